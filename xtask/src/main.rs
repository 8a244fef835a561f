//! `cargo xtask`: everything a contributor runs, behind one command.
//!
//! Each command is a thin line here and a file of its own: [`setup`] prepares the machine, [`suite`] is the whole
//! test run, [`firmware`] builds for the microcontroller. The exit code is 0 when all went well, 1 when a step failed
//! (the message says what, where and what to do), 2 for a command line that makes no sense.

mod accuracy;
mod bench;
mod budgets;
mod chromium;
mod command;
mod consent;
mod emulator;
mod environment;
mod firmware;
mod flash;
mod flat;
mod house;
mod jobs;
mod lint;
mod locks;
mod packages;
mod parity;
mod project;
mod python;
mod qemu;
mod sbom;
mod setup;
mod size;
mod suite;
mod sysroot;
mod test_programs;
mod tests_run;
mod toolchain;
mod wheels;

use clap::{Parser, Subcommand};
use project::Project;
use std::process::ExitCode;

/// Everything a contributor runs.
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
    /// Check the laws of the house: crate graph, circles of files, equations, licences.
    House,
    /// Run all that must pass before a change is merged.
    #[command(after_help = setup::ENVIRONMENT_HELP)]
    Test(suite::Options),
    /// Run the emulated board in QEMU.
    Qemu(emulator::Options),
    /// Count what the firmware costs in the emulator, write the table of it, and enforce its limits.
    Budgets,
    /// Write the rig controller's image to the board on the desk.
    Flash {
        /// Write the image and return, without staying attached to show its log.
        #[arg(long)]
        detach: bool,
    },
    /// Build the Python wheel, install it into an empty environment, and test it there.
    Python,
    /// Build the Python wheels of a release: manylinux2014, x86-64 and aarch64.
    Wheels,
    /// Write what each program is made of: every crate of others with version, licence and checksum (CycloneDX).
    Sbom,
    /// Compare the numbers of spectra, universal files and virtual points with those of pyFRF, pyuff and pyFBS.
    Parity,
    /// Run the campaigns whose truth is known (under two hours), and write the tables of docs/accuracy.md.
    Accuracy {
        /// Make these tables alone: contact, marks, slip, levels, between-arms, between-arms-campaigns, recommended, methods, fit.
        tables: Vec<String>,
    },
    /// Measure how fast everything is beside its peers and the machine's limit, and write docs/performance.md.
    Bench {
        /// Measure these parts alone, and write no page: spectra, substructuring, loops, universal, frames, simulator, campaign, growth.
        parts: Vec<String>,
        /// Run the benchmarks beside the hot paths instead; what follows is passed to `cargo bench`.
        #[arg(long, conflicts_with = "parts")]
        hot_paths: bool,
        /// A part of a benchmark's name, for example.
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
        Task::Setup { yes } => setup::everything(&project, consent::Consent::new(yes)).map(drop),
        Task::Firmware { board } => firmware::command(&project, board.as_deref()),
        Task::FmtCheck => lint::formatting(&project),
        Task::Lint => lint::all(&project),
        Task::House => house::check(&project),
        Task::Test(options) => suite::run(&project, &options),
        Task::Qemu(options) => emulator::run(&project, &options),
        Task::Budgets => budgets::command(&project),
        Task::Flash { detach } => flash::run(&project, detach),
        Task::Python => python::run(&project).map(|remark| println!("{remark}")),
        Task::Wheels => wheels::run(&project),
        Task::Sbom => sbom::run(&project),
        Task::Parity => parity::run(&project),
        Task::Accuracy { tables } => accuracy::run(&project, &tables),
        Task::Bench { hot_paths: true, extra, .. } => bench::hot_paths(&project, &extra),
        Task::Bench { parts, .. } => bench::run(&project, &parts),
    }
}
