//! `cargo xtask wheels`: the Python wheels of a release, for the Linux systems of laboratories.
//!
//! The wheel of `cargo xtask python` needs the C library of the machine that built it. These need
//! only glibc 2.17 (manylinux2014): maturin links them with Zig's linker, for x86-64 and for
//! aarch64. They are only built here; of the two, only the first could also be run.

use crate::command;
use crate::environment::environment;
use crate::project::Project;
use crate::python::{self, WHEEL};
use anyhow::{Context, Result, bail};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Target machines of a release's wheels.
const TARGETS: [&str; 2] = ["x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu"];

/// Old enough for typical computers at a rig.
const COMPATIBILITY: &str = "manylinux2014";

/// The packages that build and link them.
const TOOLS: [&str; 2] = ["maturin>=1.9,<2", "ziglang"];

/// Builds a wheel for each target into `target/release-wheels`.
pub fn run(project: &Project) -> Result<()> {
    let missing: Vec<&str> = TARGETS.into_iter().filter(|target| !installed(target)).collect();
    if !missing.is_empty() {
        let missing = missing.join(" ");
        bail!(
            "the compiler has no standard library for {missing}: `rustup target add {missing}`, then again"
        );
    }
    let found = python::interpreters();
    let Some((_, interpreter)) = found.last_key_value() else {
        bail!(
            "maturin needs a Python of {}.{} or newer, and there is none",
            python::OLDEST.0,
            python::OLDEST.1
        )
    };
    let tools = environment(interpreter, &project.target.join("python/wheels-tools"), &TOOLS)
        .context("no environment with maturin and ziglang can be made; pip needs its registry")?;
    let out = project.target.join("release-wheels");
    for target in TARGETS {
        println!("wheel for {target}, {COMPATIBILITY}");
        build(project, &tools, interpreter, target, &out)?;
    }
    let mut built: Vec<_> = fs::read_dir(&out)?.flatten().map(|entry| entry.path()).collect();
    built.sort();
    for wheel in built {
        let bytes = fs::metadata(&wheel)?.len();
        println!("{} ({:.1} MB)", wheel.display(), bytes as f64 / 1e6);
        if bytes > WHEEL {
            bail!("it has {bytes} bytes, and {WHEEL} are allowed");
        }
    }
    Ok(())
}

/// Whether the compiler can build for that target.
fn installed(target: &str) -> bool {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let asked = Command::new(rustc).args(["--print", "target-libdir", "--target", target]).output();
    asked.is_ok_and(|said| {
        said.status.success() && Path::new(String::from_utf8_lossy(&said.stdout).trim()).is_dir()
    })
}

fn build(project: &Project, tools: &Path, interpreter: &Path, target: &str, out: &Path) -> Result<()> {
    let mut maturin = Command::new(tools.with_file_name("maturin"));
    maturin.current_dir(project.root.join("host/python"));
    maturin.args(["build", "--release", "--locked", "--zig", "--compatibility", COMPATIBILITY]);
    maturin
        .args(crate::python::FOR_SIZE)
        .args(["--target", target, "--out"])
        .arg(out)
        .arg("--interpreter")
        .arg(interpreter);
    // maturin looks for Zig in the first Python on PATH
    let own = tools.parent().context("an environment has a folder of programs")?;
    let before = std::env::var_os("PATH").unwrap_or_default();
    let path = std::iter::once(own.to_path_buf()).chain(std::env::split_paths(&before));
    maturin.env("PATH", std::env::join_paths(path)?).env("CARGO_TARGET_DIR", &project.target);
    command::run(&mut maturin).with_context(|| format!("the wheel for {target} cannot be built"))
}
