//! A flipped bit anywhere in a record is found and named, and the analysis excludes that record and
//! reports it.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Output;

use jointrig::campaign::store::Store;
use jointrig_tests::campaign::{plan, rows, run};
use jointrig_tests::command::jointrig;

fn verify(file: &Path) -> Output {
    jointrig().args(["campaign", "verify"]).arg(file).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn campaign(file: &Path) {
    let transport = "sim:".parse::<jointrig::device::address::Address>().unwrap().open(3).unwrap();
    let (summary, _) = run(file, &plan(3, &[("AJB", &["AZ3"], &["A3", "B3"])]), transport);
    assert_eq!(summary.kept, 6);
}

/// The only position of `part` in `whole`; none if there are several.
fn find(whole: &[u8], part: &[u8]) -> Option<usize> {
    let mut places = whole.windows(part.len()).enumerate().filter(|(_, window)| *window == part);
    let (place, _) = places.next()?;
    places.next().is_none().then_some(place)
}

#[test]
fn a_flipped_bit_in_the_samples_names_the_record_and_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.jrig");
    campaign(&file);
    assert!(verify(&file).status.success());
    let rows = rows(&Store::open_read_only(&file).unwrap());
    let good: Vec<_> = rows.iter().filter(|row| row.kept()).collect();
    let whole = std::fs::read(&file).unwrap();

    // a record's bytes are stored in the file in pieces of a page
    let bytes = Store::open_read_only(&file).unwrap().stored_bytes(good[1].id).unwrap();
    let mut tried = 0;
    let places = [0, 1_000, bytes.len() / 4, bytes.len() / 3, bytes.len() / 2, bytes.len() - 1];
    for (place, bit) in places.into_iter().zip([0, 3, 2, 7, 1, 5]) {
        let from = place.saturating_sub(20).min(bytes.len() - 40);
        // this stretch may cross two pages, and is not found then
        let Some(at) = find(&whole, &bytes[from..from + 40]) else { continue };
        tried += 1;
        let mut spoilt = whole.clone();
        spoilt[at + (place - from)] ^= 1 << bit;
        let copy = folder.path().join("spoilt.jrig");
        std::fs::write(&copy, &spoilt).unwrap();
        let found = verify(&copy);
        let said = text(&found.stdout);
        assert_eq!(found.status.code(), Some(1), "byte {place}: {said}");
        assert!(said.contains(&format!("record {}:", good[1].id)), "byte {place}: {said}");

        let out = folder.path().join("out");
        let analysed = jointrig().arg("analyse").arg(&copy).arg("--out").arg(&out).output().unwrap();
        assert!(analysed.status.success(), "{}", text(&analysed.stderr));
        let results = std::fs::read_to_string(out.join("results.json")).unwrap();
        let results: serde_json::Value = serde_json::from_str(&results).unwrap();
        let missing = results["missing"].to_string();
        assert!(missing.contains(&format!("record {} is damaged", good[1].id)), "{missing}");
        let used = results["source"]["records"]["AJB"].to_string();
        assert!(!used.contains(&format!("[{0},{0}]", good[1].id)), "{used}");
        assert!(text(&analysed.stdout).contains("left out"), "{}", text(&analysed.stdout));
    }
    assert!(tried >= 3, "{tried}");
}

#[test]
fn whatever_bit_flips_either_it_is_found_or_every_record_is_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.jrig");
    campaign(&file);
    let whole = std::fs::read(&file).unwrap();
    let content = |file: &Path| {
        let store = Store::open_read_only(file).unwrap();
        rows(&store).iter().map(|row| (row.clone(), store.samples(row).unwrap())).collect::<Vec<_>>()
    };
    let before = content(&file);
    let copy = folder.path().join("spoilt.jrig");
    let (mut found, mut state) = (0, 20_261_121_u64);
    for _ in 0..150 {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        // the file's header and the tables' names contain no record
        let place = 8_192 + (state >> 20) as usize % (whole.len() - 8_192);
        let mut spoilt = whole.clone();
        spoilt[place] ^= 1 << (state & 7);
        std::fs::write(&copy, &spoilt).unwrap();
        let verified = verify(&copy);
        match verified.status.code() {
            // unused space
            Some(0) => assert!(content(&copy) == before, "byte {place}: a change went unseen"),
            Some(1) => found += 1,
            other => panic!("byte {place}: {other:?}, {}", text(&verified.stderr)),
        }
    }
    assert!(found > 130, "most of the file is records: {found} of 150");
}
