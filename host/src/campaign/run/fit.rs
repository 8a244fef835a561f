//! Does the device fit the plan? Asked before anything moves.

use jointrig_protocol::channel::Role;

use super::error::RunError;
use crate::campaign::plan::Plan;
use crate::device::channels::ChannelMap;

/// Refuses a device of another rate, without the channels of a hit, or with other sensors than the plan's.
pub(super) fn check_fit(address: &str, plan: &Plan, channels: &ChannelMap) -> Result<(), RunError> {
    let unfit = |what: String| Err(RunError::Unfit { address: address.into(), what });
    let wanted = plan.record.get_ref().rate_hz;
    if channels.rate_hz != wanted {
        return unfit(format!(
            "it measures at {} Hz, the plan says {wanted} Hz (record.rate_hz)",
            channels.rate_hz
        ));
    }
    if channels.place(Role::HammerForce).is_none() || channels.responses().is_none() {
        return unfit("it needs a hammer force and the vibrometer's three axes among its channels".into());
    }
    for sensor in plan.channel.iter().map(toml::Spanned::get_ref) {
        let name = &sensor.name;
        let Some(channel) = channels.channels.iter().find(|channel| channel.name == name.as_str()) else {
            return unfit(format!("it has no channel `{name}` (channel.name)"));
        };
        let scale = f64::from(channel.units_per_volt);
        let differ =
            |given: Option<f64>, found: f64| given.is_some_and(|given| (found / given - 1.0).abs() > 0.01);
        let range = f64::from(channel.range_v) * scale.abs();
        if differ(sensor.sensitivity_v, 1.0 / scale.abs()) {
            return unfit(format!(
                "its channel `{name}` has {:.6} V per {unit} (channel.sensitivity_v)",
                1.0 / scale.abs(),
                unit = channel.quantity.unit()
            ));
        }
        if sensor.polarity.is_some_and(|sign| f64::from(sign) * scale < 0.0) {
            return unfit(format!("its channel `{name}` has the other sign (channel.polarity)"));
        }
        if differ(sensor.range, range) {
            let unit = channel.quantity.unit();
            return unfit(format!("its channel `{name}` ends at {range:.6} {unit} (channel.range)"));
        }
    }
    Ok(())
}
