//! Campaigns on drawn rigs, for the tables that count how often an interval covers the truth.

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

/// A campaign on a drawn rig: the rig's number, how it is drawn, and the seed of what the campaign draws itself.
#[derive(Clone, Copy, Debug)]
pub struct DrawnCampaign {
    /// The rig's number.
    pub number: u64,
    /// The campaign's seed.
    pub seed: u64,
    /// What the rig is drawn from.
    pub like: Drawn,
}

impl DrawnCampaign {
    /// The rig.
    pub fn rig(&self) -> RigConfig {
        drawn(self.number, self.like)
    }

    /// The rig's own k_T, N/m.
    pub fn truth_n_per_m(&self) -> f64 {
        self.rig().truth().contact_k_t_n_per_m
    }

    /// Runs it into a file of `folder`, and lets `more` measure what follows the hammer; a file that is there already is left as it is.
    pub fn measured(
        &self,
        folder: &Path,
        plan: fn(&RigConfig) -> String,
        more: impl FnOnce(&Path, &Address, u64),
    ) -> PathBuf {
        let at = |ending: &str| folder.join(format!("{}-{}.{ending}", self.number, self.seed));
        let (file, description) = (at("jrig"), at("toml"));
        if !file.exists() {
            let (rig, seed) = (self.rig(), 1000 * self.number + self.seed);
            std::fs::write(&description, rig.to_toml()).unwrap();
            let address: Address = format!("sim:{}", description.display()).parse().unwrap();
            let _ = run(&file, &plan(&rig), address.open(seed).unwrap());
            more(&file, &address, seed);
        }
        file
    }

    /// What it finds; `JOINTRIG_KEEP` names a folder that keeps the files, and those that are in it are analysed again, not run.
    pub fn results(
        &self,
        plan: fn(&RigConfig) -> String,
        more: impl FnOnce(&Path, &Address, u64),
    ) -> Results {
        let temporary = tempfile::tempdir().unwrap();
        let folder = std::env::var_os("JOINTRIG_KEEP").map_or(temporary.path().to_owned(), Into::into);
        found(&self.measured(&folder, plan, more))
    }
}

/// What a campaign file tells.
pub fn found(file: &Path) -> Results {
    let store = Store::open_read_only(file).unwrap();
    document(jointrig::analyse::analyse(&store, Wanted::default(), &|_| {}).unwrap())
}

/// `rigs` rigs from number `first` on with `seeds` campaigns each, two at a time, each told to `each`; in the order of their end.
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

/// These campaigns, two at a time, each told to `each`; in the order of their end.
pub fn each_of<T: Send>(wanted: &[DrawnCampaign], each: impl Fn(DrawnCampaign) -> T + Sync) -> Vec<T> {
    let (next, all) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(campaign) = wanted.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let one = each(*campaign);
                    all.lock().unwrap().push(one);
                }
            });
        }
    });
    all.into_inner().unwrap()
}

/// A count from the environment.
pub fn count(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).ok().map_or(otherwise, |text| text.parse().expect("a count"))
}
