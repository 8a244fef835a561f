//! The live page: a campaign file in the browser while it is measured, and the way through it afterwards.
//!
//! It looks and does nothing else: no page arms the hammer, moves the shaker or writes into the file. `server` speaks HTTP on the loopback
//! address alone, `guard` turns away whoever should not ask, `routes` answers, `socket` says what is new, `page` is what the browser gets.
//! All of them read what [`crate::live`] has to say, on threads of their own: a page that stalls costs nothing but its own picture.

mod guard;
mod page;
mod routes;
mod server;
mod socket;

use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::campaign::store::error::StoreError;
use crate::device::tap::{Tap, View, tap};
use crate::live::bus::Bus;
use crate::live::eye::{Ear, Eye, eye};
use crate::live::follow::Follower;
use crate::live::forming::{Formed, form};
use crate::live::frames::Frames;
use crate::live::message::{Can, Message, Trouble};
use crate::live::watching::Watching;
use guard::Token;

/// How often the file is asked whether it has changed: a question to the operating system, a few microseconds.
const LOOK: Duration = Duration::from_millis(50);

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum DashboardError {
    /// The campaign file.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The port.
    #[error(
        "the page cannot be served on 127.0.0.1:{port}: {source}; choose another port with --port, or 0 for any"
    )]
    Port {
        /// The one asked for.
        port: u16,
        /// What the operating system said.
        source: io::Error,
    },
    /// Threads or random numbers.
    #[error("the page cannot be served: {0}")]
    System(io::Error),
}

/// What every part of the server shares.
struct Shared {
    file: Option<PathBuf>,
    port: u16,
    /// That of looking.
    look: Token,
    bus: Arc<Bus>,
    formed: Arc<Formed>,
    frames: Arc<Frames>,
}

impl Shared {
    /// Whether this is a token of somebody who may look.
    fn may_look(&self, token: &str) -> bool {
        self.look.is(token)
    }
}

/// What the measuring process hangs on its session and its runner, so that a page sees what is going on.
pub struct Hooks {
    /// For the stream.
    pub tap: Tap,
    /// For the runner.
    pub eye: Arc<Eye>,
}

/// A page that is served as long as this lives.
pub struct Dashboard {
    address: SocketAddr,
    look: Token,
    stop: Arc<AtomicBool>,
    server: Option<JoinHandle<()>>,
}

impl Dashboard {
    /// Serves the page of a campaign file on the loopback address; port 0 takes a free one. It looks and does nothing else.
    ///
    /// # Errors
    /// The file cannot be read, or the port cannot be had.
    pub fn of_file(file: &Path, port: u16) -> Result<Self, DashboardError> {
        Self::start(Some(file), port, None)
    }

    /// Serves the page of a process that measures into `file`, or into none.
    ///
    /// # Errors
    /// The file cannot be read, or the port cannot be had.
    pub fn of_measuring(file: Option<&Path>, port: u16) -> Result<(Self, Hooks), DashboardError> {
        let ((eye, ear), (tap, view)) = (eye(), tap());
        let dashboard = Self::start(file, port, Some((ear, view)))?;
        Ok((dashboard, Hooks { tap, eye: Arc::new(eye) }))
    }

    fn start(file: Option<&Path>, port: u16, measuring: Option<(Ear, View)>) -> Result<Self, DashboardError> {
        let mut follower = file.map(Follower::new).transpose()?;
        let listener = std::net::TcpListener::bind(("127.0.0.1", port))
            .map_err(|source| DashboardError::Port { port, source })?;
        let address = listener.local_addr().map_err(DashboardError::System)?;
        let look = Token::random().map_err(DashboardError::System)?;
        let can = Can { stream: measuring.is_some(), ..Can::default() };
        let (bus, formed, stop, frames) = (
            Arc::new(Bus::new(can)),
            Arc::<Formed>::default(),
            Arc::<AtomicBool>::default(),
            Arc::<Frames>::default(),
        );
        bus.say(Message::Snapshot(Box::new(follower.as_ref().map(Follower::whole).unwrap_or_default())));

        if let Some(mut follower) = follower.take() {
            let (to, ended) = (bus.clone(), stop.clone());
            named("page: file", move || watch(&mut follower, &to, &ended))?;
        }
        if let Some(path) = file.map(Path::to_owned) {
            let (to, shown, ended) = (bus.clone(), formed.clone(), stop.clone());
            named("page: estimate", move || form(&path, &to, &shown, &ended))?;
        }
        if let Some((ear, view)) = measuring {
            let (bus, frames, file) = (bus.clone(), frames.clone(), file.map(Path::to_owned));
            let (watching, ended) = (Watching { ear, view, bus, frames, file }, stop.clone());
            named("page: stream", move || watching.watch(&ended))?;
        }
        let file = file.map(Path::to_owned);
        let shared = Shared { file, port: address.port(), look: look.clone(), bus, formed, frames };
        let ended = stop.clone();
        let server = named("page: server", move || {
            if let Err(error) = server::serve(listener, shared, &ended) {
                log::error!("the page is not served any more: {error}");
            }
        })?;
        Ok(Self { address, look, stop, server: Some(server) })
    }

    /// The address to look at. The secret stands behind the `#`, which a browser sends nowhere.
    pub fn url(&self) -> String {
        format!("http://{}/#look={}", self.address, self.look.as_str())
    }
}

impl Drop for Dashboard {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // the server lets its clients go within moments; an analysis under way holds nothing and is not waited for
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

/// Says what is new in the file, until `stop`.
fn watch(follower: &mut Follower, bus: &Bus, stop: &AtomicBool) {
    let mut trouble = None;
    while !stop.load(Ordering::Relaxed) {
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
        std::thread::sleep(LOOK);
    }
}
