//! Why a record is kept or refused, and by whom it is judged.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::plan::{Cell, Plan};
use crate::device::channels::ChannelMap;
use crate::device::recording::Recording;
use jointrig_protocol::channel::Role;

/// What a record is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Kind {
    /// Kept.
    #[serde(rename = "good")]
    Good,
    /// The hammer struck twice.
    #[serde(rename = "double hit")]
    DoubleHit,
    /// A channel left its range.
    #[serde(rename = "overload")]
    Overload,
    /// Noisier than the cell's other records.
    #[serde(rename = "noisy")]
    Noisy,
    /// Too little force, or no contact at all.
    #[serde(rename = "weak")]
    Weak,
    /// Too much force.
    #[serde(rename = "strong")]
    Strong,
    /// The pulse is not where it should be.
    #[serde(rename = "mistimed")]
    Mistimed,
    /// Samples are missing.
    #[serde(rename = "gap")]
    Gap,
}

impl Kind {
    /// Every kind, good first.
    pub const ALL: [Self; 8] = [
        Self::Good,
        Self::DoubleHit,
        Self::Overload,
        Self::Noisy,
        Self::Weak,
        Self::Strong,
        Self::Mistimed,
        Self::Gap,
    ];

    /// Its name in files and on screen.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::DoubleHit => "double hit",
            Self::Overload => "overload",
            Self::Noisy => "noisy",
            Self::Weak => "weak",
            Self::Strong => "strong",
            Self::Mistimed => "mistimed",
            Self::Gap => "gap",
        }
    }

    /// The kind of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A verdict with what it rests on.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// What the record is.
    pub kind: Kind,
    /// What was measured for it, in the unit that the sentence names.
    pub measure: f64,
    /// The limit that it was held against, same unit.
    pub limit: f64,
    /// Both in words.
    pub sentence: String,
}

/// Whoever judges records. It works on the raw record, before anything is derived from it.
pub trait Judge {
    /// Judges one record of `cell`; called once per record, in order of measurement.
    fn judge(&mut self, cell: &Cell, plan: &Plan, channels: &ChannelMap, recording: &Recording) -> Judgement;
}

/// Judges by the device's own summary of the shot and by the codes' range; needs no signal processing.
#[derive(Clone, Copy, Debug, Default)]
pub struct ByShotSummary;

impl Judge for ByShotSummary {
    fn judge(&mut self, _: &Cell, plan: &Plan, channels: &ChannelMap, recording: &Recording) -> Judgement {
        let (shot, limits) = (&recording.shot, &plan.limits);
        let missing: usize = recording.gaps.iter().map(ExactSizeIterator::len).sum();
        let judged = |kind, measure, limit, sentence| Judgement { kind, measure, limit, sentence };
        if missing > 0 {
            return judged(Kind::Gap, missing as f64, 0.0, format!("{missing} samples are missing"));
        }
        for place in 0..recording.channels {
            let extreme =
                recording.channel(place).iter().filter(|code| **code == i16::MAX || **code == i16::MIN);
            let touched = extreme.count();
            // one code at the end of the range may be chance, two are a flat top
            if touched > 1 {
                let name = channels.channels.get(place).map_or("?", |channel| channel.name.as_str());
                let sentence = format!("channel {name} stands at the end of its range for {touched} samples");
                return judged(Kind::Overload, touched as f64, 1.0, sentence);
            }
        }
        let (peak, rebound) = (f64::from(shot.peak_n), f64::from(shot.rebound_ratio));
        let after = f64::from(shot.rebound_after) / f64::from(channels.rate_hz.max(1));
        if channels.place(Role::HammerForce).is_none() || peak < limits.weak_n {
            judged(
                Kind::Weak,
                peak,
                limits.weak_n,
                format!("peak {peak:.1} N, at least {:.1} N wanted", limits.weak_n),
            )
        } else if peak > limits.strong_n {
            judged(
                Kind::Strong,
                peak,
                limits.strong_n,
                format!("peak {peak:.1} N, at most {:.1} N wanted", limits.strong_n),
            )
        } else if rebound >= limits.rebound_ratio && after >= limits.rebound_after_s {
            let sentence =
                format!("a second contact of {:.1} % after {:.1} ms", rebound * 100.0, after * 1e3);
            judged(Kind::DoubleHit, rebound, limits.rebound_ratio, sentence)
        } else {
            judged(Kind::Good, peak, plan.force.get_ref().target_n, format!("peak {peak:.1} N"))
        }
    }
}
