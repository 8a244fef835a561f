//! The protocol between the rig's controller and its host.
//!
//! Everything on the link is a *frame*: one kind byte, a payload and a CRC-32, COBS-encoded and
//! terminated by a zero byte ([`frame`]), or preceded by its length where a link preserves packet
//! boundaries ([`packet`]). Three layouts are fixed, little-endian and hand-written, because they
//! are performance-critical or must never change: [`hello::Hello`] (permanently frozen),
//! [`block::Block`] (samples) and [`acknowledge::Acknowledge`]. All others use postcard:
//! [`request::Request`], [`answer::Answer`], [`event::Event`].
//!
//! The crate is `no_std`, never allocates and never panics on any input. It does not depend on
//! rigs, boards or files. Any change in the meaning of a byte changes [`schema::HASH`]. Two ends
//! with the same version and different hashes refuse each other and name both versions
//! ([`hello::Hello::check`]).
#![no_std]
#![forbid(unsafe_code)]

pub mod acknowledge;
pub mod answer;
pub mod block;
pub mod channel;
pub mod event;
pub mod frame;
pub mod golden;
pub mod hello;
pub mod limits;
pub mod packet;
pub mod request;
pub mod schema;
pub mod shot;
pub mod slow;
pub mod sync;

/// USB identification of a controller: what the device reports and what a host looks for.
pub mod usb {
    /// The vendor id of pid.codes, a registry of product ids for open hardware.
    pub const VENDOR_ID: u16 = 0x1209;

    /// The first test id of pid.codes, for use within a laboratory. A rig that is sold or given
    /// away needs its own id, here and in docs/udev/70-jointrig.rules.
    pub const PRODUCT_ID: u16 = 0x0001;

    /// Product name. It is compared as well, because other devices may use the same test id.
    pub const PRODUCT: &str = "jointrig controller";

    /// Class of the interface that carries frames over two bulk endpoints: vendor-specific.
    /// Subclass and protocol are zero.
    pub const INTERFACE_CLASS: u8 = 0xFF;
}
