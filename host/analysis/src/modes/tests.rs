use super::random_rigs::{Rig, compare};
use super::*;
use nalgebra::Complex;
use proptest::prelude::*;

/// Masses on springs with dampers, hit and measured at all of them, by inversion of the dynamic
/// stiffness: not by the formula that is tested.
struct Masses {
    mass: DMatrix<f64>,
    damping: DMatrix<f64>,
    stiffness: DMatrix<f64>,
}

impl Masses {
    fn one(mass: f64, omega: f64, damping_ratio: f64) -> Masses {
        let of = |value: f64| DMatrix::from_element(1, 1, value);
        Masses {
            mass: of(mass),
            damping: of(2.0 * damping_ratio * omega * mass),
            stiffness: of(omega * omega * mass),
        }
    }

    /// Two equal masses with equal springs to the ground and one between them: in phase at
    /// √(k/m), in antiphase at √((k + 2k₁₂)/m); dampers in the same ratio.
    fn two(mass: f64, k: f64, between: f64, per_stiffness: f64) -> Masses {
        let stiffness = DMatrix::from_row_slice(2, 2, &[k + between, -between, -between, k + between]);
        Masses {
            mass: DMatrix::from_diagonal_element(2, 2, mass),
            damping: &stiffness * per_stiffness,
            stiffness,
        }
    }

    fn frf(&self, frequency_hz: Vec<f64>, sigma_per_s: f64, quantity: MotionQuantity) -> Frf {
        let line = |f: &f64| {
            let s = C::new(sigma_per_s, TAU * f);
            let z = self.mass.map(|v| s * s * v)
                + self.damping.map(|v| s * v)
                + self.stiffness.map(Complex::from);
            z.try_inverse().expect("damped") * s.powi(quantity.order_of_s())
        };
        let lines = frequency_hz.iter().map(line).collect();
        let names = |what: &str| (0..self.mass.nrows()).map(|k| format!("{what}{k}")).collect();
        Frf::new(frequency_hz, sigma_per_s, quantity, names("a"), names("f"), lines).expect("all agree")
    }
}

fn axis(low_hz: f64, step_hz: f64, lines: usize) -> Vec<f64> {
    (0..lines).map(|l| low_hz + step_hz * l as f64).collect()
}

fn found(frf: &Frf) -> Modes {
    let hz = frf.frequency_hz();
    let mut settings = Settings::of(Band { low_hz: hz[0], high_hz: hz[hz.len() - 1] });
    settings.driving_points = vec![DrivingPoint { output: 0, input: 0, sign: 1.0 }];
    identify(frf, &settings).expect("modes")
}

/// Relative accuracy on exact data: rounding of the data, multiplied by the lines per peak.
const EXACT: f64 = 1e-9;

#[test]
fn one_mass_is_exact_in_every_quantity_with_and_without_a_window() {
    let (mass, omega, damping_ratio) = (2.0, TAU * 100.0, 0.01);
    for quantity in [MotionQuantity::Displacement, MotionQuantity::Velocity, MotionQuantity::Acceleration] {
        for sigma in [0.0, 2.3, 50.0] {
            let rig = Masses::one(mass, omega, damping_ratio);
            let found = found(&rig.frf(axis(50.0, 0.25, 500), sigma, quantity));
            let [mode] = &found.modes[..] else {
                panic!(
                    "{quantity:?} {sigma}: {:?}, χ² {:e}",
                    found.modes.iter().map(|m| (m.pole_per_s, m.evidence)).collect::<Vec<_>>(),
                    found.chi2_per_dof
                )
            };
            assert!((mode.frequency_hz / 100.0 - 1.0).abs() < EXACT, "{}", mode.frequency_hz);
            assert!((mode.damping_ratio - damping_ratio).abs() < EXACT, "{}", mode.damping_ratio);
            // residue of the receptance: 1/(2 i ω_d m)
            let omega_d = omega * (1.0 - damping_ratio * damping_ratio).sqrt();
            let residue = (C::i() * 2.0 * omega_d * mass).inv();
            assert!((mode.residue(0, 0) / residue - 1.0).norm() < 1e-8);
            assert_eq!(mode.scaling, Scaling::UnitModalA);
            let phi = mode.shape[0] * (C::i() * 2.0 * omega_d).sqrt();
            assert!((phi.norm() * mass.sqrt() - 1.0).abs() < 1e-8, "unit modal mass");
        }
    }
}

#[test]
fn two_masses_are_exact() {
    let (mass, k, between, per_stiffness) = (1.5, 1.0e6, 0.3e6, 2e-5);
    let rig = Masses::two(mass, k, between, per_stiffness);
    let found = found(&rig.frf(axis(80.0, 0.25, 600), 2.3, MotionQuantity::Velocity));
    assert_eq!(found.modes.len(), 2);
    for (mode, (stiffness, shape)) in
        found.modes.iter().zip([(k, [1.0, 1.0]), (k + 2.0 * between, [1.0, -1.0])])
    {
        let omega = (stiffness / mass).sqrt();
        assert!((mode.frequency_hz / (omega / TAU) - 1.0).abs() < EXACT);
        assert!((mode.damping_ratio - 0.5 * per_stiffness * omega).abs() < EXACT);
        assert!(1.0 - mac(&mode.shape, &shape.map(C::from)) < EXACT);
    }
    // without noise even the first mode is at a phase of its own: the shapes are real
    let shape = &found.modes[1].shape;
    assert!((shape[1] / shape[0] + 1.0).norm() < 1e-7);
    assert!(mac(&found.modes[0].shape, &found.modes[1].shape) < EXACT);
}

/// Poles of three masses of 2, 1.2 and 0.8 kg on springs of 2.2, 1.5 and 1.1 N/µm with dampers of
/// 18, 4 and 1 N s/m, by numpy's eigenvalues of the state matrix.
const REFERENCE: [C; 3] = [
    C::new(-0.896_015_795_693_312_4, 579.099_442_215_002),
    C::new(-3.421_855_655_879_170_4, 1_288.363_407_422_295),
    C::new(-3.890_461_881_760_743, 1_842.927_076_854_469_3),
];

/// Mobilities of that structure on the line of a window of 2.3 1/s, by numpy's inverse of its
/// dynamic stiffness at each line; ten digits.
#[test]
fn the_reference_case_has_its_poles() {
    let rows: Vec<Vec<&str>> = include_str!("../../examples/data/modes.csv")
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect())
        .collect();
    let number = |text: &str| text.parse::<f64>().expect("a number");
    let (outputs, inputs) = (["m1", "m2", "m3"], ["f1", "f3"]);
    let lines = rows.chunks(6).map(|line| {
        let values = line.iter().map(|row| C::new(number(row[3]), number(row[4])));
        DMatrix::from_row_iterator(3, 2, values)
    });
    let frf = Frf::new(
        rows.chunks(6).map(|line| number(line[0][0])).collect(),
        2.3,
        MotionQuantity::Velocity,
        outputs.map(String::from).to_vec(),
        inputs.map(String::from).to_vec(),
        lines.collect(),
    );
    let found = found(&frf.expect("all agree"));
    assert_eq!(found.modes.len(), 3);
    for (mode, pole) in found.modes.iter().zip(REFERENCE) {
        assert!((mode.pole_per_s - pole).norm() < 1e-8 * pole.norm(), "{}", mode.pole_per_s);
    }
    assert_eq!(found.background, []);
}

#[test]
fn the_synthesis_is_the_data_and_converts_quantity_and_window() {
    let rig = Masses::two(1.5, 1.0e6, 0.3e6, 2e-5);
    let hz = axis(80.0, 0.25, 600);
    let found = found(&rig.frf(hz.clone(), 2.3, MotionQuantity::Velocity));
    for (quantity, sigma) in [(MotionQuantity::Velocity, 2.3), (MotionQuantity::Displacement, 0.0)] {
        let wanted = rig.frf(hz.clone(), sigma, quantity);
        let synthesis = found.synthesise(hz.clone(), sigma, quantity).expect("a rising axis");
        for (wanted, y) in wanted.lines().iter().zip(synthesis.lines()) {
            assert!((wanted - y).norm() < 1e-7 * wanted.norm());
        }
    }
    // and its modes are those that it was made of
    let again =
        super::tests::found(&found.synthesise(hz, 2.3, MotionQuantity::Acceleration).expect("a rising axis"));
    for (again, mode) in again.modes.iter().zip(&found.modes) {
        assert!((again.pole_per_s - mode.pole_per_s).norm() < 1e-8 * mode.pole_per_s.norm());
    }
}

#[test]
fn a_factor_of_the_frfs_scales_residues_and_nothing_else() {
    let rig = Rig::random(1);
    let frf = rig.measured(1);
    let times = |factor: f64| {
        let variance = frf.variance().expect("given").iter().map(|v| v * factor * factor).collect();
        let scaled = frf.clone().without_noise().map_lines(|_, mut y| y *= C::from(factor));
        identify(&scaled.with_variance(variance).expect("as many"), &rig.settings()).expect("modes")
    };
    let (one, many) = (times(1.0), times(1024.0));
    assert_eq!(one.modes.len(), many.modes.len());
    assert!((one.chi2_per_dof - many.chi2_per_dof).abs() < 1e-9);
    for (a, b) in one.modes.iter().zip(&many.modes) {
        // a power of two changes no bit of the mantissa
        assert!((a.pole_per_s - b.pole_per_s).norm() < 1e-12 * a.pole_per_s.norm());
        assert!((b.residue(0, 0) / a.residue(0, 0) / 1024.0 - 1.0).norm() < 1e-9);
        assert!((a.damping_ratio_std / b.damping_ratio_std - 1.0).abs() < 1e-9);
    }
}

#[test]
fn noise_is_estimated_where_it_is_not_given() {
    let rig = Rig::random(2);
    let frf = rig.measured(2);
    let given = identify(&frf, &rig.settings()).expect("modes");
    assert!((given.chi2_per_dof - 1.0).abs() < 0.05, "{}", given.chi2_per_dof);
    let estimated = identify(&frf.without_noise(), &rig.settings()).expect("modes");
    assert_eq!((given.noise, estimated.noise), (NoiseKnown::Given, NoiseKnown::Estimated));
    for mode in &given.modes {
        // cells of different noise count the same, so that the interval is wider and another
        let same = |other: &&Mode| {
            (other.frequency_hz - mode.frequency_hz).abs()
                < 6.0 * other.frequency_std_hz.hypot(mode.frequency_std_hz)
        };
        assert!(mode.evidence < 1e4 || estimated.modes.iter().any(|other| same(&other)));
    }
}

#[test]
fn what_cannot_be_identified_is_refused_with_the_reason() {
    let frf = Masses::one(2.0, TAU * 100.0, 0.01).frf(axis(0.0, 0.5, 400), 0.0, MotionQuantity::Velocity);
    let refused = |frf: &Frf, settings: &Settings| identify(frf, settings).expect_err("refused").to_string();
    let band = |low_hz, high_hz| Settings::of(Band { low_hz, high_hz });
    assert!(refused(&frf, &band(100.0, 50.0)).contains("not a band"));
    assert!(refused(&frf, &band(100.0, 105.0)).contains("at least 16"));
    assert!(matches!(
        identify(&frf, &band(0.0, 150.0)),
        Err(ModesError::Frf(FrfError::DivisionByZero { line: 0, .. }))
    ));
    let mut settings = band(50.0, 150.0);
    settings.driving_points = vec![DrivingPoint { output: 1, input: 0, sign: 1.0 }];
    assert!(refused(&frf, &settings).contains("driving point"));
    settings = Settings { damping_limit: 1.0, ..band(50.0, 150.0) };
    assert!(refused(&frf, &settings).contains("limit"));
    let mut variance = vec![DMatrix::from_element(1, 1, 1e-12); 400];
    let with = |variance| frf.clone().with_variance(variance).expect("as many");
    assert!(identify(&with(variance.clone()), &band(50.0, 150.0)).is_ok());
    // unknown over more than the lines that a variance is averaged over
    for unknown in &mut variance[150..250] {
        unknown.fill(f64::NAN);
    }
    assert!(refused(&with(variance), &band(50.0, 150.0)).contains("`a0`"));
    let zero = frf.map_lines(|_, mut y| y.fill(C::from(0.0)));
    assert!(refused(&zero, &band(50.0, 150.0)).contains("zero"));
}

/// The second column is that of a slightly stiffer structure, and its gain varies with frequency:
/// without noise to explain this, every further pole describes a part of it.
#[test]
fn a_search_without_end_is_ended_and_says_so() {
    let hz = axis(20.0, 0.5, 400);
    let [one, other] = [1e6, 1.00002e6]
        .map(|k| Masses::two(1.0, k, 0.3 * k, 1e-6).frf(hz.clone(), 2.3, MotionQuantity::Velocity));
    let lines = one.lines().iter().zip(other.lines()).zip(&hz);
    let lines = lines.map(|((one, other), f)| {
        let mut line = one.clone();
        line.set_column(1, &other.column(1).map(|y| y * (1.0 + 1e-4 * (f / 50.0).sin())));
        line
    });
    let (outputs, inputs) = (one.outputs().to_vec(), one.inputs().to_vec());
    let frf = Frf::new(hz.clone(), 2.3, MotionQuantity::Velocity, outputs, inputs, lines.collect());
    let frf = frf.expect("all agree");
    let settings = Settings { most_work: 100_000_000, ..Settings::of(Band { low_hz: 20.0, high_hz: 219.5 }) };
    let found = identify(&frf, &settings).expect("modes");
    assert!(!found.complete, "{} modes", found.modes.len());
    // the same FRFs with an error that explains the differences
    let variance: Vec<DMatrix<f64>> =
        frf.lines().iter().map(|line| line.map(|y| 1e-4 * (y.norm_sqr() + 1e-12))).collect();
    let frf = frf.with_variance(variance).expect("all agree");
    let found = identify(&frf, &settings).expect("modes");
    assert!(found.complete && found.modes.len() == 2, "{} modes", found.modes.len());
}

#[test]
fn noise_alone_has_no_modes() {
    for seed in 0..5 {
        let mut rig = Rig::random(seed);
        rig.shape.fill(C::from(0.0));
        rig.without_others();
        let found = identify(&rig.measured(seed), &rig.settings()).expect("no modes are no error");
        assert_eq!(found.modes, []);
    }
}

proptest! {
    #[test]
    fn mac_is_one_for_any_multiple_and_symmetric(
        parts in prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64), 2..8),
        factor in (0.1..10.0f64, -3.0..3.0f64),
    ) {
        let a: Vec<C> = parts.iter().map(|p| C::new(p.0, p.1)).collect();
        let b: Vec<C> = parts.iter().map(|p| C::new(p.2, p.3)).collect();
        let multiple: Vec<C> = a.iter().map(|v| v * C::from_polar(factor.0, factor.1)).collect();
        let value = mac(&a, &b);
        prop_assert!((0.0..=1.0).contains(&value));
        prop_assert!((value - mac(&b, &a)).abs() < 1e-12);
        if a.iter().any(|v| v.norm() > 1e-3) {
            prop_assert!((mac(&a, &multiple) - 1.0).abs() < 1e-12);
        }
        prop_assert_eq!(mac(&a, &vec![C::from(0.0); a.len()]), 0.0);
    }
}

/// What was found of many rigs.
#[derive(Debug, Default)]
struct Sums {
    rigs: usize,
    modes: usize,
    found: usize,
    /// Modes whose peak stands five standard deviations above its noise in at least one cell.
    clear: usize,
    clear_found: usize,
    spurious: usize,
    covered: [usize; 2],
    /// Of the errors over their standard deviations.
    sum: [f64; 2],
    squares: [f64; 2],
    /// Median needs all of them.
    errors: [Vec<f64>; 2],
    seconds: f64,
    slowest_s: f64,
}

impl Sums {
    fn of(seeds: std::ops::Range<u64>) -> Sums {
        let verbose = std::env::var_os("JOINTRIG_VERBOSE").is_some();
        let mut sums = Sums::default();
        for seed in seeds {
            let rig = Rig::random(seed);
            let frf = rig.measured(seed);
            let start = std::time::Instant::now();
            let found = identify(&frf, &rig.settings()).expect("modes");
            let seconds = start.elapsed().as_secs_f64();
            sums.seconds += seconds;
            sums.slowest_s = sums.slowest_s.max(seconds);
            sums.rigs += 1;
            let outcome = compare(&rig, &found);
            sums.spurious += outcome.spurious.len();
            if verbose {
                println!("seed {seed}: chi2 {:.3}, {seconds:.2} s", found.chi2_per_dof);
                outcome
                    .spurious
                    .iter()
                    .for_each(|[f, d, _]| println!("  spurious {f:.2} Hz, damping {d:.4}"));
            }
            for (r, (peak, errors)) in outcome.modes.into_iter().enumerate() {
                sums.modes += 1;
                sums.clear += usize::from(peak >= 5.0);
                let Some(errors) = errors else {
                    if verbose && peak >= 5.0 {
                        println!("  lost {:.2} Hz, peak {peak:.1}", rig.poles[r].norm() / TAU);
                    }
                    continue;
                };
                sums.clear_found += usize::from(peak >= 5.0);
                sums.found += 1;
                for (k, error) in errors.into_iter().enumerate() {
                    sums.covered[k] += usize::from(error.abs() < 1.959_964);
                    sums.sum[k] += error;
                    sums.squares[k] += error * error;
                    sums.errors[k].push(error);
                }
            }
        }
        sums
    }

    fn print(&mut self) {
        let percent = |part: usize, all: usize| 100.0 * part as f64 / all as f64;
        println!("| rigs | modes | peak > 5 σ | of these found | spurious | seconds, mean | slowest |");
        println!("|---|---|---|---|---|---|---|");
        println!(
            "| {} | {} | {} | {} ({:.1} %) | {} | {:.1} | {:.1} |",
            self.rigs,
            self.modes,
            self.clear,
            self.clear_found,
            percent(self.clear_found, self.clear),
            self.spurious,
            self.seconds / self.rigs as f64,
            self.slowest_s,
        );
        println!("\n| error over its σ | covered by ±1.96 σ | mean | median | rms |");
        println!("|---|---|---|---|---|");
        for (k, name) in ["natural frequency", "damping ratio"].iter().enumerate() {
            self.errors[k].sort_by(f64::total_cmp);
            let n = self.found as f64;
            println!(
                "| {name} | {} of {} ({:.1} %) | {:+.3} | {:+.3} | {:.2} |",
                self.covered[k],
                self.found,
                percent(self.covered[k], self.found),
                self.sum[k] / n,
                self.errors[k][self.errors[k].len() / 2],
                (self.squares[k] / n).sqrt(),
            );
        }
    }
}

/// Some rigs of those with which the method was developed.
#[test]
fn random_rigs_are_found_with_honest_intervals() {
    let mut sums = Sums::of(0..12);
    sums.print();
    assert!(sums.clear_found * 100 >= 96 * sums.clear, "{sums:?}");
    assert!(sums.spurious <= 1, "{sums:?}");
    for k in 0..2 {
        // 95 % of about 60, three standard deviations of the binomial distribution lower
        assert!(sums.covered[k] * 100 >= 86 * sums.found, "{sums:?}");
    }
}

/// `cargo test --release -p jointrig-analysis --features rayon modes -- --ignored --nocapture
/// table_of_random_rigs`; `SEEDS=1000..1200` selects the rigs that were not used in development.
#[test]
#[ignore = "ten minutes"]
fn table_of_random_rigs() {
    let seeds = std::env::var("SEEDS").unwrap_or_else(|_| "0..200".into());
    let (from, to) = seeds.split_once("..").expect("FROM..TO");
    Sums::of(from.parse().expect("a number")..to.parse().expect("a number")).print();
}

/// A campaign's largest matrix: 27 outputs, 24 inputs, 3600 lines, 20 modes.
#[test]
#[ignore = "measures time"]
fn a_large_matrix() {
    let rig = Rig::large();
    let frf = rig.measured(0);
    let start = std::time::Instant::now();
    let found = identify(&frf, &rig.settings()).expect("modes");
    let outcome = compare(&rig, &found);
    println!(
        "{:.2} s, {} of {} modes, {} spurious, chi2 {:.4}",
        start.elapsed().as_secs_f64(),
        outcome.modes.iter().filter(|(_, errors)| errors.is_some()).count(),
        rig.poles.len(),
        outcome.spurious.len(),
        found.chi2_per_dof,
    );
}

#[test]
fn phase_collinearity_is_one_in_phase_and_zero_for_a_travelling_wave() {
    let turned = C::from_polar(1.0, 0.7);
    let in_phase: Vec<C> = [1.0, -0.5, 0.2].iter().map(|v| turned * v).collect();
    assert!((phase_collinearity(&in_phase) - 1.0).abs() < 1e-12);
    let travelling: Vec<C> = (0..8).map(|k| C::from_polar(1.0, f64::from(k) * TAU / 8.0)).collect();
    assert!(phase_collinearity(&travelling) < 1e-12);
    assert_eq!(phase_collinearity(&[]), 1.0);
}
