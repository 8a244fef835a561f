//! `trend`: a quantity of several campaigns over time, temperature, load or any column of a table,
//! and how much it varies between reassemblies.

use super::analyse::analysed;
use super::error::CliError;
use super::output;
use super::output::positive;
use crate::analyse::Wanted;
use crate::campaign::store::Store;
use crate::contact::Interval;
#[cfg(feature = "parquet")]
use crate::exchange::parquet::write_table;
use crate::exchange::study_table::{StudyTable, read_study};
use crate::exchange::typed_table::{Kind, Table};
use crate::report;
use crate::report::words::trend_sentences::{sentences, shown_as};
use crate::results::{
    CampaignOfStudy, FittedForm, FittedPoint, FoundByCampaign, StudiedQuantity, TrendOverCampaigns,
};
use crate::structure::Structure;
use crate::study::{Dependence, Observation, Trend, trend};
use crate::substructuring::joint_over_bands::NORMAL_95;
use crate::untrusted_input;
use crate::untrusted_text::tell_line;
use clap::Args;
use jiff::Timestamp;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// Largest results.json, bytes: with all curves, that of the paper's campaign has 15 MB.
const MOST_BYTES: u64 = 1 << 30;

/// Causes of k_T's uncertainty that differ between campaigns of one rig. The others (spots, points,
/// gains, skew, axes of sensors, bending) are the same in all of them: they move the level, not the
/// differences.
const OWN_CAUSES: [&str; 4] = ["noise", "aim", "drift", "misfit"];

/// A day, s.
const DAY_S: f64 = 86_400.0;

/// Points of the fitted line or curve.
const FITTED: usize = 101;

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
    #[arg(long, value_enum, default_value_t = StudiedQuantity::KT)]
    of: StudiedQuantity,
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
    /// Fit a smooth curve instead of a line: a natural cubic spline with four knots. It needs six
    /// different values of the covariate.
    #[arg(long, requires = "against", conflicts_with = "power_law")]
    curve: bool,
    /// How far, %, the mean may be off with 95 %: prints how many reassemblies that needs.
    #[arg(long, value_name = "PERCENT", default_value_t = 3.0, value_parser = positive)]
    within: f64,
    /// Folder for trend.json, trend.html, trend.svg, trend.csv and trend.parquet; created if it
    /// does not exist.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print trend.json on stdout.
    #[arg(long)]
    json: bool,
}

/// Mean and interval of a value in results.json.
fn with_interval(value: &Value) -> (&Value, &Value) {
    (&value["mean"], &value["ci95"])
}

/// A quantity in results.json, and the ends of its interval (null if it has none).
fn place_of(quantity: StudiedQuantity, results: &Value) -> Option<(&Value, &Value)> {
    let rows = |at: &str| results.pointer(at).and_then(Value::as_array).into_iter().flatten();
    let found = match quantity {
        StudiedQuantity::KT => results.pointer("/answer/contact/k_t_n_per_m").map(with_interval),
        StudiedQuantity::CT => results.pointer("/answer/contact/c_t_n_s_per_m").map(with_interval),
        StudiedQuantity::BetweenArms => results.pointer("/answer/between_arms/k_n_per_m").map(with_interval),
        StudiedQuantity::FrictionCoefficient => {
            let slips = |row: &&Value| row["friction_coefficient"].is_number();
            let amplitude = |row: &&Value| row["amplitude_m"].as_f64().unwrap_or(0.0);
            rows("/hysteresis")
                .filter(slips)
                .max_by(|a, b| amplitude(a).total_cmp(&amplitude(b)))
                .map(|row| (&row["friction_coefficient"], &row["friction_coefficient_ci95"]))
        }
        // they are sorted by frequency
        StudiedQuantity::FirstMode => rows("/modes")
            .find(|row| row["structure"].as_str() == Some(Structure::Ajb.name()))
            .map(|row| with_interval(&row["frequency_hz"])),
    };
    found.filter(|(value, _)| !value.is_null())
}

impl TrendArgs {
    pub fn run(self) -> Result<(), CliError> {
        let table = self.table.as_deref().map(read_study).transpose();
        let table = table.map_err(|error| CliError::Bad(error.to_string()))?;
        let mut left_out = BTreeMap::new();
        let mut campaigns = Vec::new();
        let mut given = BTreeSet::new();
        for path in &self.files {
            let results = results_of(path)?;
            let name = name_of(path, &results);
            // twice the same campaign would count as two independent ones
            if !given.insert((name.clone(), started_at(&results))) {
                return Err(CliError::Bad(format!(
                    "{}: the campaign {name} is given twice: leave one of them out",
                    path.display()
                )));
            }
            match self.campaign(&name, &results, table.as_ref()) {
                Ok(one) => campaigns.push(one),
                Err(why) => {
                    tell_line!("jointrig: left out: {name}: {why}");
                    left_out.insert(name, why);
                }
            }
        }
        if self.against.as_deref() == Some("time") {
            let first = campaigns.iter().filter_map(|one| one.started).min();
            for one in &mut campaigns {
                let (Some(first), Some(started)) = (first, one.started) else {
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
        let dependence = if self.curve { Dependence::Curve } else { Dependence::Line };
        let found = trend(&observations, shared, dependence)
            .map_err(|error| CliError::Bad(format!("trend: {error}")))?;
        let document = self.document(&found, &observations, shared, campaigns, left_out);
        if let Some(folder) = &self.out {
            self.write(folder, &document)?;
        }
        if self.json { output::json(&document) } else { output::lines(sentences(&document)) }
    }

    fn campaign(
        &self,
        name: &str,
        results: &Value,
        table: Option<&StudyTable>,
    ) -> Result<FoundByCampaign, String> {
        let (symbol, ..) = shown_as(self.of);
        let Some((value, ends)) = place_of(self.of, results) else {
            let why = match self.of {
                StudiedQuantity::FrictionCoefficient => {
                    "no level of the shaker slips, or the plan states no normal load"
                }
                StudiedQuantity::FirstMode => "no mode of the assembly was found",
                _ => results.pointer("/answer/contact/why").and_then(Value::as_str).unwrap_or("no answer"),
            };
            return Err(format!("it has no {symbol}: {why}"));
        };
        // the error of a loop with fewer than four cycles, which has no interval, counts as scatter
        let only =
            value.as_f64().filter(|_| ends.is_null() && self.of == StudiedQuantity::FrictionCoefficient);
        let end = |at: usize| ends[at].as_f64().or(only);
        let value = match [value.as_f64(), end(0), end(1)] {
            [Some(mean), Some(low), Some(high)] if low > 0.0 && mean > 0.0 && high.is_finite() => {
                Interval { mean, ci95: [low, high] }
            }
            _ => {
                return Err(format!(
                    "the interval of its {symbol} is not finite and above zero: a relative change cannot be computed"
                ));
            }
        };
        let std = (value.ci95[1] / value.ci95[0]).ln() / (2.0 * NORMAL_95);
        let own = own_part(results).filter(|_| self.of == StudiedQuantity::KT).unwrap_or(1.0);
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
        Ok(FoundByCampaign {
            file: name.into(),
            started: started_at(results),
            value,
            covariate,
            reassembly,
            own_std: std * own.sqrt(),
            shared_std: std * (1.0 - own).max(0.0).sqrt(),
            simulated: results.pointer("/source/simulated").and_then(Value::as_bool) == Some(true),
        })
    }

    fn observations(&self, campaigns: &[FoundByCampaign]) -> Result<Vec<Observation>, CliError> {
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

    fn document(
        &self,
        found: &Trend,
        observations: &[Observation],
        shared_std: f64,
        campaigns: Vec<FoundByCampaign>,
        left_out: BTreeMap<String, String>,
    ) -> TrendOverCampaigns {
        let covariates = || observations.iter().map(|one| one.covariate);
        let first = covariates().fold(f64::INFINITY, f64::min);
        let last = covariates().fold(f64::NEG_INFINITY, f64::max);
        let each = (found.campaigns as f64 / found.groups as f64).round() as usize;
        let stated = |x: f64| if self.power_law { x.exp() } else { x };
        let with_trend = |(one, observation): (FoundByCampaign, &Observation)| CampaignOfStudy {
            found: one,
            trend: exponential(found.line(observation.covariate)),
        };
        let fitted = |point: usize| {
            let x = first + (last - first) * point as f64 / (FITTED - 1) as f64;
            FittedPoint { covariate: stated(x), value: exponential(found.line(x)) }
        };
        let change = self.against.as_ref().and_then(|_| found.change(first, last));
        TrendOverCampaigns {
            quantity: self.of,
            against: self.against.clone(),
            dependence: self.against.as_ref().map(|_| match (self.power_law, self.curve) {
                (true, _) => FittedForm::PowerLaw,
                (_, true) => FittedForm::Curve,
                _ => FittedForm::Line,
            }),
            level: exponential(found.level),
            at: self.against.is_some().then(|| stated(found.at)),
            slope: found.slope,
            change: change.map(|of| Interval { mean: of.mean.exp_m1(), ci95: of.ci95.map(f64::exp_m1) }),
            depends: found.found(),
            bends: found.bends,
            between: found.between,
            within: found.within,
            shared_std,
            reassemblies_needed: found.reassemblies_for((1.0 + 0.01 * self.within).ln(), each),
            wanted_percent: self.within,
            campaigns: campaigns.into_iter().zip(observations).map(with_trend).collect(),
            fitted: if change.is_some() { (0..FITTED).map(fitted).collect() } else { Vec::new() },
            left_out,
        }
    }

    fn write(&self, folder: &Path, document: &TrendOverCampaigns) -> Result<(), CliError> {
        let failed = |doing| move |source| CliError::File { path: folder.into(), doing, source };
        std::fs::create_dir_all(folder).map_err(failed("making the folder"))?;
        let text = serde_json::to_string_pretty(document)
            .map_err(|error| CliError::Bad(format!("trend.json could not be written: {error}")))?;
        report::write_whole(&folder.join("trend.json"), (text + "\n").as_bytes())
            .map_err(failed("writing trend.json"))?;
        report::write_whole(&folder.join("trend.html"), report::trend_page(document).as_bytes())
            .map_err(failed("writing trend.html"))?;
        let figure = report::trend_figure(document);
        report::write_figure(&figure, report::Format::Svg, &folder.join("trend.svg"))
            .map_err(failed("writing trend.svg"))?;
        self.tables(folder, document)?;
        let parquet = if cfg!(feature = "parquet") { ", trend.parquet" } else { "" };
        tell_line!("jointrig: {}: trend.html, trend.svg, trend.json, trend.csv{parquet}", folder.display());
        Ok(())
    }

    /// trend.csv and trend.parquet, a row for each campaign.
    fn tables(&self, folder: &Path, document: &TrendOverCampaigns) -> Result<(), CliError> {
        let covariate = self.against.as_deref().unwrap_or("covariate");
        let numbers = [covariate, self.of.field(), "low", "high", "trend", "trend_low", "trend_high"];
        let mut columns = vec![("file", Kind::Text), ("reassembly", Kind::Text)];
        columns.extend(numbers.map(|name| (name, Kind::Real)));
        let mut table = Table::new(&columns);
        for one in &document.campaigns {
            let mut row = vec![
                one.found.file.clone().into(),
                one.found.reassembly.clone().into(),
                one.found.covariate.into(),
            ];
            for of in [one.found.value, one.trend] {
                row.extend([of.mean, of.ci95[0], of.ci95[1]].map(Into::into));
            }
            table.push(row);
        }
        let failed = |error: &dyn Display| CliError::Bad(error.to_string());
        table.write_csv(&folder.join("trend.csv")).map_err(|error| failed(&error))?;
        #[cfg(feature = "parquet")]
        write_table(&folder.join("trend.parquet"), &table, &[]).map_err(|error| failed(&error))?;
        Ok(())
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
