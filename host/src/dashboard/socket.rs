//! What is new, as it comes: a WebSocket whose first message is the token.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use serde::Deserialize;
use tokio::time::{Instant, timeout, timeout_at};

use super::Shared;

/// Bytes of a message from a page.
const MESSAGE: usize = 4 * 1024;
/// Time for the token.
const TOKEN_TIME: Duration = Duration::from_secs(2);
/// A page that is silent for so long is let go; it reconnects.
const SILENT: Duration = Duration::from_secs(10);

/// What a page says first.
#[derive(Deserialize)]
struct Hello {
    token: String,
    /// The last message that it had; none for the whole.
    after: Option<u64>,
}

/// Opens it.
pub async fn socket(State(shared): State<Arc<Shared>>, upgrade: WebSocketUpgrade) -> Response {
    upgrade.max_message_size(MESSAGE).max_frame_size(MESSAGE).on_upgrade(move |socket| talk(socket, shared))
}

async fn talk(mut socket: WebSocket, shared: Arc<Shared>) {
    let first = timeout(TOKEN_TIME, socket.recv()).await;
    let Ok(Some(Ok(Message::Text(text)))) = first else { return };
    let Ok(hello) = serde_json::from_str::<Hello>(&text) else { return };
    if !shared.token.is(&hello.token) {
        return;
    }
    let mut newest = shared.bus.newest();
    let (mut after, mut heard) = (hello.after, Instant::now());
    loop {
        newest.mark_unchanged();
        for message in shared.bus.since(after) {
            // who does not read is let go: what it missed, it gets when it comes back
            let sent = timeout(SILENT, socket.send(Message::Text((&*message.text).into()))).await;
            if !matches!(sent, Ok(Ok(()))) {
                return;
            }
            after = Some(message.seq);
        }
        // until there is news, every word of the page is a sign of life
        loop {
            tokio::select! {
                changed = newest.changed() => match changed {
                    Ok(()) => break,
                    Err(_) => return,
                },
                said = timeout_at(heard + SILENT, socket.recv()) => match said {
                    Ok(Some(Ok(Message::Close(_)) | Err(_)) | None) | Err(_) => return,
                    Ok(Some(Ok(_))) => heard = Instant::now(),
                },
            }
        }
    }
}
