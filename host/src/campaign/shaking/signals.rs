//! A stored level as a hysteresis record: scales, sums and delays applied, nothing else.

use jointrig_protocol::channel::{Quantity, Role};

use crate::campaign::level::Level;
use crate::campaign::rows::Samples;
use crate::device::channels::ChannelMap;
use crate::hysteresis::delays::in_step;
use crate::hysteresis::{HysteresisRecord, RelativeMotion};

/// Why a level's channels make no hysteresis record.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("its session has no {0}")]
pub struct Unusable(&'static str);

/// v_A, v_B and the load cells' sum, in step with one another.
///
/// # Errors
/// A channel is missing.
pub fn record(channels: &ChannelMap, samples: &Samples, level: &Level) -> Result<HysteresisRecord, Unusable> {
    let velocity = |role: Role, name: &'static str| {
        channels
            .place(role)
            .filter(|place| channels.channels[*place].quantity == Quantity::Velocity)
            .ok_or(Unusable(name))
    };
    let a = velocity(Role::SpecimenA, "velocity of specimen A")?;
    let b = velocity(Role::SpecimenB, "velocity of specimen B")?;
    let cells = channels.places(Role::LoadCell);
    let first = *cells.first().ok_or(Unusable("load cell"))?;
    let mut force = vec![0.0; samples.channel(first).len()];
    for place in cells {
        force
            .iter_mut()
            .zip(channels.to_si(place, samples.channel(place)))
            .for_each(|(sum, value)| *sum += value);
    }
    let late = |place: usize| f64::from(channels.channels[place].delay_ns) * 1e-9;
    let fs_hz = f64::from(channels.rate_hz);
    let signals = [channels.to_si(a, samples.channel(a)), channels.to_si(b, samples.channel(b)), force];
    // one amplifier: the cells are alike
    let [a_m_per_s, b_m_per_s, force_n] = in_step(signals, [late(a), late(b), late(first)], fs_hz);
    Ok(HysteresisRecord {
        fs_hz,
        motion: RelativeMotion::Velocity { a_m_per_s, b_m_per_s },
        force_n,
        excitation_hz: level.end_hz.is_none().then_some(level.frequency_hz),
        normal_load_n: None,
    })
}
