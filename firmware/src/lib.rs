//! The hardware-independent part of the rig's controller: acquisition, hammer, shaker, link and
//! safety.
//!
//! The same code runs on the controller, in the emulator and in the simulator. It contains no
//! static, no executor, no time driver and no logger: a board creates one [`Core`] and runs the
//! four asynchronous functions that borrow it, each in a separate task:
//!
//! - [`acquire::acquire`] takes blocks of scans from the converters, evaluates them for the hammer
//!   and puts them into the ring. When it is late, the front end counts missed scans; they are
//!   reported as lost ranges.
//! - [`receive::receive`] finds frames in incoming bytes and carries out requests. When it is late,
//!   the host asks again.
//! - [`transmit::transmit`] sends replies first, then events, then retransmitted blocks, then new
//!   blocks, then log lines. When it is late, blocks wait in the ring; those that leave it unsent
//!   are reported as lost.
//! - [`watch::watch`] disarms the hammer and stops the shaker when the host falls silent, and
//!   reports counters.
//!
//! What moves belongs to [`safety`]: one file states what forbids motion, who sets and who clears
//! it, and in which order.
//!
//! The scan index is the only time base for results; `embassy-time` is used for timeouts. Results
//! never depend on the order in which an executor polls the four tasks.
#![no_std]
#![forbid(unsafe_code)]

pub mod acquire;
pub mod ad7606b;
pub mod board;
mod events;
pub mod feed;
mod fmt;
pub mod hammer;
pub mod lockstep;
pub mod logs;
pub mod processor_fault;
pub mod pulse;
pub mod quiet;
pub mod receive;
pub mod ring;
pub mod ruler;
pub mod safety;
mod scales;
pub mod sentence;
pub mod servo;
pub mod shaker;
mod state;
pub mod supplies;
mod sync;
pub mod transmit;
#[cfg(feature = "usb")]
pub mod usb;
pub mod watch;

pub use state::{Core, Facts};
