//! A stored level as a hysteresis record: only scales, sums and delays are applied.

use jointrig_protocol::channel::{Quantity, Role};
use rayon::prelude::*;

use crate::campaign::plan::level::Level;
use crate::campaign::store::record_row::Samples;
use crate::device::channels::ChannelMap;
use crate::hysteresis::record::in_step;
use crate::hysteresis::{HysteresisRecord, RelativeMotion};

/// Why a level's channels do not yield a hysteresis record.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("its session has no {0}")]
pub struct Unusable(&'static str);

/// v_A, v_B and the load cells' sum, aligned in time; `cells` are
/// [`Plan::load_cells`](crate::campaign::plan::Plan::load_cells).
///
/// # Errors
/// A channel is missing.
pub fn record(
    channels: &ChannelMap,
    cells: &[(usize, f64)],
    samples: &Samples,
    level: &Level,
) -> Result<HysteresisRecord, Unusable> {
    let velocity = |role: Role, name: &'static str| {
        channels
            .place(role)
            .filter(|place| channels.channels[*place].quantity == Quantity::Velocity)
            .ok_or(Unusable(name))
    };
    let a = velocity(Role::SpecimenA, "velocity of specimen A")?;
    let b = velocity(Role::SpecimenB, "velocity of specimen B")?;
    let (first, _) = *cells.first().ok_or(Unusable("load cell along the sliding direction"))?;
    let late = |place: usize| f64::from(channels.channels[place].delay_ns) * 1e-9;
    let fs_hz = f64::from(channels.rate_hz);
    let signals = [&[(a, 1.0)][..], &[(b, 1.0)], cells].map(|places| sum(channels, samples, places));
    // all load cells share one amplifier and have the same delay
    let [a_m_per_s, b_m_per_s, force_n] = in_step(signals, [late(a), late(b), late(first)], fs_hz);
    Ok(HysteresisRecord {
        fs_hz,
        motion: RelativeMotion::Velocity { a_m_per_s, b_m_per_s },
        force_n,
        excitation_hz: level.end_hz.is_none().then_some(level.frequency_hz),
        normal_load_n: None,
    })
}

/// Samples converted per step, so that a sum of channels stays in the core's cache.
const CHUNK: usize = 1 << 14;

/// The sum of these channels in SI units, each weighted by its factor, computed on all cores.
fn sum(channels: &ChannelMap, samples: &Samples, places: &[(usize, f64)]) -> Vec<f64> {
    let Some((first, _)) = places.first() else { return Vec::new() };
    let mut sum = vec![0.0; samples.channel(*first).len()];
    sum.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, sum)| {
        for (n, (place, part)) in places.iter().enumerate() {
            let Some(channel) = channels.channels.get(*place) else { continue };
            let scale = channel.units_per_code() * part;
            let codes = &samples.channel(*place)[chunk * CHUNK..];
            let cell = |code: &i16| f64::from(*code) * scale;
            let pairs = sum.iter_mut().zip(codes);
            if n == 0 {
                // write without reading: reading fresh memory before the first write maps each page
                // twice, with an interrupt to every core
                pairs.for_each(|(sum, code)| *sum = 0.0 + cell(code));
            } else {
                pairs.for_each(|(sum, code)| *sum += cell(code));
            }
        }
    });
    sum
}
