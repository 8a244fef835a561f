//! Spectra and numbers of the live page equal those of the campaign file: the last hit's force, the
//! FRF of its cell, the views of the matrix.
#![allow(clippy::unwrap_used)]

use jointrig::analyse::{CampaignFile, KnownContact};
use jointrig::campaign::plan::configuration_name;
use jointrig::campaign::store::Store;
use jointrig::report::cell_records::Shown;
use jointrig::structure::Structure;
use jointrig_tests::browser::{Browser, Look, Page};
use jointrig_tests::command::jointrig;
use jointrig_tests::live::{self, Served, done, picture};
use serde_json::Value;

/// The value of an expression in the page, as numbers.
fn numbers(page: &mut Page<'_>, expression: &str) -> Vec<f64> {
    let found = page.eval(&format!("Array.from({expression})"));
    found.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// Whether two numbers are equal to the six digits that figures keep.
fn same(one: f64, other: f64) -> bool {
    (one - other).abs() <= 2e-6 * other.abs()
}

fn frf_is_the_analysis_one(page: &mut Page<'_>, store: &Store) {
    let last = store.records().unwrap().into_iter().flatten().last().unwrap();
    let cell = store.cells().unwrap().into_iter().find(|row| row.id == last.cell).unwrap().cell;
    let structure =
        *Structure::ALL.iter().find(|s| s.name() == configuration_name(cell.configuration)).unwrap();
    let file = CampaignFile::open(store, KnownContact::default()).unwrap();
    let frf = file.measured(structure, [10.0, 1000.0]).0.unwrap().0.to_receptance().unwrap();
    let plan = store.plan().unwrap();
    let hit = plan.geometry.impact.iter().find(|p| p.get_ref().name == cell.impact).unwrap();
    let direction = hit.get_ref().direction;
    let axis =
        ["x", "y", "z"][(0..3).max_by(|a, b| direction[*a].abs().total_cmp(&direction[*b].abs())).unwrap()];
    let output = frf.outputs().iter().position(|o| *o == format!("{}:{axis}", cell.response)).unwrap();
    let input = frf.inputs().iter().position(|i| *i == cell.impact).unwrap();

    let mark = |panel: usize, kind: &str, list: &str| {
        format!("live.alive.get('cell-frf')[{panel}].panel.marks.find(m => m.{kind}).{kind}.{list}")
    };
    let shown = numbers(page, &mark(0, "line", "y"));
    let (low, high) = (numbers(page, &mark(0, "ribbon", "low")), numbers(page, &mark(0, "ribbon", "high")));
    let coherence = numbers(page, &mark(1, "line", "y"));
    assert_eq!((shown.len(), coherence.len()), (frf.lines().len(), frf.lines().len()));
    let (variance, known) = (frf.variance().unwrap(), frf.coherence().unwrap());
    for (l, line) in frf.lines().iter().enumerate() {
        let size = line[(output, input)].norm();
        assert!(same(shown[l], size), "line {l}: {} instead of {size}", shown[l]);
        assert!(same(coherence[l], known[l][(output, input)]), "line {l}");
        let sigma = variance[l][(output, input)].sqrt();
        assert!(same(high[l], size + sigma) && low[l] < shown[l], "line {l}");
    }
}

/// At the lowest frequencies the force's spectrum equals the pulse's area.
fn force_is_the_pulse(page: &mut Page<'_>, store: &Store) {
    let last = store.records().unwrap().into_iter().flatten().last().unwrap();
    let shown = Shown::of(store, last.cell, &last).unwrap().unwrap();
    let around = shown.trigger - 100..shown.trigger + 200;
    let rest = shown.force_n[..100].iter().sum::<f64>() / 100.0;
    let area_mn_s = 1e3 * shown.force_n[around].iter().map(|f| f - rest).sum::<f64>() / shown.rate_hz;
    let force = numbers(page, "live.alive.get('force-spectrum')[0].panel.marks.find(m => m.line).line.y");
    assert!(force.len() > 50 && force.iter().all(|v| v.is_finite()));
    // noise between the pulse and the end of the force window is included in one of them only
    assert!((force[1] / area_mn_s - 1.0).abs() < 0.02, "{} instead of {area_mn_s} mN s", force[1]);
    let band =
        numbers(page, "live.alive.get('force-spectrum')[0].panel.marks.find(m => m.shade).shade.between");
    let along = "live.alive.get('force-spectrum')[0].panel.marks.find(m => m.line).line.x";
    let along = numbers(page, &format!("[{along}.first, {along}.step]"));
    let end = ((band[1] - along[0]) / along[1]).round() as usize;
    let half = 0.501 * force.iter().copied().fold(0.0, f64::max);
    assert!(force[end] >= half && force[end + 1] < half, "{} {} {half}", force[end], force[end + 1]);
}

#[test]
fn spectra_and_numbers_are_those_of_the_file() {
    let (folder, file) = live::campaign(include_str!("../../../docs/plans/small.toml"));
    done(jointrig().args(["campaign", "run"]).arg(&file).args(["--device", "sim:", "--yes"]));
    done(jointrig().arg("analyse").arg(&file).arg("--out").arg(folder.path()));
    let results = std::fs::read_to_string(folder.path().join("results.json")).unwrap();
    let results: Value = serde_json::from_str(&results).unwrap();
    let store = Store::open_read_only(&file).unwrap();
    let server = Served::of(&file);
    let mut browser = Browser::start();
    let mut page = browser.open_url(&server.url, Look::DESK);
    page.until("document.querySelectorAll('figure.ready').length === 4 && !!live.state.whole.estimate");
    picture(&mut page, "spectra-now");
    page.eval("document.getElementById('fig-force-spectrum').scrollIntoView()");
    picture(&mut page, "spectra-now-force");
    frf_is_the_analysis_one(&mut page, &store);
    force_is_the_pulse(&mut page, &store);

    page.key("2");
    let records: Vec<_> = store.records().unwrap().into_iter().map(Result::unwrap).collect();
    let heard = results["cells"]["cells"].as_array().unwrap();
    let main = |coherence: &Value| -> f64 {
        let all = coherence.as_array().unwrap().iter().map(|v| v.as_f64().unwrap());
        let lines = results["cells"]["frequency_hz"].as_array().unwrap().iter().map(|f| f.as_f64().unwrap());
        let mut own: Vec<f64> =
            lines.zip(all).filter(|(f, _)| (300.0..=600.0).contains(f)).map(|(_, v)| v).collect();
        own.sort_by(f64::total_cmp);
        own[own.len() / 2]
    };
    for (button, name) in [(1, "force"), (2, "random error"), (3, "coherence")] {
        // as by Tab and Enter
        page.eval(&format!("document.querySelectorAll('.views button')[{button}].focus()"));
        page.eval("document.activeElement.click()");
        page.until("document.querySelectorAll('.matrix .number').length === live.state.whole.cells.length");
        picture(&mut page, &format!("matrix-{}", name.replace(' ', "-")));
        let shown = page.eval("[...document.querySelectorAll('.matrix button')].map(b => [b.textContent, b.getAttribute('aria-label')])");
        for ((row, found), place) in store.cells().unwrap().iter().zip(heard).zip(0..) {
            let at = format!(
                "{} {}→{}, {name}: ",
                configuration_name(row.cell.configuration),
                row.cell.impact,
                row.cell.response
            );
            let own = shown.as_array().unwrap().iter().find(|b| b[1].as_str().unwrap().starts_with(&at));
            let own = own.unwrap_or_else(|| panic!("cell {place}: nothing begins with `{at}`: {shown}"));
            let value: f64 = own[0].as_str().unwrap().parse().unwrap();
            let (expected, digits) = match button {
                1 => {
                    let peaks: Vec<f64> =
                        records.iter().filter(|r| r.cell == row.id && r.kept()).map(|r| r.peak_n).collect();
                    (peaks.iter().sum::<f64>() / peaks.len() as f64, 0.051)
                }
                2 => {
                    let percent = 100.0 * found["random_error"].as_f64().unwrap();
                    (percent, 0.051 * percent)
                }
                _ => (main(&found["coherence"]), 0.000_51),
            };
            assert!((value - expected).abs() <= digits, "{at}{value} instead of {expected}");
        }
    }
    assert_eq!(page.errors(), Vec::<String>::new());
    drop(page);

    let mut page = browser.open_url(&server.url, Look { dark: true, ..Look::HAND });
    page.until("document.querySelectorAll('figure.ready').length > 0 && !!live.state.whole.estimate");
    for (key, name) in [("1", "spectra-now-hand"), ("2", "matrix-number-hand")] {
        page.key(key);
        if key == "2" {
            page.eval("document.querySelectorAll('.views button')[3].click()");
            page.until(
                "document.querySelectorAll('.matrix .number').length === live.state.whole.cells.length",
            );
        } else {
            page.until("live.alive.has('cell-frf') && live.alive.has('force-spectrum')");
            page.eval("document.getElementById('fig-force-spectrum').scrollIntoView()");
            picture(&mut page, "spectra-now-hand-force");
            page.eval("document.getElementById('fig-cell-frf').scrollIntoView()");
        }
        picture(&mut page, name);
        let wide = page.eval("document.documentElement.scrollWidth").as_u64().unwrap();
        assert!(wide <= 400, "{name}: {wide} px wide");
    }
    assert_eq!(page.errors(), Vec::<String>::new());
}
