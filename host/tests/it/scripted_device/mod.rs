//! Sessions and campaigns on a scripted device, over a link that loses and damages frames.
#![allow(clippy::unwrap_used)]

mod by_summary;
mod fake;
mod faulty;
mod following;
mod hostile;
mod link_faults;
mod runner;
mod session;
