//! No wake-up is lost, in any interleaving of the device's thread and the host's. Every
//! interleaving is tried:
//!
//!     RUSTFLAGS="--cfg every_order" cargo test --release -p jointrig-native --test wakes
//!     --target-dir target/loom
//!
//! Without that flag this file is empty.
#![cfg(every_order)]
#![allow(clippy::unwrap_used)]

use std::future::Future;
use std::pin::pin;
use std::sync::Arc;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use jointrig_firmware::board::{ByteSink, ByteSource};
use jointrig_native::executor::Woken;
use jointrig_native::link::{DeviceEnd, pair};
use loom::thread;

/// Polls as the board's thread does, until the future is ready or the link is closed.
fn driven<T>(link: &DeviceEnd, woken: &Arc<Woken>, future: impl Future<Output = T>) -> Option<T> {
    let waker = Waker::from(Arc::clone(woken));
    let mut future = pin!(future);
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut Context::from_waker(&waker)) {
            return Some(value);
        }
        link.sleep(woken);
        if !woken.take() && link.is_closed() {
            return None;
        }
    }
}

#[test]
fn a_byte_from_the_host_wakes_the_device() {
    loom::model(|| {
        let (mut host, mut device) = pair();
        let board = thread::spawn(move || {
            let woken = Arc::new(Woken::default());
            let sleeper = device.clone();
            let mut bytes = [0; 4];
            driven(&sleeper, &woken, device.read(&mut bytes)).map(|count| bytes[..count].to_vec())
        });
        host.write_all(&[7]).unwrap();
        assert_eq!(board.join().unwrap(), Some(vec![7]));
    });
}

#[test]
fn a_cut_and_a_close_wake_the_device() {
    loom::model(|| {
        let (mut host, mut device) = pair();
        let board = thread::spawn(move || {
            let woken = Arc::new(Woken::default());
            let sleeper = device.clone();
            let mut bytes = [0; 4];
            driven(&sleeper, &woken, device.read(&mut bytes))
        });
        host.cut();
        assert_eq!(board.join().unwrap(), Some(0));
    });
    loom::model(|| {
        let (host, mut device) = pair();
        let board = thread::spawn(move || {
            let woken = Arc::new(Woken::default());
            let sleeper = device.clone();
            let mut bytes = [0; 4];
            driven(&sleeper, &woken, device.read(&mut bytes))
        });
        drop(host);
        assert_eq!(board.join().unwrap(), None);
    });
}

#[test]
fn a_frame_reaches_a_host_that_waits() {
    loom::model(|| {
        let (mut host, mut device) = pair();
        let board = thread::spawn(move || {
            let woken = Arc::new(Woken::default());
            let sleeper = device.clone();
            driven(&sleeper, &woken, device.write(&[9])).unwrap();
            // nothing more to do: the board's thread sleeps until the host ends
            sleeper.sleep(&woken);
        });
        let mut bytes = [0; 4];
        // the model has no time: a host that is not woken waits forever, which the model checker
        // reports
        let count = host.read(&mut bytes, Duration::from_secs(3600)).unwrap();
        assert_eq!(bytes[..count], [9]);
        drop(host);
        board.join().unwrap();
    });
}
