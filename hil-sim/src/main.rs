//! `jointrig-hil-sim`: serves the virtual board on a pseudo-terminal or a socket.
#![forbid(unsafe_code)]

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use jointrig_hil_sim::board::{Controls, VirtualBoard};
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
    let Action::Serve(options) = Command::parse().action;
    match run(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("jointrig-hil-sim: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(options: &Serve) -> Result<(), Box<dyn std::error::Error>> {
    let rig = match &options.rig {
        Some(path) => Some(
            std::fs::read_to_string(path)
                .map_err(|error| format!("cannot read the rig's description {}: {error}", path.display()))?,
        ),
        None => None,
    };
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
    use jointrig_hil_sim::rig::RigConfig;

    let config = rig.map_or_else(|| Ok(RigConfig::default()), RigConfig::from_toml)?;
    let uart = Some(format!("tcp:{address},server=on,wait=off"));
    let options = Options { seed, uart, ..Options::default() };
    let (board, mut link) = QemuBoard::start_with(image, &config, &options)?;
    stand_at(board.controls());
    println!("tcp:{address}");
    // no data comes this way; reading fails when the board ends
    while link.read(&mut [0; 64], Duration::from_secs(1)).is_ok() {}
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
