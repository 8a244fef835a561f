//! The part of the deviations that position errors explain, on exact FRFs of a rig with a known
//! joint.

use jointrig::exchange::{read_frf, read_positions};
use jointrig::substructuring::averaged::Priors;
use jointrig::substructuring::explained::{Explained, USUAL};
use jointrig::substructuring::geometry::Grouping;
use jointrig::substructuring::{Band, Frf, Geometry, IdmSet};
use std::path::{Path, PathBuf};

const BAND: Band = Band { low_hz: 300.0, high_hz: 600.0 };

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

fn rigid() -> ([Frf; 3], Geometry) {
    let frfs = ["A", "B", "AJB"].map(|f| read_frf(&data(&format!("frf_rigid/{f}.npz"))).expect("test data"));
    (frfs, read_positions(&data("positions/positions.xlsx")).expect("test data").geometry)
}

fn judged(frfs: &[Frf; 3], geometry: &Geometry) -> Explained {
    let [a, b, ajb] = frfs;
    Explained::of([a, b, ajb], geometry, IdmSet::Six, BAND, &Priors::default()).expect("lines")
}

#[test]
fn exact_data_agree_everywhere_and_the_draws_say_what_half_a_millimetre_does() {
    let (frfs, geometry) = rigid();
    let found = judged(&frfs, &geometry);
    let [error, explained] = found.medians(BAND).expect("lines");
    // exact to the rounding of the files
    assert!(error < 1e-6 && explained > 0.02, "{error} {explained}");
    let last = *found.frequency_hz.last().expect("lines");
    assert_eq!(found.range(BAND, USUAL), Some([found.frequency_hz[0], last]));
    assert_eq!(found, judged(&frfs, &geometry), "the same data give the same figures");
}

/// A spring and mass between a point of A and a point of B, resonant at 520 Hz: a soft spring far
/// below it, a parallel path near it.
#[test]
fn a_path_beside_the_joint_is_seen_above_its_frequency() {
    let ([a, b, ajb], geometry) = rigid();
    let points = &geometry.ajb;
    let at = |grouping: Grouping| {
        let channel = points.channels.iter().find(|c| c.grouping == grouping && c.direction[2] > 0.9);
        let impact = points.impacts.iter().find(|i| i.grouping == grouping && i.direction[2].abs() > 0.9);
        let (channel, impact) = (channel.expect("along z"), impact.expect("along z"));
        let out = ajb.outputs().iter().position(|o| *o == channel.description).expect("measured");
        let input = ajb.inputs().iter().position(|i| *i == impact.name).expect("measured");
        (out, input, impact.direction[2].signum())
    };
    let ends = [at(Grouping::InterfaceA), at(Grouping::InterfaceB)];
    let changed = ajb.clone().map_lines(|l, mut y| {
        let s = ajb.s(l);
        let own = std::f64::consts::TAU * 520.0;
        let path = 20e6 / (1.0 + 0.02 * s / own + (s / own) * (s / own));
        // the files contain mobilities: force = path · displacement = path / s · velocity; the ends
        // count as driving points
        let gain = path / s;
        let column = (0..y.nrows())
            .map(|r| y[(r, ends[0].1)] * ends[0].2 - y[(r, ends[1].1)] * ends[1].2)
            .collect::<Vec<_>>();
        let row = (0..y.ncols()).map(|c| y[(ends[0].0, c)] - y[(ends[1].0, c)]).collect::<Vec<_>>();
        let across = column[ends[0].0] - column[ends[1].0];
        let share = gain / (1.0 + gain * across);
        for (r, left) in column.iter().enumerate() {
            for (c, right) in row.iter().enumerate() {
                y[(r, c)] -= share * left * right;
            }
        }
    });
    let below = Band { low_hz: 300.0, high_hz: 400.0 };
    let priors = Priors::default();
    let found = Explained::of([&a, &b, &changed], &geometry, IdmSet::Six, below, &priors).expect("lines");
    let [from, to] = found.range(below, USUAL).expect("there the path is soft");
    // the median's window extends 75 Hz to either side
    assert!(from <= 300.0 && (400.0..520.0).contains(&to), "{from} {to}");
}
