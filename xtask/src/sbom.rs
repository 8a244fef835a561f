//! Components of a program: every third-party crate in it, with version, licence and checksum, as a
//! CycloneDX 1.5 document.
//!
//! All data come from `cargo metadata` and the lock file. The document is reproducible byte for
//! byte from the lock file: it contains no time and no serial number.

use crate::command;
use crate::project::{EMULATED_BOARD, Project, TARGET};
use anyhow::{Context, Result, bail};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A program that is distributed.
struct Product<'p> {
    package: &'p str,
    /// The workspace in which it is built.
    root: PathBuf,
    /// The target for which it is built; `None` for this machine.
    target: Option<&'p str>,
}

/// `cargo xtask sbom`: one document for each program, in `target/sbom`.
pub fn run(project: &Project) -> Result<()> {
    let mut products = vec![
        Product { package: "jointrig", root: project.root.clone(), target: None },
        Product { package: "jointrig-python", root: project.root.clone(), target: None },
    ];
    let boards = project.boards()?;
    let root = project.boards_root().unwrap_or_else(|| project.root.clone());
    for board in boards.iter().filter(|board| board.name != EMULATED_BOARD) {
        products.push(Product { package: &board.name, root: root.clone(), target: Some(TARGET) });
    }
    let folder = project.target.join("sbom");
    std::fs::create_dir_all(&folder).with_context(|| format!("could not make {}", folder.display()))?;
    for product in products {
        let path = folder.join(format!("{}.cdx.json", product.package));
        let count = write(&product, &path)?;
        println!("{}: {count} crates", path.display());
    }
    Ok(())
}

/// Writes the document of a board's image next to the image.
pub fn of_board(root: &Path, package: &str, image: &Path) -> Result<PathBuf> {
    let path = image.with_extension("cdx.json");
    write(&Product { package, root: root.into(), target: Some(TARGET) }, &path)?;
    Ok(path)
}

/// Writes the document of a program of the root workspace for one target.
pub fn of_program(project: &Project, package: &str, target: &str, path: &Path) -> Result<()> {
    write(&Product { package, root: project.root.clone(), target: Some(target) }, path)?;
    Ok(())
}

fn write(product: &Product<'_>, path: &Path) -> Result<usize> {
    let mut cargo = command::cargo(&product.root);
    cargo.args(["metadata", "--locked", "--format-version", "1"]);
    let host = host_target()?;
    cargo.args(["--filter-platform", product.target.unwrap_or(&host)]);
    let metadata: Value = serde_json::from_str(&command::output(&mut cargo)?)
        .context("`cargo metadata` did not answer in JSON")?;
    let lock = product.root.join("Cargo.lock");
    let lock =
        std::fs::read_to_string(&lock).with_context(|| format!("could not read {}", lock.display()))?;
    let document = document(&metadata, &lock, product.package)?;
    let count = document["components"].as_array().map_or(0, Vec::len);
    std::fs::write(path, serde_json::to_string_pretty(&document)? + "\n")
        .with_context(|| format!("could not write {}", path.display()))?;
    Ok(count)
}

/// The target of this machine.
pub fn host_target() -> Result<String> {
    let told = command::output(std::process::Command::new("rustc").arg("-vV"))?;
    let host = told.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.context("rustc does not say what it compiles for")?.to_owned())
}

fn text<'v>(value: &'v Value, field: &str) -> &'v str {
    value[field].as_str().unwrap_or_default()
}

fn purl(package: &Value) -> String {
    format!("pkg:cargo/{}@{}", text(package, "name"), text(package, "version"))
}

/// Checksums of the lock, by name and version.
fn checksums(lock: &str) -> Result<BTreeMap<(String, String), String>> {
    let table: toml::Table = lock.parse().context("the lock is not understood")?;
    let packages =
        table.get("package").and_then(toml::Value::as_array).context("the lock names no packages")?;
    let field = |package: &toml::Value, name: &str| {
        package.get(name).and_then(toml::Value::as_str).unwrap_or_default().to_owned()
    };
    let all = packages.iter().map(|p| ((field(p, "name"), field(p, "version")), field(p, "checksum")));
    Ok(all.filter(|(_, sum)| !sum.is_empty()).collect())
}

fn document(metadata: &Value, lock: &str, package: &str) -> Result<Value> {
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let packages: BTreeMap<String, Value> =
        list(&metadata["packages"]).into_iter().map(|p| (text(&p, "id").to_owned(), p)).collect();
    // dependencies that are linked, or run during the build; those of tests are not in any
    // distributed program
    let counts =
        |dependency: &Value| list(&dependency["dep_kinds"]).iter().any(|kind| text(kind, "kind") != "dev");
    let needs: BTreeMap<String, Vec<String>> = list(&metadata["resolve"]["nodes"])
        .iter()
        .map(|node| {
            let deps = list(&node["deps"]);
            let own = deps.iter().filter(|dep| counts(dep)).map(|dep| text(dep, "pkg").to_owned());
            (text(node, "id").to_owned(), own.collect())
        })
        .collect();
    let Some((root, program)) = packages.iter().find(|(_, p)| text(p, "name") == package) else {
        bail!("there is no package {package}");
    };
    let mut reached = BTreeSet::from([root.clone()]);
    let mut left = vec![root.clone()];
    while let Some(id) = left.pop() {
        for need in needs.get(&id).into_iter().flatten() {
            if reached.insert(need.clone()) {
                left.push(need.clone());
            }
        }
    }
    let sums = checksums(lock)?;
    let component = |kind: &str, package: &Value| {
        let (name, version) = (text(package, "name"), text(package, "version"));
        let mut component = json!({
            "type": kind, "bom-ref": purl(package), "name": name, "version": version, "purl": purl(package),
        });
        if let Some(licence) = package["license"].as_str() {
            // cargo formerly allowed a slash for OR
            component["licenses"] = json!([{ "expression": licence.replace('/', " OR ") }]);
        }
        if let Some(sum) = sums.get(&(name.to_owned(), version.to_owned())) {
            component["hashes"] = json!([{ "alg": "SHA-256", "content": sum }]);
        }
        if let Some(repository) = package["repository"].as_str() {
            component["externalReferences"] = json!([{ "type": "vcs", "url": repository }]);
        }
        component
    };
    let known =
        |id: &String| packages.get(id).with_context(|| format!("`cargo metadata` does not describe {id}"));
    let mut components = Vec::new();
    let mut dependencies = Vec::new();
    for id in &reached {
        let package = known(id)?;
        if id != root {
            components.push(component("library", package));
        }
        let on: BTreeSet<String> =
            needs.get(id).into_iter().flatten().map(|id| known(id).map(purl)).collect::<Result<_>>()?;
        dependencies.push(json!({ "ref": purl(package), "dependsOn": on }));
    }
    Ok(json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": { "component": component("application", program) },
        "components": components,
        "dependencies": dependencies,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_built_in_is_listed_and_what_only_tests_use_is_not() {
        let package = |name: &str, licence: &str| json!({ "id": name, "name": name, "version": "1.0.0", "license": licence });
        let dep = |name: &str, kind: Value| json!({ "pkg": name, "dep_kinds": [{ "kind": kind }] });
        let metadata = json!({
            "packages": [package("app", "MIT"), package("used", "MIT/Apache-2.0"), package("builds", "MIT"), package("tests", "MIT"), package("below", "MIT")],
            "resolve": { "nodes": [
                { "id": "app", "deps": [dep("used", Value::Null), dep("builds", json!("build")), dep("tests", json!("dev"))] },
                { "id": "used", "deps": [dep("below", Value::Null)] },
                { "id": "builds", "deps": [] }, { "id": "tests", "deps": [] }, { "id": "below", "deps": [] },
            ] },
        });
        let lock = "[[package]]\nname = \"used\"\nversion = \"1.0.0\"\nchecksum = \"ab12\"\n";
        let found = document(&metadata, lock, "app").expect("a document");
        let names: Vec<&str> =
            found["components"].as_array().expect("a list").iter().map(|c| text(c, "name")).collect();
        assert_eq!(names, ["below", "builds", "used"]);
        let used = &found["components"][2];
        assert_eq!(used["licenses"][0]["expression"], "MIT OR Apache-2.0");
        assert_eq!(used["hashes"][0]["content"], "ab12");
        assert_eq!(
            found["dependencies"][0]["dependsOn"],
            json!(["pkg:cargo/builds@1.0.0", "pkg:cargo/used@1.0.0"])
        );
        assert!(document(&metadata, lock, "nobody").is_err());
    }
}
