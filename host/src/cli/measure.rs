//! Runs a campaign from the command line: shared by `campaign run` and `demo`.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::error::CliError;
use super::page::Onlooker;
use crate::advice::quoted;
use crate::campaign::run::progress::CampaignProgress;
use crate::campaign::run::runner::{self, Options, Summary};
use crate::campaign::run::stage::Stage;
use crate::campaign::store::Store;
use crate::campaign::verdict::judge::Judge;
use crate::device::address::Address;
use crate::device::logs::Tables;
use crate::device::session::Session;
use crate::untrusted_text::tell_line;

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
    /// Set to end after the current shot.
    pub stop: Arc<AtomicBool>,
}

/// Measures what is missing in the campaign in `store`. `again` is the command that resumes it.
pub fn measure(
    store: Store,
    device: Device<'_>,
    who: Who,
    onlooker: &mut Onlooker,
    again: &str,
    judge: &mut dyn Judge,
) -> Result<Summary, CliError> {
    let path = store.path().to_owned();
    let Device { address, seed, log_tables } = device;
    let mut session = Session::open(address.open(seed)?, &address.to_string())?;
    session.look_for_log_tables(Tables::new(log_tables));
    onlooker.tap.take().into_iter().for_each(|tap| session.watch(tap));
    let Who { stage, yes, new_structure, stop } = who;
    let watch = onlooker.watch.clone().and(Arc::new(CampaignProgress::default()));
    let (edits, answers) = (onlooker.edits.take(), onlooker.answers.take());
    let options = Options { stage, yes, new_structure, watch, edits, answers, stop };
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

fn tell(path: &Path, summary: &Summary, again: &str) {
    let Summary { kept, wanted, hits, given_up, accounts, .. } = summary;
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
    if summary.interrupted {
        tell_line!("stopped; `{again}` continues from here");
    }
}
