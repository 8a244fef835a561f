//! The contract between the rig's controller and its host.
//!
//! Everything that crosses the link is a *frame*: one kind byte, a payload, a CRC-32, wrapped in
//! COBS and ended by a zero byte ([`frame`]), or behind its length where a link keeps packets apart ([`packet`]). Three layouts are fixed, little-endian and written by
//! hand because they are hot or must never change: [`hello::Hello`] (frozen for ever),
//! [`block::Block`] (samples) and [`acknowledge::Acknowledge`]. All else is postcard:
//! [`request::Request`], [`answer::Answer`], [`event::Event`].
//!
//! The crate is `no_std`, never allocates and never panics on any input. It knows nothing of rigs,
//! boards or files. Whatever changes the meaning of a byte changes [`schema::HASH`], and two ends
//! whose hashes differ refuse each other by name ([`hello::Hello::check`]).
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
pub mod usb;
