//! Who moves hammer and laser: the device itself (virtual rigs), a person, or a user's command.
//!
//! Checks, before anything moves, that the structure is the one that the file's records were
//! measured on: averages over two structures are valid for neither.

use super::answers::{Answers, Key, Question};
use crate::campaign::plan::{Cell, configuration_name};
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::session_table::SessionInfo;
use crate::device::error::DeviceError;
use crate::device::session::Session;
use crate::device::transport::Simulated;
use crate::untrusted_text::{tell, tell_line};
use jointrig_protocol::answer::Info;
use jointrig_protocol::request::Stage as StageRequest;
use std::io::{BufRead, Write};
use std::process::Command;
use std::str::FromStr;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

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

/// Result of moving hammer and laser.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moved {
    /// They are in place from this scan on.
    InPlace(u64),
    /// A person wants the good hits of this cell struck again, and will be asked again.
    Redo,
    /// A person leaves this cell for a later run.
    Skip,
    /// A person wants to go back to the previous cell.
    Back,
}

/// Why hammer and laser are not in place.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// The device refused, or is disconnected.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The command failed.
    #[error("the stage command `{command}` failed ({why}); hammer and laser are not in place")]
    Command {
        /// The command.
        command: String,
        /// Its exit status.
        why: String,
    },
    /// Nobody answered.
    #[error(
        "moving hammer and laser needs a person, and there is no terminal: use --yes, --stage exec:COMMAND or --stage device"
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
    /// Resolves [`Stage::Auto`] for a device that can (or cannot) move hammer and laser itself.
    #[must_use]
    pub fn decided(self, device_can: bool) -> Self {
        match self {
            Self::Auto if device_can => Self::Device,
            Self::Auto => Self::Manual,
            other => other,
        }
    }

    /// Moves hammer and laser to `cell`, whose next attempt is `attempt`; `what` is the text shown
    /// to a person: where they go and the cell's progress. When they are in place, the
    /// acknowledgement is held at or before the returned scan. `who` answers a prompt.
    ///
    /// # Errors
    /// They are not in place, with the reason.
    pub fn go(
        &self,
        session: &mut Session,
        cell: &Cell,
        attempt: u32,
        what: &str,
        who: &Who<'_>,
    ) -> Result<Moved, StageError> {
        match self {
            Self::Device | Self::Auto => {
                let name = |text: &str| text.try_into().map_err(|_| StageError::Name(text.into()));
                let (impact, response) = (name(&cell.impact)?, name(&cell.response)?);
                let configuration = cell.configuration;
                let request = StageRequest { configuration, impact, response, attempt };
                return Ok(Moved::InPlace(session.stage(request)?));
            }
            Self::Manual => match meanwhile(session, || who.ask(what))? {
                Key::Accept => {}
                Key::Redo => return Ok(Moved::Redo),
                Key::Skip => return Ok(Moved::Skip),
                Key::Back => return Ok(Moved::Back),
            },
            Self::Exec(command) => meanwhile(session, || execute(command, cell, attempt))?,
        }
        session.hold_acknowledgement(Some(session.expected()?));
        Ok(Moved::InPlace(session.status()?.next_scan))
    }
}

/// Keeps the stream running while things are moved, or while something is computed; what is
/// measured meanwhile is discarded.
pub(super) fn meanwhile<T: Send, E: From<DeviceError> + Send>(
    session: &mut Session,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> Result<T, E> {
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

/// Who answers a prompt.
pub struct Who<'a> {
    /// Answer yes without asking.
    pub yes: bool,
    /// Another source of answers, and the question that they refer to.
    pub elsewhere: Option<(&'a Answers, Question)>,
}

/// Interval at which the other source of answers is checked.
const LISTEN: Duration = Duration::from_millis(50);

const QUESTION: &str = "Enter when in place; r redo this cell, s skip it, b back one cell, q quit: ";

impl Who<'_> {
    fn ask(&self, what: &str) -> Result<Key, StageError> {
        match self.elsewhere {
            Some((answers, question)) if !self.yes => ask_both(what, answers, question),
            _ => prompt(what, self.yes, &mut std::io::stdin().lock(), &mut std::io::stderr()),
        }
    }
}

/// Lines typed at the terminal, read on a separate thread: it blocks on the keyboard while an
/// answer may come from the other source.
fn keyboard() -> &'static Mutex<Receiver<String>> {
    static LINES: OnceLock<Mutex<Receiver<String>>> = OnceLock::new();
    LINES.get_or_init(|| {
        let (to, lines) = sync_channel(16);
        std::thread::spawn(move || {
            for line in std::io::stdin().lines().map_while(Result::ok) {
                if to.send(line).is_err() {
                    return;
                }
            }
        });
        Mutex::new(lines)
    })
}

/// Asks at the terminal and at the other source; the first answer counts. Without a terminal, only
/// the other source is asked.
fn ask_both(what: &str, answers: &Answers, question: Question) -> Result<Key, StageError> {
    let lines = keyboard().lock().unwrap_or_else(PoisonError::into_inner);
    // discard input from before the question
    answers.forget();
    lines.try_iter().for_each(drop);
    tell(&format!("\n{what}\n{QUESTION}"));
    loop {
        if let Some(key) = answers.answer_to(question) {
            tell_line!("answered on the page: {key:?}");
            return Ok(key);
        }
        if answers.stopped() {
            return Err(StageError::Stopped);
        }
        match lines.recv_timeout(LISTEN) {
            Ok(line) => match understood(&line) {
                Understood::Key(key) => return Ok(key),
                Understood::Quit => return Err(StageError::Stopped),
                Understood::Nothing => tell(&format!("`{}` is not one of these\n{QUESTION}", line.trim())),
            },
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(LISTEN),
        }
    }
}

/// The meaning of a line.
enum Understood {
    Key(Key),
    Quit,
    Nothing,
}

fn understood(line: &str) -> Understood {
    match line.trim().to_ascii_lowercase().as_str() {
        "" | "a" | "y" => Understood::Key(Key::Accept),
        "r" => Understood::Key(Key::Redo),
        "s" => Understood::Key(Key::Skip),
        "b" => Understood::Key(Key::Back),
        "q" => Understood::Quit,
        _ => Understood::Nothing,
    }
}

/// Asks until the answer is valid.
fn prompt(
    what: &str,
    yes: bool,
    keys: &mut impl BufRead,
    screen: &mut impl Write,
) -> Result<Key, StageError> {
    // write errors are ignored: without answers there is an error below
    let _ = write!(screen, "\n{what}\n");
    if yes {
        let _ = writeln!(screen, "in place? yes (--yes)");
        return Ok(Key::Accept);
    }
    loop {
        let _ = write!(screen, "{QUESTION}").and_then(|()| screen.flush());
        let mut line = String::new();
        if !matches!(keys.read_line(&mut line), Ok(length) if length > 0) {
            return Err(StageError::NobodyThere);
        }
        match understood(&line) {
            Understood::Key(key) => return Ok(key),
            Understood::Quit => return Err(StageError::Stopped),
            Understood::Nothing => {
                let _ = writeln!(screen, "`{}` is not one of these", line.trim().to_ascii_lowercase());
            }
        }
    }
}

fn execute(command: &str, cell: &Cell, attempt: u32) -> Result<(), StageError> {
    let failed = |why: String| StageError::Command { command: command.into(), why };
    let status = shell(command)
        .env("JOINTRIG_CONFIGURATION", configuration_name(cell.configuration))
        .env("JOINTRIG_IMPACT", &cell.impact)
        .env("JOINTRIG_RESPONSE", &cell.response)
        .env("JOINTRIG_ATTEMPT", attempt.to_string())
        .stdout(std::io::stderr())
        .status()
        .map_err(|error| failed(error.to_string()))?;
    if status.success() { Ok(()) } else { Err(failed(status.to_string())) }
}

/// The system's shell with this command.
#[cfg(not(windows))]
fn shell(command: &str) -> Command {
    let mut shell = Command::new("sh");
    shell.args(["-c", command]);
    shell
}

/// cmd gets the command as it was written: quoting it as other programs read it would change its
/// own quotation marks. With `/S` it removes the outer ones only; `/D` leaves out what the registry
/// may run first.
#[cfg(windows)]
fn shell(command: &str) -> Command {
    use std::os::windows::process::CommandExt;

    let mut shell = Command::new("cmd");
    shell.raw_arg(format!("/D /S /C \"{command}\""));
    shell
}

/// Evidence, as text for the user, that this is another structure than before; `None` if there is
/// none, or nothing was measured yet.
pub(super) fn another(
    store: &Store,
    info: &Info,
    simulated: Option<&Simulated>,
) -> Result<Option<String>, StoreError> {
    if store.places()?.is_empty() && store.levels()?.is_empty() {
        return Ok(None);
    }
    if let (Some(was), Some(is)) = (store.simulated_rig()?, simulated) {
        let named = |name: &str, seed: u64| format!("the simulated rig `{name}`, seed {seed}");
        let (old, new) = (named(&was.name, was.seed), named(&is.rig, is.seed));
        return Ok(if old != new {
            Some(format!("its records were measured on {old}, but this is {new}"))
        } else if was.parameters.is_some_and(|old| old != is.parameters) {
            Some(format!("its records were measured on {old}, and a parameter of that rig has changed since"))
        } else {
            None
        });
    }
    let measured = |own: &&SessionInfo| own.board != SessionInfo::IMPORTED;
    let sessions = store.sessions()?;
    let Some(before) = sessions.iter().map(|(_, own)| own).rfind(measured) else { return Ok(None) };
    let same = (&*before.board, &*before.serial) == (info.board.as_str(), info.serial.as_str());
    Ok((!same).then(|| {
        format!(
            "its records were measured with the controller {} {}, but this is {} {}",
            before.board, before.serial, info.board, info.serial
        )
    }))
}

/// Refuses another structure, unless it is accepted: then returns the evidence, to be logged once
/// the session exists.
///
/// # Errors
/// The error that `refuse` makes of it, or the file cannot be read.
pub(super) fn same_or_accepted<E: From<StoreError>>(
    store: &Store,
    info: &Info,
    simulated: Option<&Simulated>,
    accepted: bool,
    refuse: impl FnOnce(String) -> E,
) -> Result<Option<String>, E> {
    match another(store, info, simulated)? {
        Some(what) if !accepted => Err(refuse(format!(
            "{}: {what}. Hits of two structures belong in two files: create one with `jointrig campaign new`. If it is the same \
             structure after all (a controller was replaced), continue with --new-structure; the report states it",
            store.path().display()
        ))),
        accepted => Ok(accepted),
    }
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

    #[test]
    fn a_person_may_accept_redo_skip_go_back_and_quit() {
        let answered = |keys: &str| {
            let mut screen = Vec::new();
            let key = prompt("hammer to AZ1", false, &mut keys.as_bytes(), &mut screen);
            (key, String::from_utf8(screen).expect("text"))
        };
        for (keys, wanted) in
            [("\n", Key::Accept), ("r\n", Key::Redo), ("S\n", Key::Skip), ("x\nb\n", Key::Back)]
        {
            let (key, screen) = answered(keys);
            assert_eq!(key.expect(keys), wanted);
            assert!(screen.contains("hammer to AZ1") && screen.contains("q quit"), "{screen}");
            assert_eq!(screen.contains("`x` is not one of these"), keys.starts_with('x'));
        }
        assert!(matches!(answered("q\n").0, Err(StageError::Stopped)));
        assert!(matches!(answered("").0, Err(StageError::NobodyThere)));
    }

    #[test]
    fn a_command_is_told_the_cell_and_its_failure_counts() {
        let cell = Cell {
            configuration: Configuration::Ajb,
            impact: "AZ1".into(),
            response: "B2".into(),
            wanted: 1,
        };
        let test = if cfg!(windows) {
            "if \"%JOINTRIG_CONFIGURATION%/%JOINTRIG_IMPACT%/%JOINTRIG_RESPONSE%/%JOINTRIG_ATTEMPT%\" == \"AJB/AZ1/B2/3\" \
             (exit 0) else (exit 1)"
        } else {
            "test \"$JOINTRIG_CONFIGURATION/$JOINTRIG_IMPACT/$JOINTRIG_RESPONSE/$JOINTRIG_ATTEMPT\" = AJB/AZ1/B2/3"
        };
        execute(test, &cell, 3).expect("told");
        assert!(execute(test, &cell, 4).expect_err("another").to_string().contains("failed"));
    }
}
