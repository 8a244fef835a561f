//! How often stated intervals cover the truth, over many campaigns, and the tables of
//! `docs/accuracy.md` with the counts.

/// One estimate compared with the truth.
#[derive(Debug, Clone, Copy)]
pub struct Answer {
    /// Relative error.
    pub error: f64,
    /// Half width of the 95 % interval, relative.
    pub half: f64,
    /// Whether the interval covers the truth.
    pub covers: bool,
}

impl Answer {
    /// From a value with its interval.
    pub fn new(mean: f64, [low, high]: [f64; 2], truth: f64) -> Self {
        Answer {
            error: mean / truth - 1.0,
            half: 0.5 * (high - low) / mean,
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
        let share = 100.0 * *covered as f64 / (*answers).max(1) as f64;
        let [rms, half] = [self.rms, self.half].map(|part| 100.0 * part);
        format!("{covered} of {answers} ({share:.1} %) | {rms:.2} % | {half:.2} %")
    }
}

/// Column headings of [`Coverage::cells`].
pub const COLUMNS: &str = "covered | rms error | half width (median)";

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
