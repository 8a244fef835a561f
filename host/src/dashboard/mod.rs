//! The live page: a campaign file in the browser while it is measured, and the way through it afterwards.
//!
//! No page arms the hammer or moves the shaker. `server` speaks HTTP on the loopback address alone, `guard` turns away whoever should not ask,
//! `routes` answers, `edit` hands over what a page wants changed, `socket` says what is new, `page` is what the browser gets.
//! All of them read what [`crate::live`] has to say, on threads of their own: a page that stalls costs nothing but its own picture.

mod edit;
mod guard;
mod page;
mod problem;
mod routes;
mod server;
mod socket;

use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::campaign::run::answers::{Answers, answers};
use crate::campaign::run::edits::{Edits, edits};
use crate::campaign::store::error::StoreError;
use crate::device::tap::{Tap, View, tap};
use crate::live::averaging::Averages;
use crate::live::bus::Bus;
use crate::live::eye::{Ear, Eye, eye};
use crate::live::follow::Follower;
use crate::live::forming::{Formed, form};
use crate::live::frames::Frames;
use crate::live::message::{Can, Message, Trouble};
use crate::live::watching::Watching;
use edit::Doors;
use guard::Token;

/// How often the file is asked whether it has changed: a question to the operating system, a few microseconds.
const LOOK: Duration = Duration::from_millis(50);
/// Time for the last word to reach the pages.
const LAST_WORD: Duration = Duration::from_millis(300);

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
    /// That of editing, where there is something to edit.
    edit: Option<Token>,
    /// What the measuring process lets pages do.
    doors: Option<Doors>,
    bus: Arc<Bus>,
    formed: Arc<Formed>,
    /// The FRF of the cell that is measured.
    averages: Averages,
    frames: Arc<Frames>,
}

impl Shared {
    /// Whether this is a token of somebody who may look.
    fn may_look(&self, token: &str) -> bool {
        self.look.is(token) || self.edit.as_ref().is_some_and(|edit| edit.is(token))
    }
}

/// What the measuring process hangs on its session and its runner, so that a page sees what is going on.
pub struct Hooks {
    /// For the stream.
    pub tap: Tap,
    /// For the runner.
    pub eye: Arc<Eye>,
    /// What pages want changed, for whoever writes the campaign file.
    pub edits: Option<Edits>,
    /// What a page answers for hammer and laser.
    pub answers: Option<Answers>,
}

/// What a measuring process lets its pages see and do.
#[derive(Debug)]
pub struct Measuring<'a> {
    /// The campaign file; none where only channels are looked at.
    pub file: Option<&'a Path>,
    /// Set by a page to end after the shot in hand.
    pub stop: Arc<AtomicBool>,
    /// Whether a page may answer for hammer and laser.
    pub control: bool,
}

/// A page that is served as long as this lives.
pub struct Dashboard {
    address: SocketAddr,
    look: Token,
    edit: Option<Token>,
    /// Ends those who tell; then the server.
    over: Arc<AtomicBool>,
    gone: Arc<AtomicBool>,
    bus: Arc<Bus>,
    tellers: Vec<JoinHandle<()>>,
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

    /// Serves the page of a process that measures.
    ///
    /// # Errors
    /// The file cannot be read, or the port cannot be had.
    pub fn of_measuring(measuring: &Measuring<'_>, port: u16) -> Result<(Self, Hooks), DashboardError> {
        let ((eye, ear), (tap, view)) = (eye(), tap());
        let (desk, edits) = measuring.file.map(|_| edits()).unzip();
        let (answerer, answers) = measuring.control.then(|| answers(measuring.stop.clone())).unzip();
        let doors = Doors { desk, answerer, stop: measuring.stop.clone(), lease: Mutex::default() };
        let dashboard = Self::start(measuring.file, port, Some((ear, view, doors)))?;
        Ok((dashboard, Hooks { tap, eye: Arc::new(eye), edits, answers }))
    }

    fn start(
        file: Option<&Path>,
        port: u16,
        measuring: Option<(Ear, View, Doors)>,
    ) -> Result<Self, DashboardError> {
        let mut follower = file.map(Follower::new).transpose()?;
        let listener = std::net::TcpListener::bind(("127.0.0.1", port))
            .map_err(|source| DashboardError::Port { port, source })?;
        let address = listener.local_addr().map_err(DashboardError::System)?;
        let look = Token::random().map_err(DashboardError::System)?;
        let (seen, doors) = measuring.map(|(ear, view, doors)| ((ear, view), doors)).unzip();
        let can = Can {
            stream: seen.is_some(),
            edit: doors.as_ref().is_some_and(|doors| doors.desk.is_some()),
            control: doors.as_ref().is_some_and(|doors| doors.answerer.is_some()),
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
            // an analysis under way holds nothing and is not waited for
            let (to, shown, ended) = (bus.clone(), formed.clone(), over.clone());
            named("page: estimate", move || form(&path, &to, &shown, &ended))?;
        }
        if let Some((ear, view)) = seen {
            let (bus, frames, file) = (bus.clone(), frames.clone(), file.map(Path::to_owned));
            let (watching, ended) = (Watching { ear, view, bus, frames, file }, over.clone());
            tellers.push(named("page: stream", move || watching.watch(&ended))?);
        }
        let file = file.map(Path::to_owned);
        let told = bus.clone();
        let (port, look_token, edit_token) = (address.port(), look.clone(), edit.clone());
        let averages = Averages::default();
        let shared =
            Shared { file, port, look: look_token, edit: edit_token, doors, bus, formed, averages, frames };
        let ended = gone.clone();
        let server = named("page: server", move || {
            if let Err(error) = server::serve(listener, shared, &ended) {
                log::error!("the page is not served any more: {error}");
            }
        })?;
        Ok(Self { address, look, edit, over, gone, bus: told, tellers, server: Some(server) })
    }

    /// The address to edit with: notes, keep, drop, and the end after the shot in hand. None where nothing is measured.
    pub fn edit_url(&self) -> Option<String> {
        self.edit.as_ref().map(|edit| format!("http://{}/#edit={}", self.address, edit.as_str()))
    }

    /// The address to look at. The secret stands behind the `#`, which a browser sends nowhere.
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
        // the last word of a campaign is the one that is waited for
        if self.bus.is_heard() {
            std::thread::sleep(LAST_WORD);
        }
        self.gone.store(true, Ordering::Relaxed);
        // the server lets its clients go within moments
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
    loop {
        // what was stored before the end is told
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
