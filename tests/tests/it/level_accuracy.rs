//! Accuracy of the contact's own stiffness from a level of the shaker, through the whole chain:
//! plan, hammer's cells, shaker, records, spectra, estimate. The truth follows from the rig's
//! parameters.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::level::{Held, Level, Moment};
use jointrig::campaign::run::shaking::{self, ChannelLimits, LevelOptions};
use jointrig::campaign::store::Store;
use jointrig::device::address::Address;
use jointrig::device::session::Session;
use jointrig::results::{Excitation, Force, Hysteresis, Results};
use jointrig_tests::coverage::{Answer, COLUMNS, Coverage, print_table, rms};
use jointrig_tests::drawn_campaigns::{DrawnCampaign, campaigns, count};
use jointrig_tests::rigs::{Drawn, levels_plan};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// One campaign: the rig's k_T, and its results.
struct Campaign {
    truth: f64,
    results: Results,
}

impl Campaign {
    fn of(drawn: DrawnCampaign) -> Self {
        Campaign { truth: drawn.truth_n_per_m(), results: drawn.results(levels_plan, shake) }
    }

    fn levels(&self) -> impl Iterator<Item = &Hysteresis> {
        let rows = self.results.hysteresis.iter();
        rows.filter(|row| row.kind == Excitation::Shaker && row.force == Force::Raw)
    }

    /// A level's k_T compared with the truth; `None` if it has no k_T.
    fn named(&self, row: &Hysteresis) -> Option<Answer> {
        let k = row.k_t_n_per_m?;
        Some(Answer::new(k.mean, k.ci95.unwrap(), self.truth))
    }

    /// The same for the final answer, to which hits and levels both contribute.
    fn answer(&self) -> Option<Answer> {
        let k = self.results.answer.as_ref()?.contact.k_t_n_per_m?;
        Some(Answer::new(k.mean, k.ci95, self.truth))
    }

    fn tell(&self, label: &str) {
        if let Some(Answer { error, half, covers, .. }) = self.answer() {
            let basis = self.results.answer.as_ref().unwrap().contact.basis;
            let missed = if covers { "" } else { "MISSED" };
            println!("{label} answer: {:+5.1} % ± {:.1} % {basis:?} {missed}", 100.0 * error, 100.0 * half);
        }
        for row in self.levels() {
            let told = match self.named(row) {
                Some(Answer { error, half, covers, .. }) => format!(
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

/// Measures the levels of the plan.
fn shake(file: &Path, address: &Address, seed: u64) {
    let mut store = Store::open(file).unwrap();
    let plan = store.plan().unwrap();
    let planned = plan.shaker.unwrap().into_inner();
    let level =
        |(frequency_hz, amplitude)| Level { frequency_hz, end_hz: None, held: Held::Displacement, amplitude };
    let each = |f: f64| planned.amplitudes_m.iter().map(move |amplitude| (f, *amplitude));
    let mut session = Session::open(address.open(seed).unwrap(), "test").unwrap();
    let of = |level: Level| LevelOptions {
        levels: vec![level],
        moment: Moment::After,
        seconds: 1.0,
        sweep_hz_per_s: 20.0,
        most_drive_v: None,
        limits: ChannelLimits::default(),
        new_structure: false,
        stop: Arc::new(AtomicBool::new(false)),
    };
    for level in planned.frequencies_hz.iter().flat_map(|f| each(*f)).map(level) {
        // a level at a resonance cannot be held and is stopped; the others can
        if let Err(error) = shaking::run(&mut store, &mut session, &of(level), &mut |_, _, _| {}) {
            println!("{}: {error}", file.display());
        }
    }
    store.close().unwrap();
}

/// Counts over some campaigns.
#[derive(Default)]
struct Counted {
    campaigns: usize,
    levels: usize,
    /// Each level with a k_T.
    named: Vec<Answer>,
    answers: Vec<Answer>,
    /// Error of the slope between the spots of the same levels, if they have one.
    raw: Vec<f64>,
}

impl Counted {
    fn add(&mut self, campaign: &Campaign) {
        self.campaigns += 1;
        self.answers.extend(campaign.answer());
        for row in campaign.levels() {
            self.levels += 1;
            if let Some(slope) = row.slope_between_spots_n_per_m {
                self.raw.push(slope.mean / campaign.truth - 1.0);
            }
            self.named.extend(campaign.named(row));
        }
    }

    /// Table rows of the levels, and of the answers of the same campaigns.
    fn rows(&self, name: &str) -> [String; 2] {
        let told = |all: &[Answer]| Coverage::of(all).cells();
        let Counted { campaigns, levels, named, answers, raw } = self;
        [
            format!(
                "| {name} | {campaigns} | {levels} | {} | {:.0} % ({} levels) |",
                told(named),
                100.0 * rms(raw),
                raw.len()
            ),
            format!("| {name}: answer.contact | {campaigns} | – | {} | – |", told(answers)),
        ]
    }
}

#[test]
fn a_level_is_called_k_t_only_where_its_interval_holds() {
    // a contact of 93 N/µm; the slope between the spots is 24 at 100 Hz
    let campaign = Campaign::of(DrawnCampaign { number: 8, seed: 1, like: Drawn::default() });
    let mut counted = Counted::default();
    counted.add(&campaign);
    assert_eq!(counted.levels, 6);
    assert!(counted.named.len() >= 2, "some levels of this rig tell its contact");
    assert!(counted.named.iter().all(|level| level.covers && level.half <= 0.1 && level.error.abs() < 0.1));
    // the slope between the spots, shown next to it, is a different number
    assert!(counted.raw.iter().any(|error| error.abs() > 0.1), "{:?}", counted.raw);
    // the levels that have a k_T also contribute to the answer
    let contact = &campaign.results.answer.as_ref().unwrap().contact;
    assert_eq!(contact.basis, jointrig::results::Basis::Joint, "{}", contact.why);
    let Answer { half, covers, .. } = campaign.answer().unwrap();
    assert!(covers && half < 0.05, "{}", contact.why);
    let shares: f64 = contact.budget.values().map(|share| share * share).sum();
    let k = contact.k_t_n_per_m.unwrap();
    let sigma = (k.ci95[0].recip() - k.ci95[1].recip()) / (2.0 * 1.96) * k.mean;
    // 1.96 instead of the exact quantile
    assert!((sigma / shares.sqrt() - 1.0).abs() < 1e-3, "the budget adds up");
    for row in campaign.levels() {
        let why = row.k_t_why.as_ref().expect("a level says what it rests on, or why it has none");
        assert_eq!(row.k_t_n_per_m.is_none(), why.starts_with("no k_T: "), "{why}");
        assert_eq!(row.k_t_n_per_m.is_some(), row.c_t_n_s_per_m.is_some());
        assert!(row.k_eq_n_per_m.is_some(), "raw values stay");
    }
}

#[test]
#[ignore = "docs/accuracy.md, by `cargo xtask accuracy`: the shaker's levels"]
fn accuracy_of_the_shakers_levels() {
    let (first, rigs, seeds) = (count("FIRST", 40), count("RIGS", 44), count("SEEDS", 1));
    let all = campaigns(first, rigs, seeds, Drawn::default(), |drawn| {
        let campaign = Campaign::of(drawn);
        campaign.tell(&format!(
            "rig {:2} seed {} ({:5.1} N/µm)",
            drawn.number,
            drawn.seed,
            1e-6 * campaign.truth
        ));
        (!drawn.rig().clamp_b.rigid, campaign)
    });
    // all, then those with a clamp on side A only, and with clamps on both sides
    let mut counted = [Counted::default(), Counted::default(), Counted::default()];
    for (both, campaign) in &all {
        counted[0].add(campaign);
        counted[if *both { 2 } else { 1 }].add(campaign);
    }
    let named = ["all", "clamp on A", "clamps on A and B"].iter().zip(&counted);
    let rows: Vec<String> = named.flat_map(|(name, counted)| counted.rows(name)).collect();
    let columns = format!("rigs | campaigns | levels | {COLUMNS} | rms error between the spots");
    print_table("levels", &columns, &rows);
}
