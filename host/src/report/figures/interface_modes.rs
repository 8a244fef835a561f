//! The CMIF: singular values of the change caused by coupling, over frequency (the paper's Fig.
//! B.15).

use crate::report::figure::{Along, Axis, Figure, Height, Mark, Panel, Role, Spread};
use crate::results::{MAIN_BAND, Results};

/// Values below this fraction of the largest one are rounding errors.
const FLOOR: f64 = 1e-8;

/// The largest singular values; the suggested number of modes is drawn with thicker lines.
pub fn interface_modes(results: &Results) -> Option<Figure> {
    let modes = results.interface_modes.as_ref()?;
    let frequencies = [*modes.frequency_hz.first()?, *modes.frequency_hz.last()?];
    let values = || modes.singular_values_m_per_n.iter().flatten().copied();
    let high = values().fold(0.0, f64::max);
    let low = values().filter(|v| *v > FLOOR * high).fold(high, f64::min);
    if low >= high || frequencies[0] >= frequencies[1] || frequencies[0] <= 0.0 {
        return None;
    }
    let along = Along::of(&modes.frequency_hz);
    let lines = modes.singular_values_m_per_n.iter().enumerate().map(|(i, curve)| {
        let strong = i < modes.suggested;
        Mark::line(if strong { Role::Group1 } else { Role::Noise }, along.clone(), curve.iter().copied())
            .named(if strong { format!("{} suggested", modes.suggested) } else { "the rest".into() })
            .from("y", format!("/interface_modes/singular_values_m_per_n/{i}/*"), 1.0)
            .from("x", "/interface_modes/frequency_hz/*", 1.0)
    });
    let panel = Panel::new(
        Axis::frequency(Spread::Log, frequencies),
        Axis::log("singular value", "m/N", [low, 1.3 * high]),
    );
    Some(
        Figure::new(
            "interface-modes",
            "B.15",
            format!("What coupling adds: {} modes suggested", modes.suggested),
            "Singular values of Y(AJB) − Y(A) − Y(B), the CMIF. As many motions couple the parts as curves stand clear of the rest.",
        )
        .with(panel.high(Height::Tall).with(Mark::shade(Role::Band, MAIN_BAND)).with_all(lines)),
    )
}
