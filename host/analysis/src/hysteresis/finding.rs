//! Findings on a loop that a reader must know before using its numbers, each with its magnitude.

use serde::Serialize;

/// A fault of a loop, or a correction that was made.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "finding")]
#[non_exhaustive]
pub enum LoopFinding {
    /// The force falls while the contact is pushed, and the loop dissipates no energy: the sign of
    /// the force is wrong, or A and B are swapped. No k_T is reported.
    ReversedForce {
        /// Least-squares slope over the whole loop, N/m.
        k_eq_n_per_m: f64,
        /// Loop area per cycle, J.
        energy_j: f64,
    },
    /// The force lags the motion (leads it, if negative).
    LateForce {
        /// Delay, s.
        by_s: f64,
        /// Standard deviation, s.
        std_s: f64,
        /// In a loop without a plateau only a lower bound of the delay can be found: the contact's
        /// own damping hides the rest.
        at_least: bool,
        /// Stiffness, friction and energy are those of the loop with the delay removed. If both
        /// this and `at_least` are false, the force looks shifted in time, but no delay makes it a
        /// friction loop, or damping explains it as well: neither k_T nor μN is reported.
        corrected: bool,
    },
    /// Play (backlash): after each reversal the contact moves by this distance while the force
    /// stays constant.
    Play {
        /// Size of the play, m.
        size_m: f64,
        /// Half the difference between the sizes on both strokes, m.
        std_m: f64,
    },
    /// Cycles at the beginning and the end of the record whose amplitude or force differs from that
    /// of the others were left out.
    Unsteady {
        /// Cycles left out at the beginning.
        left_out_first: usize,
        /// Cycles left out at the end.
        left_out_last: usize,
        /// Cycles used.
        used: usize,
        /// Amplitude of Δx at the fundamental in the cycles used, m.
        amplitude_m: f64,
        /// Amplitude in the left-out cycle that differs most, m.
        left_out_amplitude_m: f64,
    },
    /// A force proportional to velocity acts in addition to the friction. It is removed from k_T
    /// and μN.
    Viscous {
        /// Viscous damping coefficient, N s/m.
        viscous_n_s_per_m: f64,
        /// Standard deviation, N s/m.
        std_n_s_per_m: f64,
        /// Its largest force, N.
        force_n: f64,
    },
    /// Mains hum lies at the loop's own frequency, where averaging does not remove it.
    Hum {
        /// 50 or 60, Hz.
        mains_hz: f64,
        /// The multiple of it that coincides with the loop's frequency, Hz.
        at_hz: f64,
        /// The strongest other multiple over the fundamental of the same signal; the error of the
        /// slope may be as large.
        part: f64,
    },
    /// The plateau's force depends on position: the normal load varies while the contact slides. μN
    /// is that at the middle.
    UnevenLoad {
        /// Change of the friction limit from the middle to the end of the stroke, over that at the
        /// middle.
        change: f64,
        /// Its standard deviation.
        std: f64,
    },
    /// The excitation is not at the stated frequency, or drifts. The cycles were cut at the
    /// frequency found.
    FrequencyOff {
        /// As stated, Hz; `None` if it was found from the record.
        #[serde(skip_serializing_if = "Option::is_none")]
        stated_hz: Option<f64>,
        /// At the record's beginning, Hz.
        from_hz: f64,
        /// At its end, Hz.
        to_hz: f64,
    },
}

impl LoopFinding {
    /// Its name in `results.json`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::ReversedForce { .. } => "reversed-force",
            Self::LateForce { .. } => "late-force",
            Self::Play { .. } => "play",
            Self::Unsteady { .. } => "unsteady",
            Self::Viscous { .. } => "viscous",
            Self::Hum { .. } => "hum",
            Self::UnevenLoad { .. } => "uneven-load",
            Self::FrequencyOff { .. } => "frequency-off",
        }
    }
}
