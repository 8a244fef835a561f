//! `cargo xtask release`: the files of a release, and the checks of them.
//!
//! The workflow `release.yml` calls it with `--target` on a machine of each system, then with
//! `--firmware`, `--crates` and `--sums`. `cargo xtask release --check` does the same for
//! everything that this machine can make, and states what it cannot. All files are in
//! `target/release-files`.
//!
//! Linux programs are linked with Zig against glibc 2.17, as the wheels are: the version symbols
//! of the result are compared with that. The component list of each program is compared with the
//! crates that `cargo tree`, which resolves features by itself, says are compiled into it.

use crate::packages::Consent;
use crate::project::{Project, WIRED_BOARD};
use crate::{command, firmware, python, sbom, setup};
use anyhow::{Context, Result, bail};
use clap::Args;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Targets of a release.
const TARGETS: [&str; 5] = [
    "x86_64-unknown-linux-gnu",
    "aarch64-unknown-linux-gnu",
    "x86_64-pc-windows-msvc",
    "x86_64-apple-darwin",
    "aarch64-apple-darwin",
];

/// Oldest glibc on which the Linux programs run: that of manylinux2014, as for the wheels.
const GLIBC: (u32, u32) = (2, 17);

/// The packages that link a Linux program against an old glibc.
const LINUX_TOOLS: [&str; 2] = ["cargo-zigbuild", "ziglang"];

/// Maximum size of the command, bytes.
const PROGRAM: u64 = 25_000_000;

/// Crates that are published, each after those that it depends on.
const CRATES: [&str; 4] = ["jointrig-hot", "jointrig-protocol", "jointrig-analysis", "jointrig-uff"];

/// Files that every archive of the command contains besides it.
const BESIDE: [&str; 5] =
    ["README.md", "CHANGELOG.md", "LICENSE-MIT", "LICENSE-APACHE", "docs/udev/70-jointrig.rules"];

/// How to wire, flash and first start a board, in the archive of the firmware.
const BESIDE_FIRMWARE: [&str; 6] = [
    "docs/install.md",
    "docs/first-light.md",
    "docs/WIRING.md",
    "docs/safety.md",
    "LICENSE-MIT",
    "LICENSE-APACHE",
];

/// The name of the list of checksums.
const SUMS: &str = "SHA256SUMS";

/// Which part of a release is made.
#[derive(Args)]
#[group(required = true, multiple = true, args = ["check", "target", "firmware", "crates", "sums"])]
pub struct Options {
    /// Make and check everything that this machine can, and state what it cannot.
    #[arg(long, conflicts_with_all = ["target", "firmware", "crates", "sums"])]
    check: bool,
    /// Make program, wheel and component list for this target; may be repeated.
    #[arg(long, value_name = "TRIPLE", value_parser = TARGETS)]
    target: Vec<String>,
    /// Make the archive of the firmware.
    #[arg(long)]
    firmware: bool,
    /// Check that the crates could be published.
    #[arg(long)]
    crates: bool,
    /// Write the checksums of all files in this folder.
    #[arg(long, value_name = "DIR")]
    sums: Option<PathBuf>,
    /// Fail unless the version is that of this tag, such as v0.1.0.
    #[arg(long, value_name = "TAG")]
    tag: Option<String>,
}

/// Makes the chosen parts.
pub fn run(project: &Project, options: &Options) -> Result<()> {
    let version = agreed_version(&project.root)?;
    if let Some(tag) = &options.tag
        && *tag != format!("v{version}")
    {
        bail!("the tag is {tag}, and the version {version}: tag v{version}, or change the version");
    }
    let folder = project.target.join("release-files");
    fs::create_dir_all(&folder).with_context(|| format!("could not make {}", folder.display()))?;
    let release = Release { project, version, folder };
    if options.check {
        return release.check();
    }
    for target in &options.target {
        release.program(target)?;
        release.wheel(target)?;
    }
    if options.firmware {
        release.firmware()?;
    }
    if options.crates {
        release.crates()?;
    }
    if let Some(folder) = &options.sums {
        write_sums(folder)?;
    }
    Ok(())
}

struct Release<'p> {
    project: &'p Project,
    version: String,
    folder: PathBuf,
}

impl Release<'_> {
    /// Everything that this machine can do.
    fn check(&self) -> Result<()> {
        for old in fs::read_dir(&self.folder)?.flatten() {
            fs::remove_file(old.path())
                .with_context(|| format!("could not remove {}", old.path().display()))?;
        }
        // what takes seconds comes first; it needs only cargo's metadata, so it can be made for the
        // targets that cannot be built
        for target in TARGETS {
            self.components(target)?;
        }
        self.firmware()?;
        self.crates()?;
        let mut left_out = Vec::new();
        for target in TARGETS {
            if let Some(why) = cannot_build(target) {
                left_out.push(format!("{target}: {why}"));
                continue;
            }
            self.program(target)?;
            self.wheel(target)?;
        }
        let sizes = write_sums(&self.folder)?;
        self.documented_installs()?;
        println!("\nversion {}, in {}:", self.version, self.folder.display());
        for (name, bytes) in sizes {
            println!("  {:>10.3} MB  {name}", bytes as f64 / 1e6);
        }
        for what in &left_out {
            println!("LEFT OUT: {what}");
        }
        println!("LEFT OUT: the attestation of provenance, which only the workflow can sign");
        println!("LEFT OUT: cargo-semver-checks, which needs an earlier release to compare with");
        Ok(())
    }

    /// The command for one target, with what belongs to it, as an archive.
    fn program(&self, target: &str) -> Result<()> {
        if let Some(why) = cannot_build(target) {
            bail!("the program for {target} cannot be built here: {why}");
        }
        println!("program for {target}");
        let built = self.compile(target)?;
        let bytes = fs::read(&built).with_context(|| format!("could not read {}", built.display()))?;
        if bytes.len() as u64 > PROGRAM {
            bail!("{} has {} bytes, and {PROGRAM} are allowed", built.display(), bytes.len());
        }
        if target.contains("linux") {
            let needed = newest_glibc(&bytes).with_context(|| {
                format!("{} names no version of glibc: was it linked for {target}?", built.display())
            })?;
            if needed > GLIBC {
                bail!(
                    "{} needs glibc {}.{}, and {}.{} is promised",
                    built.display(),
                    needed.0,
                    needed.1,
                    GLIBC.0,
                    GLIBC.1
                );
            }
            println!("  it needs glibc {}.{}", needed.0, needed.1);
        }
        let name = format!("jointrig-{}-{target}", self.version);
        let stage = self.stage(&name, &BESIDE)?;
        let program = built.file_name().context("a program has a name")?;
        copy(&built, &stage.join(program))?;
        self.components(target)?;
        let archive = self.archive(&name, if target.contains("windows") { "zip" } else { "tar.gz" })?;
        if target != host()? {
            println!("  LEFT OUT: it was not run, because this machine is not {target}");
            return Ok(());
        }
        let unpacked = self.stage("unpacked", &[])?;
        command::run(Command::new("tar").arg("-xf").arg(&archive).arg("-C").arg(&unpacked))
            .with_context(|| format!("{} cannot be unpacked", archive.display()))?;
        let program = unpacked.join(name).join(program);
        self.states_its_version(&program)?;
        let mut test = Command::new(program);
        test.args(["self-test", "--quick", "--folder"]).arg(&self.project.target);
        command::run(&mut test).context("the program does not pass its own test")
    }

    /// Compiles and links the command; returns its path.
    fn compile(&self, target: &str) -> Result<PathBuf> {
        let mut cargo = if target.contains("linux") {
            let python = python::newest()?;
            let tools =
                python::environment(&python, &self.project.target.join("python/release-tools"), &LINUX_TOOLS)
                    .context("no environment with cargo-zigbuild can be made; pip needs its registry")?;
            let mut zig = command::without_own_package(tools.with_file_name("cargo-zigbuild"));
            zig.current_dir(&self.project.root).arg("zigbuild");
            zig.args(["--target", &format!("{target}.{}.{}", GLIBC.0, GLIBC.1)]);
            zig.env("PATH", python::before_path(&tools)?);
            zig
        } else {
            let mut cargo = command::cargo(&self.project.root);
            cargo.args(["build", "--target", target]);
            if target.contains("windows") {
                // so that no redistributable of the compiler must be installed
                cargo.env("RUSTFLAGS", "-C target-feature=+crt-static");
            }
            cargo
        };
        cargo.args(["--release", "--locked", "--package", "jointrig", "--bin", "jointrig"]);
        // the program must not depend on a contributor's settings
        cargo.env("CARGO_TARGET_DIR", &self.project.target).env("CARGO_INCREMENTAL", "0");
        command::run(&mut cargo).with_context(|| format!("the program for {target} cannot be built"))?;
        let name = if target.contains("windows") { "jointrig.exe" } else { "jointrig" };
        Ok(self.project.target.join(target).join("release").join(name))
    }

    fn states_its_version(&self, program: &Path) -> Result<()> {
        let said = command::output(Command::new(program).arg("--version"))?;
        if said.trim() != format!("jointrig {}", self.version) {
            bail!("{} says `{}`, and its version is {}", program.display(), said.trim(), self.version);
        }
        Ok(())
    }

    /// The three ways of docs/install.md, by its own commands: a downloaded archive, a downloaded
    /// wheel, and the sources. Each installs into an empty folder of its own.
    fn documented_installs(&self) -> Result<()> {
        if host()? != TARGETS[0] {
            println!("LEFT OUT: the commands of docs/install.md, which are those of {}", TARGETS[0]);
            return Ok(());
        }
        let page = fs::read_to_string(self.project.root.join("docs/install.md"))
            .context("could not read docs/install.md")?;
        let home = self.stage("home", &[])?;
        let run = |section: &str, folder: &Path, path: &OsStr| -> Result<()> {
            let commands = commands_of(&page, section)?;
            println!("docs/install.md, {section}");
            let mut shell = command::without_own_package("sh");
            shell.args(["-e", "-x", "-c", &commands]).current_dir(folder);
            shell.env("HOME", &home).env("PATH", path).env("CARGO_INSTALL_ROOT", home.join("cargo"));
            shell.env("CARGO_TARGET_DIR", &self.project.target);
            // found in the user's real home unless they are set
            for (name, folder) in [("CARGO_HOME", ".cargo"), ("RUSTUP_HOME", ".rustup")] {
                if std::env::var_os(name).is_none()
                    && let Some(user) = std::env::home_dir()
                {
                    shell.env(name, user.join(folder));
                }
            }
            command::run(&mut shell)
                .with_context(|| format!("the commands under \"{section}\" of docs/install.md fail"))
        };
        let path = std::env::var_os("PATH").unwrap_or_default();
        run("Download", &self.folder, &path)?;
        self.states_its_version(&home.join(".local/bin/jointrig"))?;
        let python = python::empty_environment(self.project)?;
        run("pip", &self.folder, &python::before_path(&python)?)?;
        python::try_out(&python, &self.version)?;
        run("cargo", &self.project.root, &path)?;
        self.states_its_version(&home.join("cargo/bin/jointrig"))
    }

    /// The wheel for one target.
    fn wheel(&self, target: &str) -> Result<()> {
        println!("wheel for {target}");
        let wheel = python::build_release(self.project, target)?;
        copy(&wheel, &self.folder.join(wheel.file_name().context("a wheel has a name")?))?;
        if target != host()? {
            println!("  LEFT OUT: it was not imported, because this machine is not {target}");
            return Ok(());
        }
        let python = python::empty_environment(self.project)?;
        python::pip(&python, &["install", "--quiet"], &[&wheel])?;
        python::try_out(&python, &self.version)
    }

    /// The component list of the command for one target, compared with what is compiled into it.
    fn components(&self, target: &str) -> Result<()> {
        let path = self.folder.join(format!("jointrig-{}-{target}.cdx.json", self.version));
        sbom::of_program(self.project, "jointrig", target, &path)?;
        let document: Value = serde_json::from_str(&fs::read_to_string(&path)?)?;
        let listed = listed(&document)?;
        let mut cargo = command::cargo(&self.project.root);
        cargo.args([
            "tree",
            "--locked",
            "--package",
            "jointrig",
            "--edges",
            "normal,build",
            "--prefix",
            "none",
        ]);
        cargo.args(["--target", target, "--format", "{p}"]);
        let compiled = compiled(&command::output(&mut cargo)?);
        let missing: Vec<&str> = compiled.difference(&listed).map(String::as_str).collect();
        if compiled.is_empty() || !missing.is_empty() {
            bail!("{} lacks crates that are compiled: {}", path.display(), missing.join(", "));
        }
        println!("  components for {target}: {} listed, {} of them compiled", listed.len(), compiled.len());
        Ok(())
    }

    /// The image of the rig's controller, with how to flash it.
    fn firmware(&self) -> Result<()> {
        let toolchain = setup::target(self.project, Consent::new(false))?;
        firmware::build_boards(self.project, &toolchain, Some(WIRED_BOARD))?;
        let name = format!("jointrig-firmware-{WIRED_BOARD}-{}", self.version);
        let stage = self.stage(&name, &BESIDE_FIRMWARE)?;
        let image = firmware::image_of(self.project, WIRED_BOARD);
        for (from, to) in [("", "elf"), ("bin", "bin"), ("cdx.json", "cdx.json")] {
            copy(&image.with_extension(from), &stage.join(format!("{WIRED_BOARD}.{to}")))?;
        }
        self.archive(&name, "tar.gz").map(drop)
    }

    /// Packs and compiles the crates that are published, as cargo would do before uploading them.
    fn crates(&self) -> Result<()> {
        let mut cargo = command::cargo(&self.project.root);
        cargo.args(["publish", "--dry-run", "--locked"]);
        for name in CRATES {
            cargo.args(["--package", name]);
        }
        command::run(&mut cargo).context(
            "the crates could not be published; cargo names the reason. It refuses changes that are not committed",
        )
    }

    /// An empty folder with these files of the repository.
    fn stage(&self, name: &str, files: &[&str]) -> Result<PathBuf> {
        let stage = self.project.target.join("release-stage").join(name);
        if stage.is_dir() {
            fs::remove_dir_all(&stage).with_context(|| format!("could not clear {}", stage.display()))?;
        }
        fs::create_dir_all(&stage).with_context(|| format!("could not make {}", stage.display()))?;
        for file in files {
            let from = self.project.root.join(file);
            copy(&from, &stage.join(from.file_name().context("a file has a name")?))?;
        }
        Ok(stage)
    }

    /// Packs a stage.
    fn archive(&self, name: &str, kind: &str) -> Result<PathBuf> {
        let path = self.folder.join(format!("{name}.{kind}"));
        let mut tar = Command::new("tar");
        // Windows' tar chooses the format by the name
        tar.args(if kind == "zip" { ["-a", "-cf"] } else { ["-c", "-zf"] });
        tar.arg(&path);
        tar.arg("-C").arg(self.project.target.join("release-stage")).arg(name);
        command::run(&mut tar).with_context(|| format!("{name} cannot be packed"))?;
        Ok(path)
    }
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::copy(from, to).with_context(|| format!("could not copy {} to {}", from.display(), to.display()))?;
    Ok(())
}

/// This machine's target.
fn host() -> Result<String> {
    sbom::host_target()
}

/// Why this machine cannot build for a target; `None` if it can.
fn cannot_build(target: &str) -> Option<String> {
    if !python::installed(target) {
        return Some(format!("the compiler has no standard library for it (`rustup target add {target}`)"));
    }
    let linker = [("windows", cfg!(windows)), ("apple", cfg!(target_os = "macos"))];
    let foreign = linker.iter().find(|(system, here)| target.contains(system) && !here);
    foreign.map(|(system, _)| format!("only a machine with {system} has its linker"))
}

/// The newest version of glibc that a program's symbols name.
fn newest_glibc(program: &[u8]) -> Option<(u32, u32)> {
    const MARK: &[u8] = b"GLIBC_";
    let places = program.windows(MARK.len()).enumerate().filter(|(_, window)| *window == MARK);
    let versions = places.filter_map(|(at, _)| {
        let rest = &program[at + MARK.len()..];
        let end =
            rest.iter().position(|byte| !(byte.is_ascii_digit() || *byte == b'.')).unwrap_or(rest.len());
        let mut numbers = std::str::from_utf8(&rest[..end]).ok()?.split('.').map(str::parse::<u32>);
        Some((numbers.next()?.ok()?, numbers.next()?.ok()?))
    });
    versions.max()
}

/// Name and version of each component of a list, each of which must have a licence, and from the
/// registry a checksum.
fn listed(document: &Value) -> Result<BTreeSet<String>> {
    let components = document["components"].as_array().context("the list has no components")?;
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let mut all = BTreeSet::new();
    for component in components {
        let name = format!("{} v{}", text(&component["name"]), text(&component["version"]));
        if component["licenses"].as_array().is_none_or(Vec::is_empty) {
            bail!("{name} has no licence in the list of components");
        }
        if component["hashes"].as_array().is_none_or(Vec::is_empty) && !name.starts_with("jointrig") {
            bail!("{name} has no checksum in the list of components");
        }
        all.insert(name);
    }
    Ok(all)
}

/// Name and version of each crate in the output of `cargo tree`, without the program itself.
fn compiled(tree: &str) -> BTreeSet<String> {
    let lines = tree.lines().filter(|line| !line.is_empty() && !line.starts_with("jointrig v"));
    lines.map(|line| line.split(' ').take(2).collect::<Vec<_>>().join(" ")).collect()
}

/// The commands of a section of docs/install.md: its indented lines.
fn commands_of(page: &str, section: &str) -> Result<String> {
    let mut own = page.split("\n## ").find(|text| text.lines().next() == Some(section)).map(str::lines);
    let own = own.as_mut().with_context(|| format!("docs/install.md has no section {section}"))?;
    let commands: Vec<&str> = own.filter_map(|line| line.strip_prefix("    ")).collect();
    if commands.is_empty() {
        bail!("section {section} of docs/install.md has no commands");
    }
    Ok(commands.join("\n"))
}

/// Writes the checksums of all files in a folder; returns their names and sizes.
fn write_sums(folder: &Path) -> Result<Vec<(String, u64)>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| format!("could not read {}", folder.display()))? {
        let path = entry?.path();
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        if path.is_file() && name != SUMS {
            files.push((name, path));
        }
    }
    if files.is_empty() {
        bail!("{} has no files: make them first", folder.display());
    }
    files.sort();
    let (mut text, mut sizes) = (String::new(), Vec::new());
    for (name, path) in files {
        let bytes = fs::read(&path).with_context(|| format!("could not read {}", path.display()))?;
        for byte in Sha256::digest(&bytes) {
            write!(text, "{byte:02x}")?;
        }
        writeln!(text, "  {name}")?;
        sizes.push((name, bytes.len() as u64));
    }
    fs::write(folder.join(SUMS), text).with_context(|| format!("could not write {SUMS}"))?;
    Ok(sizes)
}

/// The version, which manifests, changelog and citation must agree on.
fn agreed_version(root: &Path) -> Result<String> {
    let read =
        |name: &str| fs::read_to_string(root.join(name)).with_context(|| format!("could not read {name}"));
    let in_manifest = |name: &str| -> Result<String> {
        let manifest: toml::Table =
            read(name)?.parse().with_context(|| format!("{name} is not understood"))?;
        let version = manifest["workspace"]["package"]["version"].as_str();
        Ok(version.with_context(|| format!("{name} states no version"))?.to_owned())
    };
    let version = in_manifest("Cargo.toml")?;
    let boards = in_manifest("firmware/boards/Cargo.toml")?;
    if boards != version {
        bail!("Cargo.toml has version {version}, firmware/boards/Cargo.toml {boards}");
    }
    let changelog = read("CHANGELOG.md")?;
    let newest = changelog.lines().find_map(|line| line.strip_prefix("## ")).unwrap_or_default();
    let Some(date) = newest.strip_prefix(&format!("{version} - ")).filter(|date| date.len() == 10) else {
        bail!(
            "the first heading of CHANGELOG.md is `{newest}`: `## {version} - YYYY-MM-DD` is needed for a release"
        );
    };
    let citation = read("CITATION.cff")?;
    for line in [format!("version: {version}"), format!("date-released: {date}")] {
        if !citation.lines().any(|own| own == line) {
            bail!("CITATION.cff has no line `{line}`, as the manifest and CHANGELOG.md have it");
        }
    }
    Ok(version)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_glibc_is_found_among_the_symbols() {
        let program = b"\0GLIBC_2.2.5\0memcpy\0GLIBC_2.14\0GLIBC_2.9\0GLIBC_PRIVATE\0end GLIBC_2.3";
        assert_eq!(newest_glibc(program), Some((2, 14)));
        assert_eq!(newest_glibc(b"no symbols, GLIBC_"), None);
    }

    #[test]
    fn commands_are_those_of_their_section() {
        let page = include_str!("../../docs/install.md");
        assert!(commands_of(page, "Download").expect("commands").starts_with("sha256sum --check"));
        assert_eq!(commands_of(page, "cargo").expect("commands"), "cargo install --path host --locked");
        assert!(commands_of(page, "Next").is_err() && commands_of(page, "none").is_err());
    }

    #[test]
    fn a_crate_without_licence_or_checksum_is_named() {
        let component = |name: &str, licence: bool, sum: bool| {
            let mut one = serde_json::json!({ "name": name, "version": "1.0.0" });
            if licence {
                one["licenses"] = serde_json::json!([{ "expression": "MIT" }]);
            }
            if sum {
                one["hashes"] = serde_json::json!([{ "alg": "SHA-256", "content": "ab" }]);
            }
            serde_json::json!({ "components": [one] })
        };
        assert_eq!(
            listed(&component("a", true, true)).expect("complete"),
            BTreeSet::from(["a v1.0.0".into()])
        );
        assert!(listed(&component("jointrig-uff", true, false)).is_ok());
        for (document, word) in
            [(component("a", false, true), "licence"), (component("a", true, false), "checksum")]
        {
            let said = listed(&document).expect_err("incomplete").to_string();
            assert!(said.contains("a v1.0.0") && said.contains(word), "{said}");
        }
        let tree = "jointrig v0.1.0 (/x/host)\naxum v0.8.9\nserde_derive v1.0.229 (proc-macro)\njointrig-uff v0.1.0 (/x)\naxum v0.8.9 (*)\n";
        let names: Vec<String> = compiled(tree).into_iter().collect();
        assert_eq!(names, ["axum v0.8.9", "jointrig-uff v0.1.0", "serde_derive v1.0.229"]);
    }

    #[test]
    fn checksums_are_those_that_sha256sum_compares() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(write_sums(folder.path()).is_err(), "nothing to sum");
        fs::write(folder.path().join("b"), "abc").expect("written");
        fs::write(folder.path().join("a"), "").expect("written");
        let sizes = write_sums(folder.path()).expect("written");
        assert_eq!(sizes, [("a".to_owned(), 0), ("b".to_owned(), 3)]);
        // FIPS 180-4, examples: the empty message and "abc"
        let expected = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855  a\n\
                        ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad  b\n";
        assert_eq!(fs::read_to_string(folder.path().join(SUMS)).expect("read"), expected);
        assert_eq!(write_sums(folder.path()).expect("again").len(), 2, "it does not sum itself");
    }

    #[test]
    fn version_and_date_agree_in_manifests_changelog_and_citation() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        assert_eq!(agreed_version(&root).expect("they agree"), env!("CARGO_PKG_VERSION"));
        let folder = tempfile::tempdir().expect("a folder");
        fs::create_dir_all(folder.path().join("firmware/boards")).expect("made");
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("written");
        let manifest = "[workspace.package]\nversion = \"0.2.0\"\n";
        write("Cargo.toml", manifest);
        write("firmware/boards/Cargo.toml", manifest);
        write("CHANGELOG.md", "# Changelog\n\n## 0.2.0 - 2026-12-24\n");
        write("CITATION.cff", "version: 0.2.0\ndate-released: 2026-12-24\n");
        assert_eq!(agreed_version(folder.path()).expect("they agree"), "0.2.0");
        for (name, text, word) in [
            ("CITATION.cff", "version: 0.2.0\ndate-released: 2026-12-23\n", "date-released: 2026-12-24"),
            ("CHANGELOG.md", "## Unreleased\n", "## 0.2.0 - YYYY-MM-DD"),
            ("firmware/boards/Cargo.toml", "[workspace.package]\nversion = \"0.1.0\"\n", "boards"),
        ] {
            write(name, text);
            let said = agreed_version(folder.path()).expect_err(name).to_string();
            assert!(said.contains(word), "{said}");
        }
    }

    #[test]
    fn the_workflow_builds_every_target_of_a_release() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../.github/workflows/release.yml");
        let workflow = fs::read_to_string(path).expect("the workflow is there");
        for target in TARGETS {
            assert!(workflow.contains(target), "{target}");
        }
        for part in ["--firmware", "--crates", "--sums", "--tag", "attest-build-provenance", "semver-checks"]
        {
            assert!(workflow.contains(part), "{part}");
        }
    }
}
