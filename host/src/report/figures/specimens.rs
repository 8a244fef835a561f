//! FRFs at the contact: the two specimens, their difference, the force, and the arms (the paper's
//! Fig. 8).

use super::receptances::{along, placed, unbroken};
use crate::report::figure::{Axis, Figure, Height, Mark, Panel, Role, Shape, Spread};
use crate::report::scale::middle_range;
use crate::report::words::number::decimals;
use crate::results::{FrfCurve, HIDDEN_RESONANCE, Results, Role as Shows};

const SHOWN_HZ: [f64; 2] = [100.0, 400.0];

const MOTIONS: [(Shows, Role, &str); 5] = [
    (Shows::SpecimenA, Role::SpecimenA, "x_A"),
    (Shows::SpecimenB, Role::SpecimenB, "x_B"),
    (Shows::Relative, Role::Relative, "Δx"),
    (Shows::ArmA, Role::ArmA, "arm A"),
    (Shows::ArmB, Role::ArmB, "arm B"),
];

/// Magnitude and phase per hammer force, 100–400 Hz; T in a separate panel.
pub fn specimens(results: &Results) -> Option<Figure> {
    let of = |role| results.frfs.iter().enumerate().find(|(_, c)| c.role == role && c.configuration == "AJB");
    of(Shows::SpecimenA).zip(of(Shows::SpecimenB))?;
    let curves: Vec<(usize, &FrfCurve, Role, &str)> = MOTIONS
        .into_iter()
        .filter_map(|(shows, role, name)| of(shows).map(|(i, curve)| (i, curve, role, name)))
        .collect();
    let [low, high] = magnitudes(curves.iter().map(|(_, c, ..)| *c))?;
    let x = || Axis::frequency(Spread::Linear, SHOWN_HZ);
    let mut magnitude = Panel::new(x(), Axis::log("receptance", "m/N", [low, high])).high(Height::Tall);
    let mut phase = Panel::new(x(), degrees()).high(Height::Low).named_above();
    for (i, curve, role, name) in &curves {
        let line = Mark::line(
            *role,
            along(curve, curve.magnitude_m_per_n.len()),
            curve.magnitude_m_per_n.iter().copied(),
        )
        .named(if curve.output == *name { (*name).to_owned() } else { format!("{name} ({})", curve.output) })
        .from("y", format!("/frfs/{i}/magnitude_m_per_n/*"), 1.0);
        magnitude.marks.push(placed(line, *i));
        let line = placed(phase_line(curve, *i, *role), *i);
        phase.marks.push(line.named(magnitude.marks.last().map_or(String::new(), |m| m.name.clone())));
    }
    let resonance = results.check(HIDDEN_RESONANCE).and_then(|c| c.frequency_hz);
    if let Some((f, peak)) = resonance.and_then(|f| Some((f, at(of(Shows::SpecimenA)?.1, f)?))) {
        let text = format!("{} Hz", decimals(f, 0));
        magnitude.marks.push(Mark::new(Role::Guide, Shape::Ring { at: [f, peak], text }));
        phase.marks.push(Mark::new(Role::Guide, Shape::Upright { at: f }));
    }
    let mut figure = Figure::new(
        "specimens",
        "8",
        "FRFs at the contact",
        format!("Hit at {}. Both specimens, their difference Δx, and both arms in the assembly, from one impact. A peak or a step of phase that only one specimen has is a resonance on its own clamp; loops near it are ellipses.", curves[0].1.input),
    )
    .with(magnitude)
    .with(phase);
    if let Some((i, force)) = of(Shows::Force)
        && let Some([low, high]) = magnitudes([force].into_iter())
    {
        let line = Mark::line(
            Role::Force,
            along(force, force.magnitude_m_per_n.len()),
            force.magnitude_m_per_n.iter().copied(),
        )
        .named("T over the hammer's force")
        .from("y", format!("/frfs/{i}/magnitude_m_per_n/*"), 1.0);
        let line = placed(line, i);
        figure = figure.with(Panel::new(x(), Axis::log("T per newton", "N/N", [low, high])).with(line));
    }
    Some(figure)
}

fn degrees() -> Axis {
    Axis::linear("phase", "°", [-190.0, 190.0]).every(90.0)
}

fn phase_line(curve: &FrfCurve, index: usize, role: Role) -> Mark {
    Mark::line(role, along(curve, curve.phase_deg.len()), unbroken(&curve.phase_deg)).from(
        "y",
        format!("/frfs/{index}/phase_deg/*"),
        1.0,
    )
}

/// Range of the curves' magnitudes within the frequencies shown.
fn magnitudes<'a>(curves: impl Iterator<Item = &'a FrfCurve>) -> Option<[f64; 2]> {
    let inside = curves.flat_map(|c| {
        let lines = c.magnitude_m_per_n.iter().enumerate();
        lines
            .filter(|(l, m)| (SHOWN_HZ[0]..=SHOWN_HZ[1]).contains(&c.frequency_hz(*l)) && **m > 0.0)
            .map(|(_, m)| m.log10())
    });
    middle_range(inside, 1.0, 0.06).map(|range| range.map(|e| 10f64.powf(e)))
}

fn at(curve: &FrfCurve, frequency_hz: f64) -> Option<f64> {
    let line = ((frequency_hz - curve.first_hz) / curve.step_hz).round();
    curve.magnitude_m_per_n.get(line as usize).copied()
}
