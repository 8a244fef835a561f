use super::*;
use proptest::prelude::*;

const CODES: [SampleType; 3] = [SampleType::I16; 3];

#[test]
fn any_codes_come_back_and_any_flipped_bit_is_found() {
    let codes: Vec<i16> = (0..3_000_i64).map(|i| ((i * i * 7919 + i) % 65_536 - 32_768) as i16).collect();
    let samples = Samples::of_codes(&codes, 3);
    let crc = checksum(&samples);
    let blob = encode(&samples).expect("compresses");
    assert_eq!(decode(&blob, &CODES, 1_000, crc).expect("reads"), samples);
    let mut some = Vec::new();
    decode_each(&blob, &CODES, 1_000, &[2, 0, 3], |place, own| {
        let ChannelView::I16(own) = own else { unreachable!("16-bit codes") };
        some.push((place, own.to_vec()));
    })
    .expect("reads");
    assert_eq!(some, [(2, codes[2_000..].to_vec()), (0, codes[..1_000].to_vec()), (3, Vec::new())]);
    assert!(decode(&blob, &CODES, 1_000, crc ^ 1).is_err());
    assert!(decode(&blob[..blob.len() - 1], &CODES, 1_000, crc).is_err());
    for place in (0..blob.len()).step_by(97) {
        let mut bad = blob.clone();
        bad[place] ^= 0x10;
        // a padding bit may be unused; then the codes are intact (and the checksum over the
        // stored bytes is not)
        if let Ok(read) = decode(&bad, &CODES, 1_000, crc) {
            assert_eq!(read, samples);
        }
    }
    // chunks that are longer or shorter than the row claims, or of another type
    assert!(matches!(decode(&blob, &CODES, 999, crc), Err(CodecError::Shape)));
    assert!(matches!(decode(&blob, &CODES, 1_001, crc), Err(CodecError::Shape)));
    assert!(matches!(decode(&blob, &CODES[..2], 1_000, crc), Err(CodecError::Shape)));
    assert!(decode(&blob, &[SampleType::F32; 3], 1_000, crc).is_err());
    assert!(decode(&blob, &[SampleType::I32; 3], 1_000, crc).is_err());
    // and sizes beyond any memory
    for (channels, scans) in [(2, usize::MAX / 2), (16, 1_000_000_000), (16, 1 << 30)] {
        let types = vec![SampleType::I16; channels];
        assert!(matches!(decode(&blob, &types, scans, crc), Err(CodecError::Bomb { .. })));
    }
    let empty = Samples::of_codes(&[], 10);
    let blob = encode(&empty).expect("nothing");
    assert_eq!(decode(&blob, &[SampleType::I16; 10], 0, 0).expect("nothing"), empty);
}

#[test]
fn the_limit_counts_bytes_and_not_samples() {
    // 40 million samples of nothing: 80 MB in 16 bits, 320 MB in double precision
    let scans = 40_000_000;
    let blob = vec![0; 16 << 20];
    let bomb = |of| matches!(decode(&blob, &[of], scans, 0), Err(CodecError::Bomb { .. }));
    assert_eq!(SampleType::ALL.map(bomb), [false, false, false, false]);
    let bomb = |of| matches!(decode(&blob[..4 << 20], &[of], scans, 0), Err(CodecError::Bomb { .. }));
    assert_eq!(SampleType::ALL.map(bomb), [false, true, true, true]);
}

#[test]
fn the_checksum_is_zlibs() {
    let crc = |channel| checksum(&Samples::new(vec![channel]).expect("one"));
    let wanted = crc32fast::hash(b"12345678");
    assert_eq!(crc(ChannelSamples::I16(vec![0x3231, 0x3433, 0x3635, 0x3837])), wanted);
    assert_eq!(crc(ChannelSamples::I32(vec![0x3433_3231, 0x3837_3635])), wanted);
    let single = [0x3433_3231, 0x3837_3635].map(f32::from_bits).to_vec();
    assert_eq!(crc(ChannelSamples::F32(single)), wanted);
    assert_eq!(crc(ChannelSamples::F64(vec![f64::from_bits(0x3837_3635_3433_3231)])), wanted);
}

#[test]
fn what_is_no_number_is_neither_stored_nor_read() {
    let of = |last: f64| {
        Samples::new(vec![ChannelSamples::I16(vec![0, 0]), ChannelSamples::F64(vec![0.0, last])])
            .expect("equally long")
    };
    for last in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let said = encode(&of(last)).expect_err("refused").to_string();
        assert!(said.contains("sample 1 of channel 1"), "{said}");
    }
    let mut blob = encode(&of(1.0)).expect("numbers");
    let chunk = simple_compress(&[0.0, f64::NAN], &config(SampleType::F64)).expect("compresses");
    let first = 4 + u32::from_le_bytes(*blob.first_chunk().expect("a length")) as usize;
    blob.truncate(first);
    blob.extend((chunk.len() as u32).to_le_bytes());
    blob.extend(chunk);
    let read = decode(&blob, &[SampleType::I16, SampleType::F64], 2, checksum(&of(f64::NAN)));
    assert!(matches!(read, Err(CodecError::NotFinite { channel: 1, sample: 1 })), "{read:?}");
}

/// A channel of `scans` samples of any type, extreme values included.
pub(in crate::campaign::store) fn any_channel(scans: usize) -> impl Strategy<Value = ChannelSamples> {
    let single = (prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO).boxed();
    let double = (prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO).boxed();
    prop_oneof![
        prop::collection::vec(any::<i16>(), scans).prop_map(ChannelSamples::I16),
        prop::collection::vec(any::<i32>(), scans).prop_map(ChannelSamples::I32),
        prop::collection::vec(single, scans).prop_map(ChannelSamples::F32),
        prop::collection::vec(double, scans).prop_map(ChannelSamples::F64),
    ]
}

/// The samples' bits: -0.0 equals 0.0, and must come back as it was.
pub(in crate::campaign::store) fn bits(samples: &Samples) -> Vec<Vec<u64>> {
    let of = |channel: ChannelView<'_>| match channel {
        ChannelView::I16(own) => own.iter().map(|v| u64::from(v.cast_unsigned())).collect(),
        ChannelView::I32(own) => own.iter().map(|v| u64::from(v.cast_unsigned())).collect(),
        ChannelView::F32(own) => own.iter().map(|v| u64::from(v.to_bits())).collect(),
        ChannelView::F64(own) => own.iter().map(|v| v.to_bits()).collect(),
    };
    samples.each().map(of).collect()
}

proptest! {
    #[test]
    fn samples_of_any_types_come_back_bit_for_bit(
        samples in (0..200_usize).prop_flat_map(|scans| prop::collection::vec(any_channel(scans), 0..6)),
        flip in any::<prop::sample::Index>(),
        bit in 0..8_u8,
    ) {
        let samples = Samples::new(samples).expect("equally long");
        let (types, scans, crc) = (samples.types(), samples.scans(), checksum(&samples));
        let mut blob = encode(&samples).expect("compresses");
        let read = decode(&blob, &types, scans, crc).expect("reads");
        prop_assert_eq!((read.types(), bits(&read)), (types.clone(), bits(&samples)));
        if !blob.is_empty() {
            let at = flip.index(blob.len());
            blob[at] ^= 1 << bit;
            // a padding bit changes no sample; the checksum of the stored bytes finds it
            if let Ok(read) = decode(&blob, &types, scans, crc) {
                prop_assert_eq!(bits(&read), bits(&samples));
            }
        }
    }
}
