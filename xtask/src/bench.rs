//! `cargo xtask bench`: the benchmarks beside the hot paths.

use crate::command;
use crate::project::Project;
use anyhow::Result;

/// Runs the benchmarks of every package that has some; unit tests are not run along with them.
pub fn run(project: &Project, extra: &[String]) -> Result<()> {
    let with_benches: Vec<&str> = project
        .packages
        .iter()
        .filter(|package| !package.benches.is_empty())
        .map(|package| &*package.name)
        .collect();
    if with_benches.is_empty() {
        println!("no package has benchmarks yet: they live in the folder benches/ of a package");
        return Ok(());
    }
    println!("benchmarks of {}", with_benches.join(", "));
    let mut cargo = command::cargo(&project.root);
    // `--workspace` compiles the dependencies with the same features as the tests do.
    cargo.args(["bench", "--workspace", "--bench", "*"]);
    if !extra.is_empty() {
        cargo.arg("--").args(extra);
    }
    command::run(&mut cargo)
}
