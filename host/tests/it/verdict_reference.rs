//! Verdicts on seven simulated hits of known kind (a quarter of a second of each, one response).

use jointrig::campaign::verdict::{Limits, Verdict, judge_all};
use jointrig::exchange::read_impacts;
use serde_json::Value;
use std::path::Path;

#[test]
fn all_seven_kinds_are_told_apart() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/impacts");
    let records = read_impacts(&data.join("verdicts.npz")).expect("test data");
    let text = std::fs::read_to_string(data.join("expected.json")).expect("test data");
    let expected: Value = serde_json::from_str(&text).expect("test data");
    let verdicts = judge_all(&records, &Limits::default(), None);
    let names: Vec<String> = verdicts.iter().map(|v| v.kind.name().replace(' ', "_")).collect();
    let wanted: Vec<&str> =
        expected["verdicts"].as_array().expect("a list").iter().filter_map(Value::as_str).collect();
    assert_eq!(names, wanted, "{verdicts:#?}");
    for (verdict, peak) in verdicts.iter().zip(expected["peaks_n"].as_array().expect("a list")) {
        if verdict.kind == Verdict::Good {
            // half sines are not band-limited, and the noise is 0.01 N
            assert!((verdict.peak_n / peak.as_f64().expect("a number") - 1.0).abs() < 5e-3, "{verdict:?}");
        }
    }
    assert!((verdicts[5].measure - 0.18).abs() < 0.01, "9 N of 50 N: {:?}", verdicts[5]);
}
