//! The first line of `identify`: the number that was requested.

use super::answer_sentences::with_interval;
use super::number::{band, stiffness};
use super::{brief, summary};
use crate::contact::Interval;
use crate::results::{Joint, Results, headline_rank};
use crate::substructuring::{Dof, fit};

/// The main result in one line: the answer of a campaign, otherwise the first number available.
pub fn of(results: &Results) -> String {
    let answer = brief::answer(results).into_iter().next();
    answer
        .map(|line| format!("{} {}", line.head, line.text))
        .or_else(|| between_the_arms(results))
        .or_else(|| summary::summary(results).into_iter().next())
        .unwrap_or_else(|| "no stiffness was found".into())
}

/// The stiffness along the sliding direction, from the best available source: the fit if it was
/// requested, then the recommended estimate, then single methods. `None` if no method identified
/// it.
pub fn between_the_arms(results: &Results) -> Option<String> {
    let said = fitted(results).or_else(|| recommended(results)).or_else(|| by_one_method(results))?;
    Some(format!("k_z between the arms: {said}."))
}

fn fitted(results: &Results) -> Option<String> {
    let row = best(results, |row| row.method == fit::NAME)?;
    let k = row.sliding_stiffness()?;
    Some(match k.ci95 {
        Some(ci95) => {
            let told = with_interval(&Interval { mean: k.mean, ci95 });
            format!("{told}, {} with {} IDMs, {}", row.method, row.idms, band(row.band_hz))
        }
        None => with_scatter(row, k.mean, k.std),
    })
}

fn recommended(results: &Results) -> Option<String> {
    let z = |r: &crate::results::Averaged| r.joint.get(&Dof::Z).filter(|z| z.identified).copied();
    let (estimate, z) = results.recommended.iter().find_map(|r| Some((r, z(r)?)))?;
    let told = with_interval(&Interval { mean: z.stiffness, ci95: z.ci95 });
    let of = if estimate.noise_known { "" } else { " (of errors of position and angle alone)" };
    Some(format!("{told}{of}, recommended, {} IDMs, {}", estimate.idms, band(estimate.band_hz)))
}

fn by_one_method(results: &Results) -> Option<String> {
    let row = best(results, |_| true)?;
    let k = row.sliding_stiffness()?;
    Some(with_scatter(row, k.mean, k.std))
}

fn with_scatter(row: &Joint, mean: f64, std: f64) -> String {
    let (method, idms, band, lines) = (&row.method, row.idms, band(row.band_hz), row.lines);
    format!("{} (scatter of {lines} lines), {method} with {idms} IDMs, {band}", stiffness(mean, std))
}

/// Of the rows that identified it and satisfy `wanted`, the best one in the first band.
fn best(results: &Results, wanted: impl Fn(&Joint) -> bool) -> Option<&Joint> {
    let rows = || results.joint.iter().filter(|row| row.identified() && wanted(row));
    let first = rows().next()?.band_hz;
    rows().filter(|row| row.band_hz == first).max_by_key(|row| headline_rank(&row.method, row.idms))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::{Source, example_tests as example};

    #[test]
    fn the_best_number_comes_first_and_none_is_made_up() {
        let mut results = example::results();
        let one = between_the_arms(&results);
        assert!(one.as_ref().is_some_and(|line| line.contains("26.8 ± 0.9 N/µm")), "{one:?}");
        example::add_interface(&mut results);
        let quoted = between_the_arms(&results);
        assert!(quoted.as_ref().is_some_and(|line| line.contains("recommended")), "{quoted:?}");
        assert_eq!(between_the_arms(&Results::new(Source::default())), None);
    }
}
