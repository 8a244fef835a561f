//! The USB device as a host sees it: one vendor interface with two bulk endpoints, and a serial
//! port.
//!
//! Both carry the same frames. The vendor interface needs no driver installation on any system (the
//! device itself instructs Windows to use WinUSB); the serial port (CDC-ACM) is for programs that
//! support nothing else. Frames are sent on the interface from which bytes last came, so that a
//! host chooses by sending.
//!
//! Everything here is generic over embassy's USB driver, so that a PC can act as both host and bus
//! in a test. At high speed one frame is one short packet (503 bytes of 512); at full speed a frame
//! uses as many packets of 64 bytes as it needs, followed by an empty one when the last is full.
//!
//! A host that does not read makes [`Sink::write`](crate::board::ByteSink::write) wait: blocks then
//! accumulate in the ring, and those that leave it unsent are reported as lost. A bus reset, an
//! unplugged cable or a suspended bus ends any transfer in progress, and everything that moves
//! comes to rest.
//!
//! embassy-usb builds descriptors once, for one packet size. A board whose bus comes up at full
//! speed drops the result of [`build`] and builds again with [`Speed::Full`]; the session is
//! unaffected, because its state is in [`crate::Core`].

mod device;
mod link;
pub mod mended;

pub use device::{Buffers, Speed, Usb, build};
pub use device::{INTERFACE_GUID, VENDOR_CODE};
pub use link::{Sink, Source};
