//! Locations: the two workspaces, their packages, and the target directories.
//!
//! The root workspace builds into cargo's target directory; everything for the microcontroller
//! builds into `firmware` below it, because it may use another compiler, and two compilers in one
//! target directory rebuild each other's output.

use crate::command;
use anyhow::{Context, Result};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The Cortex-M33 with its floating-point unit: the rig's controller and the emulated board.
pub const TARGET: &str = "thumbv8m.main-none-eabihf";

/// The emulated board: QEMU's machine `mps2-an505` (Cortex-M33) and our package have the same name.
pub const EMULATED_BOARD: &str = "mps2-an505";

/// The rig's controller.
pub const WIRED_BOARD: &str = "nucleo-u5a5";

/// The emulated board's other image: golden vectors and benchmark.
pub const EMULATED_CHECKS: &str = "mps2-checks";

/// The repository.
pub struct Project {
    /// The folder of the root `Cargo.toml`.
    pub root: PathBuf,
    /// Cargo's target directory of the root workspace.
    pub target: PathBuf,
    /// The packages of the root workspace.
    pub packages: Vec<Package>,
}

/// Cargo's description of a package.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Package {
    /// The name for cargo's `-p`.
    pub name: String,
    /// The root files of its library and its binaries.
    pub roots: Vec<PathBuf>,
    /// Its dependencies.
    pub dependencies: Vec<Dependency>,
    /// Its features, including the implicit ones of optional dependencies.
    pub features: Vec<String>,
    /// The names of its binaries.
    pub binaries: Vec<String>,
    /// The names of its examples.
    pub examples: Vec<String>,
    /// The names of its benchmarks.
    pub benches: Vec<String>,
}

/// A dependency of a package.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dependency {
    /// The package's name.
    pub name: String,
    /// Whether it is enabled only by a feature.
    pub optional: bool,
    /// Whether only tests, examples and benchmarks need it.
    pub only_for_tests: bool,
}

impl Project {
    /// Finds the repository to which xtask belongs.
    pub fn locate() -> Result<Self> {
        // Set by `cargo run`; if the binary is started directly, the path known at compile time is
        // used.
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

    /// The packages of the boards' workspace.
    pub fn board_packages(&self) -> Result<Vec<Package>> {
        let Some(folder) = self.boards_root() else { return Ok(Vec::new()) };
        Ok(packages(&metadata(&folder)?))
    }

    /// The boards: the packages of the boards' workspace that have a binary.
    pub fn boards(&self) -> Result<Vec<Package>> {
        let mut boards = self.board_packages()?;
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
            let texts = |kind: &str, field: &str| -> Vec<String> {
                targets
                    .iter()
                    .filter(|target| list(&target["kind"]).iter().any(|k| k == kind))
                    .filter_map(|target| target[field].as_str().map(String::from))
                    .collect()
            };
            let of_kind = |kind| texts(kind, "name");
            let roots = ["lib", "cdylib", "bin"].iter().flat_map(|kind| texts(kind, "src_path"));
            Package {
                name: package["name"].as_str().unwrap_or_default().to_owned(),
                roots: roots.map(PathBuf::from).collect(),
                dependencies: list(&package["dependencies"])
                    .iter()
                    .map(|dependency| Dependency {
                        name: dependency["name"].as_str().unwrap_or_default().to_owned(),
                        optional: dependency["optional"] == true,
                        only_for_tests: dependency["kind"] == "dev",
                    })
                    .collect(),
                features: package["features"]
                    .as_object()
                    .map(|map| map.keys().cloned().collect())
                    .unwrap_or_default(),
                binaries: of_kind("bin"),
                examples: of_kind("example"),
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
    fn a_package_is_read_with_its_features_targets_and_dependencies() {
        let metadata = json!({"packages": [{
            "name": "nucleo-u5a5",
            "features": {"default": [], "defmt": ["dep:defmt"]},
            "dependencies": [
                {"name": "defmt", "kind": null, "optional": true},
                {"name": "proptest", "kind": "dev", "optional": false},
            ],
            "targets": [
                {"name": "wiring", "kind": ["lib"], "src_path": "/src/lib.rs"},
                {"name": "nucleo-u5a5", "kind": ["bin"], "src_path": "/src/main.rs"},
                {"name": "blink", "kind": ["example"], "src_path": "/examples/blink.rs"},
                {"name": "scan", "kind": ["bench"]},
            ],
        }]});
        let expected = Package {
            name: "nucleo-u5a5".into(),
            roots: vec!["/src/lib.rs".into(), "/src/main.rs".into()],
            dependencies: vec![
                Dependency { name: "defmt".into(), optional: true, only_for_tests: false },
                Dependency { name: "proptest".into(), optional: false, only_for_tests: true },
            ],
            features: vec!["default".into(), "defmt".into()],
            binaries: vec!["nucleo-u5a5".into()],
            examples: vec!["blink".into()],
            benches: vec!["scan".into()],
        };
        assert_eq!(packages(&metadata), [expected]);
    }

    #[test]
    fn the_public_ci_runs_on_the_oldest_compiler_that_is_promised() {
        let root = Project::locate().expect("the tests run inside the repository").root;
        let read =
            |file: &str| std::fs::read_to_string(root.join(file)).expect("it is part of the repository");
        let manifest: toml::Table = read("Cargo.toml").parse().expect("a manifest");
        let oldest =
            manifest["workspace"]["package"]["rust-version"].as_str().expect("it is stated").to_owned();
        let workflow = read(".github/workflows/ci.yml");
        assert!(workflow.contains(&format!("RUSTUP_TOOLCHAIN: \"{oldest}\"")), "{oldest}");
        assert!(workflow.contains("\n      - run: cargo xtask test\n"));
    }

    #[test]
    fn the_public_ci_runs_every_fuzz_target() {
        let root = Project::locate().expect("the tests run inside the repository").root;
        let read =
            |file: &str| std::fs::read_to_string(root.join(file)).expect("it is part of the repository");
        let manifest: toml::Table = read("tests/fuzz/Cargo.toml").parse().expect("a manifest");
        let workflow = read(".github/workflows/fuzz.yml");
        for target in manifest["bin"].as_array().expect("there are targets") {
            let name = target["name"].as_str().expect("a target has a name");
            assert!(workflow.contains(&format!("          - {name}\n")), "{name}");
        }
    }

    #[test]
    fn the_repository_is_found_from_xtask() {
        let project = Project::locate().expect("the tests run inside the repository");
        assert!(project.root.join("Cargo.toml").is_file());
        assert!(project.package("xtask").is_some_and(|xtask| xtask.binaries == ["xtask"]));
        assert!(project.firmware_target().starts_with(&project.target));
    }
}
