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
    })
}

/// A folder with results 00.json and so on, whose k_T is proportional to load^0.3, and study.csv.
fn study() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = vec!["file,load_n,set".to_owned()];
    for number in 0..CAMPAIGNS {
        let load = 100.0 * 1.1f64.powf(number as f64);
        let deviation = OF_SET[number / 3] + OF_ONE[number % 3];
        let k_t = 150e6 * (load / 100.0).powf(0.3) * f64::exp(deviation);
        let text = results(number, Some(k_t)).to_string();
        std::fs::write(folder.path().join(format!("{number:02}.json")), text).unwrap();
        rows.push(format!("{number:02}.jrig,{load},{}", number / 3));
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
    assert!(lines.contains("from 14 campaigns") && lines.contains("change per unit of time"), "{lines}");
}

#[test]
fn errors_say_what_where_and_what_to_do() {
    let folder = study();
    let short = "file,load_n\n00.jrig,heavy\n";
    std::fs::write(folder.path().join("short.csv"), short).unwrap();
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
