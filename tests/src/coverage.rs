//! How often stated intervals cover the truth, over many campaigns, and the tables of
//! `docs/accuracy.md` with the counts.

/// One estimate compared with the truth.
#[derive(Debug, Clone, Copy)]
pub struct Answer {
    /// Relative error.
    pub error: f64,
    /// Half width of the 95 % interval, relative.
    pub half: f64,
    /// Error over stated standard deviation, both of the compliance, whose interval is symmetric;
    /// positive if too stiff.
    pub z: f64,
    /// Interval score relative to the truth: the interval's width, and 40 times the distance by
    /// which it misses the truth.
    pub score: f64,
    /// Whether the interval covers the truth.
    pub covers: bool,
}

impl Answer {
    /// From a value with its interval.
    pub fn new(mean: f64, [low, high]: [f64; 2], truth: f64) -> Self {
        Answer {
            error: mean / truth - 1.0,
            half: 0.5 * (high - low) / mean,
            z: 2.0 * 1.96 * (truth.recip() - mean.recip()) / (low.recip() - high.recip()),
            score: (high - low + 40.0 * ((low - truth).max(0.0) + (truth - high).max(0.0))) / truth,
            covers: low <= truth && truth <= high,
        }
    }
}

/// Statistics of many estimates.
#[derive(Debug, Clone, Copy)]
pub struct Coverage {
    /// Number of estimates.
    pub answers: usize,
    /// Number of estimates whose interval covers the truth.
    pub covered: usize,
    /// Root mean square of the errors, relative; 0 if there are no estimates.
    pub rms: f64,
    /// Median half width, relative; NaN if there are no estimates.
    pub half: f64,
}

impl Coverage {
    /// Statistics of these estimates.
    pub fn of(all: &[Answer]) -> Self {
        let errors: Vec<f64> = all.iter().map(|answer| answer.error).collect();
        let mut half: Vec<f64> = all.iter().map(|answer| answer.half).collect();
        half.sort_by(f64::total_cmp);
        Coverage {
            answers: all.len(),
            covered: all.iter().filter(|answer| answer.covers).count(),
            rms: rms(&errors),
            half: half.get(half.len() / 2).copied().unwrap_or(f64::NAN),
        }
    }

    /// As cells of a table: number of intervals that cover, rms error, median half width.
    pub fn cells(&self) -> String {
        let Coverage { answers, covered, .. } = self;
        if *answers == 0 {
            return "0 of 0 | – | –".into();
        }
        let share = 100.0 * *covered as f64 / *answers as f64;
        let [rms, half] = [self.rms, self.half].map(|part| 100.0 * part);
        format!("{covered} of {answers} ({share:.1} %) | {rms:.2} % | {half:.2} %")
    }
}

/// Column headings of [`Coverage::cells`].
pub const COLUMNS: &str = "covered | rms error | half width (median)";

/// How well the stated uncertainty describes the errors.
#[derive(Debug, Clone, Copy)]
pub struct Quality {
    /// Exact 95 % interval of the coverage (Clopper and Pearson).
    pub coverage: [f64; 2],
    /// Mean of the errors over their stated standard deviations.
    pub mean: f64,
    /// Their root mean square.
    pub rms: f64,
    /// Mean interval score.
    pub score: f64,
}

/// Column headings of [`Quality::cells`].
pub const QUALITY_COLUMNS: &str = "coverage, exact 95 % | mean z | rms z | interval score";

impl Quality {
    /// Statistics of these estimates.
    pub fn of(all: &[Answer]) -> Self {
        let n = all.len().max(1) as f64;
        let z: Vec<f64> = all.iter().map(|answer| answer.z).collect();
        Quality {
            coverage: clopper_pearson(all.iter().filter(|answer| answer.covers).count(), all.len()),
            mean: z.iter().sum::<f64>() / n,
            rms: rms(&z),
            score: all.iter().map(|answer| answer.score).sum::<f64>() / n,
        }
    }

    /// As cells of a table.
    pub fn cells(&self) -> String {
        let [low, high] = self.coverage.map(|part| 100.0 * part);
        let (mean, rms, score) = (self.mean, self.rms, 100.0 * self.score);
        format!("{low:.0}–{high:.0} % | {mean:+.2} | {rms:.2} | {score:.1} %")
    }
}

/// Exact 95 % interval of a probability from `hits` of `all`: at its ends as many hits or more,
/// or as few or fewer, have a probability of 2.5 %.
fn clopper_pearson(hits: usize, all: usize) -> [f64; 2] {
    // P(at most k of n), by logarithms because (1 − p)ⁿ may be smaller than any number
    let at_most = |k: usize, p: f64| -> f64 {
        let mut logarithm = all as f64 * (-p).ln_1p();
        let mut sum = logarithm.exp();
        for i in 1..=k {
            logarithm += ((all + 1 - i) as f64 / i as f64).ln() + p.ln() - (-p).ln_1p();
            sum += logarithm.exp();
        }
        sum
    };
    // where a falling function crosses a value
    let crossed = |of: &dyn Fn(f64) -> f64, value: f64| {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if of(middle) > value { low = middle } else { high = middle }
        }
        low
    };
    [
        if hits == 0 { 0.0 } else { crossed(&|p| at_most(hits - 1, p), 0.975) },
        if hits == all { 1.0 } else { crossed(&|p| at_most(hits, p), 0.025) },
    ]
}

/// How many of these lie in each tenth of the standard normal distribution: evenly many if the
/// stated uncertainty is right.
pub fn tenths(z: &[f64]) -> [usize; 10] {
    // its deciles
    let ends = [-1.2816, -0.8416, -0.5244, -0.2533, 0.0, 0.2533, 0.5244, 0.8416, 1.2816];
    let mut counts = [0; 10];
    for z in z {
        counts[ends.partition_point(|end| end < z)] += 1;
    }
    counts
}

/// Root mean square; 0 if there are none.
pub fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len().max(1) as f64).sqrt()
}

/// Prints a table in the form that `cargo xtask accuracy` reads. `columns` are the column names,
/// separated by ` | `.
pub fn print_table(name: &str, columns: &str, rows: &[String]) {
    let rule = "---|".repeat(columns.split(" | ").count());
    println!("table: {name}\n| {columns} |\n|{rule}\n{}\n", rows.join("\n"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stated_uncertainties_are_judged() {
        // tables of the binomial distribution
        for (hits, all, low, high) in
            [(8, 10, 0.4439, 0.9748), (0, 10, 0.0, 0.3085), (190, 200, 0.9100, 0.9758)]
        {
            let found = clopper_pearson(hits, all);
            assert!(
                (found[0] - low).abs() < 2e-4 && (found[1] - high).abs() < 2e-4,
                "{hits} {all} {found:?}"
            );
        }
        // a compliance of 1/100 with a standard deviation of 1e-4, off by two of them
        let interval = [100.0 / 1.0196, 100.0 / (1.0 - 0.0196)];
        let off = Answer::new(100.0, interval, 100.0 / 1.02);
        assert!((off.z - 2.0).abs() < 1e-9 && !off.covers, "{off:?}");
        let missed = (interval[0] - 100.0 / 1.02) / (100.0 / 1.02);
        let width = (interval[1] - interval[0]) / (100.0 / 1.02);
        assert!((off.score - width - 40.0 * missed).abs() < 1e-9, "{off:?}");
        assert_eq!(tenths(&[-3.0, -0.1, 0.1, 3.0]), [1, 0, 0, 0, 1, 1, 0, 0, 0, 1]);
    }

    #[test]
    fn answers_are_counted() {
        let all = [(101.0, [98.0, 104.0]), (97.0, [96.0, 98.0]), (100.0, [99.0, 101.0])];
        let all = all.map(|(mean, interval)| Answer::new(mean, interval, 100.0));
        let Coverage { answers, covered, rms, half } = Coverage::of(&all);
        assert_eq!((answers, covered), (3, 2));
        assert!((rms - (10.0_f64 / 3.0).sqrt() * 1e-2).abs() < 1e-12 && (half - 1.0 / 97.0).abs() < 1e-12);
        assert_eq!(Coverage::of(&all).cells(), "2 of 3 (66.7 %) | 1.83 % | 1.03 %");
        let none = Coverage::of(&[]);
        assert!(none.answers == 0 && none.rms == 0.0 && none.half.is_nan());
    }
}
