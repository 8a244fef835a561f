//! Frequency ranges in which the hammer's force was sufficient.

use super::below_name;
use crate::report::figure::{Axis, Figure, Height, Mark, Marker, Panel, Role, Spread};
use crate::report::words::number::short;
use crate::results::{MAIN_BAND, Results};

/// A bar for each configuration.
pub fn usable_bands(results: &Results) -> Option<Figure> {
    let bands = &results.usable_bands;
    let low = bands.iter().map(|b| b.band_hz.low_hz).filter(|f| *f > 0.0).reduce(f64::min)?;
    let high = bands.iter().map(|b| b.band_hz.high_hz).fold(low, f64::max);
    let names = bands
        .iter()
        .map(|b| {
            format!("{}: {} to {} Hz", b.configuration, short(b.band_hz.low_hz), short(b.band_hz.high_hz))
        })
        .collect();
    let mut panel =
        Panel::new(Axis::frequency(Spread::Log, [0.8 * low, 1.25 * high]), Axis::named("", names))
            .high(Height::Rows)
            .with(Mark::shade(Role::Band, MAIN_BAND).named("main band"));
    for (i, band) in bands.iter().enumerate() {
        let (from, to) = (band.band_hz.low_hz.max(low), band.band_hz.high_hz);
        panel.marks.push(
            Mark::points(Role::Group1, Marker::Stroke, [[from, below_name(i)], [to, below_name(i)]])
                .barred("x", [[from, to], [from, to]])
                .from("x", "/usable_bands/*/band_hz/*", 1.0),
        );
    }
    Some(
        Figure::new(
            "usable-bands",
            "",
            "The usable band",
            "Where the auto-spectrum of the hammer's force is within 6 dB of its level at low frequency.",
        )
        .across(2)
        .with(panel),
    )
}
