//! USB identification of a controller: what the device reports and what a host looks for.

/// The vendor id of pid.codes, a registry of product ids for open hardware.
pub const VENDOR_ID: u16 = 0x1209;

/// The first test id of pid.codes, for use within a laboratory. A rig that is sold or given away
/// needs its own id, here and in docs/udev/70-jointrig.rules.
pub const PRODUCT_ID: u16 = 0x0001;

/// Product name. It is compared as well, because other devices may use the same test id.
pub const PRODUCT: &str = "jointrig controller";

/// Class of the interface that carries frames over two bulk endpoints: vendor-specific. Subclass
/// and protocol are zero.
pub const INTERFACE_CLASS: u8 = 0xFF;
