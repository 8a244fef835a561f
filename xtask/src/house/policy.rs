//! What may be built into the product, as defined in `deny.toml`: licences, banned crates, sources,
//! and one version of each crate.
//!
//! cargo-deny reads the same file and checks more (advisories). Building it takes minutes; the
//! check here uses only `cargo metadata` and takes no time.

use crate::command;
use crate::project::Project;
use anyhow::{Context, Result, bail};
use serde_json::Value;
use spdx::{Expression, Licensee, ParseMode};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The policy file, relative to the repository's root.
const FILE: &str = "deny.toml";

/// Contents of `deny.toml`.
#[derive(Debug, Default)]
struct Policy {
    /// The target systems for which the crates are checked.
    targets: Vec<String>,
    licences: Vec<Licensee>,
    /// Licences allowed for one crate only.
    exceptions: Vec<(String, Vec<Licensee>)>,
    /// Crates that must not be used, and why.
    banned: Vec<(String, String)>,
    /// Versions that do not count as duplicates, as `crate@version`.
    skipped: Vec<String>,
    /// Allowed sources of crates.
    sources: Vec<String>,
}

/// A third-party crate.
#[derive(Debug, Default, PartialEq, Eq)]
struct Crate {
    name: String,
    version: String,
    licence: Option<String>,
    source: String,
}

/// Checks both workspaces against the policy; returns a remark.
pub fn check(project: &Project) -> Result<String> {
    let path = project.root.join(FILE);
    let text =
        std::fs::read_to_string(&path).with_context(|| format!("could not read {}", path.display()))?;
    let policy = Policy::read(&text).with_context(|| format!("{FILE} is not understood"))?;
    let crates = policy.crates(&project.root)?;
    let mut faults = policy.faults(&crates);
    faults.extend(policy.duplicates(&crates));
    if let Some(folder) = project.boards_root() {
        faults.extend(policy.faults(&policy.crates(&folder)?));
    }
    faults.sort();
    faults.dedup();
    if faults.is_empty() {
        return Ok(format!("{} crates of others keep to {FILE}", crates.len()));
    }
    bail!("{FILE} does not allow this: {}", faults.join("; "))
}

/// Converts a package that has a source; workspace packages have none.
fn of_others(package: &Value) -> Option<Crate> {
    let text = |field: &str| package[field].as_str().map(String::from);
    Some(Crate {
        source: text("source")?,
        name: text("name").unwrap_or_default(),
        version: text("version").unwrap_or_default(),
        licence: text("license"),
    })
}

impl Policy {
    fn read(text: &str) -> Result<Self> {
        let table: toml::Table = text.parse()?;
        let part = |section: &str, field: &str| -> Result<Vec<toml::Value>> {
            let value = table.get(section).and_then(|section| section.get(field));
            let list = value.and_then(toml::Value::as_array);
            list.cloned().with_context(|| format!("[{section}] has no list {field}"))
        };
        let strict = |section: &str, field: &str| {
            let value =
                table.get(section).and_then(|section| section.get(field)).and_then(toml::Value::as_str);
            if value == Some("deny") { Ok(()) } else { bail!("[{section}] {field} must be \"deny\"") }
        };
        strict("bans", "multiple-versions")?;
        strict("sources", "unknown-registry")?;
        strict("sources", "unknown-git")?;
        Ok(Self {
            targets: part("graph", "targets")?.iter().map(string).collect::<Result<_>>()?,
            licences: licensees(&part("licenses", "allow")?)?,
            exceptions: part("licenses", "exceptions")?
                .iter()
                .map(|entry| {
                    let allowed = entry.get("allow").and_then(toml::Value::as_array);
                    Ok((named(entry)?, licensees(allowed.context("an exception allows something")?)?))
                })
                .collect::<Result<_>>()?,
            banned: part("bans", "deny")?
                .iter()
                .map(|entry| Ok((named(entry)?, string(entry.get("reason").context("a ban has a reason")?)?)))
                .collect::<Result<_>>()?,
            skipped: part("bans", "skip")?.iter().map(named).collect::<Result<_>>()?,
            sources: part("sources", "allow-registry")?
                .iter()
                .map(|source| Ok(format!("registry+{}", string(source)?)))
                .collect::<Result<_>>()?,
        })
    }

    /// All third-party crates that a workspace is built from.
    fn crates(&self, folder: &Path) -> Result<Vec<Crate>> {
        let mut cargo = command::cargo(folder);
        cargo.args(["metadata", "--locked", "--all-features", "--format-version", "1"]);
        for target in &self.targets {
            cargo.args(["--filter-platform", target]);
        }
        let metadata: Value = serde_json::from_str(&command::output(&mut cargo)?)
            .context("`cargo metadata` did not answer in JSON")?;
        let packages = metadata["packages"].as_array().context("`cargo metadata` names no packages")?;
        Ok(packages.iter().filter_map(of_others).collect())
    }

    fn faults(&self, crates: &[Crate]) -> Vec<String> {
        let mut faults = Vec::new();
        for one in crates {
            faults.extend(
                self.licence(one).err().map(|error| format!("{} {}: {error:#}", one.name, one.version)),
            );
            if let Some((_, reason)) = self.banned.iter().find(|(name, _)| *name == one.name) {
                faults.push(format!("{} {} is banned ({reason})", one.name, one.version));
            }
            if !self.sources.contains(&one.source) {
                faults.push(format!("{} {} comes from {}", one.name, one.version, one.source));
            }
        }
        faults
    }

    fn licence(&self, one: &Crate) -> Result<()> {
        let text = one.licence.as_deref().context("it names no licence")?;
        // The older form MIT/Apache-2.0 is still common.
        let expression = Expression::parse_mode(text, ParseMode::LAX)
            .with_context(|| format!("its licence {text} is no SPDX expression"))?;
        let excepted =
            self.exceptions.iter().filter(|(name, _)| *name == one.name).flat_map(|(_, allowed)| allowed);
        let allowed: Vec<&Licensee> = self.licences.iter().chain(excepted).collect();
        if expression.evaluate(|wanted| allowed.iter().any(|licensee| licensee.satisfies(wanted))) {
            return Ok(());
        }
        bail!("its licence {text} is not on the list")
    }

    /// The crates that are used in more than one version, and listed exceptions that are no longer
    /// used.
    fn duplicates(&self, crates: &[Crate]) -> Vec<String> {
        let (mut versions, mut gone) =
            (BTreeMap::<&str, Vec<&str>>::new(), BTreeSet::from_iter(&self.skipped));
        for one in crates {
            if !gone.remove(&format!("{}@{}", one.name, one.version)) {
                versions.entry(&one.name).or_default().push(&one.version);
            }
        }
        let gone = gone.into_iter().map(|skipped| format!("[bans] skip names {skipped}, which is not there"));
        let twice = versions.into_iter().filter(|(_, versions)| versions.len() > 1);
        twice
            .map(|(name, versions)| format!("{name} is there in versions {}", versions.join(" and ")))
            .chain(gone)
            .collect()
    }
}

fn string(value: &toml::Value) -> Result<String> {
    value.as_str().map(String::from).with_context(|| format!("{value} is not a text"))
}

/// The crate to which an entry refers.
fn named(entry: &toml::Value) -> Result<String> {
    string(entry.get("crate").with_context(|| format!("{entry} names no crate"))?)
}

fn licensees(texts: &[toml::Value]) -> Result<Vec<Licensee>> {
    texts
        .iter()
        .map(|text| {
            let text = string(text)?;
            Licensee::parse(&text).with_context(|| format!("{text} is no SPDX licence"))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: &str = "registry+https://here";

    fn policy() -> Policy {
        Policy::read(
            "[graph]\ntargets = ['here']\n[licenses]\nallow = ['MIT', 'Apache-2.0 WITH LLVM-exception']\nexceptions = [{ crate = 'port', allow = ['MPL-2.0'] }]\n\
             [bans]\nmultiple-versions = 'deny'\ndeny = [{ crate = 'tokio', reason = 'threads' }]\nskip = [{ crate = 'syn@1.0.0' }]\n\
             [sources]\nunknown-registry = 'deny'\nunknown-git = 'deny'\nallow-registry = ['https://here']",
        )
        .expect("a policy")
    }

    fn one(name: &str, version: &str, licence: &str) -> Crate {
        Crate {
            name: name.into(),
            version: version.into(),
            licence: Some(licence.into()),
            source: HERE.into(),
        }
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
            one("c", "1.0.0", "Mine"),
        ];
        let faults = policy().faults(&wrong);
        assert_eq!(faults[0], "a 1.0.0: its licence MPL-2.0 is not on the list");
        assert_eq!(faults[1], "b 2.0.0: its licence MIT AND GPL-3.0-only is not on the list");
        assert!(faults[2].starts_with("c 1.0.0: its licence Mine is no SPDX expression"), "{}", faults[2]);
        let none = Crate { licence: None, ..one("a", "1.0.0", "") };
        assert_eq!(policy().faults(&[none]), ["a 1.0.0: it names no licence"]);
    }

    #[test]
    fn banned_crates_and_foreign_sources_are_named() {
        let crates = [
            one("tokio", "1.0.0", "MIT"),
            Crate { source: "git+https://there".into(), ..one("a", "1.0.0", "MIT") },
        ];
        let expected = ["tokio 1.0.0 is banned (threads)", "a 1.0.0 comes from git+https://there"];
        assert_eq!(policy().faults(&crates), expected);
    }

    #[test]
    fn a_second_version_is_named_unless_it_is_skipped() {
        let crates = [
            one("syn", "1.0.0", "MIT"),
            one("syn", "2.0.0", "MIT"),
            one("zip", "1.0.0", "MIT"),
            one("zip", "2.0.0", "MIT"),
        ];
        assert_eq!(policy().duplicates(&crates), ["zip is there in versions 1.0.0 and 2.0.0"]);
        assert_eq!(policy().duplicates(&[]), ["[bans] skip names syn@1.0.0, which is not there"]);
    }

    #[test]
    fn a_policy_that_lets_things_through_is_refused() {
        let text = "[bans]\nmultiple-versions = 'warn'";
        let message = Policy::read(text).expect_err("too weak").to_string();
        assert_eq!(message, "[bans] multiple-versions must be \"deny\"");
    }
}
