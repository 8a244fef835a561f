//! The HTTP server: one thread, on the loopback address, with limits on everything that a client
//! may send.

use super::{Shared, routes};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::io;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::Semaphore;

/// Most simultaneous connections; further ones are closed.
const CLIENTS: usize = 32;
/// Largest head of a request, bytes.
const HEAD: usize = 16 * 1024;
/// Time limit for a request's head.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// Interval of the checks of `stop`.
const LOOK: Duration = Duration::from_millis(100);

/// Serves until `stop`.
///
/// # Errors
/// The listener fails.
pub fn serve(listener: TcpListener, shared: Shared, stop: &AtomicBool) -> io::Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        listener.set_nonblocking(true)?;
        let listener = tokio::net::TcpListener::from_std(listener)?;
        let shared = Arc::new(shared);
        let router = routes::router(shared.clone());
        let clients = Arc::new(Semaphore::new(CLIENTS));
        while !stop.load(Ordering::Relaxed) {
            shared.end_lease();
            let Ok(accepted) = tokio::time::timeout(LOOK, listener.accept()).await else { continue };
            let (stream, _) = match accepted {
                Ok(accepted) => accepted,
                Err(error) => {
                    // out of file descriptors, or the client has disconnected: the server continues
                    log::debug!("a client could not be accepted: {error}");
                    tokio::time::sleep(LOOK).await;
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
