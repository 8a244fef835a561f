//! Devices: addresses, byte transports, sessions, and the records cut from their streams.
//!
//! [`address::Address`] opens a [`transport::Transport`]; [`session::Session`] runs the protocol
//! over it and assembles the stream of scans, whatever the link loses; [`stream::Recording`] is
//! one impact cut from it. A [`tap`] lets another thread view the stream.

pub mod address;
#[cfg(feature = "bridge")]
mod bridge;
pub mod channels;
mod claims;
pub mod error;
mod inbox;
pub mod link;
pub mod logs;
#[cfg(all(feature = "sim", unix))]
mod qemu;
mod requests;
pub mod samples;
pub(crate) mod serial;
pub mod session;
#[cfg(feature = "sim")]
mod sim;
pub mod stream;
pub mod tap;
mod tcp;
pub mod transport;
pub mod usb;
