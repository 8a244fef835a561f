//! The device as a host sees it on a USB: one vendor interface of two bulk endpoints, and a serial
//! port.
//!
//! Both carry the same frames. The vendor interface needs no driver on any system (Windows is told
//! to use WinUSB by the device itself); the serial port (CDC-ACM) is for programs that know nothing
//! else. Frames go out on the interface on which bytes last came in, so that a host chooses by
//! speaking.
//!
//! Everything here is generic over embassy's USB driver, so that a PC can be both the host and the
//! bus in a test. At high speed one frame is one short packet (503 bytes of 512); at full speed a
//! frame is as many packets of 64 as it needs, and an empty one behind when the last is full.
//!
//! A host that does not read makes [`Sink::write`](crate::board::ByteSink::write) wait: blocks then
//! gather in the ring, and what leaves it unsent is reported as lost. A bus reset or an unplugged
//! cable ends whatever is on its way, and so does a bus that is suspended: everything that moves
//! comes to rest.
//!
//! embassy-usb builds descriptors once, for one packet size. A board that comes up at full speed
//! drops what [`build`] made and builds anew with [`Speed::Full`]; nothing of a session is lost by
//! it, because all of that is in [`crate::Core`].

mod device;
mod link;
pub mod mended;
mod windows;

pub use device::{Buffers, Speed, Usb, build};
pub use link::{Sink, Source};
pub use windows::{INTERFACE_GUID, VENDOR_CODE};
