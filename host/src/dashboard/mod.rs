//! The live page: shows a campaign file in the browser during and after the measurement.
//!
//! No page arms the hammer or moves the shaker. `serve` serves HTTP on the loopback address only,
//! on one thread, with limits on everything that a client may send; `guard` rejects unauthorised
//! requests, `routes` answers requests and sends updates, `edit` passes a page's changes on,
//! `page` is the content for the browser, and an error response ([`Problem`]) says what is wrong,
//! where, and what to do. All of them use the data of [`crate::live`] and run on separate threads,
//! so that a stalled page affects only its own display.

use crate::campaign::run::answers::{Answers, Edits, answers, edits};
use crate::campaign::store::error::StoreError;
use crate::device::tap::{Tap, View, tap};
use crate::live::bus::Bus;
use crate::live::figures::Averages;
use crate::live::follow::Follower;
use crate::live::frames::Frames;
use crate::live::message::{Can, Message, Trouble};
use crate::live::numbers::{Formed, form};
use crate::live::watching::{WatchQueue, Watcher, Watching, watcher};
use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use edit::Controls;
use guard::{Refusal, Token};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use serde_json::json;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::sync::Semaphore;

mod edit;
mod guard;
mod page;
mod routes;

/// Interval of the checks for changes of the file; a check takes a few microseconds.
const LOOK: Duration = Duration::from_millis(50);
/// Time for the last message to reach the pages.
const LAST_WORD: Duration = Duration::from_millis(300);

/// Why the page cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum DashboardError {
    /// The campaign file cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The port cannot be used.
    #[error(
        "the page cannot be served on 127.0.0.1:{port}: {source}; choose another port with --port, or 0 for any"
    )]
    Port {
        /// The requested port.
        port: u16,
        /// The operating system's error.
        source: io::Error,
    },
    /// A thread could not be started, or there are no random numbers.
    #[error("the page cannot be served: {0}")]
    System(io::Error),
}

/// Data shared by all parts of the server.
struct Shared {
    file: Option<PathBuf>,
    port: u16,
    /// The token for viewing.
    look: Token,
    /// The token for editing, where editing is possible.
    edit: Option<Token>,
    /// What the measuring process lets pages do.
    controls: Option<Controls>,
    bus: Arc<Bus>,
    formed: Arc<Formed>,
    /// The average spectra of the cell that was requested last.
    averages: Averages,
    frames: Arc<Frames>,
}

impl Shared {
    /// Whether this token permits viewing.
    fn may_look(&self, token: &str) -> bool {
        self.look.is(token) || self.edit.as_ref().is_some_and(|edit| edit.is(token))
    }
}

/// The ends that the measuring process attaches to its session and its runner, so that a page shows
/// what is being done.
pub struct Hooks {
    /// For the session's stream.
    pub tap: Tap,
    /// For the runner.
    pub watcher: Arc<Watcher>,
    /// Changes requested by pages, for the thread that writes the campaign file.
    pub edits: Option<Edits>,
    /// Answers of a page to the prompts to move hammer and laser.
    pub answers: Option<Answers>,
}

/// What a measuring process lets its pages show and do.
#[derive(Debug)]
pub struct Measuring<'a> {
    /// The campaign file; `None` where only channels are shown.
    pub file: Option<&'a Path>,
    /// Set by a page to end the measurement after the current shot.
    pub stop: Arc<AtomicBool>,
    /// Whether a page may answer the prompts to move hammer and laser.
    pub control: bool,
}

/// The page; it is served for as long as this value lives.
pub struct Dashboard {
    address: SocketAddr,
    look: Token,
    edit: Option<Token>,
    /// Stops the threads that send messages, and then the server.
    over: Arc<AtomicBool>,
    gone: Arc<AtomicBool>,
    bus: Arc<Bus>,
    tellers: Vec<JoinHandle<()>>,
    server: Option<JoinHandle<()>>,
}

impl Dashboard {
    /// Serves the page of a campaign file on the loopback address for viewing only; port 0 selects
    /// a free port.
    ///
    /// # Errors
    /// The file cannot be read, or the port cannot be used.
    pub fn of_file(file: &Path, port: u16) -> Result<Self, DashboardError> {
        Self::start(Some(file), port, None)
    }

    /// Serves the page of a measuring process.
    ///
    /// # Errors
    /// The file cannot be read, or the port cannot be used.
    pub fn of_measuring(measuring: &Measuring<'_>, port: u16) -> Result<(Self, Hooks), DashboardError> {
        let ((watcher, watch_queue), (tap, view)) = (watcher(), tap());
        let (edit_queue, edits) = measuring.file.map(|_| edits()).unzip();
        let (answerer, answers) = measuring.control.then(|| answers(measuring.stop.clone())).unzip();
        let controls =
            Controls { edit_queue, answerer, stop: measuring.stop.clone(), lease: Mutex::default() };
        let dashboard = Self::start(measuring.file, port, Some((watch_queue, view, controls)))?;
        Ok((dashboard, Hooks { tap, watcher: Arc::new(watcher), edits, answers }))
    }

    fn start(
        file: Option<&Path>,
        port: u16,
        measuring: Option<(WatchQueue, View, Controls)>,
    ) -> Result<Self, DashboardError> {
        let mut follower = file.map(Follower::new).transpose()?;
        let listener = std::net::TcpListener::bind(("127.0.0.1", port))
            .map_err(|source| DashboardError::Port { port, source })?;
        let address = listener.local_addr().map_err(DashboardError::System)?;
        let look = Token::random().map_err(DashboardError::System)?;
        let (seen, controls) =
            measuring.map(|(watch_queue, view, controls)| ((watch_queue, view), controls)).unzip();
        let can = Can {
            stream: seen.is_some(),
            edit: controls.as_ref().is_some_and(|controls| controls.edit_queue.is_some()),
            control: controls.as_ref().is_some_and(|controls| controls.answerer.is_some()),
        };
        let edit = can.edit.then(Token::random).transpose().map_err(DashboardError::System)?;
        let (bus, formed, frames) =
            (Arc::new(Bus::new(can)), Arc::<Formed>::default(), Arc::<Frames>::default());
        let [over, gone] = [Arc::<AtomicBool>::default(), Arc::default()];
        let mut tellers = Vec::new();
        bus.say(Message::Snapshot(Box::new(follower.as_ref().map(Follower::whole).unwrap_or_default())));

        if let Some(mut follower) = follower.take() {
            let (to, ended) = (bus.clone(), over.clone());
            tellers.push(named("page: file", move || watch(&mut follower, &to, &ended))?);
        }
        if let Some(path) = file.map(Path::to_owned) {
            // not joined at the end: a running analysis holds no resources
            let (to, shown, ended) = (bus.clone(), formed.clone(), over.clone());
            named("page: estimate", move || form(&path, &to, &shown, &ended))?;
        }
        if let Some((watch_queue, view)) = seen {
            let (bus, frames, file) = (bus.clone(), frames.clone(), file.map(Path::to_owned));
            let (watching, ended) = (Watching { watch_queue, view, bus, frames, file }, over.clone());
            tellers.push(named("page: stream", move || watching.watch(&ended))?);
        }
        let file = file.map(Path::to_owned);
        let told = bus.clone();
        let (port, look_token, edit_token) = (address.port(), look.clone(), edit.clone());
        let averages = Averages::default();
        let shared = Shared {
            file,
            port,
            look: look_token,
            edit: edit_token,
            controls,
            bus,
            formed,
            averages,
            frames,
        };
        let ended = gone.clone();
        let server = named("page: server", move || {
            if let Err(error) = serve(listener, shared, &ended) {
                log::error!("the page is not served any more: {error}");
            }
        })?;
        Ok(Self { address, look, edit, over, gone, bus: told, tellers, server: Some(server) })
    }

    /// The address for editing: notes, keep, drop, and stop after the current shot. `None` where
    /// nothing is measured.
    pub fn edit_url(&self) -> Option<String> {
        self.edit.as_ref().map(|edit| format!("http://{}/#edit={}", self.address, edit.as_str()))
    }

    /// The address for viewing. The token follows the `#`, a part that browsers never send.
    pub fn url(&self) -> String {
        format!("http://{}/#look={}", self.address, self.look.as_str())
    }
}

impl Drop for Dashboard {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        for teller in self.tellers.drain(..) {
            if teller.join().is_err() {
                log::error!("a part of the page ended in a panic; what was measured is in the file");
            }
        }
        // wait so that the last message of a campaign reaches its listeners
        if self.bus.is_heard() {
            std::thread::sleep(LAST_WORD);
        }
        self.gone.store(true, Ordering::Relaxed);
        // the server closes its connections promptly
        if let Some(server) = self.server.take()
            && server.join().is_err()
        {
            log::error!("the page's server ended in a panic; what was measured is in the file");
        }
    }
}

fn named(name: &str, work: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>, DashboardError> {
    std::thread::Builder::new().name(name.into()).spawn(work).map_err(DashboardError::System)
}

/// Sends changes of the file until `stop`.
fn watch(follower: &mut Follower, bus: &Bus, stop: &AtomicBool) {
    let mut trouble = None;
    loop {
        // changes stored before `stop` was set are still sent
        let last = stop.load(Ordering::Relaxed);
        match follower.look() {
            Ok(messages) => {
                trouble = None;
                for message in messages {
                    bus.say(message);
                }
            }
            Err(error) => {
                let what = error.to_string();
                if trouble.as_ref() != Some(&what) {
                    bus.say(Message::Trouble(Trouble { what: what.clone() }));
                    trouble = Some(what);
                }
            }
        }
        if last {
            return;
        }
        std::thread::sleep(LOOK);
    }
}

/// Why a request could not be answered.
pub struct Problem {
    status: StatusCode,
    what: String,
    todo: &'static str,
}

impl Problem {
    /// A problem with this status.
    pub fn new(status: StatusCode, what: impl Into<String>, todo: &'static str) -> Self {
        Self { status, what: what.into(), todo }
    }

    /// A problem with status 404, not found.
    pub fn missing(what: &str) -> Self {
        Self::new(StatusCode::NOT_FOUND, what, "go back to the page")
    }
}

impl From<Refusal> for Problem {
    fn from(refusal: Refusal) -> Self {
        let [what, todo] = refusal.words();
        Self::new(refusal.status(), what, todo)
    }
}

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        Self::new(StatusCode::NOT_FOUND, error.to_string(), "look at the campaign file")
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let body =
            json!({ "error": { "what": self.what, "where": "the live page's server", "do": self.todo } });
        (self.status, Json(body)).into_response()
    }
}

/// Most simultaneous connections; further ones are closed.
const CLIENTS: usize = 32;
/// Largest head of a request, bytes.
const HEAD: usize = 16 * 1024;
/// Time limit for a request's head.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// Interval of the checks of `stop`.
const ACCEPT: Duration = Duration::from_millis(100);

/// Serves until `stop`.
///
/// # Errors
/// The listener fails.
fn serve(listener: TcpListener, shared: Shared, stop: &AtomicBool) -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        listener.set_nonblocking(true)?;
        let listener = tokio::net::TcpListener::from_std(listener)?;
        let shared = Arc::new(shared);
        let router = routes::router(shared.clone());
        let clients = Arc::new(Semaphore::new(CLIENTS));
        while !stop.load(Ordering::Relaxed) {
            shared.end_lease();
            let Ok(accepted) = tokio::time::timeout(ACCEPT, listener.accept()).await else { continue };
            let (stream, _) = match accepted {
                Ok(accepted) => accepted,
                Err(error) => {
                    // out of file descriptors, or the client has disconnected: the server continues
                    log::debug!("a client could not be accepted: {error}");
                    tokio::time::sleep(ACCEPT).await;
                    continue;
                }
            };
            let Ok(place) = clients.clone().try_acquire_owned() else {
                log::debug!("more than {CLIENTS} clients: one is rejected");
                continue;
            };
            let service = TowerToHyperService::new(router.clone());
            tokio::spawn(async move {
                let connection = hyper::server::conn::http1::Builder::new()
                    .timer(TokioTimer::new())
                    .header_read_timeout(HEAD_TIME)
                    .max_buf_size(HEAD)
                    .serve_connection(TokioIo::new(stream), service)
                    .with_upgrades();
                if let Err(error) = connection.await {
                    log::debug!("a client of the page: {error}");
                }
                drop(place);
            });
        }
        Ok(())
    })
}
