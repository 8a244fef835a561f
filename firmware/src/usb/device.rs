//! Descriptors: identity of the device and its interfaces, and those for Windows, which assign
//! WinUSB to the vendor interface and give the GUID by which a program finds it.
//!
//! The bytes for Windows are constant, as defined in "Microsoft OS 2.0 Descriptors Specification"
//! (July 2018, tables 3 to 15). embassy-usb's builder for them would assemble them on the
//! controller, in 1.7 kB of flash.

use super::link::{Bulk, Choice, Sink, Source};
use core::sync::atomic::AtomicU8;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_usb::class::cdc_acm::{CdcAcmClass, State};
use embassy_usb::control::{InResponse, Recipient, Request, RequestType};
use embassy_usb::driver::Driver;
use embassy_usb::{Builder, Config, Handler, UsbDevice};
use jointrig_protocol::usb::{INTERFACE_CLASS, PRODUCT, PRODUCT_ID, VENDOR_ID};

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
        alternate.bos_capability(PLATFORM, &CAPABILITY);
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

/// The request with which Windows asks for its own descriptors.
pub const VENDOR_CODE: u8 = 0x4A;
/// The GUID by which a Windows program finds the vendor interface.
pub const INTERFACE_GUID: &str = "{6C1E3B6A-58F0-4C4B-9D0E-6A2F1B7D9E35}";

/// wIndex of the request for the whole descriptor set.
const DESCRIPTOR_INDEX: u16 = 7;
/// Windows 8.1, the first version that requests it.
const WINDOWS_VERSION: [u8; 4] = 0x0603_0000_u32.to_le_bytes();
/// Name of the registry property that holds the GUID.
const PROPERTY: &str = "DeviceInterfaceGUIDs";
const NAME: usize = utf16(PROPERTY, 1);
const GUID: usize = utf16(INTERFACE_GUID, 2);
const REGISTRY: usize = 10 + NAME + GUID;
const FUNCTION: usize = 8 + 20 + REGISTRY;
const SET: usize = 10 + 8 + FUNCTION;

/// bDevCapabilityType of a platform capability.
pub const PLATFORM: u8 = 5;
/// The platform capability that refers to the descriptor set: its UUID, the version, the set's
/// length, and [`VENDOR_CODE`].
pub const CAPABILITY: [u8; 25] = [
    0,
    0xDF,
    0x60,
    0xDD,
    0xD8,
    0x89,
    0x45,
    0xC7,
    0x4C,
    0x9C,
    0xD2,
    0x65,
    0x9D,
    0x9E,
    0x64,
    0x8A,
    0x9F, //
    WINDOWS_VERSION[0],
    WINDOWS_VERSION[1],
    WINDOWS_VERSION[2],
    WINDOWS_VERSION[3], //
    SET as u8,
    0,
    VENDOR_CODE,
    0,
];
const _: () = assert!(SET <= 0xFF, "one byte of each length is written");

/// Bytes of an ASCII text in UTF-16 with `zeros` terminating zeros.
const fn utf16(text: &str, zeros: usize) -> usize {
    2 * (text.len() + zeros)
}

/// The descriptor set: header, the one configuration, its function at interface 0, "WINUSB", and
/// the GUID.
static DESCRIPTORS: [u8; SET] = {
    let mut set = [0; SET];
    let mut at = 0;
    let [a, b, c, d] = WINDOWS_VERSION;
    let heads: [&[u8]; 6] = [
        &[10, 0, 0, 0, a, b, c, d, SET as u8, 0],
        &[8, 0, 1, 0, 0, 0, (8 + FUNCTION) as u8, 0],
        &[8, 0, 2, 0, 0, 0, FUNCTION as u8, 0],
        &[20, 0, 3, 0, b'W', b'I', b'N', b'U', b'S', b'B', 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
        // a list of strings (REG_MULTI_SZ)
        &[REGISTRY as u8, 0, 4, 0, 7, 0, NAME as u8, 0],
        &[GUID as u8, 0],
    ];
    let mut part = 0;
    while part < heads.len() {
        if part == 5 {
            at = write_utf16(&mut set, at, PROPERTY) + 2;
        }
        let mut i = 0;
        while i < heads[part].len() {
            set[at] = heads[part][i];
            (at, i) = (at + 1, i + 1);
        }
        part += 1;
    }
    assert!(write_utf16(&mut set, at, INTERFACE_GUID) + 4 == SET);
    set
};

/// Writes an ASCII text in UTF-16 and returns the end position.
const fn write_utf16(set: &mut [u8; SET], mut at: usize, text: &str) -> usize {
    let mut i = 0;
    while i < text.len() {
        set[at] = text.as_bytes()[i];
        (at, i) = (at + 2, i + 1);
    }
    at
}

/// Handles the requests of Windows.
pub struct Windows;

impl Handler for Windows {
    fn control_in<'a>(&'a mut self, asked: Request, _: &'a mut [u8]) -> Option<InResponse<'a>> {
        let whole = (asked.request_type, asked.recipient) == (RequestType::Vendor, Recipient::Device)
            && (asked.request, asked.index) == (VENDOR_CODE, DESCRIPTOR_INDEX);
        whole.then_some(InResponse::Accepted(&DESCRIPTORS))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_says_its_length_and_they_fill_the_set() {
        let word = |at: usize| usize::from(u16::from_le_bytes([DESCRIPTORS[at], DESCRIPTORS[at + 1]]));
        // total length, the configuration's, the function's
        assert_eq!((word(8), word(16), word(24)), (178, 168, 160));
        let (mut at, mut kinds) = (0, [0; 5]);
        for kind in &mut kinds {
            *kind = word(at + 2);
            at += word(at);
        }
        assert_eq!((at, kinds), (SET, [0, 1, 2, 3, 4]));
    }
}
