//! The commands of documentation pages, run one by one as a user would type them.
#![allow(clippy::unwrap_used)]

use jointrig::friction::loops::area;
use jointrig::friction::{FrictionLaw, LawKind};
use jointrig_tests::command::jointrig;
use std::path::Path;

const TUTORIAL: &str = include_str!("../../../docs/tutorial.md");
const INSTALL: &str = include_str!("../../../docs/install.md");
const ANOTHER_TOOL: &str = include_str!("../../../examples/another-tool/README.md");
const FRICTION_LAWS: &str = include_str!("../../../docs/friction-laws.md");
const STUDIES: &str = include_str!("../../../docs/studies.md");
const FROM_PYFBS: &str = include_str!("../../../docs/coming-from-pyfbs.md");

/// A fenced block: its kind and its lines.
fn blocks(page: &str) -> Vec<(String, Vec<String>)> {
    let mut blocks = Vec::new();
    let mut open: Option<(String, Vec<String>)> = None;
    for line in page.lines() {
        match (line.strip_prefix("```"), &mut open) {
            (Some(kind), None) => open = Some((kind.into(), Vec::new())),
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (None, Some((_, lines))) => lines.push(line.into()),
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "a block is not closed");
    blocks
}

/// Whether a line matches the page; `…` matches anything.
fn is_like(line: &str, pattern: &str) -> bool {
    let mut rest = line;
    let mut parts = pattern.split('…').enumerate().peekable();
    while let Some((number, part)) = parts.next() {
        let Some(at) = rest.find(part) else { return false };
        if number == 0 && at > 0 || parts.peek().is_none() && !part.is_empty() && !rest.ends_with(part) {
            return false;
        }
        rest = &rest[at + part.len()..];
    }
    true
}

/// Runs a page's commands in a folder and compares their output with the page; returns the number
/// of commands.
fn run(page: &str, folder: &Path) -> usize {
    let (mut said, mut commands) = (String::new(), 0);
    for (kind, lines) in blocks(page) {
        match kind.as_str() {
            "sh" => {
                for line in lines {
                    let mut words = shlex::split(&line).unwrap().into_iter();
                    assert_eq!(words.next().as_deref(), Some("jointrig"), "{line}");
                    let out = jointrig().args(words).current_dir(folder).output().unwrap();
                    let errors = String::from_utf8_lossy(&out.stderr);
                    assert!(out.status.success(), "{line}: {errors}");
                    said = format!("{errors}{}", String::from_utf8(out.stdout).unwrap());
                    commands += 1;
                }
            }
            "text" => {
                let mut from = 0;
                let all: Vec<&str> = said.lines().collect();
                for pattern in lines {
                    let place = all[from..].iter().position(|line| is_like(line, &pattern));
                    let Some(place) = place else { panic!("`{pattern}` is not in:\n{said}") };
                    from += place + 1;
                }
            }
            other => panic!("a block of kind `{other}`"),
        }
    }
    commands
}

#[test]
fn every_command_of_the_tutorial_does_what_the_page_says() {
    let folder = tempfile::tempdir().unwrap();
    let commands = run(TUTORIAL, folder.path());
    assert!(commands >= 12, "{commands} commands");
}

/// Unpacking an archive and installing a wheel are run by `cargo xtask release --check`.
#[test]
fn every_command_of_a_fresh_pc_does_what_the_page_says() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(run(INSTALL, folder.path()), 3);
}

#[test]
fn files_of_another_tool_give_their_joint() {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/another-tool");
    let folder = tempfile::tempdir().unwrap();
    for of in ["", "frfs", "positions"] {
        std::fs::create_dir_all(folder.path().join(of)).unwrap();
        for entry in std::fs::read_dir(example.join(of)).unwrap().flatten() {
            if entry.file_type().unwrap().is_file() {
                std::fs::copy(entry.path(), folder.path().join(of).join(entry.file_name())).unwrap();
            }
        }
    }
    assert_eq!(run(ANOTHER_TOOL, folder.path()), 6);
}

/// The page's example, and the known law of its loops, again from the files that the command wrote.
#[test]
fn the_friction_law_of_the_example_is_found_written_and_simulated_again() {
    let folder = tempfile::tempdir().unwrap();
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/friction-laws/loops.csv");
    std::fs::copy(example, folder.path().join("loops.csv")).unwrap();
    assert_eq!(run(FRICTION_LAWS, folder.path()), 2);
    let text = std::fs::read_to_string(folder.path().join("law/law.json")).unwrap();
    let written: serde_json::Value = serde_json::from_str(&text).unwrap();
    let law = &written["laws"][0];
    let value = |name: &str| law[name].as_f64().unwrap();
    let values = ["k_t_n_per_m", "limit_n", "chi", "beta"].map(value);
    for (number, truth) in [180e6, 120.0, -0.4, 0.6].into_iter().enumerate() {
        let interval = &law["parameters"][number]["ci95"];
        let (low, high) = (interval[0].as_f64().unwrap(), interval[1].as_f64().unwrap());
        assert!(low < truth && truth < high, "{truth}: {interval}");
    }
    let law = FrictionLaw::new(LawKind::Iwan, &values).unwrap();
    let table = |name: &str| -> Vec<Vec<String>> {
        let mut rows = csv::Reader::from_path(folder.path().join("law").join(name)).unwrap();
        rows.records().map(|row| row.unwrap().iter().map(String::from).collect()).collect()
    };
    let number = |text: &String| text.parse::<f64>().unwrap();
    let sliders: Vec<[f64; 2]> =
        table("elements.csv").iter().map(|row| [number(&row[1]), number(&row[5])]).collect();
    let load: f64 = table("elements.csv").iter().map(|row| number(&row[4])).sum();
    assert!((load / 400.0 - 1.0).abs() < 1e-9, "{load} N");
    let points = table("loops.csv");
    for (place, name) in ["small", "middle", "large"].into_iter().enumerate() {
        let own: Vec<&Vec<String>> = points.iter().filter(|row| row[0] == name).collect();
        let x: Vec<f64> = own.iter().map(|row| number(&row[1])).collect();
        let measured: Vec<f64> = own.iter().map(|row| number(&row[2])).collect();
        let mut elements = vec![0.0; x.len()];
        for [k, limit] in &sliders {
            let one = FrictionLaw::new(LawKind::Jenkins, &[*k, *limit]).unwrap().steady(&x);
            elements.iter_mut().zip(one).for_each(|(sum, force)| *sum += force);
        }
        let energy = area(&x, &measured);
        let std = written["loops"][place]["energy_std_j"].as_f64().unwrap();
        for again in [area(&x, &law.steady(&x)), area(&x, &elements)] {
            assert!((again - energy).abs() < (0.02 * energy).max(3.0 * std), "{name}: {again} of {energy} J");
        }
    }
}

/// The page's study; the friction of each campaign is that of the rig's law at the energy of its
/// wear run, and so is the law that was exported.
#[test]
fn the_study_finds_the_law_by_which_the_contact_wears() {
    let folder = tempfile::tempdir().unwrap();
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/study");
    for name in ["rig.toml", "plan.toml", "study.csv"] {
        std::fs::copy(example.join(name), folder.path().join(name)).unwrap();
    }
    assert_eq!(run(STUDIES, folder.path()), 20);
    let json = |name: &str| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(folder.path().join(name)).unwrap()).unwrap()
    };
    let energy_j = |file: &str| -> f64 {
        let out = jointrig().args(["wear", file, "--json"]).current_dir(folder.path()).output().unwrap();
        let wear: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        wear["wear"]["energy_j"].as_f64().unwrap()
    };
    // rig.toml; a level adds less than 0.1 J
    let friction = |energy_j: f64| 0.4 * (1.0 + 0.5 * -(-energy_j / 8.0).exp_m1());
    let trend = json("trend/trend.json");
    for one in trend["campaigns"].as_array().unwrap() {
        let file = one["file"].as_str().unwrap();
        let truth = friction(if file == "fresh.jrig" { 0.0 } else { energy_j(file) });
        let found = one["value"]["mean"].as_f64().unwrap();
        // raw loops: 1 % for arm B's inertia, 1 % for what the level wears
        assert!((found / truth - 1.0).abs() < 0.02, "{file}: {found}, {truth}");
    }
    let law = &json("law/law.json")["laws"][0];
    let energy = energy_j("worn-5.jrig");
    let k_t = 60e6 * (1.0 + 0.3 * -(-energy / 16.0).exp_m1());
    let value = |name: &str| law[name].as_f64().unwrap();
    assert!((value("k_t_n_per_m") / k_t - 1.0).abs() < 0.03, "{law} {k_t}");
    assert!((value("limit_n") / (150.0 * friction(energy)) - 1.0).abs() < 0.02, "{law}");
    assert!(folder.path().join("law/elements.csv").is_file());
    assert!(folder.path().join("cycles/wear.csv").is_file());
}

#[test]
fn the_code_for_newcomers_from_pyfbs_stands_in_an_example_that_runs() {
    let example = include_str!("../../../host/examples/frf_of_records.rs");
    let (_, after) = FROM_PYFBS.split_once("host/examples/frf_of_records.rs)):\n").unwrap();
    let code: Vec<&str> = after.lines().skip(1).take_while(|line| line.starts_with("    ")).collect();
    assert!(code.len() >= 4, "{code:?}");
    for line in code {
        assert!(example.lines().any(|own| own == line), "`{line}` is not in the example");
    }
}

#[test]
fn anything_may_stand_for_an_ellipsis_and_nothing_else() {
    assert!(is_like("a 12 b", "a … b") && !is_like("a 12 c", "a … b") && !is_like("x a 1 b", "a … b"));
}
