//! Who moves hammer and laser: the device itself (virtual rigs), a person, or a command of the user's.

use std::io::{BufRead, Write};
use std::process::Command;
use std::str::FromStr;
use std::time::Duration;

use jointrig_protocol::request::Stage as StageRequest;

use super::plan::{Cell, configuration_name};
use crate::device::error::DeviceError;
use crate::device::session::Session;

/// Who moves hammer and laser.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The device when it can, else a person.
    Auto,
    /// The device.
    Device,
    /// A person, asked on the terminal.
    Manual,
    /// A command, run by the shell with the cell in its environment.
    Exec(String),
}

/// Why hammer and laser are not in place.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// The device refused, or is gone.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The command failed.
    #[error("the stage command `{command}` failed ({why}); hammer and laser are not in place")]
    Command {
        /// The command.
        command: String,
        /// How it ended.
        why: String,
    },
    /// Nobody answered.
    #[error(
        "nobody is there to move hammer and laser (no terminal): use --yes, --stage exec:COMMAND or --stage device"
    )]
    NobodyThere,
    /// A person stopped the campaign.
    #[error("stopped at the prompt; run the same command again to go on")]
    Stopped,
    /// A point's name does not fit the protocol.
    #[error("the name `{0}` is too long for the device")]
    Name(String),
}

impl FromStr for Stage {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "device" => Ok(Self::Device),
            "manual" => Ok(Self::Manual),
            _ => match text.strip_prefix("exec:") {
                Some(command) if !command.trim().is_empty() => Ok(Self::Exec(command.into())),
                _ => Err("write auto, manual, device or exec:COMMAND".into()),
            },
        }
    }
}

impl Stage {
    /// Who it is for a device that can (or cannot) be told where hammer and laser are.
    #[must_use]
    pub fn decided(self, device_can: bool) -> Self {
        match self {
            Self::Auto if device_can => Self::Device,
            Self::Auto => Self::Manual,
            other => other,
        }
    }

    /// Brings hammer and laser to `cell`, whose next attempt is `attempt`. Returns the first scan for which
    /// that holds; the acknowledgement is held at or before it. `yes` answers a manual prompt.
    ///
    /// # Errors
    /// They are not in place, and why.
    pub fn go(&self, session: &mut Session, cell: &Cell, attempt: u32, yes: bool) -> Result<u64, StageError> {
        match self {
            Self::Device | Self::Auto => {
                let name = |text: &str| text.try_into().map_err(|_| StageError::Name(text.into()));
                let (impact, response) = (name(&cell.impact)?, name(&cell.response)?);
                let configuration = cell.configuration;
                return Ok(session.stage(StageRequest { configuration, impact, response, attempt })?);
            }
            Self::Manual => meanwhile(session, || ask(cell, yes))?,
            Self::Exec(command) => meanwhile(session, || execute(command, cell, attempt))?,
        }
        session.hold_acknowledgement(Some(session.expected()?));
        Ok(session.status()?.next_scan)
    }
}

/// Keeps the stream going while somebody moves things; what is measured meanwhile is of no use.
fn meanwhile(
    session: &mut Session,
    work: impl FnOnce() -> Result<(), StageError> + Send,
) -> Result<(), StageError> {
    session.hold_acknowledgement(None);
    std::thread::scope(|scope| {
        let worker = scope.spawn(work);
        let mut link = Ok(0);
        while !worker.is_finished() && link.is_ok() {
            link = session.pump(Duration::from_millis(5)).and_then(|()| session.expected());
            if let Ok(expected) = link {
                session.forget_before(expected);
            }
        }
        let moved = worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        link?;
        moved
    })
}

fn ask(cell: &Cell, yes: bool) -> Result<(), StageError> {
    let name = configuration_name(cell.configuration);
    let mut screen = std::io::stderr();
    let said = write!(
        screen,
        "\nstructure {name}: hammer to {}, laser to {} — Enter when in place, q to stop: ",
        cell.impact, cell.response
    )
    .and_then(|()| screen.flush());
    if yes {
        // nobody reads it, so a closed screen is no reason to stop
        drop(said.and_then(|()| writeln!(screen, "yes")));
        return Ok(());
    }
    let mut line = String::new();
    match std::io::stdin().lock().read_line(&mut line) {
        Ok(0) | Err(_) => Err(StageError::NobodyThere),
        Ok(_) if line.trim().eq_ignore_ascii_case("q") => Err(StageError::Stopped),
        Ok(_) => Ok(()),
    }
}

fn execute(command: &str, cell: &Cell, attempt: u32) -> Result<(), StageError> {
    let failed = |why: String| StageError::Command { command: command.into(), why };
    let (shell, flag) = if cfg!(windows) { ("cmd", "/C") } else { ("sh", "-c") };
    let status = Command::new(shell)
        .args([flag, command])
        .env("JOINTRIG_CONFIGURATION", configuration_name(cell.configuration))
        .env("JOINTRIG_IMPACT", &cell.impact)
        .env("JOINTRIG_RESPONSE", &cell.response)
        .env("JOINTRIG_ATTEMPT", attempt.to_string())
        .stdout(std::io::stderr())
        .status()
        .map_err(|error| failed(error.to_string()))?;
    if status.success() { Ok(()) } else { Err(failed(status.to_string())) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jointrig_protocol::request::Configuration;

    #[test]
    fn stages_are_named_as_on_the_command_line() {
        assert_eq!("manual".parse(), Ok(Stage::Manual));
        assert_eq!("exec:move.sh x".parse(), Ok(Stage::Exec("move.sh x".into())));
        assert!("exec:".parse::<Stage>().is_err());
        assert!("robot".parse::<Stage>().is_err());
        assert_eq!(Stage::Auto.decided(false), Stage::Manual);
        assert_eq!(Stage::Auto.decided(true), Stage::Device);
    }

    #[cfg(unix)]
    #[test]
    fn a_command_is_told_the_cell_and_its_failure_counts() {
        let cell = Cell {
            configuration: Configuration::Ajb,
            impact: "AZ1".into(),
            response: "B2".into(),
            wanted: 1,
        };
        let test = "test $JOINTRIG_CONFIGURATION/$JOINTRIG_IMPACT/$JOINTRIG_RESPONSE/$JOINTRIG_ATTEMPT = AJB/AZ1/B2/3";
        execute(test, &cell, 3).expect("told");
        assert!(execute(test, &cell, 4).expect_err("another").to_string().contains("failed"));
    }
}
