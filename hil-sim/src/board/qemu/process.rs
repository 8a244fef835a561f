//! The QEMU process: started with the shared memory and two pipes, and always stopped.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::QemuError;
use super::shared_ram::{self, SharedRam};

/// The emulator of 32-bit Arm machines.
pub const PROGRAM: &str = "qemu-system-arm";
/// Time limit for QEMU to end by itself.
const END_LIMIT: Duration = Duration::from_secs(5);

/// The pipes that hand the turn over, one per direction.
pub struct Pipes {
    /// A byte from the board: this side's turn.
    pub ring: ChildStdout,
    /// A byte to the board: the board's turn.
    pub answer: ChildStdin,
}

/// The process.
pub struct Emulator {
    child: Mutex<Child>,
    id: u32,
    complaints: Arc<Mutex<String>>,
}

impl Emulator {
    /// Starts QEMU with this image; `uart` is the target of UART 0, which is then the board's link.
    pub fn start(image: &Path, uart: Option<&str>) -> Result<(Self, Pipes, SharedRam), QemuError> {
        let memory = |source| QemuError::Memory { folder: shared_ram::folder(), source };
        let ram = SharedRam::create().map_err(memory)?;
        let path = ram.path().map(|path| path.display().to_string()).unwrap_or_default();
        let argument = if uart.is_some() { ",arg=uart" } else { "" };
        let mut command = Command::new(PROGRAM);
        command
            .args(["-M", "mps2-an505,memory-backend=r", "-display", "none", "-monitor", "none"])
            .args(["-serial", uart.unwrap_or("null")])
            .args(["-object", &format!("memory-backend-file,id=r,size=16M,mem-path={path},share=on")])
            .args(["-semihosting-config", &format!("enable=on,target=native,arg=serve{argument}")])
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut child = command.spawn().map_err(QemuError::NoEmulator)?;
        let (Some(answer), Some(ring), Some(errors)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err(QemuError::Start("its pipes were asked for, but are not there".into()));
        };
        let complaints = Arc::new(Mutex::new(String::new()));
        let listener = Arc::clone(&complaints);
        std::thread::Builder::new()
            .name("QEMU's complaints".into())
            .spawn(move || listen(errors, &listener))
            .map_err(QemuError::Thread)?;
        let id = child.id();
        Ok((Self { child: Mutex::new(child), id, complaints }, Pipes { ring, answer }, ram))
    }

    /// Its process id.
    pub fn id(&self) -> u32 {
        self.id
    }

    fn child(&self) -> MutexGuard<'_, Child> {
        self.child.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Stops it immediately.
    pub fn kill(&self) {
        let mut child = self.child();
        // both fail only when it has already ended
        let _ = child.kill();
        let _ = child.wait();
    }

    /// Waits until it and its server have ended, and stops it at the time limit.
    pub fn end(&self, served: impl Fn() -> bool) {
        let until = Instant::now() + END_LIMIT;
        while Instant::now() < until {
            if served() && !matches!(self.child().try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        self.kill();
    }

    /// `sentence` with the first line of QEMU's error output; the rest is in the log.
    pub fn explained(&self, sentence: String) -> String {
        self.kill();
        let complaints = self.complaints.lock().unwrap_or_else(PoisonError::into_inner);
        match complaints.lines().next() {
            Some(first) => format!("{sentence} ({first})"),
            None => sentence,
        }
    }
}

/// Logs QEMU's standard error and stores it.
fn listen(errors: ChildStderr, complaints: &Mutex<String>) {
    for line in BufReader::new(errors).lines().map_while(Result::ok) {
        log::warn!(target: "qemu", "{line}");
        let mut complaints = complaints.lock().unwrap_or_else(PoisonError::into_inner);
        if complaints.len() < 2_000 {
            complaints.push_str(&line);
            complaints.push('\n');
        }
    }
}
