//! Descriptors: identity of the device and its interfaces.

use core::sync::atomic::AtomicU8;

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_usb::class::cdc_acm::{CdcAcmClass, State};
use embassy_usb::driver::Driver;
use embassy_usb::{Builder, Config, Handler, UsbDevice};
use jointrig_protocol::usb::{INTERFACE_CLASS, PRODUCT, PRODUCT_ID, VENDOR_ID};

use super::link::{Bulk, Choice, Sink, Source};
use super::windows::{self, Windows};

/// Speed of the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Speed {
    /// 12 Mbit/s: at most eight channels at 51.2 kHz.
    Full,
    /// 480 Mbit/s.
    High,
}

impl Speed {
    /// Size of a bulk packet in bytes; at either speed no other size is permitted for this use (USB
    /// 2.0, 5.8.3).
    #[must_use]
    pub const fn bulk_packet(self) -> u16 {
        match self {
            Self::Full => 64,
            Self::High => 512,
        }
    }
}

/// Memory for descriptors and the serial port's state. It outlives the device built in it.
pub struct Buffers<'d> {
    config: [u8; 192],
    bos: [u8; 64],
    control: [u8; 128],
    serial_port: State<'d>,
    choice: Choice,
    suspension: Option<Suspension<'d>>,
    windows: Windows,
}

/// Informs the link that the bus was suspended.
struct Suspension<'d>(&'d Choice);

impl Handler for Suspension<'_> {
    fn suspended(&mut self, suspended: bool) {
        if suspended {
            self.0.suspended.signal(());
        }
    }
}

impl Default for Buffers<'_> {
    fn default() -> Self {
        Self::new()
    }
}

impl Buffers<'_> {
    /// Empty.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            config: [0; 192],
            bos: [0; 64],
            control: [0; 128],
            serial_port: State::new(),
            choice: Choice {
                active: AtomicU8::new(0),
                changed: Signal::<CriticalSectionRawMutex, ()>::new(),
                suspended: Signal::<CriticalSectionRawMutex, ()>::new(),
            },
            suspension: None,
            windows: Windows,
        }
    }
}

/// A built device. `device` must run concurrently with the users of `source` and `sink`.
pub struct Usb<'d, D: Driver<'d>> {
    /// The device: enumeration and control requests.
    pub device: UsbDevice<'d, D>,
    /// Bytes from the host.
    pub source: Source<'d, D>,
    /// Bytes to the host.
    pub sink: Sink<'d, D>,
}

/// Builds the device. `serial` distinguishes this board from all others; a host uses it to find its
/// rig.
pub fn build<'d, D: Driver<'d>>(
    driver: D,
    buffers: &'d mut Buffers<'d>,
    serial: &'d str,
    speed: Speed,
) -> Usb<'d, D> {
    let mut config = Config::new(VENDOR_ID, PRODUCT_ID);
    config.manufacturer = Some("jointrig");
    config.product = Some(PRODUCT);
    config.serial_number = Some(serial);
    config.max_power = 500;
    let Buffers { config: configuration, bos, control, serial_port, choice, suspension, windows } = buffers;
    let choice: &Choice = choice;
    let mut builder = Builder::new(driver, config, configuration, bos, &mut [], control);

    let packet = speed.bulk_packet();
    let (out, into) = {
        let mut function = builder.function(INTERFACE_CLASS, 0, 0);
        let mut interface = function.interface();
        let mut alternate = interface.alt_setting(INTERFACE_CLASS, 0, 0, None);
        alternate.bos_capability(windows::PLATFORM, &windows::CAPABILITY);
        (alternate.endpoint_bulk_out(None, packet), alternate.endpoint_bulk_in(None, packet))
    };
    let (sender, receiver) = CdcAcmClass::new(&mut builder, serial_port, packet).split();

    builder.handler(suspension.insert(Suspension(choice)));
    builder.handler(windows);
    Usb {
        device: builder.build(),
        source: Source::new(Bulk(out), receiver, choice),
        sink: Sink::new(Bulk(into), sender, choice),
    }
}
