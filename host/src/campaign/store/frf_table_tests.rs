use super::*;
use crate::campaign::plan::SMALL;
use proptest::prelude::*;

fn matrix(lines: usize, seed: f64) -> Frf {
    Frf::new(
        (0..lines).map(|l| 10.0 + 0.5 * l as f64).collect(),
        2.3,
        MotionQuantity::Velocity,
        ["A1:x", "A1:y", "A1:z"].map(String::from).to_vec(),
        ["AZ1", "AY1"].map(String::from).to_vec(),
        (0..lines)
            .map(|l| DMatrix::from_fn(3, 2, |r, c| Complex::new(seed + l as f64, (10 * r + c) as f64)))
            .collect(),
    )
    .expect("all agree")
}

fn noisy(lines: usize, seed: f64) -> Frf {
    let variance = (0..lines).map(|l| DMatrix::from_fn(3, 2, |r, c| (l + 2 * r + c) as f64)).collect();
    matrix(lines, seed).with_variance(variance).expect("one for each value")
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 8, rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default()
    })]

    #[test]
    fn frfs_come_back_as_they_came_and_the_latest_count(lines in 1usize..20, seed in -1e9..1e9f64) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("c.jrig");
        let store = Store::create(&path, SMALL, "small.toml").expect("created");
        prop_assert_eq!(store.frf("A").expect("read"), None);
        store.insert_frf(Configuration::A, "first.uff", &matrix(3, 0.0)).expect("stored");
        store.insert_frf(Configuration::A, "a.npz", &noisy(lines, seed)).expect("stored");
        store.close().expect("closed");
        let store = Store::open_read_only(&path).expect("opened");
        let found = store.frf("A").expect("read").expect("there");
        prop_assert_eq!((found.source.as_str(), &found.frf), ("a.npz", &noisy(lines, seed)));
        prop_assert_eq!(store.frf("B").expect("read"), None);
        prop_assert_eq!(store.verify().expect("checked"), vec![]);
    }
}

#[test]
fn every_flipped_bit_is_seen_and_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("c.jrig");
    let store = Store::create(&path, SMALL, "small.toml").expect("created");
    store.insert_frf(Configuration::Ajb, "joined.uff", &noisy(2, 1.0)).expect("stored");
    let change = |sql: &str| store.connection.execute(sql, []).expect("changed");
    assert!(store.connection.execute("UPDATE frfs SET utc = ''", []).is_err(), "FRFs are never changed");
    assert!(store.connection.execute("DELETE FROM frfs", []).is_err(), "nor deleted");
    change("DROP TRIGGER frfs_stay");
    for (column, other) in [
        ("frf", "zeroblob(length(frf))"),
        ("frequency", "zeroblob(length(frequency))"),
        ("variance", "zeroblob(length(variance))"),
        ("sigma_per_s", "2.4"),
        ("quantity", "'accelerance'"),
        ("inputs", "'[\"AZ1\",\"AY2\"]'"),
        ("outputs", "'[]'"),
        ("source", "'other.uff'"),
    ] {
        change(&format!("CREATE TEMP TABLE kept AS SELECT {column} AS value FROM frfs"));
        change(&format!("UPDATE frfs SET {column} = {other}"));
        let error = store.frf("AJB").expect_err(column).to_string();
        assert!(error.contains("FRFs of AJB") && error.contains("import them again"), "{column}: {error}");
        let damage = store.verify().expect("checked");
        // except the triggers that had to be dropped
        let damage: Vec<_> = damage.into_iter().filter(|one| !one.what.starts_with("it lacks")).collect();
        assert!(damage.len() == 1 && damage[0].what.contains("damaged"), "{column}: {damage:?}");
        change(&format!("UPDATE frfs SET {column} = (SELECT value FROM kept)"));
        change("DROP TABLE kept");
        assert!(store.frf("AJB").is_ok(), "{column}");
    }
}

#[test]
fn what_contradicts_itself_cannot_be_stored() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let store = Store::create(&folder.path().join("c.jrig"), SMALL, "small.toml").expect("created");
    let frf = matrix(2, 0.0);
    let (frequency_hz, outputs, lines) =
        (frf.frequency_hz().to_vec(), frf.outputs().to_vec(), frf.lines().to_vec());
    let one = frf.inputs()[..1].to_vec();
    assert!(Frf::new(frequency_hz, 2.3, MotionQuantity::Velocity, outputs, one, lines).is_err());
    let variance = noisy(3, 0.0).variance().expect("known").to_vec();
    let error = frf.with_variance(variance).expect_err("3 lines of 2");
    assert!(error.to_string().contains("3 lines of 3 × 2"), "{error}");
    assert_eq!(store.frf_rows().expect("read"), []);
}
