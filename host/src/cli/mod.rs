//! The command line: one file per subcommand, whose documentation is its contract.
//!
//! `--json` prints exactly one document to stdout and nothing else; progress, prompts and messages
//! go to stderr. An error is one to a few lines: what failed, where, what to do.
//!
//! Two small subcommands are part of this file: `completions` prints a shell's completion script,
//! and `man` prints the manual page, or writes one for each command. It also tunes the system's
//! allocator for short-lived signals and matrices.

use crate::untrusted_text::{tell_line, visible};
use clap::{ArgAction, Args, CommandFactory, Parser, Subcommand};
use clap_complete::Shell;
use error::CliError;
#[cfg(feature = "dashboard")]
use serve::AnalyseForPage;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

mod analyse;
mod campaign;
mod demo;
mod error;
mod export;
mod frf;
mod frf_matrix;
mod hit_agreement;
mod hysteresis;
mod identify;
mod import;
mod info;
mod laws;
mod modes;
#[cfg(feature = "dashboard")]
mod open_page;
mod output;
mod page;
mod plan;
mod self_test;
#[cfg(feature = "dashboard")]
mod serve;
mod shaker;
mod trend;
mod wear;

/// Stiffness of a friction joint, measured: impact campaigns, FRFs, substructuring, hysteresis.
#[derive(Debug, Parser)]
#[command(name = "jointrig", version, about, propagate_version = true)]
pub struct Cli {
    /// Print more messages (-v: info, -vv: debug, -vvv: trace); JOINTRIG_LOG gives finer control.
    #[arg(short, long, global = true, action = ArgAction::Count)]
    verbose: u8,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// The complete workflow on the built-in simulator: campaign, analysis, report.
    Demo(demo::Demo),
    /// List connected devices.
    Devices(info::Devices),
    /// Show a device: handshake, channels, firmware version, counters.
    Info(info::Info),
    /// Impact campaigns.
    Campaign(campaign::Campaign),
    /// Plans: write a template, and check a plan.
    Plan(plan::Plan),
    /// Measure levels of the shaker into a campaign file.
    Shaker(shaker::Shaker),
    /// Wear a contact with the shaker, and measure every cycle into a campaign file.
    Wear(wear::Wear),
    /// Analyse a campaign file: results.json and report.html.
    Analyse(analyse::Analyse),
    /// Write the report of a campaign file, and its figures as files.
    Report(analyse::Report),
    /// Show a campaign in the browser.
    #[cfg(feature = "dashboard")]
    Serve(serve::Serve),
    /// Analyse a campaign for the live page of another process.
    #[cfg(feature = "dashboard")]
    #[command(name = crate::live::numbers::COMMAND, hide = true)]
    AnalyseForPage(AnalyseForPage),
    /// Compare two campaigns.
    Compare(analyse::Compare),
    /// Write everything that a campaign file contains in formats for other programs.
    Export(export::Export),
    /// Compute FRFs from any impact records.
    Frf(frf::FrfArgs),
    /// Compute the hysteresis loops of any time record.
    Hysteresis(hysteresis::Loops),
    /// Fit friction laws to hysteresis loops.
    Laws(laws::Laws),
    /// Import FRFs or impact records measured with other systems.
    Import(import::Import),
    /// Identify a joint from any FRFs.
    Identify(identify::Identify),
    /// Identify natural frequencies, damping and shapes.
    Modes(modes::ModesArgs),
    /// Fit a quantity of several campaigns over time, load or reassembly.
    Trend(trend::TrendArgs),
    /// Test what works on this PC: measuring, analysis, disk, live page, browser, controllers.
    SelfTest(self_test::SelfTest),
    /// Print completions for a shell.
    Completions(Completions),
    /// Print the manual page, or write one for each command.
    Man(Man),
}

/// Parses the command line, runs the command, and returns the exit code.
pub fn main() -> ExitCode {
    // clap prints help and usage errors itself, and exits with 0 and 2
    let cli = Cli::parse();
    expect_signals();
    start_log(cli.verbose);
    match cli.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            tell_line!("jointrig: {error}");
            ExitCode::from(error.code())
        }
    }
}

impl Cli {
    /// Runs the command.
    pub(crate) fn run(self) -> Result<(), error::CliError> {
        match self.command {
            Command::Demo(command) => command.run(),
            Command::Devices(command) => command.run(),
            Command::Info(command) => command.run(),
            Command::Campaign(command) => command.run(),
            Command::Plan(command) => command.run(),
            Command::Shaker(command) => command.run(),
            Command::Wear(command) => command.run(),
            Command::Analyse(command) => command.run(),
            Command::Report(command) => command.run(),
            #[cfg(feature = "dashboard")]
            Command::Serve(command) => command.run(),
            #[cfg(feature = "dashboard")]
            Command::AnalyseForPage(command) => command.run(),
            Command::Compare(command) => command.run(),
            Command::Export(command) => command.run(),
            Command::Frf(command) => command.run(),
            Command::Hysteresis(command) => command.run(),
            Command::Laws(command) => command.run(),
            Command::Import(command) => command.run(),
            Command::Identify(command) => command.run(),
            Command::Modes(command) => command.run(),
            Command::Trend(command) => command.run(),
            Command::SelfTest(command) => command.run(),
            Command::Completions(command) => {
                command.run();
                Ok(())
            }
            Command::Man(command) => command.run(),
        }
    }
}

fn start_log(verbose: u8) {
    let level = match verbose {
        0 => "warn",
        1 => "info",
        2 => "debug",
        _ => "trace",
    };
    let environment = env_logger::Env::default().filter_or("JOINTRIG_LOG", level);
    let mut builder = env_logger::Builder::from_env(environment);
    if verbose > 0 {
        builder.parse_filters(level);
    }
    // device log messages are made printable; env_logger handles a closed stderr without ending the
    // program
    builder.format(|to, record| {
        let time = to.timestamp_seconds();
        let (level, from) = (record.level(), record.target());
        writeln!(to, "[{time} {level:<5} {from}] {}", visible(&record.args().to_string()))
    });
    builder.init();
}

/// Print completions for a shell.
#[derive(Debug, Args)]
pub struct Completions {
    /// The shell.
    shell: Shell,
}

impl Completions {
    fn run(self) {
        let mut text = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "jointrig", &mut text);
        // a closed pipe is no error: the shell has read enough
        drop(std::io::stdout().write_all(&text));
    }
}

/// Print the manual page, or write it and one for each command into a folder.
#[derive(Debug, Args)]
pub struct Man {
    /// Folder for jointrig.1, jointrig-analyse.1 and so on; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Man {
    fn run(self) -> Result<(), CliError> {
        let command = Cli::command();
        let Some(folder) = self.out else {
            let mut text = Vec::new();
            let rendered = clap_mangen::Man::new(command).render(&mut text);
            rendered.map_err(|error| CliError::Bad(format!("the manual page: {error}")))?;
            // a closed pipe is no error: the pager has read enough
            drop(std::io::stdout().write_all(&text));
            return Ok(());
        };
        let written =
            std::fs::create_dir_all(&folder).and_then(|()| clap_mangen::generate_to(command, &folder));
        written.map_err(|source| CliError::File { path: folder, doing: "writing the manual pages", source })
    }
}

/// Half of the total size of the signals of several records, or of the matrices of one step of the
/// fit, bytes. A larger value would keep more memory idle than an analysis gains from it.
const BLOCK_BYTES: usize = 7 << 20;

/// glibc returns memory to the system when twice the size of the largest block freed so far is
/// idle, so each record's signals would be paged in again, which takes a tenth of an analysis.
/// Freeing this block raises that threshold (`mallopt(3)`, dynamic threshold); other allocators are
/// not affected.
pub fn expect_signals() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(BLOCK_BYTES)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_well_formed() {
        Cli::command().debug_assert();
    }

    #[test]
    fn the_contract_is_understood() {
        for line in [
            "demo --out d --seed 7",
            "demo --full --rig rigs/rigid-clamp.toml",
            "devices --json",
            "devices --udev-rule",
            "self-test --quick --folder data --json",
            "info --device sim: --json",
            "info --device usb: --log-tables tables",
            "campaign run p.jrig --device usb:0042 --log-tables tables",
            "campaign new p.jrig --paper",
            "plan new plan.toml --template small",
            "plan check plan.toml --picture g.png",
            "campaign new p.jrig --plan plan.toml",
            "campaign run p.jrig --device sim: --stage exec:move.sh --yes",
            "campaign status p.jrig --json",
            "campaign run p.jrig --device sim: --plan edited.toml --bell",
            "campaign show p.jrig AJB/AZ1/B2 --json --no-figure",
            "campaign drop p.jrig 3 4 --reason x",
            "campaign keep p.jrig 3",
            "campaign check p.jrig --mass 1.2 --cell B/BZ1/B1",
            "campaign backup p.jrig q.jrig",
            "campaign verify p.jrig",
            "analyse p.jrig --out d --json",
            "analyse p.jrig --out d --details",
            "report p.jrig --out d --figures svg,csv",
            "compare p.jrig q.jrig --out d --json",
            "identify --a A.npz --b B.npz --ajb AJB.npz --geometry p.xlsx --method internal,inverse --idms 4,6 --band 300:600 --json",
            "modes c.jrig --structure A,AJB --band 20:800 --json --out modes.unv",
            "modes AJB.npz --json",
            "completions bash",
            "man --out pages",
            "import DIR --into c.jrig --names names.csv --replace",
            "identify --a A.npz --b B.npz --ajb AJB.npz --geometry p.xlsx --out report",
            "frf records.npz --json",
            "hysteresis record.npz --json",
            "hysteresis record.npz --effective-mass 1.56 --parallel-path 0.0133 --normal-load 300",
            "shaker p.jrig --device sim: --freq 100 200 250 --amplitude 1e-7 1.5e-7",
            "shaker p.jrig --device sim: --freq 100,200 --control force --amplitude 5 --when after --yes --json",
            "shaker p.jrig --device sim: --sweep 100:400 --control drive --amplitude 0.1 --rate 10",
            "shaker p.jrig --device sim: --max-drive 2 --limit LDV_A=2e-3 --limit LC1=50",
            "import A.uff --out A.npz",
            "export c.jrig --format uff58 --out d",
            "import r.npz --into c.jrig --configuration A --impact AZ1 --response A1",
            "frf records.npz --out x.npz --quantity receptance --delay -1e-6,2e-6 --band 100:800",
        ] {
            let words = std::iter::once("jointrig").chain(line.split(' '));
            assert!(Cli::try_parse_from(words).is_ok(), "{line}");
        }
        for line in [
            "",
            "campaign new p.jrig",
            "report p.jrig --out d --figures gif",
            "campaign new p.jrig --paper --plan x.toml",
            "campaign run p.jrig --stage robot",
            "campaign drop p.jrig",
            "shaker p.jrig",
            "shaker p.jrig --device sim: --sweep 100:400",
            "shaker p.jrig --device sim: --sweep 100:400 --freq 3 --amplitude 1",
            "shaker p.jrig --device sim: --freq 0",
            "shaker p.jrig --device sim: --control loud",
            "hysteresis",
            "campaign check p.jrig --mass 1.2",
            "info",
            "devices --json --udev-rule",
            "modes",
            "modes c.jrig --structure C",
            "modes c.jrig --band 800:20",
            "identify --a A.npz --b B.npz --ajb AJB.npz",
            "identify --a A.npz --b B.npz --ajb AJB.npz --geometry p.xlsx --method none",
        ] {
            let words = std::iter::once("jointrig").chain(line.split(' ').filter(|word| !word.is_empty()));
            assert!(Cli::try_parse_from(words).is_err(), "{line}");
        }
    }
}
