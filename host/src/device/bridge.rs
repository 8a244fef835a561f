//! `bridge:COMMAND` and `bridge:tcp:HOST:PORT`: a recorder's blocks of samples from any program.
//!
//! The program is started here, without a shell, and ends with the session: its standard input,
//! which carries the orders for a hammer, is closed, and if it has not ended two seconds later it
//! is killed. What it prints to standard error is logged; its last line is a part of the error when
//! it ends.

use super::error::DeviceError;
use super::tcp;
use super::transport::{Recorder, Transport};
use jointrig_bridge::board::{Bridge, OpenError};
use jointrig_native::link::HostEnd;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Wait for the header: drivers and their libraries take some time to load.
const HEADER_PATIENCE: Duration = Duration::from_mins(1);

/// Wait for the program to end by itself after its standard input was closed.
const END_PATIENCE: Duration = Duration::from_secs(2);

/// Wait for the exit status and the last lines of a program whose output has ended.
const STATUS_PATIENCE: Duration = Duration::from_millis(500);

/// Environment variable of the programs that are started here.
const STARTED_BY_THE_HOST: &str = "JOINTRIG_BRIDGE";

/// Longest line of a program's standard error that is kept, bytes.
const LONGEST_LINE: u64 = 4096;

/// A recorder behind a bridge.
pub struct BridgedRecorder {
    link: HostEnd,
    // before the device: the thread that reads the source ends only with the source
    source: Source,
    device: Bridge,
}

impl Drop for BridgedRecorder {
    fn drop(&mut self) {
        // before the source, which waits for the program to end
        self.device.end_input();
    }
}

/// Where the blocks come from.
enum Source {
    Program(Program),
    Socket(TcpStream),
}

impl Drop for Source {
    fn drop(&mut self) {
        match self {
            Self::Program(program) => program.end(),
            // it may be closed already
            Self::Socket(stream) => drop(stream.shutdown(Shutdown::Both)),
        }
    }
}

/// The direction of a socket in which the orders go; dropping it ends this direction.
struct Backwards(TcpStream);

impl Write for Backwards {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl Drop for Backwards {
    fn drop(&mut self) {
        // it may be closed already
        drop(self.0.shutdown(Shutdown::Write));
    }
}

/// A running program.
struct Program {
    child: Child,
    last_line: Arc<Mutex<String>>,
}

impl Program {
    fn start(command: &str) -> Result<(Self, ChildStdin, impl Read + Send + use<>), String> {
        let mut command = command_of(command)?;
        // Ctrl-C is for the host, which ends after the current hit and then ends the program
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command
            // for programs that behave differently when run alone
            .env(STARTED_BY_THE_HOST, "1")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| format!("the program could not be started: {error}; check its name and path"))?;
        let (Some(stdin), Some(stdout), Some(stderr)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err("the program has no input or output".into());
        };
        let last_line = Arc::new(Mutex::new(String::new()));
        // it ends with the program
        std::thread::Builder::new()
            .name("bridge errors".into())
            .spawn({
                let last_line = Arc::clone(&last_line);
                move || listen(BufReader::new(stderr), &last_line)
            })
            .map_err(|error| error.to_string())?;
        Ok((Self { child, last_line }, stdin, stdout))
    }

    /// Its exit status, if it ends within `patience`.
    fn status(&mut self, patience: Duration) -> Option<ExitStatus> {
        let until = Instant::now() + patience;
        loop {
            match self.child.try_wait() {
                Ok(None) if Instant::now() < until => std::thread::sleep(Duration::from_millis(5)),
                Ok(status) => return status,
                Err(_) => return None,
            }
        }
    }

    /// Kills it if it does not end, although its standard input was closed.
    fn end(&mut self) {
        if self.status(END_PATIENCE).is_none() {
            // it may have ended meanwhile
            drop(self.child.kill());
            drop(self.child.wait());
        }
    }

    /// How it ended, and its last line on standard error.
    fn how_it_ended(&mut self) -> String {
        let how = match self.status(STATUS_PATIENCE) {
            Some(status) => format!("the program ended ({status})"),
            None => "the program runs on without writing".into(),
        };
        // the thread that reads the last lines may be behind
        std::thread::sleep(Duration::from_millis(20));
        let line = self.last_line.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if line.is_empty() { how } else { format!("{how}; its last line: {line}") }
    }
}

/// The command line as a command, without a shell on systems where its words are unambiguous.
#[cfg(not(windows))]
fn command_of(line: &str) -> Result<Command, String> {
    let words = shlex::split(line).ok_or("its quotation marks do not match")?;
    let (program, arguments) = words.split_first().ok_or("no program is named")?;
    let mut command = Command::new(program);
    command.args(arguments);
    Ok(command)
}

/// The command line as a command. A program gets its arguments as one text on Windows and splits
/// them itself, so they are passed on as they were written. There is no shell, because ending a
/// shell would not end the program.
#[cfg(windows)]
fn command_of(line: &str) -> Result<Command, String> {
    use std::os::windows::process::CommandExt;

    const CREATE_NEW_PROCESS_GROUP: u32 = 0x200;
    let (program, arguments) = program_and_arguments(line)?;
    let mut command = Command::new(program);
    command.raw_arg(arguments).creation_flags(CREATE_NEW_PROCESS_GROUP);
    Ok(command)
}

/// The program that a command line of Windows names, which is quoted if its path has spaces, and
/// the text after it.
#[cfg(any(windows, test))]
fn program_and_arguments(line: &str) -> Result<(&str, &str), String> {
    let line = line.trim();
    let (program, arguments) = match line.strip_prefix('"') {
        Some(quoted) => quoted.split_once('"').ok_or("its quotation marks do not match")?,
        None => line.split_at(line.find(char::is_whitespace).unwrap_or(line.len())),
    };
    if program.is_empty() { Err("no program is named".into()) } else { Ok((program, arguments.trim_start())) }
}

/// Logs every line and keeps the last one.
fn listen(mut lines: impl BufRead, last: &Mutex<String>) {
    let mut line = Vec::new();
    loop {
        line.clear();
        match lines.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        let text = String::from_utf8_lossy(&line);
        let text = text.trim_end();
        if !text.is_empty() {
            log::info!("recorder: {text}");
            text.clone_into(&mut last.lock().unwrap_or_else(PoisonError::into_inner));
        }
    }
}

impl BridgedRecorder {
    /// Starts a program with this command line, and reads the header that it writes.
    ///
    /// # Errors
    /// [`DeviceError::Open`] with the cause, and how the program ended.
    pub fn start(command: &str) -> Result<Self, DeviceError> {
        let open = |why: String| DeviceError::Open { address: format!("bridge:{command}"), why };
        let (program, input, output) = Program::start(command).map_err(open)?;
        Self::of(Source::Program(program), Bridge::open(output, input, HEADER_PATIENCE)).map_err(open)
    }

    /// Connects to a program at `host:port`, and reads the header that it sends.
    ///
    /// # Errors
    /// [`DeviceError::Open`] with the cause.
    pub fn connect(place: &str) -> Result<Self, DeviceError> {
        let open = |why: String| DeviceError::Open { address: format!("bridge:tcp:{place}"), why };
        let connected = tcp::connect(place).and_then(|stream| {
            let clones = stream.try_clone().and_then(|own| Ok((own, Backwards(stream.try_clone()?))));
            clones.map(|(own, input)| (own, input, stream)).map_err(|error| error.to_string())
        });
        let (stream, input, output) =
            connected.map_err(|why| open(format!("{why}: does the recorder's program listen there?")))?;
        Self::of(Source::Socket(stream), Bridge::open(output, input, HEADER_PATIENCE)).map_err(open)
    }

    /// The recorder behind a source whose header was read, or why it cannot be used.
    fn of(mut source: Source, opened: Result<(Bridge, HostEnd), OpenError>) -> Result<Self, String> {
        match opened {
            Ok((device, link)) => Ok(Self { link, source, device }),
            Err(error) => {
                let why = match (&error, &mut source) {
                    (OpenError::Header(_), Source::Program(program)) => {
                        format!("{error}; {}", program.how_it_ended())
                    }
                    _ => error.to_string(),
                };
                Err(format!("{why} (the format is described in docs/bridge.md)"))
            }
        }
    }

    /// Replaces a closed link by the reason why the recorder ended.
    fn explained(&mut self, error: io::Error) -> io::Error {
        let Some(why) = self.device.ended() else { return error };
        let why = match &mut self.source {
            Source::Program(program) => format!("{why}; {}", program.how_it_ended()),
            Source::Socket(_) => why,
        };
        io::Error::new(error.kind(), why)
    }
}

impl Transport for BridgedRecorder {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.link.read(buf, timeout).map_err(|error| self.explained(error))
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.link.write_all(bytes).map_err(|error| self.explained(error))
    }

    fn keeps_packets(&self) -> bool {
        true
    }

    fn recorder(&self) -> Option<Recorder> {
        let rate_hz = self.device.header().rate_hz;
        Some(Recorder { rate_hz, longest_block: self.device.longest_block() })
    }

    fn take_remarks(&mut self) -> Vec<String> {
        self.device.take_remarks()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_of_a_command_line_of_windows_may_be_quoted_and_its_arguments_stay_as_they_are() {
        for (line, program, arguments) in [
            ("python my_daq.py --rate 25600", "python", "my_daq.py --rate 25600"),
            (
                r#""C:\Program Files\Py\python.exe" "my daq.py" -x"#,
                r"C:\Program Files\Py\python.exe",
                r#""my daq.py" -x"#,
            ),
            (r"  C:\daq.exe  ", r"C:\daq.exe", ""),
            ("py\t-3 a.py", "py", "-3 a.py"),
        ] {
            assert_eq!(program_and_arguments(line), Ok((program, arguments)), "{line}");
        }
        assert!(
            program_and_arguments(r#""C:\Program Files\a.exe -x"#).expect_err("open").contains("quotation")
        );
        assert!(program_and_arguments(r#""" -x"#).expect_err("none").contains("no program"));
    }
}
