//! `cargo xtask windows`: builds the host for Windows on this machine, and runs it in Wine.
//!
//! The library tests and those of the Python wheel ([`windows_wheel`]) run there, and a campaign on
//! the simulated rig: its records must equal this system's, bit for bit. FRFs and results may
//! differ in the last digits, because sine, exponential and logarithm come from each system's own
//! library; the largest difference is printed. A second writer, a network share, and a measuring
//! program that is killed or stopped must be treated as on Linux. What Wine cannot show is listed
//! in docs/platforms.md.
//!
//! rustup is not used: the compiler and its sources are Debian's ([`sysroot`]), the linker is
//! mingw's, Wine is the distribution's. All of it lies below `target/windows`.

use crate::packages::Consent;
use crate::project::Project;
use crate::sysroot::{self, Sysroot, WINDOWS};
use crate::wine::{COMPILER, WINE, Wine, fresh};
use crate::{command, packages, tests_run, windows_wheel};
use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// The packages of Debian: cross compiler and linker, and Wine.
const PACKAGES: [&str; 2] = ["gcc-mingw-w64-x86-64-posix", "wine64"];
/// The programs that must compile, each in the package of its name; the first one is run.
const PROGRAMS: [&str; 3] = ["jointrig", "jointrig-hil-sim", "xtask"];
/// The packages whose library tests run in Wine: those that a user of Windows has.
const TESTED: [&str; 4] = ["jointrig", "jointrig-analysis", "jointrig-protocol", "jointrig-uff"];
/// The host's own package is compiled without optimisation, which takes a third of the time; what
/// it computes does not depend on that, and the loops over samples are in other packages.
const QUICKLY: &str = "profile.release.package.jointrig.opt-level=0";
/// How long a measuring program may take to start, and to end after it was asked to.
const PATIENCE: Duration = Duration::from_mins(1);

/// Options of `cargo xtask windows`.
#[derive(Args, Debug, Default)]
pub struct Options {
    /// Do not ask before installing system packages.
    #[arg(long)]
    yes: bool,
    /// Also run the complete demo on both systems, and compare its results.json: minutes, and 2 GB
    /// of disk.
    #[arg(long)]
    demo: bool,
    /// Leave out the other parts.
    #[arg(long)]
    only: Option<Only>,
    /// Compare with this `jointrig` of the same sources, instead of building one for this system.
    #[arg(long, value_name = "FILE")]
    against: Option<PathBuf>,
}

/// A part of the work.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum Only {
    /// Build `jointrig.exe`, and print its path.
    Build,
    /// Run the tests of the libraries.
    Tests,
    /// Measure on both systems and compare.
    Campaigns,
    /// Build the Python wheel, and test it with Windows' Python.
    Wheel,
}

/// Builds, tests and compares; prints a summary.
pub fn run(project: &Project, options: &Options) -> Result<()> {
    let consent = Consent::new(options.yes);
    let begun = Instant::now();
    if command::find_program(COMPILER).is_none() || !command::is_executable(Path::new(WINE)) {
        println!("  installing {}: cross compiler, and Wine to run what it builds", PACKAGES.join(", "));
        packages::install(&PACKAGES, consent)?;
    }
    let sysroot = sysroot::ensure(project, Sysroot::Windows, consent)?;
    let folder = project.target.join("windows");
    let mut said = Vec::new();
    let mut timed =
        |what: &str, since: Instant| said.push(format!("{what} ({:.0} s)", since.elapsed().as_secs_f64()));
    timed("tools and sysroot", begun);

    let since = Instant::now();
    let wanted = |part| options.only.is_none_or(|only| only == part);
    let tested: &[&str] = if wanted(Only::Tests) { &TESTED } else { &[] };
    let cross = |command: &mut Command| cross_compiling(command, &sysroot, &folder);
    let windows = Programs::build(project, &folder, cross, tested)?;
    timed("jointrig, hil-sim, xtask and the tests built for Windows", since);
    println!("  {}", windows.jointrig.display());
    if options.only == Some(Only::Build) {
        return Ok(());
    }
    let wine = Wine::prepare(&folder)?;
    if wanted(Only::Tests) {
        let since = Instant::now();
        let counts = windows.tests(&wine)?;
        timed(&format!("tests in Wine: {counts}"), since);
    }
    if wanted(Only::Wheel) {
        let since = Instant::now();
        let wheel = windows_wheel::build(project, &folder, cross)?;
        let passed = windows_wheel::test(project, &folder, &wheel, &wine, &windows.jointrig)?;
        timed(&format!("the wheel, tested by Windows' Python in Wine: {passed}"), since);
    }
    if wanted(Only::Campaigns) {
        let since = Instant::now();
        let linux = if let Some(built) = &options.against {
            fs::canonicalize(built).with_context(|| format!("{} does not exist", built.display()))?
        } else {
            let mut cargo = command::cargo(&project.root);
            command::run(cargo.args(["build", "--release", "--workspace", "--bin", "jointrig"]))?;
            project.target.join("release/jointrig")
        };
        timed("built for this system", since);
        let work = folder.join("campaigns");
        fresh(&work)?;
        for folder in FOLDERS {
            fresh(&work.join(folder))?;
        }
        let both = Both { project, linux: &linux, windows: &windows.jointrig, wine: &wine, work: &work };
        let since = Instant::now();
        let compared = both.campaign()?;
        timed(&format!("campaign, analysis and export: {compared}"), since);
        let since = Instant::now();
        both.refusals()?;
        both.killed_and_stopped()?;
        timed("a share and a second writer are refused, a killed and a stopped run are continued", since);
        if options.demo {
            let since = Instant::now();
            let k_t = both.demo()?;
            timed(&format!("demo: {k_t}"), since);
        }
        fs::remove_dir_all(&work).with_context(|| format!("could not remove {}", work.display()))?;
    }
    println!("\n  Windows, in Wine:");
    for line in &said {
        println!("  - {line}");
    }
    Ok(())
}

/// Sets the variables with which cargo compiles for Windows.
fn cross_compiling(command: &mut Command, sysroot: &Path, folder: &Path) {
    let target = sysroot::variable_form(WINDOWS);
    command
        .env("RUSTC", sysroot::wrapper(sysroot))
        .env("CARGO_TARGET_DIR", folder)
        .env(format!("CARGO_TARGET_{target}_LINKER"), COMPILER)
        .env(format!("CC_{}", target.to_ascii_lowercase()), COMPILER)
        .env_remove("RUSTC_WRAPPER")
        .env_remove("RUSTC_WORKSPACE_WRAPPER");
}

/// What was built for Windows.
struct Programs {
    jointrig: PathBuf,
    tests: Vec<tests_run::Program>,
}

impl Programs {
    fn build(
        project: &Project,
        folder: &Path,
        cross: impl Fn(&mut Command),
        tested: &[&str],
    ) -> Result<Self> {
        let cargo = || {
            let mut cargo = command::cargo(&project.root);
            cross(&mut cargo);
            cargo
        };
        let selected = ["--release", "--target", WINDOWS, "--config", QUICKLY];
        let mut build = cargo();
        build.arg("build").args(selected);
        build.args(PROGRAMS.iter().flat_map(|name| ["--package", name, "--bin", name]));
        command::run(&mut build).context("the host does not compile for Windows")?;
        let mut tests = Vec::new();
        if !tested.is_empty() {
            let mut build = cargo();
            build
                .args(["test", "--no-run", "--lib", "--message-format=json-render-diagnostics"])
                .args(selected);
            build.args(tested.iter().flat_map(|package| ["--package", package]));
            println!("  $ {}", command::line(&build));
            tests = tests_run::programs(&command::output(&mut build)?)?;
        }
        let (wanted, found) = (tested.len(), tests.len());
        ensure!(found == wanted, "expected {wanted} test programs, found {found}");
        let jointrig = folder.join(WINDOWS).join("release/jointrig.exe");
        ensure!(jointrig.is_file(), "jointrig.exe was built, but is not at {}", jointrig.display());
        Ok(Self { jointrig, tests })
    }

    fn tests(&self, wine: &Wine) -> Result<tests_run::Counts> {
        let job = |program: &tests_run::Program| {
            let mut command = wine.command(&program.path);
            command.current_dir(&program.folder);
            command::Job { name: format!("{} in Wine", program.package), command }
        };
        let jobs = self.tests.iter().map(job).collect();
        tests_run::concluded(&command::run_all(jobs, 1, &mut std::io::stdout())?)
    }
}

/// The two builds, and where they measure.
struct Both<'a> {
    project: &'a Project,
    linux: &'a Path,
    windows: &'a Path,
    wine: &'a Wine,
    work: &'a Path,
}

/// One of the two builds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Build {
    Linux,
    Windows,
}

/// The folder of each build.
const FOLDERS: [&str; 2] = ["linux", "windows"];

impl Both<'_> {
    /// `jointrig`, in its folder.
    fn jointrig(&self, build: Build, arguments: &[&str]) -> Command {
        let mut command = match build {
            Build::Linux => command::without_own_package(self.linux),
            Build::Windows => self.wine.command(self.windows),
        };
        command.args(arguments).current_dir(self.folder(build)).stdin(Stdio::null());
        command
    }

    fn folder(&self, build: Build) -> PathBuf {
        self.work.join(FOLDERS[build as usize])
    }

    fn run(&self, build: Build, arguments: &[&str]) -> Result<String> {
        let mut command = self.jointrig(build, arguments);
        println!("  $ {} ({build:?})", command::line(&command));
        command::output(&mut command)
    }

    /// Runs a command that must be refused, and returns its message.
    fn refused(&self, arguments: &[&str]) -> Result<String> {
        let mut command = self.jointrig(Build::Windows, arguments);
        println!("  $ {} (must be refused)", command::line(&command));
        let output = command.output().context("Wine could not be started")?;
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        ensure!(!output.status.success(), "`{}` was not refused", arguments.join(" "));
        Ok(said)
    }

    /// Creates a campaign with a plan of docs/plans.
    fn make(&self, build: Build, file: &str, plan: &str) -> Result<()> {
        let text = fs::read_to_string(self.project.root.join("docs/plans").join(plan))
            .with_context(|| format!("could not read the plan {plan}"))?;
        let copy = self.folder(build).join(plan);
        fs::write(&copy, text).with_context(|| format!("could not write {}", copy.display()))?;
        self.run(build, &["campaign", "new", file, "--plan", plan]).map(drop)
    }

    /// A short campaign on both, and all that can be made of it. The file's name is not ASCII.
    fn campaign(&self) -> Result<String> {
        let file = "Prüfung Пётр 1.jrig";
        for build in [Build::Linux, Build::Windows] {
            self.make(build, file, "small.toml")?;
            self.run(build, &MEASURE.map(|word| if word == FILE { file } else { word }))?;
            self.run(build, &["campaign", "verify", file])?;
            self.run(build, &["export", file, "--all", "--format", "npz", "--out", "export"])?;
            self.run(build, &["export", file, "--without-records", "--format", "csv", "--out", "tables"])?;
        }
        self.run(Build::Windows, &["campaign", "backup", file, "copy.jrig"])?;
        self.run(Build::Windows, &["campaign", "verify", "copy.jrig"])?;
        // and the other program's file
        let foreign = self.folder(Build::Linux).join(file);
        fs::copy(&foreign, self.folder(Build::Windows).join("linux.jrig"))
            .context("could not copy the campaign")?;
        self.run(Build::Windows, &["campaign", "verify", "linux.jrig"])?;
        self.equal_exports()
    }

    /// Compares the exports of both builds.
    fn equal_exports(&self) -> Result<String> {
        let read = |build: Build| Export::read(&self.folder(build).join("export"));
        let (linux, windows) = (read(Build::Linux)?, read(Build::Windows)?);
        let mut differ = linux.differs(&windows);
        let mut found = Differences::default();
        found.in_document("results.json", &linux.results, &windows.results);
        for name in ["A", "B", "AJB"] {
            let path = format!("tables/frf/{name}.csv");
            let [linux, windows] = [Build::Linux, Build::Windows].map(|build| {
                let path = self.folder(build).join(&path);
                fs::read_to_string(&path).with_context(|| format!("could not read {}", path.display()))
            });
            found.in_tables(&path, &linux?, &windows?);
        }
        differ.append(&mut found.too_large);
        ensure!(differ.is_empty(), "Windows and Linux differ:\n  {}", differ.join("\n  "));
        Ok(format!(
            "{} records in {} files are equal bit for bit; FRFs and results: {found}",
            linux.records,
            linux.content.len()
        ))
    }

    /// A second writer, and a network share.
    fn refusals(&self) -> Result<()> {
        let share = self.wine.share(&self.folder(Build::Windows))?;
        let plan = "small.toml";
        for file in [
            format!(r"{share}\new.jrig"),
            r"\\?\UNC\server\lab\new.jrig".into(),
            "//server/lab/new.jrig".into(),
        ] {
            let said = self.refused(&["campaign", "new", &file, "--plan", plan])?;
            ensure!(said.contains("lies on a network share"), "{file} was refused with: {said}");
        }
        let there = format!(r"{share}\copy.jrig");
        let said = self.refused(&["campaign", "run", &there, "--device", "sim:"])?;
        ensure!(said.contains("lies on a network share"), "{there} was refused with: {said}");
        // reading is always possible
        self.run(Build::Windows, &["campaign", "verify", &there])?;

        let file = "busy.jrig";
        self.make(Build::Windows, file, "demo.toml")?;
        let writer = self.writer(file)?;
        let said = self.refused(&["campaign", "run", file, "--device", "sim:"])?;
        ensure!(
            said.contains("is being written by another jointrig (process "),
            "the second writer was refused with: {said}"
        );
        self.run(Build::Windows, &["campaign", "status", file])?;
        drop(writer);
        self.run(Build::Windows, &["campaign", "verify", file]).map(drop)
    }

    /// Starts measuring in Wine, and waits until records arrive.
    fn writer(&self, file: &str) -> Result<Writer> {
        let arguments = MEASURE.map(|word| if word == FILE { file } else { word });
        let mut command = self.jointrig(Build::Windows, &arguments);
        let errors = self.folder(Build::Windows).join("stderr");
        let to =
            fs::File::create(&errors).with_context(|| format!("could not create {}", errors.display()))?;
        let child = command.stdout(Stdio::null()).stderr(to).spawn().context("Wine could not be started")?;
        let mut writer = Writer { child, errors };
        let path = self.folder(Build::Windows).join(file);
        let before = fs::metadata(&path).map_or(0, |file| file.len());
        let since = Instant::now();
        // each record is in the file itself as soon as it is accepted
        while fs::metadata(&path).map_or(0, |file| file.len()) < before + (1 << 20) {
            let ended = writer.child.try_wait().context("could not wait for the measuring program")?;
            ensure!(ended.is_none(), "it ended before anything was measured: {}", writer.said());
            ensure!(since.elapsed() < PATIENCE, "nothing was measured in {PATIENCE:?}: {}", writer.said());
            std::thread::sleep(Duration::from_millis(5));
        }
        Ok(writer)
    }

    /// Kills a measuring program, interrupts the next one, and lets a third one finish: the result
    /// is that of an undisturbed run.
    fn killed_and_stopped(&self) -> Result<()> {
        let file = "stopped.jrig";
        let plan = "stopped.toml";
        let text = fs::read_to_string(self.project.root.join("docs/plans/small.toml")).context("no plan")?;
        // long enough to be interrupted twice
        let text = text.replace("wanted = 2", "wanted = 15").replace("most = 8", "most = 30");
        ensure!(text.contains("wanted = 15"), "docs/plans/small.toml no longer wants two hits of each cell");
        for build in [Build::Linux, Build::Windows] {
            let copy = self.folder(build).join(plan);
            fs::write(&copy, &text).with_context(|| format!("could not write {}", copy.display()))?;
            self.run(build, &["campaign", "new", file, "--plan", plan])?;
        }
        let measure = MEASURE.map(|word| if word == FILE { file } else { word });
        self.run(Build::Linux, &measure)?;
        // killed: its Drop ends the process at once
        drop(self.writer(file)?);
        self.run(Build::Windows, &["campaign", "verify", file])?;
        let mut writer = self.writer(file)?;
        writer.interrupt()?;
        let said = writer.said();
        ensure!(said.contains("stopping after the current shot"), "Ctrl-C was answered with: {said}");
        let lock = self.folder(Build::Windows).join(format!("{file}-lock"));
        ensure!(!lock.exists(), "the interrupted program left its lock {}", lock.display());
        let log = self.folder(Build::Windows).join(format!("{file}-wal"));
        ensure!(!log.exists(), "the interrupted program did not close its file: {} exists", log.display());
        self.run(Build::Windows, &measure)?;
        let mut tables = Vec::new();
        for build in [Build::Linux, Build::Windows] {
            self.run(build, &["campaign", "verify", file])?;
            self.run(build, &["export", file, "--without-records", "--format", "csv", "--out", "continued"])?;
            let path = self.folder(build).join("continued/records.csv");
            let table =
                fs::read_to_string(&path).with_context(|| format!("could not read {}", path.display()))?;
            tables.push(columns(&table, |name| OF_A_HIT.contains(&name)));
        }
        ensure!(
            tables[0] == tables[1],
            "a run that was killed and stopped measured other hits than an undisturbed one"
        );
        ensure!(tables[0][0].len() == OF_A_HIT.len(), "records.csv no longer has all of {OF_A_HIT:?}");
        println!(
            "  killed, stopped and continued: all {} hits are those of an undisturbed run",
            tables[0].len() - 1
        );
        Ok(())
    }

    /// The complete demo: the stiffness that both found.
    fn demo(&self) -> Result<String> {
        for build in [Build::Linux, Build::Windows] {
            self.run(build, &["demo", "--out", "demo"])?;
        }
        let [linux, windows] = [Build::Linux, Build::Windows]
            .map(|build| results(&self.folder(build).join("demo/results.json")));
        let (linux, windows) = (linux?, windows?);
        let mut found = Differences::default();
        found.in_document("results.json", &linux, &windows);
        let too_large = &found.too_large;
        ensure!(too_large.is_empty(), "the demo's results differ:\n  {}", too_large.join("\n  "));
        let [linux, windows] =
            [linux, windows].map(|results| stiffness(&results).context("results.json has no k_T"));
        Ok(format!("{found}; k_T: {} N/m on Linux, {} N/m in Wine", linux?, windows?))
    }
}

/// The arguments of a run; [`FILE`] is replaced.
const MEASURE: [&str; 7] = ["campaign", "run", FILE, "--device", "sim:", "--seed", "11"];
const FILE: &str = "FILE";

/// A measuring program. Dropping it kills it.
struct Writer {
    child: Child,
    errors: PathBuf,
}

impl Writer {
    fn said(&self) -> String {
        fs::read_to_string(&self.errors).unwrap_or_default()
    }

    /// Sends what Wine turns into Ctrl-C, and waits for the end.
    fn interrupt(&mut self) -> Result<()> {
        command::run(Command::new("kill").args(["-INT", &self.child.id().to_string()]))?;
        let since = Instant::now();
        while self.child.try_wait().context("could not wait for the measuring program")?.is_none() {
            if since.elapsed() > PATIENCE {
                bail!("it did not end in {PATIENCE:?} after Ctrl-C: {}", self.said());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        Ok(())
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        // it may have ended
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What an export contains, without what differs between two runs on one system: times, and how
/// many scans were sent before the first hit.
struct Export {
    content: BTreeMap<PathBuf, Vec<u8>>,
    table: Vec<Vec<String>>,
    results: Value,
    records: usize,
}

/// Columns of records.csv that identify a hit and its samples; the others depend on when it was
/// measured, and in which session.
const OF_A_HIT: [&str; 7] = ["configuration", "impact", "response", "attempt", "verdict", "measure", "crc32"];
/// Columns of records.csv that are times.
const TIMES: [&str; 3] = ["utc", "utc_error_s", "overruled_utc"];
/// Files with times: compared field by field, or (the page, and the list of digests) made of the
/// others.
const TIMED: [&str; 4] = ["records.csv", "results.json", "report.html", "archive.json"];
/// Fields of results.json that differ between two runs, by their path.
const OF_THE_RUN: [&str; 4] = [
    "/source/started",
    "/source/link/frames_received",
    "/source/link/scans_received",
    "/source/device/target",
];

impl Export {
    fn read(folder: &Path) -> Result<Self> {
        let mut content = BTreeMap::new();
        let mut folders = vec![folder.to_path_buf()];
        while let Some(next) = folders.pop() {
            for entry in fs::read_dir(&next).with_context(|| format!("could not list {}", next.display()))? {
                let path = entry?.path();
                let name = path.strip_prefix(folder).context("it is in the folder")?.to_path_buf();
                if path.is_dir() {
                    folders.push(path);
                } else if !name.starts_with("frf") && !TIMED.iter().any(|timed| name == Path::new(timed)) {
                    let bytes =
                        fs::read(&path).with_context(|| format!("could not read {}", path.display()))?;
                    content.insert(name, bytes);
                }
            }
        }
        let table = fs::read_to_string(folder.join("records.csv")).context("could not read records.csv")?;
        let table = columns(&table, |name| !TIMES.contains(&name));
        let records = table.len().saturating_sub(1);
        Ok(Self { content, records, table, results: results(&folder.join("results.json"))? })
    }

    /// What differs, by name.
    fn differs(&self, other: &Self) -> Vec<String> {
        let mut differ = Vec::new();
        for name in self.content.keys().chain(other.content.keys()) {
            if self.content.get(name) != other.content.get(name) {
                differ.push(name.display().to_string());
            }
        }
        if self.table != other.table {
            differ.push("records.csv".into());
        }
        differ.sort();
        differ.dedup();
        differ
    }
}

/// Some columns of a table, by their names.
fn columns(table: &str, wanted: impl Fn(&str) -> bool) -> Vec<Vec<String>> {
    let lines: Vec<Vec<&str>> = table.lines().map(cells).collect();
    let Some(header) = lines.first() else { return Vec::new() };
    let kept = |line: &Vec<&str>| -> Vec<String> {
        let named = header.iter().zip(line);
        named.filter(|(name, _)| wanted(name)).map(|(_, cell)| (*cell).to_owned()).collect()
    };
    lines.iter().map(kept).collect()
}

/// The cells of a line, with their quotation marks; a comma between these does not separate.
fn cells(line: &str) -> Vec<&str> {
    let mut quoted = false;
    line.split(|c| {
        quoted ^= c == '"';
        c == ',' && !quoted
    })
    .collect()
}

/// The results without what differs between two runs.
fn results(path: &Path) -> Result<Value> {
    let text = fs::read_to_string(path).with_context(|| format!("could not read {}", path.display()))?;
    let mut results: Value =
        serde_json::from_str(&text).with_context(|| format!("{} is no JSON", path.display()))?;
    for field in OF_THE_RUN {
        let value =
            results.pointer_mut(field).with_context(|| format!("{} has no {field}", path.display()))?;
        *value = Value::Null;
    }
    Ok(results)
}

/// Largest difference of an FRF that two systems' mathematical functions may cause, in units of the
/// largest number of its column.
const OF_AN_FRF: f64 = 1e-9;
/// The same for results, relative: solving equations amplifies it.
const OF_RESULTS: f64 = 1e-6;
/// The same for natural modes: they come from a search, and are written with few digits.
const OF_MODES: f64 = 1e-4;
/// Parts of results.json that contain modes.
const MODES: [&str; 3] = ["results.json.modes", "results.json.modal", "results.json.first_mode"];
/// Results below are compared in units of this: rounding errors of sums that are zero.
const ZERO: f64 = 1e-6;

/// The places where two systems differ.
#[derive(Default)]
struct Differences {
    compared: usize,
    different: usize,
    /// The largest relative difference, and its place.
    largest: (f64, String),
    /// Places that differ by more than the limit, or in anything but a number.
    too_large: Vec<String>,
}

impl std::fmt::Display for Differences {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (largest, place) = &self.largest;
        write!(f, "{} of {} numbers differ", self.different, self.compared)?;
        if self.different > 0 {
            write!(f, ", by {largest:.1e} at most ({place})")?;
        }
        Ok(())
    }
}

impl Differences {
    /// Two numbers, and the limit of their difference in units of the larger one, or of `scale`.
    fn number(&mut self, place: &str, [one, other]: [f64; 2], scale: f64, limit: f64) {
        self.compared += 1;
        if one == other {
            return;
        }
        self.different += 1;
        let relative = (one - other).abs() / one.abs().max(other.abs()).max(scale);
        if relative > self.largest.0 {
            self.largest = (relative, place.to_owned());
        }
        // not a number where the other system has one is also too large
        if relative.is_nan() || relative > limit {
            self.too_large.push(format!("{place}: {one} and {other}"));
        }
    }

    fn in_document(&mut self, place: &str, one: &Value, other: &Value) {
        match (one, other) {
            (Value::Object(one), Value::Object(other)) => {
                let names: std::collections::BTreeSet<&String> = one.keys().chain(other.keys()).collect();
                for name in names {
                    let [a, b] = [one, other].map(|map| map.get(name).unwrap_or(&Value::Null));
                    self.in_document(&format!("{place}.{name}"), a, b);
                }
            }
            (Value::Array(one), Value::Array(other)) if one.len() == other.len() => {
                for (index, (a, b)) in one.iter().zip(other).enumerate() {
                    self.in_document(&format!("{place}[{index}]"), a, b);
                }
            }
            _ => match (one.as_f64(), other.as_f64()) {
                (Some(a), Some(b)) => {
                    let of_modes = MODES.iter().any(|part| place.starts_with(part));
                    self.number(place, [a, b], ZERO, if of_modes { OF_MODES } else { OF_RESULTS });
                }
                _ if one != other => self.too_large.push(format!("{place}: {one:.60} and {other:.60}")),
                _ => {}
            },
        }
    }

    /// Tables of numbers with a header. A difference is relative to the column's largest number.
    fn in_tables(&mut self, place: &str, one: &str, other: &str) {
        let parsed = |table: &str| -> Vec<Vec<Option<f64>>> {
            table
                .lines()
                .skip(1)
                .map(|line| line.split(',').map(|cell| cell.parse().ok()).collect())
                .collect()
        };
        let (a, b) = (parsed(one), parsed(other));
        let shape = |table: &[Vec<Option<f64>>]| table.iter().map(Vec::len).collect::<Vec<_>>();
        if one.lines().next() != other.lines().next() || shape(&a) != shape(&b) {
            self.too_large.push(format!("{place}: other lines or columns"));
            return;
        }
        let columns = a.first().map_or(0, Vec::len);
        for column in 0..columns {
            let cells = || a.iter().zip(&b).map(|(a, b)| (a[column], b[column]));
            let scale = cells().filter_map(|(a, _)| a).fold(0.0, |largest: f64, a| largest.max(a.abs()));
            for (line, cell) in cells().enumerate() {
                let place = format!("{place}, line {}, column {}", line + 2, column + 1);
                match cell {
                    (Some(a), Some(b)) => self.number(&place, [a, b], scale, OF_AN_FRF),
                    (None, None) => {}
                    _ => self.too_large.push(format!("{place}: only one is a number")),
                }
            }
        }
    }
}

/// The contact's own stiffness.
fn stiffness(results: &Value) -> Option<String> {
    let k_t = results.pointer("/answer/contact/k_t_n_per_m/mean")?;
    Some(k_t.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// An export with one record.
    fn export(folder: &Path, utc: &str, crc: &str) -> Export {
        let write = |name: &str, text: &str| fs::write(folder.join(name), text).expect("a writable folder");
        for inner in ["frf", "records"] {
            fresh(&folder.join(inner)).expect("a writable folder");
        }
        write("records.csv", &format!("record,utc,crc32\n1,{utc},{crc}\n"));
        write("records/A.npz", "bytes");
        // compared as tables
        write("frf/A.npz", utc);
        write("report.html", utc);
        let link = json!({"frames_received": utc.len(), "scans_received": 1});
        let source = json!({"started": utc, "link": link, "device": {"target": "x"}});
        write("results.json", &json!({"source": source}).to_string());
        Export::read(folder).expect("an export")
    }

    #[test]
    fn exports_are_equal_but_for_times() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let first = export(folder.path(), "09:00", "17");
        assert_eq!(first.records, 1);
        let later = export(folder.path(), "10:00:01", "17");
        assert_eq!(first.differs(&later), [""; 0]);
        assert_eq!(first.differs(&export(folder.path(), "09:00", "18")), ["records.csv"]);
        export(folder.path(), "09:00", "17");
        fs::write(folder.path().join("records/A.npz"), "bytez").expect("a writable folder");
        fs::write(folder.path().join("records/B.npz"), "bytes").expect("a writable folder");
        let other = Export::read(folder.path()).expect("an export");
        assert_eq!(first.differs(&other), ["records/A.npz", "records/B.npz"]);
    }

    #[test]
    fn a_last_digit_is_counted_and_more_than_that_is_named() {
        let of = |one: &str, other: &str| {
            let [one, other] = [one, other].map(|text| serde_json::from_str(text).expect("JSON"));
            let mut found = Differences::default();
            found.in_document("r", &one, &other);
            found
        };
        let found = of(r#"{"a": [1.0, 0.0], "b": "x"}"#, r#"{"a": [1.0000000000000002, 1e-24], "b": "x"}"#);
        assert!(found.too_large.is_empty() && found.largest.1 == "r.a[0]", "{:?}", found.too_large);
        assert_eq!(found.to_string(), "2 of 2 numbers differ, by 2.2e-16 at most (r.a[0])");
        for (one, other, place) in [
            (r#"{"a": 1.0}"#, r#"{"a": 1.00001}"#, "r.a"),
            (r#"{"a": 1.0}"#, r#"{"b": 1.0}"#, "r.a"),
            (r#"{"a": "x"}"#, r#"{"a": "y"}"#, "r.a"),
            (r#"{"a": 1.0}"#, r#"{"a": null}"#, "r.a"),
            ("[1]", "[1, 2]", "r"),
        ] {
            let found = of(one, other).too_large;
            assert!(found.first().is_some_and(|first| first.starts_with(place)), "{one} {other}: {found:?}");
        }
    }

    #[test]
    fn tables_are_compared_in_units_of_their_columns() {
        let of = |other: &str| {
            let mut found = Differences::default();
            found.in_tables("t", "f,re\n10,1e-3\n20,1e-9\n", other);
            found
        };
        assert_eq!(of("f,re\n10,1e-3\n20,1e-9\n").to_string(), "0 of 4 numbers differ");
        let found = of("f,re\n10,1e-3\n20,1.0001e-9\n");
        assert!(found.too_large.is_empty() && found.different == 1, "{:?}", found.too_large);
        for wrong in [
            "f,re\n10,1e-3\n20,2e-9\n",
            "f,im\n10,1e-3\n20,1e-9\n",
            "f,re\n10,1e-3\n",
            "f,re\n10,1e-3\n20,\n",
        ] {
            assert_eq!(of(wrong).too_large.len(), 1, "{wrong}");
        }
    }

    #[test]
    fn columns_are_found_behind_a_quoted_comma() {
        let table = "hit,sentence,crc32\n1,\"two hits, one record\",17\n2,one,18\n";
        let found = columns(table, |name| name != "sentence");
        assert_eq!(found, [["hit", "crc32"], ["1", "17"], ["2", "18"]]);
    }

    #[test]
    fn results_without_a_field_that_is_left_out_are_refused() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("results.json");
        fs::write(&path, "{}").expect("a writable folder");
        assert!(results(&path).expect_err("nothing in it").to_string().contains("/source/started"));
    }
}
