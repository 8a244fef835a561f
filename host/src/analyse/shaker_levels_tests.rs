//! Levels with a known stiffness.

use super::cell::ShakerLevel;
use super::checks::contact_change::ContactChange;
use super::shaker_levels::NoLevelStiffness;
use super::shaker_levels::{analysed, curves, loops};
use crate::campaign::plan::level::{Held, Level, Moment};
use crate::hysteresis::static_arm::{CorrectionSource, Identified};
use crate::hysteresis::{Correction, HysteresisRecord, RelativeMotion};
use std::f64::consts::TAU;

fn level(id: i64, moment: Moment, frequency_hz: f64, stiffness: f64) -> ShakerLevel {
    let n = (20.0 * 51_200.0 / frequency_hz) as usize + 1;
    let wave = |amplitude: f64| -> Vec<f64> {
        (0..n).map(|i| amplitude * (TAU * frequency_hz * i as f64 / 51_200.0).cos()).collect()
    };
    ShakerLevel {
        id,
        moment,
        level: Level { frequency_hz, end_hz: None, held: Held::Displacement, amplitude: 1.5e-7 },
        record: HysteresisRecord {
            fs_hz: 51_200.0,
            motion: RelativeMotion::Displacement { a_m: wave(2.5e-7), b_m: wave(1e-7) },
            force_n: wave(1.5e-7 * stiffness),
            excitation_hz: Some(frequency_hz),
            normal_load_n: None,
        },
    }
}

#[test]
fn wear_between_before_and_after_shows() {
    let levels = |after: f64| {
        vec![
            level(1, Moment::Before, 100.0, 180e6),
            level(2, Moment::Before, 300.0, 180e6),
            level(3, Moment::After, 100.0, 180.5e6),
            level(4, Moment::After, 300.0, after),
        ]
    };
    let check = |levels: &[ShakerLevel]| ContactChange::of(&analysed(levels, None).0);
    let same = check(&levels(179.0e6)).expect("pairs");
    assert_eq!((same.pairs, same.beyond), (2, 0), "{same:?}");
    let worn = check(&levels(150e6)).expect("pairs");
    assert_eq!((worn.pairs, worn.beyond, worn.worst_at.frequency_hz), (2, 1, 300.0), "{worn:?}");
    assert_eq!(check(&levels(150e6)[..2]), None);
}

#[test]
fn raw_and_corrected_stand_side_by_side() {
    let levels = [level(7, Moment::Before, 250.0, 180e6)];
    let (found, missing) = analysed(&levels, None);
    assert!(missing.is_empty());
    assert_eq!(curves(&found).len(), 1);
    let correction = Correction { effective_mass_kg: 1.5, parallel_path: 0.01 };
    let arm = Identified { correction, basis: CorrectionSource::Given, residual: 0.0 };
    let [one] = &loops(found, Some(&arm), vec![Err(NoLevelStiffness::NoContact)])[..] else {
        panic!("one level")
    };
    let both = [Some(&one.raw), one.corrected.as_ref()].map(|loops| loops.expect("both forces"));
    let k = both.map(|loops| loops.k_t_n_per_m.expect("stuck").mean);
    // F = 1.01 T − m ω² x_B, x_B = Δx / 1.5
    let expected = 1.01 * 180e6 - 1.5 * (TAU * 250.0).powi(2) / 1.5;
    assert!((k[0] / 180e6 - 1.0).abs() < 1e-6 && (k[1] / expected - 1.0).abs() < 1e-3, "{k:?}");
}
