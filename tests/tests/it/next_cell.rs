//! The forecast of k_T's interval against campaigns that measure what it proposes, and the time
//! that this saves.
#![allow(clippy::unwrap_used)]

use jointrig::analyse::CellName;
use jointrig::analyse::next_cell::{Averaged, Outlook, Times, Visit, outlook};
use jointrig::campaign::plan::structure;
use jointrig::campaign::run::further::{Choice, ChooseFurther, Further, FurtherCell};
use jointrig::campaign::store::Store;
use jointrig::campaign::verdict::Verdict;
use jointrig::contact::ContactPriors;
use jointrig::device::address::Address;
use jointrig::structure::Structure;
use jointrig_hil_sim::rig::RigConfig;
use jointrig_tests::campaign::{one_second, rows, run, run_further, short_contact_plan};
use jointrig_tests::command::jointrig;
use jointrig_tests::drawn_campaigns::{count, each};
use jointrig_tests::live::done;
use jointrig_tests::rigs::{Drawn, contact_plan, drawn};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_xoshiro::Xoshiro256PlusPlus;
use serde_json::Value;
use std::collections::BTreeMap;
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

fn simulated(rig: u64, folder: &Path) -> (Address, String) {
    let own = drawn(rig, Drawn::default());
    (address_of(&own, rig, folder), one_second(&contact_plan(&own)))
}

fn address_of(rig: &RigConfig, number: u64, folder: &Path) -> Address {
    let description = folder.join(format!("{number}.toml"));
    std::fs::write(&description, rig.to_toml()).unwrap();
    format!("sim:{}", description.display()).parse().unwrap()
}

/// The points and spots next to the contact, as the plan calls them.
const POINTS: [&str; 7] = ["C1", "C2", "C3", "C4", "D1", "D2", "D3"];
const SPOTS: [&str; 2] = ["LDV_A", "LDV_B"];

/// The contact's centre, as the simulator calls it.
const CENTRE: &str = "contact";

/// A drawn rig whose places next to the contact are off by known amounts, so that they can be
/// measured again.
struct Placed {
    rig: RigConfig,
    plan: toml::Table,
    /// True places, m.
    true_m: BTreeMap<&'static str, [f64; 3]>,
    random: Xoshiro256PlusPlus,
}

impl Placed {
    fn new(number: u64) -> Self {
        let mut rig = drawn(number, Drawn::default());
        let plan = toml::from_str(&one_second(&contact_plan(&rig))).unwrap();
        let random = Xoshiro256PlusPlus::seed_from_u64(0x09_1ace_0000 + number);
        let sigma_m = [rig.errors.specimen_point_m, rig.errors.spot_m];
        // drawn here instead of by the simulator
        rig.errors.specimen_point_m = 0.0;
        rig.errors.spot_m = 0.0;
        let mut own = Placed { rig, plan, true_m: BTreeMap::new(), random };
        let priors = own.plan["priors"].as_table_mut().unwrap();
        let ContactPriors { contact_across_m, contact_height_m, .. } = ContactPriors::default();
        priors.insert("contact_across_m".into(), contact_across_m.into());
        priors.insert("contact_height_m".into(), contact_height_m.into());
        let [point_m, spot_m] = sigma_m;
        let all = POINTS.map(|name| (name, [point_m; 3])).into_iter();
        let all = all.chain(SPOTS.map(|name| (name, [spot_m; 3])));
        for (name, sigma_m) in all.chain([(CENTRE, [contact_across_m, contact_height_m, 0.0])]) {
            let stated: Vec<f64> = place(&mut own.plan, name).clone().try_into().unwrap();
            let stated_m: [f64; 3] = stated.try_into().unwrap();
            let off_m = own.noise(sigma_m);
            own.true_m.insert(name, [0, 1, 2].map(|axis| stated_m[axis] + off_m[axis]));
            let simulated = if SPOTS.contains(&name) { name.to_lowercase() } else { name.into() };
            own.rig.errors.offset_m.insert(simulated, off_m);
        }
        own
    }

    fn noise(&mut self, sigma_m: [f64; 3]) -> [f64; 3] {
        sigma_m.map(|sigma_m| sigma_m * self.random.sample::<f64, _>(StandardNormal))
    }

    /// Measures the places of one cause again, with half the errors that the plan states.
    fn measure_again(&mut self, cause: &str) {
        let (names, priors): (&[&'static str], [&str; 2]) = match cause {
            "spots" => (&SPOTS, ["spot_m"; 2]),
            "centre" => (&[CENTRE], ["contact_across_m", "contact_height_m"]),
            "specimen-points" => (&POINTS, ["specimen_point_m"; 2]),
            other => panic!("{other} is not measured again here"),
        };
        let [x, y] = priors.map(|prior| 0.5 * self.plan["priors"][prior].as_float().unwrap());
        for (prior, half) in priors.into_iter().zip([x, y]) {
            self.plan["priors"][prior] = half.into();
        }
        for name in names {
            let error_m = self.noise([x, y, if *name == CENTRE { 0.0 } else { x }]);
            let true_m = self.true_m[name];
            *place(&mut self.plan, name) = (0..3).map(|i| true_m[i] + error_m[i]).collect::<Vec<_>>().into();
        }
    }
}

/// The place of a point, a spot or the contact in a plan, m.
fn place<'a>(plan: &'a mut toml::Table, name: &str) -> &'a mut toml::Value {
    let geometry = plan["geometry"].as_table_mut().unwrap();
    if name == CENTRE {
        return &mut geometry["virtual_point_m"];
    }
    let list = if SPOTS.contains(&name) { "sensor" } else { "response" };
    let mut all = geometry[list].as_array_mut().unwrap().iter_mut();
    &mut all.find(|own| own["name"].as_str() == Some(name)).unwrap()["position_m"]
}

/// Hits that the plan wants in each cell where `--until` chooses further ones.
const AT_FIRST: u32 = 6;

/// Half width that the plan's order with `wanted` hits in each cell reaches, the one that `--until`
/// reaches, and the minutes of both. The places may be measured again in this many minutes for each
/// cause.
fn compared(number: u64, folder: &Path, wanted: u32, again_min: Option<u32>) -> (f64, f64, f64, f64) {
    let begun = Instant::now();
    let mut placed = Placed::new(number);
    let address = address_of(&placed.rig, number, folder);
    let fixed = folder.join(format!("{number}-fixed.jrig"));
    placed.plan["hits"]["most"] = 100.into();
    let with = |plan: &toml::Table, wanted: u32| {
        let mut plan = plan.clone();
        plan["hits"]["wanted"] = i64::from(wanted).into();
        toml::to_string(&plan).unwrap()
    };
    run(&fixed, &with(&placed.plan, wanted), address.open(number).unwrap());
    let until = outlook_of(&fixed).half_width();
    let (text, file) =
        (folder.join(format!("{number}-plan.toml")), folder.join(format!("{number}-until.jrig")));
    std::fs::write(&text, with(&placed.plan, AT_FIRST)).unwrap();
    let out = jointrig().args(["campaign", "new"]).arg(&file).arg("--plan").arg(&text).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let run_until = || {
        let mut command = jointrig();
        command.args(["campaign", "run"]).arg(&file);
        command.args(["--device", &address.to_string(), "--seed", &number.to_string()]);
        command.args(["--until", &format!("{}%", 100.0 * until), "--further-hits", "3000", "--hit-s", "5"]);
        if let Some(minutes) = again_min {
            command.args(["--again-min", &minutes.to_string()]);
        }
        let out = command.output().unwrap();
        (out.status.success(), String::from_utf8(out.stderr).unwrap())
    };
    let (mut reached, mut said) = run_until();
    let mut again = Vec::new();
    while said.contains("campaign places") {
        let store = Store::open_read_only(&file).unwrap();
        let times = Times {
            again_s: again_min.map(|minutes| 60.0 * f64::from(minutes)),
            ..Times::of(&store.plan().unwrap())
        };
        let best = outlook(&store, times, &mut Averaged::default()).unwrap().again()[0].cause.name();
        drop(store);
        placed.measure_again(best);
        again.push(best);
        std::fs::write(&text, with(&placed.plan, AT_FIRST)).unwrap();
        let out = (jointrig().args(["campaign", "places", "--reason", "again"]).arg(&file))
            .arg("--plan")
            .arg(&text)
            .output()
            .unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        (reached, said) = run_until();
    }
    let measuring = again_min.unwrap_or(0) as usize * again.len();
    let (took, most) = (minutes(&file) + measuring as f64, minutes(&fixed));
    let achieved = outlook_of(&file).half_width();
    println!(
        "rig {number}: {:.2} % wanted, {:.2} % achieved, {took:.1} of {most:.1} min: {:.0} %{}; again: {} ({:.0} s)",
        100.0 * until,
        100.0 * achieved,
        100.0 * took / most,
        if reached { "" } else { " NOT REACHED" },
        again.join(", "),
        begun.elapsed().as_secs_f64()
    );
    if !reached {
        println!("{}", said.lines().last().unwrap_or_default());
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
    let (wanted, again_min) = (count("WANTED", 16) as u32, count("AGAIN_MIN", 0) as u32);
    let again_min = (again_min > 0).then_some(again_min);
    let all = each(&numbers, |rig| compared(*rig, folder.path(), wanted, again_min));
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
    let address: Address = "sim:".parse().unwrap();
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

    // places that take seconds to be measured again gain more per minute than any hit
    let again = |minutes: &str| {
        let out = jointrig()
            .args(["campaign", "next", "--json", "--again-min", minutes])
            .arg(&file)
            .output()
            .unwrap();
        serde_json::from_slice::<Value>(&out.stdout).unwrap()["again"].clone()
    };
    let halved: Vec<f64> =
        again("10").as_array().unwrap().iter().map(|own| own["half_width"].as_f64().unwrap()).collect();
    assert!(halved.is_sorted() && halved[0] < 0.98 * now, "{halved:?} {now}");
    let wanted = format!("{:.6}%", 100.0 * (now - 0.3 * (now - limit)));
    let out = run_until(&wanted).args(["--again-min", "0.001"]).output().unwrap();
    let said = String::from_utf8(out.stderr).unwrap();
    assert!(out.status.code() == Some(1) && said.contains("campaign places"), "{said}");
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

#[test]
fn b_alone_gets_all_its_hits_before_the_assembly_is_put_together() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, file) = (folder.path().join("plan.toml"), folder.path().join("c.jrig"));
    std::fs::write(&plan, short_contact_plan().replace("wanted = 2", "wanted = 3")).unwrap();
    done(jointrig().args(["campaign", "new"]).arg(&file).arg("--plan").arg(&plan));
    done(jointrig().args(["campaign", "run", "--device", "sim:", "--yes", "--until", "99%"]).arg(&file));
    let store = Store::open_read_only(&file).unwrap();
    let (cells, good) = (store.cells().unwrap(), rows(&store));
    for cell in &cells {
        let hits = good.iter().filter(|own| own.cell == cell.id && own.verdict == Verdict::Good).count();
        let wanted = if structure(cell.cell.configuration) == Structure::B { 3 } else { 2 };
        assert_eq!(hits, wanted, "{:?}", cell.cell);
    }
}
