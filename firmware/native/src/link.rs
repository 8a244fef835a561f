//! The two ends of an in-process link: bytes to the device, bytes to the host.
//!
//! The device's end is asynchronous and wakes its executor; the host's end blocks with a timeout,
//! as a serial port does. Closing either end closes both. The host is woken when several packets
//! have accumulated or when the device is idle, so that a fast device does not wake it for every
//! frame.

use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, PoisonError};
use std::task::{Poll, Waker};
use std::time::{Duration, Instant};

use jointrig_firmware::board::{ByteSink, ByteSource};

use crate::executor::Woken;
use crate::sync::{Condvar, Mutex, MutexGuard};

/// Maximum number of bytes queued for the host: beyond it the device's link stalls, as a real one
/// would.
const TO_HOST_BYTES: usize = 1 << 20;
/// Maximum number of bytes queued for the device; a host that writes more must wait.
const TO_DEVICE_BYTES: usize = 1 << 16;
/// Number of bytes at which a sleeping host is woken.
const WORTH_WAKING_BYTES: usize = 16 << 10;

#[derive(Default)]
struct Pipes {
    to_device: VecDeque<u8>,
    to_host: VecDeque<u8>,
    reader: Option<Waker>,
    writer: Option<Waker>,
    host_waits: bool,
    /// The link was cut, and the device has not been notified yet.
    cut: bool,
    closed: bool,
}

#[derive(Default)]
struct Shared {
    pipes: Mutex<Pipes>,
    host: Condvar,
    device: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Pipes> {
        // the byte queue is valid even after a panic in another thread
        self.pipes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn close(&self) {
        let wakers = {
            let mut pipes = self.lock();
            pipes.closed = true;
            [pipes.reader.take(), pipes.writer.take()]
        };
        wakers.into_iter().flatten().for_each(Waker::wake);
        self.host.notify_all();
        self.device.notify_all();
    }
}

/// The host's end.
pub struct HostEnd(Arc<Shared>);

/// The device's end.
#[derive(Clone)]
pub struct DeviceEnd(Arc<Shared>);

/// A new link.
pub fn pair() -> (HostEnd, DeviceEnd) {
    let shared = Arc::new(Shared::default());
    (HostEnd(Arc::clone(&shared)), DeviceEnd(shared))
}

fn gone() -> io::Error {
    io::Error::new(io::ErrorKind::BrokenPipe, "the device has stopped")
}

impl HostEnd {
    /// Reads the available bytes, waiting up to `timeout` for the first; 0 when none came.
    ///
    /// # Errors
    /// [`io::ErrorKind::BrokenPipe`] when the device has stopped and nothing is left to read.
    pub fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let until = Instant::now() + timeout;
        let mut pipes = self.0.lock();
        loop {
            if !pipes.to_host.is_empty() {
                let count = io::Read::read(&mut pipes.to_host, buffer)?;
                let waker = pipes.writer.take();
                drop(pipes);
                if let Some(waker) = waker {
                    waker.wake();
                    drop(self.0.lock());
                    self.0.device.notify_one();
                }
                return Ok(count);
            }
            if pipes.closed {
                return Err(gone());
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(0);
            }
            pipes.host_waits = true;
            pipes = self.0.host.wait_timeout(pipes, left).unwrap_or_else(PoisonError::into_inner).0;
            pipes.host_waits = false;
        }
    }

    /// Writes all bytes.
    ///
    /// # Errors
    /// [`io::ErrorKind::BrokenPipe`] when the device has stopped; [`io::ErrorKind::WouldBlock`]
    /// when the queue is full because the device has not read for too long.
    pub fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        let waker = {
            let mut pipes = self.0.lock();
            if pipes.closed {
                return Err(gone());
            }
            if pipes.to_device.len() + bytes.len() > TO_DEVICE_BYTES {
                return Err(io::Error::new(io::ErrorKind::WouldBlock, "the device does not read"));
            }
            pipes.to_device.extend(bytes);
            pipes.reader.take()
        };
        if let Some(waker) = waker {
            waker.wake();
        }
        // the device checks its flag under this lock before it sleeps
        drop(self.0.lock());
        self.0.device.notify_one();
        Ok(())
    }

    /// Cuts the link, as when the cable is pulled or the host's program ends: bytes that the device
    /// has not read are lost, and it is notified. This end then serves the next host.
    pub fn cut(&mut self) {
        let waker = {
            let mut pipes = self.0.lock();
            pipes.to_device.clear();
            pipes.cut = true;
            pipes.reader.take()
        };
        if let Some(waker) = waker {
            waker.wake();
        }
        // the device checks its flag under this lock before it sleeps
        drop(self.0.lock());
        self.0.device.notify_one();
    }
}

impl Drop for HostEnd {
    fn drop(&mut self) {
        self.0.close();
    }
}

impl DeviceEnd {
    /// Closes the link: the host reads what is left, then gets an error that the device is gone.
    pub fn close(&self) {
        self.0.close();
    }

    /// Whether the link was closed.
    pub fn is_closed(&self) -> bool {
        self.0.lock().closed
    }

    /// Sleeps until a task of the device is woken or the link is closed.
    pub fn sleep(&self, woken: &Woken) {
        let mut pipes = self.0.lock();
        if !pipes.to_host.is_empty() {
            self.0.host.notify_one();
        }
        while !woken.peek() && !pipes.closed {
            pipes = self.0.device.wait(pipes).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Sleeps as [`DeviceEnd::sleep`] does, for `longest` at most.
    pub fn sleep_for(&self, woken: &Woken, longest: Duration) {
        let pipes = self.0.lock();
        if !pipes.to_host.is_empty() {
            self.0.host.notify_one();
        }
        if !woken.peek() && !pipes.closed {
            // woken early for no reason, the caller comes again
            drop(self.0.device.wait_timeout(pipes, longest).unwrap_or_else(PoisonError::into_inner));
        }
    }

    /// Ends the device's sleep after another thread has woken one of its tasks.
    pub fn nudge(&self) {
        // the device checks its flag under this lock before it sleeps
        drop(self.0.lock());
        self.0.device.notify_one();
    }
}

impl ByteSource for DeviceEnd {
    fn read(&mut self, buffer: &mut [u8]) -> impl Future<Output = usize> {
        std::future::poll_fn(move |context| {
            let mut pipes = self.0.lock();
            if std::mem::take(&mut pipes.cut) {
                return Poll::Ready(0);
            }
            if pipes.to_device.is_empty() {
                pipes.reader = Some(context.waker().clone());
                return Poll::Pending;
            }
            // reading from a queue in memory cannot fail
            Poll::Ready(io::Read::read(&mut pipes.to_device, buffer).unwrap_or(0))
        })
    }
}

impl ByteSink for DeviceEnd {
    fn write(&mut self, frame: &[u8]) -> impl Future<Output = ()> {
        std::future::poll_fn(move |context| {
            let mut pipes = self.0.lock();
            if pipes.to_host.len() + frame.len() > TO_HOST_BYTES && !pipes.closed {
                pipes.writer = Some(context.waker().clone());
                return Poll::Pending;
            }
            pipes.to_host.extend(frame);
            if pipes.host_waits && pipes.to_host.len() >= WORTH_WAKING_BYTES {
                self.0.host.notify_one();
            }
            Poll::Ready(())
        })
    }
}
