//! Integration tests of the protocol, one program so that it is linked once.

mod any_bytes;
mod golden;
