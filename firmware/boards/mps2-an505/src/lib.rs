//! The emulated target: the controller's firmware as a binary for the Cortex-M33, on QEMU's
//! mps2-an505.
//!
//! Where a wired board uses its peripherals, this one uses memory shared with the simulator, in
//! turns ([`jointrig_firmware::lockstep`]): converters, coil, inputs, stage and link are the parts
//! in [`device`], and [`port`] takes the turns. Time is set by the simulator ([`time`]), so the
//! speed of the PC has no effect.
//!
//! The crate builds two images. `mps2-an505` contains only the board; `mps2-checks` contains checks
//! for developers: the golden vectors of the protocol and the benchmark.
#![no_std]

pub mod device;
mod executor;
mod fault;
pub mod memory;
pub mod port;
mod time;
pub mod uart;

// the critical section of a single core
use cortex_m as _;
// memcpy
use jointrig_copy as _;
