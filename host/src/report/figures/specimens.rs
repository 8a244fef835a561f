//! The two specimens' own vibrometers in the assembly: where one of them leaves the common motion.

use super::super::drawing::{Anchor, Area, Drawing, Stroke};
use super::super::panel::{BLUE, Panel, SHADE, VERMILION, legend};
use super::super::scale::{Scale, middle_range};
use super::WIDTH;
use super::receptances::unbroken;
use crate::report::words::number::decimals;
use crate::results::{FrfCurve, HIDDEN_RESONANCE, Results, Role};

const SHOWN_HZ: [f64; 2] = [100.0, 400.0];

/// Magnitude and phase of x_A and x_B over the hammer's force, 100–400 Hz, with a point of each arm where there is one.
pub fn specimens(results: &Results) -> Option<String> {
    let of = |role| results.frfs.iter().find(|c| c.role == role && c.configuration == "AJB");
    let mut curves = vec![
        (of(Role::SpecimenA)?, Stroke::new(VERMILION, 1.2), "specimen A"),
        (of(Role::SpecimenB)?, Stroke::new(BLUE, 1.2), "specimen B"),
    ];
    let arms = [
        (of(Role::ArmA), Stroke::new(VERMILION, 1.0).dashed("6 3"), "arm A"),
        (of(Role::ArmB), Stroke::new(BLUE, 1.0).dashed("6 3"), "arm B"),
    ];
    curves.extend(arms.into_iter().filter_map(|(curve, stroke, name)| Some((curve?, stroke, name))));
    let resonance = results.check(HIDDEN_RESONANCE).and_then(|c| c.frequency_hz);
    let inside = |c: &FrfCurve, values: &[f64]| -> Vec<(f64, f64)> {
        let lines = values.iter().enumerate().map(|(l, v)| (c.frequency_hz(l), *v));
        lines.filter(|(f, _)| *f >= SHOWN_HZ[0] && *f <= SHOWN_HZ[1]).collect()
    };
    let levels = curves.iter().flat_map(|(c, ..)| inside(c, &c.magnitude_m_per_n)).map(|(_, m)| m.log10());
    let [low, high] = middle_range(levels, 1.0, 0.06)?;
    let mut drawing = Drawing::new("specimens", WIDTH, 400.0);
    let entries: Vec<_> =
        curves.iter().map(|(c, s, name)| (*s, format!("{name} ({} from {})", c.output, c.input))).collect();
    legend(&mut drawing, [70.0, 16.0], &entries);
    for (top, height, phase) in [(28.0, 190.0, false), (232.0, 120.0, true)] {
        let area = Area { left: 70.0, top, width: WIDTH - 70.0 - 12.0, height };
        let pixels = [area.bottom(), area.top];
        let panel = Panel {
            area,
            x: Scale::linear(SHOWN_HZ, [area.left, area.right()]),
            y: if phase {
                Scale::linear([-190.0, 190.0], pixels)
            } else {
                Scale::logarithmic([10f64.powf(low), 10f64.powf(high)], pixels)
            },
        };
        let x_ticks = panel.x.ticks(8);
        let y_ticks = if phase { panel.y.ticks_every(90.0) } else { panel.y.ticks(5) };
        panel.grid(&mut drawing, &x_ticks, &y_ticks);
        if let Some(f) = resonance {
            panel.shade(&mut drawing, [f - 2.0, f + 2.0], SHADE, 0.45);
            if !phase {
                let text = format!("{} Hz", decimals(f, 0));
                drawing.text([panel.x.place_within(f - 3.0), area.top + 15.0], Anchor::End, "legend", &text);
            }
        }
        for (curve, stroke, _) in &curves {
            let values = if phase { &curve.phase_deg } else { &curve.magnitude_m_per_n };
            let points = inside(curve, values);
            let points = if phase { unbroken(&points) } else { points };
            panel.curve(&mut drawing, points.into_iter(), *stroke);
        }
        let label = if phase { "phase in °" } else { "receptance in m/N" };
        panel.axes(&mut drawing, (&x_ticks, phase.then_some("frequency in Hz")), (&y_ticks, Some(label)));
    }
    Some(drawing.finish("Receptance of the two specimens in the assembly"))
}
