//! The rig's controller above its board: acquisition, hammer, shaker, link and safety.
//!
//! The same code runs on the controller, in the emulator and inside the simulator. It owns no
//! static, no executor, no time driver and no logger: a board makes one [`Core`] and runs the four
//! asynchronous functions that borrow it, each in a task of its own:
//!
//! | function | what it does | when it is late |
//! |---|---|---|
//! | [`acquire::acquire`] | takes blocks of scans from the converters, judges them for the hammer, puts them in the ring | the front end counts missed scans; they are reported as lost ranges |
//! | [`receive::receive`] | finds frames in incoming bytes and carries out requests | the host asks again |
//! | [`transmit::transmit`] | sends answers first, then events, then blocks sent again, then new blocks, then log lines | blocks wait in the ring; what leaves it unsent is reported as lost |
//! | [`watch::watch`] | disarms hammer and stops shaker when the host falls silent, reports counters | – |
//!
//! The scan index is the only clock for results; `embassy-time` serves timeouts. Results never
//! depend on the order in which an executor polls the four.
#![no_std]
#![forbid(unsafe_code)]

pub mod acquire;
pub mod ad7606b;
pub mod board;
mod events;
pub mod feed;
mod fmt;
pub mod friction;
pub mod hammer;
mod in_step;
mod judging;
pub mod lock_in;
pub mod lockstep;
pub mod logs;
pub mod memory;
pub mod processor_fault;
pub mod pulse;
pub mod quiet;
pub mod receive;
mod refusal;
pub mod relay;
pub mod report;
mod requests;
pub mod ring;
pub mod ruler;
mod scales;
mod scan_time;
pub mod sentence;
pub mod servo;
pub mod shaker;
pub mod sine;
pub mod slow;
mod state;
mod supplies;
mod sync;
pub mod transmit;
#[cfg(feature = "usb")]
pub mod usb;
pub mod watch;

pub use state::{Core, Facts};
