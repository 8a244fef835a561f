//! The whole simulated device (rig, firmware, frames, link, a host that decodes every frame)
//! compared with its rig alone.
//!
//! Seconds here are seconds of processor time of all threads together, so that the result is that
//! of one core.

#[allow(missing_docs, reason = "test support")]
#[path = "../../hil-sim/tests/it/support/mod.rs"]
mod support;

use super::row::{Row, in_turns};
use jointrig_hil_sim::board::VirtualBoard;
use jointrig_hil_sim::rig::{Configuration, Rig, RigConfig};
use jointrig_protocol::request;
use std::error::Error;
use std::time::Instant;
use support::SmallHost;

/// Simulated seconds of each run.
const SIMULATED_S: u64 = 40;
const RATE_HZ: u64 = 51_200;
const RUNS: usize = 3;
/// Target for the whole device: simulated seconds per processor second.
const WANTED: f64 = 120.0;

/// A row for each way of framing, and messages about what misses the target.
pub fn rows() -> Result<(Vec<Row>, Vec<String>), Box<dyn Error>> {
    let config = RigConfig::default();
    let (mut best, mut failed) = ([f64::INFINITY; 3], None);
    in_turns(RUNS, best.len(), |job| {
        let seconds = match job {
            0 => rig(&config),
            1 => chain(true),
            _ => chain(false),
        };
        match seconds {
            Ok(seconds) => best[job] = best[job].min(seconds),
            Err(error) => failed = Some(error),
        }
    });
    if let Some(error) = failed {
        return Err(error);
    }
    let [alone, packets, cobs] = best;
    let row = |name: &str, seconds: f64| {
        let pace = SIMULATED_S as f64 / seconds;
        Row::of(
            format!("{SIMULATED_S} simulated seconds, frames in {name} (processor time; {pace:.0} : 1)"),
            seconds,
        )
        .against("the rig alone", alone, None)
    };
    let pace = SIMULATED_S as f64 / packets;
    let short = (pace < WANTED)
        .then(|| format!("the chain: {pace:.0} simulated seconds per processor second, wanted {WANTED}"));
    Ok((vec![row("packets", packets), row("COBS", cobs)], short.into_iter().collect()))
}

/// Processor time of this process in s if the system reports it, otherwise wall time since `begun`.
fn processor_s(begun: Instant) -> f64 {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let nanoseconds: u64 = tasks
        .filter_map(|task| std::fs::read_to_string(task.path().join("schedstat")).ok())
        .filter_map(|text| text.split_whitespace().next()?.parse::<u64>().ok())
        .sum();
    if nanoseconds > 0 { nanoseconds as f64 * 1e-9 } else { begun.elapsed().as_secs_f64() }
}

/// Processor seconds of `run`.
fn measure(run: impl FnOnce()) -> f64 {
    let begun = Instant::now();
    let before = processor_s(begun);
    run();
    processor_s(begun) - before
}

fn rig(config: &RigConfig) -> Result<f64, Box<dyn Error>> {
    let mut rig = Rig::new(config, 1)?;
    rig.stage(Configuration::Ajb, "AZ3", "B3", 0)?;
    Ok(measure(|| {
        let mut codes = [0; 10];
        for scan in 0..SIMULATED_S * RATE_HZ {
            if scan % (2 * RATE_HZ) == 0 {
                rig.fire(3.5e-3);
            }
            rig.scan(&mut codes);
        }
        std::hint::black_box(codes);
    }))
}

/// With frames in packets, as over USB and `sim:`, or in COBS.
fn chain(packets: bool) -> Result<f64, Box<dyn Error>> {
    let (board, link) = VirtualBoard::start(None, 1)?;
    let mut host = SmallHost::reading(link, packets);
    let seconds = measure(|| {
        host.start();
        let mut from = host.stage(request::Configuration::Ajb, "AZ3", "B3", 0);
        for number in 1..=SIMULATED_S as u32 / 2 {
            let shot = host.shoot(SmallHost::order(number, 3_500, from + host.lead()));
            from = shot.trigger + RATE_HZ;
            host.codes.clear();
            host.first_scan = host.next_scan;
        }
        // the last shot held the board at the end of its record
        host.release();
        let end = SIMULATED_S * RATE_HZ;
        while host.next_scan < end {
            host.pump();
            host.codes.clear();
        }
    });
    drop(board);
    Ok(seconds)
}
