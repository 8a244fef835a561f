//! Campaigns on randomly drawn rigs, for the tables that count how often an interval covers the
//! truth.

use crate::campaign::run;
use crate::rigs::{Drawn, drawn};
use jointrig::analyse::Wanted;
use jointrig::campaign::store::Store;
use jointrig::device::address::Address;
use jointrig::report::document;
use jointrig::results::Results;
use jointrig_hil_sim::rig::RigConfig;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A campaign on a randomly drawn rig: the rig's number, the parameters of the draw, and the
/// campaign's own seed.
#[derive(Clone, Copy, Debug)]
pub struct DrawnCampaign {
    /// The rig's number.
    pub number: u64,
    /// The campaign's seed.
    pub seed: u64,
    /// Parameters from which the rig is drawn.
    pub like: Drawn,
}

impl DrawnCampaign {
    /// The rig.
    pub fn rig(&self) -> RigConfig {
        drawn(self.number, self.like)
    }

    /// The rig's true k_T, N/m.
    pub fn truth_n_per_m(&self) -> f64 {
        self.rig().truth().contact_k_t_n_per_m
    }

    /// Runs the campaign into a file in `folder`, then calls `more` for measurements after the
    /// hammer's; an existing file is left unchanged.
    pub fn measured(
        &self,
        folder: &Path,
        plan: fn(&RigConfig) -> String,
        more: impl FnOnce(&Path, &Address, u64),
    ) -> PathBuf {
        let sensors = if self.like.accelerometers { "-accelerometers" } else { "" };
        let name = format!("{}-{}{sensors}", self.number, self.seed);
        let (rig, seed) = (self.rig(), 1000 * self.number + self.seed);
        measured(folder, &name, &rig, &plan(&rig), seed, more)
    }

    /// Results of the campaign; `JOINTRIG_KEEP` names a folder in which the files are kept;
    /// existing files are analysed again without a new run.
    pub fn results(
        &self,
        plan: fn(&RigConfig) -> String,
        more: impl FnOnce(&Path, &Address, u64),
    ) -> Results {
        in_folder(|folder| found(&self.measured(folder, plan, more)))
    }
}

/// Does something in the folder that `JOINTRIG_KEEP` names, or in a temporary one.
fn in_folder<T>(own: impl FnOnce(&Path) -> T) -> T {
    let temporary = tempfile::tempdir().unwrap();
    own(&std::env::var_os("JOINTRIG_KEEP").map_or(temporary.path().to_owned(), PathBuf::from))
}

/// Runs a campaign on a rig into the file of this name in `folder`, then calls `more`; an existing
/// file is left unchanged.
fn measured(
    folder: &Path,
    name: &str,
    rig: &RigConfig,
    plan: &str,
    seed: u64,
    more: impl FnOnce(&Path, &Address, u64),
) -> PathBuf {
    let at = |ending: &str| folder.join(format!("{name}.{ending}"));
    let (file, description) = (at("jrig"), at("toml"));
    if !file.exists() {
        std::fs::write(&description, rig.to_toml()).unwrap();
        let address: Address = format!("sim:{}", description.display()).parse().unwrap();
        let _ = run(&file, plan, address.open(seed).unwrap());
        more(&file, &address, seed);
    }
    file
}

/// Results of a campaign with this plan on a rig, whose number is its seed; `JOINTRIG_KEEP` as for
/// [`DrawnCampaign::results`].
pub fn results(number: u64, rig: &RigConfig, plan: &str) -> Results {
    in_folder(|folder| found(&measured(folder, &number.to_string(), rig, plan, number, |_, _, _| {})))
}

/// Results of a campaign file.
pub fn found(file: &Path) -> Results {
    let store = Store::open_read_only(file).unwrap();
    document(jointrig::analyse::analyse(&store, Wanted::default(), &|_| {}).unwrap())
}

/// Runs `seeds` campaigns on each of `rigs` rigs from number `first` on, two at a time, and passes
/// each to `each`; results in the order of completion.
pub fn campaigns<T: Send>(
    first: u64,
    rigs: u64,
    seeds: u64,
    like: Drawn,
    each: impl Fn(DrawnCampaign) -> T + Sync,
) -> Vec<T> {
    let one = |i| DrawnCampaign { number: first + i / seeds, seed: i % seeds, like };
    each_of(&(0..rigs * seeds).map(one).collect::<Vec<_>>(), each)
}

/// Runs these campaigns, two at a time, and passes each to `each`; results in the order of
/// completion.
pub fn each_of<T: Send>(wanted: &[DrawnCampaign], each: impl Fn(DrawnCampaign) -> T + Sync) -> Vec<T> {
    self::each(wanted, |campaign| each(*campaign))
}

/// Does something for each of these, two at a time; results in the order of completion.
pub fn each<W: Sync, T: Send>(wanted: &[W], each: impl Fn(&W) -> T + Sync) -> Vec<T> {
    let (next, all) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(wanted) = wanted.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let one = each(wanted);
                    all.lock().unwrap().push(one);
                }
            });
        }
    });
    all.into_inner().unwrap()
}

/// A count from the environment, or `otherwise`.
pub fn count(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).ok().map_or(otherwise, |text| text.parse().expect("a count"))
}
