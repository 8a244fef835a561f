//! The CMIF: singular values of what coupling changes, over frequency.

use super::super::drawing::{Anchor, Area, Drawing, Stroke};
use super::super::panel::{BLUE, Panel, SHADE};
use super::super::scale::Scale;
use super::WIDTH;
use crate::results::{MAIN_BAND, Results};

const AREA: Area = Area { left: 70.0, top: 34.0, width: WIDTH - 90.0, height: 260.0 };
/// Below this part of the largest value there is rounding.
const FLOOR: f64 = 1e-8;

/// The largest singular values; as many as modes were suggested are drawn stronger.
pub fn interface_modes(results: &Results) -> Option<String> {
    let modes = results.interface_modes.as_ref()?;
    let frequencies = [*modes.frequency_hz.first()?, *modes.frequency_hz.last()?];
    let values = || modes.singular_values_m_per_n.iter().flatten().copied();
    let high = values().fold(0.0, f64::max);
    let low = values().filter(|v| *v > FLOOR * high).fold(high, f64::min);
    if low >= high || frequencies[0] >= frequencies[1] || frequencies[0] <= 0.0 {
        return None;
    }
    let x = Scale::logarithmic(frequencies, [AREA.left, AREA.right()]);
    let y = Scale::logarithmic([low, high], [AREA.bottom(), AREA.top]);
    let panel = Panel { area: AREA, x, y };
    let (x_ticks, y_ticks) = (x.ticks(9), y.ticks(5));
    let mut drawing = Drawing::new("interface-modes", WIDTH, AREA.bottom() + 48.0);
    let title = format!("CMIF: {} modes suggested", modes.suggested);
    drawing.text([AREA.left, 18.0], Anchor::Start, "title", &title);
    panel.grid(&mut drawing, &x_ticks, &y_ticks);
    panel.shade(&mut drawing, MAIN_BAND.into(), SHADE, 0.12);
    for (i, curve) in modes.singular_values_m_per_n.iter().enumerate() {
        let stroke = if i < modes.suggested { Stroke::new(BLUE, 1.4) } else { Stroke::new("#999", 0.9) };
        panel.curve(&mut drawing, modes.frequency_hz.iter().copied().zip(curve.iter().copied()), stroke);
    }
    panel.axes(&mut drawing, (&x_ticks, Some("frequency in Hz")), (&y_ticks, Some("singular value in m/N")));
    Some(drawing.finish("Singular values of the motion that coupling adds"))
}
