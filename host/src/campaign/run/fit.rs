//! Checks whether the device fits the plan, before anything moves.

use jointrig_protocol::channel::{Quantity, Role};

use super::error::RunError;
use crate::campaign::plan::Plan;
use crate::campaign::store::calibration_table::Calibration;
use crate::device::channels::ChannelMap;

/// A sensitivity that differs from the device's by more than this factor belongs to another sensor
/// or is mistyped.
const ANOTHER_SENSOR: f64 = 1.25;

/// The channels as the plan calibrates them, with a sentence for each that the device describes
/// differently.
///
/// `coil_cap_us` is the device's longest pulse. Refuses a device with another rate, with too short
/// a pulse, without the channels of a hit, or with other sensors than the plan's.
pub(super) fn fitted(
    address: &str,
    plan: &Plan,
    channels: &ChannelMap,
    coil_cap_us: u32,
) -> Result<(ChannelMap, Vec<String>), RunError> {
    let unfit = |what: String| Err(RunError::Unfit { address: address.into(), what });
    let wanted = plan.record.get_ref().rate_hz;
    if channels.rate_hz != wanted {
        return unfit(format!(
            "it measures at {} Hz, the plan says {wanted} Hz (record.rate_hz)",
            channels.rate_hz
        ));
    }
    let [shortest, _] = plan.force.get_ref().pulse_bounds_us;
    if plan.by_hand().is_none() && coil_cap_us < shortest {
        return unfit(format!(
            "its coil is driven for at most {coil_cap_us} µs, and the plan's shortest pulse is {shortest} µs (force.pulse_bounds_us)"
        ));
    }
    if channels.place(Role::HammerForce).is_none() {
        return unfit("it needs a hammer force among its channels".into());
    }
    if let Err(what) = measured_at_every_point(plan, channels) {
        return unfit(what);
    }
    with_sensors(plan, channels).or_else(unfit)
}

/// Checks that every response point is measured: by a fixed sensor, or by the vibrometer.
fn measured_at_every_point(plan: &Plan, channels: &ChannelMap) -> Result<(), String> {
    let points = plan.geometry.response.iter().map(toml::Spanned::get_ref);
    for point in points.filter(|point| plan.is_measured(&point.name)) {
        let Some(own) = &point.channels else {
            if channels.responses().is_none_or(|axes| axes.len() != 3) {
                return Err(format!(
                    "the vibrometer is to come to `{}`, and its three axes are not among the device's channels (a sensor that stays there \
                     is named in geometry.response.channels)",
                    point.name
                ));
            }
            continue;
        };
        for name in own {
            let Some(place) = channels.named(name) else {
                let there: Vec<&str> =
                    channels.channels.iter().map(|channel| channel.name.as_str()).collect();
                return Err(format!(
                    "it has no channel `{name}`, where the sensor at `{}` is to be (geometry.response.channels); it has {}",
                    point.name,
                    there.join(", ")
                ));
            };
            let channel = &channels.channels[place];
            if !matches!(
                channel.quantity,
                Quantity::Velocity | Quantity::Acceleration | Quantity::Displacement
            ) || !matches!(channel.role, Role::Auxiliary | Role::Response(_))
            {
                return Err(format!(
                    "its channel `{name}` measures something else than the motion at `{}` (geometry.response.channels)",
                    point.name
                ));
            }
        }
    }
    Ok(())
}

/// The channels with the sensors that the plan names, and a sentence for each that the device
/// describes differently; or why they do not fit.
pub(super) fn with_sensors(plan: &Plan, channels: &ChannelMap) -> Result<(ChannelMap, Vec<String>), String> {
    let (mut map, mut remarks) = (channels.clone(), Vec::new());
    for sensor in plan.channel.iter().map(toml::Spanned::get_ref) {
        let name = &sensor.name;
        let Some(channel) = map.channels.iter_mut().find(|channel| channel.name == name.as_str()) else {
            return Err(format!("it has no channel `{name}` (channel.name)"));
        };
        let (unit, says) = (channel.quantity.unit(), 1.0 / f64::from(channel.units_per_volt).abs());
        if sensor.sensitivity_v.is_some_and(|given| (given / says).ln().abs() > ANOTHER_SENSOR.ln()) {
            return Err(format!("its channel `{name}` has {says:.6} V per {unit} (channel.sensitivity_v)"));
        }
        if sensor.polarity.is_some_and(|sign| f32::from(sign) * channel.units_per_volt < 0.0) {
            return Err(format!("its channel `{name}` has the other sign (channel.polarity)"));
        }
        let device = channel.clone();
        Calibration::of_sensor(sensor).apply(channel);
        let range = f64::from(channel.range_v) * f64::from(channel.units_per_volt).abs();
        // certificates state rounded ranges
        if sensor.range.is_some_and(|given| (range / given - 1.0).abs() > 0.01) {
            return Err(format!("its channel `{name}` ends at {range:.6} {unit} (channel.range)"));
        }
        if *channel != device {
            let is = 1.0 / f64::from(channel.units_per_volt).abs();
            remarks.push(format!(
                "channel `{name}`: the plan's {is:.6} V per {unit} and {} ns count, not the device's {says:.6} V and {} ns",
                channel.delay_ns, device.delay_ns
            ));
        }
    }
    Ok((map, remarks))
}
