//! Runs other programs. Singly: each command is printed before it runs, and an error names the
//! program, the directory and the exit code. In parallel: the output of each is collected and shown
//! when it ends.

use anyhow::{Context, Result, bail};
use std::collections::VecDeque;
use std::ffi::OsStr;
use std::io::{Read, Write};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Variables that `cargo run` sets about xtask's own package. If they were passed on, build scripts
/// of other packages that watch these variables would be rerun at every switch between plain cargo
/// and xtask.
const OWN_PACKAGE: [&str; 5] =
    ["CARGO_PKG_", "CARGO_MANIFEST_", "CARGO_BIN_NAME", "CARGO_CRATE_NAME", "CARGO_PRIMARY_PACKAGE"];

/// The cargo that started xtask, working in `directory`.
pub fn cargo(directory: &Path) -> Command {
    let mut command = without_own_package(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(directory);
    command
}

/// A command without the variables about xtask's own package.
pub fn without_own_package(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    for (name, _) in std::env::vars_os() {
        if name.to_str().is_some_and(|name| OWN_PACKAGE.iter().any(|prefix| name.starts_with(prefix))) {
            command.env_remove(name);
        }
    }
    command
}

/// Prints the command, runs it, and fails unless it exits with 0.
pub fn run(command: &mut Command) -> Result<()> {
    println!("  $ {}", line(command));
    let status = command.status().with_context(|| format!("could not start `{}`", line(command)))?;
    if !status.success() {
        bail!("`{}` failed ({status}){}", line(command), place(command));
    }
    Ok(())
}

/// Runs the command quietly and returns what it wrote to its standard output.
pub fn output(command: &mut Command) -> Result<String> {
    let output = command
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("could not start `{}`", line(command)))?;
    if !output.status.success() {
        bail!(
            "`{}` failed ({}){}:\n{}",
            line(command),
            output.status,
            place(command),
            String::from_utf8_lossy(&output.stderr).trim_end()
        );
    }
    String::from_utf8(output.stdout).with_context(|| format!("`{}` did not answer in UTF-8", line(command)))
}

/// The command as a user would type it, variables first; long paths to cargo and rustc are
/// shortened to their name.
pub fn line(command: &Command) -> String {
    let mut words = Vec::new();
    for (name, value) in command.get_envs() {
        if let Some(value) = value {
            words.push(format!("{}={}", name.to_string_lossy(), quoted(value)));
        }
    }
    let program = Path::new(command.get_program());
    words.push(quoted(program.file_name().unwrap_or(program.as_os_str())));
    words.extend(command.get_args().map(quoted));
    words.join(" ")
}

/// Path of `name` on PATH, if it exists and is executable.
pub fn find_program(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    std::env::split_paths(&path)
        .map(|directory| directory.join(format!("{name}{}", std::env::consts::EXE_SUFFIX)))
        .find(|candidate| is_executable(candidate))
}

/// Whether `path` leads to an executable file (a dangling link does not).
pub fn is_executable(path: &Path) -> bool {
    let Ok(metadata) = std::fs::metadata(path) else { return false };
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        metadata.is_file() && metadata.permissions().mode() & 0o111 != 0
    }
    #[cfg(not(unix))]
    metadata.is_file()
}

/// Makes a script executable.
pub fn make_executable(path: &Path) -> Result<()> {
    #[cfg(unix)]
    std::fs::set_permissions(path, std::os::unix::fs::PermissionsExt::from_mode(0o755))
        .with_context(|| format!("could not make {} executable", path.display()))?;
    #[cfg(not(unix))]
    bail!("{} is a shell script, which this system cannot run", path.display());
    #[cfg(unix)]
    Ok(())
}

/// Makes the symbolic link `at`, which leads to `to`.
pub fn symlink(to: &Path, at: &Path) -> Result<()> {
    #[cfg(unix)]
    let made = std::os::unix::fs::symlink(to, at);
    #[cfg(not(unix))]
    let made = Err(std::io::Error::from(std::io::ErrorKind::Unsupported));
    made.with_context(|| format!("could not link {} to {}", at.display(), to.display()))
}

fn place(command: &Command) -> String {
    command.get_current_dir().map(|directory| format!(" in {}", directory.display())).unwrap_or_default()
}

fn quoted(word: &OsStr) -> String {
    let word = word.to_string_lossy();
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.into_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// Maximum number of parallel programs: enough to use the processors while one waits, but not so
/// many that a test with a time limit is starved.
const AT_ONCE: usize = 4;

/// A program to run.
pub struct Job {
    /// Its name in the output.
    pub name: String,
    /// The command that starts it.
    pub command: Command,
}

/// Result of a job.
pub struct Ended {
    /// Its name.
    pub name: String,
    /// Its exit status.
    pub status: ExitStatus,
    /// All its output, stdout and stderr.
    pub output: Vec<u8>,
}

/// Number of jobs to run in parallel: at most the number of processors.
pub fn at_once() -> usize {
    std::thread::available_parallelism().map_or(1, NonZero::get).min(AT_ONCE)
}

/// Runs all jobs in order, `at_once` in parallel. If a job fails the others still run; an error
/// means that a job could not be started, or that output could not be shown.
pub fn run_all(jobs: Vec<Job>, at_once: usize, shown: &mut (impl Write + Send)) -> Result<Vec<Ended>> {
    let (number, begun) = (jobs.len(), Instant::now());
    let waiting = Mutex::new(VecDeque::from(jobs));
    let done = Mutex::new((Vec::new(), shown));
    let work = || -> Result<()> {
        loop {
            let Some(job) = waiting.lock().ok().and_then(|mut jobs| jobs.pop_front()) else { return Ok(()) };
            let start = Instant::now();
            let ended = finish(job)?;
            let Ok(mut done) = done.lock() else { bail!("another program's output could not be shown") };
            let (ended_so_far, shown) = &mut *done;
            report(&ended, start.elapsed(), [ended_so_far.len() + 1, number], *shown)
                .context("could not pass the output on")?;
            ended_so_far.push(ended);
        }
    };
    std::thread::scope(|scope| -> Result<()> {
        let workers: Vec<_> = (0..at_once.max(1)).map(|_| scope.spawn(work)).collect();
        workers
            .into_iter()
            .try_for_each(|worker| worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    })?;
    let (ended, shown) = done.into_inner().ok().context("a program's output could not be shown")?;
    writeln!(shown, "\n  {number} programs in {:.1} s, {at_once} at once", begun.elapsed().as_secs_f64())?;
    Ok(ended)
}

fn finish(mut job: Job) -> Result<Ended> {
    // One pipe for both streams, so that lines stay in the order in which they were written.
    let (mut reader, writer) = std::io::pipe().context("could not make a pipe")?;
    let other = writer.try_clone().context("could not make a pipe")?;
    let mut child = job
        .command
        .stdout(writer)
        .stderr(other)
        .spawn()
        .with_context(|| format!("could not start {}", job.name))?;
    // The command holds the write ends; after it is dropped, the reader reaches the end when the
    // child's are closed.
    drop(job.command);
    let mut output = Vec::new();
    reader.read_to_end(&mut output).with_context(|| format!("could not read the output of {}", job.name))?;
    let status = child.wait().with_context(|| format!("could not wait for {}", job.name))?;
    Ok(Ended { name: job.name, status, output })
}

fn report(ended: &Ended, time: Duration, [place, number]: [usize; 2], shown: &mut impl Write) -> Result<()> {
    let outcome = if ended.status.success() { "ok".to_owned() } else { format!("FAILED ({})", ended.status) };
    writeln!(shown, "\n  {} ({place} of {number}, {:.1} s): {outcome}", ended.name, time.as_secs_f64())?;
    shown.write_all(&ended.output)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shown_command_can_be_pasted_into_a_shell() {
        let mut command = Command::new("/somewhere/bin/cargo");
        command.env("RUSTDOCFLAGS", "-D warnings").args(["test", "it's here", ""]);
        assert_eq!(line(&command), r"RUSTDOCFLAGS='-D warnings' cargo test 'it'\''s here' ''");
    }

    #[test]
    fn a_failure_names_the_program_the_code_and_the_place() {
        let mut command = Command::new("sh");
        command.args(["-c", "exit 3"]).current_dir("/");
        let message = run(&mut command).expect_err("exit code 3 is a failure").to_string();
        assert!(
            message.contains("sh -c 'exit 3'") && message.contains('3') && message.ends_with("in /"),
            "{message}"
        );
    }

    #[test]
    fn cargo_does_not_inherit_what_describes_xtask_itself() {
        let command = cargo(Path::new("/"));
        let removed = command.get_envs().any(|(name, value)| name == "CARGO_MANIFEST_DIR" && value.is_none());
        assert_eq!(removed, std::env::var_os("CARGO_MANIFEST_DIR").is_some());
    }
}

#[cfg(test)]
mod jobs_tests {
    use super::*;

    fn shell(name: &str, script: &str) -> Job {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        Job { name: name.into(), command }
    }

    #[test]
    fn output_stays_whole_and_a_failure_stops_nobody() {
        let jobs = vec![
            shell("slow", "echo one; sleep 0.2; echo two >&2; echo three; exit 3"),
            shell("quick", "echo four"),
            shell("last", "echo five"),
        ];
        let mut shown = Vec::new();
        let ended = run_all(jobs, 2, &mut shown).expect("sh is there");
        let shown = String::from_utf8(shown).expect("text");
        assert!(shown.contains("FAILED (exit status: 3)\none\ntwo\nthree\n"), "{shown}");
        assert!(shown.contains("\n  quick (1 of 3, "), "{shown}");
        assert!(shown.contains("  3 programs in "), "{shown}");
        let mut names: Vec<_> = ended.iter().map(|ended| (&*ended.name, ended.status.success())).collect();
        names.sort_unstable();
        assert_eq!(names, [("last", true), ("quick", true), ("slow", false)]);
    }

    #[test]
    fn a_program_that_is_not_there_is_an_error() {
        let job = Job { name: "nothing".into(), command: Command::new("/nowhere/at-all") };
        let error = run_all(vec![job], 1, &mut Vec::new()).err().expect("it cannot be started");
        assert_eq!(error.to_string(), "could not start nothing");
    }
}
