//! A calibration that is corrected after the campaign: all results are recomputed with it, the
//! measured data do not change.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::{CONTACT, SMALL};
use jointrig::campaign::store::Store;
use jointrig::campaign::store::codec;
use jointrig::campaign::store::record_table::RecordRow;
use jointrig::device::channels::ChannelMap;
use jointrig_tests::campaign::{one_second, without_known_mass};
use jointrig_tests::command::jointrig;
use jointrig_tests::drawn_campaigns::found;
use jointrig_tests::live::{campaign, done};
use std::fmt::Write as _;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

/// A hash over all raw samples, and every scale with which the sessions were measured.
fn measured(file: &Path) -> (u64, Vec<f32>) {
    let store = Store::open_read_only(file).unwrap();
    let mut hash = DefaultHasher::new();
    for record in store.records().unwrap().into_iter().flatten() {
        codec::checksum(&store.samples(&record).unwrap()).hash(&mut hash);
    }
    let map = store.channels_as_measured(1).unwrap();
    (hash.finish(), map.channels.iter().map(|channel| channel.units_per_volt).collect())
}

fn k_t(file: &Path) -> f64 {
    found(file).answer.unwrap().contact.k_t_n_per_m.unwrap().mean
}

/// A calibration file: the voltage of each of these channels is `times` the voltage by `map`.
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

/// Enters the calibration; returns the command's output.
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
    let (folder, file) = campaign(&without_known_mass(&one_second(CONTACT)));
    done(jointrig().args(["campaign", "run"]).arg(&file).args(["--device", "sim:", "--yes"]));
    let (before, raw) = (k_t(&file), measured(&file));
    let map = Store::open_read_only(&file).unwrap().channels(1).unwrap();

    // 2 % more volts per newton: every force was 2 % smaller than assumed, and so is k_T
    let why = "recalibrated after the campaign: 2 % more";
    let said = calibrate(&file, &laboratory(folder.path(), &map, &FORCES, 1.02), why);
    assert!(FORCES.iter().all(|name| said.contains(name)) && said.contains("+2.00 %"), "{said}");
    let after = k_t(&file);
    // what the specimens' compliances are expected to be does not scale with the forces: a part of
    // the interval (4 %) that is as small as the change
    assert!((after / before * 1.02 - 1.0).abs() < 1e-3, "{before:.5e}, then {after:.5e}");
    assert_eq!(measured(&file), raw, "records, and what they were measured with, stay as they are");
    assert_eq!(Store::open_read_only(&file).unwrap().verify().unwrap(), []);

    // its history is in results and report
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

    // the motions too: both 2 % smaller, and their ratio is as before
    calibrate(&file, &laboratory(folder.path(), &map, &MOTIONS, 1.02), "the vibrometers too");
    assert!((k_t(&file) / before - 1.0).abs() < 2e-4);

    // further rows undo the change of the forces: motions 2 % smaller, a contact 2 % stiffer; the
    // first rows are kept
    let back = laboratory(folder.path(), &map, &FORCES, 1.0);
    calibrate(&file, &back, "the old certificate was right");
    // as above
    assert!((k_t(&file) / before / 1.02 - 1.0).abs() < 1e-3);
    assert_eq!(Store::open_read_only(&file).unwrap().calibrations().unwrap().len(), 4 + 5 + 4);

    // a channel that does not exist
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
    // by the calibration the hammer's force cell gives a quarter more than the device assumes
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
        // the plan's 50 N refer to the calibration, and so does the device's report of the hit
        assert!((40.0..60.0).contains(&record.peak_n), "{}", record.peak_n);
        let device = f64::from(record.shot.peak_n);
        assert!((device / record.peak_n - 1.0).abs() < 0.02, "{device} and {}", record.peak_n);
    }
}

/// A rig on `sim:` whose sensors have these voltage ratios to the device's scales, and a
/// calibration file that states them.
fn another_rig(folder: &Path, map: &ChannelMap, volts: &[(&str, f64)]) -> (String, PathBuf) {
    let mut rig = "[surroundings]\ntemperature_c = 31.5\n[errors]\nnone = false\n[errors.volts]\n".to_owned();
    let mut laboratory = String::new();
    for (name, volts) in volts {
        let channel = map.channels.iter().find(|channel| channel.name == *name).unwrap();
        let scale = f64::from(channel.units_per_volt) / volts;
        writeln!(rig, "{name} = {volts:?}").unwrap();
        writeln!(
            laboratory,
            "[[channel]]\nname = {name:?}\nsensitivity_v = {:?}\npolarity = {}",
            1.0 / scale.abs(),
            scale.signum() as i8
        )
        .unwrap();
    }
    let (at, lab) = (folder.join("other-rig.toml"), folder.join("other-lab.toml"));
    std::fs::write(&at, rig).unwrap();
    std::fs::write(&lab, laboratory).unwrap();
    (format!("sim:{}", at.display()), lab)
}

#[test]
fn the_device_acts_by_the_calibrated_scales_and_signs() {
    let map = {
        let (_folder, plain) = campaign(SMALL);
        done(jointrig().args(["campaign", "run"]).arg(&plain).args(["--device", "sim:", "--yes"]));
        Store::open_read_only(&plain).unwrap().channels(1).unwrap()
    };
    let (folder, file) = campaign(SMALL);
    // the hammer's force cell is reversed, and the two vibrometers are off by 3 % in opposite
    // directions
    let volts = [("force", -1.0), ("ldv_a", 1.03), ("ldv_b", 0.97)];
    let (rig, laboratory) = another_rig(folder.path(), &map, &volts);
    let device = ["--device", &rig, "--yes"];
    done(jointrig().args(["campaign", "run"]).arg(&file).args(device).arg("--calibration").arg(&laboratory));
    let store = Store::open_read_only(&file).unwrap();
    let good = store.records().unwrap().into_iter().flatten().filter(RecordRow::kept).count();
    assert!(good >= 14, "a turned cell whose sign is told is hit like any other: {good}");
    drop(store);

    let level = ["--freq", "100", "--amplitude", "2e-7"];
    done(jointrig().arg("shaker").arg(&file).args(device).args(level));
    let store = Store::open_read_only(&file).unwrap();
    let rows: Vec<_> = store.levels().unwrap().into_iter().flatten().collect();
    let held = rows[0].settled().reached;
    assert!((held / 2e-7 - 1.0).abs() < 0.02, "{held} m by the calibrated scales");
    // and the specimen's temperature is stored with it
    let celsius: Vec<f64> = store.temperatures().unwrap().iter().map(|row| row.celsius).collect();
    assert!(celsius.len() >= 3 && celsius.iter().all(|celsius| (celsius - 31.5).abs() < 1e-3), "{celsius:?}");
    let out = folder.path().join("out");
    done(jointrig().arg("analyse").arg(&file).arg("--out").arg(&out));
    let results: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("results.json")).unwrap()).unwrap();
    assert_eq!(results["source"]["temperature_c"], serde_json::json!([31.5, 31.5, 31.5]));
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("temperature of the specimen"));
    // the device's own description stays in the session
    let as_measured = store.channels_as_measured(1).unwrap();
    assert!(as_measured.channels.iter().zip(&map.channels).all(|(now, then)| now == then));
}
