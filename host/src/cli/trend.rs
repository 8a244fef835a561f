//! `trend`: a quantity of several campaigns over time, temperature, load or any column of a table,
//! and how much it varies between reassemblies.

use super::analyse::analysed;
use super::error::CliError;
use super::output;
use super::output::positive;
use crate::analyse::Wanted;
use crate::campaign::store::Store;
use crate::contact::Interval;
use crate::exchange::study_table::{StudyTable, read_study};
use crate::exchange::tables_output::write_rows;
use crate::report;
use crate::study::{Observation, Trend, trend};
use crate::substructuring::joint_over_bands::NORMAL_95;
use crate::untrusted_input;
use crate::untrusted_text::tell_line;
use clap::{Args, ValueEnum};
use jiff::Timestamp;
use serde::Serialize;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Largest results.json, bytes: with all curves, that of the paper's campaign has 15 MB.
const MOST_BYTES: u64 = 1 << 30;

/// Causes of k_T's uncertainty that differ between campaigns of one rig. The others (spots, points,
/// gains, skew, axes of sensors, bending) are the same in all of them: they move the level, not the
/// differences.
const OWN_CAUSES: [&str; 4] = ["noise", "aim", "drift", "misfit"];

/// A day, s.
const DAY_S: f64 = 86_400.0;

/// Fit how a quantity of several campaigns depends on time, temperature or a column of a table, and
/// how much it varies between reassemblies.
///
/// FILES are campaigns (.jrig, analysed now), or the results.json of campaigns of one rig. What the
/// model assumes is in docs/studies.md.
#[derive(Debug, Args)]
pub struct TrendArgs {
    /// Campaigns (.jrig), or their results.json.
    #[arg(value_name = "FILES", required = true)]
    files: Vec<PathBuf>,
    /// The quantity.
    #[arg(long, value_enum, default_value_t = Quantity::KT)]
    of: Quantity,
    /// The covariate: `time` (days since the first campaign), `temperature` (°C), or a column of
    /// --table [default: none, the level and its scatter only].
    #[arg(long, value_name = "COVARIATE")]
    against: Option<String>,
    /// A csv table with the column `file` (name of the campaign file) and one column for each
    /// covariate.
    #[arg(long, value_name = "TABLE.csv")]
    table: Option<PathBuf>,
    /// The column of --table that names the reassembly [default: each campaign is one of its own].
    #[arg(long, value_name = "COLUMN", requires = "table")]
    reassembly: Option<String>,
    /// Fit a power law: the quantity is proportional to a power of the covariate.
    #[arg(long, requires = "against")]
    power_law: bool,
    /// How far, %, the mean may be off with 95 %: prints how many reassemblies that needs.
    #[arg(long, value_name = "PERCENT", default_value_t = 3.0, value_parser = positive)]
    within: f64,
    /// Folder for trend.json and trend.csv; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print trend.json on stdout.
    #[arg(long)]
    json: bool,
}

/// A quantity of each campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Quantity {
    /// The contact's stiffness k_T, N/m.
    #[value(name = "k-t")]
    KT,
    /// The contact's damping c_T, N s/m.
    #[value(name = "c-t")]
    CT,
    /// The stiffness between the arms, N/m.
    #[value(name = "between-arms")]
    BetweenArms,
}

impl Quantity {
    fn pointer(self) -> &'static str {
        match self {
            Quantity::KT => "/answer/contact/k_t_n_per_m",
            Quantity::CT => "/answer/contact/c_t_n_s_per_m",
            Quantity::BetweenArms => "/answer/between_arms/k_n_per_m",
        }
    }

    /// Its field in the files, with the unit.
    fn field(self) -> &'static str {
        match self {
            Quantity::KT => "k_t_n_per_m",
            Quantity::CT => "c_t_n_s_per_m",
            Quantity::BetweenArms => "between_arms_n_per_m",
        }
    }

    fn symbol(self) -> &'static str {
        match self {
            Quantity::KT => "k_T",
            Quantity::CT => "c_T",
            Quantity::BetweenArms => "k between the arms",
        }
    }

    fn shown(self, value: f64) -> String {
        match self {
            Quantity::KT | Quantity::BetweenArms => format!("{:.2} N/µm", 1e-6 * value),
            Quantity::CT => format!("{value:.1} N s/m"),
        }
    }
}

/// One campaign of the study.
#[derive(Debug, Clone, Serialize)]
struct CampaignOfStudy {
    /// Name of the campaign file.
    file: String,
    /// The quantity with its interval.
    value: Interval,
    /// The covariate.
    covariate: Option<f64>,
    /// The reassembly.
    reassembly: Option<String>,
    /// Relative standard deviation of its own error.
    own_std: f64,
    /// Relative standard deviation of the error that it shares with the others.
    shared_std: f64,
}

/// trend.json. Standard deviations and changes are relative (of the logarithm).
#[derive(Serialize)]
struct TrendDocument<'a> {
    quantity: &'static str,
    against: Option<&'a str>,
    power_law: bool,
    /// The level at the covariate's mean (for a power law, its geometric mean).
    level: Interval,
    at: Option<f64>,
    /// Relative change per unit of the covariate; for a power law, the exponent.
    slope: Option<Interval>,
    /// Relative change over the range of the covariate.
    change: Option<Interval>,
    /// Whether the quantity depends on the covariate; null if it has none, or too few values.
    depends: Option<bool>,
    /// Relative standard deviation between reassemblies.
    between: Option<Interval>,
    /// Relative standard deviation within a reassembly.
    within: Option<Interval>,
    /// Relative standard deviation of the error that all campaigns share.
    shared_std: f64,
    /// Reassemblies of as many campaigns as here, for a mean within ± `within_percent`; null if
    /// what all share prevents it.
    reassemblies_needed: Option<usize>,
    within_percent: f64,
    campaigns: &'a [CampaignOfStudy],
    /// Files that are left out, each with the reason.
    left_out: &'a BTreeMap<String, String>,
}

impl TrendArgs {
    pub fn run(self) -> Result<(), CliError> {
        let table = self.table.as_deref().map(read_study).transpose();
        let table = table.map_err(|error| CliError::Bad(error.to_string()))?;
        let mut left_out = BTreeMap::new();
        let mut campaigns = Vec::new();
        let mut started = Vec::new();
        let mut given = BTreeSet::new();
        for path in &self.files {
            let results = results_of(path)?;
            let name = name_of(path, &results);
            let begun = started_at(&results);
            // twice the same campaign would count as two independent ones
            if !given.insert((name.clone(), begun)) {
                return Err(CliError::Bad(format!(
                    "{}: the campaign {name} is given twice: leave one of them out",
                    path.display()
                )));
            }
            match self.campaign(&name, &results, table.as_ref()) {
                Ok(one) => {
                    campaigns.push(one);
                    started.push(begun);
                }
                Err(why) => {
                    tell_line!("jointrig: left out: {name}: {why}");
                    left_out.insert(name, why);
                }
            }
        }
        if self.against.as_deref() == Some("time") {
            let first = started.iter().flatten().min().copied();
            for (one, started) in campaigns.iter_mut().zip(&started) {
                let (Some(first), Some(started)) = (first, started) else {
                    return Err(CliError::Bad(format!(
                        "{}: it does not state when it was started: give the time as a column of --table",
                        one.file
                    )));
                };
                one.covariate = Some(started.duration_since(first).as_secs_f64() / DAY_S);
            }
        }
        let observations = self.observations(&campaigns)?;
        let shared = campaigns.iter().map(|one| one.shared_std).fold(0.0, f64::max);
        let found = trend(&observations, shared).map_err(|error| CliError::Bad(format!("trend: {error}")))?;
        let document = self.document(&found, &observations, shared, &campaigns, &left_out);
        if let Some(folder) = &self.out {
            self.write(folder, &document, &found, &observations)?;
        }
        if self.json { output::json(&document) } else { output::lines(self.lines(&document)) }
    }

    fn campaign(
        &self,
        name: &str,
        results: &Value,
        table: Option<&StudyTable>,
    ) -> Result<CampaignOfStudy, String> {
        let found = results.pointer(self.of.pointer()).filter(|value| !value.is_null());
        let Some(found) = found else {
            let why = results.pointer("/answer/contact/why").and_then(Value::as_str).unwrap_or("no answer");
            return Err(format!("it has no {}: {why}", self.of.symbol()));
        };
        let number = |at: &str| found.pointer(at).and_then(Value::as_f64);
        let value = match [number("/mean"), number("/ci95/0"), number("/ci95/1")] {
            [Some(mean), Some(low), Some(high)] if low > 0.0 && mean > 0.0 && high.is_finite() => {
                Interval { mean, ci95: [low, high] }
            }
            _ => {
                return Err(format!(
                    "the interval of its {} is not finite and above zero: a relative change cannot be computed",
                    self.of.symbol()
                ));
            }
        };
        let std = (value.ci95[1] / value.ci95[0]).ln() / (2.0 * NORMAL_95);
        let own = own_part(results).filter(|_| self.of == Quantity::KT).unwrap_or(1.0);
        let row = table.map(|table| table.row(name)).transpose()?;
        let covariate = match self.against.as_deref() {
            None | Some("time") => None,
            Some("temperature") => Some(
                results
                    .pointer("/source/temperature_c/1")
                    .and_then(Value::as_f64)
                    .ok_or("its controller measured no temperature: give it as a column of --table")?,
            ),
            Some(column) => {
                let row = row.as_ref().ok_or_else(|| {
                    format!("`{column}` is neither `time` nor `temperature`: give a --table that has it")
                })?;
                Some(row.number(column)?)
            }
        };
        let reassembly = match (&self.reassembly, &row) {
            (Some(column), Some(row)) => Some(row.text(column)?.to_owned()),
            _ => None,
        };
        Ok(CampaignOfStudy {
            file: name.into(),
            value,
            covariate,
            reassembly,
            own_std: std * own.sqrt(),
            shared_std: std * (1.0 - own).max(0.0).sqrt(),
        })
    }

    fn observations(&self, campaigns: &[CampaignOfStudy]) -> Result<Vec<Observation>, CliError> {
        let mut groups: BTreeMap<&str, usize> = BTreeMap::new();
        let mut observations = Vec::new();
        for (number, one) in campaigns.iter().enumerate() {
            let next = groups.len();
            let group = match one.reassembly.as_deref() {
                Some(name) => *groups.entry(name).or_insert(next),
                None => number,
            };
            let covariate = match (one.covariate, self.power_law) {
                (Some(x), true) if x <= 0.0 => {
                    return Err(CliError::Bad(format!(
                        "{}: its covariate is {x}: a power law needs values over 0",
                        one.file
                    )));
                }
                (Some(x), true) => x.ln(),
                (Some(x), false) => x,
                (None, _) => 0.0,
            };
            let variance = one.own_std * one.own_std;
            observations.push(Observation { value: one.value.mean.ln(), variance, covariate, group });
        }
        Ok(observations)
    }

    fn document<'a>(
        &'a self,
        found: &Trend,
        observations: &[Observation],
        shared_std: f64,
        campaigns: &'a [CampaignOfStudy],
        left_out: &'a BTreeMap<String, String>,
    ) -> TrendDocument<'a> {
        let covariates = || observations.iter().map(|one| one.covariate);
        let range =
            covariates().fold(f64::NEG_INFINITY, f64::max) - covariates().fold(f64::INFINITY, f64::min);
        let each = (found.campaigns as f64 / found.groups as f64).round() as usize;
        TrendDocument {
            quantity: self.of.field(),
            against: self.against.as_deref(),
            power_law: self.power_law,
            level: exponential(found.level),
            at: self.against.is_some().then(|| if self.power_law { found.at.exp() } else { found.at }),
            slope: found.slope,
            change: found.slope.map(|slope| {
                let over = |slope: f64| (slope * range).exp_m1();
                Interval { mean: over(slope.mean), ci95: slope.ci95.map(over) }
            }),
            depends: found.found(),
            between: found.between,
            within: found.within,
            shared_std,
            reassemblies_needed: found.reassemblies_for((1.0 + 0.01 * self.within).ln(), each),
            within_percent: self.within,
            campaigns,
            left_out,
        }
    }

    fn write(
        &self,
        folder: &Path,
        document: &TrendDocument<'_>,
        found: &Trend,
        observations: &[Observation],
    ) -> Result<(), CliError> {
        let failed = |doing| move |source| CliError::File { path: folder.into(), doing, source };
        std::fs::create_dir_all(folder).map_err(failed("making the folder"))?;
        let text = serde_json::to_string_pretty(document)
            .map_err(|error| CliError::Bad(format!("trend.json could not be written: {error}")))?;
        report::write_whole(&folder.join("trend.json"), (text + "\n").as_bytes())
            .map_err(failed("writing trend.json"))?;
        let field = self.of.field();
        let mut rows = vec![vec![
            "file".to_owned(),
            "reassembly".to_owned(),
            self.against.clone().unwrap_or_else(|| "covariate".to_owned()),
            field.to_owned(),
            "low".to_owned(),
            "high".to_owned(),
            "trend".to_owned(),
            "trend_low".to_owned(),
            "trend_high".to_owned(),
        ]];
        for (one, observation) in document.campaigns.iter().zip(observations) {
            let line = exponential(found.line(observation.covariate));
            let numbers = [&one.value, &line].map(|of| [of.mean, of.ci95[0], of.ci95[1]]);
            let mut row = vec![
                one.file.clone(),
                one.reassembly.clone().unwrap_or_default(),
                one.covariate.map(|x| x.to_string()).unwrap_or_default(),
            ];
            row.extend(numbers.as_flattened().iter().map(f64::to_string));
            rows.push(row);
        }
        write_rows(&folder.join("trend.csv"), &rows).map_err(|error| CliError::Bad(error.to_string()))?;
        tell_line!("jointrig: {}: trend.json, trend.csv", folder.display());
        Ok(())
    }

    fn lines(&self, document: &TrendDocument<'_>) -> Vec<String> {
        let of = self.of;
        let [low, high] = document.level.ci95;
        let at = match (document.against, document.at) {
            (Some(name), Some(at)) => format!(" at {name} {at:.4}"),
            _ => String::new(),
        };
        let mut lines = vec![format!(
            "{}{at}: {} ({} to {}), from {} campaigns",
            of.symbol(),
            of.shown(document.level.mean),
            of.shown(low),
            of.shown(high),
            document.campaigns.len()
        )];
        let percent = |of: Interval| {
            let [mean, low, high] = [of.mean, of.ci95[0], of.ci95[1]].map(|v| format!("{:+.2}", 100.0 * v));
            format!("{mean} % ({low} to {high})")
        };
        if let (Some(name), None) = (document.against, document.slope) {
            lines.push(format!("dependence on {name}: too few different values of it; three are needed"));
        }
        if let (Some(name), Some(slope), Some(change)) = (document.against, document.slope, document.change) {
            let [low, high] = slope.ci95;
            lines.push(if document.power_law {
                format!("proportional to {name} to the power {:.3} ({low:.3} to {high:.3})", slope.mean)
            } else {
                format!("change per unit of {name}: {}", percent(slope))
            });
            let largest = change.ci95[0].abs().max(change.ci95[1].abs());
            lines.push(if document.depends == Some(true) {
                format!("over the campaigns it changes by {}", percent(change))
            } else {
                format!("no change found; over the campaigns it is below {:.2} % with 95 %", 100.0 * largest)
            });
        }
        let scatter = |of: Interval| {
            let [mean, low, high] = [of.mean, of.ci95[0], of.ci95[1]].map(|v| format!("{:.2}", 100.0 * v));
            format!("{mean} % ({low} to {high})")
        };
        if let Some(between) = document.between {
            let what = if document.within.is_some() || self.reassembly.is_some() {
                "standard deviation between reassemblies"
            } else {
                "standard deviation between campaigns, beyond their own errors"
            };
            lines.push(format!("{what}: {}", scatter(between)));
        }
        if let Some(within) = document.within {
            lines.push(format!("standard deviation within a reassembly: {}", scatter(within)));
        }
        lines.push(format!(
            "error that all campaigns share (spots, gains, points): {:.2} %",
            100.0 * document.shared_std
        ));
        lines.push(match document.reassemblies_needed {
            Some(needed) => format!("for a mean within ± {} %: {needed} reassemblies", self.within),
            None => format!(
                "a mean within ± {} % is out of reach: what all campaigns share prevents it, or more than a thousand reassemblies are needed",
                self.within
            ),
        });
        lines
    }
}

fn exponential(of: Interval) -> Interval {
    Interval { mean: of.mean.exp(), ci95: of.ci95.map(f64::exp) }
}

/// Fraction of k_T's variance that is the campaign's own; `None` without a budget.
fn own_part(results: &Value) -> Option<f64> {
    let budget = results.pointer("/answer/contact/budget")?.as_object()?;
    let squares = |own: bool| -> f64 {
        budget
            .iter()
            .filter(|(cause, _)| !own || OWN_CAUSES.contains(&cause.as_str()))
            .filter_map(|(_, std)| std.as_f64())
            .map(|std| std * std)
            .sum()
    };
    let all = squares(false);
    (all > 0.0).then(|| squares(true) / all)
}

/// The results of a campaign, or those of its results.json.
fn results_of(path: &Path) -> Result<Value, CliError> {
    if path.extension().is_some_and(|ending| ending == "json") {
        let text = untrusted_input::text(path, MOST_BYTES).map_err(|source| CliError::Read {
            path: path.into(),
            doing: "reading",
            source,
        })?;
        let results: Value = serde_json::from_str(&text).map_err(|error| {
            CliError::Bad(format!("{}: {error}: this is no results.json", path.display()))
        })?;
        if results.pointer("/source/kind").and_then(Value::as_str) != Some("campaign") {
            return Err(CliError::Bad(format!(
                "{}: it is not the results.json of a campaign: write one with `jointrig analyse`",
                path.display()
            )));
        }
        return Ok(results);
    }
    let results = analysed(&Store::open_read_only(path)?, Wanted::default())?;
    serde_json::to_value(&results)
        .map_err(|error| CliError::Bad(format!("{}: its results cannot be used: {error}", path.display())))
}

/// Name of the campaign file.
fn name_of(path: &Path, results: &Value) -> String {
    let stated = results.pointer("/source/file").and_then(Value::as_str);
    stated.map_or_else(
        || path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned(),
        Into::into,
    )
}

fn started_at(results: &Value) -> Option<Timestamp> {
    results.pointer("/source/started").and_then(Value::as_str)?.parse().ok()
}
