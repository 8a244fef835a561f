//! `campaign run`: measures what is left.

use std::path::PathBuf;

use clap::Args;

use crate::campaign::stage::Stage;
use crate::campaign::store::Store;
use crate::cli::error::CliError;
use crate::cli::{interrupt, measure};
use crate::device::address::Address;

/// Measure what is left of a campaign.
#[derive(Debug, Args)]
pub struct Run {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Device address, e.g. sim:, usb:, serial:/dev/ttyACM0, tcp:127.0.0.1:4000.
    #[arg(long, value_name = "ADDR")]
    device: String,
    /// Who moves hammer and laser: auto, manual, device or exec:COMMAND.
    #[arg(long, value_name = "WHO", default_value = "auto")]
    stage: Stage,
    /// Answer every prompt with yes.
    #[arg(long)]
    yes: bool,
    /// Seed of a simulated rig.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Folder of the tables by which the controller's log lines are read (else JOINTRIG_LOG_TABLES).
    #[arg(long, value_name = "DIR")]
    log_tables: Option<PathBuf>,
}

impl Run {
    pub fn run(self) -> Result<(), CliError> {
        let address: Address = self.device.parse()?;
        let store = Store::open(&self.file)?;
        let again = format!("jointrig campaign run {} --device {address}", self.file.display());
        let stop = interrupt::flag();
        let device = measure::Device { address: &address, seed: self.seed, log_tables: self.log_tables };
        let summary = measure::measure(store, device, self.stage, self.yes, stop, &again)?;
        if summary.interrupted {
            return Err(CliError::Bad("stopped before the campaign was complete".into()));
        }
        Ok(())
    }
}
