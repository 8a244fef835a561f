//! A whole campaign for the contact's stiffness, measured live from another program: the simulated
//! rig's volts over the bridge give the same k_T as `sim:`, although the host is killed in the
//! middle and scans are lost within a hit.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use jointrig::campaign::store::Store;
use jointrig::device::address::Address;
use jointrig_tests::campaign::{self, records};
use jointrig_tests::command::{binary, jointrig};
use jointrig_tests::live::done;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const RIG: &str = include_str!("../../../hil-sim/rigs/accelerometers.toml");
const PLAN: &str = include_str!("../../../docs/plans/contact-by-hand.toml");
/// A hit that is refused would be missing when the operator of `play` goes on.
const NO_MISHAPS: &str = "\n[hammer.mishaps]\ndouble_hit = 0.0\nweak = 0.0\noverload = 0.0\n";
/// The operator strikes this often, s.
const EVERY_S: f64 = 4.0;
const RATE_HZ: f64 = 51_200.0;
/// Good hits in each place, in place of ten.
const WANTED: u32 = 3;
/// The plan's places in the order in which the runner walks through them.
const PLACES: [&str; 13] = [
    "B/BZ1/NB1",
    "B/BZ2/NB3",
    "B/BZ3/NB1",
    "B/BY1/NB3",
    "B/BY2/NB1",
    "B/BY3/NB3",
    "B/BX1/NB1",
    "B/BX2/NB3",
    "B/BX3/NB1",
    "AJB/AZ1/NA1",
    "AJB/AZ2/NB3",
    "AJB/AZ3/NA1",
    "AJB/I_MZ/NB3",
];
/// The place with the damaged hit.
const DAMAGED: usize = 11;
const LOST: u64 = 100;

/// The operator's way after so many good hits; in the place of the damaged hit there is one more.
fn way(good: usize) -> Vec<(&'static str, u32)> {
    let (first, rest) = (good / WANTED as usize, good as u32 % WANTED);
    let hits = |place: usize| WANTED - if place == first { rest } else { 0 } + u32::from(place == DAMAGED);
    (first..PLACES.len()).map(|place| (PLACES[place], hits(place))).collect()
}

/// Half a second after the first hit in the damaged place: scans since the beginning of this way.
fn scan_of_the_loss(way: &[(&str, u32)]) -> u64 {
    let before = way.iter().take_while(|(place, _)| *place != PLACES[DAMAGED]);
    let scans: u64 = before.map(|(_, hits)| ((f64::from(*hits) + 0.9) * EVERY_S * RATE_HZ) as u64).sum();
    scans + ((EVERY_S + 0.5) * RATE_HZ) as u64
}

/// The arguments of `jointrig-hil-sim` that play this way with volts in single precision.
fn play(rig: &Path, way: &[(&str, u32)]) -> Vec<String> {
    let rig = rig.display().to_string();
    let mut all: Vec<String> = ["play", "--rig", &rig, "--seed", "1", "--volts"].map(Into::into).into();
    all.extend(way.iter().flat_map(|(place, hits)| ["--visit".into(), format!("{place}:{hits}")]));
    all
}

/// Plays the rig to the first program that connects, and reports scans as lost in the block after
/// this scan.
fn served(rig: &Path, way: &[(&str, u32)], lose_at: u64) -> (String, std::thread::JoinHandle<()>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("bridge:tcp:{}", listener.local_addr().unwrap());
    let mut program = Command::new(binary("JOINTRIG_HIL_SIM_BIN"))
        .args(play(rig, way))
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let relay = std::thread::spawn(move || {
        let (mut peer, _) = listener.accept().unwrap();
        let mut from = BufReader::new(program.stdout.take().unwrap());
        let mut header = String::new();
        from.read_line(&mut header).unwrap();
        let scan_bytes = 4 * header.matches("\"role\"").count();
        peer.write_all(header.as_bytes()).unwrap();
        let (mut scans, mut lost) = (0_u64, false);
        loop {
            let mut block = vec![0; 24];
            from.read_exact(&mut block).unwrap();
            let count = u32::from_le_bytes(*block[4..].first_chunk().unwrap());
            if scans >= lose_at && !std::mem::replace(&mut lost, true) {
                block[8..16].copy_from_slice(&LOST.to_le_bytes());
            }
            scans += u64::from(count);
            block.resize(24 + count as usize * scan_bytes, 0);
            from.read_exact(&mut block[24..]).unwrap();
            // the host ends the connection when it has what it wants
            if peer.write_all(&block).is_err() {
                break;
            }
        }
        drop(from);
        program.wait().unwrap();
    });
    (address, relay)
}

/// k_T, and its interval, N/m.
fn found(file: &Path, out: &Path) -> (f64, [f64; 2]) {
    done(jointrig().arg("analyse").arg(file).arg("--out").arg(out));
    let results: Value = serde_json::from_slice(&std::fs::read(out.join("results.json")).unwrap()).unwrap();
    let k = &results["answer"]["contact"]["k_t_n_per_m"];
    (k["mean"].as_f64().unwrap(), [0, 1].map(|end| k["ci95"][end].as_f64().unwrap()))
}

#[test]
fn a_contact_campaign_over_the_bridge_gives_the_k_t_of_the_rig_itself() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let plan = PLAN.replace("wanted = 10", "wanted = 3").replace("minimum = 4", "minimum = 3");
    std::fs::write(at("rig.toml"), format!("{RIG}{NO_MISHAPS}")).unwrap();
    std::fs::write(at("plan.toml"), &plan).unwrap();
    for file in ["sim.jrig", "lab.jrig"] {
        done(jointrig().args(["campaign", "new"]).arg(at(file)).arg("--plan").arg(at("plan.toml")));
    }
    let sim = format!("sim:{}", at("rig.toml").display());
    done(jointrig().args(["campaign", "run", "--yes", "--device", &sim]).arg(at("sim.jrig")));

    // the host is killed somewhere in configuration B
    let file = at("lab.jrig");
    let words = shlex::try_join(play(&at("rig.toml"), &way(0)).iter().map(String::as_str)).unwrap();
    let device = format!("bridge:{} {words}", binary("JOINTRIG_HIL_SIM_BIN").display());
    let mut host = jointrig();
    host.args(["campaign", "run", "--yes", "--device", &device]).arg(&file);
    let mut host = host.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begun = Instant::now();
    while Store::open_read_only(&file).unwrap().records().unwrap().len() < 8 {
        assert!(begun.elapsed() < Duration::from_mins(1), "no hits were stored");
        std::thread::sleep(Duration::from_millis(5));
    }
    host.kill().unwrap();
    host.wait().unwrap();
    let first = records(&file);
    assert!(first.len() < 27 && first.iter().all(|kept| kept.verdict == "good"), "{}", first.len());
    // to the byte those of the rig itself
    assert!(records(&at("sim.jrig"))[..first.len()] == first[..]);

    // the next run continues, and refuses the hit with the lost scans
    let way = way(first.len());
    let (address, relay) = served(&at("rig.toml"), &way, scan_of_the_loss(&way));
    let transport = address.parse::<Address>().unwrap().open(0).unwrap();
    let summary = campaign::attempt(&file, &plan, transport).unwrap();
    relay.join().unwrap();
    assert_eq!((summary.accounts.lost, summary.accounts.unexplained()), (LOST, 0), "{:?}", summary.accounts);
    let all = records(&file);
    assert_eq!(all[..first.len()], first[..]);
    let refused: Vec<&str> = all.iter().map(|kept| kept.verdict).filter(|own| *own != "good").collect();
    assert_eq!((all.len(), refused), (PLACES.len() * WANTED as usize + 1, vec!["gap"]));

    let (direct, [low, high]) = found(&at("sim.jrig"), &at("sim"));
    let (bridged, [from, to]) = found(&file, &at("lab"));
    println!("sim: {direct:e} [{low:e}, {high:e}], bridge: {bridged:e} [{from:e}, {to:e}]");
    // the operator who begins again aims again: other draws of positions and noise from there on
    assert!(low < bridged && bridged < high && from < direct && direct < to);
    assert!(((to - from) / (high - low) - 1.0).abs() < 0.5, "the intervals are alike");
}
