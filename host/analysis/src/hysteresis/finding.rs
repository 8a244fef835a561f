//! What a loop shows that a reader must know before using its numbers: each with its measure.

use serde::Serialize;

/// Something that is wrong with a loop, or was put right.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "finding")]
#[non_exhaustive]
pub enum LoopFinding {
    /// The force falls while the contact is pushed, and the loop gives energy: the force's sign is wrong, or A and B are swapped. No
    /// k_T is given.
    ReversedForce {
        /// Least-squares slope over the whole loop, N/m.
        k_eq_n_per_m: f64,
        /// Loop area per cycle, J.
        energy_j: f64,
    },
    /// The force comes later than the motion (earlier, if negative).
    LateForce {
        /// By so much, s.
        by_s: f64,
        /// Standard deviation, s.
        std_s: f64,
        /// A loop without a plateau shows only by how much it is late at least: its own damping hides the rest.
        at_least: bool,
        /// Stiffness, friction and energy are those of the loop with the delay taken out. If neither this nor `at_least` is true,
        /// the loop looks out of step, but no delay makes a friction loop of it, or damping explains it as well: no k_T and no μN
        /// are given.
        corrected: bool,
    },
    /// Play (backlash): after each reversal the contact moves by so much without the force changing.
    Play {
        /// Size of the play, m.
        size_m: f64,
        /// Half the difference of the sizes on both strokes, m.
        std_m: f64,
    },
    /// Cycles whose amplitude or force is not that of the others were left out at the beginning and the end of the record.
    Unsteady {
        /// Cycles left out at the beginning.
        left_out_first: usize,
        /// Cycles left out at the end.
        left_out_last: usize,
        /// Cycles used.
        used: usize,
        /// Amplitude of Δx at the fundamental in the cycles used, m.
        amplitude_m: f64,
        /// The same in the cycle left out that differs most, m.
        left_out_amplitude_m: f64,
    },
    /// A force that goes with the velocity acts beside the friction. It is taken out of k_T and μN.
    Viscous {
        /// The dashpot, N s/m.
        viscous_n_s_per_m: f64,
        /// Standard deviation, N s/m.
        std_n_s_per_m: f64,
        /// Its largest force, N.
        force_n: f64,
    },
    /// The mains' hum lies at the loop's own frequency, where no average takes it out.
    Hum {
        /// 50 or 60, Hz.
        mains_hz: f64,
        /// The multiple of it that the loop's frequency falls on, Hz.
        at_hz: f64,
        /// The strongest other multiple over the fundamental of the same signal: the slope may be wrong by as much.
        part: f64,
    },
    /// The plateau's force goes with the place: the normal load varies while the contact slides. μN is that at the middle.
    UnevenLoad {
        /// Change of the friction limit from the middle to the end of the stroke, over that at the middle.
        change: f64,
        /// Its standard deviation.
        std: f64,
    },
    /// The excitation is not at the stated frequency, or drifts. The cycles were cut at the frequency found.
    FrequencyOff {
        /// As stated, Hz; none where it was read off the record.
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
