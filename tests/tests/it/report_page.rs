//! The report's page in a browser: every figure is present and interactive, no network request, no
//! overflow of the window.
#![allow(clippy::unwrap_used)]

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use jointrig_tests::browser::{Browser, Look, Page};
use jointrig_tests::campaign::one_second;
use jointrig_tests::command::jointrig;
use jointrig_tests::origins;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// Runs a command that must succeed.
fn done(command: &mut Command) -> String {
    let out = command.output().unwrap();
    assert!(out.status.success(), "{command:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

/// A campaign of all three configurations with the shaker's levels, as short as coherence allows:
/// two hits in each cell.
fn campaign() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let plan = one_second(include_str!("../../../docs/plans/demo.toml"))
            .replace("wanted = 3", "wanted = 2")
            .replace("minimum = 3", "minimum = 2");
        let (plan_file, file) = (folder.path().join("plan.toml"), folder.path().join("campaign.jrig"));
        std::fs::write(&plan_file, plan).unwrap();
        done(jointrig().args(["campaign", "new"]).arg(&file).arg("--plan").arg(&plan_file));
        let levels = ["--freq", "100", "200", "250", "--amplitude", "1e-7", "2e-7"];
        done(jointrig().arg("shaker").arg(&file).args(["--device", "sim:"]).args(levels));
        done(jointrig().args(["campaign", "run"]).arg(&file).args(["--device", "sim:", "--yes"]));
        let printed = done(
            jointrig()
                .arg("report")
                .arg(&file)
                .arg("--out")
                .arg(folder.path())
                .args(["--figures", "svg,csv"]),
        );
        assert!(printed.lines().count() <= 15, "the terminal ends with at most fifteen lines:\n{printed}");
        assert!(printed.starts_with("SIMULATED rig"), "{printed}");
        folder
    });
    folder.path()
}

fn report() -> PathBuf {
    campaign().join("report.html")
}

/// Each figure by name.
fn figures(page: &mut Page<'_>) -> Vec<String> {
    let names = page.eval("report.FIGURES.map(f => f.name)");
    names.as_array().unwrap().iter().map(|n| n.as_str().unwrap().to_owned()).collect()
}

/// Number of figures of this campaign: all except those that need slip.
const EXPECTED: usize = 28;

/// Centre of a figure's first plot, after it was scrolled into view and became interactive.
fn middle(page: &mut Page<'_>, name: &str) -> [f64; 2] {
    page.eval(&format!(
        "document.getElementById('fig-{name}').scrollIntoView({{block:'start',behavior:'instant'}})"
    ));
    page.until(&format!("report.alive.has('{name}')"));
    let at = page.eval(&format!(
        "(() => {{ const f = document.getElementById('fig-{name}'), o = f.querySelector('.u-over, .turned') || f.querySelector('.plot svg'); o.scrollIntoView({{block:'center',behavior:'instant'}}); \
         const r = o.getBoundingClientRect(); return [r.left + r.width / 2, r.top + r.height / 2] }})()"
    ));
    [at[0].as_f64().unwrap(), at[1].as_f64().unwrap()]
}

fn view(page: &mut Page<'_>, name: &str) -> Value {
    page.eval(&format!(
        "JSON.stringify(report.alive.get('{name}').map(c => c.view || [c.yaw, c.pitch, c.size, c.at]))"
    ))
}

#[test]
fn the_page_is_whole_in_every_light_and_at_every_width() {
    let mut browser = Browser::start();
    for look in [Look::DESK, Look { dark: true, ..Look::DESK }, Look::HAND, Look { dark: true, ..Look::HAND }]
    {
        let mut page = browser.open(&report(), look);
        let names = figures(&mut page);
        assert_eq!(names.len(), EXPECTED, "{names:?}");
        for name in &names {
            middle(&mut page, name);
        }
        page.until("[...report.alive.values()].every(charts => charts.every(c => c.drawn > 0))");
        // before the test itself reads back pixels, which causes a warning of Chromium
        assert_eq!(page.errors(), Vec::<String>::new(), "{look:?}");
        assert_eq!(page.requests(), Vec::<String>::new(), "{look:?}");
        let wide = page.eval("document.documentElement.scrollWidth").as_u64().unwrap();
        assert!(wide <= u64::from(look.width), "{look:?}: {wide} px wide");
        let blank = page.eval(BLANK);
        assert_eq!(blank, serde_json::json!([]), "{look:?}: blank panels");
        let touching = page.eval(TOUCHING);
        assert_eq!(touching, serde_json::json!([]), "{look:?}: labels over one another");
    }
}

/// Panels whose canvas shows only axes: at least 40 pixels, the size of one point, must differ from
/// background and grid.
const BLANK: &str = include_str!("../page_probes/blank_panels.js");

/// Tick labels of the static drawings that overlap.
const TOUCHING: &str = include_str!("../page_probes/touching_labels.js");

#[test]
fn every_figure_reacts_to_drag_wheel_and_keys_and_returns() {
    let mut browser = Browser::start();
    let mut page = browser.open(&report(), Look::DESK);
    for name in figures(&mut page) {
        // linked figures were moved by earlier ones; a focused element is scrolled into view
        page.eval(&format!("document.getElementById('fig-{name}').focus()"));
        page.key("0");
        let [x, y] = middle(&mut page, &name);
        let whole = view(&mut page, &name);
        // a matrix is not a chart: it only reacts to keys
        let matrix =
            page.eval(&format!("report.alive.get('{name}').every(c => !c.plot && !c.scene)")) == true;
        page.drag([x - 40.0, y - 20.0], [x + 40.0, y + 25.0]);
        if !matrix {
            assert_ne!(view(&mut page, &name), whole, "{name}: drag");
            page.click([x, y], 2);
            assert_eq!(view(&mut page, &name), whole, "{name}: double click returns");
            page.eval(&format!("document.getElementById('fig-{name}').focus()"));
            page.wheel([x, y], -120.0);
            page.until(&format!("JSON.stringify(report.alive.get('{name}').map(c => c.view || [c.yaw, c.pitch, c.size, c.at])) !== {whole}"));
        }
        page.eval(&format!("document.getElementById('fig-{name}').focus()"));
        page.key("0");
        if !matrix {
            assert_eq!(view(&mut page, &name), whole, "{name}: 0 returns");
        }
        page.key("ArrowRight");
        page.key("ArrowRight");
        let said = page.eval(&format!("document.querySelector('#fig-{name} .readout').textContent + (report.alive.get('{name}')[0].yaw || '')"));
        assert_ne!(said, "", "{name}: the arrow keys say nothing");
        // the exported files contain numbers and curves
        let csv = page.eval(&format!("report.csvOf(report.FIGURES.find(f => f.name === '{name}'), document.getElementById('fig-{name}'))"));
        assert!(csv.as_str().unwrap().lines().count() > 1, "{name}: csv");
        let svg = page.eval(&format!("report.svgOf(report.FIGURES.find(f => f.name === '{name}'), document.getElementById('fig-{name}'))"));
        assert!(svg.as_str().unwrap().starts_with("<svg xmlns="), "{name}: svg");
    }
    assert_eq!(page.errors(), Vec::<String>::new());
}

#[test]
fn names_can_be_hidden_and_the_light_switched() {
    let mut browser = Browser::start();
    let mut page = browser.open(&report(), Look::DESK);
    middle(&mut page, "specimens");
    let hidden = "document.querySelector('#fig-specimens .legend button').click(), report.alive.get('specimens')[0].hidden.size";
    assert_eq!(page.eval(hidden), 1);
    let paper = "getComputedStyle(document.body).backgroundColor";
    let light = page.eval(paper);
    page.eval("document.querySelector('#page-tools button').click()");
    assert_ne!(page.eval(paper), light);
    assert_eq!(page.errors(), Vec::<String>::new());
}

#[test]
fn drawings_are_taken_away_whole_and_axes_change_their_spread() {
    let mut browser = Browser::start();
    let mut page = browser.open(&report(), Look::DESK);
    let count = |page: &mut Page<'_>, name: &str, mark: &str| {
        page.eval(&format!("report.svgOf(report.FIGURES.find(f => f.name === '{name}'), document.getElementById('fig-{name}')).split('{mark}').length - 1"))
            .as_u64()
            .unwrap()
    };
    // the background, and a square for each of 276 cells, or each pair of six values and six
    // motions
    assert!(count(&mut page, "cells", "<rect") > 276 && count(&mut page, "participation", "<rect") > 36);
    assert!(count(&mut page, "geometry", "<circle") >= 21 && count(&mut page, "geometry", ">AZ1<") == 1);

    middle(&mut page, "noise-floor");
    let spread = "(k => { [...document.querySelectorAll('#fig-noise-floor .tools button')].find(b => b.textContent === k).click(); const c = report.alive.get('noise-floor')[0]; return [c.panel.y.scale, c.plot.scales.y.distr, c.view.y[0]] })('log y')";
    let even = page.eval(spread);
    assert_eq!([&even[0], &even[1], &even[2]], ["linear".into(), Value::from(1), 0.into()].each_ref());
    let log = page.eval(spread);
    assert_eq!([&log[0], &log[1]], ["log".into(), Value::from(3)].each_ref());

    let [x, y] = middle(&mut page, "interface-modes");
    page.drag([x - 9.0, y], [x - 8.0, y]);
    let said = page.eval("document.querySelector('#fig-interface-modes .readout').textContent");
    assert!(said.as_str().unwrap().contains("singular value"), "{said}");
    let motion = page.eval("Math.max(...report.arms().motion)");
    assert_eq!(motion, 1, "the arms move as far as there is room");
    assert_eq!(page.errors(), Vec::<String>::new());
}

#[test]
fn terms_are_linked_to_their_meaning_once() {
    let mut browser = Browser::start();
    let mut page = browser.open(&report(), Look::DESK);
    let links = page.eval("[...document.querySelectorAll('a.word')].map(a => [a.getAttribute('href').slice(1), document.getElementById(a.getAttribute('href').slice(1))?.nextElementSibling?.textContent || ''])");
    let links = links.as_array().unwrap();
    let linked: BTreeSet<&str> = links.iter().map(|l| l[0].as_str().unwrap()).collect();
    assert_eq!(linked.len(), links.len(), "a term is linked twice: {links:?}");
    assert!(links.iter().all(|l| l[1].as_str().unwrap().len() > 9), "{links:?}");
    for word in ["kT", "keq", "T", "Δx", "FBS", "IDM", "virtual-point", "internals", "CMIF", "coherence"] {
        let word = format!("word-{}", word.to_ascii_lowercase());
        assert!(linked.contains(word.as_str()), "{word} is not among {linked:?}");
    }
    assert_eq!(page.eval("document.body.innerText.includes('`')"), false);
}

#[test]
fn twenty_thousand_zooms_break_nothing() {
    let mut browser = Browser::start();
    let mut page = browser.open(&report(), Look::DESK);
    middle(&mut page, "receptances");
    // a small seeded generator, so that a failure is repeatable
    let worst = page.eval(
        "(() => {
            const chart = report.alive.get('receptances')[0], axis = chart.panel.x;
            let seed = 7; const random = () => (seed = (seed * 48271) % 2147483647) / 2147483647;
            let view = [...axis.range], most = 0;
            for (let n = 0; n < 20000; n++) {
                if (n % 50 === 0) view = [...axis.range];
                const at = view[0] * (view[1] / view[0]) ** random();
                view = report.zoomed(axis, view, random() < .6 ? .3 + .6 * random() : 1.2 + random(), at);
                if (!(view[0] < view[1] && view[0] >= axis.range[0] && view[1] <= axis.range[1])) return 'view ' + view;
                const labels = report.ticks('log', view[0], view[1], 300, false).filter(t => t.label);
                most = Math.max(most, labels.length);
                if (n % 200 === 0) chart.show({ x: view });
            }
            return most;
        })()",
    );
    assert!(worst.as_u64().is_some_and(|most| (2..=20).contains(&most)), "{worst}");
    assert_eq!(page.errors(), Vec::<String>::new());
}

#[test]
fn without_scripts_and_on_paper_nothing_is_lost() {
    let mut browser = Browser::start();
    for look in [Look { scripts: false, ..Look::DESK }, Look { scripts: false, ..Look::HAND }] {
        let mut page = browser.open(&report(), look);
        let shown = page.eval("[...document.querySelectorAll('figure')].filter(f => f.querySelector('.plot > svg')?.getBoundingClientRect().height > 40).length");
        assert_eq!(shown, EXPECTED, "{look:?}");
        let wide = page.eval("document.documentElement.scrollWidth").as_u64().unwrap();
        assert!(wide <= u64::from(look.width), "{look:?}: {wide} px wide");
        assert_eq!(page.errors(), Vec::<String>::new());
    }
    let mut page = browser.open(&report(), Look::DESK);
    let pdf = page.pdf();
    // each page of a PDF is an object of this type; Chromium writes them uncompressed
    let bytes = BASE64_STANDARD.decode(pdf).unwrap();
    let pages = bytes.windows(11).filter(|w| *w == b"/Type /Page").count();
    let trees = bytes.windows(12).filter(|w| *w == b"/Type /Pages").count();
    assert!((4..=30).contains(&(pages - trees)), "{} pages", pages - trees);
}

/// Every number that states its position in results.json is found there, including those of tables
/// and of the first screen.
#[test]
fn every_number_is_found_in_the_results() {
    let results = results();
    let mut browser = Browser::start();
    let mut page = browser.open(&report(), Look::DESK);
    let told = page.eval(
        "[...document.querySelectorAll('[data-path]')].map(e => [e.dataset.path, e.textContent, e.matches('td.n') && !/[a-z]/i.test(e.textContent)])",
    );
    let told = told.as_array().unwrap();
    assert!(told.len() > 600, "{} numbers", told.len());
    for one in told {
        let (paths, text) = (one[0].as_str().unwrap(), one[1].as_str().unwrap());
        let numbers = origins::shown(text);
        let paths: Vec<&str> = paths.split(' ').collect();
        for path in &paths {
            let path = path.replace("%20", " ").replace("%25", "%");
            let value = results.pointer(&path).unwrap_or_else(|| panic!("{path} is not in results.json"));
            let value = value.as_f64().unwrap_or_else(|| panic!("{path} is no number"));
            let found = numbers.iter().any(|number| origins::agrees(value, *number));
            assert!(found, "{path}: {value} is shown as {text}");
        }
        // if there are only numbers, each has its path
        assert!(one[2] == false || numbers.len() == paths.len(), "{paths:?}: {text}");
    }
    let silent = page.eval(
        "[...document.querySelectorAll('td.n:not([data-path])')].map(e => e.textContent).filter(t => /[0-9]/.test(t))",
    );
    assert_eq!(silent, serde_json::json!([]), "cells of tables that say no path");
    // units are not numbers, nor is the percentage of an interval
    let screen = page.eval(
        "[...document.querySelectorAll('#answer .found:not(.warn) p, #answer .differ')].map(p => { const c = p.cloneNode(true); for (const e of c.querySelectorAll('[data-path]')) e.remove(); return c.textContent.replaceAll('95\u{a0}%', '') }).filter(t => /[0-9]/.test(t))",
    );
    assert_eq!(screen, serde_json::json!([]), "numbers of the first screen that say no path");
}

/// Every number in every figure's csv file is found in results.json at the position that the figure
/// states.
#[test]
fn every_number_of_a_csv_file_is_found_in_the_results() {
    let results = results();
    let html = std::fs::read_to_string(report()).unwrap();
    let (_, data) = html.split_once("id=\"figures\">").unwrap();
    let data: Value = serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap();
    let figures = data["figures"].as_array().unwrap();
    assert_eq!(figures.len(), EXPECTED);
    for figure in figures {
        let name = figure["name"].as_str().unwrap();
        let csv = std::fs::read_to_string(campaign().join(format!("figures/{name}.csv"))).unwrap();
        let count = origins::hold_csv(&results, figure, &csv);
        assert!(count > 1, "{name}: {count} numbers");
    }
}

fn results() -> Value {
    serde_json::from_str(&std::fs::read_to_string(campaign().join("results.json")).unwrap()).unwrap()
}

/// The static drawings and the interactive charts use the same rule for ticks.
#[test]
fn a_thousand_random_axes_have_the_same_ticks_in_both_languages() {
    use jointrig::report::axis_labels;
    use rand::{RngExt, SeedableRng};
    let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(16);
    let mut browser = Browser::start();
    let mut page = browser.open(&report(), Look::DESK);
    let mut asked = Vec::new();
    for _ in 0..1000 {
        let log = random.random::<bool>();
        let size = 10f64.powf(random.random_range(-12.0..9.0));
        let low = if log { size } else { size * random.random_range(-1.0..1.0) };
        let high = if log {
            size * 10f64.powf(random.random_range(0.01..9.0))
        } else {
            low + size * random.random_range(0.001..2.0)
        };
        asked.push((log, [low, high], random.random_range(60.0..1200.0), random.random::<bool>()));
    }
    let list: Vec<Value> = asked
        .iter()
        .map(|(log, [low, high], length, up)| {
            serde_json::json!([if *log { "log" } else { "linear" }, low, high, length, up])
        })
        .collect();
    let found = page.eval(&format!("{}.map(a => report.ticks(...a).map(t => t.label))", Value::Array(list)));
    for ((log, range, length, up), labels) in asked.into_iter().zip(found.as_array().unwrap()) {
        let ours = axis_labels(log, range, length, up);
        assert_eq!(serde_json::json!(ours), *labels, "{log} {range:?} {length} {up}");
    }
}

/// A plan may contain any names; none is interpreted as markup, and none breaks the page.
#[test]
fn hostile_names_break_nothing() {
    let mut results = results();
    results["source"]["file"] = "</script><script>alert(1)</script>]]>\u{202e}.jrig".into();
    let folder = tempfile::tempdir().unwrap();
    let long = "n".repeat(300);
    let hostile = ["<script>alert(1)</script>", "]]>", "</script>", "\u{202e}abc", &long, "a\"b'c&d"];
    let names: Vec<jointrig::results::Place> = hostile
        .iter()
        .enumerate()
        .map(|(i, name)| jointrig::results::Place {
            name: (*name).to_owned(),
            kind: "response",
            grouping: 1 + (i % 4) as u8,
            position_m: [0.01 * i as f64, 0.02, -0.01 * i as f64],
            direction: None,
        })
        .collect();
    let source = jointrig::results::Source {
        file: results["source"]["file"].as_str().unwrap().into(),
        ..Default::default()
    };
    let mut shown = jointrig::results::Results::new(source);
    shown.geometry = names;
    shown.missing = hostile.iter().map(|name| (*name).to_owned()).collect();
    shown.hits = (1..40)
        .map(|n| jointrig::results::HitRow {
            record: n,
            peak_n: 50.0 + n as f64,
            pulse_us: 3000 + n as u32,
            verdict: hostile[n as usize % 6].into(),
            kept: n % 2 == 0,
        })
        .collect();
    let file = folder.path().join("report.html");
    std::fs::write(&file, jointrig::report::page(&shown)).unwrap();
    let mut browser = Browser::start();
    for look in [Look::DESK, Look::HAND] {
        let mut page = browser.open(&file, look);
        for name in ["geometry", "pulses"] {
            middle(&mut page, name);
        }
        assert_eq!(page.eval("document.querySelectorAll('script').length"), 2);
        let wide = page.eval("document.documentElement.scrollWidth").as_u64().unwrap();
        assert!(wide <= u64::from(look.width), "{look:?}: {wide} px wide");
        assert_eq!(page.errors(), Vec::<String>::new());
    }
}
