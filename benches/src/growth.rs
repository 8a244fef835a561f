//! The same work at 1, 4 and 16 times the size: time and memory, and their exponents as powers of
//! the size.

use super::row::{RUNS, in_turns};
use peak_alloc::PeakAlloc;
use std::fmt::Write;
use std::time::Instant;

/// The largest exponent of time.
const TIME: f64 = 1.05;
/// Memory that does not grow with the size stays within this factor over the whole range; it is not
/// constant because the timing of threads varies.
const FLAT: f64 = 1.5;

/// Sizes, relative to the first.
pub const TIMES: [usize; 3] = [1, 4, 16];

/// Cost of one size.
#[derive(Clone, Copy)]
pub struct Cost {
    /// The fastest run, s.
    pub seconds: f64,
    /// Peak of the heap above the initial usage, MB.
    pub megabytes: f64,
}

/// Work measured at several sizes.
pub struct Growth {
    /// Description of the work, and of what grows.
    pub what: String,
    /// Costs at the sizes [`TIMES`].
    pub steps: [Cost; TIMES.len()],
    /// Whether memory must stay constant.
    pub flat_memory: bool,
}

/// The cost of the same job at each size, in a program whose allocator is `heap`. The sizes
/// alternate, so that a small one does not find its data in the processor's cache, and temporary
/// load on the machine affects all of them.
pub fn measured(heap: PeakAlloc, mut jobs: [impl FnMut(); TIMES.len()]) -> [Cost; TIMES.len()] {
    let mut costs = [Cost { seconds: f64::INFINITY, megabytes: f64::INFINITY }; TIMES.len()];
    in_turns(RUNS, jobs.len(), |job| {
        let cost = &mut costs[job];
        let before = heap.current_usage();
        heap.reset_peak_usage();
        let start = Instant::now();
        jobs[job]();
        cost.seconds = cost.seconds.min(start.elapsed().as_secs_f64());
        cost.megabytes = cost.megabytes.min((heap.peak_usage().saturating_sub(before)) as f64 / 1e6);
    });
    costs
}

impl Growth {
    fn exponent(&self, of: impl Fn(&Cost) -> f64) -> f64 {
        let [first, _, last] = &self.steps;
        (of(last) / of(first)).ln() / (TIMES[2] as f64).ln()
    }

    /// Messages about what grows faster than its limit.
    pub fn short(&self) -> Vec<String> {
        let (time, memory) = (self.exponent(|c| c.seconds), self.exponent(|c| c.megabytes));
        let mut short = Vec::new();
        if time.is_nan() || time > TIME {
            short.push(format!("{}: time grows with the power {time:.2}, wanted {TIME}", self.what));
        }
        if self.flat_memory && (TIMES[2] as f64).powf(memory) > FLAT {
            short.push(format!("{}: memory grows with the power {memory:.2}, and should not", self.what));
        }
        short
    }
}

/// The table in Markdown.
pub fn table(all: &[Growth]) -> String {
    let mut text = String::from(
        "| work | 1 × | 4 × | 16 × | exponent of time | exponent of memory |\n|---|---|---|---|---:|---:|\n",
    );
    for growth in all {
        let cells: Vec<String> = growth
            .steps
            .iter()
            .map(|cost| format!("{} s, {:.1} MB", super::row::brief(cost.seconds), cost.megabytes))
            .collect();
        let (time, memory) = (growth.exponent(|c| c.seconds), growth.exponent(|c| c.megabytes));
        // writing to a string cannot fail
        let _ = writeln!(text, "| {} | {} | {time:.2} | {memory:.2} |", growth.what, cells.join(" | "));
    }
    text
}
