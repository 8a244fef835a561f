//! The hot paths of substructuring: all methods on a campaign's lines, the fit, and the bootstrap
//! of 1000 replicates.
//!
//!     cargo bench -p jointrig-benches --bench substructuring

use divan::Bencher;
use jointrig::exchange::{read_frf, read_positions};
use jointrig::substructuring::averaged::{CellHits, Prepared, Priors};
use jointrig::substructuring::fit::{Options, fit};
use jointrig::substructuring::geometry::{Geometry, Grouping};
use jointrig::substructuring::{Band, Frf, IdmSet, Method, identify};
use nalgebra::Complex;
use std::path::{Path, PathBuf};

#[expect(dead_code, reason = "the rest is for the tables of the tests")]
#[path = "../../host/tests/it/simulated/mod.rs"]
mod simulated;

fn main() {
    divan::main();
}

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../host/tests/data").join(file)
}

fn geometry() -> Geometry {
    read_positions(&data("positions/positions.xlsx")).expect("test data").geometry
}

/// The exact FRFs of a rigid clamp, repeated to give `lines` lines from 300 Hz on, spaced by 0.5
/// Hz.
fn frf(file: &str, lines: usize) -> Frf {
    let exact = read_frf(&data("frf_rigid").join(file)).expect("test data");
    let frequency_hz = (0..lines).map(|l| 300.0 + 0.5 * l as f64).collect();
    let lines = (0..lines).map(|l| exact.lines()[l % exact.lines().len()].clone()).collect();
    let (outputs, inputs) = (exact.outputs().to_vec(), exact.inputs().to_vec());
    Frf::new(frequency_hz, exact.sigma_per_s(), exact.quantity(), outputs, inputs, lines).expect("all agree")
}

/// VPT and the paper's seven methods, six modes: 27 × 24 measured, 12 × 12 at the virtual points.
#[divan::bench(sample_count = 5)]
fn all_methods_on_3600_lines(bencher: Bencher) {
    let (a, b, ajb, geometry) = (frf("A.npz", 3600), frf("B.npz", 3600), frf("AJB.npz", 3600), geometry());
    let band = Band { low_hz: 300.0, high_hz: 3000.0 };
    bencher.bench(|| identify(&a, &b, &ajb, &geometry, &Method::PAPER, &[IdmSet::Six], &[band]));
}

/// `fit` of a simulated campaign over 300–600 Hz: 162 cells of the interface, 20 bands of 30 lines,
/// 900 geometry errors. The gain of its optimised weights over a direct implementation of the
/// formulas is printed by `cargo test --release -p jointrig-analysis --lib speed_of_the_weights --
/// --ignored --nocapture`.
#[divan::bench(sample_count = 3)]
fn fit_over_the_main_band(bencher: Bencher) {
    let c = simulated::campaign(&simulated::rigid_rig(180e6), 0.05e-6, 1, [300.0, 600.0]);
    let geometry = geometry();
    let band = Band { low_hz: 300.0, high_hz: 600.0 };
    let [a, b, ajb] = [&c.a, &c.b, &c.ajb].map(|m| &m.frf);
    bencher.bench(|| fit(a, b, ajb, &geometry, IdmSet::Six, band, &Options::default()).expect("a joint"));
}

/// 1000 replicates of eight hits on 18 × 18 interface cells over 300–600 Hz.
#[divan::bench(sample_count = 1)]
fn bootstrap_of_1000_replicates(bencher: Bencher) {
    let (ajb, geometry) = (frf("AJB.npz", 601), geometry());
    let band = Band { low_hz: 300.0, high_hz: 600.0 };
    let prepared = Prepared::of(&ajb, &geometry, IdmSet::Six, band, &Priors::default()).expect("exact data");
    let interface = |g: Grouping| matches!(g, Grouping::InterfaceA | Grouping::InterfaceB);
    let mut cells: Vec<CellHits> = Vec::new();
    for impact in geometry.ajb.impacts.iter().filter(|p| interface(p.grouping)) {
        let column = ajb.inputs().iter().position(|i| *i == impact.name).expect("there");
        for channels in geometry.ajb.channels.chunks(3).filter(|c| interface(c[0].grouping)) {
            let rows: Vec<usize> = channels
                .iter()
                .map(|c| ajb.outputs().iter().position(|o| *o == c.description).expect("there"))
                .collect();
            let hit = |h: usize| Complex::from(1.0 + 1e-3 * h as f64);
            cells.push(CellHits {
                input: impact.name.clone(),
                outputs: channels.iter().map(|c| c.description.clone()).collect(),
                auto: vec![vec![1.0; 8]; 601],
                cross: ajb
                    .lines()
                    .iter()
                    .map(|y| {
                        rows.iter().map(|&r| (0..8).map(|h| y[(r, column)] * hit(h)).collect()).collect()
                    })
                    .collect(),
            });
        }
    }
    bencher.bench(|| prepared.bootstrap(&cells, 1000, 1));
}
