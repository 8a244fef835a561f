//! Permission to change the machine: a user at a terminal is asked before system packages are
//! installed.

use anyhow::{Context, Result, bail};
use std::io::{IsTerminal, Write};

/// Permission to install system packages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Consent {
    /// Given in advance: by `--yes`, by `CI`, or because stdin is not a terminal.
    Given,
    /// stdin is a terminal: ask the user.
    Ask,
}

impl Consent {
    /// Asks only if stdin is a terminal and `CI` is not set.
    pub fn new(yes: bool) -> Self {
        let somebody = std::io::stdin().is_terminal() && std::env::var_os("CI").is_none();
        if yes || !somebody { Self::Given } else { Self::Ask }
    }

    /// Returns if `what` is permitted; otherwise the error states what was declined.
    pub fn require(self, what: &str) -> Result<()> {
        if self == Self::Given {
            return Ok(());
        }
        print!("  {what}? [Y/n] ");
        std::io::stdout().flush().context("could not write to the terminal")?;
        let mut answer = String::new();
        std::io::stdin().read_line(&mut answer).context("could not read the answer from the terminal")?;
        if !is_yes(&answer) {
            bail!("declined: {what}");
        }
        Ok(())
    }
}

fn is_yes(answer: &str) -> bool {
    matches!(answer.trim().to_ascii_lowercase().as_str(), "" | "y" | "yes")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_yes_or_a_bare_return_is_consent() {
        assert!(is_yes("\n") && is_yes("Y\n") && is_yes("yes\n"));
        assert!(!is_yes("n\n") && !is_yes("what?\n"));
    }

    #[test]
    fn yes_on_the_command_line_is_consent() {
        assert_eq!(Consent::new(true), Consent::Given);
        assert!(Consent::Given.require("install nothing").is_ok());
    }
}
