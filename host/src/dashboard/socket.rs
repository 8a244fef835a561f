//! What is new, as it comes: a WebSocket whose first message is the token. A page that wants the stream of samples says so, and says how many of its
//! frames it has had: more than [`UNREAD`] that it has not had are never under way, whatever buffers lie between.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use serde::Deserialize;
use tokio::time::{Instant, timeout, timeout_at};

use super::Shared;
use crate::live::frames::Looker;

/// Bytes of a message from a page.
const MESSAGE: usize = 4 * 1024;
/// Time for the token.
const TOKEN_TIME: Duration = Duration::from_secs(2);
/// A page that is silent for so long is let go; it reconnects.
const SILENT: Duration = Duration::from_secs(10);
/// Frames that may be under way to a page.
const UNREAD: u64 = 3;

/// What a page says first.
#[derive(Deserialize)]
struct Hello {
    token: String,
    /// The last message that it had; none for the whole.
    after: Option<u64>,
    /// Whether it wants the stream.
    #[serde(default)]
    stream: bool,
}

/// What a page says later; every word is a sign of life.
#[derive(Deserialize)]
struct Word {
    /// Frames that it has had since it came.
    frames: Option<u64>,
    /// Whether it wants the stream from now on.
    stream: Option<bool>,
}

/// The stream as one page gets it.
struct Stream {
    /// As long as it wants it.
    looker: Option<Looker>,
    sent: u64,
    had: u64,
    /// The number of the last frame that it was sent or has missed.
    at: u64,
    missed: u32,
}

/// Opens it.
pub async fn socket(State(shared): State<Arc<Shared>>, upgrade: WebSocketUpgrade) -> Response {
    upgrade.max_message_size(MESSAGE).max_frame_size(MESSAGE).on_upgrade(move |socket| talk(socket, shared))
}

async fn talk(mut socket: WebSocket, shared: Arc<Shared>) {
    let first = timeout(TOKEN_TIME, socket.recv()).await;
    let Ok(Some(Ok(Message::Text(text)))) = first else { return };
    let Ok(hello) = serde_json::from_str::<Hello>(&text) else { return };
    if !shared.may_look(&hello.token) {
        return;
    }
    let (mut newest, mut frames) = (shared.bus.newest(), shared.frames.newest());
    let mut stream = Stream { looker: None, sent: 0, had: 0, at: *frames.borrow(), missed: 0 };
    stream.want(&shared, hello.stream);
    let (mut after, mut heard) = (hello.after, Instant::now());
    loop {
        newest.mark_unchanged();
        for message in shared.bus.since(after) {
            if !send(&mut socket, Message::Text((&*message.text).into())).await {
                return;
            }
            after = Some(message.seq);
        }
        frames.mark_unchanged();
        while let Some(frame) = stream.next(&shared) {
            if !send(&mut socket, Message::Binary(frame.into())).await {
                return;
            }
        }
        tokio::select! {
            changed = newest.changed() => if changed.is_err() { return },
            changed = frames.changed(), if stream.ready() => if changed.is_err() { return },
            said = timeout_at(heard + SILENT, socket.recv()) => match said {
                Ok(Some(Ok(Message::Close(_)) | Err(_)) | None) | Err(_) => return,
                Ok(Some(Ok(message))) => {
                    heard = Instant::now();
                    if let Message::Text(text) = message && let Ok(word) = serde_json::from_str::<Word>(&text) {
                        stream.hear(&shared, &word);
                    }
                }
            },
        }
    }
}

/// Who does not read is let go: what it missed, it gets when it comes back.
async fn send(socket: &mut WebSocket, message: Message) -> bool {
    matches!(timeout(SILENT, socket.send(message)).await, Ok(Ok(())))
}

impl Stream {
    fn want(&mut self, shared: &Shared, wants: bool) {
        if !wants {
            self.looker = None;
        } else if self.looker.is_none() {
            // what came while it did not look is not missed
            self.at = *shared.frames.newest().borrow();
            self.looker = Some(shared.frames.look());
        }
    }

    fn hear(&mut self, shared: &Shared, word: &Word) {
        if let Some(had) = word.frames {
            self.had = had.clamp(self.had, self.sent);
        }
        if let Some(wants) = word.stream {
            self.want(shared, wants);
        }
    }

    fn ready(&self) -> bool {
        self.looker.is_some() && self.sent - self.had < UNREAD
    }

    /// The next frame, if the page wants one and there is one.
    fn next(&mut self, shared: &Shared) -> Option<Vec<u8>> {
        if !self.ready() {
            return None;
        }
        let (number, frame) = shared.frames.after(self.at, self.missed)?;
        self.missed = self.missed.saturating_add(u32::try_from(number - self.at - 1).unwrap_or(u32::MAX));
        (self.at, self.sent) = (number, self.sent + 1);
        Some(frame)
    }
}
