//! Which crate may use which, which crates of others a build may contain, according to `cargo
//! metadata` and `cargo tree`, and inside the host which top-level module may use which: they are
//! layered, and a module only uses modules of lower layers.

use super::modules::{Found, Tree};
use crate::command;
use crate::project::{Package, Project};
use anyhow::{Context, Result, bail};
use std::collections::BTreeSet;

/// The packages of this repository that one package may depend on.
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

/// What the images may use.
const OF_A_BOARD: [&str; 6] = [
    "jointrig-hot",
    "jointrig-protocol",
    "jointrig-firmware",
    "jointrig-copy",
    "jointrig-board-fault",
    "jointrig-board-log",
];

/// Every package of both workspaces has an entry; dependencies only point to earlier entries.
const RULES: [Rule; 19] = [
    rule("jointrig-hot", &[]),
    rule("jointrig-protocol", &["jointrig-hot"]),
    rule("jointrig-firmware", &["jointrig-protocol", "jointrig-hot"]),
    rule("jointrig-native", &["jointrig-protocol", "jointrig-firmware"]),
    rule("jointrig-copy", &[]),
    rule("jointrig-board-fault", &["jointrig-firmware"]),
    rule("jointrig-board-log", &["jointrig-firmware"]),
    rule("nucleo-u5a5", &OF_A_BOARD),
    rule("mps2-an505", &OF_A_BOARD),
    rule("jointrig-logs", &[]),
    rule("jointrig-analysis", &[]),
    rule("jointrig-uff", &[]),
    rule(
        "jointrig-hil-sim",
        &["jointrig-hot", "jointrig-protocol", "jointrig-firmware", "jointrig-native", "jointrig-logs"],
    ),
    rule("jointrig-bridge", &["jointrig-protocol", "jointrig-firmware", "jointrig-native"]),
    Rule {
        package: "jointrig",
        uses: &["jointrig-protocol", "jointrig-logs", "jointrig-analysis", "jointrig-uff"],
        behind_a_feature: &["jointrig-hil-sim", "jointrig-bridge", "jointrig-native"],
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
            "jointrig-bridge",
            "jointrig",
        ],
    ),
    rule("jointrig-benches", &["jointrig-protocol", "jointrig-hil-sim", "jointrig", "jointrig-tests"]),
    rule("xtask", &["jointrig-logs"]),
];

/// Limits on what a build contains.
struct Build {
    package: &'static str,
    features: &'static [&'static str],
    /// Number of packages, ours and third-party, including itself.
    at_most: usize,
    /// Packages that it must not contain.
    without: &'static [&'static str],
}

/// Devices, files, screens, and the rest of the product.
const PRODUCT: [&str; 7] =
    ["jointrig-protocol", "rusqlite", "clap", "serialport", "nusb", "tokio", "indicatif"];

/// The libraries that are usable on their own, and the host without its live page.
const BUILDS: [Build; 3] = [
    Build { package: "jointrig-analysis", features: &["--all-features"], at_most: 46, without: &PRODUCT },
    Build { package: "jointrig-uff", features: &["--all-features"], at_most: 25, without: &PRODUCT },
    Build {
        package: "jointrig",
        features: &["--no-default-features", "--features", "sim,device-logs,png"],
        at_most: usize::MAX,
        without: &["axum", "hyper", "hyper-util", "tokio", "tokio-tungstenite", "tungstenite"],
    },
];

/// The page that gives the reason for each dependency.
const REASONS: &str = "docs/dependencies.md";

/// Compares both workspaces with the rules; returns a remark.
pub fn check(project: &Project) -> Result<String> {
    let mut packages = project.board_packages()?;
    packages.extend(project.packages.iter().cloned());
    let mut faults = edges(&packages, &RULES);
    for build in &BUILDS {
        faults.extend(excess(build, &contents(project, build)?));
    }
    let page = std::fs::read_to_string(project.root.join(REASONS))
        .with_context(|| format!("could not read {REASONS}"))?;
    faults.extend(without_reason(&packages, &page));
    if faults.is_empty() {
        return Ok(format!("{} packages, as allowed", packages.len()));
    }
    bail!("{}. The rules are the tables in xtask/src/layout/crates.rs", faults.join("; "))
}

/// Violations of the rules.
fn edges(packages: &[Package], rules: &[Rule]) -> Vec<String> {
    let mut faults = Vec::new();
    for rule in rules.iter().filter(|rule| !packages.iter().any(|package| package.name == rule.package)) {
        faults.push(format!("there is a rule for {}, but no such package", rule.package));
    }
    for package in packages {
        let name = &package.name;
        let Some(rule) = rules.iter().find(|rule| rule.package == name) else {
            faults.push(format!("there is no rule for {name}"));
            continue;
        };
        for dependency in package.dependencies.iter().filter(|one| !one.only_for_tests) {
            let other = &*dependency.name;
            let ours = rules.iter().any(|rule| rule.package == other);
            if !ours || rule.uses.contains(&other) {
                continue;
            }
            if !rule.behind_a_feature.contains(&other) {
                faults.push(format!("{name} must not use {other}"));
            } else if !dependency.optional {
                faults.push(format!("{name} may use {other} only behind a feature"));
            }
        }
    }
    faults
}

/// The names of all packages in a build, each version once. The package is queried alone: in the
/// whole workspace, other packages' features would add to it.
fn contents(project: &Project, build: &Build) -> Result<Vec<String>> {
    let mut cargo = command::cargo(&project.root);
    cargo.args(["tree", "--locked", "--package", build.package]).args(build.features);
    cargo.args(["--edges", "normal", "--prefix", "none", "--no-dedupe", "--format", "{p}"]);
    let text = command::output(&mut cargo)?;
    let name_and_version = |line: &str| line.split(' ').take(2).map(String::from).collect::<Vec<_>>();
    let packages: BTreeSet<Vec<String>> = text.lines().map(name_and_version).collect();
    Ok(packages.into_iter().map(|mut words| words.swap_remove(0)).collect())
}

/// What a build contains too much.
fn excess(build: &Build, contents: &[String]) -> Vec<String> {
    let there = build.without.iter().filter(|name| contents.iter().any(|one| one == *name));
    let mut faults: Vec<String> = there
        .map(|name| format!("{} ({}) contains {name}", build.package, build.features.join(" ")))
        .collect();
    if contents.len() > build.at_most {
        let (package, count, most) = (build.package, contents.len(), build.at_most);
        faults.push(format!("{package} is built from {count} packages, allowed are {most}"));
    }
    faults
}

/// The dependencies of others that no row of the page names in its first column. `embassy-sync,
/// -time` names embassy-time too.
fn without_reason(packages: &[Package], page: &str) -> Vec<String> {
    let mut named = BTreeSet::new();
    for row in page.lines().filter_map(|line| line.strip_prefix('|')) {
        let cell = row.split('|').next().unwrap_or_default();
        let words: Vec<&str> =
            cell.split([',', ' ', '(', ')', '`']).filter(|word| !word.is_empty()).collect();
        let family = words.first().and_then(|first| first.split('-').next()).unwrap_or_default();
        named.extend(words.iter().map(|word| match word.strip_prefix('-') {
            Some(_) => format!("{family}{word}"),
            None => (*word).to_owned(),
        }));
    }
    let ours = |name: &String| packages.iter().any(|package| package.name == *name);
    let all = packages.iter().flat_map(|package| &package.dependencies).map(|dependency| &dependency.name);
    let missing: BTreeSet<&String> = all.filter(|name| !ours(name) && !named.contains(*name)).collect();
    missing.into_iter().map(|name| format!("{REASONS} has no row for {name}")).collect()
}

/// The package whose modules are checked.
const LAYERED: &str = "jointrig";
/// Its layers, the lowest first. Modules of one layer do not use each other.
const LAYERS: [&[&str]; 8] = [
    &["device", "exchange"],
    &["campaign"],
    &["results"],
    &["analyse"],
    &["report"],
    &["live"],
    &["dashboard"],
    &["cli"],
];

/// Searches for uses of the same or a higher layer; returns a remark.
pub fn check_layers(project: &Project) -> Result<String> {
    let package = project.package(LAYERED).with_context(|| format!("there is no package {LAYERED}"))?;
    let root = package.roots.first().with_context(|| format!("{LAYERED} has no source"))?;
    let faults = upwards(&Tree::read(root)?, &LAYERS);
    if faults.is_empty() {
        return Ok(format!("{} layers, each uses only lower ones", LAYERS.len()));
    }
    bail!("{}. The layers are listed in xtask/src/layout/crates.rs", faults.join("\n    "))
}

/// Uses of a module that is not in a lower layer, each file and item once.
fn upwards(tree: &Tree, layers: &[&[&str]]) -> Vec<String> {
    let layer = |module: &str| layers.iter().position(|modules| modules.contains(&module));
    let mut faults = BTreeSet::new();
    for (number, module) in tree.modules.iter().enumerate() {
        for path in &module.paths {
            let Some(Found::Item(other, item)) = tree.find(number, &path.names) else { continue };
            let (Some(from), Some(to)) = (module.path.first(), tree.modules[other].path.first()) else {
                continue;
            };
            let (Some(own), Some(used)) = (layer(from), layer(to)) else { continue };
            if from != to && used >= own {
                faults.insert(format!("{} must not use {item} of {to}", module.path.join("::")));
            }
        }
    }
    faults.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::project::Dependency;

    fn package(name: &str, dependencies: &[(&str, bool)]) -> Package {
        let of = |&(name, optional): &(&str, bool)| Dependency {
            name: name.into(),
            optional,
            only_for_tests: false,
        };
        Package {
            name: name.into(),
            dependencies: dependencies.iter().map(of).collect(),
            ..Package::default()
        }
    }

    const THREE: [Rule; 3] = [
        rule("low", &[]),
        rule("middle", &["low"]),
        Rule { package: "high", uses: &["low"], behind_a_feature: &["middle"] },
    ];

    #[test]
    fn allowed_dependencies_and_crates_of_others_pass() {
        let mut packages = [
            package("low", &[("serde", false), ("high", false)]),
            package("middle", &[("low", false), ("rand", true)]),
            package("high", &[("low", false), ("middle", true)]),
        ];
        packages[0].dependencies[1].only_for_tests = true;
        assert!(edges(&packages, &THREE).is_empty());
    }

    #[test]
    fn each_forbidden_dependency_and_missing_or_stale_rule_is_named() {
        let packages =
            [package("low", &[("high", false)]), package("high", &[("middle", false)]), package("new", &[])];
        let expected = [
            "there is a rule for middle, but no such package",
            "low must not use high",
            "high may use middle only behind a feature",
            "there is no rule for new",
        ];
        assert_eq!(edges(&packages, &THREE), expected);
    }

    #[test]
    fn a_build_with_too_many_packages_or_a_forbidden_one_is_named() {
        let build =
            Build { package: "numbers", features: &["--all-features"], at_most: 2, without: &["clap"] };
        let contents = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        assert!(excess(&build, &contents(&["numbers", "clap-like"])).is_empty());
        let expected =
            ["numbers (--all-features) contains clap", "numbers is built from 3 packages, allowed are 2"];
        assert_eq!(excess(&build, &contents(&["numbers", "clap", "rayon"])), expected);
    }

    #[test]
    fn a_dependency_without_a_reason_is_named() {
        let packages =
            [package("low", &[("high", false), ("a-one", false), ("a-two", true)]), package("high", &[])];
        let expected = ["docs/dependencies.md has no row for a-two"];
        assert_eq!(without_reason(&packages, "| a, a-one | low | why |\n"), expected);
        assert!(without_reason(&packages, "| a-one (`b`), -two | low | why |\n").is_empty());
    }
}

#[cfg(test)]
mod layers_tests {
    use super::super::modules::tests::crate_of;
    use super::*;

    #[test]
    fn uses_of_a_higher_layer_and_of_the_same_one_are_named() {
        let (_folder, tree) = crate_of(&[
            ("lib.rs", "pub mod low; pub mod beside; pub mod high; mod nowhere;"),
            ("low.rs", "use crate::high::High; pub struct Low;"),
            ("beside.rs", "use crate::low::Low; use crate::nowhere::Free;"),
            ("high.rs", "use crate::low::Low; pub struct High;"),
            ("nowhere.rs", "use crate::high::High; pub struct Free;"),
        ]);
        let expected = ["beside must not use Low of low", "low must not use High of high"];
        assert_eq!(upwards(&tree, &[&["low", "beside"], &["high"]]), expected);
    }
}
