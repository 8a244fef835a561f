//! An FRF compared with its own noise, and the resulting dynamic stiffness (the paper's Fig. C.16).

use super::MICRO;
use crate::report::figure::{Along, Axis, Figure, Mark, Panel, Role, Spread};
use crate::report::scale::middle_range;
use crate::results::Results;

/// Receptance and noise, and the inverse of the receptance.
pub fn noise_floor(results: &Results) -> Option<Figure> {
    let one = results.noise_floor.as_ref()?;
    let count = one.magnitude_m_per_n.len();
    let along = Along::Regular { first: one.first_hz, step: one.step_hz, count };
    let frequencies = [one.first_hz, one.first_hz + one.step_hz * count.saturating_sub(1) as f64];
    let logarithmic = |values: &mut dyn Iterator<Item = f64>| -> Option<[f64; 2]> {
        let range = middle_range(values.filter(|v| *v > 0.0).map(f64::log10), 1.0, 0.05)?;
        Some(range.map(|e| 10f64.powf(e)))
    };
    let receptance = logarithmic(&mut one.magnitude_m_per_n.iter().chain(&one.noise_m_per_n).copied())?;
    let stiffness = logarithmic(&mut one.dynamic_stiffness_n_per_m.iter().map(|k| k / MICRO))?;
    let x = || Axis::frequency(Spread::Log, frequencies);
    let line = |role, values: &[f64], field: &str, factor: f64| {
        Mark::line(role, along.clone(), values.iter().map(|v| v * factor))
            .from("y", format!("/noise_floor/{field}/*"), factor)
            .from("first", "/noise_floor/first_hz", 1.0)
            .from("step", "/noise_floor/step_hz", 1.0)
    };
    Some(
        Figure::new(
            "noise-floor",
            "C.16",
            "Noise floor and dynamic stiffness",
            format!(
                "{}: {} from {}. Where the receptance comes near its noise, what is computed from it is noise too; the dynamic stiffness is its inverse.",
                one.configuration, one.output, one.input
            ),
        )
        .across(2)
        .with(
            Panel::new(x(), Axis::log("receptance", "m/N", receptance))
                .with(line(Role::Measured, &one.magnitude_m_per_n, "magnitude_m_per_n", 1.0).named("receptance"))
                .with(line(Role::Noise, &one.noise_m_per_n, "noise_m_per_n", 1.0).named("its noise, σ")),
        )
        .with(
            Panel::new(x(), Axis::log("dynamic stiffness", "N/µm", stiffness))
                .with(line(Role::Measured, &one.dynamic_stiffness_n_per_m, "dynamic_stiffness_n_per_m", 1.0 / MICRO)),
        ),
    )
}
