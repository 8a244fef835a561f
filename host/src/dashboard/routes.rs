//! Routes of the server and their handlers; among them the updates over a WebSocket, whose first
//! message is the token. A page requests the sample stream and reports how many of its frames it
//! has received; at most [`UNREAD`] frames are under way, however large the buffers in between are.

use super::guard::{Refusal, from_here, token};
use super::{Problem, Shared, edit, page};
use crate::analyse;
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::live::frames::Looker;
use crate::live::numbers::drawn;
use crate::live::{figures, numbers};
use crate::report::figure::Figure;
use crate::report::{self, figure};
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{DefaultBodyLimit, Path, Query, Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router};
use serde::Deserialize;
use serde_json::json;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{Instant, timeout, timeout_at};

/// Permissions of our page: run our script, use our style sheet, and send requests to this server.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data: blob:; \
    frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// Largest body of a request for a change, bytes.
const BODY: usize = 8 * 1024;

/// All routes.
pub fn router(shared: Arc<Shared>) -> Router {
    let data = Router::new()
        .route("/api/state", get(state))
        .route("/api/figures/{name}", get(of_campaign))
        .route("/api/{of}/{id}/{name}", get(of_one))
        .route("/api/matrix", get(matrix))
        .route("/api/now/shaker", get(of_shaker))
        .route("/api/wear", get(of_wear))
        .route("/api/log", get(log))
        .layer(from_fn_with_state(shared.clone(), with_token));
    let edits = edit::routes()
        .layer(DefaultBodyLimit::max(BODY))
        .layer(from_fn_with_state(shared.clone(), with_edit_token));
    Router::new()
        .route("/", get(async || ([(header::CONTENT_TYPE, "text/html; charset=utf-8")], page::HTML)))
        .route(
            "/live.css",
            get(async || ([(header::CONTENT_TYPE, "text/css; charset=utf-8")], page::style())),
        )
        .route(
            "/live.js",
            get(async || ([(header::CONTENT_TYPE, "text/javascript; charset=utf-8")], page::script())),
        )
        .route("/socket", get(socket))
        .merge(data)
        .merge(edits)
        .fallback(async || Problem::missing("there is no such page"))
        .layer(from_fn_with_state(shared.clone(), guarded))
        .with_state(shared)
}

impl Shared {
    /// Opens the campaign file read-only.
    fn store(&self) -> Result<Store, Problem> {
        let file = self.file.as_deref().ok_or_else(|| Problem::missing("no campaign is measured here"))?;
        Ok(Store::open_read_only(file)?)
    }
}

async fn guarded(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let mut response = match from_here(request.headers(), shared.port) {
        Ok(()) => next.run(request).await,
        Err(refusal) => Problem::from(refusal).into_response(),
    };
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CACHE_CONTROL, "no-store"),
    ] {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response.headers_mut().insert("cross-origin-resource-policy", HeaderValue::from_static("same-origin"));
    response
}

async fn with_token(
    State(shared): State<Arc<Shared>>,
    request: Request,
    next: Next,
) -> Result<Response, Problem> {
    if !shared.may_look(token(request.headers())?) {
        return Err(Refusal::Token.into());
    }
    Ok(next.run(request).await)
}

async fn with_edit_token(
    State(shared): State<Arc<Shared>>,
    request: Request,
    next: Next,
) -> Result<Response, Problem> {
    let given = token(request.headers())?;
    if !shared.edit.as_ref().is_some_and(|edit| edit.is(given)) {
        let refusal = if shared.look.is(given) { Refusal::LooksOnly } else { Refusal::Token };
        return Err(refusal.into());
    }
    Ok(next.run(request).await)
}

async fn state(State(shared): State<Arc<Shared>>) -> Response {
    let whole = shared
        .bus
        .since(None)
        .into_iter()
        .next()
        .map_or_else(String::new, |message| message.text.to_string());
    ([(header::CONTENT_TYPE, "application/json")], whole).into_response()
}

/// Responds with a figure as JSON.
fn sent(text: Option<String>) -> Result<Response, Problem> {
    let text = text.ok_or_else(|| Problem::missing("there are no data for this figure yet"))?;
    Ok(([(header::CONTENT_TYPE, "application/json")], text).into_response())
}

async fn of_campaign(
    State(shared): State<Arc<Shared>>,
    Path(name): Path<String>,
) -> Result<Response, Problem> {
    sent(shared.formed.found().figures.get(&name).cloned())
}

/// The shaker's current level.
async fn of_shaker(State(shared): State<Arc<Shared>>) -> Result<Response, Problem> {
    let figure = shared.bus.shaker().as_ref().and_then(figures::shaker);
    let simulated = shared.bus.simulated();
    let from = figure::Source {
        file: shared.file.as_ref().map(|file| file.display().to_string()).unwrap_or_default(),
        simulated,
        version: env!("CARGO_PKG_VERSION").into(),
        ..figure::Source::default()
    };
    sent(figure.map(|figure| drawn(&Figure { from, ..figure })))
}

/// The wear runs along their cycles, from the current content of the file.
async fn of_wear(State(shared): State<Arc<Shared>>) -> Result<Response, Problem> {
    made(move || {
        let store = shared.store()?;
        Ok(from_file(report::wear_figure(&analyse::wear::curve(&store)?), &store, None)?)
    })
    .await
}

/// Figures of a record or a cell, from the current content of the file.
async fn of_one(
    State(shared): State<Arc<Shared>>,
    Path((of, id, name)): Path<(String, i64, String)>,
) -> Result<Response, Problem> {
    made(move || one(&shared, &of, id, &name)).await
}

/// Responds with a figure that is made on a separate thread: a cell's spectra take long, and other
/// messages must not wait for them.
async fn made(
    make: impl FnOnce() -> Result<Option<Figure>, Problem> + Send + 'static,
) -> Result<Response, Problem> {
    let made = tokio::task::spawn_blocking(make).await;
    let broken =
        |_| Problem::new(StatusCode::INTERNAL_SERVER_ERROR, "the figure could not be made", "report this");
    sent(made.map_err(broken)??.as_ref().map(drawn))
}

fn one(shared: &Shared, of: &str, id: i64, name: &str) -> Result<Option<Figure>, Problem> {
    let store = shared.store()?;
    let (figure, record) = match (of, name) {
        ("records", "hit") => (figures::hit(&store, id)?, Some(id)),
        ("records", "channels") => (figures::channels(&store, id)?, Some(id)),
        ("records", "force") => (figures::force(&store, id)?, Some(id)),
        ("cells", "frf") => (figures::frf(&shared.averages, &store, id)?, None),
        ("cells", "hits") => (figures::cell(&store, id)?, None),
        ("cells", "place") => (figures::place(&store, id)?, None),
        _ => {
            let what = "records have the figures hit, force and channels, cells have hits, frf and place";
            return Err(Problem::missing(what));
        }
    };
    Ok(from_file(figure, &store, record)?)
}

/// Numbers of every cell for each view of the matrix.
async fn matrix(State(shared): State<Arc<Shared>>) -> Result<Response, Problem> {
    let store = shared.store()?;
    let numbers = numbers::of_cells(
        &store.cells()?,
        &store.rows()?,
        &store.records()?,
        shared.formed.found().cells.as_ref(),
    );
    Ok(Json(numbers).into_response())
}

/// The figure with its source.
fn from_file(
    figure: Option<Figure>,
    store: &Store,
    record: Option<i64>,
) -> Result<Option<Figure>, StoreError> {
    let Some(mut figure) = figure else { return Ok(None) };
    figure.from = figure::Source {
        records: record.map(|record| [record; 2]).into_iter().collect(),
        file: store.path().display().to_string(),
        simulated: store.is_simulated()?,
        version: env!("CARGO_PKG_VERSION").into(),
    };
    Ok(Some(figure))
}

#[derive(Deserialize)]
struct After {
    after: Option<i64>,
}

async fn log(State(shared): State<Arc<Shared>>, Query(asked): Query<After>) -> Result<Response, Problem> {
    let store = shared.store()?;
    let lines = store.log_lines(asked.after.unwrap_or(0))?;
    let lines: Vec<_> =
        lines.iter().map(|(id, utc, text)| json!({ "id": id, "utc": utc, "text": text })).collect();
    Ok(Json(lines).into_response())
}

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
