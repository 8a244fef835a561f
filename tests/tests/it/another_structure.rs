//! A campaign that is continued on a structure other than that of its records: refused, or accepted
//! and reported.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::SMALL;
use jointrig::campaign::store::Store;
use jointrig_hil_sim::rig::RigConfig;
use jointrig_tests::command::jointrig;
use jointrig_tests::drawn_campaigns::found;
use jointrig_tests::live::{campaign, done};
use std::path::Path;
use std::process::Command;

fn run(file: &Path, device: &str, more: &[&str]) -> Command {
    let mut command = jointrig();
    command.args(["campaign", "run"]).arg(file).args(["--yes", "--device", device]).args(more);
    command
}

fn refused(mut command: Command) -> String {
    let out = command.output().unwrap();
    assert_eq!(out.status.code(), Some(1), "{command:?}");
    String::from_utf8(out.stderr).unwrap()
}

#[test]
fn hits_of_another_structure_are_refused_or_accepted_and_told() {
    let (folder, file) = campaign(SMALL);
    done(&mut run(&file, "sim:", &[]));
    // more hits are needed, and the device is now another draw of the rig, another rig, or one with
    // another parameter
    let more = folder.path().join("more.toml");
    std::fs::write(&more, SMALL.replace("wanted = 2", "wanted = 3")).unwrap();
    let heavier = folder.path().join("heavier.toml");
    let mut rig = RigConfig::elastic();
    rig.bodies.arm_a.mass_kg *= 1.1;
    std::fs::write(&heavier, rig.to_toml()).unwrap();
    let heavier = format!("sim:{}", heavier.display());
    let plan = ["--plan", more.to_str().unwrap()];
    let records = || Store::open_read_only(&file).unwrap().places().unwrap().len();
    let (before, sessions) = (records(), || Store::open_read_only(&file).unwrap().sessions().unwrap().len());

    let seed = refused(run(&file, "sim:", &[&plan[..], &["--seed", "2"]].concat()));
    assert!(seed.contains("seed 1") && seed.contains("seed 2") && seed.contains("--new-structure"), "{seed}");
    let parameter = refused(run(&file, &heavier, &[]));
    assert!(parameter.contains("a parameter of that rig"), "{parameter}");
    let shaker = refused({
        let mut shaker = jointrig();
        shaker.arg("shaker").arg(&file).args([
            "--yes",
            "--device",
            &heavier,
            "--freq",
            "200",
            "--amplitude",
            "1e-7",
        ]);
        shaker
    });
    assert!(shaker.contains("a parameter of that rig"), "{shaker}");
    assert_eq!((records(), sessions()), (before, 1), "nothing was struck or noted");
    assert!(found(&file).checks.iter().all(|check| check.name != "one-structure"));

    done(&mut run(&file, &heavier, &["--new-structure"]));
    assert!(records() > before);
    let results = found(&file);
    let told = results.checks.iter().find(|check| check.name == "one-structure").unwrap();
    assert!(told.ok == Some(false) && told.meaning.contains("a parameter of that rig"), "{told:?}");
    assert_eq!(results.source.structure_changes.len(), 1);

    // the same rig as last time is not a change
    done(&mut run(&file, &heavier, &[]));
    assert_eq!(found(&file).source.structure_changes.len(), 1);
}
