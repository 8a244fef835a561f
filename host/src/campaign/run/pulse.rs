//! The hammer's closed loop: which coil pulse gives the target force.
//!
//! Peak force grows with pulse length, with a scatter of a few per cent and a slow drift as the
//! coil warms up. The next pulse depends only on the hits so far, so that a resumed campaign
//! continues as if it had never stopped.
//!
//! Checks whether the device fits the plan, before anything moves.

use super::error::RunError;
use crate::campaign::plan::{Force, Plan};
use crate::campaign::store::calibration_table::Calibration;
use crate::device::channels::ChannelMap;
use jointrig_protocol::channel::{Quantity, Role};

/// Number of hits used: older ones belong to a colder coil.
const MEMORY: usize = 6;

/// Fraction of the correction that one hit may cause: the loop must not follow scatter.
const DAMPING: f64 = 0.7;

/// Largest relative change of the pulse in one step.
const STEP: f64 = 0.15;

/// Relative increase of the pulse if the bolt did not arrive.
const REACH: f64 = 0.12;

/// Bounds of d ln(peak) / d ln(pulse): near the shortest pulse that arrives, the peak is very
/// sensitive.
const SLOPES: (f64, f64) = (0.5, 8.0);

/// Slope assumed until it can be measured.
pub(super) const FIRST_SLOPE: f64 = 3.0;

/// A peak that differs by this much (ln) from earlier peaks of the same pulse is an outlier and
/// says nothing about the coil, unless the next one differs as much.
const ODD: f64 = 0.2;

/// A hit as the loop uses it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PulseHit {
    /// Coil pulse, µs.
    pub pulse_us: u32,
    /// Peak force, N; 0 when the bolt did not arrive.
    pub peak_n: f64,
}

/// The closed loop.
#[derive(Clone, Debug)]
pub struct PulseLoop {
    force: Force,
    cap_us: u32,
    hits: Vec<PulseHit>,
    pulse_us: f64,
    /// Whether the last hit was an outlier.
    odd: bool,
}

impl PulseLoop {
    /// A loop that starts at the plan's pulse and never exceeds `cap_us`, the device's longest
    /// pulse.
    pub fn new(force: &Force, cap_us: u32) -> Self {
        let pulse_us = f64::from(force.pulse_us.min(cap_us));
        Self { force: *force, cap_us, hits: Vec::new(), pulse_us, odd: false }
    }

    /// The pulse for the next shot, µs.
    pub fn pulse_us(&self) -> u32 {
        self.pulse_us.round() as u32
    }

    /// Updates the loop with a hit.
    pub fn learn(&mut self, hit: PulseHit) {
        let [shortest, longest] = self.force.pulse_bounds_us;
        let pulse = f64::from(hit.pulse_us);
        let is_odd = self.is_odd(hit);
        let was_odd = std::mem::replace(&mut self.odd, is_odd);
        if self.odd && !was_odd {
            return;
        }
        if self.odd {
            // two in a row: the coil has changed, and the earlier hits are out of date
            self.hits.clear();
        }
        let next = if hit.peak_n <= 0.0 {
            // relative to the failed pulse, not to the current one: several failed shots must not
            // add up
            self.pulse_us.max(pulse * (1.0 + REACH))
        } else {
            if self.hits.len() == MEMORY {
                self.hits.remove(0);
            }
            self.hits.push(hit);
            self.corrected(pulse, hit.peak_n)
        };
        self.pulse_us = next.clamp(f64::from(shortest), f64::from(longest.min(self.cap_us)));
    }

    /// The mean peak over hits with (nearly) this pulse, which averages the scatter, and their
    /// number.
    fn usual(&self, pulse: f64) -> (f64, f64) {
        let near = |hit: &&PulseHit| (f64::from(hit.pulse_us) / pulse - 1.0).abs() < 0.01;
        let (sum, count) =
            self.hits.iter().filter(near).fold((0.0, 0.0), |(sum, n), hit| (sum + hit.peak_n, n + 1.0));
        (sum / count, count)
    }

    fn is_odd(&self, hit: PulseHit) -> bool {
        let (usual, count) = self.usual(f64::from(hit.pulse_us));
        count >= 2.0 && hit.peak_n > 0.0 && (hit.peak_n / usual).ln().abs() > ODD
    }

    fn corrected(&self, pulse: f64, peak: f64) -> f64 {
        let (usual, count) = self.usual(pulse);
        let mean = if count > 0.0 { usual } else { peak };
        let error = (self.force.target_n / mean).ln();
        // a mean over n hits scatters less by √n, so its tolerance is tighter
        if error.abs() <= (1.0 + self.force.tolerance).ln() / count.max(1.0).sqrt() {
            return pulse;
        }
        let step = (DAMPING * error / self.slope()).exp();
        pulse * step.clamp(1.0 - STEP, 1.0 + STEP)
    }

    /// d ln(peak) / d ln(pulse) over the hits in memory (least squares), within bounds.
    fn slope(&self) -> f64 {
        let points = || self.hits.iter().map(|hit| (f64::from(hit.pulse_us).ln(), hit.peak_n.ln()));
        let n = self.hits.len().max(1) as f64;
        let (mx, my) = points().fold((0.0, 0.0), |(x, y), (px, py)| (x + px / n, y + py / n));
        let (sxx, sxy) = points()
            .fold((0.0, 0.0), |(xx, xy), (px, py)| (xx + (px - mx).powi(2), xy + (px - mx) * (py - my)));
        // pulses that hardly differ show only scatter
        if sxx < n * 1e-4 { FIRST_SLOPE } else { (sxy / sxx).clamp(SLOPES.0, SLOPES.1) }
    }
}

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

/// Longest time from an order to a bridge until the force arrives here, s: a block of 50 ms before
/// the order, one after it, the program's own time, and the bolt's flight.
const BRIDGED_FLIGHT_S: f64 = 0.2;

/// Refuses a plan that would count a late strike of a bridge's hammer as a missed one, and would
/// then strike harder.
pub(super) fn strikes_in_time(address: &str, plan: &Plan) -> Result<(), RunError> {
    let flight_s = plan.trigger.get_ref().flight_s;
    if plan.by_hand().is_none() && flight_s < BRIDGED_FLIGHT_S {
        return Err(RunError::Unfit {
            address: address.into(),
            what: format!(
                "through a bridge a strike is seen up to {BRIDGED_FLIGHT_S} s after its order, and the plan waits for {flight_s} s: set \
                 trigger.flight_s to {BRIDGED_FLIGHT_S} or more"
            ),
        });
    }
    Ok(())
}

/// Checks that every response point is measured: by a fixed sensor, or by the vibrometer.
fn measured_at_every_point(plan: &Plan, channels: &ChannelMap) -> Result<(), String> {
    let points = plan.geometry.response.iter().map(toml::Spanned::get_ref);
    for point in points.filter(|point| plan.is_measured(&point.name)) {
        let Some(own) = &point.channels else {
            if channels.responses().is_none_or(|axes| axes.len() != 3) {
                return Err(format!(
                    "the vibrometer is to measure at `{}`, but the device has no channels for its three axes (name a fixed sensor in \
                     geometry.response.channels)",
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
                    "it has no channel `{name}` for the sensor at `{}` (geometry.response.channels); its channels are {}",
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
                    "its channel `{name}` does not measure the motion at `{}` (geometry.response.channels)",
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
                "channel `{name}`: the plan's {is:.6} V per {unit} and {} ns are used, not the device's {says:.6} V and {} ns",
                channel.delay_ns, device.delay_ns
            ));
        }
    }
    Ok((map, remarks))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FORCE: Force = Force {
        target_n: 50.0,
        softer: None,
        tolerance: 0.05,
        pulse_us: 3_000,
        pulse_bounds_us: [500, 8_000],
    };

    fn settle(peak: impl Fn(u32, usize) -> f64) -> Vec<PulseHit> {
        let mut pulse = PulseLoop::new(&FORCE, 8_000);
        (0..24)
            .map(|shot| {
                let hit = PulseHit { pulse_us: pulse.pulse_us(), peak_n: peak(pulse.pulse_us(), shot) };
                pulse.learn(hit);
                hit
            })
            .collect()
    }

    #[test]
    fn finds_the_target_from_far_away_and_follows_a_drift() {
        let scatter = |shot: usize| 1.0 + 0.03 * (shot as f64 * 2.4).sin();
        let laws: [fn(f64) -> f64; 4] = [
            |us| 0.012 * us,
            |us| (us - 2_000.0).max(0.0) * 0.02,
            |us| (us - 4_000.0).max(0.0) * 0.05,
            |us| 1e-5 * us * us,
        ];
        for (which, law) in laws.iter().enumerate() {
            let hits = settle(|us, shot| law(f64::from(us)) * scatter(shot) * (1.0 + 0.002 * shot as f64));
            for hit in &hits[16..] {
                assert!((hit.peak_n / 50.0 - 1.0).abs() < 0.12, "law {which}: {hits:?}");
            }
        }
    }

    #[test]
    fn an_accident_is_not_chased_and_a_change_is() {
        let mut pulse = PulseLoop::new(&FORCE, 8_000);
        let mut strike = |peak_n: f64| {
            let pulse_us = pulse.pulse_us();
            pulse.learn(PulseHit { pulse_us, peak_n });
            pulse.pulse_us()
        };
        for peak in [50.5, 49.0, 50.0] {
            assert_eq!(strike(peak), 3_000);
        }
        // the bolt slipped; the next hit is normal
        assert_eq!((strike(15.0), strike(50.2)), (3_000, 3_000));
        // the supply sagged: two in a row are not outliers
        assert_eq!(strike(35.0), 3_000);
        assert!(strike(35.5) > 3_100);
    }

    #[test]
    fn the_mean_comes_closer_to_the_target_than_one_hit_must() {
        let mut state = 7_u64;
        let mut dice = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
        };
        // scatter of 2 % rms, every tenth hit an outlier
        let mut pulse = PulseLoop::new(&FORCE, 8_000);
        let mut peaks = Vec::new();
        for shot in 0..400 {
            let us = f64::from(pulse.pulse_us());
            let accident = if shot % 10 == 7 { 0.35 } else { 1.0 };
            let peak_n = (us - 1_000.0) * 0.022 * (1.0 + 0.07 * dice()) * accident;
            pulse.learn(PulseHit { pulse_us: pulse.pulse_us(), peak_n });
            if shot > 20 && accident == 1.0 {
                peaks.push(peak_n);
            }
        }
        let within = peaks.iter().filter(|peak| (*peak / 50.0 - 1.0).abs() <= 0.05).count();
        assert!(within * 10 > peaks.len() * 9, "{within} of {}", peaks.len());
    }

    #[test]
    fn never_leaves_its_bounds() {
        assert!(settle(|_, _| 0.0).iter().all(|hit| hit.pulse_us <= 8_000));
        assert!(settle(|_, _| 1e6).iter().all(|hit| hit.pulse_us >= 500));
        let mut capped = PulseLoop::new(&FORCE, 2_500);
        capped.learn(PulseHit { pulse_us: 2_500, peak_n: 0.0 });
        assert_eq!(capped.pulse_us(), 2_500);
    }

    #[test]
    fn a_good_hit_leaves_the_pulse_alone() {
        let mut pulse = PulseLoop::new(&FORCE, 8_000);
        pulse.learn(PulseHit { pulse_us: 3_000, peak_n: 51.5 });
        assert_eq!(pulse.pulse_us(), 3_000);
    }
}
