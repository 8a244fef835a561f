//! `campaign run`: measures what is missing. `demo` runs its campaign by the same function.

use super::{calibrate, next};
use crate::advice::{quoted, quoted_word};
use crate::campaign::plan::{Cell, Plan};
use crate::campaign::run::further::Further;
use crate::campaign::run::progress::CampaignProgress;
use crate::campaign::run::runner;
use crate::campaign::run::runner::{Options, Summary};
use crate::campaign::run::stage::Stage;
use crate::campaign::store::Store;
use crate::campaign::verdict::judge::{ByRecord, Judge};
use crate::campaign::verdict::others::Others;
use crate::campaign::verdict::{Judgement, Verdict};
use crate::cli::error::CliError;
use crate::cli::output;
use crate::cli::page::{Onlooker, Page};
use crate::cli::plan::file as plan_file;
use crate::device::address::Address;
use crate::device::channels::ChannelMap;
use crate::device::logs::Tables;
use crate::device::session::Session;
use crate::device::stream::Recording;
use crate::untrusted_text::tell_line;
use clap::Args;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Measure what is missing in a campaign.
#[derive(Debug, Args)]
#[allow(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
pub struct Run {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Device address, e.g. sim:, usb:, serial:/dev/ttyACM0, tcp:127.0.0.1:4000,
    /// "bridge:python my_daq.py".
    #[arg(long, value_name = "ADDR")]
    device: String,
    /// Who moves hammer and laser: auto, manual, device or exec:COMMAND.
    #[arg(long, value_name = "WHO", default_value = "auto")]
    stage: Stage,
    /// Answer every prompt with yes.
    #[arg(long)]
    yes: bool,
    /// Continue with this edited plan.
    #[arg(long, value_name = "PLAN.toml")]
    plan: Option<PathBuf>,
    /// The laboratory's sensors: from this session onwards they replace the data of device and
    /// plan.
    #[arg(long, value_name = "LAB.toml")]
    calibration: Option<PathBuf>,
    /// Continue even if the device indicates another structure than that of the file's records; the
    /// report notes it.
    #[arg(long)]
    new_structure: bool,
    /// Measure the fewest good hits of each cell, and then the cells that shrink k_T's interval most
    /// per minute, until its relative half width is this, such as 2%.
    #[arg(long, value_name = "PERCENT", value_parser = next::percent)]
    until: Option<f64>,
    /// Largest number of further hits in this run, with --until.
    #[arg(long, value_name = "N", default_value_t = next::FURTHER_HITS, requires = "until")]
    further_hits: usize,
    #[command(flatten)]
    durations: next::Durations,
    /// Ring the terminal's bell at every verdict, twice if the hit is refused.
    #[arg(long)]
    bell: bool,
    /// Seed of a simulated rig.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Folder with the tables that decode the controller's log lines [default: that of the
    /// environment variable JOINTRIG_LOG_TABLES].
    #[arg(long, value_name = "DIR")]
    log_tables: Option<PathBuf>,
    #[command(flatten)]
    page: Page,
    /// Let a live page answer the prompts for hammer and laser: in place, redo, skip, back. The
    /// person who answers must see the rig.
    #[cfg(feature = "dashboard")]
    #[arg(long, requires = "serve")]
    allow_control: bool,
}

impl Run {
    /// The command without options, with a live page.
    #[cfg(feature = "dashboard")]
    pub fn with_page(file: PathBuf, device: String, page: Page, allow_control: bool) -> Self {
        Self {
            file,
            device,
            stage: Stage::Auto,
            yes: false,
            new_structure: false,
            plan: None,
            calibration: None,
            until: None,
            further_hits: next::FURTHER_HITS,
            durations: next::Durations::default(),
            bell: false,
            seed: 1,
            log_tables: None,
            page,
            allow_control,
        }
    }

    pub fn run(self) -> Result<(), CliError> {
        let address: Address = self.device.parse()?;
        let mut store = Store::open(&self.file)?;
        self.settle_plan(&mut store)?;
        if let Some(path) = &self.calibration {
            let reason = format!("`campaign run --calibration {}`", path.display());
            store.calibrate(&calibrate::read(path)?, store.next_session()?, &reason)?;
        }
        self.mention_shaker(&store)?;
        let stop = output::flag();
        let mut onlooker = self.page.start(Some(&self.file), &stop, self.allows_control())?;
        let device = quoted_word(&address.to_string());
        let until = self.until.map_or(String::new(), |until| format!(" --until {}%", 100.0 * until));
        let again = format!("jointrig campaign run {} --device {device}{until}", quoted(&self.file));
        let device = Device { address: &address, seed: self.seed, log_tables: self.log_tables };
        let further = self.until.map(|until| {
            next::Until::new(&store, until, self.durations, self.further_hits).map(Further::new)
        });
        let further = further.transpose()?;
        let who = Who { stage: self.stage, yes: self.yes, new_structure: self.new_structure, further, stop };
        let mut judge = Ringing { rings: self.bell };
        let summary = measure(store, device, who, &mut onlooker, Some(&again), &mut judge)?;
        if summary.interrupted {
            return Err(CliError::Bad("stopped before the campaign was complete".into()));
        }
        if let Some((false, why)) = summary.further {
            return Err(CliError::Bad(why));
        }
        Ok(())
    }

    #[cfg(feature = "dashboard")]
    fn allows_control(&self) -> bool {
        self.allow_control
    }

    #[cfg(not(feature = "dashboard"))]
    #[allow(clippy::unused_self, reason = "with a page it depends on the command line")]
    fn allows_control(&self) -> bool {
        false
    }

    /// The shaker's levels are measured by another command: prints a reminder as long as some of
    /// the plan's levels are missing.
    fn mention_shaker(&self, store: &Store) -> Result<(), CliError> {
        if let Some(shaker) = &store.plan()?.shaker
            && store.levels()?.len() < 2 * shaker.get_ref().levels()
        {
            tell_line!("{}", shaker.get_ref().remark(&self.file));
        }
        Ok(())
    }

    /// Takes over the edited plan given by --plan; without it, reports if the plan's file was
    /// edited.
    fn settle_plan(&self, store: &mut Store) -> Result<(), CliError> {
        if let Some(path) = &self.plan {
            let text = plan_file::read(path)?;
            return Ok(store.take_over(&text, &path.display().to_string())?);
        }
        let (text, source) = store.plan_text()?;
        // a plan file that no longer exists, or a built-in plan, was not edited
        if plan_file::read(Path::new(&source)).is_ok_and(|now| now != text) {
            tell_line!(
                "{source} was edited since: continuing with the plan in {}; `--plan {source}` adopts the new one",
                self.file.display()
            );
        }
        Ok(())
    }
}

/// Judges by the record, and rings the bell for a person at the rig.
struct Ringing {
    rings: bool,
}

impl Judge for Ringing {
    fn judge(
        &mut self,
        cell: &Cell,
        plan: &Plan,
        channels: &ChannelMap,
        recording: &Recording,
        others: &Others,
    ) -> Judgement {
        let verdict = ByRecord.judge(cell, plan, channels, recording, others);
        if self.rings {
            let rings: &[u8] = if verdict.kind == Verdict::Good { b"\x07" } else { b"\x07\x07" };
            // errors on stderr are ignored
            let _ = std::io::stderr().write_all(rings);
        }
        verdict
    }
}

/// The measuring device.
pub struct Device<'a> {
    pub address: &'a Address,
    /// Seed of a simulated rig.
    pub seed: u64,
    /// Folder of the log string tables, if given.
    pub log_tables: Option<PathBuf>,
}

/// Interaction with the person at the rig.
pub struct Who {
    /// Who moves hammer and laser.
    pub stage: Stage,
    /// Whether every prompt is answered with yes.
    pub yes: bool,
    /// Whether another structure than that of the file's records is accepted.
    pub new_structure: bool,
    /// Chooses further cells, if any are wanted.
    pub further: Option<Further>,
    /// Set to end after the current shot.
    pub stop: Arc<AtomicBool>,
}

/// Measures what is missing in the campaign in `store`. `again` is the command that resumes it, if
/// it can be resumed.
pub fn measure(
    store: Store,
    device: Device<'_>,
    who: Who,
    onlooker: &mut Onlooker,
    again: Option<&str>,
    judge: &mut dyn Judge,
) -> Result<Summary, CliError> {
    let path = store.path().to_owned();
    let Device { address, seed, log_tables } = device;
    let worn_j = store.wear_total()?.energy_j;
    let mut session = Session::open(address.open_worn(seed, worn_j)?, &address.to_string())?;
    session.look_for_log_tables(Tables::new(log_tables));
    onlooker.tap.take().into_iter().for_each(|tap| session.watch(tap));
    let Who { stage, yes, new_structure, further, stop } = who;
    let watch = onlooker.watch.clone().and(Arc::new(CampaignProgress::default()));
    let (edits, answers) = (onlooker.edits.take(), onlooker.answers.take());
    let options = Options { stage, yes, new_structure, watch, edits, answers, further, stop };
    let summary = runner::run(store, &mut session, judge, &options)?;
    tell(&path, &summary, again);
    tell_size(&path)?;
    Ok(summary)
}

/// Prints the file's size, and the compression ratio of its samples.
fn tell_size(path: &Path) -> Result<(), CliError> {
    let (stored, raw) = Store::open_read_only(path)?.sample_bytes()?;
    let whole = std::fs::metadata(path).map_or(0, |file| file.len());
    let ratio = raw as f64 / stored.max(1) as f64;
    tell_line!(
        "{}: {:.1} MB on disk; samples {:.1} MB, stored in {:.1} MB ({ratio:.2} : 1, lossless)",
        path.display(),
        whole as f64 / 1e6,
        raw as f64 / 1e6,
        stored as f64 / 1e6
    );
    Ok(())
}

fn tell(path: &Path, summary: &Summary, again: Option<&str>) {
    let Summary { kept, wanted, hits, given_up, accounts, further, .. } = summary;
    tell_line!("{}: {kept} of {wanted} good hits kept ({hits} struck in this run)", path.display());
    if *given_up > 0 {
        tell_line!("{given_up} cells were given up: `jointrig campaign status {}` says why", quoted(path));
    }
    if accounts.lost > 0 || accounts.unexplained() > 0 {
        tell_line!(
            "samples lost: {} reported by the device, {} unexplained",
            accounts.lost,
            accounts.unexplained()
        );
    }
    if let Some((true, why)) = further {
        tell_line!("{why}");
    }
    if summary.interrupted
        && let Some(again) = again
    {
        tell_line!("stopped; `{again}` continues from here");
    }
}
