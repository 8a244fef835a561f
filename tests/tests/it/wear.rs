//! Wear runs that are killed: no cycle is lost or counted twice, and what is measured follows the
//! law of the simulated contact.
//!
//! `JOINTRIG_WEAR_CYCLES` (2400) and `JOINTRIG_KILLS` (3) set the size of the run; with 1000000 and
//! 10 it takes some minutes.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use jointrig::campaign::store::Store;
use jointrig::campaign::store::wear_table::WearBlockRow;
use jointrig_tests::browser::{Browser, Look};
use jointrig_tests::command::{Served, jointrig};
use jointrig_tests::live;

/// k_T (N/m), μ, N (N), Δx (m) of the simulated run.
const K: f64 = 6e7;
const MU: f64 = 0.4;
const LOAD_N: f64 = 150.0;
const AMPLITUDE_M: f64 = 4e-6;
const HZ: f64 = 100.0;
/// Relative changes of k_T and μ.
const CHANGES: [f64; 2] = [0.3, 0.5];
/// Largest deviation of a decade from the law.
const WITHIN: f64 = 0.03;

/// Energies (J) by which k_T and μ have changed by 63 % of that: within the run.
fn energies(cycles: u64) -> [f64; 2] {
    [1.5e-4, 3e-4].map(|of_cycle| of_cycle * cycles as f64)
}

fn number(variable: &str) -> Option<u64> {
    std::env::var(variable).ok().and_then(|text| text.parse().ok())
}

struct Bench {
    _folder: tempfile::TempDir,
    file: PathBuf,
    device: String,
    cycles: u64,
}

impl Bench {
    fn new(cycles: u64) -> Self {
        Self::with(cycles, "", "")
    }

    /// With more lines in the plan's [wear] and in the rig.
    fn with(cycles: u64, of_run: &str, of_rig: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let rig = folder.path().join("rig.toml");
        let ([k, mu], [of_k, of_mu]) = (CHANGES, energies(cycles));
        let text = format!(
            "name = \"wears\"\n[contact]\nlaw = \"jenkins\"\nstiffness_n_per_m = [{K:e}, 2.6e8, {K:e}]\n\
             friction_coefficient = {MU}\nnormal_load_n = {LOAD_N}\n[contact.wear]\nstiffness_change = {k}\n\
             stiffness_energy_j = {of_k}\nfriction_change = {mu}\nfriction_energy_j = {of_mu}\n[clamp]\nrigid = true\n{of_rig}"
        );
        std::fs::write(&rig, text).unwrap();
        let small = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/plans/small.toml");
        let plan = folder.path().join("plan.toml");
        let mut text = std::fs::read_to_string(small).unwrap();
        text = text.replace("[window]", &format!(
            "[wear]\nfrequency_hz = {HZ}\namplitude_m = {AMPLITUDE_M:e}\ncycles = {cycles}\nenergy_j = 1e6\n\
             friction_coefficient = [0.1, 0.9]\nlargest_amplitude_m = 2e-5\n{of_run}\n[window]"
        ));
        text = match text.find("\n[contact]\n") {
            Some(_) => text.replace("normal_load_n = 300.0", &format!("normal_load_n = {LOAD_N}")),
            None => text.replace("[window]", &format!("[contact]\nnormal_load_n = {LOAD_N}\n\n[window]")),
        };
        std::fs::write(&plan, text).unwrap();
        let file = folder.path().join("a.jrig");
        let made = jointrig().args(["campaign", "new"]).arg(&file).arg("--plan").arg(plan).output().unwrap();
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        Self { _folder: folder, file, device: format!("sim:{}", rig.display()), cycles }
    }

    fn wear(&self, cycles: u64) -> Command {
        let mut command = jointrig();
        command.arg("wear").arg(&self.file).args(["--device", &self.device, "--cycles", &cycles.to_string()]);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command
    }

    /// Cycles in the file.
    fn done(&self) -> u64 {
        Store::open_read_only(&self.file).unwrap().wear_total().unwrap().cycles
    }

    fn verify(&self) {
        let verified = jointrig().args(["campaign", "verify"]).arg(&self.file).output().unwrap();
        assert!(verified.status.success(), "{}", String::from_utf8_lossy(&verified.stdout));
    }

    fn blocks(&self) -> Vec<WearBlockRow> {
        let mut blocks = Vec::new();
        let store = Store::open_read_only(&self.file).unwrap();
        store.each_wear_block(|block| blocks.push(block.unwrap().0)).unwrap();
        blocks
    }
}

#[test]
fn killed_at_random_instants_it_counts_every_cycle_once_and_follows_the_law() {
    let cycles = number("JOINTRIG_WEAR_CYCLES").unwrap_or(2_400);
    let kills = number("JOINTRIG_KILLS").unwrap_or(3);
    let bench = Bench::new(cycles);
    let mut before = 0;
    for kill in 1..=kills {
        let goal = cycles * kill / (kills + 1);
        let mut child = bench.wear(cycles).spawn().unwrap();
        let begun = Instant::now();
        while bench.file.exists() && bench.done() < goal {
            assert!(child.try_wait().unwrap().is_none(), "it must not end before it is killed");
            assert!(begun.elapsed() < Duration::from_hours(1), "no cycles came");
            std::thread::sleep(Duration::from_millis(7));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let now = bench.done();
        assert!(now >= goal && now > before, "kill {kill}: {now} cycles after {before}");
        before = now;
        bench.verify();
        if kill == 1 {
            // cells of the hammer in between
            let mut run = jointrig();
            run.args(["campaign", "run"]).arg(&bench.file).args(["--device", &bench.device, "--yes"]);
            assert!(run.stdin(Stdio::null()).output().unwrap().status.success());
            assert_eq!(bench.done(), before);
        }
    }
    let ended = bench.wear(cycles).output().unwrap();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    bench.verify();
    // started again, it does nothing
    let total = bench.done();
    assert!(bench.wear(cycles).output().unwrap().status.success());
    assert_eq!(bench.done(), total);

    let blocks = bench.blocks();
    let mut next = 0;
    for block in &blocks {
        assert_eq!((block.cycles_before, block.unmeasured), (next, 0), "cycle lost or counted twice");
        next += block.count;
    }
    assert_eq!(next, total);
    // the ramp to rest counts as well, and a virtual board is up to half a second ahead
    assert!((cycles..cycles + 100).contains(&total), "{total}");
    // within a session the cycles follow each other in the stream without a gap
    for pair in blocks.windows(2).filter(|pair| pair[0].session == pair[1].session) {
        let end = pair[0].begin_scan + pair[0].count as f64 * pair[0].period_scans;
        assert!((end - pair[1].begin_scan).abs() < 1e-3, "{pair:?}");
    }
    let sessions = blocks.iter().map(|block| block.session).collect::<std::collections::BTreeSet<_>>();
    assert_eq!(sessions.len() as u64, kills + 1);
    compare_with_law(&bench);
}

/// Compares means over decades with the law at the energy of each cycle.
fn compare_with_law(bench: &Bench) {
    let store = Store::open_read_only(&bench.file).unwrap();
    let energies = energies(bench.cycles);
    // sums by decade: cycles, then k, μ and energy as measured and by the law
    let mut sums: Vec<[f64; 7]> = Vec::new();
    store
        .each_wear_cycle(|block, number, cycle, energy_to_j| {
            let own = cycle.reading.unwrap();
            // while the amplitude rises or falls the closed form does not hold
            if (own.amplitude_m / block.ordered_m - 1.0).abs() > 0.05 {
                return;
            }
            let place = number.ilog10() as usize;
            sums.resize(sums.len().max(place + 1), [0.0; 7]);
            let worn_j = energy_to_j - 0.5 * cycle.energy_j;
            let factor = |of: usize| 1.0 - CHANGES[of] * (-worn_j / energies[of]).exp_m1();
            let (k, mu) = (K * factor(0), MU * factor(1));
            let limit = mu * LOAD_N;
            let energy = 4.0 * limit * (own.amplitude_m - limit / k);
            let measured = [
                own.stiffness_n_per_m.unwrap(),
                own.friction_n.unwrap() / cycle.normal_load_n.unwrap(),
                cycle.energy_j,
            ];
            let all = [1.0].into_iter().chain(measured).chain([k, mu, energy]);
            sums[place].iter_mut().zip(all).for_each(|(sum, value)| *sum += value);
        })
        .unwrap();
    println!("decade  cycles  k/law  mu/law  energy/law");
    for (place, sum) in sums.iter().enumerate().filter(|(_, sum)| sum[0] > 0.0) {
        let ratios = [1, 2, 3].map(|i| sum[i] / sum[i + 3]);
        println!("10^{place}  {}  {:.4}  {:.4}  {:.4}", sum[0], ratios[0], ratios[1], ratios[2]);
        if sum[0] >= 10.0 {
            assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < WITHIN), "decade {place}: {ratios:?}");
        }
    }
    let energy_j = store.wear_total().unwrap().energy_j;
    assert!(energy_j > 2.0 * energies[0], "most of the law has acted: {energy_j} J");
    let kept = store.wear_loops().unwrap();
    assert!(kept.len() > 20, "{}", kept.len());
    for row in kept {
        let row = row.unwrap();
        assert!(store.wear_loop_samples(&row).unwrap().scans() >= row.period_scans as usize);
    }
    println!("{} bytes", std::fs::metadata(&bench.file).unwrap().len());
}

#[test]
fn a_limit_or_the_user_ends_a_run_and_the_result_is_one_document() {
    let bench = Bench::new(300);
    let run = |more: &[&str]| {
        let out = bench.wear(300).args(more).stdout(Stdio::piped()).stderr(Stdio::piped()).output().unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        serde_json::from_slice::<serde_json::Value>(&out.stdout).unwrap()
    };
    let first = run(&["--energy", "0.05", "--json"]);
    assert_eq!(first["end"], "energy");
    assert!(first["wear"]["energy_j"].as_f64().unwrap() >= 0.05);
    let second = run(&["--json"]);
    assert_eq!(second["end"], "cycles");
    let decades = second["wear"]["decades"].as_array().unwrap();
    let last = decades.last().unwrap();
    assert!(last["k_t_n_per_m"].as_f64().unwrap() > 0.9 * K, "{last}");
    // shown without a device, exported, and named where it is missing
    let shown = jointrig().arg("wear").arg(&bench.file).arg("--json").output().unwrap();
    let shown: serde_json::Value = serde_json::from_slice(&shown.stdout).unwrap();
    assert_eq!(shown["wear"], second["wear"]);
    let to = bench.file.with_extension("out");
    let out = jointrig()
        .arg("export")
        .arg(&bench.file)
        .args(["--format", "csv", "--out"])
        .arg(&to)
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let csv = std::fs::read_to_string(to.join("wear.csv")).unwrap();
    assert_eq!(csv.lines().count() as u64, 1 + second["wear"]["cycles"].as_u64().unwrap());
    // the curve's points are the means over their cycles
    let rows: Vec<Vec<f64>> = csv
        .lines()
        .skip(1)
        .map(|row| row.split(',').map(|field| field.parse().unwrap_or(f64::NAN)).collect())
        .collect();
    let heads: Vec<&str> = csv.lines().next().unwrap().split(',').collect();
    let place = |name: &str| heads.iter().position(|head| *head == name).unwrap();
    let curve = second["wear"]["curve"].as_array().unwrap();
    assert_eq!(curve.last().unwrap()["last"], second["wear"]["cycles"]);
    assert!(
        curve.len() > 2 && curve.windows(2).all(|two| two[1]["first"].as_u64() > two[0]["last"].as_u64())
    );
    for point in curve {
        let [first, last] = ["first", "last"].map(|name| point[name].as_u64().unwrap() as usize);
        let slipping = || rows[first - 1..last].iter().filter(|row| !row[place("friction_n")].is_nan());
        let mean = |column: usize| {
            let (sum, count) = slipping()
                .map(|row| row[column])
                .filter(|value| !value.is_nan())
                .fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
            sum / count
        };
        assert_eq!(point["slipping"].as_u64().unwrap() as usize, slipping().count());
        for (field, column) in
            [("k_t_n_per_m", "stiffness_n_per_m"), ("friction_coefficient", "friction_coefficient")]
        {
            match point[field].as_f64() {
                Some(value) => assert!((value / mean(place(column)) - 1.0).abs() < 1e-9, "{point}"),
                None => assert_eq!(slipping().count(), 0, "{point}"),
            }
        }
        let energy_to_j = rows[last - 1][place("energy_to_j")];
        assert!((point["energy_to_j"].as_f64().unwrap() / energy_to_j - 1.0).abs() < 1e-6, "{point}");
    }
    // the user's end
    let mut child = bench.wear(1_000_000).spawn().unwrap();
    let before = bench.done();
    let begun = Instant::now();
    while bench.done() < before + 100 {
        assert!(begun.elapsed() < Duration::from_mins(2), "no cycles came");
        std::thread::sleep(Duration::from_millis(5));
    }
    let asked = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(asked.success());
    assert_eq!(child.wait().unwrap().code(), Some(1));
    bench.verify();
    let blocks = bench.blocks();
    assert!(blocks.last().unwrap().drive_v < 0.1, "the last block ends at rest: {blocks:?}");
}

#[test]
fn a_specimen_that_becomes_too_warm_ends_the_run() {
    // 22 °C at first; over the limit after two seconds, which is less than the run
    let bench = Bench::with(2_000, "temperature_c = 22.4\n", "[surroundings]\nwarming_k_per_s = 0.2\n");
    let out = bench.wear(2_000).arg("--json").stdout(Stdio::piped()).output().unwrap();
    assert!(out.status.success());
    let found: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(found["end"], "temperature", "{found}");
    let done = bench.done();
    assert!(done > 50 && done < 1_500, "{done}");
    bench.verify();
    let blocks = bench.blocks();
    assert!(blocks.last().unwrap().drive_v < 0.1, "the last block ends at rest: {blocks:?}");
}

#[test]
fn killed_or_over_a_limit_the_shaker_rests_and_the_count_goes_on() {
    let mut bench = Bench::new(100_000);
    let rig = bench.device.trim_start_matches("sim:").to_owned();
    let rig = Served::start(&["--tcp", "127.0.0.1:0", "--rig", &rig]);
    bench.device.clone_from(&rig.address);
    let mut child = bench.wear(100_000).spawn().unwrap();
    let begun = Instant::now();
    while bench.done() < 500 {
        assert!(begun.elapsed() < Duration::from_mins(2), "no cycles came");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let before = bench.done();
    let info = jointrig().args(["info", "--json", "--device", &rig.address]).output().unwrap();
    let said = String::from_utf8_lossy(&info.stdout);
    assert!(said.contains("\"Resting\"") || said.contains("\"Stopping\""), "{said}");
    // a limit of the device, below the velocity of the ordered motion
    let out = bench.wear(100_000).args(["--limit", "ldv_a=1e-3"]).stderr(Stdio::piped()).output().unwrap();
    let said = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(1), "{said}");
    assert!(said.contains("channel `ldv_a` went beyond its limit"), "{said}");
    let after = bench.done();
    assert!(after >= before && said.contains(&format!("all {after} cycles")), "{said}");
    bench.verify();
    // on the same rig, whose contact has its history in itself
    let more = bench.wear(after + 200).output().unwrap();
    assert!(more.status.success(), "{}", String::from_utf8_lossy(&more.stderr));
    bench.verify();
    assert!(bench.done() >= after + 200);
}

/// The page shows stiffness, friction and energy over the cycles, and they grow with the file.
#[test]
fn the_live_page_shows_how_the_contact_wears() {
    let bench = Bench::new(2000);
    let slide = |cycles| {
        let out = bench.wear(cycles).stderr(Stdio::piped()).output().unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    };
    slide(1000);
    let server = live::Served::of(&bench.file);
    let mut browser = Browser::start();
    for look in [Look::DESK, Look { dark: true, ..Look::HAND }] {
        let mut page = browser.open_url(&server.url, look);
        page.until("live.state.whole?.progress.wear_cycles > 0");
        page.key("8");
        let shows = |cycles: u64| {
            format!(
                "document.querySelector('figure[data-figure=wear].ready') !== null && live.alive.get('wear')?.length === 3 && live.alive.get('wear')[0].panel.x.range[1] === {cycles}"
            )
        };
        page.until(&shows(bench.done()));
        slide(bench.done() + 500);
        page.until(&shows(bench.done()));
        live::picture(&mut page, &format!("wear-{}", look.width));
        assert!(page.eval("document.documentElement.scrollWidth").as_u64().unwrap() <= u64::from(look.width));
        assert_eq!(page.errors(), Vec::<String>::new());
    }
}
