//! What may be built into the product, as defined in `deny.toml`: licences, banned crates, sources,
//! and one version of each crate.
//!
//! `cargo deny check` reads the same file and also checks security advisories; the public CI runs
//! it. Building cargo-deny takes minutes; the check here uses only `cargo metadata` and takes a
//! second.

use crate::command;
use crate::project::Project;
use anyhow::{Context, Result, bail};
use serde::Deserialize;
use spdx::{Expression, Licensee, ParseMode};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The parts of `deny.toml` that are checked here. A level other than `deny` is refused.
#[derive(Deserialize)]
struct Policy {
    graph: Graph,
    licenses: Licences,
    bans: Bans,
    sources: Sources,
}

#[derive(Deserialize)]
struct Graph {
    targets: Vec<String>,
}

#[derive(Deserialize)]
struct Licences {
    allow: Vec<String>,
    exceptions: Vec<Entry>,
}

#[derive(Deserialize)]
struct Bans {
    #[serde(rename = "multiple-versions")]
    _multiple_versions: Level,
    deny: Vec<Entry>,
    skip: Vec<Entry>,
}

/// An entry about one crate.
#[derive(Deserialize)]
struct Entry {
    #[serde(rename = "crate")]
    name: String,
    #[serde(default)]
    allow: Vec<String>,
    #[serde(default)]
    reason: String,
}

#[derive(Deserialize)]
struct Sources {
    #[serde(rename = "unknown-registry")]
    _unknown_registry: Level,
    #[serde(rename = "unknown-git")]
    _unknown_git: Level,
    #[serde(rename = "allow-registry")]
    allow_registry: Vec<String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Level {
    Deny,
}

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Crate>,
}

/// A package; one of this repository has no source.
#[derive(Clone, Deserialize)]
struct Crate {
    name: String,
    version: String,
    license: Option<String>,
    source: Option<String>,
}

/// Checks both workspaces against the policy; returns a remark.
pub fn check(project: &Project) -> Result<String> {
    let text = std::fs::read_to_string(project.root.join("deny.toml")).context("could not read deny.toml")?;
    let policy: Policy = toml::from_str(&text).context("deny.toml is not understood")?;
    let crates = policy.crates(&project.root)?;
    let mut faults = policy.faults(&crates);
    faults.extend(policy.duplicates(&crates));
    if let Some(folder) = project.boards_root() {
        faults.extend(policy.faults(&policy.crates(&folder)?));
    }
    faults.sort();
    faults.dedup();
    if faults.is_empty() {
        return Ok(format!("{} third-party crates, as deny.toml allows", crates.len()));
    }
    bail!("deny.toml does not allow this: {}", faults.join("; "))
}

impl Policy {
    /// The third-party crates of a workspace.
    fn crates(&self, folder: &Path) -> Result<Vec<Crate>> {
        let mut cargo = command::cargo(folder);
        cargo.args(["metadata", "--locked", "--all-features", "--format-version", "1"]);
        for target in &self.graph.targets {
            cargo.args(["--filter-platform", target]);
        }
        let metadata: Metadata = serde_json::from_str(&command::output(&mut cargo)?)
            .context("the answer of `cargo metadata` is not understood")?;
        Ok(metadata.packages.into_iter().filter(|package| package.source.is_some()).collect())
    }

    fn faults(&self, crates: &[Crate]) -> Vec<String> {
        let mut faults = Vec::new();
        for one in crates {
            let mut add = |fault: String| faults.push(format!("{} {}: {fault}", one.name, one.version));
            if let Err(error) = self.licence(one) {
                add(format!("{error:#}"));
            }
            if let Some(ban) = self.bans.deny.iter().find(|ban| ban.name == one.name) {
                add(format!("is banned ({})", ban.reason));
            }
            let source = one.source.as_deref().unwrap_or_default();
            let registry = source.strip_prefix("registry+").unwrap_or_default();
            if !self.sources.allow_registry.iter().any(|allowed| allowed == registry) {
                add(format!("the source {source} is not allowed"));
            }
        }
        faults
    }

    fn licence(&self, one: &Crate) -> Result<()> {
        let text = one.license.as_deref().context("it states no licence")?;
        // The older form MIT/Apache-2.0 is still common.
        let expression = Expression::parse_mode(text, ParseMode::LAX)
            .with_context(|| format!("its licence {text} is no SPDX expression"))?;
        let exceptions = self.licenses.exceptions.iter().filter(|entry| entry.name == one.name);
        let allowed = self.licenses.allow.iter().chain(exceptions.flat_map(|entry| &entry.allow));
        let allowed: Vec<Licensee> = allowed
            .map(|text| Licensee::parse(text).with_context(|| format!("{text} is no SPDX licence")))
            .collect::<Result<_>>()?;
        if expression.evaluate(|wanted| allowed.iter().any(|licensee| licensee.satisfies(wanted))) {
            return Ok(());
        }
        bail!("its licence {text} is not allowed")
    }

    /// The crates that are used in more than one version, and listed exceptions that are no longer
    /// used.
    fn duplicates(&self, crates: &[Crate]) -> Vec<String> {
        let mut versions = BTreeMap::<&str, Vec<&str>>::new();
        let mut unused: BTreeSet<String> = self.bans.skip.iter().map(|entry| entry.name.clone()).collect();
        for one in crates {
            if !unused.remove(&format!("{}@{}", one.name, one.version)) {
                versions.entry(&one.name).or_default().push(&one.version);
            }
        }
        let twice = versions.into_iter().filter(|(_, versions)| versions.len() > 1);
        twice
            .map(|(name, versions)| format!("{name} is used in versions {}", versions.join(" and ")))
            .chain(unused.into_iter().map(|name| format!("[bans] skip names {name}, which is not used")))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POLICY: &str = "[graph]\ntargets = ['here']\n[licenses]\nallow = ['MIT', 'Apache-2.0 WITH LLVM-exception']\n\
         exceptions = [{ crate = 'port', allow = ['MPL-2.0'] }]\n\
         [bans]\nmultiple-versions = 'deny'\ndeny = [{ crate = 'tokio', reason = 'threads' }]\nskip = [{ crate = 'syn@1.0.0' }]\n\
         [sources]\nunknown-registry = 'deny'\nunknown-git = 'deny'\nallow-registry = ['https://here']";

    fn policy() -> Policy {
        toml::from_str(POLICY).expect("a policy")
    }

    fn one(name: &str, version: &str, licence: &str) -> Crate {
        let source = Some("registry+https://here".into());
        Crate { name: name.into(), version: version.into(), license: Some(licence.into()), source }
    }

    #[test]
    fn licences_are_expressions_and_exceptions_are_for_one_crate() {
        let fine = [
            one("a", "1.0.0", "MIT OR GPL-3.0-only"),
            one("b", "1.0.0", "GPL-3.0-only/MIT"),
            one("c", "1.0.0", "MIT AND Apache-2.0 WITH LLVM-exception"),
            one("port", "1.0.0", "MPL-2.0"),
        ];
        assert!(policy().faults(&fine).is_empty());
        let wrong = [
            one("a", "1.0.0", "MPL-2.0"),
            one("b", "2.0.0", "MIT AND GPL-3.0-only"),
            Crate { license: None, ..one("c", "1.0.0", "") },
            one("d", "1.0.0", "Mine"),
        ];
        let faults = policy().faults(&wrong);
        assert_eq!(faults[0], "a 1.0.0: its licence MPL-2.0 is not allowed");
        assert_eq!(faults[1], "b 2.0.0: its licence MIT AND GPL-3.0-only is not allowed");
        assert_eq!(faults[2], "c 1.0.0: it states no licence");
        assert!(faults[3].starts_with("d 1.0.0: its licence Mine is no SPDX expression"), "{}", faults[3]);
    }

    #[test]
    fn banned_crates_and_foreign_sources_are_named() {
        let there = Some("git+https://there".into());
        let crates = [one("tokio", "1.0.0", "MIT"), Crate { source: there, ..one("a", "1.0.0", "MIT") }];
        let expected =
            ["tokio 1.0.0: is banned (threads)", "a 1.0.0: the source git+https://there is not allowed"];
        assert_eq!(policy().faults(&crates), expected);
    }

    #[test]
    fn a_second_version_is_named_unless_it_is_skipped() {
        let crates =
            ["1.0.0", "2.0.0"].map(|version| [one("syn", version, "MIT"), one("zip", version, "MIT")]);
        assert_eq!(policy().duplicates(&crates.concat()), ["zip is used in versions 1.0.0 and 2.0.0"]);
        assert_eq!(policy().duplicates(&[]), ["[bans] skip names syn@1.0.0, which is not used"]);
    }

    #[test]
    fn a_weaker_policy_is_refused() {
        for field in ["multiple-versions", "unknown-registry", "unknown-git"] {
            let weak = POLICY.replace(&format!("{field} = 'deny'"), &format!("{field} = 'warn'"));
            assert!(toml::from_str::<Policy>(&weak).is_err(), "{field}");
        }
    }
}
