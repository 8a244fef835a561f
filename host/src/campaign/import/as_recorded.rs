//! Imported records as the samples of a campaign file: in SI units, with every digit.
//!
//! A channel whose values are all exact in single precision is stored as that, which is what a file
//! of single-precision samples in SI units holds; any other in double precision. Both are read back
//! bit for bit.

use jointrig_protocol::channel::{Axis, Channel, Quantity, Role};

use crate::device::channels::ChannelMap;
use crate::device::samples::{ChannelSamples, Samples};
use crate::spectra::{ImpactRecords, MotionQuantity};

/// The channels of the records, and the samples of each hit.
///
/// # Errors
/// The number of responses differs from the plan's, or values are not finite.
pub fn as_recorded(records: &ImpactRecords, axes: usize) -> Result<(ChannelMap, Vec<Samples>), String> {
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
    let kinds = kinds.get(..1 + axes).ok_or_else(|| format!("there are {axes} responses: three at most"))?;
    let signal = |hit: usize, place: usize| -> &[f64] {
        if place == 0 { &records.force_n[hit] } else { &records.response[hit][place - 1] }
    };
    let hits = records.force_n.len();
    let mut map = ChannelMap { id: 0, rate_hz: rate_hz as u32, exact_hz, channels: Vec::new() };
    let mut single = Vec::new();
    for (place, (name, role, quantity)) in kinds.iter().copied().enumerate() {
        for hit in 0..hits {
            if let Some(sample) = signal(hit, place).iter().position(|v| !v.is_finite()) {
                return Err(format!("hit {hit}, {name}, sample {sample} is not a number: remove the hit"));
            }
        }
        single.push((0..hits).all(|hit| signal(hit, place).iter().all(|v| exact_in_single(*v))));
        map.channels.push(Channel {
            name: name.parse().map_err(|_| format!("the name `{name}` is too long"))?,
            role,
            quantity,
            // the samples are in SI units, and the converter behind them is unknown
            units_per_volt: 1.0,
            range_v: 0.0,
            delay_ns: 0,
            bits: 0,
        });
    }
    let of_hit = |hit: usize| {
        let of_channel = |place: usize| {
            let own = signal(hit, place);
            if single[place] {
                ChannelSamples::F32(own.iter().map(|v| *v as f32).collect())
            } else {
                ChannelSamples::F64(own.to_vec())
            }
        };
        Samples::new((0..kinds.len()).map(of_channel).collect())
            .ok_or_else(|| format!("hit {hit}: its force and its responses differ in length"))
    };
    Ok((map, (0..hits).map(of_hit).collect::<Result<_, _>>()?))
}

fn exact_in_single(value: f64) -> bool {
    f64::from(value as f32) == value
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::samples::SampleType;

    #[test]
    fn a_spike_in_one_hit_does_not_change_the_others_and_values_come_back_bit_for_bit() {
        let clean: Vec<f64> = (0..200).map(|i| (0.1 * f64::from(i)).sin()).collect();
        let mut spiked = clean.clone();
        spiked[50] = 1000.0;
        let records = ImpactRecords {
            fs_hz: 51_200.0,
            force_n: vec![clean.iter().map(|v| f64::from(*v as f32)).collect(); 3],
            response: vec![vec![clean.clone()], vec![spiked.clone()], vec![clean.clone()]],
            quantity: MotionQuantity::Velocity,
        };
        let (map, hits) = as_recorded(&records, 1).expect("one axis");
        assert_eq!(map.len(), 2);
        for (hit, samples) in hits.iter().enumerate() {
            assert_eq!(samples.types(), [SampleType::F32, SampleType::F64]);
            for (place, wanted) in [(0, &records.force_n[hit]), (1, &records.response[hit][0])] {
                let si = map.to_si(place, samples.channel(place));
                assert!(si.iter().zip(wanted).all(|(one, other)| one.to_bits() == other.to_bits()));
                assert_eq!(si.len(), wanted.len());
            }
        }
        assert!(hits[0] == hits[2] && hits[0] != hits[1]);
    }

    #[test]
    fn what_cannot_be_stored_is_refused() {
        let records = ImpactRecords {
            fs_hz: 51_200.0,
            force_n: vec![vec![0.0, 50.0, 0.1]; 2],
            response: vec![vec![vec![0.0; 3]; 2]; 2],
            quantity: MotionQuantity::Velocity,
        };
        assert!(as_recorded(&records, 3).expect_err("two axes").contains("x, y, z"));
        let mut broken = records.clone();
        broken.response[1][0][2] = f64::INFINITY;
        let said = as_recorded(&broken, 2).expect_err("not finite");
        assert!(said.contains("hit 1, x, sample 2"), "{said}");
        let mut short = records;
        short.response[1][1].pop();
        assert!(as_recorded(&short, 2).expect_err("too short").contains("hit 1"));
    }
}
