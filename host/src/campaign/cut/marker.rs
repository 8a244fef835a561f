//! A marker channel: its level says which place is struck.
//!
//! `--marker ai7:0.5` means that the level of channel `ai7` is 0.5 times the number of the place in
//! the plan's order, from 1; a level of 0 means no place (test taps). The unit is that of the
//! recording: volts, parts of a WAV file's full scale, or SI. A switch, a source or a spare output
//! of the front end makes it, and it is changed between the hits.
//!
//! The level is the median around the hit, so that crosstalk of the pulse does not count. The user
//! is asked where it is not near a multiple of the step, or changes while the hammer strikes.

use std::str::FromStr;

use super::places::Named;
use super::recording::LongRecording;
use super::{CutError, CutHit, Place};
use crate::campaign::import::roles::same_name;
use crate::median::middle;

/// The level is taken this long before and after the hit's start, s.
const AROUND_S: f64 = 0.05;
/// A level belongs to a place if it deviates from its multiple of the step by at most this part of
/// the step.
const NEAR: f64 = 0.25;
/// Most of the samples around a hit must have the same place; the others may be crosstalk or the
/// edge of a change.
const STEADY: f64 = 0.8;

/// A marker channel as the user states it.
#[derive(Clone, Debug, PartialEq)]
pub struct Marker {
    /// The channel's name.
    channel: String,
    /// Difference of the levels of two consecutive places, in the recording's unit.
    step: f64,
}

impl FromStr for Marker {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || {
            format!(
                "`{text}`: write CHANNEL:STEP, e.g. ai7:0.5 if the channel has 0.5 V at the plan's first place, 1 V at the second"
            )
        };
        let (channel, step) = text.rsplit_once(':').ok_or_else(form)?;
        let step: f64 = step.trim().parse().map_err(|_| form())?;
        if channel.trim().is_empty() || !step.is_normal() {
            return Err(form());
        }
        Ok(Self { channel: channel.trim().into(), step })
    }
}

impl Marker {
    /// Whether it is the channel of this name.
    pub fn is(&self, name: &str) -> bool {
        same_name(&self.channel, name)
    }
}

/// What a marker says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Marked {
    /// Of each hit; `None` where it is not clear.
    pub named: Vec<Option<Named>>,
    /// Why it is not clear: the hit and the reason.
    pub doubts: Vec<(usize, String)>,
}

/// Reads the marker at every hit.
///
/// # Errors
/// The recording has no such channel, or cannot be read.
pub fn read(
    recording: &LongRecording,
    marker: &Marker,
    hits: &[CutHit],
    places: &[Place],
) -> Result<Marked, CutError> {
    let map = recording.map();
    let channel = map.channels.iter().position(|own| marker.is(own.name.as_str())).ok_or_else(|| {
        let names: Vec<&str> = map.channels.iter().map(|channel| channel.name.as_str()).collect();
        CutError::unfit(
            recording.name(),
            format!("there is no channel `{}` for the marker: it has {}", marker.channel, names.join(", ")),
        )
    })?;
    let around = (AROUND_S * map.fs_hz()).ceil() as u64;
    let mut marked = Marked::default();
    for (number, hit) in hits.iter().enumerate() {
        let start = hit.found.start;
        let levels = recording.si(channel, start.saturating_sub(around)..start + around)?;
        match place_at(&levels, marker.step, places) {
            Ok(named) => marked.named.push(Some(named)),
            Err(what) => {
                marked.named.push(None);
                marked.doubts.push((number, format!("hit {}: the marker {what}", number + 1)));
            }
        }
    }
    Ok(marked)
}

/// The place of these levels, or what is wrong with them.
fn place_at(levels: &[f64], step: f64, places: &[Place]) -> Result<Named, String> {
    let level = middle(levels).unwrap_or(0.0);
    let number = (level / step).round();
    let near = |own: &f64| (own / step - number).abs() <= NEAR;
    if !near(&level) {
        return Err(format!("stands at {level:.4}, which is no multiple of its step {step}"));
    }
    let steady = levels.iter().filter(|own| near(own)).count() as f64;
    if steady < STEADY * levels.len() as f64 {
        return Err("changes while the hammer strikes: change it between hits".into());
    }
    match number {
        0.0 => Ok(Named::Nowhere),
        n if n >= 1.0 && n <= places.len() as f64 => Ok(Named::Place(n as usize - 1)),
        n => Err(format!("says place {n}, and the plan has places 1 to {}", places.len())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::cut::{Only, places_of};
    use crate::campaign::plan::{CONTACT, Plan};

    #[test]
    fn a_level_is_the_places_number_times_the_step() {
        let plan = Plan::parse(CONTACT, "contact.toml").expect("a plan");
        let places = places_of(&plan, &Only::default()).expect("places");
        let at = |levels: &[f64]| place_at(levels, 0.5, &places);
        assert_eq!(at(&[1.5; 20]), Ok(Named::Place(2)));
        assert_eq!(at(&[0.04; 20]), Ok(Named::Nowhere));
        // crosstalk of the pulse in a fifth of the samples
        let mut levels = [1.01; 20];
        levels[8..12].fill(3.0);
        assert_eq!(at(&levels), Ok(Named::Place(1)));
        levels[12..14].fill(3.0);
        assert!(at(&levels).expect_err("it changes").contains("between hits"));
        assert!(at(&[1.2; 20]).expect_err("between two").contains("multiple"));
        assert!(at(&[-0.5; 20]).expect_err("negative").contains("place -1"));
        assert!(
            at(&[0.5 * (places.len() + 1) as f64; 20]).expect_err("too many").contains("has places 1 to")
        );
        let marker: Marker = "ai7: -0.5".parse().expect("a marker");
        assert!(marker.is("AI 7") && marker.step == -0.5);
        for text in ["ai7", "ai7:", ":0.5", "ai7:0", "ai7:NaN"] {
            assert!(text.parse::<Marker>().is_err(), "{text}");
        }
    }
}
