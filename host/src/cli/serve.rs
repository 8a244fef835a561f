//! `serve`: the live page of a campaign file.

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::Duration;

use clap::Args;

use super::error::CliError;
use super::{interrupt, output};
use crate::dashboard::Dashboard;

/// Show a campaign in the browser: while another process measures it, or afterwards. Looks and does nothing else.
#[derive(Debug, Args)]
pub struct Serve {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Port on 127.0.0.1; 0 takes a free one.
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,
}

impl Serve {
    pub fn run(self) -> Result<(), CliError> {
        let stop = interrupt::flag();
        let dashboard = Dashboard::of_file(&self.file, self.port)?;
        output::lines([dashboard.url()])?;
        eprintln!(
            "Open this address in a browser of this machine. Ctrl-C ends the page; it changes nothing in the file."
        );
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(100));
        }
        Ok(())
    }
}
