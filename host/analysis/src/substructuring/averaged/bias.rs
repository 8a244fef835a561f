//! Second-order effect of noise on the compliance, simulated because it has no short closed form.

use super::assembly::Assembly;
use super::{Line, compliance, invert};
use crate::parallel::prelude::*;
use nalgebra::Complex;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Pairs of draws per line; averaging over hundreds of lines reduces the remaining scatter.
const PAIRS: u64 = 4;
/// Fixed seed, so that the same data give the same values.
const SEED: u64 = 0x6A6F_696E;

/// E\[y(Y + n)\] − y(Y) per line and degree of freedom; zero if the noise is not known. A pair ±n
/// cancels the linear part, so a few draws suffice.
pub(super) fn of(assembly: &Assembly, impedance: &[Line]) -> Vec<Vec<Complex<f64>>> {
    let n = impedance[0].nrows() / 2;
    let Some(variance) = &assembly.variance else {
        return vec![vec![Complex::default(); n]; impedance.len()];
    };
    (0..impedance.len())
        .into_par_iter()
        .map(|l| {
            // a separate random stream for every line: the order of threads does not matter
            let mut stream = Xoshiro256PlusPlus::seed_from_u64(SEED ^ ((l as u64) << 20));
            let mut normal = || -> f64 { StandardNormal.sample(&mut stream) };
            let y = assembly.layout.reduce(&assembly.cells[l]);
            let mut sum = vec![Complex::default(); n];
            for _ in 0..PAIRS {
                let noise = variance[l].map(|v| Complex::new(normal(), normal()) * v.sqrt());
                let noise = assembly.layout.reduce(&noise);
                // a draw that makes Y singular to rounding has probability zero and is skipped
                let (Ok(plus), Ok(minus)) = (invert(&(&y + &noise)), invert(&(&y - &noise))) else {
                    continue;
                };
                for (d, sum) in sum.iter_mut().enumerate() {
                    let mean = 0.5 * (compliance(&plus, d) + compliance(&minus, d));
                    *sum += (mean - compliance(&impedance[l], d)) / PAIRS as f64;
                }
            }
            sum
        })
        .collect()
}
