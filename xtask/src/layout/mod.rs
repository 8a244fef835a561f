//! `cargo xtask layout`: structural rules that a program can check, in seconds and without
//! compiling anything.

mod crates;
mod cycles;
mod equations;
mod modules;
pub mod pages;
mod policy;

use crate::project::Project;
use anyhow::{Result, bail};

/// One rule: its name, and its check, which returns a remark.
type Rule = (&'static str, fn(&Project) -> Result<String>);

const RULES: [Rule; 6] = [
    ("which crate uses which", crates::check),
    ("import cycles of files", cycles::check),
    ("layers of the host", crates::check_layers),
    ("equations", equations::check),
    ("licences, bans, sources", policy::check),
    ("pages", pages::check),
];

/// Checks all rules, and fails with all violations found.
pub fn check(project: &Project) -> Result<()> {
    let mut faults = Vec::new();
    for (name, rule) in RULES {
        match rule(project) {
            Ok(remark) => println!("  {name}: {remark}"),
            Err(error) => faults.push(format!("{name}: {error:#}")),
        }
    }
    if faults.is_empty() {
        return Ok(());
    }
    bail!("the layout breaks these rules:\n  {}", faults.join("\n  "))
}
