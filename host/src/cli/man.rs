//! `man`: the manual page, and one for each command.

use std::io::Write;
use std::path::PathBuf;

use clap::{Args, CommandFactory};

use super::error::CliError;

/// Print the manual page, or write it and one for each command into a folder.
#[derive(Debug, Args)]
pub struct Man {
    /// Folder for jointrig.1, jointrig-analyse.1 and so on; made when it is not there.
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
            // a pager that is closed has what it wants
            drop(std::io::stdout().write_all(&text));
            return Ok(());
        };
        let written =
            std::fs::create_dir_all(&folder).and_then(|()| clap_mangen::generate_to(command, &folder));
        written.map_err(|source| CliError::File { path: folder, doing: "writing the manual pages", source })
    }
}
