//! A calibration that is corrected after the campaign: everything is computed anew with it, nothing that was measured changes.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::{CONTACT, SMALL};
use jointrig::campaign::store::Store;
use jointrig::campaign::store::record_row::RecordRow;
use jointrig::device::channels::ChannelMap;
use jointrig_tests::command::jointrig;
use jointrig_tests::drawn_campaigns::found;
use jointrig_tests::live::{campaign, done};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A hash over all raw codes, and every scale that the sessions were measured with.
fn measured(file: &Path) -> (u64, Vec<f32>) {
    let store = Store::open_read_only(file).unwrap();
    let mut hash = DefaultHasher::new();
    for record in store.records().unwrap().into_iter().flatten() {
        store.samples(&record).unwrap().codes.hash(&mut hash);
    }
    let map = store.channels_as_measured(1).unwrap();
    (hash.finish(), map.channels.iter().map(|channel| channel.units_per_volt).collect())
}

fn k_t(file: &Path) -> f64 {
    found(file).answer.unwrap().contact.k_t_n_per_m.unwrap().mean
}

/// A laboratory's file: each of these channels gives so many times the volts that `map` says.
fn laboratory(folder: &Path, map: &ChannelMap, names: &[&str], times: f64) -> PathBuf {
    let one = |name: &&str| {
        let channel = map.channels.iter().find(|channel| channel.name == *name).unwrap();
        let sensitivity_v = times / f64::from(channel.units_per_volt.abs());
        format!(
            "[[channel]]\nname = {name:?}\nsensitivity_v = {sensitivity_v:?}\nserial = \"LW12345\"\ncalibrated = \"2026-11-02\"\n\
             uncertainty = 0.01\n"
        )
    };
    let path = folder.join("lab.toml");
    std::fs::write(&path, names.iter().map(one).collect::<String>()).unwrap();
    path
}

/// Enters it; what the command says.
fn calibrate(file: &Path, laboratory: &Path, why: &str) -> String {
    done(
        jointrig()
            .args(["campaign", "calibrate"])
            .arg(file)
            .args(["--reason", why, "--calibration"])
            .arg(laboratory),
    )
}

const FORCES: [&str; 4] = ["force", "lc_1", "lc_2", "lc_3"];
const MOTIONS: [&str; 5] = ["vib_x", "vib_y", "vib_z", "ldv_a", "ldv_b"];

#[test]
fn a_calibration_corrected_afterwards_changes_the_answer_and_no_record() {
    let (folder, file) = campaign(CONTACT);
    done(jointrig().args(["campaign", "run"]).arg(&file).args(["--device", "sim:", "--yes"]));
    let (before, raw) = (k_t(&file), measured(&file));
    let map = Store::open_read_only(&file).unwrap().channels(1).unwrap();

    // 2 % more volts for each newton: every force was 2 % smaller than it was taken for, and so is k_T
    let why = "recalibrated after the campaign: 2 % more";
    let said = calibrate(&file, &laboratory(folder.path(), &map, &FORCES, 1.02), why);
    assert!(FORCES.iter().all(|name| said.contains(name)) && said.contains("+2.00 %"), "{said}");
    let after = k_t(&file);
    assert!((after / before * 1.02 - 1.0).abs() < 2e-4, "{before:.5e}, then {after:.5e}");
    assert_eq!(measured(&file), raw, "records, and what they were measured with, stay as they are");
    assert_eq!(Store::open_read_only(&file).unwrap().verify().unwrap(), []);

    // its history stands in results and report
    let out = folder.path().join("out");
    done(jointrig().arg("analyse").arg(&file).arg("--out").arg(&out));
    let results: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("results.json")).unwrap()).unwrap();
    let entered = &results["source"]["calibrations"][0];
    assert_eq!((&entered["channel"], &entered["reason"]), (&"force".into(), &why.into()));
    let volts = |n: usize| entered["sensitivity_v"][n].as_f64().unwrap();
    assert!((volts(1) / volts(0) - 1.02).abs() < 1e-5);
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("recalibrated after the campaign"), "why");
    assert!(page.contains("LW12345, 2026-11-02"), "the sensor");

    // the motions too: both 2 % smaller, and their ratio is what it was
    calibrate(&file, &laboratory(folder.path(), &map, &MOTIONS, 1.02), "the vibrometers too");
    assert!((k_t(&file) / before - 1.0).abs() < 2e-4);

    // the forces taken back by further rows: motions 2 % smaller, a contact 2 % stiffer; the first rows stay
    let back = laboratory(folder.path(), &map, &FORCES, 1.0);
    calibrate(&file, &back, "the old certificate was right");
    assert!((k_t(&file) / before / 1.02 - 1.0).abs() < 2e-4);
    assert_eq!(Store::open_read_only(&file).unwrap().calibrations().unwrap().len(), 4 + 5 + 4);

    // a channel that is not there
    std::fs::write(&back, "[[channel]]\nname = \"forse\"\nsensitivity_v = 1.0\n").unwrap();
    let refused = jointrig()
        .args(["campaign", "calibrate"])
        .arg(&file)
        .args(["--reason", "x", "--calibration"])
        .arg(&back)
        .output()
        .unwrap();
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(
        !refused.status.success() && said.contains("no channel `forse`") && said.contains("force"),
        "{said}"
    );
}

#[test]
fn a_laboratorys_file_counts_while_it_is_measured() {
    // by the laboratory the hammer's cell gives a quarter more than the device takes it for
    let (folder, file) = campaign(SMALL);
    let map = {
        let (_folder, plain) = campaign(SMALL);
        done(jointrig().args(["campaign", "run"]).arg(&plain).args(["--device", "sim:", "--yes"]));
        Store::open_read_only(&plain).unwrap().channels(1).unwrap()
    };
    let laboratory = laboratory(folder.path(), &map, &["force"], 1.25);
    let command = ["--device", "sim:", "--yes", "--calibration"];
    done(jointrig().args(["campaign", "run"]).arg(&file).args(command).arg(&laboratory));
    let store = Store::open_read_only(&file).unwrap();
    let scale = |map: &ChannelMap| {
        f64::from(map.channels.iter().find(|channel| channel.name == "force").unwrap().units_per_volt)
    };
    assert!((scale(&store.channels(1).unwrap()) * 1.25 / scale(&map) - 1.0).abs() < 1e-6);
    let good: Vec<_> = store.records().unwrap().into_iter().flatten().filter(RecordRow::kept).collect();
    assert!(good.len() >= 14);
    for record in &good {
        // the plan's 50 N are those of the laboratory, and so is what the device says of the hit
        assert!((40.0..60.0).contains(&record.peak_n), "{}", record.peak_n);
        let device = f64::from(record.shot.peak_n);
        assert!((device / record.peak_n - 1.0).abs() < 0.02, "{device} and {}", record.peak_n);
    }
}

#[test]
fn nothing_moves_where_the_device_sees_another_sign() {
    let (folder, file) = campaign(SMALL);
    done(jointrig().args(["campaign", "run"]).arg(&file).args(["--device", "sim:", "--yes"]));
    let map = Store::open_read_only(&file).unwrap().channels(1).unwrap();
    let turned = |name: &str| {
        let channel = map.channels.iter().find(|channel| channel.name == name).unwrap();
        let path = folder.path().join("turned.toml");
        let polarity = -channel.units_per_volt.signum() as i8;
        std::fs::write(&path, format!("[[channel]]\nname = {name:?}\npolarity = {polarity}\n")).unwrap();
        calibrate(&file, &path, "turned");
    };
    let refused = |command: &mut Command, name: &str| {
        let out = command.output().unwrap();
        let said = String::from_utf8(out.stderr).unwrap();
        assert!(
            !out.status.success() && said.contains(&format!("channel `{name}` has the other sign")),
            "{said}"
        );
        let sessions = Store::open_read_only(&file).unwrap().sessions().unwrap();
        assert_eq!(sessions.len(), 1, "what is refused is no session");
    };
    turned("ldv_a");
    let level = ["--device", "sim:", "--freq", "150", "--amplitude", "2e-7"];
    refused(jointrig().arg("shaker").arg(&file).args(level), "ldv_a");
    turned("force");
    refused(jointrig().args(["campaign", "run"]).arg(&file).args(["--device", "sim:", "--yes"]), "force");
}
