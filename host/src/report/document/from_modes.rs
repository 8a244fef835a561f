//! Converts modes to the format of the results.

use crate::analyse::FoundModes;
use crate::contact::Interval;
use crate::modes::{ChartPole, Mode, NoiseKnown, Scaling, phase_collinearity};
use crate::report::words::mode_sentences;
use crate::results::{ChartPoles, ModalFit, ModeRow, Moving, PoleOnly, SensorPlace, rounded};
use crate::substructuring::joint_over_bands::NORMAL_95;
use num_complex::Complex;

/// Digits of frequencies in the chart.
const CHART_DIGITS: i32 = 6;
/// Digits of a component of a shape; standard deviations have fewer.
const SHAPE_DIGITS: i32 = 7;
const STD_DIGITS: i32 = 3;

/// The modes of all structures by rising frequency, and how those of each were identified.
pub fn mode_rows(found: &[FoundModes]) -> (Vec<ModeRow>, Vec<ModalFit>) {
    let rows = found.iter().flat_map(|one| one.modes.modes.iter().map(|mode| row(one, mode)));
    let mut rows: Vec<ModeRow> = rows.collect();
    rows.sort_by(|a, b| a.frequency_hz.mean.total_cmp(&b.frequency_hz.mean));
    (rows, found.iter().map(fit).collect())
}

fn row(found: &FoundModes, mode: &Mode) -> ModeRow {
    let interval =
        |mean: f64, std: f64| Interval { mean, ci95: [mean - NORMAL_95 * std, mean + NORMAL_95 * std] };
    let size = |at: &usize| mode.shape[*at].norm_sqr();
    let largest = (0..mode.shape.len()).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0);
    ModeRow {
        structure: found.structure.map(|structure| structure.name().into()),
        frequency_hz: interval(mode.frequency_hz, mode.frequency_std_hz),
        damping_ratio: interval(mode.damping_ratio, mode.damping_ratio_std),
        pole_per_s: [mode.pole_per_s.re, mode.pole_per_s.im],
        scaling: scaling(mode.scaling),
        shape: moving(&found.modes.outputs, &mode.shape, &mode.shape_std),
        participation: moving(&found.modes.inputs, &mode.participation, &mode.participation_std),
        phase_collinearity: rounded(phase_collinearity(&mode.shape), CHART_DIGITS),
        largest: found.modes.outputs.get(largest).cloned().unwrap_or_default(),
        evidence: rounded(mode.evidence, CHART_DIGITS),
    }
}

/// The name of a scaling in files.
pub fn scaling(scaling: Scaling) -> &'static str {
    match scaling {
        Scaling::UnitModalA => "unit-modal-a",
        _ => "largest-output-is-one",
    }
}

fn moving(names: &[String], values: &[Complex<f64>], stds: &[[f64; 2]]) -> Vec<Moving> {
    let of = |((name, value), std): ((&String, &Complex<f64>), &[f64; 2])| Moving {
        name: name.clone(),
        re: rounded(value.re, SHAPE_DIGITS),
        im: rounded(value.im, SHAPE_DIGITS),
        std: std.map(|std| rounded(std, STD_DIGITS)),
    };
    names.iter().zip(values).zip(stds).map(of).collect()
}

fn fit(found: &FoundModes) -> ModalFit {
    let modes = &found.modes;
    let stable = |pole: &ChartPole| -> u8 {
        [pole.stable_in_frequency, pole.stable_in_damping, pole.stable_in_shape].map(u8::from).iter().sum()
    };
    let class = |class: u8| {
        let own = || modes.chart.poles.iter().filter(|pole| stable(pole) == class);
        ChartPoles {
            stable: class,
            order: own().map(|pole| pole.order).collect(),
            frequency_hz: own().map(|pole| rounded(pole.frequency_hz, CHART_DIGITS)).collect(),
        }
    };
    let chart = (0..4).map(class).filter(|class| !class.order.is_empty()).collect();
    let mut sensors: Vec<SensorPlace> = Vec::new();
    for point in &found.points {
        if let Some(position_m) = point.position_m
            && sensors.iter().all(|known| known.name != point.name)
        {
            sensors.push(SensorPlace { name: point.name.clone(), position_m });
        }
    }
    let pole = |mode: &Mode| PoleOnly {
        frequency_hz: rounded(mode.frequency_hz, CHART_DIGITS),
        damping_ratio: rounded(mode.damping_ratio, CHART_DIGITS),
    };
    ModalFit {
        structure: found.structure.map(|structure| structure.name().into()),
        band_hz: modes.band,
        outputs: found.points.clone(),
        inputs: modes.inputs.clone(),
        frf_error: found.frf_error,
        chi2_per_dof: (modes.noise == NoiseKnown::Given).then_some(modes.chi2_per_dof),
        degrees_of_freedom: modes.degrees_of_freedom,
        residual_powers: modes.residuals.iter().map(|term| term.power).collect(),
        background: modes.background.iter().map(pole).collect(),
        warnings: mode_sentences::warnings(found),
        sensors,
        chart,
    }
}
