//! What a page is told, version 1. Units stand in the names; a page skips fields and kinds that it does not know.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::now::{Control, Disk, Link, Now, Shaker, Signals, State, StreamInfo};

/// Version of these messages.
pub const VERSION: u32 = 1;

/// One message.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Message {
    /// All that there is to know, for a page that has just come or was left behind.
    Snapshot(Box<Snapshot>),
    /// A record was stored and judged.
    Judged(Box<Judged>),
    /// Cells whose count changed otherwise: dropped, kept, given up, settled.
    Cells(Counted),
    /// What the analysis says by now.
    Estimate(Box<Estimate>),
    /// The file cannot be read any more.
    Trouble(Trouble),
    /// What is going on.
    State(State),
    /// Where the stream's scans went.
    Link(Link),
    /// What the stream consists of.
    Stream(StreamInfo),
    /// How large the signals are.
    Signals(Signals),
    /// The shaker's level.
    Shaker(Box<Shaker>),
    /// Room for the campaign file.
    Disk(Disk),
    /// Who answers for hammer and laser.
    Control(Control),
}

/// All that there is to know.
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
    /// Every cell of the plan, in the order in which it is measured.
    pub cells: Vec<CellCount>,
    /// How far it is.
    pub progress: Progress,
    /// Every hit, in order.
    pub hits: Vec<Hit>,
    /// Every level of the shaker that is stored.
    pub levels: Vec<LevelDone>,
    /// What the analysis said last; none before it said anything.
    pub estimate: Option<Estimate>,
    /// What is told while something is measured in this process.
    pub now: Now,
    /// What this server can do besides looking.
    pub can: Can,
}

/// What a server can do besides looking.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Can {
    /// It sees the stream of a device.
    pub stream: bool,
    /// It takes notes, and overrules verdicts.
    pub edit: bool,
    /// It lets a page answer for hammer and laser.
    pub control: bool,
}

/// A level of the shaker that is stored.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LevelDone {
    /// Its id.
    pub id: i64,
    /// In words.
    pub title: String,
    /// `before` or `after` the hammer's cells.
    pub moment: &'static str,
    /// What is held: `displacement`, `force` or `drive`.
    pub held: &'static str,
    /// The order, m, N or V.
    pub order: f64,
    /// The amplitude over the record, m, N or V.
    pub reached: f64,
    /// Largest amplitude on the way, over the order.
    pub overshoot: f64,
    /// Time from the order to the record, s.
    pub after_s: f64,
    /// The drive then, V.
    pub drive_v: f64,
}

/// How far a campaign is.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Progress {
    /// Good hits that are there.
    pub kept: u64,
    /// Good hits wanted.
    pub wanted: u64,
    /// Whether every cell has what it wants, or enough.
    pub complete: bool,
    /// The cell that comes next: its place among the cells.
    pub next: Option<usize>,
    /// Good hits in that cell.
    pub left: Option<Left>,
    /// Scans that the link lost for good.
    pub lost_scans: u64,
    /// Scans that were sent again.
    pub recovered_scans: u64,
}

/// Time that is left at the pace of the last hits, s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Left {
    /// In the cell.
    pub cell_s: f64,
    /// In its configuration.
    pub configuration_s: f64,
    /// In the campaign.
    pub campaign_s: f64,
}

/// One cell's count.
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
    /// Good hits there.
    pub kept: u32,
    /// Hits tried.
    pub attempts: u32,
    /// Refused hits by verdict.
    pub refused: BTreeMap<&'static str, u32>,
    /// Whether it was given up, with the reason.
    pub given_up: Option<String>,
    /// Whether it is done with fewer good hits than wanted, with the reason.
    pub settled: Option<String>,
}

/// One hit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Hit {
    /// The record's id.
    pub record: i64,
    /// The cell's id.
    pub cell: i64,
    /// Which attempt in that cell, from 0.
    pub attempt: u32,
    /// When.
    pub utc: String,
    /// The verdict that counts.
    pub verdict: &'static str,
    /// The judge's, where a person has overruled it.
    pub judged: Option<&'static str>,
    /// Whether analysis uses it.
    pub kept: bool,
    /// What was measured for the verdict; none where it is no number.
    pub measure: Option<f64>,
    /// The limit it was held against.
    pub limit: Option<f64>,
    /// Both in words.
    pub sentence: String,
    /// Peak force, N.
    pub peak_n: f64,
    /// The coil's pulse, µs.
    pub pulse_us: u32,
}

/// A hit, and what it changes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// The hit.
    pub hit: Hit,
    /// Its cell's count.
    pub cell: CellCount,
    /// How far the campaign is.
    pub progress: Progress,
}

/// Counts that changed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Counted {
    /// The cells.
    pub cells: Vec<CellCount>,
    /// Hits whose verdict a person changed.
    pub hits: Vec<Hit>,
    /// How far the campaign is.
    pub progress: Progress,
}

/// What the analysis says.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The last record that it knows.
    pub after_record: i64,
    /// Good hits in it.
    pub hits: usize,
    /// How long it took, s.
    pub took_s: f64,
    /// `answer` of `results.json`, as `analyse` gives it.
    pub answer: serde_json::Value,
    /// The same in words: what it is about, and what is said of it.
    pub lines: Vec<[String; 2]>,
    /// What is missing, and for what.
    pub missing: Vec<String>,
    /// Names of the figures that it has data for.
    pub figures: Vec<String>,
}

/// Why nothing more comes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trouble {
    /// What is wrong, where, and what to do.
    pub what: String,
}
