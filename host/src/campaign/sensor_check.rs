//! Checks on stored records: whether every channel has the sign that its role requires, and whether
//! hammer and vibrometer agree on a known mass.
//!
//! **Polarity.** A hit transfers energy to the point that it strikes: over the pulse, force times
//! velocity along it is positive, whatever the structure. The sign of a response is therefore Σ F v
//! / √(Σ F² Σ v²), in −1 … 1, over the kept hits along its axis, nearest first (on the paper's
//! campaign, simulated, 0.6 to 0.96 within 31 mm); a wrong plug or a turned head gives a clearly
//! negative value. A fixed sensor is judged at its own point, in every record of its part that was
//! struck along its measurement direction. Vibrometers on the specimens and load cells are further
//! away, and follow hits along the sliding direction on A within the first millisecond: their sign
//! is the mean over the rms in that time; a load cell is positive when arm B moves along the
//! sliding direction. The same holds for the force itself: it pushes.
//!
//! **Ratio calibration.** On a free, rigid mass m the hammer's impulse is the change of momentum:
//! ∫F dt = m Δv, whatever the shape of the pulse. The ratio ∫F dt / (m Δv) is 1 if the
//! sensitivities of hammer and vibrometer are consistent; otherwise one of them is wrong by that
//! factor. (Established practice: ISO 7626-5, ratio calibration.)

use jointrig_protocol::channel::{Axis, Quantity, Role};
use jointrig_protocol::request::Configuration;

use super::plan::{ImpactPoint, Plan, ResponsePoint};
use super::store::Store;
use super::store::error::StoreError;
use super::store::record_table::RecordRow;
use crate::device::channels::ChannelMap;
use crate::spectra::Pulse;

/// The structure follows the force for about this long, s.
const EARLY_S: f64 = 1e-3;
/// A sign is clear if mean over rms is at least this in magnitude.
const CLEAR: f64 = 0.2;
/// Maximum number of hits evaluated per channel.
const HITS: usize = 12;
/// Time after the pulse's end in which a free mass moves uniformly, s.
const EVEN_S: [f64; 2] = [0.5e-3, 5e-3];
/// Rest before the pulse, s.
const REST_S: f64 = 2e-3;
/// Two directions count as parallel if the magnitude of their cosine is at least this.
const ALONG: f64 = 0.9;

/// The sign of one channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Polarity {
    /// The channel.
    pub channel: String,
    /// Sign measure, −1 … 1, averaged over the hits; `None` if no kept hit is usable.
    pub sign: Option<f64>,
    /// Records that it is based on.
    pub records: Vec<i64>,
}

impl Polarity {
    /// Whether the sign is right; `None` if these records do not determine it.
    pub fn right(&self) -> Option<bool> {
        self.sign.filter(|sign| sign.abs() >= CLEAR).map(|sign| sign > 0.0)
    }
}

/// Hammer against vibrometer on a known mass.
#[derive(Clone, Debug, PartialEq)]
pub struct Ratio {
    /// Mean of ∫F dt / (m Δv) over the hits.
    pub mean: f64,
    /// Its standard deviation from hit to hit; 0 for one hit.
    pub deviation: f64,
    /// Records that it is based on.
    pub records: Vec<i64>,
}

/// What a channel measures.
enum Felt<'a> {
    /// The hammer's force.
    Force,
    /// The motion along a unit vector, at the point that the vibrometer measures in that cell.
    Aimed([f64; 3]),
    /// The motion along a unit vector, at the point of a fixed sensor.
    Fixed(&'a ResponsePoint, [f64; 3]),
    /// The contact's motion or force along the sliding direction.
    Contact,
}

/// A kept record in SI units, and its hit direction.
struct CheckedHit {
    record: i64,
    direction: [f64; 3],
    map: ChannelMap,
    signals: Vec<Vec<f64>>,
    pulse: Pulse,
}

/// The sign of every channel that the kept records determine.
///
/// # Errors
/// The file cannot be read.
pub fn polarity(store: &Store) -> Result<Vec<Polarity>, StoreError> {
    let plan = store.plan()?;
    let rows = kept(store, |_| true)?;
    let Some(last) = rows.last() else { return Ok(Vec::new()) };
    let map = store.channels(last.session)?;
    let cells = plan.load_cells(&map);
    let mut found = Vec::new();
    for (place, channel) in map.channels.iter().enumerate() {
        let felt = match (plan.sensor_on(&channel.name), channel.role) {
            (Some((point, direction)), _) => Felt::Fixed(point, direction),
            (None, Role::HammerForce) => Felt::Force,
            (None, Role::Response(axis)) => Felt::Aimed(unit(axis)),
            (None, Role::SpecimenA | Role::SpecimenB | Role::LoadCell) => Felt::Contact,
            _ => continue,
        };
        // the plan defines a load cell's orientation; a cell perpendicular to the sliding direction
        // yields no sign
        let sense = match cells.iter().find(|(cell, _)| *cell == place) {
            Some((_, part)) => part.signum(),
            None if channel.role == Role::LoadCell => continue,
            None => 1.0,
        };
        let mut candidates = candidates(store, &plan, &rows, &felt)?;
        candidates.truncate(HITS);
        let (mut signs, mut records) = (Vec::new(), Vec::new());
        for row in candidates {
            let Some(hit) = hit(store, &plan, row)? else { continue };
            let own = hit.map.channels.iter().position(|other| other.name == channel.name);
            let sign = own.and_then(|own| match felt {
                Felt::Aimed(direction) | Felt::Fixed(_, direction) => power_sign(&hit, own, direction),
                Felt::Force => early_sign(&hit, own, None),
                Felt::Contact => early_sign(&hit, own, Some(plan.sliding())),
            });
            if let Some(sign) = sign {
                signs.push(sense * sign);
                records.push(hit.record);
            }
        }
        let mean = signs.iter().sum::<f64>() / signs.len().max(1) as f64;
        let sign = (!signs.is_empty()).then_some(mean);
        log::debug!("{} (place {place}): {sign:?}", channel.name);
        found.push(Polarity { channel: channel.name.as_str().into(), sign, records });
    }
    Ok(found)
}

/// Hammer against vibrometer in the cell with that id, struck on a free mass of `mass_kg`; `None`
/// without a kept hit.
///
/// # Errors
/// The file cannot be read.
pub fn ratio(store: &Store, cell: i64, mass_kg: f64) -> Result<Option<Ratio>, StoreError> {
    let plan = store.plan()?;
    let (mut ratios, mut records) = (Vec::new(), Vec::new());
    for row in kept(store, |row| row.cell == cell)? {
        if let Some(hit) = hit(store, &plan, &row)?
            && let Some(ratio) = momentum_ratio(&hit, mass_kg)
        {
            ratios.push(ratio);
            records.push(hit.record);
        }
    }
    let n = ratios.len() as f64;
    if ratios.is_empty() {
        return Ok(None);
    }
    let mean = ratios.iter().sum::<f64>() / n;
    let spread = ratios.iter().map(|ratio| (ratio - mean).powi(2)).sum::<f64>();
    let deviation = if ratios.len() > 1 { (spread / (n - 1.0)).sqrt() } else { 0.0 };
    Ok(Some(Ratio { mean, deviation, records }))
}

fn kept(store: &Store, wanted: impl Fn(&RecordRow) -> bool) -> Result<Vec<RecordRow>, StoreError> {
    Ok(store.records()?.into_iter().flatten().filter(|row| row.kept() && wanted(row)).collect())
}

/// Records whose hits are parallel to the channel's measurement direction, the nearest to its
/// position first.
fn candidates<'a>(
    store: &Store,
    plan: &Plan,
    rows: &'a [RecordRow],
    felt: &Felt<'_>,
) -> Result<Vec<&'a RecordRow>, StoreError> {
    let cells = store.cells()?;
    let mut near: Vec<(f64, &RecordRow)> = rows
        .iter()
        .filter_map(|row| {
            let cell = &cells.iter().find(|cell| cell.id == row.cell)?.cell;
            let impact = impact(plan, &cell.impact)?;
            let looked_at = plan.response(&cell.response)?;
            let assembly = cell.configuration == Configuration::Ajb;
            let (told, at) = match felt {
                Felt::Force => (true, looked_at),
                // in the cells of a fixed sensor the vibrometer is aimed nowhere
                Felt::Aimed(direction) => {
                    (looked_at.channels.is_none() && along(&impact.direction, direction), looked_at)
                }
                // on the other side of the contact, the first motion need not have the hit's sign
                Felt::Fixed(point, direction) => {
                    let same_part = impact.grouping % 2 == point.grouping % 2;
                    (same_part && along(&impact.direction, direction), *point)
                }
                // these respond only in the assembly, where the force path leads from A's side to B
                Felt::Contact => {
                    let slides = along(&impact.direction, &plan.sliding());
                    (slides && assembly && impact.grouping % 2 == 1, looked_at)
                }
            };
            let apart: f64 = (0..3).map(|i| (impact.position_m[i] - at.position_m[i]).powi(2)).sum();
            told.then_some((apart.sqrt(), row))
        })
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.id.cmp(&b.1.id)));
    Ok(near.into_iter().map(|(_, row)| row).collect())
}

fn impact<'a>(plan: &'a Plan, name: &str) -> Option<&'a ImpactPoint> {
    plan.geometry.impact.iter().map(toml::Spanned::get_ref).find(|point| point.name == name)
}

fn along(a: &[f64; 3], b: &[f64; 3]) -> bool {
    dot(a, b).abs() >= ALONG
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A record in SI units; `None` if it is damaged or has no pulse.
fn hit(store: &Store, plan: &Plan, row: &RecordRow) -> Result<Option<CheckedHit>, StoreError> {
    let Some(cell) = store.cells()?.into_iter().find(|cell| cell.id == row.cell) else { return Ok(None) };
    let samples = match store.samples(row) {
        Ok(samples) => samples,
        Err(error @ StoreError::Damaged { .. }) => {
            log::warn!("{error}");
            return Ok(None);
        }
        Err(error) => return Err(error),
    };
    let map = store.channels(row.session)?;
    let signals: Vec<Vec<f64>> =
        (0..map.len()).map(|place| map.to_si(place, samples.channel(place))).collect();
    let pulse = map.place(Role::HammerForce).and_then(|place| Pulse::locate(&signals[place]));
    let found = pulse.zip(impact(plan, &cell.cell.impact));
    Ok(found.map(|(pulse, impact)| CheckedHit {
        record: row.id,
        direction: impact.direction,
        map,
        signals,
        pulse,
    }))
}

/// Force times velocity along the hit, summed over the pulse and normalised to −1 … 1.
fn power_sign(hit: &CheckedHit, place: usize, felt: [f64; 3]) -> Option<f64> {
    let rate = hit.map.fs_hz();
    let channel = hit.map.channels.get(place)?;
    let late = (f64::from(channel.delay_ns) * 1e-9 * rate) as usize;
    let (force, signal) = (hit.signals.get(hit.map.place(Role::HammerForce)?)?, hit.signals.get(place)?);
    let Pulse { start, end, offset_n, .. } = hit.pulse;
    let before = signal.get((start + late).checked_sub((REST_S * rate) as usize)?..start + late)?;
    let rest = before.iter().sum::<f64>() / before.len().max(1) as f64;
    let moved = signal.get(start + late..end + late)?.iter().map(|value| value - rest);
    // the scale does not affect the sign
    let velocity: Vec<f64> = match channel.quantity {
        Quantity::Velocity => moved.collect(),
        Quantity::Acceleration => running_sum(moved),
        Quantity::Displacement => differences(moved),
        Quantity::Force | Quantity::Voltage => return None,
    };
    let (mut both, mut forces, mut motions) = (0.0, 0.0, 0.0);
    for (f, v) in force.get(start..end)?.iter().map(|f| f - offset_n).zip(velocity) {
        both += f * v;
        forces += f * f;
        motions += v * v;
    }
    let most = (forces * motions).sqrt();
    (most > 0.0).then_some(dot(&hit.direction, &felt).signum() * both / most)
}

fn running_sum(values: impl Iterator<Item = f64>) -> Vec<f64> {
    values
        .scan(0.0, |sum, value| {
            *sum += value;
            Some(*sum)
        })
        .collect()
}

fn differences(values: impl Iterator<Item = f64>) -> Vec<f64> {
    values.scan(0.0, |before, value| Some(value - std::mem::replace(before, value))).collect()
}

/// The mean over the rms of a channel in the first millisecond, positive along the hit (for the
/// force itself: positive for a push).
fn early_sign(hit: &CheckedHit, place: usize, felt: Option<[f64; 3]>) -> Option<f64> {
    let rate = hit.map.fs_hz();
    let channel = &hit.map.channels[place];
    let late = (f64::from(channel.delay_ns) * 1e-9 * rate) as usize;
    let (signal, from) = (hit.signals.get(place)?, hit.pulse.start + late);
    let before = signal.get(from.checked_sub((REST_S * rate) as usize)?..from)?;
    let rest = before.iter().sum::<f64>() / before.len().max(1) as f64;
    let early = signal.get(from..from + (EARLY_S * rate) as usize)?;
    let mean = early.iter().map(|value| value - rest).sum::<f64>() / early.len() as f64;
    let rms = (early.iter().map(|value| (value - rest).powi(2)).sum::<f64>() / early.len() as f64).sqrt();
    let along = felt.map_or(1.0, |felt| dot(&hit.direction, &felt).signum());
    (rms > 0.0).then_some(along * mean / rms)
}

/// ∫F dt / (m Δv) along the hit.
fn momentum_ratio(hit: &CheckedHit, mass_kg: f64) -> Option<f64> {
    let rate = hit.map.fs_hz();
    let samples = |seconds: f64| (seconds * rate) as usize;
    let force = &hit.signals[hit.map.place(Role::HammerForce)?];
    let Pulse { start, end, offset_n, .. } = hit.pulse;
    // the foot below 2 % of the peak contributes to the impulse too
    let margin = (end - start) / 4;
    let impulse: f64 =
        force.get(start.saturating_sub(margin)..end + margin)?.iter().map(|f| f - offset_n).sum::<f64>()
            / rate;
    let mut change = 0.0;
    for (axis, place) in hit.map.responses().filter(|axes| axes.len() == 3)?.into_iter().enumerate() {
        let (signal, channel) = (&hit.signals[place], &hit.map.channels[place]);
        if channel.quantity != Quantity::Velocity {
            return None;
        }
        let late = (f64::from(channel.delay_ns) * 1e-9 * rate) as usize;
        let mean = |range: std::ops::Range<usize>| {
            let part = signal.get(range)?;
            Some(part.iter().sum::<f64>() / part.len().max(1) as f64)
        };
        let before = mean((start + late).checked_sub(samples(REST_S) + margin)?..start + late - margin)?;
        let after = mean(end + late + samples(EVEN_S[0])..end + late + samples(EVEN_S[1]))?;
        change += hit.direction[axis] * (after - before);
    }
    (change != 0.0).then(|| impulse / (mass_kg * change))
}

fn unit(axis: Axis) -> [f64; 3] {
    match axis {
        Axis::X => [1.0, 0.0, 0.0],
        Axis::Y => [0.0, 1.0, 0.0],
        Axis::Z => [0.0, 0.0, 1.0],
    }
}

#[cfg(test)]
#[path = "sensor_check_tests.rs"]
mod tests;
