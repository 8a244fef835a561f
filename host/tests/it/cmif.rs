//! Interface modes by CMIF, compared with an independent implementation.

use jointrig::exchange::{read_frf, read_positions};
use jointrig::substructuring::cmif::cmif;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

#[test]
fn singular_values_are_those_of_an_independent_implementation() {
    for case in ["frf_rigid", "frf_default"] {
        let frf = |file: &str| read_frf(&data(case).join(file)).expect("test data");
        let geometry = read_positions(&data("positions/positions.xlsx")).expect("test data").geometry;
        let found = cmif(&frf("A.npz"), &frf("B.npz"), &frf("AJB.npz"), &geometry).expect("exact data");
        let text = std::fs::read_to_string(data(case).join("expected.json")).expect("test data");
        let expected: Value = serde_json::from_str(&text).expect("JSON");
        for line in ["300", "500"] {
            let l = found.frequency_hz.iter().position(|f| f.to_string() == line).expect("the line");
            let values = expected["cmif"][line].as_array().expect("values");
            assert_eq!(values.len(), 8);
            for (value, found_value) in values.iter().zip(&found.singular_values[l]) {
                // both are decompositions in double precision
                let wanted = value.as_f64().expect("a number");
                assert!((found_value - wanted).abs() < 1e-9 * found.singular_values[l][0]);
            }
        }
        // the arms are rigid bodies, so six motions of each virtual point describe them completely
        assert!(found.explained[&6] > 0.9, "{:?}", found.explained);
        assert!(found.reason.contains("modes are the fewest"), "{}", found.reason);
        for vectors in &found.participation {
            assert!(vectors.iter().flatten().all(|p| (0.0..=1.0 + 1e-12).contains(p)));
        }
    }
}
