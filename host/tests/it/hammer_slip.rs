//! Slip under the hammer, on randomly drawn campaigns for which nothing was tuned: the cells of a
//! contact campaign, on rigs that differ in contact, clamps, masses, damping and noise, half of
//! them stuck.
//!
//!     cargo test --release -p jointrig --test it hammer_slip -- --ignored --nocapture
#![cfg(feature = "sim")]

use jointrig::hysteresis::hammer_slip::{CellHits, HammerSlip, Unclear};
use jointrig::hysteresis::hammer_slip::{HitResponse, HitSignals};
use jointrig_hil_sim::rig::config::ContactLaw;
use jointrig_hil_sim::rig::{Configuration, Mishap, Rig, RigConfig};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

const IMPACTS: [&str; 4] = ["AZ1", "AZ2", "AZ3", "I_MZ"];
const RESPONSES: [&str; 7] = ["A1", "A2", "A3", "A4", "B1", "B2", "B3"];
/// A coil pulse for about 50 N.
const PULSE_S: f64 = 3.5e-3;
/// Scans of a record.
const RECORD: usize = 20_480;
/// The next hit waits until this fraction of the motion remains, and no longer than `SLOWEST`
/// scans.
const LEFT: f64 = 0.003;
const SLOWEST: usize = 51_200;
/// Sliding below this distance in a hit has no measurable effect, m; elements of an Iwan contact
/// creep this far.
const NOTHING_M: f64 = 2e-9;
const MUCH_M: f64 = 10e-9;

/// One campaign: every hit's response by cell, and the largest sliding distance of the contact in a
/// hit (m).
struct Campaign {
    cells: Vec<(&'static str, Vec<HitResponse>)>,
    slid_m: f64,
    about: String,
}

impl Campaign {
    fn verdict(&self) -> HammerSlip {
        let cells: Vec<CellHits<'_>> = self
            .cells
            .iter()
            .map(|(impact, hits)| CellHits { impact, hits: hits.iter().collect() })
            .collect();
        HammerSlip::of(&cells)
    }
}

/// A different rig for each seed.
fn rig(seed: u64) -> RigConfig {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let mut times = |factor: f64| factor.powf(between(-1.0, 1.0));
    let mut config = RigConfig::default();
    let contact = 190e6 * times(3.16);
    let ratio = contact / config.contact.stiffness_n_per_m[2];
    config.contact.stiffness_n_per_m.iter_mut().for_each(|k| *k *= ratio);
    config.contact.rotation_nm_per_rad.iter_mut().for_each(|k| *k *= ratio.sqrt());
    let clamp = [times(3.0), times(3.0)];
    config.clamp.loaded.stiffness_n_per_m.iter_mut().for_each(|k| *k *= clamp[0]);
    config.clamp.loaded.rotation_nm_per_rad.iter_mut().for_each(|k| *k *= clamp[1]);
    for body in [&mut config.bodies.arm_a, &mut config.bodies.arm_b, &mut config.bodies.mass] {
        body.mass_kg *= times(1.5);
    }
    let damping = times(2.5);
    for beta in
        [&mut config.contact.damping_s, &mut config.clamp.loaded.damping_s, &mut config.knife_edge.damping_s]
    {
        for own in beta.iter_mut() {
            *own *= damping;
        }
    }
    let floor = times(3.0);
    config.sensors.ldv_a.floor *= floor;
    config.sensors.ldv_b.floor *= floor;
    config.sensors.load_cells.noise_n *= times(3.0);
    config.sensors.ldv_a.delay_s = between(0.0, 1e-4);
    config.sensors.ldv_b.delay_s = between(0.0, 1e-4);
    config.clamp.rigid = between(0.0, 1.0) < 0.3;
    // one half linear, the other half slips at a limit between 8 and 24 N if the contact force
    // reaches it
    config.contact.friction_coefficient = 0.5;
    config.contact.normal_load_n = between(8.0, 24.0) / 0.5;
    config.contact.iwan.spread = between(0.3, 0.95);
    config.contact.law = match seed % 4 {
        0 | 1 => ContactLaw::Linear,
        2 => ContactLaw::Jenkins,
        _ => ContactLaw::Iwan,
    };
    // a stiff contact between light bodies needs a smaller step
    if Rig::new(&config, seed).is_err() {
        config.contact.slip_step_s = 1e-6;
    }
    config
}

/// Two good hits in each cell, the second on the residual motion of the first.
fn measured(config: &RigConfig, seed: u64) -> Campaign {
    let mut rig = Rig::new(config, seed).expect("a rig");
    let scale: Vec<f64> = rig.channels().iter().map(|c| c.step() * f64::from(c.polarity)).collect();
    let fs_hz = f64::from(rig.scan_rate_hz());
    let (mut cells, mut slid_m) = (Vec::new(), 0.0f64);
    let mut codes = [0; 10];
    for impact in IMPACTS {
        for response in RESPONSES {
            rig.stage(Configuration::Ajb, impact, response, 0).expect("a cell");
            let mut hits = Vec::new();
            while hits.len() < 2 {
                let before = rig.joint().expect("the assembly").slid_m;
                rig.fire(PULSE_S);
                let mut signals: [Vec<f64>; 4] = Default::default();
                let mut energy_j = 0.0f64;
                for _ in 0..RECORD {
                    rig.scan(&mut codes);
                    energy_j = energy_j.max(rig.energy_j());
                    let si = |at: usize| f64::from(codes[at]) * scale[at];
                    let now = [si(0), si(6) + si(7) + si(8), si(4), si(5)];
                    signals.iter_mut().zip(now).for_each(|(all, value)| all.push(value));
                }
                if rig.last_hit().expect("fired").mishap == Mishap::None {
                    slid_m = slid_m.max(rig.joint().expect("the assembly").slid_m - before);
                    let [force, t, a, b] = &signals;
                    let hit = HitResponse::of(&HitSignals {
                        fs_hz,
                        hammer_n: force,
                        contact: [t, a, b],
                        delay_s: [0.0, config.sensors.ldv_a.delay_s, config.sensors.ldv_b.delay_s],
                    });
                    hits.push(hit.expect("a pulse"));
                }
                quieten(&mut rig, (impact, response), energy_j);
            }
            cells.push((impact, hits));
        }
    }
    let contact = &config.contact;
    let about = format!(
        "{:?} {:.0} N/µm, μN {:.0} N, rigid {}",
        contact.law,
        contact.stiffness_n_per_m[2] * 1e-6,
        contact.friction_coefficient * contact.normal_load_n,
        config.clamp.rigid
    );
    Campaign { cells, slid_m, about }
}

/// Waits as the runner does, until 0.3 % of the hit's motion remains; after a mishap the cell is
/// staged again.
fn quieten(rig: &mut Rig, (impact, response): (&str, &str), energy_j: f64) {
    let mut codes = [0; 10];
    if rig.last_hit().is_some_and(|hit| hit.mishap != Mishap::None) {
        let attempt = rig.attempt();
        rig.stage(Configuration::Ajb, impact, response, attempt).expect("the same cell");
    }
    let mut waited = 0;
    while waited < SLOWEST && rig.energy_j() > LEFT * LEFT * energy_j {
        (0..512).for_each(|_| rig.scan(&mut codes));
        waited += 512;
    }
}

/// Results of campaigns with an unambiguous truth.
#[derive(Debug, Default, Clone, Copy)]
struct Tally {
    slipping: usize,
    found: usize,
    stuck: usize,
    called_stuck: usize,
    cannot_tell: usize,
}

impl Tally {
    fn add(mut self, campaign: &Campaign) -> Self {
        let verdict = campaign.verdict();
        println!("{}: slid {:.1} nm: {verdict:?}", campaign.about, campaign.slid_m * 1e9);
        self.cannot_tell += usize::from(verdict.found().is_none());
        if campaign.slid_m > MUCH_M {
            self.slipping += 1;
            self.found += usize::from(verdict.found() == Some(true));
        } else if campaign.slid_m < NOTHING_M {
            self.stuck += 1;
            self.called_stuck += usize::from(verdict.found() == Some(false));
        }
        self
    }

    fn of(seeds: std::ops::Range<u64>) -> Self {
        let campaigns: Vec<Campaign> = seeds.into_par_iter().map(|seed| measured(&rig(seed), seed)).collect();
        campaigns.iter().fold(Self::default(), Self::add)
    }
}

#[test]
fn slip_is_told_from_stick_on_rigs_of_all_kinds() {
    let tally = Tally::of(1000..1012);
    assert!(tally.slipping >= 3 && tally.stuck >= 5, "{tally:?}");
    assert_eq!((tally.found, tally.called_stuck), (tally.slipping, tally.stuck), "{tally:?}");
}

#[test]
#[ignore = "a hundred campaigns; minutes"]
fn slip_is_told_from_stick_over_a_hundred_campaigns() {
    let tally = Tally::of(0..100);
    println!("{tally:?}");
    let right = tally.found + tally.called_stuck;
    assert!(right * 100 >= 95 * (tally.slipping + tally.stuck), "{tally:?}");
}

/// Hits that are all alike contain no information, and neither do a few of them.
#[test]
fn what_cannot_be_told_is_said() {
    let mut config = rig(4);
    config.hammer.speed_scatter = 0.0;
    config.hammer.width_scatter = 0.0;
    config.hammer.warming = 0.0;
    config.sensors.load_cells.noise_n = 0.1;
    let mut campaign = measured(&config, 4);
    let verdict = campaign.verdict();
    assert!(matches!(verdict, HammerSlip::CannotTell(Unclear::TooAlike { .. })), "{verdict:?}");
    campaign.cells.truncate(6);
    let verdict = campaign.verdict();
    assert!(matches!(verdict, HammerSlip::CannotTell(Unclear::TooFewHits { .. })), "{verdict:?}");
}
