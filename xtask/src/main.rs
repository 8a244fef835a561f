//! `cargo xtask`: all tasks for contributors in one command.
//!
//! Each task has one line here, and its code in the file of its subject: [`setup`] prepares the
//! machine, [`suite`] is the whole test run, [`firmware`] builds for the microcontroller. The exit
//! code is 0 for success, 1 when a step failed (the message states what, where and what to do), 2
//! for an invalid command line.

mod accuracy;
mod bench;
mod book;
mod budgets;
mod command;
mod emulator;
mod firmware;
mod layout;
mod lint;
mod packages;
mod project;
mod python;
mod release;
mod sbom;
mod setup;
mod size;
mod suite;
mod sysroot;
mod tests_run;
mod windows;
mod windows_wheel;
mod wine;

use clap::{Parser, Subcommand};
use project::Project;
use std::process::ExitCode;

/// All tasks for contributors.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Make the microcontroller target and QEMU available; quick when they already are.
    #[command(after_help = setup::ENVIRONMENT_HELP)]
    Setup {
        /// Do not ask before installing system packages.
        #[arg(long)]
        yes: bool,
    },
    /// Build the board images, keep their log strings, and print how much flash and RAM each takes.
    #[command(after_help = setup::ENVIRONMENT_HELP)]
    Firmware {
        /// Only this board (its package name); all boards when absent.
        #[arg(long, value_name = "NAME")]
        board: Option<String>,
    },
    /// Check the formatting of both workspaces.
    FmtCheck,
    /// Run clippy on both workspaces with warnings as errors, and compare their locks.
    Lint,
    /// Check the structural rules: crate graph, circular imports of files, equations, licences,
    /// links.
    #[command(alias = "house")]
    Layout,
    /// Run all checks that must pass before a change is merged.
    #[command(after_help = setup::ENVIRONMENT_HELP)]
    Test(suite::Options),
    /// Build the host for Windows with the distribution's compilers, and run its library tests and
    /// campaigns in Wine, compared with this system's (Debian).
    Windows(windows::Options),
    /// Run the emulated board in QEMU.
    Qemu(emulator::Options),
    /// Count the firmware's instructions and memory in the emulator, write the table, and enforce
    /// its limits.
    Budgets,
    /// Write the rig controller's image to the connected board.
    Flash {
        /// Write the image and return, without staying attached to show its log.
        #[arg(long)]
        detach: bool,
    },
    /// Build the Python wheel, install it into an empty environment, and test it there.
    Python,
    /// Build the Python wheels of a release: manylinux2014, x86-64 and aarch64.
    Wheels,
    /// Check the documents, and build them as a book with the documentation of the code beside it.
    Book {
        /// Do not ask before installing mdbook.
        #[arg(long)]
        yes: bool,
    },
    /// Write the components of each program: every third-party crate with version, licence and
    /// checksum (CycloneDX).
    Sbom,
    /// Make and check the files of a release: programs, wheels, firmware, components, checksums.
    #[command(after_help = setup::ENVIRONMENT_HELP)]
    Release(release::Options),
    /// Compare the numbers of spectra, universal files and virtual points with those of pyFRF,
    /// pyuff and pyFBS.
    Parity,
    /// Run the campaigns with known truth (under two hours), and write the tables of
    /// docs/accuracy.md.
    Accuracy {
        /// Compute only these tables: contact, slip, levels, between-arms,
        /// between-arms-campaigns, recommended, methods, fit.
        tables: Vec<String>,
    },
    /// Measure run times, compare them with peers and the machine's limit, and write
    /// docs/performance.md.
    Bench {
        /// Measure only these parts, and do not write the page: spectra, substructuring, loops,
        /// universal, frames, simulator, campaign, growth.
        parts: Vec<String>,
        /// Run the benchmarks of the hot paths instead; the arguments after `--` are passed to
        /// `cargo bench`.
        #[arg(long, conflicts_with = "parts")]
        hot_paths: bool,
        /// For example a part of a benchmark's name.
        #[arg(last = true, requires = "hot_paths")]
        extra: Vec<String>,
    },
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(arguments.task) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(task: Task) -> anyhow::Result<()> {
    let project = Project::locate()?;
    match task {
        Task::Setup { yes } => setup::everything(&project, packages::Consent::new(yes)).map(drop),
        Task::Firmware { board } => firmware::command(&project, board.as_deref()),
        Task::FmtCheck => lint::formatting(&project),
        Task::Lint => lint::all(&project),
        Task::Layout => layout::check(&project),
        Task::Test(options) => suite::run(&project, &options),
        Task::Windows(options) => windows::run(&project, &options),
        Task::Qemu(options) => emulator::run(&project, &options),
        Task::Budgets => budgets::command(&project),
        Task::Flash { detach } => firmware::flash(&project, detach),
        Task::Python => python::run(&project, python::Jointrig::Build).map(|remark| println!("{remark}")),
        Task::Wheels => python::run_release(&project),
        Task::Book { yes } => book::run(&project, packages::Consent::new(yes)),
        Task::Sbom => sbom::run(&project),
        Task::Release(options) => release::run(&project, &options),
        Task::Parity => bench::parity(&project),
        Task::Accuracy { tables } => accuracy::run(&project, &tables),
        Task::Bench { hot_paths: true, extra, .. } => bench::hot_paths(&project, &extra),
        Task::Bench { parts, .. } => bench::run(&project, &parts),
    }
}
