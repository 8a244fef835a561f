//! Compares two campaigns: before and after wear, under two loads, with two contacts.

use crate::contact::Interval;
use crate::report::words::side_by_side::{lacking, verdict};
use crate::results::{Compared, Difference, Force, Hysteresis, Results, VERSION};

/// Relative tolerance within which two levels of the shaker count as the same: frequencies are
/// reproduced to some parts per thousand, amplitudes to some per cent.
const SAME_FREQUENCY: f64 = 2e-3;
/// See [`SAME_FREQUENCY`].
const SAME_AMPLITUDE: f64 = 0.06;

/// Compares everything that both have. The errors of two campaigns are assumed independent: if they
/// share a rig and its gains, the true interval of the difference is narrower.
pub fn compare(a: &Results, b: &Results) -> Compared {
    let (mut differences, mut missing) = (Vec::new(), Vec::new());
    let mut put = |quantity: &str, unit, a: Option<Interval>, b: Option<Interval>| match (a, b) {
        (Some(a), Some(b)) => differences.push(difference(quantity.into(), unit, a, b)),
        (None, None) => {}
        (Some(_), None) => missing.push(lacking(quantity, "second")),
        (None, Some(_)) => missing.push(lacking(quantity, "first")),
    };
    let answers = [a.answer.as_ref(), b.answer.as_ref()];
    let [k_a, k_b] = answers.map(|answer| answer?.contact.k_t_n_per_m);
    put(K_T, "N/m", k_a, k_b);
    let [c_a, c_b] = answers.map(|answer| answer?.contact.c_t_n_s_per_m);
    put("c_T of the contact", "N s/m", c_a, c_b);
    let [k_a, k_b] = answers.map(|answer| answer?.between_arms.k_n_per_m);
    put(BETWEEN, "N/m", k_a, k_b);
    let [k_a, k_b] = answers.map(|answer| answer?.clamp.as_ref().map(|clamp| clamp.k_n_per_m));
    put("clamps", "N/m", k_a, k_b);
    differences.extend(levels(a, b));
    let told = [K_T, BETWEEN].into_iter().find_map(|name| differences.iter().find(|d| d.quantity == name));
    Compared {
        version: VERSION,
        sources: [a.source.clone(), b.source.clone()],
        differ: told.map(|d| d.differ),
        verdict: verdict(told),
        differences,
        missing,
    }
}

const K_T: &str = "k_T of the contact";
const BETWEEN: &str = "between the arms";

fn difference(quantity: String, unit: &'static str, a: Interval, b: Interval) -> Difference {
    let mean = b.mean - a.mean;
    let down = (b.mean - b.ci95[0]).hypot(a.ci95[1] - a.mean);
    let up = (b.ci95[1] - b.mean).hypot(a.mean - a.ci95[0]);
    let ci95 = [mean - down, mean + up];
    Difference {
        quantity,
        unit,
        a,
        b,
        b_minus_a: Interval { mean, ci95 },
        differ: ci95[0] > 0.0 || ci95[1] < 0.0,
    }
}

/// Levels that both measured: k_T if known in both, otherwise the slope of the straight loop.
fn levels(a: &Results, b: &Results) -> Vec<Difference> {
    let steady = |r: &Hysteresis| r.level.is_some() && r.force == Force::Raw;
    let pairs = a.hysteresis.iter().filter(|r| steady(r)).filter_map(|x| {
        let same = |y: &&Hysteresis| steady(y) && x.moment == y.moment && near(x, y);
        Some((x, b.hysteresis.iter().find(same)?))
    });
    pairs
        .filter_map(|(x, y)| {
            let slope = |r: &Hysteresis| {
                let k = r.stick_slope()?;
                Some(Interval { mean: k.mean, ci95: k.ci95? })
            };
            let (name, of_a, of_b) = match (x.own_k_t(), y.own_k_t()) {
                (Some(p), Some(q)) => ("k_T", p, q),
                _ => ("slope between the spots", slope(x)?, slope(y)?),
            };
            let quantity = format!(
                "{name}, shaker, {:.0} Hz, {:.2} µm, {}",
                x.frequency_hz?,
                1e6 * x.amplitude_m?,
                x.moment.unwrap_or("once")
            );
            Some(difference(quantity, "N/m", of_a, of_b))
        })
        .collect()
}

fn near(x: &Hysteresis, y: &Hysteresis) -> bool {
    let within =
        |p: Option<f64>, q: Option<f64>, part: f64| p.zip(q).is_some_and(|(p, q)| (p / q - 1.0).abs() < part);
    within(x.frequency_hz, y.frequency_hz, SAME_FREQUENCY)
        && within(x.amplitude_m, y.amplitude_m, SAME_AMPLITUDE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn interval(mean: f64, half: f64) -> Interval {
        Interval { mean, ci95: [mean - half, mean + half] }
    }

    #[test]
    fn a_difference_has_the_intervals_of_both() {
        let d = difference(K_T.into(), "N/m", interval(180e6, 6e6), interval(162e6, 5e6));
        let half = 5e6f64.hypot(6e6);
        assert!((d.b_minus_a.mean + 18e6).abs() < 1.0 && (d.b_minus_a.ci95[0] + 18e6 + half).abs() < 1.0);
        assert!(d.differ);
        let same = difference(K_T.into(), "N/m", interval(180e6, 6e6), interval(177e6, 5e6));
        assert!(!same.differ);
    }

    #[test]
    fn empty_results_tell_nothing() {
        let compared = compare(&Results::default(), &Results::default());
        assert_eq!((compared.differ, compared.differences.len()), (None, 0));
    }
}
