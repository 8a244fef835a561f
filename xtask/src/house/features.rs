//! A build without a feature does not contain the feature's dependencies.

use crate::command;
use crate::project::Project;
use anyhow::{Result, bail};

/// The package whose feature is checked.
const PACKAGE: &str = "jointrig";

/// All its other features.
const OTHERS: &str = "sim,device-logs,png";

/// Crates that only the live page (`dashboard`) needs.
const SERVER: [&str; 6] = ["axum", "hyper", "hyper-util", "tokio", "tokio-tungstenite", "tungstenite"];

/// Searches a build without the live page for the server's crates; returns a remark.
pub fn check(project: &Project) -> Result<String> {
    let mut cargo = command::cargo(&project.root);
    cargo.args(["tree", "--package", PACKAGE, "--no-default-features", "--features", OTHERS]);
    cargo.args(["--edges", "normal,build", "--prefix", "none", "--locked"]);
    let tree = command::output(&mut cargo)?;
    let there = left(&tree);
    if there.is_empty() {
        return Ok(format!("a {PACKAGE} without `dashboard` has none of {} crates", SERVER.len()));
    }
    bail!("{PACKAGE} without its feature `dashboard` still has {}", there.join(", "))
}

/// The server's crates in the lines of `cargo tree`.
fn left(tree: &str) -> Vec<&'static str> {
    let names: Vec<&str> = tree.lines().filter_map(|line| line.split(' ').next()).collect();
    SERVER.into_iter().filter(|name| names.contains(name)).collect()
}

#[cfg(test)]
mod tests {
    use super::left;

    #[test]
    fn a_crate_is_told_from_another_whose_name_begins_so() {
        assert_eq!(left("jointrig v0.1.0 (/here)\nhyperx v1.0.0\nserde v1.0.0 (*)"), [""; 0]);
        assert_eq!(left("jointrig v0.1.0 (/here)\ntokio v1.54.0\nhyper v1.9.0 (*)"), ["hyper", "tokio"]);
    }
}
