//! How a controller is known on a USB: what its device says of itself, and what a host looks for.

/// pid.codes, the registry that gives product ids to open hardware.
pub const VENDOR_ID: u16 = 0x1209;

/// pid.codes' first test id: for use inside a laboratory. A rig that is sold or given away needs an id of
/// its own, here and in docs/udev/70-jointrig.rules.
pub const PRODUCT_ID: u16 = 0x0001;

/// Name of the product. As a test id may be anybody's, it is compared too.
pub const PRODUCT: &str = "jointrig controller";

/// Class of the interface that carries frames over two bulk endpoints: the vendor's own. Subclass and
/// protocol are zero.
pub const INTERFACE_CLASS: u8 = 0xFF;
