//! `completions`: prints a shell's completion script.

use std::io::Write;

use clap::{Args, CommandFactory};
use clap_complete::Shell;

/// Print completions for a shell.
#[derive(Debug, Args)]
pub struct Completions {
    /// The shell.
    shell: Shell,
}

impl Completions {
    pub fn run(self) {
        let mut text = Vec::new();
        clap_complete::generate(self.shell, &mut super::Cli::command(), "jointrig", &mut text);
        // a closed pipe is no error: the shell has read enough
        drop(std::io::stdout().write_all(&text));
    }
}
