//! Records from elsewhere as 16-bit codes, which is what a campaign file holds.

use jointrig_protocol::channel::{Axis, Channel, Quantity, Role};

use crate::device::channels::ChannelMap;
use crate::spectra::{ImpactRecords, MotionQuantity};

/// Codes on either side of zero that the largest value of a channel becomes: full scale stays free, so that nothing reads as overload.
const TOP_CODE: f64 = 32_000.0;

/// The records as 16-bit codes, channel after channel for each hit, with the scales that belong to them.
pub(super) fn quantised(records: &ImpactRecords, axes: usize) -> Result<(ChannelMap, Vec<Vec<i16>>), String> {
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
    let mut map = ChannelMap { id: 0, rate_hz: rate_hz as u32, exact_hz, channels: Vec::new() };
    for (place, (name, role, quantity)) in kinds.into_iter().take(1 + axes).enumerate() {
        let mut largest = 0.0f64;
        for hit in 0..records.force_n.len() {
            if let Some(sample) = signal(hit, place).iter().position(|v| !v.is_finite()) {
                return Err(format!("hit {hit}, {name}, sample {sample} is not a number: take the hit out"));
            }
            largest = signal(hit, place).iter().fold(largest, |m, v| m.max(v.abs()));
        }
        let range_v = 10.0f32;
        // code 32000 for the largest value, rounded up to what a float holds
        let units_per_volt = (largest.max(1e-30) * 32_768.0 / TOP_CODE / f64::from(range_v)) as f32;
        map.channels.push(Channel {
            name: name.parse().map_err(|_| format!("`{name}` is too long a name"))?,
            role,
            quantity,
            units_per_volt,
            range_v,
            delay_ns: 0,
            bits: 16,
        });
    }
    let codes = (0..records.force_n.len())
        .map(|hit| {
            (0..map.len())
                .flat_map(|place| {
                    let unit = map.channels[place].units_per_code();
                    signal(hit, place).iter().map(move |v| (v / unit).round() as i16)
                })
                .collect()
        })
        .collect();
    Ok((map, codes))
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
        let (map, codes) = quantised(&records, 3).expect("three axes");
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
        assert!(quantised(&two, 3).expect_err("two axes").contains("x, y, z"));
    }
}
