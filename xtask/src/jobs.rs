//! Runs programs in parallel: the output of each is collected and shown when it ends.

use anyhow::{Context, Result, bail};
use std::collections::VecDeque;
use std::io::{Read, Write};
use std::num::NonZero;
use std::process::{Command, ExitStatus};
use std::sync::Mutex;
use std::time::{Duration, Instant};

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
pub fn run(jobs: Vec<Job>, at_once: usize, shown: &mut (impl Write + Send)) -> Result<Vec<Ended>> {
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
        let ended = run(jobs, 2, &mut shown).expect("sh is there");
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
        let error = run(vec![job], 1, &mut Vec::new()).err().expect("it cannot be started");
        assert_eq!(error.to_string(), "could not start nothing");
    }
}
