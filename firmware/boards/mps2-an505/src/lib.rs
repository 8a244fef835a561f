//! The emulated target: the controller's firmware as a binary for the Cortex-M33, under QEMU's
//! mps2-an505.
//!
//! What a wired board does with its peripherals, this one does through memory that it shares with
//! the simulator, in turns ([`jointrig_firmware::lockstep`]): converters, coil, inputs, stage and
//! link are the parts in [`parts`], and [`port`] is where turns are taken. Time is what the
//! simulator says ([`time`]), so the machine's speed enters nothing.
//!
//! Two images are made of it. `mps2-an505` is the board, and nothing else; `mps2-checks` has what
//! only its makers ask of it: the golden vectors of the wire and the benchmark.
#![no_std]

pub mod device;
mod executor;
mod fault;
pub mod lines;
pub mod memory;
mod parts;
pub mod port;
mod time;
pub mod uart;

// the critical section of a single core
use cortex_m as _;
// memcpy
use jointrig_copy as _;
