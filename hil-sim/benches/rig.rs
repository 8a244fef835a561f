//! Throughput of a whole scan, in simulated seconds per second: the modal stepper compared with the
//! baseline, the matrix exponential.
//!
//! Run with `cargo bench -p jointrig-hil-sim --bench rig`. One item is one simulated second, so
//! items per second is the ratio to real time at 51.2 kHz.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use jointrig_hil_sim::rig::{CHANNELS, Configuration, Rig, RigConfig, Stepping};

/// Scans of the default rig in one second.
const SECOND: u64 = 51_200;

fn main() {
    divan::main();
}

/// One record: fire, then two seconds of decay.
#[divan::bench(args = ["A", "B", "AJB"])]
fn record_modal(bencher: Bencher, configuration: &str) {
    let mut rig = Rig::new(&RigConfig::default(), 1).expect("the default rig stands");
    record(bencher, &mut rig, configuration, 2);
}

/// The same with the matrix exponential, for half the time.
#[divan::bench(args = ["A", "B", "AJB"], sample_count = 10)]
fn record_exponential(bencher: Bencher, configuration: &str) {
    let config = RigConfig::default();
    let mut rig = Rig::with_stepping(&config, 1, Stepping::Exponential).expect("the default rig stands");
    record(bencher, &mut rig, configuration, 1);
}

/// A record of the assembly with rigid bodies, and with specimens and arms that bend, staging
/// included.
#[divan::bench(args = ["rigid", "elastic"])]
fn record_of(bencher: Bencher, bodies: &str) {
    let mut rig = Rig::new(&with(bodies), 1).expect("a shipped rig stands");
    record(bencher, &mut rig, "AJB", 2);
}

/// Preparation of a rig: its structures and their modes.
#[divan::bench(args = ["rigid", "elastic"], sample_count = 10)]
fn new_rig(bencher: Bencher, bodies: &str) {
    let config = with(bodies);
    bencher.bench_local(|| Rig::new(black_box(&config), 1).expect("a shipped rig stands"));
}

fn with(bodies: &str) -> RigConfig {
    let text = if bodies == "elastic" { include_str!("../rigs/elastic.toml") } else { "" };
    RigConfig::from_toml(text).expect("a shipped rig stands")
}

/// Every mode is driven in every scan, so that no mode decays.
#[divan::bench(args = ["rigid", "elastic"])]
fn shaker_modal(bencher: Bencher, bodies: &str) {
    let mut rig = Rig::new(&with(bodies), 1).expect("a shipped rig stands");
    let mut codes = [0_i16; CHANNELS];
    bencher.counter(ItemsCount::new(1_u64)).bench_local(|| {
        for scan in 0..SECOND {
            rig.drive(if scan % 256 < 128 { 1.0 } else { -1.0 });
            rig.scan(&mut codes);
            black_box(&codes);
        }
    });
}

/// The contact in gross slip at 30 Hz: every scan is divided into steps.
#[divan::bench(args = ["stuck", "jenkins", "iwan"])]
fn shaker_slip(bencher: Bencher, case: &str) {
    let text =
        if case == "iwan" { include_str!("../rigs/iwan.toml") } else { include_str!("../rigs/jenkins.toml") };
    let config = RigConfig::from_toml(text).expect("a shipped rig stands");
    let mut rig = Rig::new(&config, 1).expect("a shipped rig stands");
    let volts = if case == "stuck" { 0.1 } else { 5.0 };
    let mut codes = [0_i16; CHANNELS];
    bencher.counter(ItemsCount::new(1_u64)).bench_local(|| {
        for scan in 0..SECOND {
            let angle = std::f64::consts::TAU * 30.0 * scan as f64 / SECOND as f64;
            rig.drive(volts * angle.sin());
            rig.scan(&mut codes);
            black_box(&codes);
        }
    });
    let slid_m = rig.joint().map_or(0.0, |joint| joint.slid_m);
    assert_eq!(slid_m > 0.0, case != "stuck", "it slides where it should");
}

fn record(bencher: Bencher, rig: &mut Rig, configuration: &str, seconds: u64) {
    let configuration = match configuration {
        "A" => Configuration::A,
        "B" => Configuration::B,
        _ => Configuration::Ajb,
    };
    let (impact, response) = if configuration == Configuration::B { ("BZ3", "B3") } else { ("AZ3", "A3") };
    let mut codes = [0_i16; CHANNELS];
    bencher.counter(ItemsCount::new(seconds)).bench_local(|| {
        rig.stage(configuration, impact, response, 0).expect("the default rig has this cell");
        rig.fire(3.5e-3);
        for _ in 0..seconds * SECOND {
            rig.scan(&mut codes);
            black_box(&codes);
        }
    });
}
