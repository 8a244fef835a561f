//! The report's verdict on five rigs with known clamp and contact: FBS between the arms finds clamp
//! and contact in series, the vibrometers at the specimens measure the contact.
#![cfg(feature = "sim")]

use crate::records;

use jointrig::analyse::{Wanted, analyse_measurements};
use jointrig::report::{document, words};
use jointrig::results::{DIRECT, HIDDEN_RESONANCE, Results, SERIES_COMPLIANCE};
use jointrig::substructuring::Dof;
use jointrig_hil_sim::rig::RigConfig;
use records::Assembly;
use std::path::Path;

/// Stiffness in series with the contact on the default rig (N/m): 60 N/µm of the clamp's spring,
/// and its tilt at 10 mm over 6500 N m/rad.
const SERIES: f64 = 31.2e6;

struct Verdict {
    results: Results,
}

impl Verdict {
    /// A campaign of the assembly on `hil-sim/rigs/NAME.toml`: every interface cell, two hits each.
    fn on(name: &str) -> Verdict {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../hil-sim/rigs").join(format!("{name}.toml"));
        let config = RigConfig::from_toml(&std::fs::read_to_string(path).expect("a rig")).expect("readable");
        let found = analyse_measurements(&Assembly::of(config, 5), Wanted::default(), &|_| {});
        Verdict { results: document(found) }
    }

    fn series(&self) -> f64 {
        self.results.check(SERIES_COMPLIANCE).expect("the check").values["series_stiffness_n_per_m"]
    }

    fn direct(&self) -> f64 {
        let row = self.results.joint.iter().find(|j| j.method == DIRECT).expect("T and Δx are there");
        // away from the specimen's local mode, whose frequency depends on the clamp
        let mode = self.results.check(HIDDEN_RESONANCE).and_then(|check| check.frequency_hz);
        assert!(
            mode.is_none_or(|f| row.band_hz.low_hz > 1.2 * f || row.band_hz.high_hz < 0.8 * f),
            "{row:?}"
        );
        row.sliding_stiffness().expect("along z").mean
    }
}

fn near(what: &str, value: f64, truth: f64, part: f64) {
    println!("{what}: {:.1} N/µm for {:.1}", value * 1e-6, truth * 1e-6);
    assert!((value / truth - 1.0).abs() < part, "{what}: {value:e} for {truth:e}");
}

#[test]
fn on_the_default_rig_fbs_is_not_k_t() {
    let verdict = Verdict::on("default");
    let check = verdict.results.check(SERIES_COMPLIANCE).expect("the check");
    assert_eq!(check.ok, Some(false), "{check:?}");
    assert!(check.meaning.contains("not k_T") && check.meaning.contains("in series"), "{}", check.meaning);
    // the terminal output and the report's head state it too
    let said = words::summary(&verdict.results).join("\n");
    assert!(said.contains("not k_T"), "{said}");
    assert!(jointrig::report::page(&verdict.results).contains("not k_T"));
    assert!(!verdict.results.to_json().expect("serialises").contains("NaN"));
    near("series", verdict.series(), SERIES, 0.15);
    near("direct", verdict.direct(), 180e6, 0.10);
    let hidden = verdict.results.check(HIDDEN_RESONANCE).expect("the check");
    assert_eq!(hidden.ok, Some(false), "{hidden:?}");
    assert!((hidden.frequency_hz.expect("a place") - 192.0).abs() < 3.0, "{hidden:?}");
}

#[test]
fn half_the_clamp_is_half_in_series() {
    let verdict = Verdict::on("clamp-half");
    near("series", verdict.series(), SERIES / 2.0, 0.15);
    near("direct", verdict.direct(), 180e6, 0.10);
}

#[test]
fn twice_the_clamp_is_twice_in_series() {
    let verdict = Verdict::on("clamp-double");
    near("series", verdict.series(), SERIES * 2.0, 0.15);
    near("direct", verdict.direct(), 180e6, 0.10);
}

#[test]
fn a_contact_of_120_is_found_through_the_same_clamp() {
    let verdict = Verdict::on("contact-120");
    near("series", verdict.series(), SERIES, 0.15);
    near("direct", verdict.direct(), 120e6, 0.10);
}

#[test]
fn a_contact_of_240_is_found_through_the_same_clamp() {
    let verdict = Verdict::on("contact-240");
    near("series", verdict.series(), SERIES, 0.15);
    near("direct", verdict.direct(), 240e6, 0.10);
}

/// The bootstrap through the whole analysis: spectra of single hits from records, redrawn, compared
/// with the propagated noise.
#[test]
fn hits_drawn_anew_scatter_as_the_noise_does() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../hil-sim/rigs/noisy.toml");
    let config = RigConfig::from_toml(&std::fs::read_to_string(path).expect("a rig")).expect("readable");
    let wanted = Wanted { replicates: 100, ..Wanted::default() };
    let results = document(analyse_measurements(&Assembly::of(config, 5), wanted, &|_| {}));
    let drawn = results.bootstrap.as_ref().expect("two hits in every cell");
    assert_eq!((drawn.replicates, <[f64; 2]>::from(drawn.band_hz)), (100, [300.0, 600.0]));
    let propagated = results.recommended[0].joint[&Dof::Z].std_noise;
    // both are based on two hits only, which show √(1/2) of the scatter that many would show; 100
    // replicates determine it to 7 %, two hits in each of 108 cells and 601 lines leave some tens
    // of per cent
    let ratio = drawn.hits[&Dof::Z].std / propagated;
    assert!((0.6..1.6).contains(&ratio), "{:?} against {propagated:e}", drawn.hits[&Dof::Z]);
    assert!(words::summary(&results).join("\n").contains("Hits resampled 100 times"));
}
