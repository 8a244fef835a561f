//! `cargo xtask python`: the wheel is built, installed into an empty environment, and tested from there, not from the tree.
//!
//! Python and its packages are this check's alone, in folders under `target/`; no part of jointrig needs them.

use crate::command;
use crate::project::Project;
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Oldest Python that the wheel is made for.
const OLDEST: (u32, u32) = (3, 10);

/// What builds the wheel, and what tests it.
const TOOLS: [&str; 1] = ["maturin>=1.9,<2"];
const TESTS: [&str; 3] = ["numpy", "pytest", "mypy"];

/// Builds and tests the wheel; a remark on it, or why it was left out.
pub fn run(project: &Project) -> Result<String> {
    let Some(system) = ["python3", "python"].into_iter().find_map(command::find_program) else {
        return Ok(left_out("there is no Python"));
    };
    let Some((major, minor)) = version(&system) else {
        return Ok(left_out("python3 does not tell its version"));
    };
    if (major, minor) < OLDEST {
        return Ok(left_out(&format!("Python {major}.{minor} is older than {}.{}", OLDEST.0, OLDEST.1)));
    }
    let folder = project.target.join("python");
    let Ok(tools) = environment(&system, &folder.join("tools"), &TOOLS) else {
        return Ok(left_out(
            "no environment with maturin can be made (on Debian: python3-venv; pip needs its registry)",
        ));
    };
    let wheels = folder.join("wheels");
    if wheels.is_dir() {
        std::fs::remove_dir_all(&wheels).context("old wheels cannot be removed")?;
    }
    let mut maturin = Command::new(tools.with_file_name("maturin"));
    maturin.current_dir(project.root.join("host/python"));
    maturin.args(["build", "--release", "--locked", "--quiet", "--out"]).arg(&wheels);
    maturin.arg("--interpreter").arg(&system).env("CARGO_TARGET_DIR", &project.target);
    command::run(&mut maturin).context("the wheel cannot be built")?;
    let wheel = std::fs::read_dir(&wheels)?
        .flatten()
        .map(|entry| entry.path())
        .next()
        .context("there is no wheel")?;
    let bytes = std::fs::metadata(&wheel)?.len();
    if bytes > 5_000_000 {
        bail!("the wheel has {bytes} bytes, and 5 MB are allowed");
    }
    // a fresh one each time: what an older wheel left behind must not help
    let fresh = folder.join("fresh");
    if fresh.is_dir() {
        std::fs::remove_dir_all(&fresh).context("the old environment cannot be removed")?;
    }
    let python = environment(&system, &fresh, &TESTS)?;
    command::run(Command::new(&python).args(["-m", "pip", "install", "--quiet", "--no-deps"]).arg(&wheel))?;
    let tests = project.root.join("host/python/tests");
    let mut pytest = Command::new(&python);
    pytest.args(["-m", "pytest", "-q", "-p", "no:cacheprovider"]).arg(&tests).current_dir(&folder);
    pytest.env(
        "JOINTRIG_BIN",
        project.target.join("release").join(format!("jointrig{}", std::env::consts::EXE_SUFFIX)),
    );
    pytest.env("PYTHONDONTWRITEBYTECODE", "1");
    command::run(&mut pytest).context("the wheel failed its tests")?;
    let mut mypy = Command::new(&python);
    mypy.args(["-m", "mypy", "--strict", "--cache-dir"]).arg(folder.join("mypy")).current_dir(&tests);
    command::run(mypy.args(["test_lab.py", "test_signals.py"])).context("the stubs do not fit the tests")?;
    Ok(format!("a wheel of {:.1} MB, tested with Python {major}.{minor}", bytes as f64 / 1e6))
}

fn left_out(why: &str) -> String {
    println!("LEFT OUT: the Python wheel was neither built nor tested: {why}");
    format!("LEFT OUT: {why}")
}

fn version(python: &Path) -> Option<(u32, u32)> {
    let asked = Command::new(python)
        .args(["-c", "import sys; print(sys.version_info[0], sys.version_info[1])"])
        .output();
    let text = String::from_utf8(asked.ok()?.stdout).ok()?;
    let (major, minor) = text.trim().split_once(' ')?;
    Some((major.parse().ok()?, minor.parse().ok()?))
}

/// The interpreter of an environment that has these packages; made where it is not there.
fn environment(system: &Path, folder: &Path, packages: &[&str]) -> Result<PathBuf> {
    let interpreter = folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    if !interpreter.is_file() {
        command::run(Command::new(system).args(["-m", "venv"]).arg(folder))
            .context("the environment cannot be made: on Debian, install python3-venv")?;
    }
    command::run(Command::new(&interpreter).args(["-m", "pip", "install", "--quiet"]).args(packages))
        .context("the packages cannot be installed")?;
    Ok(interpreter)
}
