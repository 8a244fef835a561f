//! `jointrig plan`: a plan template, all errors of a plan, and its figure.
#![allow(clippy::unwrap_used)]

use jointrig_tests::command::jointrig;
use jointrig_tests::live::done;

#[test]
fn a_plan_is_written_checked_drawn_and_made_a_campaign_of() {
    let folder = tempfile::tempdir().unwrap();
    for template in ["contact", "paper", "paper-contact", "small"] {
        // a name that must be quoted in a shell
        let plan = folder.path().join(format!("my {template}.toml"));
        done(jointrig().args(["plan", "new", "--template", template]).arg(&plan));
        let again = jointrig().args(["plan", "new"]).arg(&plan).output().unwrap();
        assert_eq!(again.status.code(), Some(1), "an edited plan is never overwritten");

        let checked = jointrig().args(["plan", "check"]).arg(&plan).output().unwrap();
        let (said, next) =
            (String::from_utf8(checked.stdout).unwrap(), String::from_utf8(checked.stderr).unwrap());
        assert!(checked.status.success(), "{next}");
        let answered = |what: &str| said.contains(&format!("{what}: yes"));
        assert_eq!(answered("k_T of the contact"), template.ends_with("contact"), "{said}");
        assert_eq!(answered("stiffness between the arms"), template.starts_with("paper"), "{said}");
        let picture =
            std::fs::read_to_string(folder.path().join(format!("my {template}-geometry.svg"))).unwrap();
        assert!(picture.starts_with("<svg") && picture.contains("BZ1"), "{picture}");
        let command = next.lines().find_map(|line| line.strip_prefix("next: jointrig ")).unwrap();
        let words = shlex::split(command).unwrap();
        done(jointrig().args(words));
    }
}

#[test]
fn everything_that_is_wrong_is_told_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let plan = folder.path().join("plan.toml");
    done(jointrig().args(["plan", "new"]).arg(&plan));
    let text = std::fs::read_to_string(&plan).unwrap();
    let wrong = text
        .replace("exponential_per_s = 2.3", "exponential_per_s = -2.3")
        .replace("rate_hz = 51200", "rate_hz = 0")
        .replacen("[-0.02, -0.02, 0.03]", "[-20.0, -20.0, 30.0]", 1);
    std::fs::write(&plan, &wrong).unwrap();
    let out = jointrig().args(["plan", "check"]).arg(&plan).output().unwrap();
    let said = String::from_utf8(out.stderr).unwrap();
    assert_eq!((out.status.code(), out.stdout.len()), (Some(1), 0), "{said}");
    for (field, what) in [
        ("[record]", "record.rate_hz"),
        ("[window]", "window.exponential_per_s"),
        ("-20.0", "in m, not in mm"),
    ] {
        let line = 1 + wrong.lines().position(|line| line.contains(field)).unwrap();
        let told = said.lines().find(|told| told.contains(what)).unwrap_or_else(|| panic!("{what}: {said}"));
        assert!(told.contains(&format!("plan.toml:{line}:")), "{told}");
    }
    let new = jointrig()
        .args(["campaign", "new"])
        .arg(folder.path().join("c.jrig"))
        .arg("--plan")
        .arg(&plan)
        .output()
        .unwrap();
    let said = String::from_utf8(new.stderr).unwrap();
    assert!(new.status.code() == Some(1) && said.contains("lists 2 more"), "{said}");
    assert!(!folder.path().join("c.jrig").exists());
}
