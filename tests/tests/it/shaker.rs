//! A host that is killed while shaking: the shaker comes to rest, the file is intact, and the same
//! command continues.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use jointrig::campaign::store::Store;
use jointrig::campaign::store::codec;
use jointrig::campaign::store::level_table::LevelRow;
use jointrig_tests::command::{Served, jointrig};

/// Frequency and checksum of every level in the file.
fn levels(file: &Path) -> Vec<(f64, u32)> {
    let store = Store::open_read_only(file).unwrap();
    let rows: Vec<LevelRow> = store.levels().unwrap().into_iter().collect::<Result<_, _>>().unwrap();
    assert!(rows.iter().all(LevelRow::whole));
    let crc = |row| codec::checksum(&store.level_samples(row).unwrap());
    rows.iter().map(|row| (row.level().frequency_hz, crc(row))).collect()
}

/// Four levels of half a minute of the device's time each: long enough to be killed during them.
fn shaker(file: &Path, address: &str) -> Command {
    let mut command = jointrig();
    command.arg("shaker").arg(file).args(["--device", address, "--yes", "--seconds", "30"]);
    command.args(["--freq", "100", "250", "300", "350", "--amplitude", "1e-7"]);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

#[test]
fn killed_in_mid_shake_nothing_moves_on_and_nothing_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.jrig");
    let plan = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/plans/small.toml");
    let made = jointrig().args(["campaign", "new"]).arg(&file).arg("--plan").arg(plan).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let rig = Served::start(&["--tcp", "127.0.0.1:0"]);

    let mut child = shaker(&file, &rig.address).spawn().unwrap();
    let begun = Instant::now();
    while levels(&file).is_empty() {
        assert!(begun.elapsed() < Duration::from_mins(2), "no level came");
        assert!(child.try_wait().unwrap().is_none(), "it must not end before it is killed");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let before = levels(&file);
    assert!((1..4).contains(&before.len()), "{before:?}");

    let info = jointrig().args(["info", "--json", "--device", &rig.address]).output().unwrap();
    let said = String::from_utf8_lossy(&info.stdout);
    assert!(info.status.success(), "{}", String::from_utf8_lossy(&info.stderr));
    assert!(said.contains("\"Resting\"") || said.contains("\"Stopping\""), "{said}");

    let verified = jointrig().args(["campaign", "verify", "--deep"]).arg(&file).status().unwrap();
    assert!(verified.success());
    assert!(shaker(&file, &rig.address).status().unwrap().success());
    let after = levels(&file);
    assert_eq!(after[..before.len()], before[..], "what was stored stays as it is");
    assert_eq!(after.iter().map(|(f, _)| *f).collect::<Vec<_>>(), [100.0, 250.0, 300.0, 350.0]);
}
