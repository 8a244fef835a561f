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
use crate::live::bus::Bus;
use crate::live::follow::Follower;
use crate::live::forming::{Formed, form};
use crate::live::message::{Message, Trouble};
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
    file: PathBuf,
    port: u16,
    token: Token,
    bus: Arc<Bus>,
    formed: Arc<Formed>,
}

/// A page that is served as long as this lives.
pub struct Dashboard {
    address: SocketAddr,
    token: Token,
    stop: Arc<AtomicBool>,
    server: Option<JoinHandle<()>>,
}

impl Dashboard {
    /// Serves the page of a campaign file on the loopback address; port 0 takes a free one.
    ///
    /// # Errors
    /// The file cannot be read, or the port cannot be had.
    pub fn start(file: &Path, port: u16) -> Result<Self, DashboardError> {
        let mut follower = Follower::new(file)?;
        let listener = std::net::TcpListener::bind(("127.0.0.1", port))
            .map_err(|source| DashboardError::Port { port, source })?;
        let address = listener.local_addr().map_err(DashboardError::System)?;
        let token = Token::random().map_err(DashboardError::System)?;
        let (bus, formed, stop) =
            (Arc::<Bus>::default(), Arc::<Formed>::default(), Arc::<AtomicBool>::default());
        bus.say(Message::Snapshot(Box::new(follower.whole())));

        let (to, ended) = (bus.clone(), stop.clone());
        named("page: file", move || watch(&mut follower, &to, &ended))?;
        let (to, shown, ended, path) = (bus.clone(), formed.clone(), stop.clone(), file.to_owned());
        named("page: estimate", move || form(&path, &to, &shown, &ended))?;
        let shared =
            Shared { file: file.to_owned(), port: address.port(), token: token.clone(), bus, formed };
        let ended = stop.clone();
        let server = named("page: server", move || {
            if let Err(error) = server::serve(listener, shared, &ended) {
                log::error!("the page is not served any more: {error}");
            }
        })?;
        Ok(Self { address, token, stop, server: Some(server) })
    }

    /// The address to look at. The secret stands behind the `#`, which a browser sends nowhere.
    pub fn url(&self) -> String {
        format!("http://{}/#look={}", self.address, self.token.as_str())
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
