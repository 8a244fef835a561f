//! Simulated seconds per second of the whole device: stuck rig, ten channels, firmware, frames, link, a host
//! that decodes every frame. Baseline in the same run: the rig's physics alone.
//!
//! Seconds here are seconds of processor time, all threads together, so that the figure is that of one
//! core and a busy machine does not change it much. `cargo bench -p jointrig-hil-sim --bench chain`

#[path = "../tests/support/mod.rs"]
mod support;

use std::time::Instant;

use jointrig_hil_sim::board::VirtualBoard;
use jointrig_hil_sim::rig::{Configuration, Rig, RigConfig};
use jointrig_protocol::request;
use support::SmallHost;

/// Simulated seconds of each run.
const SIMULATED_S: u64 = 40;
const RATE_HZ: u64 = 51_200;

/// Processor time of this process in s where the system tells it, else wall time since `begun`.
fn processor_s(begun: Instant) -> (f64, &'static str) {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let nanoseconds: u64 = tasks
        .filter_map(|task| std::fs::read_to_string(task.path().join("schedstat")).ok())
        .filter_map(|text| text.split_whitespace().next()?.parse::<u64>().ok())
        .sum();
    if nanoseconds > 0 {
        (nanoseconds as f64 * 1e-9, "processor")
    } else {
        (begun.elapsed().as_secs_f64(), "wall")
    }
}

/// Simulated seconds per second of `run`.
fn measure(run: impl FnOnce()) -> (f64, &'static str) {
    let begun = Instant::now();
    let (before, _) = processor_s(begun);
    run();
    let (after, clock) = processor_s(begun);
    (SIMULATED_S as f64 / (after - before), clock)
}

fn main() {
    let config = RigConfig::default();
    let (rig, clock) = measure(|| {
        let mut rig = Rig::new(&config, 1).expect("the built-in rig is sound");
        rig.stage(Configuration::Ajb, "AZ3", "B3", 0).expect("the built-in rig has this cell");
        let mut codes = [0; 10];
        for scan in 0..SIMULATED_S * RATE_HZ {
            if scan % (2 * RATE_HZ) == 0 {
                rig.fire(3.5e-3);
            }
            rig.scan(&mut codes);
        }
        std::hint::black_box(codes);
    });
    let packets = chain(true);
    let cobs = chain(false);
    println!("rig alone:                      {rig:7.1} simulated seconds per {clock} second");
    println!("the whole chain, in packets:    {packets:7.1}, {:.2} of the rig alone", packets / rig);
    println!("the whole chain, in COBS:       {cobs:7.1}, {:.2} of the rig alone", cobs / rig);
}

/// Simulated seconds per second of rig, firmware, frames and host; frames in packets, as USB and `sim:` carry them, or in COBS.
fn chain(packets: bool) -> f64 {
    let (board, link) = VirtualBoard::start(None, 1).expect("the built-in rig is sound");
    let mut host = SmallHost::reading(link, packets);
    let (chain, _) = measure(|| {
        host.start();
        let mut from = host.stage(request::Configuration::Ajb, "AZ3", "B3", 0);
        for number in 1..=SIMULATED_S as u32 / 2 {
            let shot = host.shoot(SmallHost::order(number, 3_500, from + host.lead()));
            from = shot.trigger + RATE_HZ;
            host.codes.clear();
            host.first_scan = host.next_scan;
        }
        // the last shot's record is held to its end
        host.release();
        let end = SIMULATED_S * RATE_HZ;
        while host.next_scan < end {
            host.pump();
            host.codes.clear();
        }
    });
    drop(board);
    chain
}
