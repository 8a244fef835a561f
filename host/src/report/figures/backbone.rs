//! A slipping contact against amplitude: stiffness and tip force of the levels, and the fitted law.

use super::MICRO;
use crate::report::figure::{Along, Axis, Figure, Height, How, Mark, Marker, Packed, Panel, Role};
use crate::report::scale::middle_range;
use crate::report::words::number::{decimals, micro, short};
use crate::results::{Backbone, Force, Hysteresis, Results};

/// Maximum number of laws in one figure.
const MOST: usize = 3;

/// Paths of amplitudes and secants.
const AMPLITUDE: &str = "/hysteresis/*/amplitude_m";
const SECANT: &str = "/hysteresis/*/k_secant_n_per_m";

/// Number of points of a law's curve.
const POINTS: usize = 160;

/// Left: slope of the stick part and peak secant of each level, and the law's secant. Right: the
/// force at the loops' tips, and the law's backbone.
pub fn backbone(results: &Results) -> Option<Figure> {
    let shown = &results.backbones[..results.backbones.len().min(MOST)];
    let rows: Vec<Vec<&Hysteresis>> = shown.iter().map(|one| rows(results, one)).collect();
    let all = || rows.iter().flatten();
    let amplitudes = all().filter_map(|row| row.amplitude_m).map(|x| (MICRO * x).log10());
    let [low, high] = middle_range(amplitudes, 1.0, 0.1)?.map(|e| 10f64.powf(e));
    let stuck = all().filter_map(|row| row.stick_slope()).map(|k| k.mean + k.std);
    let stiffest = stuck.chain(all().filter_map(|row| row.k_secant_n_per_m)).map(micro).fold(0.0, f64::max);
    let strongest = all().filter_map(|row| tip(row)).fold(0.0, f64::max);
    let most_n = shown.iter().map(|one| one.law.tip(high / MICRO)).fold(strongest, f64::max);
    let x = || Axis::log("amplitude of Δx", "µm", [low, high]).linked("backbone");
    let mut stiffness =
        Panel::new(x(), Axis::linear("stiffness", "N/µm", [0.0, 1.1 * stiffest])).high(Height::Tall);
    let mut force =
        Panel::new(x(), Axis::linear("force at the tip", "N", [0.0, 1.1 * most_n])).high(Height::Tall);
    let along: Vec<f64> = (0..=POINTS).map(|i| low * (high / low).powf(i as f64 / POINTS as f64)).collect();
    let packed = Along::List(Packed::of(along.iter().copied()));
    let mut words = Vec::new();
    for (i, (one, own)) in shown.iter().zip(&rows).enumerate() {
        let (role, law) = (Role::group(i), &one.law);
        let at = |row: &&Hysteresis, y: f64| Some([MICRO * row.amplitude_m?, y]);
        let slopes: Vec<_> = own
            .iter()
            .filter_map(|r| Some((at(r, micro(r.stick_slope()?.mean))?, micro(r.stick_slope()?.std))))
            .collect();
        let secants = own.iter().filter_map(|r| at(r, micro(r.k_secant_n_per_m?)));
        let tips = own.iter().filter_map(|r| at(r, tip(r)?));
        stiffness = stiffness
            .with(
                Mark::line(role, packed.clone(), along.iter().map(|x| micro(law.secant(x / MICRO))))
                    .named(format!("law, {} Hz", short(one.frequency_hz))),
            )
            .with(
                Mark::points(role, Marker::Ring, slopes.iter().map(|(at, _)| *at))
                    .barred("y", slopes.iter().map(|(at, std)| [at[1] - std, at[1] + std]))
                    .named("slope of the stick part")
                    .from("x", AMPLITUDE, MICRO)
                    .scatter("y", "/hysteresis/*/*/mean", 1.0 / MICRO),
            )
            .with(
                Mark::points(role, Marker::Square, secants)
                    .named("peak secant")
                    .from("x", AMPLITUDE, MICRO)
                    .from("y", SECANT, 1.0 / MICRO),
            );
        force = force.with(Mark::line(role, packed.clone(), along.iter().map(|x| law.tip(x / MICRO)))).with(
            Mark::points(role, Marker::Square, tips).from("x", AMPLITUDE, MICRO).from_two(
                "y",
                SECANT,
                How::Times,
                AMPLITUDE,
                1.0,
            ),
        );
        words.push(in_words(one));
    }
    Some(
        Figure::new("backbone", "", "The contact against amplitude, where it slips", words.join(" "))
            .across(2)
            .with(stiffness)
            .with(force),
    )
}

fn rows<'a>(results: &'a Results, one: &Backbone) -> Vec<&'a Hysteresis> {
    let own = |row: &&Hysteresis| {
        row.force == Force::Raw && row.level.is_some_and(|level| one.levels.contains(&level))
    };
    results.hysteresis.iter().filter(own).collect()
}

/// Half the swing of T, N.
fn tip(row: &Hysteresis) -> Option<f64> {
    Some(row.k_secant_n_per_m? * row.amplitude_m?)
}

fn in_words(one: &Backbone) -> String {
    let law = &one.law;
    format!(
        "{} Hz{}: stuck {} N/µm, all slipping {} N, limits spread by ± {} %; the levels lie within {} % of the law of parallel sliders.",
        short(one.frequency_hz),
        one.moment.map_or(String::new(), |moment| format!(", {moment}")),
        decimals(micro(law.stiffness_n_per_m), 0),
        decimals(law.limit_n, 0),
        decimals(100.0 * law.spread, 0),
        decimals(100.0 * law.residual, 1),
    )
}
