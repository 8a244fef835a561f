//! `campaign verify --deep`: everything stored about records and levels follows from their raw
//! codes, whatever happened since; anything that does not is named.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use jointrig::campaign::plan::level::Moment;
use jointrig::campaign::store::Store;
use jointrig::campaign::store::level_table::NewLevel;
use jointrig::campaign::store::record_table::NewRecord;
use jointrig::campaign::store::session_table::Counters;
use jointrig::campaign::verdict::{Judgement, Verdict};
use jointrig::device::stream::Recording;
use jointrig_tests::campaign::{rows, small_plan};
use jointrig_tests::command::jointrig;
use jointrig_tests::live::{campaign, done};

fn deep(file: &Path) -> (bool, String) {
    let out = jointrig().args(["campaign", "verify", "--deep"]).arg(file).output().unwrap();
    let said = [out.stdout, out.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
    (out.status.success(), said)
}

fn on_the_rig(command: &str, file: &Path, more: &[&str]) {
    let words = command.split(' ');
    done(jointrig().args(words).arg(file).args(["--device", "sim:", "--yes"]).args(more));
}

#[test]
fn verdicts_and_amplitudes_follow_from_the_codes_whatever_a_person_did_since() {
    let plan = small_plan(&[("AJB", &["AZ1"], &["A1", "B1"])]);
    let (folder, file) = campaign(&plan.replace("wanted = 2", "wanted = 5"));
    on_the_rig("campaign run", &file, &[]);
    on_the_rig("shaker", &file, &["--freq", "150", "--amplitude", "1e-7", "--seconds", "0.5"]);
    let campaign = |words: &[&str]| done(jointrig().arg("campaign").args(words));
    let path = file.to_str().unwrap();
    campaign(&["drop", path, "2", "--reason", "a lorry"]);
    campaign(&["drop", path, "7", "--reason", "a lorry"]);
    campaign(&["keep", path, "7", "--reason", "no lorry"]);
    // other scales from here on: they apply to the next session, not to earlier records
    let map = Store::open_read_only(&file).unwrap().channels_as_measured(1).unwrap();
    let channel = map.channels.iter().find(|channel| channel.name == "force").unwrap();
    let sensitivity_v = 1.02 / f64::from(channel.units_per_volt.abs());
    let laboratory = folder.path().join("lab.toml");
    std::fs::write(
        &laboratory,
        format!("[[channel]]\nname = \"force\"\nsensitivity_v = {sensitivity_v:?}\n"),
    )
    .unwrap();
    campaign(&["calibrate", path, "--calibration", laboratory.to_str().unwrap(), "--reason", "recalibrated"]);
    on_the_rig("campaign run", &file, &[]);

    let store = Store::open_read_only(&file).unwrap();
    let records = rows(&store);
    assert!(records.len() > 10 && store.levels().unwrap().len() == 1, "{} records", records.len());
    assert_eq!(records.last().unwrap().session, 3, "the dropped hit was struck anew");
    let (whole, said) = deep(&file);
    assert!(whole, "{said}");
    let told = format!("the verdicts of {} records and 1 levels follow", records.len());
    assert!(said.contains("all intact") && said.contains(&told), "{said}");
}

#[test]
fn a_verdict_that_does_not_follow_is_named_although_every_seal_fits() {
    let (_folder, file) = campaign(&small_plan(&[("AJB", &["AZ1"], &["A1"])]));
    on_the_rig("campaign run", &file, &[]);
    on_the_rig("shaker", &file, &["--freq", "150", "--amplitude", "1e-7", "--seconds", "0.5"]);
    let store = Store::open(&file).unwrap();
    let row = rows(&store).remove(0);
    let recording = Recording {
        epoch: row.epoch,
        first_scan: row.first_scan,
        trigger_index: row.trigger_index,
        samples: store.samples(&row).unwrap(),
        gaps: row.gaps.clone(),
        shot: row.shot,
    };
    let next = rows(&store).len() as u32;
    let verdict = |kind, peak_n| Judgement {
        peak_n,
        ..Judgement::without_pulse(kind, row.measure, row.limit, row.sentence.clone())
    };
    for (attempt, verdict) in
        (next..).zip([verdict(Verdict::DoubleHit, row.peak_n), verdict(Verdict::Good, row.peak_n * 1.001)])
    {
        let record = NewRecord {
            cell: row.cell,
            attempt,
            session: row.session,
            utc: row.utc.clone(),
            utc_error_s: None,
            recording: recording.clone(),
            verdict,
        };
        store.insert(&record, &Counters::new()).unwrap();
    }
    let level = store.levels().unwrap().remove(0).unwrap();
    let mut settled = level.settled();
    settled.reached *= 1.02;
    let false_level = NewLevel {
        session: level.session,
        moment: Moment::After,
        level: level.level(),
        settled,
        epoch: level.epoch,
        first_scan: level.first_scan,
        samples: store.level_samples(&level).unwrap(),
        gaps: Vec::new(),
    };
    store.insert_level(&false_level).unwrap();
    store.close().unwrap();
    assert!(done(jointrig().args(["campaign", "verify"]).arg(&file)).contains("all intact"));
    let (whole, said) = deep(&file);
    assert!(!whole && said.contains("3 of ") && said.contains("differ"), "{said}");
    for part in ["`double hit`", "in the file, but `good`", "level 2:"] {
        assert!(said.contains(part), "{part}: {said}");
    }
}
