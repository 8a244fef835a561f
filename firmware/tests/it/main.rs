//! Integration tests of the firmware, one program so that it is linked once.

mod ad7606b;
mod coil_driver;
mod front_end;
mod usb;
