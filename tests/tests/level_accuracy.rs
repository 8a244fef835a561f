//! How well a level of the shaker tells the contact's own stiffness, through the whole chain: plan, hammer's cells, shaker, records,
//! spectra, estimate. The truth is that of the rig's parameters.
#![allow(clippy::unwrap_used)]

use jointrig::analyse::Wanted;
use jointrig::campaign::plan::level::{Held, Level, Moment};
use jointrig::campaign::run::shaking::{self, Limits, Options};
use jointrig::campaign::store::Store;
use jointrig::device::address::Address;
use jointrig::device::session::Session;
use jointrig::report::document;
use jointrig::results::{Excitation, Force, Hysteresis, Results};
use jointrig_tests::campaign::run;
use jointrig_tests::rigs::{Drawn, drawn, levels_plan};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// One campaign: the rig's k_T, and its results.
struct Campaign {
    truth: f64,
    results: Results,
}

impl Campaign {
    fn levels(&self) -> impl Iterator<Item = &Hysteresis> {
        let rows = self.results.hysteresis.iter();
        rows.filter(|row| row.kind == Excitation::Shaker && row.force == Force::Raw)
    }

    /// Error and half width of a level's k_T, relative, and whether its interval covers; none where it has none.
    fn named(&self, row: &Hysteresis) -> Option<(f64, f64, bool)> {
        let k = row.k_t_n_per_m?;
        let [low, high] = k.ci95.unwrap();
        let covers = low <= self.truth && self.truth <= high;
        Some((k.mean / self.truth - 1.0, 0.5 * (high - low) / k.mean, covers))
    }

    fn tell(&self, label: &str) {
        for row in self.levels() {
            let told = match self.named(row) {
                Some((error, half, covers)) => format!(
                    "{:+5.1} % ± {:.1} % {}",
                    100.0 * error,
                    100.0 * half,
                    if covers { "" } else { "MISSED" }
                ),
                None => row.k_t_why.clone().unwrap_or_default(),
            };
            println!("{label} {:3.0} Hz: {told}", row.frequency_hz.unwrap());
        }
    }
}

/// Measures the levels that the plan asks for.
fn shake(file: &Path, address: &Address, seed: u64) {
    let mut store = Store::open(file).unwrap();
    let plan = store.plan().unwrap();
    let planned = plan.shaker.unwrap().into_inner();
    let level =
        |(frequency_hz, amplitude)| Level { frequency_hz, end_hz: None, held: Held::Displacement, amplitude };
    let each = |f: f64| planned.amplitudes_m.iter().map(move |amplitude| (f, *amplitude));
    let mut session = Session::open(address.open(seed).unwrap(), "test").unwrap();
    let of = |level: Level| Options {
        levels: vec![level],
        moment: Moment::After,
        seconds: 1.0,
        sweep_hz_per_s: 20.0,
        most_drive_v: None,
        limits: Limits::default(),
        stop: Arc::new(AtomicBool::new(false)),
    };
    for level in planned.frequencies_hz.iter().flat_map(|f| each(*f)).map(level) {
        // a level on a resonance cannot be held, and is stopped: the others can
        if let Err(error) = shaking::run(&mut store, &mut session, &of(level), &mut |_, _, _| {}) {
            println!("{}: {error}", file.display());
        }
    }
    store.close().unwrap();
}

fn campaign(number: u64, seed: u64, like: Drawn) -> Campaign {
    let temporary = tempfile::tempdir().unwrap();
    // JOINTRIG_KEEP names a folder that keeps the campaigns; those that are in it are not measured again
    let folder = std::env::var_os("JOINTRIG_KEEP").map_or(temporary.path().to_owned(), Into::into);
    let at = |ending: &str| folder.join(format!("{number}-{seed}.{ending}"));
    let (file, description) = (at("jrig"), at("toml"));
    let rig = drawn(number, like);
    let drawn_seed = 1000 * number + seed;
    if !file.exists() {
        std::fs::write(&description, rig.to_toml()).unwrap();
        let address: Address = format!("sim:{}", description.display()).parse().unwrap();
        let _ = run(&file, &levels_plan(&rig), address.open(drawn_seed).unwrap());
        shake(&file, &address, drawn_seed);
    }
    let store = Store::open_read_only(&file).unwrap();
    let results = document(jointrig::analyse::analyse(&store, Wanted::default(), &|_| {}).unwrap());
    Campaign { truth: rig.truth().contact_k_t_n_per_m, results }
}

/// What is counted of some campaigns.
#[derive(Default)]
struct Counted {
    campaigns: usize,
    levels: usize,
    /// Error and half width of each level that is named k_T, relative; whether its interval covers.
    named: Vec<(f64, f64, bool)>,
    /// Error of the slope between the spots of the same levels where it has one.
    raw: Vec<f64>,
}

impl Counted {
    fn add(&mut self, campaign: &Campaign) {
        self.campaigns += 1;
        for row in campaign.levels() {
            self.levels += 1;
            if let Some(slope) = row.slope_between_spots_n_per_m {
                self.raw.push(slope.mean / campaign.truth - 1.0);
            }
            self.named.extend(campaign.named(row));
        }
    }

    fn row(&self, name: &str) -> String {
        let rms = |errors: &[f64]| {
            100.0 * (errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64).sqrt()
        };
        let covered = self.named.iter().filter(|(.., covers)| *covers).count();
        let mut half: Vec<f64> = self.named.iter().map(|(_, half, _)| 100.0 * half).collect();
        half.sort_by(f64::total_cmp);
        let errors: Vec<f64> = self.named.iter().map(|(error, ..)| *error).collect();
        format!(
            "| {name} | {} | {} | {} | {covered} ({:.1} %) | {:.1} % | {:.1} % | {:.0} % ({} levels) |",
            self.campaigns,
            self.levels,
            self.named.len(),
            100.0 * covered as f64 / self.named.len().max(1) as f64,
            rms(&errors),
            half.get(half.len() / 2).copied().unwrap_or(f64::NAN),
            rms(&self.raw),
            self.raw.len()
        )
    }
}

#[test]
fn a_level_is_called_k_t_only_where_its_interval_holds() {
    // a contact of 93 N/µm; between the spots it is 24 at 100 Hz
    let campaign = campaign(8, 0, Drawn::default());
    let mut counted = Counted::default();
    counted.add(&campaign);
    assert_eq!(counted.levels, 6);
    assert!(counted.named.len() >= 2, "some levels of this rig tell its contact");
    assert!(counted.named.iter().all(|(error, half, covers)| *covers && *half <= 0.1 && error.abs() < 0.1));
    // what stands beside it, between the spots, is another number
    assert!(counted.raw.iter().any(|error| error.abs() > 0.1), "{:?}", counted.raw);
    for row in campaign.levels() {
        let why = row.k_t_why.as_ref().expect("a level says what it rests on, or why it has none");
        assert_eq!(row.k_t_n_per_m.is_none(), why.starts_with("no k_T: "), "{why}");
        assert_eq!(row.k_t_n_per_m.is_some(), row.c_t_n_s_per_m.is_some());
        assert!(row.k_eq_n_per_m.is_some(), "raw values stay");
    }
}

#[test]
#[ignore = "prints docs/accuracy.md's table of the shaker's levels: half an hour"]
fn accuracy_of_the_shakers_levels() {
    let variable = |name: &str, otherwise: u64| -> u64 {
        std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
    };
    let (first, rigs, seeds) = (variable("FIRST", 40), variable("RIGS", 12), variable("SEEDS", 2));
    let like = Drawn::default();
    let next = AtomicU64::new(0);
    // all, then those with a clamp on side A only, and on both
    let counted = Mutex::new([Counted::default(), Counted::default(), Counted::default()]);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    if i >= rigs * seeds {
                        break;
                    }
                    let (number, seed) = (first + i / seeds, i % seeds);
                    let campaign = campaign(number, seed, like);
                    let label = format!("rig {number:2} seed {seed} ({:5.1} N/µm)", 1e-6 * campaign.truth);
                    campaign.tell(&label);
                    let mut counted = counted.lock().unwrap();
                    let kind = if number.is_multiple_of(3) { 2 } else { 1 };
                    counted[0].add(&campaign);
                    counted[kind].add(&campaign);
                }
            });
        }
    });
    println!(
        "| rigs | campaigns | levels | named k_T | covered | rms error | half width (median) | rms error between the spots |"
    );
    for (name, counted) in
        ["all", "clamp on A", "clamps on A and B"].iter().zip(counted.into_inner().unwrap().iter())
    {
        println!("{}", counted.row(name));
    }
}
