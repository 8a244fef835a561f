//! `cargo xtask house`: structural rules that a program can check, in seconds and without compiling
//! anything.

mod circles;
mod declarations;
mod equations;
mod features;
mod graph;
mod modules;
mod pages;
mod policy;
mod rooms;
mod tokens;

use crate::project::Project;
use anyhow::{Result, bail};

/// One rule: its name, and its check, which returns a remark.
type Law = (&'static str, fn(&Project) -> Result<String>);

const LAWS: [Law; 7] = [
    ("which crate uses which", graph::check),
    ("files in circles", circles::check),
    ("the host's rooms", rooms::check),
    ("equations", equations::check),
    ("licences, bans, sources", policy::check),
    ("features", features::check),
    ("pages", pages::check),
];

/// Checks all rules, and fails with all violations found.
pub fn check(project: &Project) -> Result<()> {
    let mut faults = Vec::new();
    for (name, law) in LAWS {
        match law(project) {
            Ok(remark) => println!("  {name}: {remark}"),
            Err(error) => faults.push(format!("{name}: {error:#}")),
        }
    }
    if faults.is_empty() {
        return Ok(());
    }
    bail!("the house is not in order:\n  {}", faults.join("\n  "))
}
