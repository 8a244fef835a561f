//! A folder of records from another system imported by one command, which may be repeated.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::SMALL;
use jointrig::campaign::store::Store;
use jointrig::campaign::store::record_table::RecordRow;
use jointrig::exchange::{read_frf, read_impacts, write_impacts};
use jointrig_protocol::channel::{Quantity, Role};
use jointrig_tests::command::jointrig;
use jointrig_tests::live::{campaign, done};
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

fn import(folder: &Path, into: &Path, more: &[&str]) -> Command {
    let mut command = jointrig();
    command.arg("import").arg(folder).arg("--into").arg(into).args(more);
    command
}

fn refused(mut command: Command) -> String {
    let out = command.output().unwrap();
    assert_eq!(out.status.code(), Some(1), "{command:?}");
    String::from_utf8(out.stderr).unwrap()
}

fn kept(file: &Path) -> Vec<Value> {
    let status = done(jointrig().args(["campaign", "status", "--json"]).arg(file));
    let status: Value = serde_json::from_str(&status).unwrap();
    let cells = status["cells"].as_array().unwrap().iter();
    cells
        .map(|cell| {
            serde_json::json!([cell["configuration"], cell["impact"], cell["response"], cell["kept"]])
        })
        .collect()
}

fn records(file: &Path) -> usize {
    Store::open_read_only(file).unwrap().places().unwrap().len()
}

#[test]
fn what_was_exported_is_imported_again_by_names_or_labels() {
    let (folder, measured) = campaign(SMALL);
    done(jointrig().args(["campaign", "run", "--yes", "--device", "sim:"]).arg(&measured));
    let at = |name: &str| folder.path().join(name);
    for format in ["npz", "uff58"] {
        done(jointrig().args(["export", "--format", format]).arg(&measured).arg("--out").arg(at(format)));
    }
    let (_npz, by_name) = campaign(SMALL);
    let told = done(&mut import(&at("npz/records"), &by_name, &[]));
    assert!(told.contains("cells"), "{told}");
    assert_eq!(kept(&by_name), kept(&measured));
    let first = records(&by_name);
    // again: nothing is stored twice
    let told = done(&mut import(&at("npz/records"), &by_name, &[]));
    assert!(told.contains("were there already"), "{told}");
    assert_eq!(records(&by_name), first);

    // file names without information, in folders that name the configuration: the rest comes from
    // the labels
    for (number, entry) in std::fs::read_dir(at("uff58/records")).unwrap().enumerate() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let configuration = name.split('_').next().unwrap();
        let place = at("daq").join(configuration);
        std::fs::create_dir_all(&place).unwrap();
        std::fs::copy(&path, place.join(format!("measurement {number}.uff"))).unwrap();
    }
    // the same files as a matrix of FRFs
    let matrix = at("A.npz");
    let told =
        done(jointrig().arg("frf").arg(at("daq/A")).arg("--out").arg(&matrix).args(["--band", "20:1000"]));
    assert!(told.contains("mobility of 6 outputs, 1 inputs"), "{told}");
    let (ours, exported) = (read_frf(&matrix).unwrap(), read_frf(&at("npz/frf/A.npz")).unwrap());
    let (row, line) = (ours.outputs().iter().position(|name| name == "A1:z").unwrap(), 400);
    let there = exported.outputs().iter().position(|name| name == "A1:z").unwrap();
    // the export truncates its records, so its frequency lines differ slightly from ours
    let same = exported.frequency_hz().iter().position(|f| *f >= ours.frequency_hz()[line]).unwrap();
    let ratio = ours.lines()[line][(row, 0)].norm() / exported.lines()[same][(there, 0)].norm();
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    let (_frf, of_frfs) = campaign(SMALL);
    done(jointrig().arg("import").arg(&matrix).arg("--into").arg(&of_frfs).args(["--configuration", "A"]));

    let (_uff, by_label) = campaign(SMALL);
    done(&mut import(&at("daq"), &by_label, &[]));
    assert_eq!(kept(&by_label), kept(&measured));
    assert_eq!(records(&by_label), first);
    assert!(done(jointrig().args(["campaign", "verify", "--deep"]).arg(&by_label)).contains("all intact"));
}

/// Writes three hits with three axes to a file of this name.
fn hits(path: &Path, gain: f64) {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host/tests/data/impacts/good.npz");
    let mut records = read_impacts(&data).unwrap();
    for hit in &mut records.response {
        hit[0].iter_mut().for_each(|v| *v *= gain);
        *hit = vec![hit[0].clone(); 3];
    }
    write_impacts(path, &records).unwrap();
}

#[test]
fn nothing_is_overwritten_unasked_and_nothing_stored_of_files_without_a_name() {
    let (folder, file) = campaign(SMALL);
    let cell = folder.path().join("cells");
    std::fs::create_dir(&cell).unwrap();
    hits(&cell.join("A_AZ1_A1.npz"), 1.0);
    hits(&cell.join("somewhere.npz"), 1.0);
    hits(&cell.join("else.npz"), 1.0);
    std::fs::write(cell.join("notes.txt"), "Tuesday").unwrap();
    let said = refused(import(&cell, &file, &[]));
    assert!(said.contains("else.npz, somewhere.npz") && said.contains("--names"), "{said}");
    assert_eq!(records(&file), 0);

    let table = folder.path().join("names.csv");
    std::fs::write(&table, "file,configuration,impact,response\nsomewhere.npz,A,AZ1,A2\nelse.npz,A,AZ1,A1\n")
        .unwrap();
    let names = ["--names", table.to_str().unwrap()];
    done(&mut import(&cell, &file, &names));
    assert_eq!(records(&file), 6);
    // different content under the same name
    hits(&cell.join("else.npz"), 1.1);
    let said = refused(import(&cell, &file, &names));
    assert!(said.contains("--replace") && said.contains("1 of 2 files are stored"), "{said}");
    assert_eq!(records(&file), 6);
    done(&mut import(&cell, &file, &[&names[..], &["--replace"]].concat()));
    assert_eq!(records(&file), 9);
    let of_cell = |response: &str| {
        kept(&file).into_iter().find(|cell| cell[2] == response && cell[0] == "A").unwrap()[3].clone()
    };
    assert_eq!((of_cell("A1"), of_cell("A2")), (3.into(), 3.into()), "dropped ones stay and do not count");
    let shown = done(jointrig().args(["campaign", "show", "--no-figure"]).arg(&file).arg("A/AZ1/A1"));
    assert!(shown.contains("replaced by else.npz"), "{shown}");

    // hits from a file of another name are added to the existing ones
    std::fs::remove_file(cell.join("somewhere.npz")).unwrap();
    std::fs::remove_file(cell.join("else.npz")).unwrap();
    hits(&cell.join("A_AZ1_A1.npz"), 0.9);
    done(&mut import(&cell, &file, &[]));
    assert_eq!(of_cell("A1"), 6);
    let missing = refused(import(&cell, &file, &names));
    assert!(missing.contains("there is no file"), "{missing}");
}

/// Writes every kept hit as a recorder without jointrig would: one text file for each, with the
/// hammer in volts and velocities in mm/s; returns the sums of squares of all signals, SI.
fn as_text(measured: &Path, folder: &Path) -> Vec<f64> {
    std::fs::create_dir(folder).unwrap();
    let store = Store::open_read_only(measured).unwrap();
    let cells = store.cells().unwrap();
    let mut sums = Vec::new();
    for row in store.records().unwrap().into_iter().flatten().filter(RecordRow::kept) {
        let (map, samples) = (store.channels(row.session).unwrap(), store.samples(&row).unwrap());
        let cell = &cells.iter().find(|cell| cell.id == row.cell).unwrap().cell;
        let mut text = "time (s)".to_owned();
        let mut signals = Vec::new();
        for (place, channel) in map.channels.iter().enumerate() {
            let si = map.to_si(place, samples.channel(place));
            sums.push(si.iter().map(|value| value * value).sum());
            let (name, factor) = match (channel.role, channel.quantity) {
                (Role::HammerForce, _) => ("ai0 (V)".to_owned(), 2.25e-3),
                (_, Quantity::Velocity) => (format!("{} (mm/s)", channel.name), 1e3),
                _ => (format!("{} (N)", channel.name), 1.0),
            };
            write!(text, ",{name}").unwrap();
            signals.push(si.into_iter().map(|value| value * factor).collect::<Vec<f64>>());
        }
        // a tenth of the length is enough
        for scan in 0..row.scans.min(12_000) {
            write!(text, "\n{}", scan as f64 / map.fs_hz()).unwrap();
            for signal in &signals {
                write!(text, ",{}", signal[scan]).unwrap();
            }
        }
        let configuration = jointrig::campaign::plan::configuration_name(cell.configuration);
        let name = format!("{configuration}-{}-{} no {}.csv", cell.impact, cell.response, row.id);
        std::fs::write(folder.join(name), text).unwrap();
    }
    sums
}

#[test]
fn files_of_a_recorder_with_all_channels_are_imported_with_their_sensitivities() {
    let (folder, measured) = campaign(SMALL);
    done(jointrig().args(["campaign", "run", "--yes", "--device", "sim:"]).arg(&measured));
    let text = folder.path().join("text");
    let sums = as_text(&measured, &text);
    let (_new, file) = campaign(SMALL);
    let pattern = ["--pattern", "{configuration}-{impact}-{response} no {hit}"];
    let said = refused(import(&text, &file, &pattern));
    assert!(said.contains("ai0") && said.contains("--calibrate 'ai0=NAME:SENSITIVITY'"), "{said}");
    let calibrate = [&pattern[..], &["--calibrate", "ai0=hammer:2.25 mV/N"]].concat();
    let told = done(&mut import(&text, &file, &calibrate));
    assert!(told.contains("hits in 7 cells"), "{told}");
    assert_eq!(kept(&file), kept(&measured));
    let store = Store::open_read_only(&file).unwrap();
    let mut found = Vec::new();
    for row in store.records().unwrap().into_iter().flatten() {
        let (map, samples) = (store.channels(row.session).unwrap(), store.samples(&row).unwrap());
        assert!(map.place(Role::SpecimenA).is_some() && map.place(Role::LoadCell).is_some());
        found.extend((0..map.len()).map(|place| {
            map.to_si(place, samples.channel(place)).iter().map(|value| value * value).sum::<f64>()
        }));
    }
    assert_eq!(found.len(), sums.len());
    // the beginning of each record has less than all of it, and nearly all of the hammer's
    let hammer = |all: &[f64]| all.iter().step_by(sums.len() / store.places().unwrap().len()).sum::<f64>();
    assert!((hammer(&found) / hammer(&sums) - 1.0).abs() < 1e-2, "{} {}", hammer(&found), hammer(&sums));
    // again: nothing is stored twice
    assert!(done(&mut import(&text, &file, &calibrate)).contains("were there already"));

    let path = std::fs::read_dir(&text).unwrap().next().unwrap().unwrap().path();
    let content = std::fs::read_to_string(&path).unwrap();
    let (_other, fresh) = campaign(SMALL);
    for (change, wanted) in [
        (content.replacen("ldv_a (mm/s)", "ldv_a", 1), "has no unit"),
        (content.replacen("ldv_a (mm/s)", "laser 2 (mm/s)", 1), "'laser 2=-' to leave it out"),
        (content.replacen("time (s)", "when", 1), "no column is called `time (s)`"),
    ] {
        let one = folder.path().join("one");
        std::fs::create_dir_all(&one).unwrap();
        std::fs::write(one.join(path.file_name().unwrap()), change).unwrap();
        let said = refused(import(&one, &fresh, &calibrate));
        assert!(said.contains(wanted), "{said}");
    }
    assert_eq!(records(&fresh), 0);
}
