//! Converts imported records to 16-bit codes, the format of a campaign file.
//!
//! Hits of about the same size share their scales. A hit that is far larger than the others in a
//! channel (a spike, an overload) has separate scales, so that it does not coarsen theirs.

use jointrig_protocol::channel::{Axis, Channel, Quantity, Role};

use crate::device::channels::ChannelMap;
use crate::median::middle;
use crate::spectra::{ImpactRecords, MotionQuantity};

/// Magnitude of the code for a channel's largest value: below full scale, so that nothing is taken
/// for an overload.
const TOP_CODE: f64 = 32_000.0;

/// A hit shares the common scales if none of its channels exceeds this many times the channel's
/// median over the hits.
const LARGER: f64 = 8.0;

/// Hits with the same scales.
pub(super) struct Quantised {
    /// The scales.
    pub(super) map: ChannelMap,
    /// Indices of the hits in the records.
    pub(super) hits: Vec<usize>,
    /// Their codes, channel after channel.
    pub(super) codes: Vec<Vec<i16>>,
}

/// The records as 16-bit codes with their scales; every hit is in exactly one group.
///
/// # Errors
/// The number of responses differs from the plan's, or values are not finite.
pub(super) fn quantised(records: &ImpactRecords, axes: usize) -> Result<Vec<Quantised>, String> {
    let rate_hz = records.fs_hz.round();
    if !(1.0..=f64::from(u32::MAX)).contains(&rate_hz) {
        return Err(format!("the sampling rate is {} Hz: 1 Hz or more is needed", records.fs_hz));
    }
    let exact_hz = (rate_hz != records.fs_hz).then_some(records.fs_hz);
    let channels = records.response.first().map_or(0, Vec::len);
    if channels != axes {
        return Err(format!(
            "there are {channels} responses, and the plan says that the location has {axes} (three axes x, y, z, or `axes` of its own in \
             [[geometry.response]]): change the plan, or average the records with `jointrig frf` and import the FRFs"
        ));
    }
    let quantity = match records.quantity {
        MotionQuantity::Displacement => Quantity::Displacement,
        MotionQuantity::Velocity => Quantity::Velocity,
        MotionQuantity::Acceleration => Quantity::Acceleration,
    };
    let kinds = [
        ("force", Role::HammerForce, Quantity::Force),
        ("x", Role::Response(Axis::X), quantity),
        ("y", Role::Response(Axis::Y), quantity),
        ("z", Role::Response(Axis::Z), quantity),
    ];
    let signal = |hit: usize, place: usize| -> &[f64] {
        if place == 0 { &records.force_n[hit] } else { &records.response[hit][place - 1] }
    };
    let kinds: Vec<_> = kinds.into_iter().take(1 + axes).collect();
    let hits = records.force_n.len();
    // the largest value of each channel in each hit
    let mut largest = vec![vec![0.0f64; kinds.len()]; hits];
    for (hit, largest) in largest.iter_mut().enumerate() {
        for (place, largest) in largest.iter_mut().enumerate() {
            if let Some(sample) = signal(hit, place).iter().position(|v| !v.is_finite()) {
                let name = kinds[place].0;
                return Err(format!("hit {hit}, {name}, sample {sample} is not a number: remove the hit"));
            }
            *largest = signal(hit, place).iter().fold(0.0, |m, v| m.max(v.abs()));
        }
    }
    let usual: Vec<f64> = (0..kinds.len())
        .map(|place| middle(&largest.iter().map(|of_hit| of_hit[place]).collect::<Vec<_>>()).unwrap_or(0.0))
        .collect();
    let alike = |hit: &usize| largest[*hit].iter().zip(&usual).all(|(own, usual)| *own <= LARGER * usual);
    let (together, alone): (Vec<usize>, Vec<usize>) = (0..hits).partition(alike);
    let groups = std::iter::once(together).chain(alone.into_iter().map(|hit| vec![hit]));
    groups
        .filter(|group| !group.is_empty())
        .map(|group| {
            let mut map = ChannelMap { id: 0, rate_hz: rate_hz as u32, exact_hz, channels: Vec::new() };
            for (place, (name, role, quantity)) in kinds.iter().copied().enumerate() {
                let largest = group.iter().fold(0.0f64, |m, hit| m.max(largest[*hit][place]));
                let range_v = 10.0f32;
                // code 32000 for the largest value; the scale is rounded to a float
                let units_per_volt = (largest.max(1e-30) * 32_768.0 / TOP_CODE / f64::from(range_v)) as f32;
                map.channels.push(Channel {
                    name: name.parse().map_err(|_| format!("the name `{name}` is too long"))?,
                    role,
                    quantity,
                    units_per_volt,
                    range_v,
                    delay_ns: 0,
                    bits: 16,
                });
            }
            let of_hit = |hit: &usize| {
                (0..map.len())
                    .flat_map(|place| {
                        let unit = map.channels[place].units_per_code();
                        signal(*hit, place).iter().map(move |v| (v / unit).round() as i16)
                    })
                    .collect()
            };
            let codes = group.iter().map(of_hit).collect();
            Ok(Quantised { map, hits: group, codes })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_bits_keep_each_channel_to_its_own_rounding() {
        let records = ImpactRecords {
            fs_hz: 51_200.0,
            force_n: vec![vec![0.0, 50.0, 0.1], vec![0.0, -25.0, 0.0]],
            response: vec![vec![vec![1e-6, -2e-3, 0.0], vec![0.0; 3], vec![1.0, 2.0, 3.0]]; 2],
            quantity: MotionQuantity::Velocity,
        };
        let groups = quantised(&records, 3).expect("three axes");
        let Quantised { map, codes, .. } = &groups[0];
        for (place, wanted) in
            [(0, &records.force_n[0]), (1, &records.response[0][0]), (3, &records.response[0][2])]
        {
            let unit = map.channels[place].units_per_code();
            for (code, value) in codes[0][3 * place..].iter().zip(wanted) {
                assert!((f64::from(*code) * unit - value).abs() <= 0.5001 * unit, "{place}");
                assert!(code.unsigned_abs() <= 32_001);
            }
        }
        let two = ImpactRecords { response: vec![vec![vec![0.0; 3]; 2]; 2], ..records };
        assert!(quantised(&two, 3).err().expect("two axes").contains("x, y, z"));
    }
    #[test]
    fn a_spike_in_one_hit_does_not_coarsen_the_others() {
        let clean: Vec<f64> = (0..200).map(|i| (0.1 * f64::from(i)).sin()).collect();
        let mut spiked = clean.clone();
        spiked[50] = 1000.0;
        let records = ImpactRecords {
            fs_hz: 51_200.0,
            force_n: vec![clean.clone(); 3],
            response: vec![vec![clean.clone()], vec![spiked.clone()], vec![clean.clone()]],
            quantity: MotionQuantity::Velocity,
        };
        let groups = quantised(&records, 1).expect("one axis");
        assert_eq!(groups.iter().map(|group| group.hits.clone()).collect::<Vec<_>>(), [vec![0, 2], vec![1]]);
        for (group, largest) in groups.iter().zip([1.0, 1000.0]) {
            let unit = group.map.channels[1].units_per_code();
            assert!((unit * TOP_CODE / largest - 1.0).abs() < 1e-2, "{unit}");
            let hit = group.hits[0];
            let codes = &group.codes[0][clean.len()..];
            for (code, value) in codes.iter().zip(&records.response[hit][0]) {
                assert!((f64::from(*code) * unit - value).abs() <= 0.5001 * unit);
            }
        }
    }
}
