//! Where things are: the two workspaces, their packages, and the target directories.
//!
//! The root workspace builds into cargo's target directory; everything for the microcontroller builds into `firmware`
//! below it, because it may use another compiler, and two compilers in one target directory rebuild each other's work.

use crate::command;
use anyhow::{Context, Result};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The repository as xtask sees it.
pub struct Project {
    /// The folder of the root `Cargo.toml`.
    pub root: PathBuf,
    /// Cargo's target directory of the root workspace.
    pub target: PathBuf,
    /// The packages of the root workspace.
    pub packages: Vec<Package>,
}

/// What cargo says about one package.
#[derive(Debug, PartialEq, Eq)]
pub struct Package {
    /// The name `-p` takes.
    pub name: String,
    /// Its features, the implicit ones of optional dependencies included.
    pub features: Vec<String>,
    /// The names of its binaries.
    pub binaries: Vec<String>,
    /// The names of its benchmarks.
    pub benches: Vec<String>,
}

impl Project {
    /// Finds the repository xtask belongs to.
    pub fn locate() -> Result<Self> {
        // Set by `cargo run`; the path known at compile time serves when the binary is started by hand.
        let manifest =
            std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
        let root = Path::new(&manifest)
            .parent()
            .with_context(|| {
                format!("{} has no parent folder: run `cargo xtask` in the repository", manifest.display())
            })?
            .to_path_buf();
        let metadata = metadata(&root)?;
        let target =
            metadata["target_directory"].as_str().context("`cargo metadata` names no target directory")?;
        Ok(Self { target: PathBuf::from(target), packages: packages(&metadata), root })
    }

    /// The target directory of everything compiled for the microcontroller.
    pub fn firmware_target(&self) -> PathBuf {
        self.target.join("firmware")
    }

    /// The folder of the boards' workspace, when there is one.
    pub fn boards_root(&self) -> Option<PathBuf> {
        let folder = self.root.join("firmware/boards");
        folder.join("Cargo.toml").is_file().then_some(folder)
    }

    /// The boards: the packages of the boards' workspace that have a binary.
    pub fn boards(&self) -> Result<Vec<Package>> {
        let Some(folder) = self.boards_root() else { return Ok(Vec::new()) };
        let mut boards = packages(&metadata(&folder)?);
        boards.retain(|package| !package.binaries.is_empty());
        Ok(boards)
    }

    /// A package of the root workspace.
    pub fn package(&self, name: &str) -> Option<&Package> {
        self.packages.iter().find(|package| package.name == name)
    }
}

fn metadata(folder: &Path) -> Result<Value> {
    let text = command::output(command::cargo(folder).args([
        "metadata",
        "--no-deps",
        "--offline",
        "--format-version",
        "1",
    ]))?;
    serde_json::from_str(&text).context("`cargo metadata` did not answer in JSON")
}

fn packages(metadata: &Value) -> Vec<Package> {
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    list(&metadata["packages"])
        .iter()
        .map(|package| {
            let targets = list(&package["targets"]);
            let of_kind = |kind: &str| {
                targets
                    .iter()
                    .filter(|target| list(&target["kind"]).iter().any(|k| k == kind))
                    .filter_map(|target| target["name"].as_str().map(String::from))
                    .collect()
            };
            Package {
                name: package["name"].as_str().unwrap_or_default().to_owned(),
                features: package["features"]
                    .as_object()
                    .map(|map| map.keys().cloned().collect())
                    .unwrap_or_default(),
                binaries: of_kind("bin"),
                benches: of_kind("bench"),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_package_is_read_with_its_features_binaries_and_benches() {
        let metadata = json!({"packages": [{
            "name": "nucleo-u5a5",
            "features": {"default": [], "defmt": ["dep:defmt"]},
            "targets": [
                {"name": "wiring", "kind": ["lib"]},
                {"name": "nucleo-u5a5", "kind": ["bin"]},
                {"name": "scan", "kind": ["bench"]},
            ],
        }]});
        let expected = Package {
            name: "nucleo-u5a5".into(),
            features: vec!["default".into(), "defmt".into()],
            binaries: vec!["nucleo-u5a5".into()],
            benches: vec!["scan".into()],
        };
        assert_eq!(packages(&metadata), [expected]);
    }

    #[test]
    fn the_repository_is_found_from_xtask() {
        let project = Project::locate().expect("the tests run inside the repository");
        assert!(project.root.join("Cargo.toml").is_file());
        assert!(project.package("xtask").is_some_and(|xtask| xtask.binaries == ["xtask"]));
        assert!(project.firmware_target().starts_with(&project.target));
    }
}
