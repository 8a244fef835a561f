//! What `jointrig laws` refuses, and how it says so. Its example is run by `tutorial.rs`.
#![allow(clippy::unwrap_used)]

use jointrig_tests::command::jointrig;
use std::path::Path;

/// Exit code and message of `jointrig laws` with these words.
fn refused(folder: &Path, words: &[&str]) -> (i32, String) {
    let out = jointrig().arg("laws").args(words).current_dir(folder).output().unwrap();
    (out.status.code().unwrap(), String::from_utf8_lossy(&out.stderr).into_owned())
}

#[test]
fn errors_say_what_where_and_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("no_force.csv", "loop,displacement_m,force\na,1,2\n");
    write("word.csv", "displacement_m,force_n\n1,2\n3,four\n");
    write("empty.csv", "displacement_m,force_n\n");
    write("short.csv", "loop,displacement_m,force_n\nfirst,1,2\nfirst,2,3\n");
    let plan = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/plans/small.toml");
    let mut new = jointrig();
    new.args(["campaign", "new", "new.jrig", "--plan"]).arg(plan).current_dir(folder.path());
    assert!(new.output().unwrap().status.success());
    for (words, code, parts) in [
        (&["gone.csv"][..], 1, &["gone.csv", "check the name"][..]),
        (&["no_force.csv"], 1, &["no_force.csv", "no column `force_n`", "displacement_m"]),
        (&["word.csv"], 1, &["word.csv, row 3", "`four`", "write a number"]),
        (&["empty.csv"], 1, &["empty.csv", "no loop"]),
        (&["short.csv"], 1, &["short.csv, loop first", "at least 32"]),
        (&["new.jrig"], 1, &["new.jrig", "no loop", "jointrig shaker"]),
        (&["word.csv", "--law", "iwam"], 2, &["`iwam` is no law", "iwan"]),
        (&["word.csv", "--normal-load", "0"], 2, &["write a number over 0"]),
    ] {
        let (found, message) = refused(folder.path(), words);
        assert_eq!(found, code, "{words:?}: {message}");
        for part in parts {
            assert!(message.contains(part), "{words:?}: `{part}` is not in: {message}");
        }
    }
}
