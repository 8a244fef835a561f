//! A campaign that is killed repeatedly loses nothing, and ends like an undisturbed one.
//!
//! `JOINTRIG_KILLS` sets how often it is killed (25), `JOINTRIG_SEED` repeats the kill times of an
//! earlier run.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use jointrig::campaign::store::Store;
use jointrig::campaign::store::codec;
use jointrig_tests::campaign::rows;
use jointrig_tests::command::jointrig;

/// By cell and attempt: verdict, measure, and the checksum of every code.
type Content = BTreeMap<(i64, u32), (String, String, u32)>;

fn content(file: &Path) -> Content {
    let store = Store::open_read_only(file).unwrap();
    let row = |row: &jointrig::campaign::store::record_table::RecordRow| {
        let crc = codec::checksum(&store.samples(row).unwrap());
        ((row.cell, row.attempt), (row.verdict.name().to_owned(), format!("{:?}", row.measure), crc))
    };
    rows(&store).iter().map(row).collect()
}

fn command(file: &Path) -> std::process::Command {
    let mut command = jointrig();
    command.args(["campaign", "run"]).arg(file).args(["--device", "sim:", "--seed", "11"]);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

fn new(file: &Path, plan: &Path) {
    let made = jointrig().args(["campaign", "new"]).arg(file).arg("--plan").arg(plan).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
}

fn number(variable: &str) -> Option<u64> {
    std::env::var(variable).ok().and_then(|text| text.parse().ok())
}

/// splitmix64
fn draw(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[test]
fn killed_at_random_instants_it_ends_as_if_undisturbed() {
    let folder = tempfile::tempdir().unwrap();
    // more hits than the plan of few cells has, so that a cell is often interrupted in its middle
    let small = include_str!("../../../docs/plans/small.toml").replace("wanted = 2", "wanted = 5");
    let plan = folder.path().join("plan.toml");
    std::fs::write(&plan, small).unwrap();

    let whole = folder.path().join("whole.jrig");
    new(&whole, &plan);
    let begun = std::time::Instant::now();
    assert!(command(&whole).status().unwrap().success());
    let takes = begun.elapsed();
    let undisturbed = content(&whole);

    let kills = number("JOINTRIG_KILLS").unwrap_or(25);
    let seed = number("JOINTRIG_SEED").unwrap_or_else(|| {
        std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().subsec_nanos().into()
    });
    println!("JOINTRIG_SEED={seed} repeats these instants; undisturbed it takes {takes:?}");
    let mut state = seed;

    let mut file = folder.path().join("killed0.jrig");
    new(&file, &plan);
    let mut seen = Content::new();
    let (mut kill, mut struck, mut campaigns) = (0, 0, 1);
    // a run that ended before the kill does not count
    while struck < kills {
        kill += 1;
        assert!(kill < 4 * kills, "the instants must strike");
        // any time from the first bytes to a good part of the campaign
        let instant = takes.mul_f64(0.25 * (draw(&mut state) % 10_000) as f64 / 10_000.0);
        let mut child = command(&file).spawn().unwrap();
        std::thread::sleep(instant);
        let ended_before = child.try_wait().unwrap();
        child.kill().unwrap();
        child.wait().unwrap();
        struck += u64::from(ended_before.is_none());

        let verified = jointrig().args(["campaign", "verify", "--deep"]).arg(&file).output().unwrap();
        let said = String::from_utf8_lossy(&verified.stdout).into_owned();
        assert!(verified.status.success(), "seed {seed}, kill {kill} after {instant:?}: {said}");
        let now = content(&file);
        for (place, record) in &seen {
            assert_eq!(
                now.get(place),
                Some(record),
                "seed {seed}, kill {kill}: {place:?} is gone or changed"
            );
        }
        for (place, record) in &now {
            assert_eq!(undisturbed.get(place), Some(record), "seed {seed}, kill {kill}: {place:?} differs");
        }
        seen = now;
        if ended_before.is_some_and(|status| status.success()) {
            // complete despite the kills: continue with a new one, so that every kill interrupts
            // something
            assert_eq!(seen, undisturbed);
            file = folder.path().join(format!("killed{campaigns}.jrig"));
            new(&file, &plan);
            seen = Content::new();
            campaigns += 1;
        }
    }
    assert!(command(&file).status().unwrap().success());
    assert_eq!(content(&file), undisturbed, "seed {seed}");
    println!("{struck} of {kill} kills struck a running campaign; {campaigns} campaigns");
}

#[test]
fn an_interrupt_from_the_keyboard_closes_the_file_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let plan = folder.path().join("plan.toml");
    let small = include_str!("../../../docs/plans/small.toml").replace("wanted = 2", "wanted = 8");
    std::fs::write(&plan, small).unwrap();
    let file = folder.path().join("a.jrig");
    new(&file, &plan);
    let mut child = command(&file).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(1_500));
    let interrupted = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(interrupted.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(1), "it was not complete");
    assert!(!content(&file).is_empty());
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 2, "one file beside the plan: {left:?}");
}
