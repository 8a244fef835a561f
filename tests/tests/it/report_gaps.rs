//! Reports of incomplete campaigns, and of contacts that slip: each states what is missing, and its
//! page is complete.
#![allow(clippy::unwrap_used)]

use jointrig_tests::browser::{Browser, Look};
use jointrig_tests::command::jointrig;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Runs a command that must succeed.
fn done(command: &mut Command) -> String {
    let out = command.output().unwrap();
    assert!(out.status.success(), "{command:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

/// Measures a campaign with this plan on this rig (`sim:…`).
fn measured(folder: &Path, name: &str, plan: &str, device: &str) -> PathBuf {
    let file = created(folder, name, plan);
    done(jointrig().args(["campaign", "run", "--yes", "--device", device]).arg(&file));
    file
}

fn created(folder: &Path, name: &str, plan: &str) -> PathBuf {
    let (plan_file, file) = (folder.join(format!("{name}.toml")), folder.join(format!("{name}.jrig")));
    std::fs::write(&plan_file, plan).unwrap();
    done(jointrig().args(["campaign", "new"]).arg(&file).arg("--plan").arg(&plan_file));
    file
}

/// The contents of a report.
struct Said {
    results: Value,
    /// The text of the page, and the names of its figures.
    words: String,
    figures: Vec<String>,
}

impl Said {
    fn lacks(&self, what: &str) -> bool {
        self.results["missing"].as_array().into_iter().flatten().any(|m| m.as_str().unwrap().contains(what))
    }

    fn draws(&self, figure: &str) -> bool {
        self.figures.iter().any(|name| name == figure)
    }
}

/// The report of a file: opened at two widths, with every figure interactive, no errors, and no
/// wider than the window.
fn reported(browser: &mut Browser, file: &Path) -> Said {
    let out = file.with_extension("report");
    done(jointrig().arg("report").arg(file).arg("--out").arg(&out));
    let results: Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("results.json")).unwrap()).unwrap();
    let (mut words, mut figures) = (String::new(), Value::Null);
    for look in [Look::DESK, Look::HAND] {
        let mut page = browser.open(&out.join("report.html"), look);
        page.eval(
            "report.FIGURES.map(f => report.enliven(document.getElementById('fig-' + f.name), f)).length",
        );
        page.until("[...report.alive.values()].every(charts => charts.every(c => c.drawn > 0))");
        assert_eq!(page.errors(), Vec::<String>::new(), "{}: {look:?}", file.display());
        assert_eq!(page.requests(), Vec::<String>::new(), "{}: {look:?}", file.display());
        let wide = page.eval("document.documentElement.scrollWidth").as_u64().unwrap();
        assert!(wide <= u64::from(look.width), "{}: {look:?}: {wide} px wide", file.display());
        words = page
            .eval("document.querySelector('main').textContent")
            .as_str()
            .unwrap()
            .replace('\u{a0}', " ")
            .replace('\u{2060}', "");
        figures = page.eval("report.FIGURES.map(f => f.name)");
    }
    let missing = results["missing"].as_array().into_iter().flatten();
    for one in missing.map(|m| m.as_str().unwrap()) {
        assert!(words.contains(one) || one.contains('`'), "`{one}` is not on the page");
    }
    let figures = figures.as_array().unwrap().iter().map(|f| f.as_str().unwrap().to_owned()).collect();
    Said { results, words, figures }
}

#[test]
fn contacts_that_slip_are_shown_as_such() {
    let folder = tempfile::tempdir().unwrap();
    let mut browser = Browser::start();
    // an eighth of the time: fewer points, shorter records; slip is tested with the shaker
    let plan = include_str!("../../../docs/plans/small.toml").replace("length_s = 2.0", "length_s = 1.0");
    for (rig, shape) in [("jenkins", "gross-slip"), ("iwan", "microslip")] {
        let device = format!("sim:{}/../hil-sim/rigs/{rig}.toml", env!("CARGO_MANIFEST_DIR"));
        let file = measured(folder.path(), rig, &plan, &device);
        let levels = ["--when", "after", "--freq", "100", "--amplitude", "3e-7", "8e-7", "1.3e-6", "1.8e-6"];
        done(jointrig().arg("shaker").arg(&file).args(["--device", &device]).args(levels));
        let said = reported(&mut browser, &file);
        assert!(said.draws("backbone") && said.draws("loop-parts") && said.draws("levels"), "{rig}");
        assert!(said.words.contains(shape), "{rig}: {shape}");
        let slope = &said.results["backbones"][0]["stiffness_n_per_m"];
        let off = slope.as_f64().unwrap() / 180e6 - 1.0;
        // the raw force lacks arm B's inertia, some per cent at 100 Hz
        assert!(off.abs() < 0.08, "{rig}: {slope}");
        assert!(said.words.contains("k_T of the contact: not known"), "{rig}");
    }
}

#[test]
fn a_campaign_without_levels_says_what_figures_would_need() {
    let folder = tempfile::tempdir().unwrap();
    let mut browser = Browser::start();
    let plan = include_str!("../../../docs/plans/small.toml");
    let said = reported(&mut browser, &measured(folder.path(), "small", plan, "sim:"));
    assert!(!said.draws("levels") && said.draws("receptances"));
    assert!(said.words.contains("needs levels of the shaker"), "{}", said.words);
    assert!(said.lacks("effective mass is not known"));
}

#[test]
fn configurations_and_cells_that_are_missing_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut browser = Browser::start();
    let small = include_str!("../../../docs/plans/small.toml");

    // one configuration is missing from the plan
    let (before, b) = small.split_once("[[configuration]]\nname = \"B\"").unwrap();
    let without = format!("{before}{}", &b[b.find("[[configuration]]").unwrap()..]);
    let said = reported(&mut browser, &measured(folder.path(), "without-b", &without, "sim:"));
    assert!(said.lacks("Substructuring needs A, B and AJB; missing: B."));
    assert!(said.words.contains("needs FRFs of A, B and the assembly"));
    assert!(said.draws("receptances") && !said.draws("joint-spectrum"));

    // hardly any hit can be good: only a very narrow range of force is accepted
    let strict = small
        .replace("weak_n = 30.0", "weak_n = 50.0")
        .replace("strong_n = 75.0", "strong_n = 50.2")
        .replace("most = 8", "most = 2");
    let said = reported(&mut browser, &measured(folder.path(), "strict", &strict, "sim:"));
    assert!(said.lacks("given up") && said.lacks("has not been measured"), "{}", said.results["missing"]);
    assert!(said.words.contains("not known.") && said.draws("cells") && said.draws("pulses"));
    assert_eq!(said.results["answer"]["contact"]["k_t_n_per_m"], Value::Null);
}

#[test]
fn imported_frfs_alone_make_a_report() {
    let folder = tempfile::tempdir().unwrap();
    let mut browser = Browser::start();
    let plan = include_str!("../../../docs/plans/small.toml").replace("length_s = 2.0", "length_s = 1.0");
    let file = measured(folder.path(), "own", &plan, "sim:");
    let out = folder.path().join("export");
    done(jointrig().arg("export").arg(&file).args(["--format", "npz", "--out"]).arg(&out));
    let empty = created(folder.path(), "imported", &plan);
    for name in ["A", "B", "AJB"] {
        let npz = out.join(format!("frf/{name}.npz"));
        done(jointrig().arg("import").arg(npz).arg("--into").arg(&empty).args(["--configuration", name]));
    }
    let said = reported(&mut browser, &empty);
    assert!(said.lacks("AJB: its FRFs were imported from") && said.draws("receptances"));
    assert!(!said.draws("cells") && !said.draws("coherence") && !said.draws("pulses"));
    assert!(said.words.contains("needs a campaign's own records"), "{}", said.words);
}
