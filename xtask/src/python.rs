//! Python: `cargo xtask python` builds the wheel, installs it into empty environments and tests it
//! there, not in the source tree; `cargo xtask wheels` builds the wheels of a release.
//!
//! Python and its packages are only for these checks, in folders under `target/`; jointrig itself
//! does not need them.
//!
//! The wheels of a release are for the Linux systems of laboratories. The wheel of `cargo xtask
//! python` needs the C library of the machine that built it. The released ones need only glibc 2.17
//! (manylinux2014): maturin links them with Zig's linker, for x86-64 and for aarch64. Wheels for
//! Windows and macOS are built on those systems, by `cargo xtask release --target`.

use crate::command;
use crate::project::Project;
use anyhow::{Context, Result, bail};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Oldest Python version that the wheel supports.
pub const OLDEST: (u32, u32) = (3, 10);

/// Newest minor version that is searched for by name.
const NEWEST: u32 = 20;

/// Maximum size of the wheel, bytes.
pub const WHEEL: u64 = 5_500_000;

/// The package that builds the wheel, and those that test it where nothing else is installed.
pub const TOOLS: [&str; 1] = ["maturin>=1.16,<2"];

/// Options of maturin that compile the host's own code for size: the wheel has a size limit, and
/// the loops over samples and lines are in other packages (jointrig-analysis, pco, rustfft).
///
/// One unit of code generation shares what several would each contain, and takes less time in all.
pub const FOR_SIZE: [&str; 8] = [
    "--compression-level",
    "9",
    "--config",
    "profile.release.package.jointrig.opt-level=\"s\"",
    "--config",
    "profile.release.package.jointrig.codegen-units=1",
    "--config",
    "profile.release.package.jointrig-uff.opt-level=\"s\"",
];
const ALONE: [&str; 3] = ["numpy", "pytest", "pytest-xdist"];

/// Packages that are used together with the wheel: those of notebooks, engines that read the
/// columns, and a scheduler.
const OTHERS: [&str; 16] = [
    "pytest",
    "pytest-xdist",
    "mypy",
    "matplotlib",
    "duckdb",
    "polars",
    "dask[distributed]",
    "nbclient",
    "ipykernel",
    // read the formats of docs/recipes.md
    "npTDMS",
    "h5py",
    "lvm_read",
    "soundfile",
    // recorders for jointrig.bridge, in the versions that it was written for
    "LDAQ==1.3.2",
    "opendaq==3.40.3",
    // needs PortAudio (on Debian: libportaudio2), without which its test is skipped
    "sounddevice==0.5.6",
];

/// The command that the wheel is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Jointrig {
    /// It is built first.
    Build,
    /// It was built with the tests. Building it again without them would compile the host a second
    /// time, because the tests enable other features.
    Built,
}

/// Builds and tests the wheel; returns a remark, or why it was skipped.
pub fn run(project: &Project, jointrig: Jointrig) -> Result<String> {
    let found = interpreters();
    let (Some((oldest, first)), Some((newest, last))) = (found.first_key_value(), found.last_key_value())
    else {
        return Ok(left_out(&format!("there is no Python {}.{} or newer", OLDEST.0, OLDEST.1)));
    };
    let folder = project.target.join("python");
    let Ok(tools) = environment(last, &folder.join("tools"), &TOOLS) else {
        return Ok(left_out(
            "no environment with maturin can be made (on Debian: python3-venv; pip needs its registry)",
        ));
    };
    if jointrig == Jointrig::Build {
        let mut cargo = command::cargo(&project.root);
        cargo.args(["build", "--release", "--bin", "jointrig"]);
        command::run(&mut cargo).context("the command that the wheel is compared with does not compile")?;
    }
    let wheel = build(project, &folder, &tools, last)?;
    let bytes = fs::metadata(&wheel)?.len();
    if bytes > WHEEL {
        bail!("the wheel has {bytes} bytes, and {WHEEL} are allowed");
    }
    let tests = Tests { project, folder: &folder, wheel: &wheel };
    let mut versions = vec![format!("{}.{}", oldest.0, oldest.1)];
    tests.alone(first)?;
    if oldest == newest {
        println!("LEFT OUT: the wheel is tested with Python {} alone: no other is here", versions[0]);
        tests.with_others(last, &["with_others"])?;
    } else {
        versions.push(format!("{}.{}", newest.0, newest.1));
        tests.with_others(last, &[])?;
    }
    Ok(format!("a wheel of {:.1} MB, tested with Python {}", bytes as f64 / 1e6, versions.join(" and ")))
}

fn left_out(why: &str) -> String {
    println!("LEFT OUT: the Python wheel was neither built nor tested: {why}");
    format!("LEFT OUT: {why}")
}

/// The interpreter of each supported Python version, from PATH and from pyenv's folder.
pub fn interpreters() -> BTreeMap<(u32, u32), PathBuf> {
    let named = (OLDEST.1..NEWEST).map(|minor| format!("python3.{minor}"));
    let mut candidates: Vec<PathBuf> = ["python3".to_owned(), "python".to_owned()]
        .into_iter()
        .chain(named)
        .filter_map(|name| command::find_program(&name))
        .collect();
    let root = std::env::var_os("PYENV_ROOT")
        .map(PathBuf::from)
        .or_else(|| std::env::home_dir().map(|home| home.join(".pyenv")));
    let kept = root.and_then(|root| fs::read_dir(root.join("versions")).ok());
    candidates.extend(kept.into_iter().flatten().flatten().map(|entry| entry.path().join("bin/python3")));
    let mut found = BTreeMap::new();
    for path in candidates {
        if let Some(version) = version(&path).filter(|version| *version >= OLDEST) {
            found.entry(version).or_insert(path);
        }
    }
    found
}

fn version(python: &Path) -> Option<(u32, u32)> {
    let asked = Command::new(python)
        .args(["-c", "import sys; print(sys.version_info[0], sys.version_info[1])"])
        .output();
    let text = String::from_utf8(asked.ok()?.stdout).ok()?;
    let (major, minor) = text.trim().split_once(' ')?;
    Some((major.parse().ok()?, minor.parse().ok()?))
}

/// The wheel, one for all versions of Python.
fn build(project: &Project, folder: &Path, tools: &Path, interpreter: &Path) -> Result<PathBuf> {
    let wheels = folder.join("wheels");
    if wheels.is_dir() {
        fs::remove_dir_all(&wheels).context("old wheels cannot be removed")?;
    }
    let mut maturin = Command::new(tools.with_file_name("maturin"));
    maturin.current_dir(project.root.join("host/python"));
    maturin.args(["build", "--release", "--locked", "--quiet"]).args(FOR_SIZE).arg("--out").arg(&wheels);
    maturin.arg("--interpreter").arg(interpreter).env("CARGO_TARGET_DIR", &project.target);
    command::run(&mut maturin).context("the wheel cannot be built")?;
    wheel_in(&wheels)
}

/// The wheel that maturin has put into an empty folder.
pub fn wheel_in(folder: &Path) -> Result<PathBuf> {
    let built = fs::read_dir(folder)?.flatten().map(|entry| entry.path()).next();
    built.with_context(|| format!("maturin left no wheel in {}", folder.display()))
}

/// Tests of a wheel.
struct Tests<'a> {
    project: &'a Project,
    folder: &'a Path,
    wheel: &'a Path,
}

impl Tests<'_> {
    /// With numpy alone, in a new environment: the test must not depend on remains of an older
    /// wheel or another package.
    fn alone(&self, system: &Path) -> Result<()> {
        let fresh = self.folder.join("alone");
        if fresh.is_dir() {
            fs::remove_dir_all(&fresh).context("the old environment cannot be removed")?;
        }
        let python = environment(system, &fresh, &ALONE)?;
        self.install(&python)?;
        self.pytest(&python, &["--ignore=with_others"])
    }

    /// With the packages that users combine it with, and the stubs. `which` selects tests as
    /// arguments of pytest; none are all. This environment is kept: it takes half a gigabyte.
    fn with_others(&self, system: &Path, which: &[&str]) -> Result<()> {
        let python = environment(system, &self.folder.join("others"), &OTHERS)?;
        with_peers(&python)?;
        pip(&python, &["uninstall", "--quiet", "--yes"], &["jointrig"])?;
        self.install(&python)?;
        self.pytest(&python, which)?;
        let cache = self.folder.join("mypy");
        let mut mypy = Command::new(&python);
        mypy.args(["-m", "mypy", "--strict", "--cache-dir"]).arg(&cache).current_dir(self.tests());
        command::run(mypy.args(["test_lab.py", "test_signals.py", "test_identify.py"]))
            .context("the stubs do not fit the tests")?;
        let mut stubs = Command::new(&python);
        stubs.args(["-m", "mypy.stubtest", "jointrig._native"]).current_dir(self.folder);
        command::run(&mut stubs).context("the stubs are not those of the module")
    }

    fn tests(&self) -> PathBuf {
        self.project.root.join("host/python/tests")
    }

    fn install(&self, python: &Path) -> Result<()> {
        pip(python, &["install", "--quiet", "--no-deps"], &[self.wheel])
    }

    fn pytest(&self, python: &Path, which: &[&str]) -> Result<()> {
        let mut pytest = Command::new(python);
        pytest.args(["-m", "pytest", "-q", "-p", "no:cacheprovider", "--durations=5"]).args(which);
        // one file at a time on each core, because the tests of one file share the campaigns that
        // they measure
        pytest.args(["-n", "auto", "--dist", "loadfile"]);
        pytest.current_dir(self.tests()).env("PYTHONDONTWRITEBYTECODE", "1");
        let command = format!("jointrig{}", std::env::consts::EXE_SUFFIX);
        pytest.env("JOINTRIG_BIN", self.project.target.join("release").join(command));
        command::run(&mut pytest).context("the wheel failed its tests")
    }
}

/// The packages with which jointrig is compared, in the versions of the last successful comparison,
/// and their dependencies.
const PEERS: [&str; 7] = ["numpy", "pyFRF==1.5.0", "pyuff==2.5.8", "scipy", "pandas", "openpyxl", "tqdm"];

/// Installed without its dependencies: virtual points and SEMM need only the packages named above,
/// while the rest (3D views with pyvista and Qt, Ansys readers) takes a gigabyte and often cannot
/// be installed.
const WITHOUT_DEPENDENCIES: [&str; 1] = ["pyFBS==1.0.7"];

/// Installs the peers.
pub fn with_peers(python: &Path) -> Result<()> {
    pip(python, &["install", "--quiet"], &PEERS)?;
    pip(python, &["install", "--quiet", "--no-deps"], &WITHOUT_DEPENDENCIES)
}

/// The interpreter of an environment with these packages; creates the environment if necessary.
pub fn environment(system: &Path, folder: &Path, packages: &[&str]) -> Result<PathBuf> {
    let interpreter = folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
    if !interpreter.is_file() {
        command::run(Command::new(system).args(["-m", "venv"]).arg(folder))
            .context("the environment cannot be made: on Debian, install python3-venv")?;
    }
    if !packages.is_empty() {
        pip(&interpreter, &["install", "--quiet"], packages)?;
    }
    Ok(interpreter)
}

/// Runs pip.
pub fn pip<T: AsRef<std::ffi::OsStr>>(python: &Path, how: &[&str], packages: &[T]) -> Result<()> {
    command::run(
        Command::new(python).args(["-m", "pip", "--disable-pip-version-check"]).args(how).args(packages),
    )
    .context("the packages cannot be installed")
}

/// Linux machines for which a release has wheels.
const TARGETS: [&str; 2] = ["x86_64-unknown-linux-gnu", "aarch64-unknown-linux-gnu"];

/// Old enough for typical computers at a rig.
const COMPATIBILITY: &str = "manylinux2014";

/// The packages that build and link them.
const RELEASE_TOOLS: [&str; 2] = ["maturin>=1.16,<2", "ziglang"];

/// Builds a wheel for each Linux target into `target/release-wheels`.
pub fn run_release(project: &Project) -> Result<()> {
    let missing: Vec<&str> = TARGETS.into_iter().filter(|target| !installed(target)).collect();
    if !missing.is_empty() {
        let missing = missing.join(" ");
        bail!(
            "the compiler has no standard library for {missing}: `rustup target add {missing}`, then again"
        );
    }
    for target in TARGETS {
        build_release(project, target)?;
    }
    Ok(())
}

/// Whether the compiler can build for that target.
pub fn installed(target: &str) -> bool {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let asked = Command::new(rustc).args(["--print", "target-libdir", "--target", target]).output();
    asked.is_ok_and(|said| {
        said.status.success() && Path::new(String::from_utf8_lossy(&said.stdout).trim()).is_dir()
    })
}

/// The newest Python here.
pub fn newest() -> Result<PathBuf> {
    let found = interpreters().pop_last();
    let (_, interpreter) = found.with_context(|| {
        format!("a Python of {}.{} or newer is needed, and there is none", OLDEST.0, OLDEST.1)
    })?;
    Ok(interpreter)
}

/// PATH with the programs of an environment first: Zig is looked for in the first Python on PATH.
pub fn before_path(environment: &Path) -> Result<std::ffi::OsString> {
    let own = environment.parent().context("an environment has a folder of programs")?;
    let before = std::env::var_os("PATH").unwrap_or_default();
    Ok(std::env::join_paths(std::iter::once(own.to_path_buf()).chain(std::env::split_paths(&before)))?)
}

/// Builds the wheel of a release for one target, in a folder of `target/release-wheels`; returns
/// its path.
pub fn build_release(project: &Project, target: &str) -> Result<PathBuf> {
    let interpreter = newest()?;
    let tools = environment(&interpreter, &project.target.join("python/wheels-tools"), &RELEASE_TOOLS)
        .context("no environment with maturin and ziglang can be made; pip needs its registry")?;
    let out = project.target.join("release-wheels").join(target);
    if out.is_dir() {
        fs::remove_dir_all(&out).context("old wheels cannot be removed")?;
    }
    let mut maturin = command::without_own_package(
        tools.with_file_name(format!("maturin{}", std::env::consts::EXE_SUFFIX)),
    );
    maturin.current_dir(project.root.join("host/python"));
    maturin.args(["build", "--release", "--locked"]);
    if target.contains("linux") {
        maturin.args(["--zig", "--compatibility", COMPATIBILITY]);
    }
    maturin
        .args(FOR_SIZE)
        .args(["--target", target, "--out"])
        .arg(&out)
        .arg("--interpreter")
        .arg(interpreter);
    // the wheel must not depend on a contributor's settings
    maturin.env("PATH", before_path(&tools)?).env("CARGO_INCREMENTAL", "0");
    maturin.env("CARGO_TARGET_DIR", &project.target);
    command::run(&mut maturin).with_context(|| format!("the wheel for {target} cannot be built"))?;
    let wheel = wheel_in(&out)?;
    let bytes = fs::metadata(&wheel)?.len();
    println!("{} ({:.1} MB)", wheel.display(), bytes as f64 / 1e6);
    if bytes > WHEEL {
        bail!("it has {bytes} bytes, and {WHEEL} are allowed");
    }
    Ok(wheel)
}

/// An environment without any package, as a user has it first.
pub fn empty_environment(project: &Project) -> Result<PathBuf> {
    let folder = project.target.join("python/release-user");
    if folder.is_dir() {
        fs::remove_dir_all(&folder).context("the old environment cannot be removed")?;
    }
    environment(&newest()?, &folder, &[])
}

/// Imports the package that was installed in an environment.
pub fn try_out(python: &Path, version: &str) -> Result<()> {
    let script =
        "import jointrig, importlib.metadata as m; print(jointrig.read_frf.__name__, m.version('jointrig'))";
    let folder = python.parent().context("an interpreter is in a folder")?;
    let said = command::output(Command::new(python).args(["-c", script]).current_dir(folder))?;
    if said.trim() != format!("read_frf {version}") {
        bail!("the wheel is of another version: `{}` instead of {version}", said.trim());
    }
    Ok(())
}
