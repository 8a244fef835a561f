//! A laboratory with a manual impact hammer and fixed sensors: one hit fills a row of cells.
#![allow(clippy::unwrap_used)]

use jointrig_hil_sim::rig::RigConfig;
use jointrig_tests::command::jointrig;
use jointrig_tests::live::done;
use jointrig_tests::own_plan::plan;
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;

const RIG: &str = include_str!("../../../hil-sim/rigs/clamped-tips.toml");
/// Its clamps and contact in series, N/m.
const TRUTH: f64 = 1.0 / (1.0 / 90e6 + 1.0 / 120e6 + 1.0 / 200e6);

/// The rig with an operator who strikes, and fixed sensors of three channels at two of its six
/// points.
fn by_hand(every_s: f64) -> String {
    let mut text = format!("{RIG}\n[hammer.hand]\nevery_s = {every_s:?}\npulse_s = 3.5e-3\n");
    for point in ["11", "21"] {
        for (axis, direction) in [("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])] {
            writeln!(
                text,
                "\n[[sensors.fixed]]\nname = \"p{point}_{axis}\"\nresponse = {point:?}\ndirection = {direction:?}\n\
                 units_per_volt = 0.005\nfloor = 2e-8\ndelay_s = 2e-5\npolarity = -1"
            )
            .unwrap();
        }
    }
    text
}

fn json(command: &mut std::process::Command) -> Value {
    serde_json::from_str(&done(command)).unwrap()
}

/// The rig's plan with only these cells.
fn few(folder: &Path, cells: &str) -> String {
    let whole = std::fs::read_to_string(folder.join("plan.toml")).unwrap();
    let (head, geometry) =
        (whole.split_once("[[configuration]]").unwrap().0, whole.split_once("[geometry]").unwrap().1);
    format!("{head}[[configuration]]\n{cells}\n\n[geometry]{geometry}")
}

fn new(folder: &Path, rig: &str) -> String {
    std::fs::write(folder.join("rig.toml"), rig).unwrap();
    std::fs::write(folder.join("plan.toml"), plan(&RigConfig::from_toml(rig).unwrap())).unwrap();
    let (file, plan) = (folder.join("lab.jrig"), folder.join("plan.toml"));
    done(jointrig().args(["campaign", "new"]).arg(&file).arg("--plan").arg(plan));
    format!("sim:{}", folder.join("rig.toml").display())
}

#[test]
fn one_hit_by_hand_fills_a_row_of_cells() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let file = at("lab.jrig");
    let address = new(folder.path(), &by_hand(2.5));
    done(jointrig().args(["campaign", "run", "--yes", "--device", &address]).arg(&file));
    let status = json(jointrig().args(["campaign", "status", "--json"]).arg(&file));
    assert_eq!(status["complete"], true, "{status}");
    // 9 impacts on each of the parts with 3 responses, and 18 in the assembly with 6, of which two
    // share one row
    let (cells, struck) = (9 * 3 * 2 + 18 * 6, 9 * 3 * 2 + 18 * 5);
    assert_eq!(
        (status["cells"].as_array().unwrap().len(), status["wanted"].as_u64()),
        (cells, Some(2 * struck))
    );
    assert_eq!(status["kept"].as_u64(), Some(2 * struck));
    assert!(status["cells"].as_array().unwrap().iter().all(|cell| cell["kept"] == 2), "{status}");

    let said = done(jointrig().arg("analyse").arg(&file).arg("--out").arg(at("out")));
    let results: Value = serde_json::from_slice(&std::fs::read(at("out/results.json")).unwrap()).unwrap();
    let between = &results["answer"]["between_arms"]["k_n_per_m"];
    let [low, high] = [0, 1].map(|end| between["ci95"][end].as_f64().unwrap());
    println!("{said}");
    assert!(low < TRUTH && TRUTH < high && high < 1.3 * low, "{between}, and {TRUTH} is true");

    // every sensor has the declared sign; one with the opposite scale is named
    let check = || jointrig().args(["campaign", "check", "--json"]).arg(&file).output().unwrap();
    let signs: Value = serde_json::from_slice(&check().stdout).unwrap();
    let signs = signs["polarity"].as_array().unwrap();
    let right = |name: &str| &signs.iter().find(|sign| sign["channel"] == name).unwrap()["right"];
    for name in ["force", "vib_z", "ldv_a", "p11_z", "p21_z"] {
        assert_eq!(right(name), true, "{name} of {signs:?}");
    }
    // no hits along x or y
    assert_eq!(*right("p11_x"), Value::Null);
    assert!(signs.iter().all(|sign| sign["right"] != false), "{signs:?}");
    std::fs::write(at("lab.toml"), "[[channel]]\nname = \"p11_z\"\npolarity = 1\n").unwrap();
    done(
        jointrig()
            .args(["campaign", "calibrate", "--reason", "plugged the other way round"])
            .arg(&file)
            .args(["--calibration", at("lab.toml").to_str().unwrap()]),
    );
    let turned = check();
    let told = String::from_utf8(turned.stderr).unwrap();
    assert!(!turned.status.success() && told.contains("wrong sign: p11_z;"), "{told}");
}

#[test]
fn who_strikes_too_early_or_not_at_all_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("lab.jrig");
    // a hit while the previous one still rings; all except the first of a cell come too early
    let address = new(folder.path(), &by_hand(1.05));
    let few = few(folder.path(), "name = \"frame\"\nimpacts = [\"101\"]\nresponses = [\"11\"]");
    let few = few.replace("by = \"hand\"", "by = \"hand\"\npatience_s = 30.0");
    std::fs::write(folder.path().join("few.toml"), &few).unwrap();
    let small = folder.path().join("small.jrig");
    done(jointrig().args(["campaign", "new"]).arg(&small).arg("--plan").arg(folder.path().join("few.toml")));
    done(jointrig().args(["campaign", "run", "--yes", "--device", &address]).arg(&small));
    let said = done(jointrig().args(["campaign", "show", "--no-figure"]).arg(&small).arg("A/101/11"));
    assert!(said.contains("struck before the structure was at rest: "), "{said}");

    // no operator: the default rig strikes only when ordered to
    let nobody = by_hand(4.0).replace("every_s = 4.0", "every_s = 1e6");
    std::fs::write(folder.path().join("rig.toml"), nobody).unwrap();
    std::fs::remove_file(&small).unwrap();
    done(jointrig().args(["campaign", "new"]).arg(&small).arg("--plan").arg(folder.path().join("few.toml")));
    let out =
        jointrig().args(["campaign", "run", "--yes", "--device", &address]).arg(&small).output().unwrap();
    let told = String::from_utf8(out.stderr).unwrap();
    assert!(!out.status.success(), "{told}");
    assert!(told.contains("no hit within 30 s (hammer.patience_s)"), "{told}");
    // a device without the sensor's channels is refused before anything moves
    let out = jointrig().args(["campaign", "run", "--yes", "--device", "sim:"]).arg(&file).output().unwrap();
    let told = String::from_utf8(out.stderr).unwrap();
    assert!(told.contains("it has no channel `p11_x`") && told.contains("vib_x"), "{told}");
}

#[test]
fn a_row_has_its_hits_in_common() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let file = at("row.jrig");
    let address = new(folder.path(), &by_hand(4.0));
    let row = few(
        folder.path(),
        "name = \"both\"\nimpacts = [\"101\", \"201\"]\nresponses = [\"12\", \"11\", \"21\"]",
    );
    std::fs::write(at("row.toml"), row).unwrap();
    let made =
        jointrig().args(["campaign", "new"]).arg(&file).arg("--plan").arg(at("row.toml")).output().unwrap();
    let told = String::from_utf8(made.stderr).unwrap();
    assert!(told.contains("6 cells, 8 hits wanted"), "{told}");
    let run = || done(jointrig().args(["campaign", "run", "--yes", "--device", &address]).arg(&file));
    run();
    // both cells of the row have the same hits, each with its own sensor's channels
    let show = |cell: &str| {
        json(jointrig().args(["campaign", "show", "--no-figure", "--json"]).arg(&file).arg(cell))["records"]
            .clone()
    };
    let [first, second] = ["AJB/101/11", "AJB/101/21"].map(show);
    assert_eq!(first, second);
    done(jointrig().arg("export").arg(&file).args(["--format", "npz", "--out"]).arg(at("npz")));
    let text = |cell: &str| {
        jointrig::exchange::read_impacts(&at(&format!("npz/records/AJB_101_{cell}.npz"))).unwrap()
    };
    let [first, second] = ["11", "21"].map(text);
    assert_eq!((first.force_n.len(), &first.force_n), (2, &second.force_n));
    assert_ne!(first.response, second.response);

    // dropped once, it is missing in both, and is repeated once
    let record = show("AJB/101/21")[0]["record"].as_i64().unwrap().to_string();
    done(jointrig().args(["campaign", "drop"]).arg(&file).arg(&record).args(["--reason", "a lorry passed"]));
    let kept = |status: &Value, response: &str| {
        let cells = status["cells"].as_array().unwrap();
        let own = cells.iter().find(|c| {
            (&c["configuration"], &c["impact"], &c["response"])
                == (&"AJB".into(), &"101".into(), &response.into())
        });
        own.unwrap()["kept"].as_u64()
    };
    let status = json(jointrig().args(["campaign", "status", "--json"]).arg(&file));
    assert_eq!((kept(&status, "11"), kept(&status, "21"), kept(&status, "12")), (Some(1), Some(1), Some(2)));
    run();
    let status = json(jointrig().args(["campaign", "status", "--json"]).arg(&file));
    assert_eq!((kept(&status, "11"), kept(&status, "21")), (Some(2), Some(2)));
    assert_eq!(status["complete"], true);
}
