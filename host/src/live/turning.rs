//! The shaker's current loop: the last received cycle, unprocessed. It is for display only; results
//! are computed from stored data.

use crate::campaign::plan::level::Level;
use crate::campaign::run::shaking::record;
use crate::campaign::store::record_row::Samples;
use crate::device::channels::ChannelMap;
use crate::device::recording::by_channel;
use crate::hysteresis::RelativeMotion;
use crate::hysteresis::cycles::closed_cycle;

/// Most points of a loop on the screen.
const POINTS: usize = 180;

/// Relative displacement (µm) and force (N) over the last whole cycle in these codes (one scan
/// after another); `None` where a channel or a cycle is missing, or during a sweep.
pub fn turn(
    channels: &ChannelMap,
    load_cells: &[(usize, f64)],
    codes: &[i16],
    level: &Level,
) -> Option<[Vec<f64>; 2]> {
    let count = channels.len();
    let cycle = (f64::from(channels.rate_hz) / level.frequency_hz).round() as usize;
    let scans = codes.len().checked_div(count)?;
    // the alignment of the channels in time makes both ends of the record invalid
    let spare = cycle / 8;
    if level.end_hz.is_some() || cycle < 8 || scans < cycle + 2 * spare {
        return None;
    }
    let from = scans - cycle - 2 * spare;
    let samples = Samples { codes: by_channel(&codes[from * count..scans * count], count), channels: count };
    let record = record(channels, load_cells, &samples, level).ok()?;
    let RelativeMotion::Velocity { a_m_per_s, b_m_per_s } = &record.motion else { return None };
    let length = a_m_per_s.len().min(b_m_per_s.len()).min(record.force_n.len());
    let from = length.checked_sub(cycle + spare)?;
    let within = from..from + cycle;
    let apart = a_m_per_s[within.clone()].iter().zip(&b_m_per_s[within.clone()]);
    let velocity: Vec<f64> = apart.map(|(a, b)| a - b).collect();
    let mut x = Vec::new();
    closed_cycle(&velocity, 1.0 / record.fs_hz, &mut x);
    let force = &record.force_n[within];
    let mean = force.iter().sum::<f64>() / cycle as f64;
    let step = cycle.div_ceil(POINTS);
    // repeats the first point, which closes the loop
    let closed = |values: &[f64], of: &dyn Fn(f64) -> f64| -> Vec<f64> {
        values.iter().step_by(step).chain(values.first()).map(|value| of(*value)).collect()
    };
    Some([closed(&x, &|x| 1e6 * x), closed(force, &|force| force - mean)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::plan::level::Held;
    use jointrig_protocol::channel::{Channel, Quantity, Role};
    use std::f64::consts::TAU;

    #[test]
    fn an_ellipse_comes_out_with_its_axes() {
        let channel = |role, quantity, units_per_volt| Channel {
            name: "c".parse().expect("short"),
            role,
            quantity,
            units_per_volt,
            range_v: 10.0,
            delay_ns: 0,
            bits: 16,
        };
        let channels = ChannelMap {
            id: 0,
            rate_hz: 51_200,
            exact_hz: None,
            channels: vec![
                channel(Role::SpecimenA, Quantity::Velocity, 1e-3),
                channel(Role::SpecimenB, Quantity::Velocity, 1e-3),
                channel(Role::LoadCell, Quantity::Force, 10.0),
            ],
        };
        // x_A − x_B = 2 µm sin ωt, F = 30 N sin ωt + 5 N cos ωt plus a constant 3 N
        let level = Level { frequency_hz: 100.0, end_hz: None, held: Held::Displacement, amplitude: 2e-6 };
        let omega = TAU * 100.0;
        let code =
            |place: usize, value: f64| (value / channels.channels[place].units_per_code()).round() as i16;
        let codes: Vec<i16> = (0..5_120)
            .flat_map(|scan| {
                let (sin, cos) = (omega * f64::from(scan) / 51_200.0).sin_cos();
                [
                    code(0, 1.5e-6 * omega * cos),
                    code(1, -0.5e-6 * omega * cos),
                    code(2, 3.0 + 30.0 * sin + 5.0 * cos),
                ]
            })
            .collect();
        let [x, force] = turn(&channels, &[(2, 1.0)], &codes, &level).expect("whole cycles");
        assert_eq!(x.len(), force.len());
        let most = |all: &[f64]| all.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        assert!((most(&x) - 2.0).abs() < 0.02, "{}", most(&x));
        assert!((most(&force) - 30_f64.hypot(5.0)).abs() < 0.1, "{}", most(&force));
        // at the largest x the force is the elastic part, at zero x the dissipative one
        let middle = x.iter().zip(&force).min_by(|a, b| a.0.abs().total_cmp(&b.0.abs())).expect("points");
        assert!((middle.1.abs() - 5.0).abs() < 1.5, "{middle:?}");
        assert_eq!(turn(&channels, &[(2, 1.0)], &codes[..3 * 512], &level), None, "not a cycle and its ends");
        assert_eq!(turn(&channels, &[(2, 1.0)], &codes, &Level { end_hz: Some(200.0), ..level }), None);
    }
}
