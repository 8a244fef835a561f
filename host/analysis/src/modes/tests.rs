use super::rigs::{Rig, compare};
use super::*;

/// Rigs `from..to`: prints a table and returns the sums.
fn table(seeds: std::ops::Range<u64>) -> Sums {
    let mut sums = Sums::default();
    let verbose = std::env::var("MODES_VERBOSE").is_ok();
    for seed in seeds {
        let rig = Rig::random(seed);
        let start = std::time::Instant::now();
        let found = identify(&rig.measured(seed), &rig.settings());
        let seconds = start.elapsed().as_secs_f64();
        let found = match found {
            Ok(found) => found,
            Err(error) => {
                println!("seed {seed}: {error}");
                sums.failed += 1;
                continue;
            }
        };
        let outcome = compare(&rig, &found);
        sums.rigs += 1;
        if verbose {
            println!(
                "seed {seed}: {}x{} sigma {} chi2 {:.3} modes {} outside {} residual terms {} {seconds:.2} s",
                rig.noise.nrows(),
                rig.noise.ncols(),
                rig.sigma_per_s,
                outcome.chi2_per_dof,
                rig.poles.len(),
                found.background.len(),
                found.residuals.len(),
            );
        }
        for (r, (peak, errors)) in outcome.modes.iter().enumerate() {
            sums.modes += 1;
            if *peak >= 5.0 {
                sums.clear += 1;
                if errors.is_none() {
                    let pole = rig.poles[r];
                    println!(
                        "seed {seed}: lost {:.2} Hz, damping {:.4}, peak {peak:.1} ({}x{}, sigma {})",
                        pole.norm() / TAU,
                        -pole.re / pole.norm(),
                        rig.noise.nrows(),
                        rig.noise.ncols(),
                        rig.sigma_per_s
                    );
                }
            }
            let Some([f, d]) = errors else { continue };
            sums.found += 1;
            sums.clear_found += usize::from(*peak >= 5.0);
            sums.covered_frequency += usize::from(f.abs() < 1.959_964);
            sums.covered_damping += usize::from(d.abs() < 1.959_964);
            sums.bias_frequency += f;
            sums.bias_damping += d;
            if verbose && (f.abs() > 3.0 || d.abs() > 3.0) {
                println!(
                    "   mode {r} peak {peak:.1} errors {f:.2} {d:.2} of {:.2} Hz {:.4}",
                    rig.poles[r].norm() / TAU,
                    -rig.poles[r].re / rig.poles[r].norm()
                );
            }
        }
        for [f, d, e] in &outcome.spurious {
            println!(
                "seed {seed}: spurious {f:.2} Hz, damping {d:.4}, evidence {e:.1}, chi2 {:.3}",
                outcome.chi2_per_dof
            );
        }
        sums.spurious += outcome.spurious.len();
        sums.seconds += seconds;
    }
    println!("{sums:?}");
    let share = |part: usize, all: usize| 100.0 * part as f64 / all as f64;
    println!(
        "coverage frequency {:.1} %, damping {:.1} %; found {:.1} % of clear modes; bias frequency {:.3}, damping {:.3}; spurious {:.2} per 100 rigs",
        share(sums.covered_frequency, sums.found),
        share(sums.covered_damping, sums.found),
        share(sums.clear_found, sums.clear),
        sums.bias_frequency / sums.found as f64,
        sums.bias_damping / sums.found as f64,
        share(sums.spurious, sums.rigs)
    );
    sums
}

#[derive(Debug, Default)]
struct Sums {
    rigs: usize,
    failed: usize,
    modes: usize,
    clear: usize,
    clear_found: usize,
    found: usize,
    covered_frequency: usize,
    covered_damping: usize,
    bias_frequency: f64,
    bias_damping: f64,
    spurious: usize,
    seconds: f64,
}

#[test]
#[ignore = "development"]
fn development() {
    let seeds = std::env::var("MODES_SEEDS").unwrap_or("0..20".into());
    let (a, b) = seeds.split_once("..").expect("a..b");
    table(a.parse().expect("a")..b.parse().expect("b"));
}
