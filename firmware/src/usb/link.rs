//! Frames over the two interfaces: selection of the interface, and handling of a lost bus.

use core::future::poll_fn;
use core::pin::pin;
use core::sync::atomic::{AtomicU8, Ordering};

use embassy_futures::select::{Either, Either3, select, select3};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_usb::class::cdc_acm::{Receiver, Sender};
use embassy_usb::driver::{Driver, EndpointError, EndpointIn, EndpointOut};

use crate::board::{ByteSink, ByteSource};

/// Most bytes of one packet, at any speed.
const PACKET: usize = 512;

/// One of the two interfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Vendor,
    SerialPort,
}

/// The interface chosen by the host; shared by source and sink.
pub(super) struct Choice {
    /// 0: none yet; otherwise the number of the [`Way`] plus one.
    pub(super) active: AtomicU8,
    /// Signals a change.
    pub(super) changed: Signal<CriticalSectionRawMutex, ()>,
    /// Signals that the bus was suspended.
    pub(super) suspended: Signal<CriticalSectionRawMutex, ()>,
}

impl Choice {
    fn get(&self) -> Option<Way> {
        match self.active.load(Ordering::Acquire) {
            1 => Some(Way::Vendor),
            2 => Some(Way::SerialPort),
            _ => None,
        }
    }

    fn set(&self, way: Option<Way>) {
        self.active.store(way.map_or(0, |way| way as u8 + 1), Ordering::Release);
        self.changed.signal(());
    }
}

/// A plain bulk endpoint.
pub(super) struct Bulk<E>(pub(super) E);

/// Packets from the host.
trait Incoming {
    async fn enabled(&mut self);
    async fn packet(&mut self, bytes: &mut [u8; PACKET]) -> Result<usize, EndpointError>;
}

/// Packets to the host.
trait Outgoing {
    async fn enabled(&mut self);
    async fn packet(&mut self, bytes: &[u8]) -> Result<(), EndpointError>;
    fn packet_bytes(&self) -> usize;
}

impl<E: EndpointOut> Incoming for Bulk<E> {
    async fn enabled(&mut self) {
        self.0.wait_enabled().await;
    }

    async fn packet(&mut self, bytes: &mut [u8; PACKET]) -> Result<usize, EndpointError> {
        self.0.read(bytes).await
    }
}

impl<E: EndpointIn> Outgoing for Bulk<E> {
    async fn enabled(&mut self) {
        self.0.wait_enabled().await;
    }

    async fn packet(&mut self, bytes: &[u8]) -> Result<(), EndpointError> {
        self.0.write(bytes).await
    }

    fn packet_bytes(&self) -> usize {
        usize::from(self.0.info().max_packet_size)
    }
}

impl<'d, D: Driver<'d>> Incoming for Receiver<'d, D> {
    async fn enabled(&mut self) {
        self.wait_connection().await;
    }

    async fn packet(&mut self, bytes: &mut [u8; PACKET]) -> Result<usize, EndpointError> {
        self.read_packet(bytes).await
    }
}

impl<'d, D: Driver<'d>> Outgoing for Sender<'d, D> {
    async fn enabled(&mut self) {
        self.wait_connection().await;
    }

    async fn packet(&mut self, bytes: &[u8]) -> Result<(), EndpointError> {
        self.write_packet(bytes).await
    }

    fn packet_bytes(&self) -> usize {
        usize::from(self.max_packet_size())
    }
}

/// One incoming interface: its current packet, and whether it was enabled at the last check.
struct Inlet<P> {
    pipe: P,
    enabled: bool,
    /// No read has had to wait since it was enabled.
    fresh: bool,
    bytes: [u8; PACKET],
}

impl<P: Incoming> Inlet<P> {
    fn new(pipe: P) -> Self {
        Self { pipe, enabled: false, fresh: false, bytes: [0; PACKET] }
    }

    /// The length of the next non-empty packet, or `None` once when the interface was cut. The
    /// future may be dropped while it waits: a packet is taken in one step or not at all.
    async fn next(&mut self) -> Option<usize> {
        loop {
            if !self.enabled {
                self.pipe.enabled().await;
                self.enabled = true;
                self.fresh = true;
            }
            let (fresh, mut reading) = (&mut self.fresh, pin!(self.pipe.packet(&mut self.bytes)));
            let came = poll_fn(|context| {
                let came = reading.as_mut().poll(context);
                *fresh &= came.is_ready();
                came
            });
            match came.await {
                // The packet was pending since before the cut; it must not be carried out.
                Ok(_) if self.fresh => {}
                Ok(0) => {}
                Ok(length) => return Some(length),
                Err(_) => {
                    self.enabled = false;
                    return None;
                }
            }
        }
    }
}

/// A packet that was not yet completely passed on.
#[derive(Clone, Copy)]
struct Held {
    way: Way,
    from: usize,
    to: usize,
}

/// Bytes from the host, from the interface that it uses.
pub struct Source<'d, D: Driver<'d>> {
    vendor: Inlet<Bulk<D::EndpointOut>>,
    serial_port: Inlet<Receiver<'d, D>>,
    held: Option<Held>,
    choice: &'d Choice,
}

impl<'d, D: Driver<'d>> Source<'d, D> {
    pub(super) fn new(
        vendor: Bulk<D::EndpointOut>,
        serial_port: Receiver<'d, D>,
        choice: &'d Choice,
    ) -> Self {
        Self { vendor: Inlet::new(vendor), serial_port: Inlet::new(serial_port), held: None, choice }
    }

    fn hand_over(&mut self, held: Held, buffer: &mut [u8]) -> usize {
        let bytes = match held.way {
            Way::Vendor => &self.vendor.bytes,
            Way::SerialPort => &self.serial_port.bytes,
        };
        let packet = &bytes[held.from..held.to];
        let taken = packet.len().min(buffer.len());
        buffer[..taken].copy_from_slice(&packet[..taken]);
        let rest = Held { from: held.from + taken, ..held };
        self.held = (rest.from < rest.to).then_some(rest);
        taken
    }
}

impl<'d, D: Driver<'d>> ByteSource for Source<'d, D> {
    async fn read(&mut self, buffer: &mut [u8]) -> usize {
        if let Some(held) = self.held.take() {
            return self.hand_over(held, buffer);
        }
        loop {
            let came =
                select3(self.vendor.next(), self.serial_port.next(), self.choice.suspended.wait()).await;
            let (way, came) = match came {
                Either3::First(came) => (Way::Vendor, came),
                Either3::Second(came) => (Way::SerialPort, came),
                Either3::Third(()) => {
                    // a host that sleeps or whose cable was unplugged can no longer cancel a
                    // request: treat it as cut
                    if self.choice.get().is_none() {
                        continue;
                    }
                    self.choice.set(None);
                    return 0;
                }
            };
            let before = self.choice.get();
            let Some(to) = came else {
                if before != Some(way) {
                    // nothing was received on an interface that is not in use
                    continue;
                }
                self.choice.set(None);
                return 0;
            };
            let held = Held { way, from: 0, to };
            if before == Some(way) {
                return self.hand_over(held, buffer);
            }
            self.choice.set(Some(way));
            if before.is_none() {
                return self.hand_over(held, buffer);
            }
            // the host changed the interface: a partial frame from the other one must not be joined
            // with this one
            self.held = Some(held);
            return 0;
        }
    }
}

/// Bytes to the host, on the interface from which bytes last came.
pub struct Sink<'d, D: Driver<'d>> {
    vendor: Bulk<D::EndpointIn>,
    serial_port: Sender<'d, D>,
    choice: &'d Choice,
}

impl<'d, D: Driver<'d>> Sink<'d, D> {
    pub(super) fn new(vendor: Bulk<D::EndpointIn>, serial_port: Sender<'d, D>, choice: &'d Choice) -> Self {
        Self { vendor, serial_port, choice }
    }
}

/// Sends one frame, or the part of it that the bus accepts before it is cut.
async fn send(pipe: &mut impl Outgoing, frame: &[u8]) {
    pipe.enabled().await;
    let packet_bytes = pipe.packet_bytes();
    for packet in frame.chunks(packet_bytes) {
        if pipe.packet(packet).await.is_err() {
            return;
        }
    }
    if frame.len().is_multiple_of(packet_bytes) {
        // only a short packet ends a host's read; if the interface is cut here, the frame is
        // already complete
        let _ = pipe.packet(&[]).await;
    }
}

impl<'d, D: Driver<'d>> ByteSink for Sink<'d, D> {
    async fn write(&mut self, frame: &[u8]) {
        loop {
            self.choice.changed.reset();
            let Some(way) = self.choice.get() else {
                self.choice.changed.wait().await;
                continue;
            };
            let sending = async {
                match way {
                    Way::Vendor => send(&mut self.vendor, frame).await,
                    Way::SerialPort => send(&mut self.serial_port, frame).await,
                }
            };
            // a host that changed to the other interface will never accept what waits on this one
            match select(sending, self.choice.changed.wait()).await {
                Either::First(()) => return,
                Either::Second(()) => {}
            }
        }
    }
}
