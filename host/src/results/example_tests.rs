//! An artificial document with every part, for tests of the sentences and the report.

use super::*;
use crate::substructuring::IdmSet;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// A deterministic scatter in −1…1.
fn scatter(i: usize) -> f64 {
    let x = (i as f64 * 12.9898).sin() * 43_758.545_3;
    2.0 * (x - x.floor()) - 1.0
}

fn statistics(mean: f64, std: f64) -> Statistics {
    Statistics { mean, std, median: mean * 0.995, ci95: Some([mean - 0.3 * std, mean + 0.3 * std]) }
}

fn joint(method: &str, idms: usize, band_hz: [f64; 2], k: f64, std: f64, warnings: &[&str]) -> Joint {
    let translations = |z: Statistics| {
        BTreeMap::from([("y".to_owned(), statistics(z.mean * 2.4, z.std)), ("z".to_owned(), z)])
    };
    Joint {
        method: method.into(),
        idms,
        modes: IdmSet::from_count(idms).map_or_else(Vec::new, IdmSet::dofs),
        band_hz: band_hz.into(),
        stiffness_n_per_m: translations(statistics(k, std)),
        damping_n_s_per_m: translations(statistics(410.0, 90.0)),
        stiffness_n_m_per_rad: BTreeMap::new(),
        damping_n_m_s_per_rad: BTreeMap::new(),
        stiffness_flexible_si: BTreeMap::new(),
        coupling_si: BTreeMap::new(),
        coupling_damping_si: BTreeMap::new(),
        lines: ((band_hz[1] - band_hz[0]) / 0.5) as usize + 1,
        noise_n_per_m: BTreeMap::from([("z".to_owned(), 0.8 * std)]),
        goodness: None,
        warnings: warnings.iter().map(|w| (*w).to_owned()).collect(),
    }
}

/// Receptance of a sum of modes at f: (frequency, residue) pairs, 1 % damping.
fn modes(f: f64, modes: &[(f64, f64)]) -> (f64, f64) {
    let w = TAU * f;
    modes.iter().fold((0.0, 0.0), |(re, im), &(fm, a)| {
        let wm = TAU * fm;
        let (d, e) = (wm * wm - w * w, 0.02 * wm * w);
        let n = d * d + e * e;
        (re + a * d / n, im - a * e / n)
    })
}

fn frf(configuration: &str, role: Role, names: [&str; 2], sum: &[(f64, f64)], noise: f64) -> FrfCurve {
    let lines = 1961;
    let mut curve = FrfCurve {
        configuration: configuration.into(),
        role,
        output: names[0].into(),
        input: names[1].into(),
        hits: 3,
        first_hz: 20.0,
        step_hz: 0.5,
        magnitude_m_per_n: Vec::new(),
        phase_deg: Vec::new(),
        coherence: Vec::new(),
    };
    for l in 0..lines {
        let (re, im) = modes(curve.frequency_hz(l), sum);
        let (re, im) = (re + noise * scatter(2 * l), im + noise * scatter(2 * l + 1));
        let size = re.hypot(im);
        curve.magnitude_m_per_n.push(rounded(size, 5));
        curve.phase_deg.push(rounded(im.atan2(re).to_degrees(), 4));
        curve.coherence.push(rounded(1.0 / (1.0 + (noise / size).powi(2)), 5));
    }
    curve
}

fn example_loop() -> LoopCurve {
    let step_s = 1.0 / 51_200.0;
    let t: Vec<f64> = (0..900).map(|i| i as f64 * step_s).collect();
    let decay = |t: f64, f: f64, a: f64| a * (-30.0 * t).exp() * (TAU * f * t).sin();
    let force_n: Vec<f64> = t.iter().map(|&t| decay(t, 208.0, 17.0) + decay(t, 1310.0, 0.8)).collect();
    let displacement_m: Vec<f64> = t
        .iter()
        .zip(&force_n)
        .map(|(&t, f)| f / 148e6 + decay(t, 192.0, 2e-8) * (60.0 * t).min(1.0))
        .collect();
    let displacement_b_m: Vec<f64> = force_n.iter().map(|f| f / 75e6).collect();
    let displacement_a_m = displacement_m.iter().zip(&displacement_b_m).map(|(d, b)| d + b).collect();
    LoopCurve {
        record: 2011,
        impact: "AZ1".into(),
        step_s,
        displacement_m,
        displacement_a_m,
        displacement_b_m,
        force_n,
        cycle: [0, 246],
        cycles: vec![[0, 246], [246, 492], [492, 738], [738, 900]],
        slope_n_per_m: 148.9e6,
    }
}

fn spectrum() -> JointSpectrum {
    let frequency_hz: Vec<f64> = (0..1601).map(|l| 100.0 + 0.5 * f64::from(l)).collect();
    let curve = |method: &str, idms: usize, k: f64, size: f64| SpectrumCurve {
        method: method.into(),
        idms,
        dof: "z".into(),
        stiffness_n_per_m: frequency_hz
            .iter()
            .enumerate()
            .map(|(l, f)| {
                let peak = 60e6 * (-((f - 208.0) / 9.0).powi(2)).exp() * scatter(l + 31);
                (l != 700)
                    .then(|| rounded(k + size * scatter(l + idms) + peak + 2e6 * (f / 60.0 * PI).sin(), 6))
            })
            .collect(),
        stiffness_noise_n_per_m: vec![Some(0.8 * size); frequency_hz.len()],
        damping_n_s_per_m: frequency_hz
            .iter()
            .enumerate()
            .map(|(l, _)| Some(400.0 + 90.0 * scatter(l)))
            .collect(),
    };
    let curves = vec![
        curve("internal", 2, 52e6, 14e6),
        curve("internal", 4, 26e6, 5e6),
        curve("internal", 6, 26.8e6, 1.6e6),
        curve("internal-printed", 2, 49e6, 17e6),
        curve("internal-printed", 4, 26e6, 9e6),
        curve("internal-printed", 6, 25.9e6, 4e6),
    ];
    JointSpectrum { frequency_hz, curves }
}

/// Two amplitudes at three frequencies, before and after the hammer's cells.
fn levels() -> Vec<Hysteresis> {
    let mut rows = Vec::new();
    for (f, k, shape) in
        [(100.0, 139e6, Shape::Stuck), (200.0, 86e6, Shape::Elliptical), (250.0, 195e6, Shape::Stuck)]
    {
        for (moment, worn) in [("before", 1.0), ("after", 0.99)] {
            let amplitudes: &[f64] = if moment == "before" { &[1e-7, 2e-7] } else { &[] };
            for amplitude in amplitudes {
                let slope = Some(OverCycles { mean: k * worn, std: 2e6, cycles: 100, ci95: None });
                rows.push(Hysteresis {
                    force: Force::Raw,
                    kind: Excitation::Shaker,
                    frequency_hz: Some(f),
                    amplitude_m: Some(*amplitude),
                    shape,
                    k_t_n_per_m: None,
                    c_t_n_s_per_m: None,
                    k_t_budget: None,
                    k_t_why: None,
                    slope_between_spots_n_per_m: slope.filter(|_| shape == Shape::Stuck),
                    stick_part: None,
                    k_eq_n_per_m: slope,
                    k_secant_n_per_m: Some(1.1 * k),
                    k_fundamental_n_per_m: Some(1.1 * k),
                    energy_j: Some(OverCycles { mean: 1e-8, std: 2e-8, cycles: 100, ci95: None }),
                    friction_limit_n: None,
                    friction_limit_ci95_n: None,
                    friction_coefficient: None,
                    friction_coefficient_ci95: None,
                    phase_deg: Some(if shape == Shape::Stuck { 1.0 } else { 65.0 }),
                    shape_evidence: None,
                    decay_cycles: Vec::new(),
                    decay: Vec::new(),
                    level: i64::try_from(rows.len() + 1).ok(),
                    moment: Some(moment),
                    records: Vec::new(),
                    findings: Vec::new(),
                    warnings: Vec::new(),
                });
            }
        }
    }
    rows
}

fn shaker_loop(frequency_hz: f64, lag_deg: f64) -> ShakerLoop {
    let wave = |amplitude: f64, degrees: f64| -> Vec<f64> {
        (0..256).map(|i| amplitude * (TAU * f64::from(i) / 256.0 + degrees.to_radians()).cos()).collect()
    };
    ShakerLoop {
        level: 1,
        frequency_hz,
        moment: "before",
        shape: if lag_deg > 10.0 { Shape::Elliptical } else { Shape::Stuck },
        slope_n_per_m: 180e6 * lag_deg.to_radians().cos(),
        displacement_m: wave(1.5e-7, -lag_deg),
        force_n: wave(27.0, 0.0),
        displacement_a_m: wave(3e-7, -0.4 * lag_deg),
        displacement_b_m: wave(1.8e-7, 0.0),
    }
}

fn reconstruction() -> Reconstruction {
    let step_s = 8.0 / 51_200.0;
    let decay = |f: f64, a: f64| -> Vec<f64> {
        (0..640).map(|i| f64::from(i) * step_s).map(|t| a * (-20.0 * t).exp() * (TAU * f * t).sin()).collect()
    };
    let (common, hidden) = (decay(208.0, 2e-7), decay(192.0, 4e-8));
    let a: Vec<f64> = common.iter().zip(&hidden).map(|(c, h)| c + h).collect();
    Reconstruction {
        record: 2011,
        hidden_hz: 192.0,
        common_hz: 208.0,
        step_s,
        displacement_a_m: a.clone(),
        displacement_b_m: common.clone(),
        rebuilt_a_m: a,
        rebuilt_b_m: common,
        explained_a: [0.99, 0.93],
        explained_b: 0.99,
    }
}

/// A contact that sticks for 300 cycles, then slips and wears.
fn wear() -> WearRuns {
    let one = |place: i32| {
        let last = (100.0 * 1.2_f64.powi(place)).round();
        let slips = last > 300.0;
        let stiffness = 6e7 * (1.0 + 0.05 * (last / 100.0).ln());
        let coefficient = 0.4 + 0.02 * (last / 100.0).ln();
        WearMeans {
            first: last as u64 - 99,
            last: last as u64,
            slipping: if slips { 100 } else { 0 },
            k_t_n_per_m: slips.then_some(stiffness),
            tangent_n_per_m: (!slips).then_some(stiffness),
            friction_n: slips.then_some(150.0 * coefficient),
            friction_coefficient: slips.then_some(coefficient),
            amplitude_m: Some(4e-6),
            energy_j: 0.08,
            energy_to_j: 8e-4 * last,
        }
    };
    let curve: Vec<WearMeans> = (0..40).map(one).collect();
    WearRuns {
        cycles: curve[39].last,
        energy_j: curve[39].energy_to_j,
        unmeasured: 0,
        loops: 40,
        decades: vec![curve[0].clone(), curve[20].clone()],
        curve,
    }
}

/// All parts together: the default rig's numbers, with a little noise.
pub fn results() -> Results {
    let names =
        |pairs: &[(&str, &str)]| pairs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    let mut results = Results::new(Source {
        file: "campaign.jrig".into(),
        kind: "campaign".into(),
        started: Some("2026-03-02T09:15:00Z".into()),
        device: names(&[
            ("name", "simulated rig"),
            ("address", "sim:"),
            ("firmware", "0.1.0"),
            ("schema", "9c1b7a40"),
        ]),
        settings: BTreeMap::from([
            ("sigma_per_s".to_owned(), serde_json::json!(2.3)),
            ("line_spacing_hz".to_owned(), serde_json::json!(0.5)),
            ("force_window".to_owned(), serde_json::json!("rectangular, 20 ms")),
            ("seed".to_owned(), serde_json::json!(7)),
        ]),
        records: BTreeMap::from([
            ("A".to_owned(), ranges(1..=144)),
            ("B".to_owned(), ranges(150..=257)),
            ("AJB".to_owned(), ranges((260..=760).chain(2000..=2100))),
        ]),
        link: BTreeMap::from([
            ("frames_received".to_owned(), 1_243_117),
            ("frames_damaged".to_owned(), 12),
            ("blocks_asked_again".to_owned(), 14),
            ("scans_lost".to_owned(), 0),
        ]),
        ..Source::default()
    });
    let few = "Eq. 3 as printed with 3 internal impacts and 3 internal responses for 6 interface DoFs: rank 3 of 6, biased";
    for (band, widen) in [([300.0, 600.0], 1.0), ([100.0, 800.0], 6.0), ([100.0, 300.0], 10.0)] {
        results.joint.push(joint("internal", 2, band, 52.1e6, 9.8e6 * widen, &[]));
        results.joint.push(joint("internal", 4, band, 26.2e6, 2.1e6 * widen, &[]));
        results.joint.push(joint("internal", 6, band, 26.81e6, 0.91e6 * widen, &[]));
        results.joint.push(joint("internal-printed", 6, band, 25.9e6, 3.9e6 * widen, &[few]));
    }
    results.joint_spectrum = Some(spectrum());
    let over = |mean, std, cycles| Some(OverCycles { mean, std, cycles, ci95: None });
    for (force, k) in [(Force::Raw, 148.2e6), (Force::Corrected, 151.1e6)] {
        results.hysteresis.push(Hysteresis {
            force,
            kind: Excitation::Impact,
            frequency_hz: Some(207.0),
            amplitude_m: Some(1.02e-7),
            shape: Shape::Stuck,
            k_t_n_per_m: None,
            c_t_n_s_per_m: None,
            k_t_budget: None,
            k_t_why: None,
            slope_between_spots_n_per_m: None,
            stick_part: None,
            k_eq_n_per_m: over(k, 4.1e6, 72),
            k_secant_n_per_m: None,
            k_fundamental_n_per_m: None,
            energy_j: over(-2.1e-8, 4.0e-8, 72),
            friction_limit_n: None,
            friction_limit_ci95_n: None,
            friction_coefficient: None,
            friction_coefficient_ci95: None,
            phase_deg: Some(3.1),
            shape_evidence: None,
            decay_cycles: Vec::new(),
            decay: (1..=8)
                .map(|cycle| DecayStep {
                    cycle,
                    k_eq_n_per_m: OverCycles {
                        mean: k - 9e6 * cycle as f64,
                        std: 5e6,
                        cycles: 72,
                        ci95: None,
                    },
                    phase_deg: 4.0 * cycle as f64,
                    amplitude_m: 1e-7 / cycle as f64,
                })
                .collect(),
            level: None,
            moment: None,
            records: ranges(260..=331),
            findings: Vec::new(),
            warnings: Vec::new(),
        });
    }
    results.hysteresis.extend(levels());
    results.shaker_loops =
        [(100.0, 0.0), (200.0, 65.0), (250.0, 2.0)].map(|(f, lag)| shaker_loop(f, lag)).to_vec();
    results.wear = Some(wear());
    results.static_arm = Some(Identified {
        correction: crate::hysteresis::Correction { effective_mass_kg: 1.74, parallel_path: 0.0133 },
        basis: crate::hysteresis::static_arm::CorrectionSource::Hits,
        residual: 0.004,
    });
    results.reconstruction = Some(reconstruction());
    results.checks = vec![
        Check::new(
            "series-compliance",
            Some(false),
            "The loops at the specimens are 5.5 times stiffer than what FBS sees between the arms: clamp and contact are in series, so the FBS value is not k_T.",
        )
        .with("series_stiffness_n_per_m", 32.7e6)
        .with("ratio", 5.53),
        Check::new(
            "hidden-resonance",
            Some(false),
            "Specimen A moves out of phase with specimen B near 192 Hz: loops there become ellipses and give k_eq, not k_T.",
        )
        .at(192.1),
        Check::new("reciprocity", None, "Too few pairs were measured both ways to say."),
    ];
    results.refused = vec![Refusal {
        method: "internal".into(),
        idms: 6,
        reason: "3 impacts on A and 3 responses on B, but 6 interface DoFs".into(),
    }];
    results.missing = vec!["B: cell BZ2 × B4 has 1 of 3 hits.".into()];
    let done = |configuration: &str, cells, kept, refused: &[(&str, usize)]| Completeness {
        configuration: configuration.into(),
        cells,
        cells_complete: cells,
        wanted: cells * 3,
        kept,
        refused: refused.iter().map(|(v, n)| ((*v).to_owned(), *n)).collect(),
    };
    results.completeness = vec![
        done("A", 48, 144, &[("double hit", 9), ("noisy", 12), ("weak", 2)]),
        done("B", 36, 108, &[("double hit", 5), ("weak", 3)]),
        done("AJB", 168, 504, &[("double hit", 31), ("overload", 4), ("noisy", 17), ("weak", 6)]),
    ];
    let (a, b, j) = (
        [(27.3, 0.09), (430.0, 0.4)],
        [(356.0, 0.5), (840.0, 0.3)],
        [(208.0, 0.1), (356.0, 0.3), (610.0, 0.2)],
    );
    results.frfs = vec![
        frf("A", Role::DrivingPoint, ["A1:z", "AZ1"], &a, 2e-10),
        frf("A", Role::Transfer, ["A1:z", "I_MZ"], &[(27.3, 0.09), (430.0, -0.2)], 2e-10),
        frf("B", Role::DrivingPoint, ["B1:z", "BZ1"], &b, 2e-10),
        frf("B", Role::Transfer, ["B4:z", "BZ1"], &[(356.0, 0.3), (840.0, -0.2)], 2e-10),
        frf("AJB", Role::DrivingPoint, ["A1:z", "AZ1"], &j, 2e-10),
        frf("AJB", Role::Transfer, ["B1:z", "AZ1"], &[(208.0, 0.1), (356.0, -0.1)], 2e-10),
        frf("AJB", Role::SpecimenA, ["x_A", "I_MZ"], &[(192.0, 0.004), (208.0, 0.1)], 2e-10),
        frf("AJB", Role::SpecimenB, ["x_B", "I_MZ"], &[(208.0, 0.09)], 2e-10),
    ];
    results.usable_bands = ["A", "B", "AJB"]
        .map(|c| UsableBand { configuration: c.into(), band_hz: [0.0, 1985.0].into() })
        .to_vec();
    results.example_loop = Some(example_loop());
    results.impact_slopes = (0..72)
        .map(|i| ImpactSlope {
            record: 260 + i,
            impact: ["AZ1", "AZ2", "AZ3", "I_MZ"][i as usize % 4].into(),
            k_eq_n_per_m: 148.2e6 + 7e6 * scatter(i as usize),
        })
        .collect();
    results
}

/// Parts that only a campaign with all three configurations has: the estimate to quote, the virtual
/// points, the CMIF, the bootstrap over hits.
pub fn add_interface(results: &mut Results) {
    use crate::substructuring::Dof;
    use crate::substructuring::averaged::{DofEstimate, Priors, Replicates};
    let band_hz = MAIN_BAND;
    let z = DofEstimate {
        stiffness: 26.7e6,
        std: 0.5e6,
        std_noise: 0.2e6,
        std_geometry: 0.45e6,
        ci95: [25.7e6, 27.7e6],
        bias: -0.02e6,
        damping: 410.0,
        identified: true,
    };
    let lost = DofEstimate { stiffness: 20.0, ci95: [8.0, f64::INFINITY], identified: false, ..z };
    let joint = BTreeMap::from([(Dof::Z, z), (Dof::Rx, lost)]);
    results.recommended = vec![Averaged {
        band_hz,
        lines: 601,
        idms: 6,
        priors: Priors::default(),
        noise_known: true,
        joint: joint.clone(),
    }];
    let hits = Replicates { bias: 0.0, std: 0.21e6, median: 26.7e6, ci95: [26.3e6, 27.1e6] };
    results.bootstrap =
        Some(Bootstrap { band_hz, replicates: 500, seed: 1, hits: BTreeMap::from([(Dof::Z, hits)]), joint });
    results.virtual_points = vec![VirtualPoint {
        substructure: "A".into(),
        idms: 6,
        modes: IdmSet::Six.dofs(),
        condition_responses: 4.2,
        condition_impacts: 3.1,
        overall_sensor: 0.991,
        overall_impact: 0.984,
        sensors: BTreeMap::from([("A1:x".to_owned(), 0.99), ("A2:z".to_owned(), 0.81)]),
        impacts: BTreeMap::from([("AZ1".to_owned(), 0.97)]),
        passivity: IdmSet::Six.dofs().into_iter().map(|d| (d, 1.0)).collect(),
        reciprocity: 0.998,
    }];
    let frequency_hz: Vec<f64> = (20..1000).map(f64::from).collect();
    results.interface_modes = Some(InterfaceModes {
        singular_values_m_per_n: (0..13)
            .map(|c| frequency_hz.iter().map(|f| 1e-3 / f / 10f64.powi(c)).collect())
            .collect(),
        frequency_hz,
        participation: (0..6).map(|c| std::array::from_fn(|dof| if dof == c { 0.9 } else { 0.02 })).collect(),
        explained: BTreeMap::from([(2, 0.7), (4, 0.96), (6, 0.99)]),
        suggested: 4,
        reason: "4 explain 96 %".into(),
    });
}
