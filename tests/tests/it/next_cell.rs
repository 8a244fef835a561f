//! The forecast of k_T's interval against campaigns that measure what it proposes, and the time
//! that this saves.
#![allow(clippy::unwrap_used)]

use jointrig::analyse::CellName;
use jointrig::analyse::next_cell::{Averaged, Outlook, Times, Visit, outlook};
use jointrig::campaign::plan::structure;
use jointrig::campaign::run::further::{Choice, ChooseFurther, Further, FurtherCell};
use jointrig::campaign::store::Store;
use jointrig_tests::campaign::{one_second, rows, run, run_further, short_contact_plan};
use jointrig_tests::command::jointrig;
use jointrig_tests::drawn_campaigns::{count, each};
use jointrig_tests::rigs::{Drawn, contact_plan, drawn};
use serde_json::Value;
use std::path::Path;
use std::process::Stdio;
use std::thread::sleep;
use std::time::{Duration, Instant};

fn outlook_of(file: &Path) -> Outlook {
    let store = Store::open_read_only(file).unwrap();
    let times = Times::of(&store.plan().unwrap());
    outlook(&store, times, &mut Averaged::default()).unwrap()
}

/// Minutes of the hits in a file, in the order in which they were struck, with the moves between
/// them: hits of 5 s, as with records of two seconds, and without the change from B alone to the
/// assembly, which every order needs once.
fn minutes(file: &Path) -> f64 {
    let store = Store::open_read_only(file).unwrap();
    let times = Times { hit_s: 5.0, structure_s: 0.0, ..Times::of(&store.plan().unwrap()) };
    let cells = store.cells().unwrap();
    let mut at: Option<CellName> = None;
    let mut seconds = 0.0;
    for record in rows(&store) {
        let cell = &cells.iter().find(|cell| cell.id == record.cell).unwrap().cell;
        let here = CellName {
            configuration: structure(cell.configuration),
            impact: cell.impact.clone(),
            response: cell.response.clone(),
        };
        seconds += times.moves_s(at.as_ref(), &here, false) + times.hit_s;
        at = Some(here);
    }
    seconds / 60.0
}

/// Visits that were chosen before.
struct Chosen(Option<Vec<FurtherCell>>);

impl ChooseFurther for Chosen {
    fn next(&mut self, _: &Path, _: &(dyn Fn(&FurtherCell) -> bool + Sync)) -> Result<Choice, String> {
        Ok(match self.0.take() {
            Some(cells) => Choice::Cells { cells, why: "chosen before".into() },
            None => Choice::Enough { reached: true, why: "all measured".into() },
        })
    }
}

fn chosen(visits: &[Visit]) -> Further {
    let one = |visit: &Visit| FurtherCell {
        configuration: visit.cell.configuration.name(),
        impact: visit.cell.impact.clone(),
        response: visit.cell.response.clone(),
        more: visit.more as u32,
    };
    Further::new(Chosen(Some(visits.iter().map(one).collect())))
}

/// Measures a plan on a rig, then the visits that are predicted to make the half width `factor`
/// times as large, or as small as they can: the prediction, and what it came to.
fn predicted(rig: u64, folder: &Path, factor: f64) -> [f64; 2] {
    let (address, plan) = simulated(rig, folder);
    let file = folder.join(format!("{rig}-predicted.jrig"));
    run(&file, &plan, address.open(rig).unwrap());
    let found = outlook_of(&file);
    let before = found.half_width();
    let visits = found.route(factor * before, 400, &|_| false);
    let predicted = visits.last().map_or(before, |last| last.half_width);
    run_further(&file, address.open(rig).unwrap(), chosen(&visits)).unwrap();
    let achieved = outlook_of(&file).half_width();
    let hits: usize = visits.iter().map(|visit| visit.more).sum();
    println!(
        "rig {rig}: {:.2} % from {} hits; {hits} more in {} visits: {:.2} % predicted, {:.2} % achieved: {:+.1} %",
        100.0 * before,
        found.hits,
        visits.len(),
        100.0 * predicted,
        100.0 * achieved,
        100.0 * (achieved / predicted - 1.0)
    );
    let _ = std::fs::remove_file(&file);
    [predicted, achieved]
}

fn simulated(rig: u64, folder: &Path) -> (jointrig::device::address::Address, String) {
    let own = drawn(rig, Drawn::default());
    let description = folder.join(format!("{rig}.toml"));
    std::fs::write(&description, own.to_toml()).unwrap();
    let address = format!("sim:{}", description.display()).parse().unwrap();
    (address, one_second(&contact_plan(&own)))
}

/// Minutes that the plan's order with `wanted` hits in each cell takes, and that `--until` takes for
/// the same half width.
fn compared(rig: u64, folder: &Path, wanted: u32) -> (f64, f64, f64, f64) {
    let begun = Instant::now();
    let (address, plan) = simulated(rig, folder);
    let fixed = folder.join(format!("{rig}-fixed.jrig"));
    let all = plan.replace("wanted = 6", &format!("wanted = {wanted}")).replace("most = 12", "most = 60");
    run(&fixed, &all, address.open(rig).unwrap());
    let until = outlook_of(&fixed).half_width();
    let (text, file) = (folder.join(format!("{rig}-plan.toml")), folder.join(format!("{rig}-until.jrig")));
    std::fs::write(&text, &all).unwrap();
    let out = jointrig().args(["campaign", "new"]).arg(&file).arg("--plan").arg(&text).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let out = jointrig()
        .args(["campaign", "run"])
        .arg(&file)
        .args(["--device", &address.to_string(), "--seed", &rig.to_string()])
        .args(["--until", &format!("{}%", 100.0 * until), "--further-hits", "3000", "--hit-s", "5"])
        .output()
        .unwrap();
    let (took, most) = (minutes(&file), minutes(&fixed));
    let achieved = outlook_of(&file).half_width();
    println!(
        "rig {rig}: {:.2} % wanted, {:.2} % achieved, {took:.1} of {most:.1} min: {:.0} %{} ({:.0} s)",
        100.0 * until,
        100.0 * achieved,
        100.0 * took / most,
        if out.status.success() { "" } else { " NOT REACHED" },
        begun.elapsed().as_secs_f64()
    );
    if !out.status.success() {
        println!("{}", String::from_utf8_lossy(&out.stderr).lines().last().unwrap_or_default());
    }
    (until, achieved, took, most)
}

#[test]
#[ignore = "docs/campaigns.md: how well the interval after further hits is predicted"]
fn intervals_are_predicted_on_drawn_rigs() {
    let (first, rigs) = (count("FIRST", 12_010), count("RIGS", 30));
    let folder = tempfile::tempdir().unwrap();
    let numbers: Vec<u64> = (first..first + rigs).collect();
    let all = each(&numbers, |rig| predicted(*rig, folder.path(), 0.8));
    let inside = all.iter().filter(|row| (row[1] / row[0] - 1.0).abs() <= 0.15).count();
    println!("{inside} of {} within 15 %", all.len());
}

#[test]
#[ignore = "docs/campaigns.md: minutes to a wanted interval, compared with the plan's order"]
fn until_takes_fewer_minutes_than_the_plans_order() {
    let (first, rigs) = (count("FIRST", 12_010), count("RIGS", 30));
    let folder = tempfile::tempdir().unwrap();
    let numbers: Vec<u64> = (first..first + rigs).collect();
    let all = each(&numbers, |rig| compared(*rig, folder.path(), count("WANTED", 8) as u32));
    let reached = all.iter().filter(|(until, achieved, ..)| achieved <= until).count();
    let mut parts: Vec<f64> = all.iter().map(|(_, _, took, most)| took / most).collect();
    parts.sort_by(f64::total_cmp);
    let below = parts.iter().filter(|part| **part <= 0.7).count();
    println!(
        "{reached} of {} reached; minutes: median {:.0} %, at most 70 % in {below}",
        all.len(),
        100.0 * parts[parts.len() / 2]
    );
}

#[test]
fn a_run_goes_on_until_the_interval_is_as_narrow_as_wanted() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("c.jrig");
    let address: jointrig::device::address::Address = "sim:".parse().unwrap();
    run(&file, &short_contact_plan(), address.open(1).unwrap());
    let next = |until: &str| -> Value {
        let out =
            jointrig().args(["campaign", "next", "--json", "--until", until]).arg(&file).output().unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        serde_json::from_slice(&out.stdout).unwrap()
    };
    let run_until = |until: &str| {
        let mut command = jointrig();
        command.args(["campaign", "run", "--device", "sim:", "--until", until]).arg(&file);
        command
    };
    let goes_on = |until: &str| {
        let out = run_until(until).output().unwrap();
        (out.status.code(), String::from_utf8(out.stderr).unwrap())
    };
    let verify = || {
        let out = jointrig().args(["campaign", "verify"]).arg(&file).output().unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    };
    let hits = || rows(&Store::open_read_only(&file).unwrap()).len();
    let before = next("99%");
    let (now, limit) =
        (before["half_width"].as_f64().unwrap(), before["with_four_times_the_hits"]["AJB"].as_f64().unwrap());
    assert_eq!(before["until"]["reached"], true);
    assert!(before["cells"].as_array().unwrap().len() == 21 && limit < now, "{before}");
    let struck = hits();

    // what no further hit reaches is refused before the hammer moves
    let (code, said) = goes_on("0.01%");
    assert!(code == Some(1) && said.contains("further hits"), "{code:?} {said}");
    assert_eq!(hits(), struck);

    // what some further hits reach is measured
    let until = now - 0.3 * (now - limit);
    let percentage = format!("{:.6}%", 100.0 * until);
    let predicted = next(&percentage);
    assert_eq!(predicted["until"]["reachable"], true, "{predicted}");
    assert!(predicted["until"]["hits"].as_u64().unwrap() > 0);

    // killed after its first further hit it loses nothing, and the same command goes on
    let silent = || Stdio::null();
    let mut child = run_until(&percentage).stdout(silent()).stderr(silent()).spawn().unwrap();
    while hits() == struck {
        assert!(child.try_wait().unwrap().is_none(), "it ended without a hit");
        sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    // on a busy machine it may have ended before
    child.wait().unwrap();
    verify();
    let kept = hits();
    assert!(kept > struck);

    let (code, said) = goes_on(&percentage);
    assert!(code == Some(0) && said.contains("was wanted"), "{code:?} {said}");
    // these hits may have been enough
    assert!(hits() >= kept, "{kept}");
    let reached = next(&percentage);
    assert!(reached["half_width"].as_f64().unwrap() <= until && reached["until"]["reached"] == true);
    let after = hits();
    assert!(after > struck && reached["hits"].as_u64() > before["hits"].as_u64());

    // the same command measures nothing more, and the file is intact
    assert_eq!((goes_on(&percentage).0, hits()), (Some(0), after));
    verify();
}
