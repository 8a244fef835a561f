//! Comparison of two campaigns: with a contact that was changed, and with one that was not.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::CONTACT;
use jointrig_tests::campaign::one_second;
use jointrig_tests::command::jointrig;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Runs a command that must succeed.
fn done(command: &mut Command) -> String {
    let out = command.output().unwrap();
    assert!(out.status.success(), "{command:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

/// A campaign for the contact's own stiffness on the default rig with this k_T along the sliding
/// direction, N/µm.
fn measured(folder: &Path, k_t: f64, seed: u64) -> PathBuf {
    let (rig, file) = (folder.join(format!("rig-{seed}.toml")), folder.join(format!("contact-{seed}.jrig")));
    let contact = format!("name = \"own-{k_t}\"\n[contact]\nstiffness_n_per_m = [1.8e8, 2.6e8, {k_t}e6]\n");
    std::fs::write(&rig, contact).unwrap();
    let plan = folder.join(format!("plan-{seed}.toml"));
    std::fs::write(&plan, one_second(CONTACT)).unwrap();
    done(jointrig().args(["campaign", "new"]).arg(&file).arg("--plan").arg(&plan));
    let device = format!("sim:{}", rig.display());
    done(
        jointrig()
            .args(["campaign", "run", "--yes", "--device", &device])
            .arg(&file)
            .args(["--seed", &seed.to_string()]),
    );
    file
}

/// The document of `jointrig compare`, and the output when no document is requested.
fn compared(folder: &Path, a: &Path, b: &Path) -> (Value, String) {
    let printed = done(jointrig().arg("compare").arg(a).arg(b).arg("--out").arg(folder));
    let document = std::fs::read_to_string(folder.join("compare.json")).unwrap();
    (serde_json::from_str(&document).unwrap(), printed)
}

/// The difference in k_T, and its interval, N/µm.
fn of_k_t(compared: &Value) -> [f64; 3] {
    let all = compared["differences"].as_array().unwrap();
    let own = all.iter().find(|d| d["quantity"] == "k_T of the contact").unwrap();
    let own = &own["b_minus_a"];
    [&own["mean"], &own["ci95"][0], &own["ci95"][1]].map(|v| 1e-6 * v.as_f64().unwrap())
}

/// Three campaigns, each with a different seed: gains, positions, aim and noise are drawn again.
/// How often such an interval covers the truth is counted in `contact_accuracy`; here it is the
/// interval of one draw.
#[test]
fn a_softer_contact_is_told_from_the_same_one_measured_twice() {
    let temporary = tempfile::tempdir().unwrap();
    let folder = temporary.path();
    let files: Vec<PathBuf> = std::thread::scope(|scope| {
        let all = [(180.0, 24), (180.0, 25), (162.0, 26)];
        let running = all.map(|(k_t, seed)| scope.spawn(move || measured(folder, k_t, seed)));
        running.into_iter().map(|one| one.join().unwrap()).collect()
    });

    let (worn, printed) = compared(folder, &files[0], &files[2]);
    let [mean, low, high] = of_k_t(&worn);
    assert_eq!(worn["differ"], true, "{mean} {low}…{high}");
    assert!((low..=high).contains(&-18.0) && high < 0.0, "{mean}, 95 % {low}…{high}");
    let verdict = worn["verdict"].as_str().unwrap();
    assert!(printed.contains(verdict) && verdict.contains("differ"), "{printed}");
    let page = std::fs::read_to_string(folder.join("compare.html")).unwrap();
    assert!(page.contains("id=\"fig-differences\"") && page.contains("id=\"fig-impacts\""));

    let (same, printed) = compared(folder, &files[0], &files[1]);
    let [mean, low, high] = of_k_t(&same);
    assert_eq!(same["differ"], false, "{mean} {low}…{high}");
    assert!(low <= 0.0 && 0.0 <= high, "{mean}, 95 % {low}…{high}");
    assert!(printed.contains(same["verdict"].as_str().unwrap()), "{printed}");
}
