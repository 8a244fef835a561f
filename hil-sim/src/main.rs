//! `jointrig-hil-sim`: serves the virtual board on a pseudo-terminal or a socket, or plays the rig
//! as a recorder.
#![forbid(unsafe_code)]

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use clap::{Args, Parser, Subcommand};
use jointrig_hil_sim::board::{Controls, VirtualBoard};
use jointrig_hil_sim::play::{self, Play, Samples, Visit};
use jointrig_hil_sim::rig::RigConfig;
use jointrig_hil_sim::{console, serve};

/// The simulated friction rig with its controller's firmware.
#[derive(Parser)]
#[command(version)]
struct Command {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// Serve one virtual board; its time does not advance while no host is connected.
    ///
    /// Lines on stdin are commands of the rig's operator: `load NEWTONS` sets the normal load,
    /// `guard open|shut`, `emergency press|release` and `reset` work the safety chain. The response
    /// to each is written to stderr.
    Serve(Serve),
    /// Write the rig's voltages to stdout as a recorder's blocks of samples (docs/bridge.md).
    ///
    /// An operator strikes by hand and walks through the cells: at each one the structure is at
    /// rest, then the hits follow. Measure it with
    /// `--device "bridge:jointrig-hil-sim play --rig RIG.toml --visit …"`.
    Play(PlayOptions),
}

#[derive(Args)]
struct PlayOptions {
    /// The rig's description, with [hammer.hand].
    #[arg(long, value_name = "FILE.toml")]
    rig: PathBuf,
    /// Seed of noise, scatter and every position error.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// A cell of the operator's list, for example AJB/AZ3/A3, or AJB/AZ3/A3:5 for five hits; repeat
    /// it for the next one.
    #[arg(long = "visit", value_name = "CELL", required = true)]
    visits: Vec<Visit>,
    /// Hits in each cell that states no number of its own.
    #[arg(long, default_value_t = 3)]
    hits: u32,
    /// Write volts (single precision, double for converters of more than 24 bits) instead of the
    /// converters' codes.
    #[arg(long)]
    volts: bool,
    /// Scans of a block.
    #[arg(long, default_value_t = 2560, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    block: u32,
    /// Deliver blocks in real time without waiting for the reader, as a recorder does.
    #[arg(long)]
    paced: bool,
}

#[derive(Args)]
struct Serve {
    /// Serve on a new pseudo-terminal and print its path: open it as serial:PATH.
    #[arg(long, conflicts_with = "tcp", required_unless_present = "tcp")]
    pty: bool,
    /// Serve on this TCP address, for example 127.0.0.1:4000: open it as tcp:ADDR. Port 0 takes a
    /// free one.
    #[arg(long, value_name = "ADDR")]
    tcp: Option<String>,
    /// The rig's description; the built-in rig if left out.
    #[arg(long, value_name = "FILE.toml")]
    rig: Option<PathBuf>,
    /// The firmware's image, to run under QEMU instead of the native board; its UART is served at
    /// the TCP address.
    #[arg(long, value_name = "IMAGE", requires = "tcp", conflicts_with = "pty")]
    image: Option<PathBuf>,
    /// Seed of noise, scatter and every position error.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

fn main() -> ExitCode {
    let done = match Command::parse().action {
        Action::Serve(options) => run(&options),
        Action::Play(options) => run_play(options),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("jointrig-hil-sim: {error}");
            ExitCode::FAILURE
        }
    }
}

fn description(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path)
        .map_err(|error| format!("cannot read the rig's description {}: {error}", path.display()))
}

fn run_play(options: PlayOptions) -> Result<(), Box<dyn std::error::Error>> {
    let config = RigConfig::from_toml(&description(&options.rig)?)?;
    let samples = if options.volts { Samples::Volts } else { Samples::Codes };
    let PlayOptions { seed, visits, hits, paced, .. } = options;
    let block = options.block as usize;
    let what = Play { seed, visits, hits, samples, block, paced };
    Ok(play::play(&config, &what, std::io::stdout().lock())?)
}

fn run(options: &Serve) -> Result<(), Box<dyn std::error::Error>> {
    let rig = options.rig.as_deref().map(description).transpose()?;
    if let (Some(image), Some(address)) = (&options.image, &options.tcp) {
        return serve_image(image, address, rig.as_deref(), options.seed);
    }
    let (board, mut host) = VirtualBoard::start(rig.as_deref(), options.seed)?;
    stand_at(board.controls());
    if let Some(address) = &options.tcp {
        let listener = TcpListener::bind(address).map_err(|error| {
            format!("cannot listen on {address}: {error}; is the address free and yours?")
        })?;
        println!("tcp:{}", listener.local_addr()?);
        serve::tcp(&mut host, &listener)?;
    } else {
        serve_terminal(&mut host)?;
    }
    Ok(())
}

/// Reads commands from stdin until it ends; the service continues after that.
fn stand_at(controls: &Arc<Controls>) {
    let controls = Arc::clone(controls);
    std::thread::spawn(move || {
        if let Err(error) = console::listen(&controls, std::io::stdin().lock(), std::io::stderr()) {
            eprintln!("stdin is no longer read: {error}");
        }
    });
}

/// Runs the image until it ends: QEMU itself listens on the address.
#[cfg(unix)]
fn serve_image(
    image: &Path,
    address: &str,
    rig: Option<&str>,
    seed: u64,
) -> Result<(), Box<dyn std::error::Error>> {
    use jointrig_hil_sim::board::Options;
    use jointrig_hil_sim::board::qemu::QemuBoard;

    let config = RigConfig::of_device(rig)?;
    let uart = Some(format!("tcp:{address},server=on,wait=off"));
    let options = Options { seed, uart, ..Options::default() };
    let (board, mut link) = QemuBoard::start_with(image, &config, &options)?;
    stand_at(board.controls());
    println!("tcp:{address}");
    // no data comes this way; reading fails when the board ends
    while link.read(&mut [0; 64], std::time::Duration::from_secs(1)).is_ok() {}
    Err(board.failure().unwrap_or_else(|| "the emulated board has ended".into()).into())
}

#[cfg(not(unix))]
fn serve_image(_: &Path, _: &str, _: Option<&str>, _: u64) -> Result<(), Box<dyn std::error::Error>> {
    Err("the emulated board needs shared memory, which only Unix systems have".into())
}

#[cfg(unix)]
fn serve_terminal(host: &mut jointrig_hil_sim::link::HostEnd) -> std::io::Result<()> {
    serve::pseudo_terminal(host, |path| println!("serial:{path}"))
}

#[cfg(not(unix))]
fn serve_terminal(_host: &mut jointrig_hil_sim::link::HostEnd) -> std::io::Result<()> {
    Err(std::io::Error::new(
        std::io::ErrorKind::Unsupported,
        "this system has no pseudo-terminals: use --tcp 127.0.0.1:4000 and the address tcp:127.0.0.1:4000",
    ))
}
