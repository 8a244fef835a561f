//! `serve`: the live page of a campaign file, of a device's channels, or of both during a
//! measurement.
//!
//! `analyse-for-page` is started by the live page's process to analyse a campaign in a separate
//! process. It is hidden, since users do not call it.

use super::campaign::run::Run;
use super::error::CliError;
use super::open_page::Opened;
use super::output;
use super::page::Page;
use crate::campaign::store::is_simulated_board;
use crate::campaign::watch::Seen;
use crate::dashboard::Dashboard;
use crate::device::address::Address;
use crate::device::logs::Tables;
use crate::device::session::Session;
use crate::live::numbers::analyse_for_another;
use crate::untrusted_text::tell_line;
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Interval between updates of the link's accounting.
const LINK: Duration = Duration::from_secs(1);

/// Show a campaign in the browser: while another process measures it, or afterwards. With FILE and
/// --device: measure it, as `campaign run` does. With --device alone: show its channels; nothing is
/// struck.
#[derive(Debug, Args)]
pub struct Serve {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig", required_unless_present = "device")]
    file: Option<PathBuf>,
    /// Device address, e.g. sim:, usb:, serial:/dev/ttyACM0, tcp:127.0.0.1:4000,
    /// "bridge:python my_daq.py".
    #[arg(long, value_name = "ADDR")]
    device: Option<String>,
    /// Port on 127.0.0.1; 0 chooses a free one.
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,
    /// Open the page in the browser.
    #[arg(long)]
    open: bool,
    /// During a measurement: let a page answer the prompts for hammer and laser. The person who
    /// answers must see the rig.
    #[arg(long, requires = "device", requires = "file")]
    allow_control: bool,
}

impl Serve {
    pub fn run(self) -> Result<(), CliError> {
        let page = Page { serve: Some(self.port), open: self.open };
        match (self.file, self.device) {
            (Some(file), Some(device)) => Run::with_page(file, device, page, self.allow_control).run(),
            (Some(file), None) => show(&file, page),
            (None, Some(device)) => show_channels(&device, page),
            (None, None) => Err(CliError::Usage("name a FILE.jrig, or give --device ADDR".into())),
        }
    }
}

/// Shows a file, without a device.
fn show(file: &Path, page: Page) -> Result<(), CliError> {
    let stop = output::flag();
    let dashboard = Dashboard::of_file(file, page.serve.unwrap_or(0))?;
    output::lines([dashboard.url()])?;
    tell_line!(
        "Open this address in a browser of this machine. Ctrl-C ends the page; it changes nothing in the file."
    );
    let _opened = page.open.then(|| Opened::new(&dashboard.url()));
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(100));
    }
    Ok(())
}

/// Shows a device, without a file: its stream is started and displayed.
fn show_channels(device: &str, page: Page) -> Result<(), CliError> {
    let address: Address = device.parse()?;
    let stop = output::flag();
    let mut onlooker = page.start(None, &stop, false)?;
    let mut session = Session::open(address.open(0)?, &address.to_string())?;
    session.look_for_log_tables(Tables::new(None));
    onlooker.tap.take().into_iter().for_each(|tap| session.watch(tap));
    let info = session.info()?;
    let channels = session.channels(&info)?;
    let simulated = is_simulated_board(&info.board);
    onlooker.watch.saw(&Seen::Stream { channels: &channels, simulated });
    let (_, first) = session.start(&channels)?;
    tell_line!("nothing is struck and nothing moves; Ctrl-C ends");
    let (begun, mut told) = (Instant::now(), Instant::now());
    while !stop.load(Ordering::Relaxed) {
        session.pump(Duration::from_millis(20))?;
        let expected = session.expected()?;
        session.forget_before(expected);
        if session.simulated().is_some() {
            // otherwise a simulated rig's time would run as fast as the machine allows
            let now = first + (begun.elapsed().as_secs_f64() * f64::from(channels.rate_hz)) as u64;
            session.hold_acknowledgement(Some(now.saturating_sub(session.ring_scans() / 2).max(first)));
        }
        for line in session.log_lines() {
            log::info!("controller: {line}");
        }
        if told.elapsed() >= LINK {
            told = Instant::now();
            onlooker.watch.saw(&Seen::Link(session.accounts()));
        }
    }
    session.finish()?;
    Ok(())
}

/// Print the result of an analysis, for the live page; ends when the input is closed.
#[derive(Debug, Args)]
pub struct AnalyseForPage {
    /// The campaign file.
    file: PathBuf,
    /// The newest record's id.
    last: i64,
}

impl AnalyseForPage {
    pub(super) fn run(self) -> Result<(), CliError> {
        analyse_for_another(&self.file, self.last, &mut std::io::stdout().lock()).map_err(|source| {
            CliError::File { path: self.file, doing: "analysing for the live page", source }
        })
    }
}
