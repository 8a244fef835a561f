//! A campaign synchronised with another recorder, by its clock and by edges that both see; and the
//! errors of a plan that does not match the device.
#![allow(clippy::unwrap_used)]

use std::io;
use std::path::Path;
use std::time::Duration;

use jointrig::campaign::run::error::RunError;
use jointrig::campaign::run::runner::Summary;
use jointrig::campaign::store::Store;
use jointrig::campaign::store::session_table::{ClockRow, EdgeRow};
use jointrig::device::transport::Transport;
use jointrig_hil_sim::board::{Options as BoardOptions, VirtualBoard, Wires};
use jointrig_hil_sim::link::HostEnd;
use jointrig_hil_sim::rig::RigConfig;
use jointrig_tests::campaign::{attempt, small_plan};
use jointrig_tests::command::jointrig;
use jointrig_tests::live::done;

/// A virtual board with a recorder at its sync port.
struct Wired {
    link: HostEnd,
    _board: VirtualBoard,
}

impl Transport for Wired {
    fn read(&mut self, bytes: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.link.read(bytes, timeout)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.link.write_all(bytes)
    }
}

/// Two good hits of one cell.
fn plan(sync: &str) -> String {
    small_plan(&[("AJB", &["AZ1"], &["B1"])]).replacen("[record]", &format!("{sync}\n[record]"), 1)
}

fn measure(file: &Path, plan: &str, wire: impl Fn(&Wires)) -> Result<Summary, RunError> {
    let options = BoardOptions { seed: 5, ..BoardOptions::default() };
    let (board, link) = VirtualBoard::start_with(&RigConfig::default(), &options).unwrap();
    wire(board.controls().wires());
    attempt(file, plan, Box::new(Wired { link, _board: board }))
}

fn noted(file: &Path) -> (Vec<ClockRow>, Vec<EdgeRow>) {
    let store = Store::open_read_only(file).unwrap();
    (store.clocks().unwrap(), store.edges().unwrap())
}

#[test]
fn clock_and_edges_are_stored_and_exported() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.jrig");
    let external = plan("[sync]\nclock = \"external\"\n");
    let summary = measure(&file, &external, |wires| {
        wires.give_clock(Some(-70.0));
        wires.edge(1_000.25);
    })
    .unwrap();
    assert_eq!(summary.kept, 2);
    let (clocks, edges) = noted(&file);
    assert_eq!((clocks.len(), clocks[0].source.as_str(), clocks[0].rate_hz), (1, "external", Some(51_200)));
    assert!((clocks[0].ppm.unwrap() + 70.0).abs() < 12.0, "{clocks:?}");
    let input = edges.iter().find(|edge| edge.line == "input").unwrap();
    assert!((input.at_scan() - 1_000.25).abs() < 1e-9);
    // each hit is marked when the coil is switched on and when the force is detected; the second
    // mark is within its record
    let store = Store::open_read_only(&file).unwrap();
    for record in store.records().unwrap().into_iter().flatten() {
        let trigger = record.first_scan + record.trigger_index as u64;
        let felt = |edge: &&EdgeRow| edge.line == "trigger" && (trigger..trigger + 25).contains(&edge.scan);
        assert_eq!(edges.iter().filter(felt).count(), 1, "{edges:?}");
        assert!(
            edges.iter().any(|edge| edge.line == "fired" && edge.scan.abs_diff(record.shot.fired_at) <= 1)
        );
    }
    drop(store);
    // the same samples as without synchronisation
    let alone = folder.path().join("b.jrig");
    measure(&alone, &plan(""), |_| {}).unwrap();
    assert_eq!(noted(&alone), (Vec::new(), Vec::new()), "a plan without [sync] stores none of it");
    let samples = |file: &Path| {
        let store = Store::open_read_only(file).unwrap();
        let records = store.records().unwrap().into_iter().flatten();
        records.map(|record| store.samples(&record).unwrap()).collect::<Vec<_>>()
    };
    assert!(samples(&file) == samples(&alone));

    let out = folder.path().join("out");
    done(
        jointrig().args(["export", "--format", "csv", "--without-records"]).arg(&file).arg("--out").arg(&out),
    );
    let table = std::fs::read_to_string(out.join("edges.csv")).unwrap();
    assert!(table.starts_with("session,clock,line,number,scan,record,sample"), "{table}");
    assert!(table.lines().any(|line| line.starts_with("1,external,input,1,1000.25,")), "{table}");
    let inside = table.lines().filter(|line| line.contains(",trigger,") && !line.ends_with(',')).count();
    assert_eq!(inside as u64, summary.hits, "{table}");
    let status = done(jointrig().args(["campaign", "status", "--json"]).arg(&file));
    let status: serde_json::Value = serde_json::from_str(&status).unwrap();
    assert_eq!(status["clocks"][0]["source"], "external");
    assert_eq!(status["edges"].as_u64().unwrap(), edges.len() as u64);
    done(jointrig().args(["campaign", "verify"]).arg(&file));
}

#[test]
fn a_clock_that_is_not_there_is_refused_before_anything_is_stored() {
    let folder = tempfile::tempdir().unwrap();
    let external = plan("[sync]\nclock = \"external\"\n");
    for (name, ppm, words) in [("a", None, "no external clock"), ("b", Some(900.0), "within 200 ppm")] {
        let file = folder.path().join(name).with_extension("jrig");
        let said = measure(&file, &external, |wires| wires.give_clock(ppm)).unwrap_err().to_string();
        assert!(said.contains("test: ") && said.contains(words), "{said}");
        assert!(Store::open_read_only(&file).unwrap().sessions().unwrap().is_empty());
    }
}

#[test]
fn a_clock_that_is_lost_ends_the_run_by_name_and_keeps_what_was_measured() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.jrig");
    let many = plan("[sync]\nclock = \"external\"\n").replace("wanted = 2", "wanted = 8");
    let said = measure(&file, &many, |wires| {
        wires.give_clock(Some(10.0));
        wires.stop_clock_at(400_000);
    })
    .unwrap_err()
    .to_string();
    assert!(said.contains("test: ") && said.contains("the external clock was lost"), "{said}");
    let store = Store::open_read_only(&file).unwrap();
    assert!(!store.records().unwrap().is_empty(), "what was measured before is there");
}

#[test]
fn an_unknown_clock_is_a_wrong_plan() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plan.toml");
    std::fs::write(&file, plan("[sync]\nclock = \"gps\"\n")).unwrap();
    let refused = jointrig().args(["plan", "check"]).arg(&file).output().unwrap();
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && said.contains("gps") && said.contains("external"), "{said}");
}
