//! `man`: prints the manual page, or writes one for each command.

use std::io::Write;
use std::path::PathBuf;

use clap::{Args, CommandFactory};

use super::error::CliError;

/// Print the manual page, or write it and one for each command into a folder.
#[derive(Debug, Args)]
pub struct Man {
    /// Folder for jointrig.1, jointrig-analyse.1 and so on; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Man {
    pub fn run(self) -> Result<(), CliError> {
        let command = super::Cli::command();
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
