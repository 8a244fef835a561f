//! Observers do not allocate memory in the measuring thread: neither the tap on the stream nor the
//! live page's watcher.
//!
//! A single test in a separate program, because the counting allocator is global.
#![cfg(feature = "dashboard")]
#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use jointrig::campaign::plan::SMALL;
use jointrig::campaign::store::Store;
use jointrig::campaign::watch::{Seen, Shaking, Standing, Watch};
use jointrig::device::samples::Samples;
use jointrig::device::stream::Accounts;
use jointrig::device::tap::tap;
use jointrig::live::watching::{room, watcher};
use peak_alloc::PeakAlloc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Peak of the memory allocated while `work` ran, beyond the initial usage: even one byte that was
/// allocated and freed counts.
fn allocated(work: impl FnOnce()) -> usize {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    work();
    MEMORY.peak_usage().saturating_sub(before)
}

#[test]
fn watching_allocates_nothing_on_the_measuring_thread() {
    assert!(allocated(|| drop(std::hint::black_box(vec![0_u8; 64]))) >= 64, "the allocator counts");

    // ten channels, blocks of 24 scans, ten seconds; a page takes an envelope on its own thread
    // whenever there is one
    let (mut tap, mut view) = tap();
    tap.begin(10, 10, 0, 51_200.0);
    let block: Vec<i16> = (0..240).map(|n| n * 7 - 800).collect();
    let over = AtomicBool::new(false);
    let (looks, used) = std::thread::scope(|scope| {
        let looks = scope.spawn(|| {
            let mut looks = 0_u64;
            while !over.load(Ordering::Relaxed) {
                looks += u64::from(view.next(Duration::from_millis(1)).is_some());
            }
            looks
        });
        // the other thread allocates while it starts
        std::thread::sleep(Duration::from_millis(50));
        let used = allocated(|| {
            for n in 0..21_333 {
                tap.fold(&block);
                if n % 1_000 == 0 {
                    tap.skip(100);
                }
            }
        });
        over.store(true, Ordering::Relaxed);
        (looks.join().unwrap(), used)
    });
    assert!(looks > 0, "nobody looked");
    assert_eq!(used, 0, "bytes for the tap");

    let folder = tempfile::tempdir().unwrap();
    let store = Store::create(&folder.path().join("a.jrig"), SMALL, "small.toml").unwrap();
    let cells = store.cells().unwrap();
    let (watcher, ear) = watcher();
    let mut cycles = room();
    let samples = Samples::of_codes(&vec![1; 51_200], 10);
    let used = allocated(|| {
        for attempts in 0..5_000 {
            let (row, standing) = (&cells[0], Standing { kept: 1, attempts });
            watcher.saw(&Seen::Settling { row, standing, most_s: 25.0, by_hand: false });
            watcher.saw(&Seen::Recording);
            watcher.saw(&Seen::Judging);
            watcher.saw(&Seen::Link(Accounts::default()));
            watcher.saw(&Seen::Shaking(Shaking {
                at_s: 0.1,
                amplitude: 1e-7,
                drive_v: 0.1,
                settled: false,
                samples: &samples,
            }));
            // messages are received now and then; most of the time the queue is full
            if attempts % 100 == 0 {
                assert!(ear.cycles(&mut cycles) && ear.queue.try_recv().is_ok());
            }
        }
    });
    assert_eq!(used, 0, "bytes for the watcher");
    assert_eq!(cycles.len(), 51_200);
}
