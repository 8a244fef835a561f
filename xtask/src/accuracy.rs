//! `cargo xtask accuracy`: runs the campaigns with known truth, and writes the tables of
//! docs/accuracy.md.

use crate::command;
use crate::project::Project;
use anyhow::{Context, Result, bail};
use std::fs;
use std::io::{BufRead, BufReader};
use std::process::Stdio;
use std::time::Instant;

/// A test that prints a table.
struct Source {
    /// The table's name, in the page and in the test's output.
    table: &'static str,
    package: &'static str,
    module: &'static str,
    test: &'static str,
}

const fn source(
    table: &'static str,
    package: &'static str,
    module: &'static str,
    test: &'static str,
) -> Source {
    Source { table, package, module, test }
}

const SOURCES: [Source; 12] = [
    source("contact", "jointrig-tests", "contact_accuracy", "accuracy_of_the_contacts_own_stiffness"),
    source("validation", "jointrig-tests", "contact_validation", "rigs_not_used_in_development"),
    source("false-assumptions", "jointrig-tests", "contact_validation", "false_assumptions"),
    source("bending", "jointrig-tests", "contact_accuracy", "contacts_of_specimens_that_bend"),
    source("accelerometers", "jointrig-tests", "contact_accuracy", "accelerometers_in_place_of_lasers"),
    source(
        "slip",
        "jointrig-tests",
        "contact_accuracy",
        "a_contact_that_may_slip_has_its_stuck_stiffness_or_none",
    ),
    source("levels", "jointrig-tests", "level_accuracy", "accuracy_of_the_shakers_levels"),
    source("between-arms", "jointrig", "between_arms", "table_of_random_rigs"),
    source(
        "between-arms-campaigns",
        "jointrig-tests",
        "between_arms_accuracy",
        "accuracy_of_the_stiffness_between_the_arms",
    ),
    source("recommended", "jointrig", "accuracy", "table_of_the_recommended"),
    source("methods", "jointrig", "accuracy", "table_of_every_method"),
    source("fit", "jointrig", "accuracy", "table_of_the_fit"),
];

/// Computes these tables, or all, and inserts each at its position in the page.
pub fn run(project: &Project, tables: &[String]) -> Result<()> {
    if let Some(unknown) = tables.iter().find(|name| SOURCES.iter().all(|source| source.table != **name)) {
        let known: Vec<&str> = SOURCES.iter().map(|source| source.table).collect();
        bail!("there is no table `{unknown}`; those there are: {}", known.join(", "));
    }
    let page = project.root.join("docs/accuracy.md");
    let wanted = |source: &&Source| tables.is_empty() || tables.iter().any(|name| name == source.table);
    let mut failed = Vec::new();
    for source in SOURCES.iter().filter(wanted) {
        let begun = Instant::now();
        let (table, passed) = printed(project, source)?;
        let text = fs::read_to_string(&page).with_context(|| format!("{} cannot be read", page.display()))?;
        fs::write(&page, placed(&text, source.table, &table)?)
            .with_context(|| format!("{} cannot be written", page.display()))?;
        println!("table `{}`: {:.0} s", source.table, begun.elapsed().as_secs_f64());
        if !passed {
            failed.push(source.table);
        }
    }
    if !failed.is_empty() {
        bail!("these tables do not show what they must, see above: {}", failed.join(", "));
    }
    Ok(())
}

/// Runs a test, prints its output, and returns its table and whether it passed.
fn printed(project: &Project, source: &Source) -> Result<(String, bool)> {
    let mut cargo = command::cargo(&project.root);
    cargo.args(["test", "--release", "--package", source.package, "--test", "it", "--"]);
    let test = format!("{}::{}", source.module, source.test);
    cargo.args(["--ignored", "--exact", &test, "--nocapture"]);
    cargo.stdout(Stdio::piped());
    println!("  $ {}", command::line(&cargo));
    let mut test = cargo.spawn().context("cargo cannot be started")?;
    let mut lines = Vec::new();
    for line in BufReader::new(test.stdout.take().context("the test's output is not there")?).lines() {
        let line = line.context("the test's output is not text")?;
        println!("{line}");
        lines.push(line);
    }
    let passed = test.wait()?.success();
    let table = table_in(&lines, source.table)
        .with_context(|| format!("`{}` printed no table `{}`", source.test, source.table))?;
    Ok((table, passed))
}

/// The rows after the line that names the table.
fn table_in(lines: &[String], name: &str) -> Option<String> {
    // the test's own name may precede it on the same line
    let named = |line: &String| line.split_once("table: ").is_some_and(|(_, rest)| rest == name);
    let from = lines.iter().position(named)? + 1;
    let rows: Vec<&str> =
        lines[from..].iter().map(String::as_str).take_while(|line| line.starts_with('|')).collect();
    (rows.len() > 2).then(|| rows.join("\n"))
}

/// The page with the table inserted.
fn placed(page: &str, name: &str, table: &str) -> Result<String> {
    let (begin, end) = (format!("<!-- table: {name} -->\n"), "<!-- end of table -->");
    let from = page.find(&begin).with_context(|| format!("docs/accuracy.md has no place for `{name}`"))?;
    let from = from + begin.len();
    let to = page[from..].find(end).with_context(|| format!("the place for `{name}` has no end"))?;
    Ok(format!("{}\n{table}\n\n{}", &page[..from], &page[from + to..]))
}

#[cfg(test)]
mod tests {
    use super::{SOURCES, placed, table_in};

    #[test]
    fn a_table_is_found_and_put_in_its_place() {
        let lines = ["rig 1: 180", "test some ... table: b", "| x |", "|---|", "| 1 |", "", "| no |"];
        let table = table_in(&lines.map(str::to_owned), "b").expect("it is there");
        assert_eq!(table, "| x |\n|---|\n| 1 |");
        assert_eq!(table_in(&lines.map(str::to_owned), "c"), None);
        let page = "one\n<!-- table: b -->\nold\n<!-- end of table -->\ntwo\n";
        let new = placed(page, "b", &table).expect("it is there");
        assert_eq!(new, "one\n<!-- table: b -->\n\n| x |\n|---|\n| 1 |\n\n<!-- end of table -->\ntwo\n");
        assert_eq!(placed(&new, "b", &table).expect("it is there"), new);
        assert!(placed(page, "c", &table).is_err());
    }

    #[test]
    fn the_page_has_a_place_for_every_table() {
        let page = include_str!("../../docs/accuracy.md");
        for source in &SOURCES {
            assert!(placed(page, source.table, "| |").is_ok(), "{}", source.table);
        }
    }
}
