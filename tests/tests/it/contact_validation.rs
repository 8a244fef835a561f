//! The contact's k_T on rigs that were not used in development: how often the interval covers the
//! truth, and whether a false assumption is noticed. The rigs' numbers were committed before the
//! estimator was run on them.
#![allow(clippy::unwrap_used)]

use jointrig::results::{ContactAnswer, Results};
use jointrig_hil_sim::rig::RigConfig;
use jointrig_hil_sim::rig::config::Patch;
use jointrig_tests::campaign::one_second;
use jointrig_tests::coverage::{Answer, COLUMNS, Coverage, QUALITY_COLUMNS, Quality, print_table};
use jointrig_tests::drawn_campaigns::{count, each, results};
use jointrig_tests::rigs::{Drawn, Elastic, contact_plan, drawn, off_centre};

/// What bends on the rig of this number: half are rigid, a quarter have specimens that bend, and on
/// a quarter arms bend too.
fn bends(number: u64) -> Option<Elastic> {
    [None, Some(Elastic::Specimens), None, Some(Elastic::SpecimensAndArms)][(number % 4) as usize]
}

/// A rig whose plan is right, with all errors as large as stated, that of the contact's centre too.
fn sound(number: u64) -> RigConfig {
    let mut rig = drawn(number, Drawn { elastic: bends(number), ..Drawn::default() });
    off_centre(number, &mut rig);
    rig
}

/// As [`measured`], with records of one second instead of two, for the tests that always run.
fn measured_shortly(number: u64, stated: &RigConfig, rig: &RigConfig) -> Results {
    results(number, rig, &one_second(&contact_plan(stated)))
}

/// Runs `contact.toml` with the priors of `stated` on `rig`.
fn measured(number: u64, stated: &RigConfig, rig: &RigConfig) -> ContactAnswer {
    results(number, rig, &contact_plan(stated)).answer.unwrap().contact
}

fn answer(rig: &RigConfig, found: &ContactAnswer) -> Option<Answer> {
    let truth = rig.truth().contact_k_t_n_per_m;
    found.k_t_n_per_m.map(|k| Answer::new(k.mean, k.ci95, truth))
}

/// Hits of `contact.toml` on the rig: 59 cells of six, without those on the known mass.
const HITS: f64 = 354.0;

/// One sound campaign.
struct Sound {
    number: u64,
    k_n_per_m: f64,
    answer: Option<Answer>,
    contradicts: bool,
}

#[test]
#[ignore = "docs/accuracy.md, by `cargo xtask accuracy`: rigs not used in development"]
fn rigs_not_used_in_development() {
    let numbers: Vec<u64> = (0..count("RIGS", 200)).map(|n| count("FIRST", 10463) + n).collect();
    let all = each(&numbers, |number| {
        let rig = sound(*number);
        let found = measured(*number, &rig, &rig);
        let (answer, k) = (answer(&rig, &found), rig.truth().contact_k_t_n_per_m);
        let told = answer.map_or_else(
            || found.why.clone(),
            |own| format!("{:+.1} % ± {:.1} % (z {:+.2})", 100.0 * own.error, 100.0 * own.half, own.z),
        );
        let contradicts = !found.contradictions.is_empty();
        let named: Vec<&str> = found.contradictions.iter().map(|one| one.what.as_str()).collect();
        println!("rig {number}: truth {:.1}, {told} {named:?}", 1e-6 * k);
        Sound { number: *number, k_n_per_m: k, answer, contradicts }
    });
    let row = |name: &str, chosen: &dyn Fn(&Sound) -> bool| {
        let own: Vec<&Sound> = all.iter().filter(|one| chosen(one)).collect();
        let answers: Vec<Answer> = own.iter().filter_map(|one| one.answer).collect();
        format!(
            "| {name} | {} | {} | {} | {} |",
            own.len(),
            own.len() - answers.len(),
            Coverage::of(&answers).cells(),
            Quality::of(&answers).cells()
        )
    };
    let rows = [
        row("all", &|_| true),
        row("rigid", &|one| bends(one.number).is_none()),
        row("specimens bend", &|one| bends(one.number) == Some(Elastic::Specimens)),
        row("specimens and arms bend", &|one| bends(one.number) == Some(Elastic::SpecimensAndArms)),
        row("clamp on A alone", &|one| !one.number.is_multiple_of(3)),
        row("clamps on A and B", &|one| one.number.is_multiple_of(3)),
        row("below 130 N/µm", &|one| one.k_n_per_m < 130e6),
        row("130 N/µm and more", &|one| one.k_n_per_m >= 130e6),
    ];
    print_table(
        "validation",
        &format!("rigs | campaigns | no answer | {COLUMNS} | {QUALITY_COLUMNS}"),
        &rows,
    );
    let z: Vec<f64> = all.iter().filter_map(|one| one.answer).map(|own| own.z).collect();
    let tenths = jointrig_tests::coverage::tenths(&z);
    println!("truths in each tenth of the stated distribution: {tenths:?}");
    let named = all.iter().filter(|one| one.contradicts).count();
    println!("contradictions named although all is as stated: {named} of {}", all.len());
}

#[test]
fn a_contact_that_changes_while_it_is_hit_is_noticed() {
    let mut rig = RigConfig::elastic();
    rig.contact.drift_per_hit = 0.1 / HITS;
    let found = measured_shortly(1, &rig, &rig);
    let (drifts, answer) = (found.check("contact-steady").unwrap(), found.answer.as_ref().unwrap());
    let answer = &answer.contact;
    assert_eq!(drifts.ok, Some(false), "{}", drifts.meaning);
    assert!(answer.why.contains("The contact changed"), "{}", answer.why);
    // the interval contains the stiffness before the first hit and after the last
    let [low, high] = answer.k_t_n_per_m.unwrap().ci95;
    let first = RigConfig::elastic().truth().contact_k_t_n_per_m;
    assert!(low < first && high > 1.1 * first, "{low} {high}");
}

#[test]
fn nothing_is_contradicted_on_a_rig_that_is_as_stated() {
    let rig = RigConfig::elastic();
    let found = measured_shortly(2, &rig, &rig);
    let steady = found.check("contact-steady").unwrap();
    assert_ne!(steady.ok, Some(false), "{}", steady.meaning);
    let answer = found.answer.unwrap().contact;
    assert!(answer.contradictions.is_empty(), "{}", answer.why);
}

#[test]
fn a_hammer_that_contradicts_the_load_cells_is_named_and_allowed_for() {
    let measured = |number, ratio: f64| {
        let mut rig = RigConfig::elastic();
        volts(&mut rig, &["force"], ratio);
        measured_shortly(number, &rig, &rig).answer.unwrap().contact
    };
    // the load cells would show more force than the hammer gives; then, 25 % more than the plan
    // states would pass beside them
    for (number, ratio) in [(3, 0.93), (4, 1.25)] {
        let found = measured(number, ratio);
        let answer = answer(&RigConfig::elastic(), &found).expect("a k_T");
        assert!(answer.covers, "{}: {:?}", found.why, found.k_t_n_per_m);
        assert!(found.why.contains("hammer's force cell"), "{}", found.why);
    }
}

#[test]
fn a_cable_beside_the_contact_is_named_and_allowed_for() {
    let mut rig = RigConfig::elastic();
    path(&mut rig, "[\"arm_a\", \"arm_b\"]", 0.03);
    let found = measured_shortly(5, &RigConfig::elastic(), &rig).answer.unwrap().contact;
    let answer = answer(&rig, &found).expect("a k_T");
    assert!(answer.covers, "{}: {:?}", found.why, found.k_t_n_per_m);
    assert!(found.why.contains("passes beside the contact"), "{}", found.why);
    assert!(found.why.contains("remove the cable"), "{}", found.why);
}

/// Number of examples of each false assumption.
const EXAMPLES: usize = 5;

/// A false assumption: its name, what makes it false in the i-th of its [`EXAMPLES`], and what the
/// answer must say of it.
type False = (&'static str, fn(&mut RigConfig, usize), &'static [&'static str]);

fn offset(rig: &mut RigConfig, name: &str, by_m: [f64; 3]) {
    rig.errors.offset_m.insert(name.into(), by_m);
}

fn volts(rig: &mut RigConfig, names: &[&str], ratio: f64) {
    rig.errors.volts.extend(names.iter().map(|name| ((*name).into(), ratio)));
}

fn tilt(rig: &mut RigConfig, names: &[&str], about_x_rad: f64) {
    rig.errors.tilt_rad.extend(names.iter().map(|name| ((*name).into(), [about_x_rad, 0.0, 0.0])));
}

fn path(rig: &mut RigConfig, between: &str, y_m: f64) {
    let text = format!(
        "[[paths]]\nbetween = {between}\nin = [\"AJB\"]\nposition_m = [0.0, {y_m:?}, 0.02]\n\
         stiffness_n_per_m = [0.0, 0.0, 3e6]\nrotation_nm_per_rad = [0.0, 0.0, 0.0]\n\
         damping_s = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]\n"
    );
    rig.paths = RigConfig::from_toml(&text).unwrap().paths;
}

fn exchange(rig: &mut RigConfig, one: &str, other: &str) {
    let at = |name: &str| rig.response_points().find(|point| point.name == name).unwrap().position_m;
    let by: [f64; 3] = std::array::from_fn(|axis| at(other)[axis] - at(one)[axis]);
    offset(rig, one, by);
    offset(rig, other, by.map(|by| -by));
}

const VIBROMETERS: [&str; 5] = ["ldv_a", "ldv_b", "vib_x", "vib_y", "vib_z"];

const FALSE: [False; 17] = [
    (
        "the contact is 0.1 to 0.2 mm too high or low",
        |rig, i| offset(rig, "contact", [0.0, [1.5e-4, -1.5e-4, 2e-4, -1e-4, 1e-4][i], 0.0]),
        &["height", "contact's centre"],
    ),
    (
        "a spot is 0.15 mm off",
        |rig, i| {
            let by = [[0.0, 1.5e-4, 0.0], [-1.5e-4, 0.0, 0.0], [0.0, -1.5e-4, 0.0]][i % 3];
            offset(rig, ["ldv_a", "ldv_b"][i % 2], by);
        },
        &["spot"],
    ),
    (
        "the hammer's force cell is 5 % off",
        |rig, i| volts(rig, &["force"], [1.05, 0.95][i % 2]),
        &["hammer's force", "force cell"],
    ),
    (
        "all vibrometers are 3 to 5 % off",
        |rig, i| volts(rig, &VIBROMETERS, [1.04, 0.96, 1.03, 0.97, 1.05][i]),
        &["vibrometer"],
    ),
    (
        "one vibrometer is 4 % off",
        |rig, i| volts(rig, &[["ldv_a", "ldv_b", "vib_z"][i % 3]], [0.96, 1.04][i % 2]),
        &["vibrometer"],
    ),
    (
        "a clamp on specimen B of 3000 to 10 000 N/µm",
        |rig, i| {
            let k = [3e9, 1e10, 5e9, 3e9, 1e10][i];
            rig.clamp_b.rigid = false;
            rig.clamp_b.loaded.stiffness_n_per_m = [k; 3];
            rig.clamp_b.loaded.rotation_nm_per_rad = [1e-4 * k; 3];
        },
        &["specimen B", "clamp"],
    ),
    (
        "the contact is two patches 5 mm apart, 30 and 70 %",
        |rig, _| {
            let patch = |x: f64, share| Patch { offset_m: [x, 0.0, 0.0], share };
            rig.contact.patches = vec![patch(2.5e-3, 0.3), patch(-2.5e-3, 0.7)];
        },
        &["contact's centre", "spot"],
    ),
    (
        "a cable of 3 N/µm joins the arms in the assembly",
        |rig, _| path(rig, "[\"arm_a\", \"arm_b\"]", 0.03),
        &["cable"],
    ),
    (
        "a wire of 3 N/µm holds arm B in the assembly",
        |rig, _| path(rig, "[\"arm_b\", \"ground\"]", -0.03),
        &["cable"],
    ),
    (
        "points of arm B three times worse than stated",
        |rig, _| rig.errors.position_m *= 3.0,
        &["arm B", "Point B"],
    ),
    (
        "points of the specimens three times worse than stated",
        |rig, _| rig.errors.specimen_point_m *= 3.0,
        &["points on the specimen", "Point C", "Point D"],
    ),
    (
        "two points exchanged",
        |rig, i| {
            let [one, other] = [["C1", "C2"], ["B1", "B2"], ["C1", "C3"], ["D1", "D2"], ["B1", "BL"]][i];
            exchange(rig, one, other);
        },
        &["exchanged"],
    ),
    (
        "a point 1.5 to 2.5 mm off",
        |rig, i| {
            let by = [[0.0, 2e-3, 0.0], [1.5e-3, 0.0, 0.0], [0.0, 0.0, 2.5e-3]][i % 3];
            offset(rig, ["C1", "C3", "B2", "D2", "C4"][i], by);
        },
        &["Point "],
    ),
    ("delays of 20 µs", |rig, _| rig.errors.skew_s *= 10.0, &["delay"]),
    (
        "k_T drifts by 5 to 10 %",
        |rig, i| rig.contact.drift_per_hit = [0.07, -0.07, 0.1, 0.05, -0.1][i] / HITS,
        &["contact changed"],
    ),
    (
        "the rig leans by 2 to 3° about x against all sensors and the hammer",
        |rig, i| {
            let by = [0.04, -0.04, 0.05, 0.035, -0.05][i];
            tilt(rig, &["ldv_a", "ldv_b", "vibrometer", "hammer"], by);
        },
        &["tilt", "direction"],
    ),
    (
        "one spot's vibrometer is tilted by 2 to 3° about x",
        |rig, i| tilt(rig, &[["ldv_a", "ldv_b"][i % 2]], [0.035, -0.035, 0.05, 0.04, -0.05][i]),
        &["vibrometer on", "the spot on"],
    ),
];

#[test]
#[ignore = "docs/accuracy.md, by `cargo xtask accuracy`: false assumptions"]
fn false_assumptions() {
    let (first, rigs) = (count("FIRST", 6600), count("RIGS", 12) as usize);
    let only = count("ROW", u64::MAX);
    let wanted: Vec<(usize, usize)> = (0..FALSE.len())
        .filter(|row| only == u64::MAX || *row as u64 == only)
        .flat_map(|row| (0..rigs).map(move |i| (row, i)))
        .collect();
    // covered, told with the cause, told with another, missed in silence
    let outcomes = each(&wanted, |(row, i)| {
        let (name, falsify, causes) = FALSE[*row];
        let number = first + (20 * row + i) as u64;
        let stated = sound(number);
        let mut rig = stated.clone();
        falsify(&mut rig, i % EXAMPLES);
        let found = measured(number, &stated, &rig);
        let answer = answer(&rig, &found);
        let covered = answer.is_some_and(|own| own.covers);
        let told = answer.is_none() || !found.contradictions.is_empty();
        let right = told && causes.iter().any(|cause| found.why.contains(cause));
        let error = answer.map(|own| format!("{:+.1} % ± {:.1} %", 100.0 * own.error, 100.0 * own.half));
        println!(
            "{name}: rig {number}: {error:?} covered {covered} told {told} right {right}: {}",
            found.why
        );
        (*row, [covered, told && right, told && !right, !covered && !told])
    });
    let line = |row: &usize| {
        let own: Vec<[bool; 4]> = outcomes.iter().filter(|(r, _)| r == row).map(|(_, own)| *own).collect();
        let counted = |n: usize| own.iter().filter(|own| own[n]).count();
        let good = own.iter().filter(|own| own[0] || own[1]).count();
        let [covered, right, other, silent] = [0, 1, 2, 3].map(counted);
        format!("| {} | {} | {covered} | {right} | {other} | {silent} | {good} |", FALSE[*row].0, own.len())
    };
    let mut rows: Vec<usize> = outcomes.iter().map(|(row, _)| *row).collect();
    rows.sort_unstable();
    rows.dedup();
    let lines: Vec<String> = rows.iter().map(line).collect();
    print_table(
        "false-assumptions",
        "what is false | campaigns | covered | told, with the cause | told, without it | missed in silence | covered or told with the cause",
        &lines,
    );
}
