//! `usb:` and `usb:SERIAL`: the controller's vendor interface, two bulk endpoints that carry
//! frames.
//!
//! Only the address selects this interface instead of the serial port; the controller answers on
//! the interface on which it last received a message. [`attached`](fn@attached) lists controllers,
//! [`Usb::open`] opens one, and transfers stay queued for its bytes.

mod attached;
mod queue;

use std::io;
use std::time::Duration;

use jointrig_protocol::usb::INTERFACE_CLASS;
use nusb::descriptors::{InterfaceDescriptor, TransferType};
use nusb::transfer::{Buffer, Bulk, Direction, In, Out, TransferError};
use nusb::{Device, Endpoint, ErrorKind, Interface, MaybeFuture};

use super::error::{DeviceError, permission_advice};
use super::transport::Transport;
pub use attached::{Attached, attached};
use queue::{Incoming, Queue, TRANSFER_BYTES, broken};

/// Longest wait of a write for a controller that accepts no bytes.
const WRITE_PATIENCE: Duration = Duration::from_secs(5);

/// An open vendor interface. Dropping it cancels queued transfers and releases the interface.
pub struct Usb {
    queue: Queue<BulkIn>,
    out: Endpoint<Bulk, Out>,
}

impl Usb {
    /// Opens the controller with this serial number, or the only one attached.
    ///
    /// # Errors
    /// [`DeviceError::Open`]: none or several attached, no permission, held by another program.
    pub fn open(serial: Option<&str>) -> Result<Self, DeviceError> {
        let address = format!("usb:{}", serial.unwrap_or_default());
        let open = |why: String| DeviceError::Open { address: address.clone(), why };
        let list = attached().map_err(|error| open(format!("USB devices cannot be listed: {error}")))?;
        let place = attached::choose(&list, serial).map_err(open)?;
        let failed = |error: nusb::Error| open(why(&error));
        let device = list[place].info.open().wait().map_err(failed)?;
        let ends = Ends::of(&device).map_err(open)?;
        let interface = device.claim_interface(ends.interface).wait().map_err(failed)?;
        let out = interface.endpoint(ends.out).map_err(failed)?;
        let into = BulkIn::open(&interface, ends.into).map_err(failed)?;
        Ok(Self { queue: Queue::new(into), out })
    }
}

/// Interface and endpoint numbers, from the controller's descriptors.
struct Ends {
    interface: u8,
    out: u8,
    into: u8,
}

impl Ends {
    fn of(device: &Device) -> Result<Self, String> {
        let configuration = device.active_configuration().map_err(|error| error.to_string())?;
        configuration.interface_alt_settings().find_map(|interface| Self::inside(&interface)).ok_or_else(
            || {
                "it has no vendor interface with two bulk endpoints: another firmware than this program's?"
                    .into()
            },
        )
    }

    fn inside(interface: &InterfaceDescriptor<'_>) -> Option<Self> {
        let end = |direction| {
            interface
                .endpoints()
                .find(|end| end.direction() == direction && end.transfer_type() == TransferType::Bulk)
                .map(|end| end.address())
        };
        (interface.class() == INTERFACE_CLASS).then_some(())?;
        Some(Self {
            interface: interface.interface_number(),
            out: end(Direction::Out)?,
            into: end(Direction::In)?,
        })
    }
}

/// A message for a controller that could not be opened.
fn why(error: &nusb::Error) -> String {
    match error.kind() {
        ErrorKind::PermissionDenied => format!("permission denied: {}", permission_advice()),
        ErrorKind::Busy => {
            "another program holds its vendor interface (another `jointrig`?): end that one, or use \
                            its serial port if both are needed"
                .into()
        }
        ErrorKind::Disconnected => {
            "it was unplugged just now: check the cable; `jointrig devices` lists what is attached".into()
        }
        _ => format!("{error}"),
    }
}

/// The bulk IN endpoint; its buffers are reused.
struct BulkIn {
    end: Endpoint<Bulk, In>,
    idle: Vec<Buffer>,
}

impl BulkIn {
    fn open(interface: &Interface, address: u8) -> Result<Self, nusb::Error> {
        Ok(Self { end: interface.endpoint(address)?, idle: Vec::new() })
    }
}

impl Incoming for BulkIn {
    fn ask(&mut self) {
        let mut buffer = self.idle.pop().unwrap_or_else(|| Buffer::new(TRANSFER_BYTES));
        buffer.clear();
        buffer.set_requested_len(TRANSFER_BYTES);
        self.end.submit(buffer);
    }

    fn finished(&mut self, timeout: Duration, bytes: &mut Vec<u8>) -> Option<Result<(), TransferError>> {
        let done = self.end.wait_next_complete(timeout)?;
        bytes.extend_from_slice(&done.buffer[..done.actual_len]);
        self.idle.push(done.buffer);
        Some(done.status)
    }
}

impl Transport for Usb {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.queue.read(buf, timeout)
    }

    fn keeps_packets(&self) -> bool {
        true
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        // a zero byte ends every frame, so no zero-length packet is needed after a transfer of
        // whole packets
        match self.out.transfer_blocking(bytes.to_vec().into(), WRITE_PATIENCE).status {
            Err(TransferError::Cancelled) => Err(io::Error::new(
                io::ErrorKind::TimedOut,
                format!(
                    "the controller took no bytes for {} s: reset it, or unplug it and plug it in again",
                    WRITE_PATIENCE.as_secs()
                ),
            )),
            status => status.map_err(broken),
        }
    }
}
