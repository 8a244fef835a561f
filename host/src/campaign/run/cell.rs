//! Measures one cell: from the hammer in place until it has enough good hits or is given up with a
//! reason.
//!
//! Instructions for the person at the rig: where hammer and laser go for a cell, and how much is
//! left to do.
//!
//! How quiet the structure must be before the next hit, relative to its motion after the last one.

use super::answers::Question;
use super::by_hand;
use super::error::RunError;
use super::runner::{Next, Runner, still};
use super::shot::{Outcome, QuietLimits};
use super::stage::{Moved, Stage, Who};
use crate::campaign::plan::{Cell, Settle, configuration_name};
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::codec;
use crate::campaign::verdict::others::Others;
use crate::campaign::verdict::{Judgement, Verdict};
use crate::campaign::watch::{Left, Seen, Standing};
use crate::device::channels::ChannelMap;
use crate::device::samples::Samples;
use crate::device::stream::Recording;
use jointrig_protocol::channel::Quantity;
use jointrig_protocol::request::Configuration;
use jointrig_protocol::shot::Shot;
use std::collections::VecDeque;
use std::f64::consts::PI;

/// Shots of one cell that may be cancelled or find no quiet before the cell is given up.
const SETBACKS: u32 = 4;

impl Runner<'_> {
    /// Measures one cell until it has enough good hits or is given up with a reason.
    pub(super) fn cell(&mut self, row: &CellRow) -> Result<Next, RunError> {
        let responses = self.responses(row);
        let (mut others, mut again) = if self.visit.is_some() {
            still(self.keeper.catch_up())?;
            let others = self.earlier.others_now(row.id, &responses, self.plan, self.channels)?;
            (others, VecDeque::new())
        } else {
            self.earlier.of(row.id, &responses, self.plan, self.channels)?
        };
        // manual hits cannot be repeated
        if self.stage != Stage::Device || self.plan.by_hand().is_some() {
            again.clear();
        }
        let attempt = if again.is_empty() { self.tally.attempts(row.id) } else { 0 };
        match self.go(row, attempt)? {
            Moved::InPlace(_) => {}
            Moved::Skip => return Ok(Next::On),
            Moved::Back => return Ok(Next::Back),
            Moved::Redo => {
                self.tally.redo(row.id);
                self.earlier.forget(row.id);
                still(self.keeper.redo(row.id, "hit again, as requested at the prompt"))?;
                return self.cell(row);
            }
        }
        let mut quiet = unknown(self.channels);
        let mut setbacks = 0;
        while (self.tally.open(row.id) || !again.is_empty()) && !self.stopped() {
            if self.recount(Some(row.id)) {
                // a person overruled one of this cell's hits: recompute the statistics of the good
                // ones
                still(self.keeper.catch_up())?;
                others = self.earlier.others_now(row.id, &responses, self.plan, self.channels)?;
            }
            if again.is_empty() && !self.tally.open(row.id) {
                break;
            }
            if again.is_empty() && self.ended(row, &others)? {
                break;
            }
            let known = again.front().map(|known| (known.id, known.crc, known.shot.pulse_us));
            let pulse_us = known.map_or_else(
                || self.forces.pulse_us(self.tally.kept_in(row.id) + self.cells_before(row)),
                |(_, _, pulse_us)| pulse_us,
            );
            self.mark()?;
            let by_hand = self.plan.by_hand();
            let most_s = by_hand.unwrap_or(self.plan.settle.get_ref().bound_s);
            let standing = self.standing(row);
            self.saw(&Seen::Settling { row, standing, most_s, by_hand: by_hand.is_some() });
            let (stop, watch) = (&self.options.stop, &self.options.watch);
            let outcome = match by_hand {
                Some(patience_s) => {
                    let channels = self.channels;
                    self.shooter.await_hand(self.session, channels, patience_s, &quiet, stop, watch)?
                }
                None => self.shooter.shoot(self.session, pulse_us, &quiet, stop, watch)?,
            };
            if let (Some((record, stored, _)), Some(crc)) = (known, crc_of(&outcome)) {
                again.pop_front();
                if crc == stored {
                    setbacks = 0;
                    if let Outcome::Recorded(recording) = &outcome {
                        quiet = after(recording, self.channels, self.plan.settle.get_ref(), 1.0);
                    }
                } else {
                    self.differs(row, record)?;
                    again.clear();
                    quiet = unknown(self.channels);
                    let attempt = self.tally.attempts(row.id);
                    self.go(row, attempt)?;
                }
                continue;
            }
            match outcome {
                Outcome::Recorded(recording) => {
                    setbacks = 0;
                    let allowance = if by_hand.is_some() { by_hand::ALLOWANCE } else { 1.0 };
                    quiet = after(&recording, self.channels, self.plan.settle.get_ref(), allowance);
                    self.saw(&Seen::Judging);
                    let verdict = self.judge.judge(&row.cell, self.plan, self.channels, &recording, &others);
                    if verdict.kind == Verdict::Good {
                        others.learn(self.plan, self.channels, &recording.samples);
                    }
                    self.keep(row, *recording, verdict)?;
                }
                Outcome::TooEarly { recording, place, ratio } => {
                    let name = &self.channels.channels[place].name;
                    let sentence = format!(
                        "{}: {name} still moved {ratio:.1} times the allowed amount",
                        by_hand::TOO_EARLY
                    );
                    let judged = self.judge.judge(&row.cell, self.plan, self.channels, &recording, &others);
                    let verdict =
                        Judgement { kind: Verdict::Noisy, measure: ratio, limit: 1.0, sentence, ..judged };
                    quiet = after(&recording, self.channels, self.plan.settle.get_ref(), by_hand::ALLOWANCE);
                    self.keep(row, *recording, verdict)?;
                }
                Outcome::NobodyStruck => {
                    // a timeout leaves the cell unchanged
                    return Err(RunError::NobodyStruck { cell: name(&row.cell), seconds: most_s });
                }
                Outcome::Missed { shot, lost } => {
                    let limit = self.plan.limits.get_ref().weak_n;
                    let sentence = format!("the bolt did not arrive with a pulse of {pulse_us} us");
                    let verdict = if lost == 0 {
                        Judgement::without_pulse(Verdict::Weak, 0.0, limit, sentence)
                    } else {
                        let sentence = format!("{sentence}, and {lost} scans were lost meanwhile");
                        Judgement::without_pulse(Verdict::Gap, lost as f64, 0.0, sentence)
                    };
                    let recording = Recording {
                        epoch: 0,
                        first_scan: shot.fired_at,
                        trigger_index: 0,
                        samples: Samples::of_codes(&[], self.channels.len()),
                        gaps: Vec::new(),
                        shot: Shot { peak_n: 0.0, ..shot },
                    };
                    self.keep(row, recording, verdict)?;
                }
                Outcome::NotQuiet(shot) => {
                    setbacks += 1;
                    let reason = format!("not quiet within {} s", self.plan.settle.get_ref().bound_s);
                    if !self.set_back(row, setbacks, &format!("{reason} (ratio {:.1})", shot.quiet_ratio))? {
                        self.give_up(row, &reason)?;
                        break;
                    }
                    loosen(&mut quiet);
                }
                Outcome::Cancelled(_) => {
                    setbacks += 1;
                    let why = "the device cancelled the shot";
                    self.check_safe()?;
                    if !self.set_back(row, setbacks, why)? {
                        self.give_up(row, why)?;
                        break;
                    }
                }
                Outcome::Interrupted => {}
            }
        }
        Ok(Next::On)
    }

    /// Indices of the channels that measure when this cell is struck: its own, and those of the
    /// cells that the same hits fill.
    fn responses(&self, row: &CellRow) -> Vec<usize> {
        let measured = std::iter::once(row).chain(self.filled.get(&row.id).into_iter().flatten());
        measured
            .filter_map(|row| self.plan.response_places(&row.cell.response, self.channels))
            .flatten()
            .collect()
    }

    /// Ends a cell if its attempts have run out or its FRFs are good enough; returns whether it
    /// did.
    fn ended(&mut self, row: &CellRow, others: &Others) -> Result<bool, RunError> {
        let hits = self.plan.hits.get_ref();
        let (kept, attempts) = (self.tally.kept_in(row.id), self.tally.attempts(row.id));
        if let Some(before) = self.visit {
            // a cell that further hits are chosen for keeps what it has, whatever this visit gives
            return Ok(attempts >= before + hits.most.max(row.cell.wanted));
        }
        let enough = self.plan.enough.as_ref().map(toml::Spanned::get_ref).filter(|_| kept >= hits.minimum);
        let reason = if attempts >= hits.most {
            format!("{kept} of {} good after {attempts} hits", row.cell.wanted)
        } else if let Some(enough) = enough
            && let Some(error) = others.random_error(enough).filter(|error| *error <= enough.random_error)
        {
            format!(
                "{kept} good hits give the FRFs to {:.2} % (enough: {:.2} %)",
                100.0 * error,
                100.0 * enough.random_error
            )
        } else {
            return Ok(false);
        };
        if kept >= hits.minimum && kept > 0 {
            self.tally.settle(row.id);
            self.saw(&Seen::Remark(&format!("{}: settled: {reason}", name(&row.cell))));
            still(self.keeper.settle(row.id, &reason))?;
        } else {
            self.give_up(row, &format!("{reason}, at least {} needed", hits.minimum))?;
        }
        Ok(true)
    }

    /// Moves hammer and laser to a cell. The acknowledgement is held meanwhile, so that the first
    /// shot is at a fixed distance from the scan at which they are in place.
    fn go(&mut self, row: &CellRow, attempt: u32) -> Result<Moved, RunError> {
        let by_hand = !matches!(self.stage, Stage::Device | Stage::Auto);
        let (standing, left) = (self.standing(row), self.left(row));
        self.saw(&Seen::Moving { row, standing, by_hand, left });
        let what = self.directions(row);
        let question = Question { cell: row.id, attempt };
        let elsewhere = self.options.answers.as_ref().map(|answers| (answers, question));
        let who = Who { yes: self.options.yes, elsewhere };
        let moved = self.stage.go(self.session, &row.cell, attempt, &what, &who);
        self.saw(&Seen::Moved);
        let moved = moved?;
        if let Moved::InPlace(at_scan) = moved {
            self.shooter.staged(at_scan);
        }
        Ok(moved)
    }

    /// Handles a device that did not reproduce a stored record: it is another rig, or has another
    /// seed.
    fn differs(&mut self, row: &CellRow, record: i64) -> Result<(), RunError> {
        let text = format!(
            "{}: record {record}, measured again, came out differently: this is another rig or another seed than it was measured \
             with; continuing with this one",
            name(&row.cell)
        );
        self.saw(&Seen::Remark(&text));
        still(self.keeper.log(text))
    }

    fn give_up(&mut self, row: &CellRow, reason: &str) -> Result<(), RunError> {
        if self.visit.is_some() {
            // its good hits stay in use
            self.excluded.insert(row.id);
            let text = format!("{}: no further hits in this run: {reason}", name(&row.cell));
            self.saw(&Seen::Remark(&text));
            return still(self.keeper.log(text));
        }
        self.tally.give_up(row.id);
        self.saw(&Seen::Remark(&format!("{}: given up: {reason}", name(&row.cell))));
        still(self.keeper.give_up(row.id, reason))
    }

    /// Logs a setback; returns whether to try again.
    fn set_back(&self, row: &CellRow, setbacks: u32, why: &str) -> Result<bool, RunError> {
        self.saw(&Seen::Remark(&format!("{}: {why}", name(&row.cell))));
        still(self.keeper.log(format!("{}: {why}", name(&row.cell))))?;
        Ok(setbacks < SETBACKS)
    }

    /// Ends the run if the rig must not be struck: giving up every remaining cell would be useless.
    fn check_safe(&mut self) -> Result<(), RunError> {
        let status = self.session.status()?;
        if status.emergency_stop {
            Err(RunError::Unsafe("the emergency stop is latched: release and reset it at the rig"))
        } else if !status.interlock_closed {
            Err(RunError::Unsafe("the interlock is open: close the guard"))
        } else {
            Ok(())
        }
    }
}

/// The checksum of a shot's samples, if it was fired: a missed shot has no samples.
fn crc_of(outcome: &Outcome) -> Option<u32> {
    match outcome {
        Outcome::Recorded(recording) => Some(codec::checksum(&recording.samples)),
        Outcome::Missed { .. } => Some(codec::checksum(&Samples::default())),
        _ => None,
    }
}

fn loosen(quiet: &mut QuietLimits) {
    for limit in quiet {
        *limit *= 2.0;
    }
}

impl Runner<'_> {
    /// Text shown to a person before a cell: where hammer and laser go, and the cell's progress.
    pub(super) fn directions(&self, row: &CellRow) -> String {
        let millimetres =
            |at: [f64; 3]| format!("x {:.1}, y {:.1}, z {:.1} mm", 1e3 * at[0], 1e3 * at[1], 1e3 * at[2]);
        let (cell, geometry) = (&row.cell, &self.plan.geometry);
        let impact =
            geometry.impact.iter().map(toml::Spanned::get_ref).find(|point| point.name == cell.impact);
        let response =
            geometry.response.iter().map(toml::Spanned::get_ref).find(|point| point.name == cell.response);
        let hammer = impact.map_or(String::new(), |point| {
            let [x, y, z] = point.direction;
            format!(" ({}; pushing along {x} {y} {z})", millimetres(point.position_m))
        });
        let laser = response.map_or(String::new(), |point| {
            let all = point.lasers && configuration_name(cell.configuration) == "B";
            let others = if all { "; LDV_A and LDV_B too" } else { "" };
            format!(" ({}{others})", millimetres(point.position_m))
        });
        let joint = if self.plan.opens_joint(cell) {
            "\n  the joint open: both sides in place, nothing touches"
        } else if cell.configuration == Configuration::Ajb
            && self.cells.iter().any(|other| self.plan.opens_joint(&other.cell))
        {
            "\n  the joint closed"
        } else {
            ""
        };
        let place = 1 + self.cells.iter().position(|other| other.id == row.id).unwrap_or(0);
        format!(
            "cell {place} of {}, structure {}: {} of {} good{joint}\n  hammer to {}{hammer}\n  laser to {}{laser}",
            self.cells.len(),
            configuration_name(cell.configuration),
            self.tally.kept_in(row.id),
            cell.wanted,
            cell.impact,
            cell.response,
        )
    }

    /// The number of cells with the same impact that are struck before this one. Every second of
    /// them begins with the softer force, because a hit acts on what is left of the last one's
    /// motion: if the softer hit were always the second, that would look as if the response changed
    /// with the force.
    fn cells_before(&self, row: &CellRow) -> u32 {
        let same = |other: &&CellRow| {
            other.cell.configuration == row.cell.configuration
                && other.cell.impact == row.cell.impact
                && self.plan.own_channels(&other.cell.response).is_none()
        };
        self.cells.iter().take_while(|other| other.id != row.id).filter(same).count() as u32
    }

    /// A cell's progress.
    pub(super) fn standing(&self, row: &CellRow) -> Standing {
        Standing { kept: self.tally.kept_in(row.id), attempts: self.tally.attempts(row.id) }
    }

    /// Good hits still wanted in this cell, in this structure, and in total.
    pub(super) fn left(&self, row: &CellRow) -> Left {
        let mut left = Left::default();
        for other in self.cells.iter().filter(|other| self.tally.open(other.id)) {
            let wanted = self.tally.wanted_in(other.id);
            let missing = u64::from(wanted.saturating_sub(self.tally.kept_in(other.id)));
            left.campaign += missing;
            left.configuration +=
                if other.cell.configuration == row.cell.configuration { missing } else { 0 };
            left.cell += if other.id == row.id { missing } else { 0 };
        }
        left
    }
}

/// A cell's name in a line of the log.
pub(super) fn name(cell: &Cell) -> String {
    format!("{} {}, {}", configuration_name(cell.configuration), cell.impact, cell.response)
}

/// Start of the window in which the motion right after a hit is evaluated (s after the trigger),
/// when the pulse is over …
const FROM_S: f64 = 0.002;
/// … and its length, s: `PERIODS` periods of the slowest mode of interest.
const FOR_S: f64 = 0.075;
const PERIODS: f64 = 2.0;

/// Limits for the first hit of a cell: without an earlier hit, any motion is allowed.
pub fn unknown(channels: &ChannelMap) -> QuietLimits {
    vec![0.0; channels.len()]
}

/// Limits after `recording`: for each velocity or acceleration channel a fraction of its rms right
/// after the hit, but at least the floor; `allowance` (1 or more) loosens them. Other channels are
/// not limited. For an acceleration, the velocity floor is converted at the frequency of the
/// slowest mode of interest.
pub fn after(recording: &Recording, channels: &ChannelMap, settle: &Settle, allowance: f64) -> QuietLimits {
    let rate = f64::from(channels.rate_hz);
    let from = recording.trigger_index + (FROM_S * rate) as usize;
    let to = from + (FOR_S * rate) as usize;
    channels
        .channels
        .iter()
        .enumerate()
        .map(|(place, channel)| {
            let floor = match channel.quantity {
                Quantity::Velocity => settle.quiet_floor_m_per_s,
                Quantity::Acceleration => settle.quiet_floor_m_per_s * 2.0 * PI * PERIODS / FOR_S,
                Quantity::Displacement | Quantity::Force | Quantity::Voltage => return 0.0,
            };
            let samples = recording.channel(place);
            let mut window = Vec::new();
            samples.part(from, to).scaled(1.0, &mut window);
            let power: f64 = window.iter().map(|sample| sample.powi(2)).sum();
            let rms = (power / window.len().max(1) as f64).sqrt() * samples.of().units(channel).abs();
            (allowance * (settle.quiet_relative * rms).max(floor)) as f32
        })
        .collect()
}
