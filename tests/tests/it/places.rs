//! Places that are measured again after the campaign: the same hits give the result of the right
//! plan, and nothing else of the plan can be changed this way.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::CONTACT;
use jointrig::campaign::store::Store;
use jointrig::results::Results;
use jointrig_tests::campaign::{one_second, rows, run};
use jointrig_tests::command::jointrig;
use jointrig_tests::drawn_campaigns::found;
use jointrig_tests::live::done;
use std::path::Path;
use std::process::Command;

fn places(file: &Path, plan: &Path) -> Command {
    let mut command = jointrig();
    command.args(["campaign", "places"]).arg(file).arg("--plan").arg(plan);
    command.args(["--reason", "with the microscope"]);
    command
}

#[test]
fn a_place_that_is_measured_again_gives_the_right_stiffness() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("c.jrig");
    let right = one_second(CONTACT).replace("wanted = 6", "wanted = 2");
    let stated = "name = \"C3\", grouping = 5, position_m = [0.0, 0.001, -0.007]";
    assert_eq!(right.matches(stated).count(), 1);
    let plan = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let right_plan = plan("right.toml", &right);
    let wrong = plan("wrong.toml", &right.replace(stated, &stated.replace("0.001", "0.003")));
    run(&file, &right, "sim:".parse::<jointrig::device::address::Address>().unwrap().open(1).unwrap());
    let k_t = |results: &Results| results.answer.as_ref().unwrap().contact.k_t_n_per_m.unwrap();
    let at_first = found(&file);
    assert!(at_first.source.measured_again.is_empty());
    let hits = rows(&Store::open_read_only(&file).unwrap()).len();

    // 2 mm is more than the stated uncertainty of this point's place: the report names it
    let said = done(&mut places(&file, &wrong));
    assert!(
        said.contains("geometry.response.C3.position_m: [0.0, 0.003, -0.007], was [0.0, 0.001, -0.007]"),
        "{said}"
    );
    let with_wrong = found(&file);
    let told = with_wrong.checks.iter().find(|check| check.name == "plan-as-stated").unwrap();
    assert!(told.ok == Some(false) && told.meaning.contains("Point C3 seems off"), "{told:?}");

    // with the right place the same hits give the same result as before
    done(&mut places(&file, &right_plan));
    let again = found(&file);
    assert_eq!(k_t(&again), k_t(&at_first));
    assert_eq!(again.source.measured_again.len(), 2);
    assert!(again.source.measured_again[1].contains("with the microscope: geometry.response.C3"));
    let store = Store::open_read_only(&file).unwrap();
    assert_eq!((rows(&store).len(), store.plans().unwrap().len()), (hits, 3));
    drop(store);
    done(jointrig().args(["campaign", "verify"]).arg(&file));

    // anything else, and nothing at all, is refused
    let refused = |plan: &Path| {
        let out = places(&file, plan).output().unwrap();
        assert_eq!(out.status.code(), Some(1));
        String::from_utf8(out.stderr).unwrap()
    };
    let more = plan("more.toml", &right.replace("wanted = 2", "wanted = 3"));
    assert!(refused(&more).contains("`hits.wanted` is not what was measured again"));
    assert!(refused(&right_plan).contains("nothing else than the file's plan"));
    assert_eq!(Store::open_read_only(&file).unwrap().plans().unwrap().len(), 3);
}
