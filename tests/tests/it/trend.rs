//! `jointrig trend` on the results of several campaigns: the numbers, the files, and what it
//! refuses.
#![allow(clippy::unwrap_used)]

use jointrig_tests::command::jointrig;
use serde_json::{Value, json};
use std::path::Path;

/// Campaigns of the study: three in each of five reassemblies.
const CAMPAIGNS: usize = 15;

/// Deviations of each reassembly, and of each campaign in it: relative, with mean zero.
const OF_SET: [f64; 5] = [0.006, -0.011, 0.004, 0.009, -0.008];
const OF_ONE: [f64; 3] = [0.002, -0.005, 0.003];

/// results.json of a campaign: k_T in N/m with an interval of ± 4.4 %, of which noise is 1 % and
/// spots 2 % as standard deviations.
fn results(number: usize, k_t: Option<f64>) -> Value {
    let interval = k_t.map(|k| json!({"mean": k, "ci95": [k / 1.0448, k * 1.0448]}));
    json!({
        "version": 1,
        "source": {
            "file": format!("{number:02}.jrig"),
            "kind": "campaign",
            "started": format!("2026-03-{:02}T08:00:00Z", number + 1),
            "temperature_c": [20.0, 20.5 + 0.1 * number as f64, 21.0],
        },
        "answer": {"contact": {
            "k_t_n_per_m": interval,
            "c_t_n_s_per_m": null,
            "budget": {"noise": 0.01, "spots": 0.02},
            "why": "the hits contradict each other",
        }},
        // the assembly's mode is 1 % higher in each campaign, and known to 0.2 %
        "modes": [
            {"structure": "A", "frequency_hz": {"mean": 90.0, "ci95": [89.0, 91.0]}},
            mode(200.0 * 1.01f64.powf(number as f64)),
            mode(900.0),
        ],
        // of the two levels that slip, the larger one counts
        "hysteresis": [
            {"amplitude_m": 1e-6, "friction_coefficient": null},
            {"amplitude_m": 8e-6, "friction_coefficient": 0.5 + 0.01 * number as f64},
            {"amplitude_m": 4e-6, "friction_coefficient": 0.9},
        ],
    })
}

fn mode(hz: f64) -> Value {
    json!({"structure": "AJB", "frequency_hz": {"mean": hz, "ci95": [0.998 * hz, 1.002 * hz]}})
}

/// A folder with results 00.json and so on, whose k_T is proportional to load^0.3, and study.csv.
fn study() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = vec!["file,load_n,log_load,set".to_owned()];
    for number in 0..CAMPAIGNS {
        let load = 100.0 * 1.1f64.powf(number as f64);
        let deviation = OF_SET[number / 3] + OF_ONE[number % 3];
        let k_t = 150e6 * (load / 100.0).powf(0.3) * f64::exp(deviation);
        let text = results(number, Some(k_t)).to_string();
        std::fs::write(folder.path().join(format!("{number:02}.json")), text).unwrap();
        rows.push(format!("{number:02}.jrig,{load},{},{}", load.ln(), number / 3));
    }
    std::fs::write(folder.path().join("study.csv"), rows.join("\n")).unwrap();
    folder
}

fn run(folder: &Path, words: &[&str]) -> std::process::Output {
    let files = (0..CAMPAIGNS).map(|number| format!("{number:02}.json"));
    jointrig().arg("trend").args(files).args(words).current_dir(folder).output().unwrap()
}

fn found(folder: &Path, words: &[&str]) -> Value {
    let out = run(folder, &[words, &["--json"]].concat());
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).unwrap()
}

fn interval(of: &Value) -> [f64; 3] {
    [&of["mean"], &of["ci95"][0], &of["ci95"][1]].map(|value| value.as_f64().unwrap())
}

#[test]
fn the_power_of_the_load_is_found_and_what_all_share_is_kept_apart() {
    let folder = study();
    let words = ["--against", "load_n", "--table", "study.csv", "--reassembly", "set", "--power-law"];
    let trend = found(folder.path(), &[&words[..], &["--out", "trend"]].concat());
    let [power, low, high] = interval(&trend["slope"]);
    assert!(low < 0.3 && 0.3 < high && (power - 0.3).abs() < 0.03, "{trend}");
    assert_eq!(trend["depends"], json!(true));
    assert!((trend["shared_std"].as_f64().unwrap() / 0.02 - 1.0).abs() < 0.05, "{trend}");
    // the shared 2 % are in the level's interval, and not in that of the power
    let [level, low, high] = interval(&trend["level"]);
    assert!((high / low).ln() > 2.0 * 1.9 * 0.02, "{trend}");
    // 150 N/µm at 100 N, at the mean of the loads' logarithms: 1.1^7 times as much load
    assert!((level / (150e6 * 1.1f64.powf(2.1)) - 1.0).abs() < 0.01, "{trend}");
    let between = interval(&trend["between"]);
    assert!(between[1] <= 0.0091 && between[2] > 0.0091, "{trend}");
    assert!(trend["within"].is_object() && trend["left_out"] == json!({}));
    // the shared error alone is ± 3.9 %
    assert_eq!(trend["reassemblies_needed"], Value::Null);
    assert!(found(folder.path(), &["--within", "6"])["reassemblies_needed"].as_u64().unwrap() >= 2);
    let written: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("trend/trend.json")).unwrap()).unwrap();
    assert_eq!(written, trend);
    let rows = std::fs::read_to_string(folder.path().join("trend/trend.csv")).unwrap();
    assert_eq!(rows.lines().count(), CAMPAIGNS + 1);
    assert_eq!(
        rows.lines().next(),
        Some("file,reassembly,load_n,k_t_n_per_m,low,high,trend,trend_low,trend_high")
    );
}

/// The law of the study bends over the load and is straight over its logarithm.
#[test]
fn a_curve_follows_the_law_and_tells_whether_it_bends() {
    let folder = study();
    let words =
        ["--against", "load_n", "--table", "study.csv", "--reassembly", "set", "--curve", "--out", "c"];
    let bent = found(folder.path(), &words);
    assert_eq!(
        (&bent["dependence"], &bent["bends"], &bent["depends"]),
        (&json!("curve"), &json!(true), &json!(true))
    );
    assert!(bent["slope"].is_null());
    let fitted = bent["fitted"].as_array().unwrap();
    assert_eq!(fitted.len(), 101);
    for point in fitted {
        let truth = 150e6 * (point["covariate"].as_f64().unwrap() / 100.0).powf(0.3);
        let [mean, low, high] = interval(&point["value"]);
        // the sets' deviations are up to 1.1 %, and the spline with four knots misses this law by
        // less than 0.5 %
        assert!((mean / truth - 1.0).abs() < 0.02 && low < truth && truth < high, "{point} {truth}");
    }
    let [change, low, high] = interval(&bent["change"]);
    let truth = 1.1f64.powf(14.0 * 0.3) - 1.0;
    assert!(low < truth && truth < high && (change - truth).abs() < 0.03, "{change} {truth}");
    let straight = found(
        folder.path(),
        &["--against", "log_load", "--table", "study.csv", "--reassembly", "set", "--curve"],
    );
    assert_eq!((&straight["bends"], &straight["depends"]), (&json!(false), &json!(true)));
    let written = |name: &str| std::fs::read(folder.path().join("c").join(name)).unwrap();
    assert!(written("trend.parquet").starts_with(b"PAR1"));
    assert!(String::from_utf8(written("trend.svg")).unwrap().starts_with("<svg"));
    let page = String::from_utf8(written("trend.html")).unwrap();
    for part in ["k_T against load_n", "the curve bends", "14.jrig", "data-figure=\"trend\""] {
        assert!(page.contains(part), "`{part}` is not in the page");
    }
}

#[test]
fn the_first_mode_and_the_coefficient_of_friction_have_trends_too() {
    let folder = study();
    let mode = found(folder.path(), &["--of", "first-mode", "--against", "time"]);
    let [per_day, low, high] = interval(&mode["slope"]);
    // drawn quantiles of an exact line: its ends may touch the truth
    assert!((per_day / 1.01f64.ln() - 1.0).abs() < 1e-6 && low <= per_day && per_day <= high, "{mode}");
    assert_eq!(mode["campaigns"][0]["value"]["mean"], json!(200.0));
    let friction = found(folder.path(), &["--of", "friction-coefficient"]);
    let [level, low, high] = interval(&friction["level"]);
    // its own error is not known: the scatter of the campaigns is all that widens the level
    assert!((level - 0.57).abs() < 0.01 && 0.54 < low && high < 0.6, "{friction}");
    assert_eq!(friction["campaigns"][3]["own_std"], json!(0.0));
}

#[test]
fn time_and_temperature_are_in_the_results_and_a_campaign_without_k_t_is_named() {
    let folder = study();
    let [per_day, _, _] = interval(&found(folder.path(), &["--against", "time"])["slope"]);
    let [per_degree, _, _] = interval(&found(folder.path(), &["--against", "temperature"])["slope"]);
    // 1.1^0.3 a day, and 0.1 °C a day
    assert!((per_day - 0.3 * 1.1f64.ln()).abs() < 2e-3, "{per_day}");
    assert!((per_degree / per_day - 10.0).abs() < 1e-6, "{per_degree} {per_day}");
    std::fs::write(folder.path().join("04.json"), results(4, None).to_string()).unwrap();
    let out = run(folder.path(), &["--against", "time"]);
    let (said, lines) = (String::from_utf8_lossy(&out.stderr), String::from_utf8_lossy(&out.stdout));
    assert!(said.contains("left out: 04.jrig: it has no k_T: the hits contradict each other"), "{said}");
    assert!(lines.contains("from 14 campaigns") && lines.contains("change per day"), "{lines}");
}

#[test]
fn errors_say_what_where_and_what_to_do() {
    let folder = study();
    let short = "file,load_n\n00.jrig,heavy\n";
    std::fs::write(folder.path().join("short.csv"), short).unwrap();
    let few: Vec<String> = (0..CAMPAIGNS).map(|number| format!("{number:02}.jrig,{}", number % 5)).collect();
    std::fs::write(folder.path().join("few.csv"), format!("file,few\n{}", few.join("\n"))).unwrap();
    std::fs::write(folder.path().join("frf.json"), json!({"source": {"kind": "frf"}}).to_string()).unwrap();
    for (words, code, parts) in [
        (&["--against", "load_n"][..], 1, &["neither `time` nor `temperature`", "--table"][..]),
        (&["--against", "load_n", "--table", "gone.csv"], 1, &["gone.csv", "check the name"]),
        (
            &["--against", "load_n", "--table", "short.csv"],
            1,
            &["short.csv, row 2", "`heavy`", "no row for it"],
        ),
        (&["--against", "mass", "--table", "study.csv"], 1, &["no column `mass`", "load_n"]),
        (&["frf.json"], 1, &["frf.json", "jointrig analyse"]),
        (&["00.json"], 1, &["00.json", "00.jrig is given twice"]),
        (&["--power-law"], 2, &["--against"]),
        (&["--curve", "--power-law", "--against", "time"], 2, &["--power-law"]),
        (&["--curve", "--against", "few", "--table", "few.csv"], 1, &["6 different values", "5"]),
        (&["--of", "c-t"], 1, &["00.jrig: it has no c_T", "0 campaigns", "add campaigns"]),
        (&["--reassembly", "set"], 2, &["--table"]),
        (&["--within", "0"], 2, &["write a number over 0"]),
    ] {
        let out = run(folder.path(), words);
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(code), "{words:?}: {said}");
        for part in parts {
            assert!(said.contains(part), "{words:?}: `{part}` is not in: {said}");
        }
    }
}
