//! Checks on stored records: whether every channel has the sign that its role requires, and whether
//! hammer and vibrometer agree on a known mass.
//!
//! **Polarity.** A hit transfers energy to the point that it strikes: over the pulse, force times
//! velocity along it is positive, whatever the structure. The sign of a response is therefore Σ F v
//! / √(Σ F² Σ v²), in −1 … 1, over the kept hits along its axis, nearest first (on the paper's
//! campaign, simulated, 0.6 to 0.96 within 31 mm); a wrong plug or a turned head gives a clearly
//! negative value. A fixed sensor is judged at its own point, in every record of its part that was
//! struck along its measurement direction. The force itself pushes.
//!
//! Vibrometers on the specimens and load cells are further away, where the first motion depends on
//! how the structure rocks. They are judged by transforms at real frequencies, ∫ x e^(−σt) dt,
//! which contain no phase: there a structure has no resonance, and responds in the same way as to a
//! static force. The specimens follow hits along the sliding direction on A; their sign counts if
//! it is the same from the stiff to the inertial end, at every hit. A single load cell may be
//! relieved by such a hit, but all of them together carry its force: the signs of load cells are
//! those with which their sum equals the hammer's force. Where no signs give that sum, or more than
//! one choice does, these records do not determine them.
//!
//! **Ratio calibration.** On a free, rigid mass m the hammer's impulse is the change of momentum:
//! ∫F dt = m Δv, whatever the shape of the pulse. The ratio ∫F dt / (m Δv) is 1 if the
//! sensitivities of hammer and vibrometer are consistent; otherwise one of them is wrong by that
//! factor. (Established practice: ISO 7626-5, ratio calibration.)

use jointrig_protocol::channel::{Axis, Quantity, Role};
use jointrig_protocol::request::Configuration;

use super::plan::{ImpactPoint, Plan, ResponsePoint, SEPARATE, configuration_name};
use super::store::Store;
use super::store::error::StoreError;
use super::store::record_table::RecordRow;
use crate::device::channels::ChannelMap;
use crate::spectra::Pulse;
use std::collections::HashSet;

/// The hammer pushes for about this long, s.
const EARLY_S: f64 = 1e-3;
/// Real frequencies at which the specimens must move along the hit, 1/s: from below the first mode
/// of an assembly to above those of its clamps.
const SPECIMEN_PER_S: [f64; 4] = [200.0, 400.0, 800.0, 1600.0];
/// Real frequency at which load cells are compared with the hammer, 1/s: below the first mode of an
/// assembly, and above the drift of sensors.
const LOAD_PER_S: f64 = 100.0;
/// Largest rms deviation of the load cells' sum from the hammer's force, relative to it: supports
/// beside the cells take a part, and so does inertia.
const UNBALANCED: f64 = 0.25;
/// Number of load cells above which their signs are not looked for: all combinations are compared.
const MOST_LOAD_CELLS: usize = 10;
/// A transform covers this many time constants 1/σ.
const TIME_CONSTANTS: f64 = 5.0;
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
    /// A specimen's motion along the sliding direction.
    Specimen,
    /// The force of hits along the sliding direction.
    Load,
}

/// A kept record in SI units, and its hit direction.
struct CheckedHit {
    record: i64,
    direction: [f64; 3],
    map: ChannelMap,
    /// With a force that pushes.
    signals: Vec<Vec<f64>>,
    /// Whether the force has this sign in the record.
    pushes: bool,
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
    let map = plan.along_sliding(store.channels(last.session)?);
    let loads = load_signs(store, &plan, &rows, &map)?;
    let mut found = Vec::new();
    for (place, channel) in map.channels.iter().enumerate() {
        let name: String = channel.name.as_str().into();
        let felt = match (plan.sensor_on(&channel.name), channel.role) {
            (Some((point, direction)), _) => Felt::Fixed(point, direction),
            (None, Role::HammerForce) => Felt::Force,
            (None, Role::Response(axis)) => Felt::Aimed(unit(axis)),
            (None, Role::SpecimenA | Role::SpecimenB) => Felt::Specimen,
            (None, Role::LoadCell) => {
                found.extend(loads.iter().find(|own| own.channel == name).cloned());
                continue;
            }
            _ => continue,
        };
        let mut candidates = candidates(store, &plan, &rows, &felt)?;
        candidates.truncate(HITS);
        let (mut signs, mut records) = (Vec::new(), Vec::new());
        for row in candidates {
            let Some(hit) = hit(store, &plan, row)? else { continue };
            let own = hit.map.channels.iter().position(|other| other.name == channel.name);
            let sign = own.and_then(|own| match felt {
                Felt::Aimed(direction) | Felt::Fixed(_, direction) => power_sign(&hit, own, direction),
                Felt::Specimen => specimen_sign(&hit, own, plan.sliding()),
                Felt::Force => early_sign(&hit, own),
                Felt::Load => None,
            });
            if let Some(sign) = sign {
                signs.push(sign);
                records.push(hit.record);
            }
        }
        let mean = signs.iter().sum::<f64>() / signs.len().max(1) as f64;
        let opposed = matches!(felt, Felt::Specimen) && signs.iter().any(|sign| sign * mean < 0.0);
        let sign = (!signs.is_empty()).then_some(if opposed { 0.0 } else { mean });
        log::debug!("{name} (place {place}): {sign:?}");
        found.push(Polarity { channel: name, sign, records });
    }
    Ok(found)
}

/// The signs of all load cells that measure along the sliding direction, as the plan defines their
/// orientation.
fn load_signs(
    store: &Store,
    plan: &Plan,
    rows: &[RecordRow],
    map: &ChannelMap,
) -> Result<Vec<Polarity>, StoreError> {
    let cells = plan.load_cells(map);
    let names: Vec<&str> = cells.iter().map(|(place, _)| map.channels[*place].name.as_str()).collect();
    let (mut hits, mut records) = (Vec::new(), Vec::new());
    for row in candidates(store, plan, rows, &Felt::Load)?.into_iter().take(HITS) {
        let Some(hit) = hit(store, plan, row)? else { continue };
        let own = plan.load_cells(&hit.map);
        let named = own.iter().map(|(place, _)| hit.map.channels[*place].name.as_str());
        if named.eq(names.iter().copied())
            && let Some(shares) = load_shares(&hit, &own, plan.sliding())
        {
            hits.push(shares);
            records.push(hit.record);
        }
    }
    let signs = signs_of_shares(&hits, cells.len());
    let one = |(cell, name): (usize, &str)| Polarity {
        channel: name.into(),
        sign: signs.as_ref().map(|signs| signs[cell]),
        records: records.clone(),
    };
    Ok(names.into_iter().enumerate().map(one).collect())
}

/// The part of the hammer's force along the sliding direction that each load cell carries.
fn load_shares(hit: &CheckedHit, cells: &[(usize, f64)], sliding: [f64; 3]) -> Option<Vec<f64>> {
    let force = transform(hit, hit.map.place(Role::HammerForce)?, LOAD_PER_S)?;
    let along = force * dot(&hit.direction, &sliding);
    let share = |(place, part): &(usize, f64)| Some(part * transform(hit, *place, LOAD_PER_S)? / along);
    cells.iter().map(share).collect()
}

/// The sign of each load cell with which the `shares` of every hit sum to 1, times how much worse
/// the sum is with its opposite; 0 where the sum does not tell. `None` without a hit.
fn signs_of_shares(hits: &[Vec<f64>], cells: usize) -> Option<Vec<f64>> {
    if hits.is_empty() {
        return None;
    }
    if cells > MOST_LOAD_CELLS {
        return Some(vec![0.0; cells]);
    }
    let sign = |choice: usize, cell: usize| if choice >> cell & 1 == 0 { 1.0 } else { -1.0 };
    let misfit = |choice: usize| {
        let sum = |shares: &Vec<f64>| (0..cells).map(|cell| sign(choice, cell) * shares[cell]).sum::<f64>();
        (hits.iter().map(|shares| (sum(shares) - 1.0).powi(2)).sum::<f64>() / hits.len() as f64).sqrt()
    };
    let misfits: Vec<f64> = (0..1 << cells).map(misfit).collect();
    let least = |wanted: &dyn Fn(usize) -> bool| {
        (0..misfits.len()).filter(|choice| wanted(*choice)).min_by(|a, b| misfits[*a].total_cmp(&misfits[*b]))
    };
    let best = least(&|_| true)?;
    if misfits[best] > UNBALANCED {
        return Some(vec![0.0; cells]);
    }
    let of_cell = |cell: usize| {
        let own = sign(best, cell);
        let other = least(&|choice| sign(choice, cell) != own)?;
        Some(own * (misfits[other] - misfits[best]).min(1.0))
    };
    (0..cells).map(of_cell).collect()
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
            // the known mass moves nothing else, nor does A while the joint is open
            if SEPARATE.contains(&impact.grouping) && !matches!(felt, Felt::Force | Felt::Aimed(_)) {
                return None;
            }
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
                // moves only in the assembly, where the force path leads from A's side to B
                Felt::Specimen => {
                    let slides = along(&impact.direction, &plan.sliding());
                    (slides && assembly && impact.grouping % 2 == 1, looked_at)
                }
                // A alone does not touch the load cells
                Felt::Load => {
                    let slides = along(&impact.direction, &plan.sliding());
                    (slides && cell.configuration != Configuration::A, looked_at)
                }
            };
            let apart: f64 = (0..3).map(|i| (impact.position_m[i] - at.position_m[i]).powi(2)).sum();
            told.then_some((apart.sqrt(), row))
        })
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.id.cmp(&b.1.id)));
    let mut near: Vec<&RecordRow> = near.into_iter().map(|(_, row)| row).collect();
    if matches!(felt, Felt::Specimen | Felt::Load) {
        // the aim does not matter to these: one hit of every place tells more than many of one
        let place = |row: &RecordRow| {
            let cell = cells.iter().find(|cell| cell.id == row.cell).map(|cell| &cell.cell);
            cell.map(|cell| (configuration_name(cell.configuration), cell.impact.clone()))
        };
        let mut seen = HashSet::new();
        near.retain(|row| seen.insert(place(row)));
    }
    Ok(near)
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
    let map = plan.along_sliding(store.channels(row.session)?);
    let mut signals: Vec<Vec<f64>> =
        (0..map.len()).map(|place| map.to_si(place, samples.channel(place))).collect();
    let Some(force) = map.place(Role::HammerForce) else { return Ok(None) };
    let largest = |sign: f64| signals[force].iter().map(|force| sign * force).fold(0.0, f64::max);
    let pushes = largest(1.0) >= largest(-1.0);
    if !pushes {
        // the other channels are compared with the force that acts
        signals[force].iter_mut().for_each(|force| *force = -*force);
    }
    let pulse = Pulse::locate(&signals[force]);
    let found = pulse.zip(impact(plan, &cell.cell.impact));
    Ok(found.map(|(pulse, impact)| CheckedHit {
        record: row.id,
        direction: impact.direction,
        map,
        signals,
        pushes,
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

/// The mean over the rms of the force in the first millisecond, positive for a push.
fn early_sign(hit: &CheckedHit, place: usize) -> Option<f64> {
    let length = (EARLY_S * hit.map.fs_hz()) as usize;
    let early = moved(hit, place, length)?;
    let mean = early.iter().sum::<f64>() / early.len() as f64;
    let rms = (early.iter().map(|value| value.powi(2)).sum::<f64>() / early.len() as f64).sqrt();
    let sign = if hit.pushes { 1.0 } else { -1.0 };
    (rms > 0.0).then_some(sign * mean / rms)
}

/// 1 if a specimen moves along the hit at all real frequencies, −1 if against it, otherwise 0. It
/// does not matter whether the channel measures displacement, velocity or acceleration: their
/// transforms differ by factors σ.
fn specimen_sign(hit: &CheckedHit, place: usize, sliding: [f64; 3]) -> Option<f64> {
    let force = hit.map.place(Role::HammerForce)?;
    let along = dot(&hit.direction, &sliding).signum();
    let one = |sigma: &f64| {
        Some(along * (transform(hit, place, *sigma)? * transform(hit, force, *sigma)?).signum())
    };
    let signs: Vec<f64> = SPECIMEN_PER_S.iter().map(one).collect::<Option<_>>()?;
    Some(if signs.iter().all(|sign| *sign == signs[0]) { signs[0] } else { 0.0 })
}

/// ∫ x e^(−σt) dt of a channel from the pulse's start on.
fn transform(hit: &CheckedHit, place: usize, sigma_per_s: f64) -> Option<f64> {
    let rate = hit.map.fs_hz();
    let moved = moved(hit, place, (TIME_CONSTANTS / sigma_per_s * rate) as usize)?;
    let decay = (-sigma_per_s / rate).exp();
    let sum = moved.iter().rev().fold(0.0, |sum, value| value + decay * sum);
    Some(sum / rate)
}

/// A channel's change against its rest before the pulse, for `length` samples from the pulse's
/// start on.
fn moved(hit: &CheckedHit, place: usize, length: usize) -> Option<Vec<f64>> {
    let rate = hit.map.fs_hz();
    let channel = hit.map.channels.get(place)?;
    let late = (f64::from(channel.delay_ns) * 1e-9 * rate) as usize;
    let (signal, from) = (hit.signals.get(place)?, hit.pulse.start + late);
    let before = signal.get(from.checked_sub((REST_S * rate) as usize)?..from)?;
    let rest = before.iter().sum::<f64>() / before.len().max(1) as f64;
    Some(signal.get(from..from + length)?.iter().map(|value| value - rest).collect())
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
