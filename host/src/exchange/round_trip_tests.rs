//! read(write(x)) = x for every format that is both written and read. Universal data sets of every
//! kind are tested in `uff/round_trip.rs`, arrays of any type in `any_bytes_tests.rs`.

use super::frf_uff::{read_frf_uff, to_functions, write_uff};
use super::record_uff::read_record_file;
use super::tables_output::write_positions;
use super::uff::{ByteOrder, Encoding};
use super::units::StatedUnits;
use super::{
    read_frf, read_hysteresis, read_impacts, read_positions, uff_output, write_frf, write_hysteresis,
    write_impacts,
};
use crate::frf::Frf;
use crate::hysteresis::{HysteresisRecord, RelativeMotion};
use crate::spectra::{ImpactRecords, MotionQuantity};
use crate::substructuring::geometry::{Configuration, Geometry, Grouping, Point};
use nalgebra::DMatrix;
use num_complex::Complex;
use proptest::collection::vec;
use proptest::prelude::*;

/// Numbers of twelve digits, which columns of thirteen characters preserve.
fn twelve_digits() -> impl Strategy<Value = f64> {
    (-1_000_000_000_000i64..1_000_000_000_000, -20..20i32)
        .prop_map(|(n, exponent)| format!("{n}e{exponent}").parse().expect("a number"))
}

fn finite() -> impl Strategy<Value = f64> {
    prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO
}

fn quantity() -> impl Strategy<Value = MotionQuantity> {
    prop::sample::select(vec![
        MotionQuantity::Displacement,
        MotionQuantity::Velocity,
        MotionQuantity::Acceleration,
    ])
}

fn motion() -> impl Strategy<Value = MotionQuantity> {
    prop::sample::select(vec![
        MotionQuantity::Displacement,
        MotionQuantity::Velocity,
        MotionQuantity::Acceleration,
    ])
}

/// FRFs of one to three sensors with three axes, and one to three impacts, on one to nine lines.
fn frf(value: impl Strategy<Value = f64>) -> impl Strategy<Value = Frf> {
    let sizes = (1..4usize, 1..4usize, 1..10usize, 1..4000u32, 0..40u32, quantity());
    (sizes, vec(value, 2 * 9 * 3 * 9)).prop_map(
        |((sensors, impacts, lines, step, sigma, quantity), values)| {
            Frf::new(
                (0..lines).map(|l| l as f64 * f64::from(step) / 16.0).collect(),
                f64::from(sigma) / 8.0,
                quantity,
                (0..sensors).flat_map(|s| ["x", "y", "z"].map(|a| format!("A{s}:{a}"))).collect(),
                (0..impacts).map(|i| format!("AZ{i}")).collect(),
                (0..lines)
                    .map(|l| {
                        DMatrix::from_fn(3 * sensors, impacts, |r, c| {
                            let at = 2 * ((l * 9 + r) * 3 + c);
                            Complex::new(values[at], values[at + 1])
                        })
                    })
                    .collect(),
            )
            .expect("all agree")
        },
    )
}

/// One to three hits of one or three responses.
fn records(value: impl Strategy<Value = f64>) -> impl Strategy<Value = ImpactRecords> {
    let sizes = (1..4usize, prop::sample::select(vec![1usize, 3]), 2..20usize, motion());
    (sizes, vec(value, 3 * 4 * 20)).prop_map(|((hits, responses, samples, quantity), values)| {
        let signal = |hit: usize, channel: usize| values[(hit * 4 + channel) * 20..][..samples].to_vec();
        ImpactRecords {
            fs_hz: 51_200.0,
            force_n: (0..hits).map(|hit| signal(hit, 0)).collect(),
            response: (0..hits).map(|hit| (1..=responses).map(|c| signal(hit, c)).collect()).collect(),
            quantity,
        }
    })
}

fn points(kind: &'static str, axes: bool) -> impl Strategy<Value = Vec<Point>> {
    let one = (1..7u8, prop::array::uniform3(-1e3..1e3f64), 0..3usize, any::<bool>());
    vec(one, 1..5).prop_map(move |rows| {
        rows.into_iter()
            .enumerate()
            .flat_map(|(i, (grouping, position_m, axis, turned))| {
                let grouping = Grouping::try_from(grouping).expect("1 to 6");
                let point = move |name: String, description: String, axis: usize, sign: f64| Point {
                    name,
                    description,
                    grouping,
                    position_m,
                    direction: std::array::from_fn(|a| if a == axis { sign } else { 0.0 }),
                };
                let name = format!("{kind}{i}");
                if axes {
                    let axis = |a| point(name.clone(), format!("{name}:{}", ["x", "y", "z"][a]), a, 1.0);
                    (0..3).map(axis).collect::<Vec<_>>()
                } else {
                    vec![point(name.clone(), name, axis, if turned { -1.0 } else { 1.0 })]
                }
            })
            .collect()
    })
}

fn geometry() -> impl Strategy<Value = Geometry> {
    let configuration = || {
        (points("S", true), points("I", false))
            .prop_map(|(channels, impacts)| Configuration { channels, impacts })
    };
    let place = || prop::array::uniform3(-1.0..1.0f64);
    (configuration(), configuration(), configuration(), place(), place()).prop_map(
        |(a, b, ajb, virtual_point_a_m, virtual_point_b_m)| Geometry {
            a,
            b,
            ajb,
            virtual_point_a_m,
            virtual_point_b_m,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, rng_seed: proptest::test_runner::RngSeed::Fixed(21), ..ProptestConfig::default() })]

    #[test]
    fn frfs_as_npz(y in frf(finite()), variances in vec(0.0..1e9f64, 9 * 9 * 3)) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("y.npz");
        let (rows, columns) = (y.outputs().len(), y.inputs().len());
        let cell = |l: usize, r: usize, c: usize| variances[(l * rows + r) * columns + c];
        let matrices = |scale: f64| -> Vec<DMatrix<f64>> {
            (0..y.lines().len()).map(|l| DMatrix::from_fn(rows, columns, |r, c| scale * cell(l, r, c))).collect()
        };
        let whole = y.clone().with_variance(matrices(1.0)).and_then(|y| y.with_coherence(matrices(1e-9))).expect("alike");
        for frf in [y.clone(), whole] {
            write_frf(&path, &frf, &[]).expect("written");
            prop_assert_eq!(&read_frf(&path).expect("read"), &frf);
        }
    }

    #[test]
    fn frfs_as_universal_files(y in frf(twelve_digits()), encoding in 0..3usize) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("y.uff");
        let encoding =
            [Encoding::Ascii, Encoding::Binary(ByteOrder::Little), Encoding::Binary(ByteOrder::Big)][encoding];
        write_uff(&path, &to_functions(&y, &[-3; 3], encoding).expect("consistent")).expect("written");
        let read = read_frf_uff(&path, &StatedUnits::default()).expect("read");
        prop_assert_eq!((read.frf, read.notes), (y, vec![]));
    }

    #[test]
    fn records_as_npz_and_as_universal_files(records in records(finite())) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (npz, uff) = (folder.path().join("r.npz"), folder.path().join("r.uff"));
        write_impacts(&npz, &records).expect("written");
        prop_assert_eq!(&read_impacts(&npz).expect("read"), &records);
        uff_output::write_records(&uff, &records, "A1", "AZ1").expect("written");
        let read = read_record_file(&uff, &StatedUnits::default()).expect("read");
        prop_assert_eq!(&read.records, &records);
        prop_assert!(read.delay_s.iter().all(|late| *late == 0.0));
    }

    #[test]
    fn loops_as_npz(
        signals in vec((finite(), finite(), finite()), 1..40), velocity in any::<bool>(),
        excitation_hz in prop::option::of(1e-3..1e5f64), normal_load_n in prop::option::of(1e-3..1e5f64),
    ) {
        // the reader refuses sums that overflow
        prop_assume!(signals.iter().all(|(a, b, f)| (a + b + f).is_finite()));
        let signal = |pick: fn(&(f64, f64, f64)) -> f64| signals.iter().map(pick).collect::<Vec<_>>();
        let (a, b) = (signal(|s| s.0), signal(|s| s.1));
        let motion = if velocity {
            RelativeMotion::Velocity { a_m_per_s: a, b_m_per_s: b }
        } else {
            RelativeMotion::Displacement { a_m: a, b_m: b }
        };
        let record = HysteresisRecord { fs_hz: 51_200.0, motion, force_n: signal(|s| s.2), excitation_hz, normal_load_n };
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("loop.npz");
        write_hysteresis(&path, &record).expect("written");
        prop_assert_eq!(read_hysteresis(&path).expect("read"), record);
    }

    #[test]
    fn geometry_as_tables(geometry in geometry()) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        write_positions(folder.path(), &geometry, "Velocity").expect("written");
        let back = read_positions(folder.path()).expect("read");
        prop_assert_eq!(back.geometry, geometry);
        prop_assert_eq!(back.warnings, Vec::<String>::new());
    }
}
