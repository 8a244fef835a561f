//! The same seed gives the same records over any transport and with any losses on the link.
#![allow(clippy::unwrap_used)]

use jointrig::device::address::Address;
use jointrig::device::samples::SampleType;
use jointrig::device::transport::Transport;
use jointrig_tests::campaign::{Kept, by_hand, plan, run};
use jointrig_tests::command::{Served, binary};

#[path = "../../../host/tests/it/scripted_device/faulty.rs"]
mod faulty;
use faulty::{Faults, Faulty};

/// Four cells of all three configurations, two good hits each; A must wait until it is quiet.
fn few_cells() -> String {
    plan(2, &[("A", &["AZ3"], &["A3"]), ("B", &["BY1"], &["B4"]), ("AJB", &["AZ3"], &["A3", "B3"])])
}

fn open(address: &str, seed: u64) -> Box<dyn Transport> {
    address.parse::<Address>().unwrap().open(seed).unwrap()
}

fn over(transport: Box<dyn Transport>) -> Vec<Kept> {
    let folder = tempfile::tempdir().unwrap();
    let (summary, records) = run(&folder.path().join("c.jrig"), &few_cells(), transport);
    assert_eq!((summary.kept, summary.given_up), (8, 0));
    assert_eq!(summary.accounts.unexplained(), 0, "{:?}", summary.accounts);
    records
}

#[test]
fn the_same_seed_gives_the_same_records_and_another_does_not() {
    let first = over(open("sim:", 7));
    assert_eq!(first, over(open("sim:", 7)));
    assert_ne!(first, over(open("sim:", 8)));
}

#[test]
fn a_link_that_drops_and_damages_one_frame_in_a_hundred_changes_nothing() {
    let faults = Faults { drop: 0.005, corrupt: 0.005, ..Faults::default() };
    let spoilt = Faulty::new(open("sim:", 7), faults, 99);
    let folder = tempfile::tempdir().unwrap();
    let (summary, records) = run(&folder.path().join("c.jrig"), &few_cells(), Box::new(spoilt));
    let accounts = summary.accounts;
    assert_eq!(accounts.unexplained(), 0, "{accounts:?}");
    assert!(accounts.recovered > 0, "the link must have lost something: {accounts:?}");
    assert_eq!(accounts.lost, 0, "{accounts:?}");
    assert_eq!(records, over(open("sim:", 7)));
}

#[test]
#[cfg(unix)]
fn a_pseudo_terminal_carries_the_same_records() {
    let served = Served::start(&["--pty", "--seed", "7"]);
    assert!(served.address.starts_with("serial:/dev/"), "{}", served.address);
    assert_eq!(over(open(&served.address, 0)), over(open("sim:", 7)));
}

#[test]
fn a_socket_carries_the_same_records() {
    let served = Served::start(&["--tcp", "127.0.0.1:0", "--seed", "7"]);
    assert_eq!(over(open(&served.address, 0)), over(open("sim:", 7)));
}

/// The by-hand rig's codes as a recorder's blocks, and its volts: an operator strikes twice in each
/// cell.
#[test]
#[cfg(unix)]
fn a_bridge_carries_the_same_records() {
    let cells = by_hand(2, &[("A", &["AZ3"], &["A3"]), ("AJB", &["AZ3"], &["A3", "B3"])]);
    // the operator strikes every 4 s, whether or not the structure is at rest
    let cells = cells.replace("quiet_relative = 0.003", "quiet_relative = 0.9");
    let rig = include_str!("../../../hil-sim/rigs/by-hand.toml");
    let over = |address: &str| {
        let folder = tempfile::tempdir().unwrap();
        let (summary, records) = run(&folder.path().join("c.jrig"), &cells, open(address, 7));
        assert_eq!((summary.kept, summary.hits), (6, 6));
        assert_eq!((summary.accounts.unexplained(), summary.accounts.lost), (0, 0), "{:?}", summary.accounts);
        records
    };
    let play = binary("JOINTRIG_HIL_SIM_BIN").display().to_string();
    let folder = tempfile::tempdir().unwrap();
    for (bits, of) in [(16, SampleType::I16), (24, SampleType::I32)] {
        let path = folder.path().join(format!("{bits}.toml"));
        std::fs::write(&path, format!("{rig}\n[sensors]\nbits = {bits}\n")).unwrap();
        let path = path.display();
        let direct = over(&format!("sim:{path}"));
        assert!(direct[0].samples.types().iter().all(|own| *own == of), "{:?}", direct[0].samples.types());
        for how in ["--block 1000", "--block 5120 --volts"] {
            let bridge = format!(
                "bridge:{play} play --rig {path} --seed 7 --hits 2 --visit A/AZ3/A3 --visit AJB/AZ3/A3 --visit AJB/AZ3/B3 {how}"
            );
            assert_eq!(over(&bridge), direct, "{bits} bits, {how}");
        }
    }
}
