//! A row of the table: our time compared with a peer's and with the minimum that this machine
//! needs.

use std::fmt::Write;
use std::time::{Duration, Instant};

/// Minimum number of runs of each side. The fastest counts, because other load on the machine can
/// only add to a time.
pub const RUNS: usize = 15;

/// Minimum duration of the runs: on a virtual machine, load from others that share the cache can
/// last some seconds.
pub const SPELL: Duration = Duration::from_secs(15);

/// One kind of work, and the time that each side needs.
pub struct Row {
    /// Description and size of the work.
    pub work: String,
    /// Our fastest run, s.
    pub ours_s: f64,
    /// The program that laboratories use for it; `None` without Python, or if there is none.
    pub peer: Option<Other>,
    /// The minimum that any program needs.
    pub limit: Option<Other>,
}

/// The other side of a ratio.
pub struct Other {
    /// Its name.
    pub name: String,
    /// Its fastest run, s.
    pub seconds: f64,
    /// Target: for a peer, how many times as fast we must be; for a limit, how many times its time
    /// we may take.
    pub wanted: Option<f64>,
}

impl Row {
    /// A row with our time only.
    pub fn of(work: impl Into<String>, ours_s: f64) -> Self {
        Row { work: work.into(), ours_s, peer: None, limit: None }
    }

    /// Adds the comparison with a peer, if it was run.
    #[must_use]
    pub fn beside(mut self, name: &str, seconds: Option<f64>, wanted: f64) -> Self {
        self.peer = seconds.map(|seconds| Other { name: name.into(), seconds, wanted: Some(wanted) });
        self
    }

    /// Adds the comparison with the limit.
    #[must_use]
    pub fn against(mut self, name: &str, seconds: f64, wanted: Option<f64>) -> Self {
        self.limit = Some(Other { name: name.into(), seconds, wanted });
        self
    }

    /// Messages about what is slower than its target.
    pub fn short(&self) -> Vec<String> {
        let mut short = Vec::new();
        if let Some(Other { name, seconds, wanted: Some(wanted) }) = &self.peer {
            let ratio = seconds / self.ours_s;
            if ratio.is_nan() || ratio < *wanted {
                short.push(format!("{}: {ratio:.2} times as fast as {name}, wanted {wanted}", self.work));
            }
        }
        if let Some(Other { name, seconds, wanted: Some(wanted) }) = &self.limit {
            let ratio = self.ours_s / seconds;
            if ratio.is_nan() || ratio > *wanted {
                short.push(format!("{}: {ratio:.2} times the time of {name}, wanted {wanted}", self.work));
            }
        }
        short
    }
}

/// The table in Markdown.
pub fn table(rows: &[Row]) -> String {
    let mut text = String::from(
        "| work | ours, s | peer | its time, s | times as fast | wanted | limit | its time, s | times as long | allowed |\n\
         |---|---:|---|---:|---:|---:|---|---:|---:|---:|\n",
    );
    let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
    for row in rows {
        let peer = row.peer.as_ref().map_or(" | | | ".into(), |Other { name, seconds, wanted }| {
            format!("{name} | {} | {:.1} | {}", brief(*seconds), seconds / row.ours_s, number(*wanted))
        });
        let limit = row.limit.as_ref().map_or(" | | | ".into(), |Other { name, seconds, wanted }| {
            format!("{name} | {} | {:.2} | {}", brief(*seconds), row.ours_s / seconds, number(*wanted))
        });
        // writing to a string cannot fail
        let _ = writeln!(text, "| {} | {} | {peer} | {limit} |", row.work, brief(row.ours_s));
    }
    text
}

/// Formats seconds with three digits.
pub fn brief(seconds: f64) -> String {
    let digits = (2 - seconds.abs().log10().floor() as i32).clamp(0, 6) as usize;
    format!("{seconds:.digits$}")
}

/// The fastest run of each job, s, in order. The jobs alternate, so that temporary load on the
/// machine affects all of them.
pub fn quickest<const N: usize>(runs: usize, mut jobs: [&mut dyn FnMut(); N]) -> [f64; N] {
    let mut best = [f64::INFINITY; N];
    in_turns(runs, N, |job| {
        let start = Instant::now();
        jobs[job]();
        best[job] = best[job].min(start.elapsed().as_secs_f64());
    });
    best
}

/// Calls `run` with the number of each job in turn, at least `runs` times and for at least
/// [`SPELL`].
pub fn in_turns(runs: usize, jobs: usize, mut run: impl FnMut(usize)) {
    let begun = Instant::now();
    let mut done = 0;
    while done < runs || begun.elapsed() < SPELL {
        (0..jobs).for_each(&mut run);
        done += 1;
    }
}
