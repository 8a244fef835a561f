//! Updates over a WebSocket, whose first message is the token. A page requests the sample stream
//! and reports how many of its frames it has received; at most [`UNREAD`] frames are under way,
//! however large the buffers in between are.

use super::Shared;
use crate::live::frames::Looker;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use serde::Deserialize;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{Instant, timeout, timeout_at};

/// Largest message from a page, bytes.
const MESSAGE: usize = 4 * 1024;

/// Time limit for the token.
const TOKEN_TIME: Duration = Duration::from_secs(2);

/// A page that is silent for this long is disconnected; it reconnects.
const SILENT: Duration = Duration::from_secs(10);

/// Most frames under way to a page.
const UNREAD: u64 = 3;

/// First message of a page.
#[derive(Deserialize)]
struct Hello {
    token: String,
    /// Number of the last message received; `None` for the complete state.
    after: Option<u64>,
    /// Whether it requests the stream.
    #[serde(default)]
    stream: bool,
}

/// Later messages of a page; each one is also a sign of life.
#[derive(Deserialize)]
struct Word {
    /// Frames received since it connected.
    frames: Option<u64>,
    /// Whether it requests the stream from now on.
    stream: Option<bool>,
}

/// The sample stream for one page.
struct Stream {
    /// Present while the page requests the stream.
    looker: Option<Looker>,
    sent: u64,
    had: u64,
    /// Number of the last frame that was sent or skipped.
    at: u64,
    missed: u32,
}

/// Opens the WebSocket.
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
    let (mut after, mut last_contact) = (hello.after, Instant::now());
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
            said = timeout_at(last_contact + SILENT, socket.recv()) => match said {
                Ok(Some(Ok(Message::Close(_)) | Err(_)) | None) | Err(_) => return,
                Ok(Some(Ok(message))) => {
                    last_contact = Instant::now();
                    if let Message::Text(text) = message && let Ok(word) = serde_json::from_str::<Word>(&text) {
                        stream.hear(&shared, &word);
                    }
                }
            },
        }
    }
}

/// Sends a message. A page that does not read it in time is disconnected; it gets what it missed
/// when it reconnects.
async fn send(socket: &mut WebSocket, message: Message) -> bool {
    matches!(timeout(SILENT, socket.send(message)).await, Ok(Ok(())))
}

impl Stream {
    fn want(&mut self, shared: &Shared, wants: bool) {
        if !wants {
            self.looker = None;
        } else if self.looker.is_none() {
            // frames that came while it did not request the stream do not count as missed
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

    /// The next frame, if the page requests one and there is one.
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
