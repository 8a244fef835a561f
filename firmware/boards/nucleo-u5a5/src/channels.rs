//! The channels of a scan, in the order of the converters' inputs; the sockets are listed in
//! docs/WIRING.md.

use heapless::String;
use jointrig_firmware::ad7606b::part::AD7606B;
use jointrig_protocol::channel::{Axis, Channel, Name, Quantity, Role};
use jointrig_protocol::limits::MAX_CHANNELS;
use static_cell::StaticCell;

use crate::chips::SETTINGS;

/// One input: name, role, quantity, SI units per volt (sign included), delay of the sensor's
/// electronics in ns.
type Input = (&'static str, Role, Quantity, f32, u32);

/// Index of the hammer's force channel.
pub const FORCE: u8 = 0;
/// Index of the shaker's force channel.
pub const EXCITATION: u8 = 9;

/// The channels of the rig; the last six inputs are free.
const INPUTS: [Input; MAX_CHANNELS] = [
    ("force", Role::HammerForce, Quantity::Force, 44.643, 0),
    ("vib_x", Role::Response(Axis::X), Quantity::Velocity, 0.005, 0),
    ("vib_y", Role::Response(Axis::Y), Quantity::Velocity, 0.005, 0),
    ("vib_z", Role::Response(Axis::Z), Quantity::Velocity, 0.005, 0),
    ("ldv_a", Role::SpecimenA, Quantity::Velocity, 0.001, 0),
    ("ldv_b", Role::SpecimenB, Quantity::Velocity, 0.001, 0),
    ("lc_1", Role::LoadCell, Quantity::Force, 20.0, 0),
    ("lc_2", Role::LoadCell, Quantity::Force, 20.0, 0),
    ("lc_3", Role::LoadCell, Quantity::Force, 20.0, 0),
    ("excitation", Role::Excitation, Quantity::Force, 44.643, 0),
    ("aux_11", Role::Auxiliary, Quantity::Voltage, 1.0, 0),
    ("aux_12", Role::Auxiliary, Quantity::Voltage, 1.0, 0),
    ("aux_13", Role::Auxiliary, Quantity::Voltage, 1.0, 0),
    ("aux_14", Role::Auxiliary, Quantity::Voltage, 1.0, 0),
    ("aux_15", Role::Auxiliary, Quantity::Voltage, 1.0, 0),
    ("aux_16", Role::Auxiliary, Quantity::Voltage, 1.0, 0),
];

/// A filter that depends on the range would give channels with different ranges different delays
/// (docs/front-end.md), which are not reported to the host.
const _: () = {
    let mut place = 1;
    while place < SETTINGS.ranges.len() {
        let alike = SETTINGS.ranges[place] as u8 == SETTINGS.ranges[0] as u8;
        assert!(
            alike || AD7606B.has_bandwidth,
            "channels of different ranges have different phase with this part"
        );
        place += 1;
    }
};

/// The table, created once.
///
/// # Panics
/// When called twice.
pub fn table() -> &'static [Channel] {
    static TABLE: StaticCell<[Channel; MAX_CHANNELS]> = StaticCell::new();
    TABLE.init_with(|| {
        core::array::from_fn(|i| {
            let (label, role, quantity, units_per_volt, sensor_ns) = INPUTS[i];
            Channel {
                name: name(label),
                role,
                quantity,
                units_per_volt,
                range_v: SETTINGS.ranges[i % SETTINGS.ranges.len()].full_scale_v(),
                delay_ns: sensor_ns + AD7606B.averaging_delay_ns(SETTINGS.oversampling),
                bits: AD7606B.bits,
            }
        })
    })
}

/// A name, truncated to the maximum length.
pub fn name(value: &str) -> Name {
    text(value)
}

/// A text, truncated to its capacity.
pub fn text<const N: usize>(value: &str) -> String<N> {
    value.chars().take(N).collect()
}
