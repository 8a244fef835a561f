//! A campaign that is exported and imported again gives the same results, digit for digit; an
//! export that is not complete is refused.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::{SMALL, configuration_name};
use jointrig::campaign::store::Store;
use jointrig_tests::campaign::{one_second, short_contact_plan, small_plan};
use jointrig_tests::command::jointrig;
use jointrig_tests::live::{campaign, done};
use serde_json::Value;
use std::path::{Path, PathBuf};

fn measured(plan: &str) -> (tempfile::TempDir, PathBuf) {
    let (folder, file) = campaign(plan);
    done(jointrig().args(["campaign", "run", "--yes", "--device", "sim:"]).arg(&file));
    (folder, file)
}

fn export(file: &Path, format: &str, to: &Path, more: &[&str]) {
    done(jointrig().args(["export", "--format", format]).arg(file).arg("--out").arg(to).args(more));
}

/// The results of a campaign, without where they come from.
fn results(file: &Path, out: &Path) -> Value {
    done(jointrig().arg("analyse").arg(file).arg("--out").arg(out));
    let mut all: Value = serde_json::from_slice(&std::fs::read(out.join("results.json")).unwrap()).unwrap();
    all.as_object_mut().unwrap().remove("source").unwrap();
    all
}

/// What the command says when it refuses an import.
fn refused(folder: &Path, into: &Path) -> String {
    let out = jointrig().arg("import").arg(folder).arg("--into").arg(into).output().unwrap();
    assert_eq!(out.status.code(), Some(1), "{}", String::from_utf8_lossy(&out.stdout));
    String::from_utf8(out.stderr).unwrap()
}

fn import(folder: &Path, into: &Path) -> String {
    done(jointrig().arg("import").arg(folder).arg("--into").arg(into))
}

/// Copies a folder with its subfolders.
fn copied(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let place = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copied(&path, &place);
        } else {
            std::fs::copy(&path, &place).unwrap();
        }
    }
}

/// Every record's samples, in the types in which they were measured.
fn samples(file: &Path) -> Vec<(i64, jointrig::device::samples::Samples)> {
    let store = Store::open_read_only(file).unwrap();
    let rows = store.records().unwrap().into_iter().flatten();
    rows.map(|row| (row.id, store.samples(&row).unwrap())).collect()
}

#[test]
fn an_exported_campaign_comes_back_digit_for_digit_with_what_persons_decided() {
    // few cells and short records, because every format is written, read and analysed
    let cells: [(&str, &[&str], &[&str]); 3] =
        [("A", &["AZ1"], &["A1"]), ("B", &["BZ1"], &["B1"]), ("AJB", &["AZ1"], &["A1", "B1"])];
    let (folder, file) = measured(&one_second(&small_plan(&cells)));
    let at = |name: &str| folder.path().join(name);
    let store = Store::open_read_only(&file).unwrap();
    let rows: Vec<_> = store.records().unwrap().into_iter().flatten().collect();
    let row = rows.iter().find(|row| row.kept()).unwrap();
    let dropped = row.id.to_string();
    let cell = store.cells().unwrap().into_iter().find(|cell| cell.id == row.cell).unwrap().cell;
    let cell = format!("{}/{}/{}", configuration_name(cell.configuration), cell.impact, cell.response);
    drop(store);
    let reason = ["--reason", "a truck, passing"];
    done(jointrig().args(["campaign", "drop"]).arg(&file).arg(&dropped).args(reason));
    let calibration = "[[channel]]\nname = \"ldv_a\"\nsensitivity_v = 37.3\nserial = \"77\"\n";
    std::fs::write(at("lab.toml"), calibration).unwrap();
    let calibrate = jointrig()
        .args(["campaign", "calibrate"])
        .arg(&file)
        .arg("--calibration")
        .arg(at("lab.toml"))
        .args(["--reason", "yearly"])
        .output()
        .unwrap();
    assert!(calibrate.status.success());
    let wanted = results(&file, &at("results"));
    for (format, more) in [("npz", &["--all"][..]), ("npz", &[]), ("uff58", &[]), ("csv", &["--all"])] {
        let name = format!("{format}{}", more.len());
        export(&file, format, &at(&name), more);
        let into = at(&format!("{name}.jrig"));
        let told = import(&at(&name), &into);
        assert!(told.contains("the verdicts and amplitudes are those of the export"), "{told}");
        assert_eq!(results(&into, &at(&format!("{name} results"))), wanted, "{name}");
        if more.is_empty() {
            assert!(told.contains("no samples"), "{told}");
        } else {
            assert!(samples(&into) == samples(&file), "{name}");
        }
        let shown = done(jointrig().args(["campaign", "show", "--no-figure"]).arg(&into).arg(&cell));
        assert!(shown.contains("a truck, passing"), "{shown}");
        let verified = done(jointrig().args(["campaign", "verify", "--deep"]).arg(&into));
        assert!(verified.contains("all intact"), "{verified}");
        // again: nothing is stored twice
        let told = import(&at(&name), &into);
        assert!(told.contains("were there already"), "{told}");
        assert_eq!(results(&into, &at("again")), wanted, "{name}, imported twice");
        assert_eq!(Store::open_read_only(&into).unwrap().records().unwrap().len(), rows.len());
    }
}

/// A damage to an export: its name, what it does to the folder, and what the refusal says.
type Damage<'a> = (&'a str, &'a dyn Fn(&Path), &'a str);

#[test]
fn an_export_that_is_not_whole_is_refused_before_a_file_is_made() {
    let (folder, file) = measured(SMALL);
    let at = |name: &str| folder.path().join(name);
    export(&file, "npz", &at("whole"), &[]);
    let one_of = |folder: &Path, below: &str| {
        let mut all: Vec<PathBuf> =
            std::fs::read_dir(folder.join(below)).unwrap().map(|entry| entry.unwrap().path()).collect();
        all.sort();
        all.swap_remove(0)
    };
    let into = at("new.jrig");
    let damages: [Damage<'_>; 6] = [
        ("missing", &|at| std::fs::remove_file(one_of(at, "channels")).unwrap(), "the file is missing"),
        (
            "short",
            &|at| {
                let path = one_of(at, "records");
                let bytes = std::fs::read(&path).unwrap();
                std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
            },
            "bytes, and was exported with",
        ),
        (
            "flipped",
            &|at| {
                let path = one_of(at, "records");
                let mut bytes = std::fs::read(&path).unwrap();
                let middle = bytes.len() / 2;
                bytes[middle] ^= 1;
                std::fs::write(&path, &bytes).unwrap();
            },
            "its content was changed",
        ),
        (
            "counted",
            &|at| {
                let path = at.join("records.csv");
                let text = std::fs::read_to_string(&path).unwrap();
                let shorter: Vec<&str> = text.lines().take(5).collect();
                std::fs::write(&path, shorter.join("\n")).unwrap();
            },
            "records.csv",
        ),
        (
            "cut",
            &|at| {
                let path = at.join("archive.json");
                let text = std::fs::read_to_string(&path).unwrap();
                std::fs::write(&path, &text[..text.len() / 2]).unwrap();
            },
            "not the document of an export",
        ),
        (
            "outside",
            &|at| {
                let path = at.join("archive.json");
                let text = std::fs::read_to_string(&path).unwrap();
                std::fs::write(&path, text.replace("\"plan.toml\": {", "\"../plan.toml\": {")).unwrap();
            },
            "outside the folder",
        ),
    ];
    for (name, damage, wanted) in damages {
        copied(&at("whole"), &at(name));
        damage(&at(name));
        let said = refused(&at(name), &into);
        assert!(said.contains(wanted) && said.contains("export the campaign again"), "{name}: {said}");
        assert!(!into.exists(), "{name}");
    }
    export(&file, "npz", &at("bare"), &["--without-records"]);
    assert!(refused(&at("bare"), &into).contains("--without-records"));
    assert!(!into.exists());
    let (_other, elsewhere) = campaign(&SMALL.replace("wanted = 2", "wanted = 3"));
    let said = refused(&at("whole"), &elsewhere);
    assert!(said.contains("another plan"), "{said}");
    assert_eq!(samples(&elsewhere), []);
}

#[test]
fn a_contact_campaign_with_levels_of_the_shaker_gives_the_same_k_t() {
    let (folder, file) = measured(&short_contact_plan());
    let at = |name: &str| folder.path().join(name);
    let levels = ["--freq", "250", "--amplitude", "5e-8,1e-7,2e-7", "--seconds", "0.5"];
    done(jointrig().arg("shaker").arg(&file).args(["--yes", "--device", "sim:"]).args(levels));
    let k_t = |results: &Value| results["answer"]["contact"]["k_t_n_per_m"]["mean"].as_f64().unwrap();
    let wanted = results(&file, &at("results"));
    let shaken = wanted["hysteresis"].as_array().unwrap().iter().filter(|row| row["kind"] == "shaker");
    assert!(shaken.count() >= 3);
    for format in ["npz", "uff58"] {
        export(&file, format, &at(format), &[]);
        let into = at(&format!("{format}.jrig"));
        let told = import(&at(format), &into);
        assert!(told.contains("3 levels judged again"), "{told}");
        let found = results(&into, &at(&format!("{format} results")));
        assert!((k_t(&found) / k_t(&wanted) - 1.0).abs() < 1e-6);
        // both forms hold every value in double precision
        assert_eq!(found, wanted, "{format}");
    }
}

/// The folder that the command of 0.1.0 exported from the kept campaign file of version 3: one of
/// its records was dropped, so that its samples were not exported.
#[test]
fn the_kept_export_of_0_1_0_becomes_the_campaign_that_it_was() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host/tests/data");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("again.jrig");
    let said = import(&data.join("export_1"), &file);
    assert!(said.contains("the verdicts and amplitudes are those of the export"), "{said}");
    let original = samples(&data.join("campaign_v3/old.jrig"));
    let dropped = 2;
    let store = Store::open_read_only(&file).unwrap();
    let rows: Vec<_> = store.records().unwrap().into_iter().flatten().collect();
    assert_eq!(rows.len(), original.len());
    for (row, (id, before)) in rows.iter().zip(&original) {
        assert_eq!(row.id, *id);
        if row.id == dropped {
            assert_eq!((row.scans, row.kept()), (0, false));
        } else {
            assert!(store.samples(row).unwrap() == *before, "record {id}");
        }
    }
    drop(store);
    let reasons = |file: &Path| -> Vec<(i64, String)> {
        let all = Store::open_read_only(file).unwrap().overrules().unwrap();
        all.into_iter().map(|one| (one.record, one.reason)).collect()
    };
    assert_eq!(reasons(&file), [(dropped, "struck twice by eye".to_owned())]);
    assert_eq!(Store::open_read_only(&file).unwrap().calibrations().unwrap().len(), 1);
    assert_eq!(Store::open_read_only(&file).unwrap().verify().unwrap(), []);
}
