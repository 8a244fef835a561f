//! npz, csv and xlsx: written files are read back, and damaged files are refused without a panic.

use super::npz::NpzFile;
use super::npz::NpzOutput;
use super::{read_frf, read_hysteresis, read_impacts, read_positions, write_impacts};
use crate::spectra::{ImpactRecords, MotionQuantity};
use num_complex::Complex;
use proptest::collection::vec;
use proptest::prelude::*;
use std::fs;
use std::path::Path;

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/positions");

/// Runs every reader of single files on these bytes.
fn read_all(bytes: &[u8]) -> usize {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    fs::write(file.path(), bytes).expect("writable");
    let path = file.path();
    [
        read_frf(path).is_ok(),
        read_impacts(path).is_ok(),
        read_hysteresis(path).is_ok(),
        read_positions(path).is_ok(),
    ]
    .into_iter()
    .filter(|ok| *ok)
    .count()
}

/// A small file of impact records.
fn records() -> Vec<u8> {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    let records = ImpactRecords {
        fs_hz: 51_200.0,
        force_n: vec![vec![0.0, 1.0, 0.5]; 2],
        response: vec![vec![vec![0.0, 0.5, 0.25]]; 2],
        quantity: MotionQuantity::Velocity,
    };
    write_impacts(file.path(), &records).expect("writable");
    fs::read(file.path()).expect("readable")
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, rng_seed: proptest::test_runner::RngSeed::Fixed(7), ..ProptestConfig::default() })]

    #[test]
    fn arrays_of_any_values_come_back(
        reals in vec(prop::num::f64::ANY.prop_filter("a number", |v| !v.is_nan()), 1..40),
        parts in vec((-1e300..1e300f64, -1e300..1e300f64), 0..20),
        words in vec("[a-zäµ°² :/]{0,9}[a-zµ]", 1..6),
    ) {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        let complex: Vec<_> = parts.iter().map(|(re, im)| Complex::new(*re, *im)).collect();
        let mut out = NpzOutput::create(file.path()).expect("writable");
        out.real("r", &[reals.len(), 1], &reals).expect("written");
        out.complex("c", &[complex.len()], &complex).expect("written");
        out.text("t", &[words.len()], &words).expect("written");
        out.finish().expect("closed");
        let mut back = NpzFile::open(file.path()).expect("readable");
        prop_assert_eq!(back.real("r", "").expect("real").values, reals);
        prop_assert_eq!(back.complex("c", "").expect("complex").values, complex);
        prop_assert_eq!(back.text("t", "").expect("text").values, words);
    }

    #[test]
    fn a_flipped_byte_is_survived(at in any::<prop::sample::Index>(), value in any::<u8>()) {
        for mut bytes in [records(), fs::read(Path::new(DATA).join("positions.xlsx")).expect("test data")] {
            let at = at.index(bytes.len());
            bytes[at] = value;
            prop_assert!(read_all(&bytes) <= 1);
        }
    }

    #[test]
    fn noise_is_refused(bytes in vec(any::<u8>(), 0..2000)) {
        prop_assert_eq!(read_all(&bytes), 0);
    }

    #[test]
    fn a_table_with_any_byte_changed_or_cut_is_survived(
        at in any::<prop::sample::Index>(), value in any::<u8>(), cut in any::<bool>(), which in 0..8usize,
    ) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for (i, entry) in fs::read_dir(Path::new(DATA).join("csv")).expect("test data").enumerate() {
            let from = entry.expect("entry").path();
            let mut bytes = fs::read(&from).expect("test data");
            if i == which {
                let at = at.index(bytes.len());
                bytes[at] = value;
                bytes.truncate(if cut { at } else { bytes.len() });
            }
            fs::write(folder.path().join(from.file_name().expect("a name")), bytes).expect("writable");
        }
        // a changed digit is still a digit; any other change is an error that names table, row and
        // column
        if let Err(error) = read_positions(folder.path()) {
            prop_assert!(!error.to_string().is_empty());
        }
    }
}

#[test]
fn records_cut_at_any_byte_are_refused() {
    let whole = records();
    assert_eq!(read_all(&whole), 1);
    for length in 0..whole.len() {
        assert_eq!(read_all(&whole[..length]), 0, "{length} of {}", whole.len());
    }
}

#[test]
fn a_workbook_cut_at_any_of_many_bytes_is_refused() {
    let whole = fs::read(Path::new(DATA).join("positions.xlsx")).expect("test data");
    assert_eq!(read_all(&whole), 1);
    for length in (0..whole.len()).step_by(61) {
        assert_eq!(read_all(&whole[..length]), 0, "{length} of {}", whole.len());
    }
}
