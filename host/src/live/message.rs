//! Messages to a page, version 1. Field names include units; a page ignores fields and kinds that
//! it does not know.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::now::{Control, Disk, Link, Now, Shaker, Signals, State, StreamInfo};

/// Version of these messages.
pub const VERSION: u32 = 1;

/// One message.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Message {
    /// The complete state, for a page that has just connected or has missed messages.
    Snapshot(Box<Snapshot>),
    /// A record was stored and assessed.
    Judged(Box<Judged>),
    /// Cells whose counts changed for another reason: a hit dropped or kept, a cell given up or
    /// settled.
    Cells(Counted),
    /// The current result of the analysis.
    Estimate(Box<Estimate>),
    /// The file can no longer be read.
    Trouble(Trouble),
    /// What the measuring process is doing.
    State(State),
    /// Scans received and lost.
    Link(Link),
    /// The channels of the stream.
    Stream(StreamInfo),
    /// Signal levels of the channels.
    Signals(Signals),
    /// The shaker's level.
    Shaker(Box<Shaker>),
    /// Free space for the campaign file.
    Disk(Disk),
    /// Which page may answer the prompts to move hammer and laser.
    Control(Control),
}

/// The complete state.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Snapshot {
    /// Version of the messages.
    pub version: u32,
    /// The campaign file.
    pub file: String,
    /// The plan's name.
    pub plan: String,
    /// Whether the rig is simulated.
    pub simulated: bool,
    /// Every cell of the plan, in measuring order.
    pub cells: Vec<CellCount>,
    /// Progress of the campaign.
    pub progress: Progress,
    /// Every hit, in order.
    pub hits: Vec<Hit>,
    /// Every level of the shaker that is stored.
    pub levels: Vec<LevelDone>,
    /// The newest result of the analysis; `None` before the first.
    pub estimate: Option<Estimate>,
    /// State that exists only while this process measures.
    pub now: Now,
    /// What this server supports besides viewing.
    pub can: Can,
}

/// What a server supports besides viewing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Can {
    /// It receives a device's stream.
    pub stream: bool,
    /// It accepts notes and changes of verdicts.
    pub edit: bool,
    /// It lets a page answer the prompts to move hammer and laser.
    pub control: bool,
}

/// A level of the shaker that is stored.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LevelDone {
    /// Its id.
    pub id: i64,
    /// Its description.
    pub title: String,
    /// `before` or `after` the hammer measurements of the cells.
    pub moment: &'static str,
    /// The controlled quantity: `displacement`, `force` or `drive`.
    pub held: &'static str,
    /// The set point, m, N or V.
    pub order: f64,
    /// The amplitude over the record, m, N or V.
    pub reached: f64,
    /// Largest amplitude before the record, as a ratio to the set point.
    pub overshoot: f64,
    /// Time from the set point to the record, s.
    pub after_s: f64,
    /// Drive amplitude during the record, V.
    pub drive_v: f64,
}

/// Progress of a campaign.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Progress {
    /// Good hits so far.
    pub kept: u64,
    /// Good hits wanted.
    pub wanted: u64,
    /// Whether every cell is complete or settled.
    pub complete: bool,
    /// Index of the next cell to measure.
    pub next: Option<usize>,
    /// Time left.
    pub left: Option<Left>,
    /// Scans that the link lost for good.
    pub lost_scans: u64,
    /// Scans that were sent again.
    pub recovered_scans: u64,
    /// Cycles of wear runs in the file.
    pub wear_cycles: u64,
}

/// Time left at the pace of the last hits, s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Left {
    /// For the cell.
    pub cell_s: f64,
    /// For its configuration.
    pub configuration_s: f64,
    /// For the campaign.
    pub campaign_s: f64,
}

/// Counts of one cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellCount {
    /// Its id in the file.
    pub id: i64,
    /// `A`, `B` or `AJB`.
    pub configuration: &'static str,
    /// The impact.
    pub impact: String,
    /// The response.
    pub response: String,
    /// Good hits wanted.
    pub wanted: u32,
    /// Good hits so far.
    pub kept: u32,
    /// Hits tried.
    pub attempts: u32,
    /// Refused hits by verdict.
    pub refused: BTreeMap<&'static str, u32>,
    /// The reason why it was given up, if it was.
    pub given_up: Option<String>,
    /// The reason why it is complete with fewer good hits than wanted, if it is.
    pub settled: Option<String>,
}

/// One hit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hit {
    /// The record's id.
    pub record: i64,
    /// The cell's id.
    pub cell: i64,
    /// The attempt in that cell, from 0.
    pub attempt: u32,
    /// When it was stored, UTC.
    pub utc: String,
    /// The verdict in effect.
    pub verdict: &'static str,
    /// The automatic verdict, where a person has changed it.
    pub judged: Option<&'static str>,
    /// Whether the analysis uses it.
    pub kept: bool,
    /// The value on which the verdict is based; `None` where it is not finite.
    pub measure: Option<f64>,
    /// The limit for that value.
    pub limit: Option<f64>,
    /// Value and limit as a sentence.
    pub sentence: String,
    /// Peak force, N.
    pub peak_n: f64,
    /// Length of the coil's pulse, µs.
    pub pulse_us: u32,
}

/// A new hit and the counts that it changes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// The hit.
    pub hit: Hit,
    /// The counts of its cell.
    pub cell: CellCount,
    /// Progress of the campaign.
    pub progress: Progress,
}

/// Counts that changed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Counted {
    /// The cells.
    pub cells: Vec<CellCount>,
    /// Hits whose verdict a person changed.
    pub hits: Vec<Hit>,
    /// Progress of the campaign.
    pub progress: Progress,
}

/// A result of the analysis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Id of the last record that it includes.
    pub after_record: i64,
    /// Number of good hits that it includes.
    pub hits: usize,
    /// Computing time, s.
    pub took_s: f64,
    /// `answer` of `results.json`, as `analyse` writes it.
    pub answer: serde_json::Value,
    /// The answer as text: heading and text of each line.
    pub lines: Vec<[String; 2]>,
    /// What is missing, and what it is needed for.
    pub missing: Vec<String>,
    /// Names of the figures for which there are data.
    pub figures: Vec<String>,
}

/// Why no more messages follow.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trouble {
    /// What is wrong, where, and what to do.
    pub what: String,
}
