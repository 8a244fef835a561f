//! The allowed dependencies between the crates, checked with `cargo metadata`.

use crate::command;
use crate::project::{Package, Project};
use anyhow::{Result, bail};
use std::collections::BTreeSet;

/// The workspace packages that one package may depend on.
struct Rule {
    package: &'static str,
    /// Always.
    uses: &'static [&'static str],
    /// Only behind a feature.
    behind_a_feature: &'static [&'static str],
}

const fn rule(package: &'static str, uses: &'static [&'static str]) -> Rule {
    Rule { package, uses, behind_a_feature: &[] }
}

/// Every package of the workspace has an entry; dependencies only point to earlier entries.
const RULES: [Rule; 12] = [
    rule("jointrig-hot", &[]),
    rule("jointrig-protocol", &["jointrig-hot"]),
    rule("jointrig-firmware", &["jointrig-protocol", "jointrig-hot"]),
    rule("jointrig-logs", &[]),
    rule("jointrig-analysis", &[]),
    rule("jointrig-uff", &[]),
    rule("jointrig-hil-sim", &["jointrig-hot", "jointrig-protocol", "jointrig-firmware", "jointrig-logs"]),
    Rule {
        package: "jointrig",
        uses: &["jointrig-protocol", "jointrig-logs", "jointrig-analysis", "jointrig-uff"],
        behind_a_feature: &["jointrig-hil-sim"],
    },
    rule("jointrig-python", &["jointrig"]),
    rule(
        "jointrig-tests",
        &[
            "jointrig-protocol",
            "jointrig-firmware",
            "jointrig-logs",
            "jointrig-analysis",
            "jointrig-uff",
            "jointrig-hil-sim",
            "jointrig",
        ],
    ),
    rule("jointrig-benches", &["jointrig-protocol", "jointrig-hil-sim", "jointrig", "jointrig-tests"]),
    rule("xtask", &["jointrig-logs"]),
];

/// Limit on the number of packages, ours and third-party, that a library for external users depends
/// on, directly or indirectly.
struct Load {
    package: &'static str,
    /// Including itself.
    at_most: usize,
}

/// The libraries that are usable on their own.
const LOADS: [Load; 2] =
    [Load { package: "jointrig-analysis", at_most: 46 }, Load { package: "jointrig-uff", at_most: 25 }];

/// Packages on which none of them may depend: devices, files, screens, and the rest of the product.
const NEVER: [&str; 7] =
    ["jointrig-protocol", "rusqlite", "clap", "serialport", "nusb", "tokio", "indicatif"];

/// Compares the workspace with the rules; returns a remark.
pub fn check(project: &Project) -> Result<String> {
    let mut faults = edges(&project.packages, &RULES);
    for load in &LOADS {
        faults.extend(overloads(load, &needed(project, load.package)?));
    }
    if faults.is_empty() {
        return Ok(format!("{} packages keep to the walls", project.packages.len()));
    }
    bail!("{}. The rules are the tables of xtask/src/house/graph.rs", faults.join("; "))
}

/// Violations of the rules.
fn edges(packages: &[Package], rules: &[Rule]) -> Vec<String> {
    let mut faults = Vec::new();
    for rule in rules.iter().filter(|rule| !packages.iter().any(|package| package.name == rule.package)) {
        faults.push(format!("there is a rule for {}, but no such package", rule.package));
    }
    for package in packages {
        let name = &*package.name;
        let Some(rule) = rules.iter().find(|rule| rule.package == name) else {
            faults.push(format!("there is no rule of what {name} may use"));
            continue;
        };
        for dependency in &package.dependencies {
            let other = &*dependency.name;
            if !packages.iter().any(|package| package.name == other) || rule.uses.contains(&other) {
                continue;
            }
            if !rule.behind_a_feature.contains(&other) {
                faults.push(format!("{name} uses {other}, which it must not know"));
            } else if !dependency.optional {
                faults.push(format!("{name} uses {other} always, not behind a feature"));
            }
        }
    }
    faults
}

/// The names of all packages that `package` is built from, including itself, with all its features.
/// The package is queried alone: in the whole workspace, other packages' features would add to it.
fn needed(project: &Project, package: &str) -> Result<Vec<String>> {
    let arguments = [
        "tree",
        "--locked",
        "--package",
        package,
        "--all-features",
        "--edges",
        "normal",
        "--prefix",
        "none",
        "--no-dedupe",
    ];
    let text = command::output(command::cargo(&project.root).args(arguments))?;
    // Two versions of a crate count as two packages.
    let lines: BTreeSet<(&str, &str)> = text
        .lines()
        .filter_map(|line| line.split_once(' '))
        .map(|(name, rest)| (name, version(rest)))
        .collect();
    Ok(lines.into_iter().map(|(name, _)| name.to_owned()).collect())
}

/// `v1.2.3 (proc-macro)` without the remark.
fn version(text: &str) -> &str {
    text.split(' ').next().unwrap_or(text)
}

fn overloads(load: &Load, needed: &[String]) -> Vec<String> {
    let mut faults: Vec<String> = NEVER
        .iter()
        .filter(|never| needed.iter().any(|name| name == *never))
        .map(|never| format!("{} needs {never}", load.package))
        .collect();
    if needed.len() > load.at_most {
        faults.push(format!(
            "{} is built from {} packages, allowed {}",
            load.package,
            needed.len(),
            load.at_most
        ));
    }
    faults
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::project::Dependency;

    fn package(name: &str, dependencies: &[(&str, bool)]) -> Package {
        let dependencies =
            dependencies.iter().map(|&(name, optional)| Dependency { name: name.into(), optional }).collect();
        Package { name: name.into(), dependencies, ..Package::default() }
    }

    const THREE: [Rule; 3] = [
        rule("low", &[]),
        rule("middle", &["low"]),
        Rule { package: "high", uses: &["low"], behind_a_feature: &["middle"] },
    ];

    #[test]
    fn arrows_up_the_list_and_crates_of_others_are_allowed() {
        let packages = [
            package("low", &[("serde", false)]),
            package("middle", &[("low", false), ("rand", true)]),
            package("high", &[("low", false), ("middle", true)]),
        ];
        assert!(edges(&packages, &THREE).is_empty());
    }

    #[test]
    fn each_forbidden_edge_is_named() {
        let packages = [
            package("low", &[("high", false)]),
            package("middle", &[("low", false)]),
            package("high", &[("middle", false)]),
            package("new", &[]),
        ];
        let expected = [
            "low uses high, which it must not know",
            "high uses middle always, not behind a feature",
            "there is no rule of what new may use",
        ];
        assert_eq!(edges(&packages, &THREE), expected);
    }

    #[test]
    fn a_rule_for_a_package_that_is_gone_is_named() {
        let packages = [package("low", &[]), package("middle", &[])];
        assert_eq!(edges(&packages, &THREE), ["there is a rule for high, but no such package"]);
    }

    #[test]
    fn what_a_library_brings_along_is_counted_and_named() {
        let load = Load { package: "numbers", at_most: 2 };
        let needed = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        assert!(overloads(&load, &needed(&["numbers", "rayon"])).is_empty());
        let expected = ["numbers needs clap", "numbers is built from 3 packages, allowed 2"];
        assert_eq!(overloads(&load, &needed(&["numbers", "clap", "rayon"])), expected);
    }
}
