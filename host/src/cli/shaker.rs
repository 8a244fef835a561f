//! `shaker`: measures closed-loop sine levels and stores them in the campaign file.

use std::io::{BufRead, Write};
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use serde_json::{Value, json};

use super::error::CliError;
use super::output;
use super::output::positive;
use crate::advice;
use crate::campaign::plan::Plan;
use crate::campaign::plan::level::{Held, Level, Moment};
use crate::campaign::run::shaking::{
    self, CRITERION, ChannelLimits, LevelOptions, Onlookers, Outcome, Summary,
};
use crate::campaign::store::Store;
use crate::campaign::store::level_table::LevelRow;
use crate::device::address::Address;
use crate::device::logs::Tables;
use crate::device::session::Session;
use crate::hysteresis::{LoopAnalysis, Shape, analyse};
use crate::report::words;
use crate::report::words::number::{decimals, micro};
use crate::untrusted_text::{tell, tell_line};

/// Measure levels of the shaker: each is controlled to its amplitude, recorded in steady state and
/// stored.
///
/// Without --freq and --amplitude: the plan's levels. Levels that are already in the file are
/// skipped, so the same command resumes. The structure on the table must be the assembly.
#[derive(Debug, Args)]
pub struct Shaker {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Device address, e.g. sim:, usb:, serial:/dev/ttyACM0, tcp:127.0.0.1:4000,
    /// "bridge:python my_daq.py".
    #[arg(long, value_name = "ADDR")]
    device: String,
    /// Frequencies, Hz [default: those of the plan].
    #[arg(long = "freq", value_name = "HZ", num_args = 1.., value_delimiter = ',', value_parser = positive)]
    frequencies: Vec<f64>,
    /// Amplitudes of the controlled quantity: m, N or V [default: those of the plan (relative
    /// displacement)].
    #[arg(long = "amplitude", value_name = "M", num_args = 1.., value_delimiter = ',', value_parser = positive)]
    amplitudes: Vec<f64>,
    /// Controlled quantity: displacement (of specimen A relative to B), force (of the excitation)
    /// or drive (open loop).
    #[arg(long, value_name = "WHAT", default_value = "displacement")]
    control: Held,
    /// Sweep from LO to HI Hz in place of single frequencies.
    #[arg(long, value_name = "LO:HI", conflicts_with = "frequencies", value_parser = range, requires = "amplitudes")]
    sweep: Option<[f64; 2]>,
    /// Sweep rate, Hz/s.
    #[arg(long, value_name = "HZ_PER_S", default_value_t = 20.0, value_parser = positive)]
    rate: f64,
    /// Before or after the hammer's cells [default: before, as long as no hit is recorded].
    #[arg(long, value_name = "MOMENT")]
    when: Option<Moment>,
    /// Shortest record in steady state, s; at least twenty cycles.
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = positive)]
    seconds: f64,
    #[command(flatten)]
    shaking: ShakingArgs,
}

/// Options of every command that moves the shaker.
#[derive(Debug, Args)]
pub struct ShakingArgs {
    /// The drive's largest amplitude, V [default: its full scale].
    #[arg(long, value_name = "V", value_parser = positive)]
    pub max_drive: Option<f64>,
    /// Magnitude of a channel (SI) that stops the shaker [default: 95 % of full scale for load
    /// cells and excitation]; may be repeated.
    #[arg(long = "limit", value_name = "CHANNEL=VALUE", value_parser = limit)]
    pub limits: Vec<(String, f64)>,
    /// Answer every prompt with yes.
    #[arg(long)]
    pub yes: bool,
    /// Continue even if the device indicates another structure than that of the file's records; the
    /// report notes it.
    #[arg(long)]
    pub new_structure: bool,
    /// Print the results as one JSON document.
    #[arg(long)]
    pub json: bool,
    /// Seed of a simulated rig.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Folder with the tables that decode the controller's log lines [default: that of the
    /// environment variable JOINTRIG_LOG_TABLES].
    #[arg(long, value_name = "DIR")]
    pub log_tables: Option<PathBuf>,
    #[command(flatten)]
    pub page: crate::cli::page::Page,
}

impl Shaker {
    pub fn run(self) -> Result<(), CliError> {
        let address: Address = self.device.parse()?;
        let mut store = Store::open(&self.file)?;
        let stop = Arc::default();
        let mut onlooker = self.shaking.page.start(Some(&self.file), &stop, false)?;
        let plan = store.plan()?;
        let levels = self.levels(&plan)?;
        let moment = match self.when {
            Some(moment) => moment,
            None if store.records()?.is_empty() => Moment::Before,
            None => Moment::After,
        };
        let mut session = Session::open(
            address.open_worn(self.shaking.seed, store.wear_total()?.energy_j)?,
            &address.to_string(),
        )?;
        session.look_for_log_tables(Tables::new(self.shaking.log_tables.clone()));
        onlooker.tap.take().into_iter().for_each(|tap| session.watch(tap));
        let info = session.info()?;
        if info.drive_v > 0.0 && !info.stage {
            ready(self.shaking.yes, &format!("{} levels of the shaker", levels.len()))?;
        }
        output::catch(&stop, "shot");
        tell_line!("{} levels, {} the hammer's cells; {CRITERION}", levels.len(), moment.name());
        let options = LevelOptions {
            levels,
            moment,
            seconds: self.seconds,
            sweep_hz_per_s: self.rate,
            most_drive_v: self.shaking.max_drive,
            limits: ChannelLimits(self.shaking.limits.clone()),
            new_structure: self.shaking.new_structure,
            stop,
        };
        let onlookers = Onlookers { watch: onlooker.watch.clone(), edits: onlooker.edits.take() };
        let mut seen = Vec::new();
        let summary = shaking::run_watched(
            &mut store,
            &mut session,
            &options,
            &onlookers,
            &mut |store, level, outcome| {
                let Some(outcome) = outcome else {
                    tell(&format!("{level}: "));
                    return;
                };
                let (line, value) = told(store, outcome);
                tell_line!("{line}");
                seen.push(value);
            },
        );
        if summary.is_err() {
            tell_line!();
        }
        let summary = summary?;
        store.close()?;
        if self.shaking.json {
            output::json(&json!({
                "file": self.file.display().to_string(),
                "when": moment.name(),
                "settled": CRITERION,
                "levels": seen,
            }))?;
        }
        self.end(&options, &summary)
    }

    fn levels(&self, plan: &Plan) -> Result<Vec<Level>, CliError> {
        if let Some([low, high]) = self.sweep {
            let level = |amplitude: &f64| Level {
                frequency_hz: low,
                end_hz: Some(high),
                held: self.control,
                amplitude: *amplitude,
            };
            return Ok(self.amplitudes.iter().map(level).collect());
        }
        let planned = plan.shaker.as_ref().map(toml::Spanned::get_ref);
        let chosen = |own: &[f64], planned: Option<&Vec<f64>>, flag: &str| {
            let list = if own.is_empty() { planned.cloned().unwrap_or_default() } else { own.to_vec() };
            if list.is_empty() {
                return Err(CliError::Usage(format!("the plan has no shaker levels: give them with {flag}")));
            }
            Ok(list)
        };
        let frequencies = chosen(&self.frequencies, planned.map(|p| &p.frequencies_hz), "--freq HZ…")?;
        // the plan's amplitudes are displacements
        let planned = planned.filter(|_| self.control == Held::Displacement);
        let amplitudes = chosen(&self.amplitudes, planned.map(|p| &p.amplitudes_m), "--amplitude")?;
        let level = |frequency_hz: f64, amplitude: f64| Level {
            frequency_hz,
            end_hz: None,
            held: self.control,
            amplitude,
        };
        Ok(frequencies.iter().flat_map(|f| amplitudes.iter().map(move |a| level(*f, *a))).collect())
    }

    fn end(&self, options: &LevelOptions, summary: &Summary) -> Result<(), CliError> {
        let count = |which: fn(&Outcome) -> bool| summary.outcomes.iter().filter(|o| which(o)).count();
        let (stored, known) =
            (count(|o| matches!(o, Outcome::Stored(_))), count(|o| matches!(o, Outcome::Known(_))));
        let path = advice::quoted(&self.file);
        tell_line!("{path}: {stored} levels recorded, {known} were there already; the shaker is at rest");
        if summary.interrupted && summary.outcomes.len() < options.levels.len() {
            return Err(CliError::Bad("stopped; run the same command again to continue from here".into()));
        }
        let short = count(|o| matches!(o, Outcome::Short(..)));
        if short > 0 {
            let message =
                format!("{short} of {} levels were not reached; the reasons are above", options.levels.len());
            return Err(CliError::Bad(message));
        }
        tell_line!("next: jointrig analyse {path} --out DIR");
        Ok(())
    }
}

/// A level as text for a person, and as JSON for a script.
fn told(store: &Store, outcome: &Outcome) -> (String, Value) {
    let (row, is_new) = match outcome {
        Outcome::Known(row) => (row, false),
        Outcome::Stored(row) => (row, true),
        Outcome::Short(level, why) => {
            let value = json!({
                "frequency_hz": level.frequency_hz, "end_hz": level.end_hz, "control": level.held.name(),
                "amplitude": level.amplitude, "recorded": false, "why": why.to_string(),
            });
            return (why.to_string(), value);
        }
    };
    let found = look(store, row);
    let settled = row.settled();
    let mut value = json!({
        "id": row.id,
        "frequency_hz": row.level().frequency_hz,
        "end_hz": row.level().end_hz,
        "control": row.level().held.name(),
        "amplitude": row.level().amplitude,
        "recorded": true,
        "new": is_new,
        "reached": settled.reached,
        "overshoot": settled.overshoot,
        "settled_after_s": settled.after_s,
        "drive_v": settled.drive_v,
        "scans": row.scans,
    });
    let mut line = if is_new {
        format!(
            "{} after {} s, at most {} % on the way, {} V",
            row.level().held.show(settled.reached),
            decimals(settled.after_s, 1),
            decimals(100.0 * settled.overshoot, 0),
            decimals(settled.drive_v, 3)
        )
    } else {
        format!("{}: in the file already", row.level())
    };
    match found {
        Some(Ok(found)) => {
            let (name, k) = match found.k_t_n_per_m {
                Some(k) if found.shape == Shape::Stuck => ("slope between the spots", k),
                _ => ("k_eq", found.k_eq_n_per_m),
            };
            let said = format!(
                "; raw {name} {} N/µm, {} ({} cycles)",
                decimals(micro(k.mean), 1),
                words::shape_name(found.shape),
                k.cycles
            );
            line += &said;
            value["shape"] = json!(found.shape);
            value["slope_between_spots_n_per_m"] = json!(found.k_t_n_per_m);
            value["k_eq_n_per_m"] = json!(found.k_eq_n_per_m);
        }
        Some(Err(why)) => line.extend(["; no loop: ", &why]),
        None => line += "; recorded from rest to rest",
    }
    (line, value)
}

/// Preview of the loop with the raw force; `None` for a sweep, which has no loop.
fn look(store: &Store, row: &LevelRow) -> Option<Result<LoopAnalysis, String>> {
    if row.level().end_hz.is_some() {
        return None;
    }
    let read = || {
        let plan = store.plan().map_err(|error| error.to_string())?;
        let channels = store.channels(row.session).map_err(|error| error.to_string())?;
        let channels = plan.along_sliding(channels);
        let samples = store.level_samples(row).map_err(|error| error.to_string())?;
        let record = shaking::record(&channels, &plan.load_cells(&channels), &samples, &row.level())
            .map_err(|error| error.to_string())?;
        analyse(&record).map_err(|error| error.to_string())
    };
    Some(read())
}

/// Asks the person at the rig for confirmation before anything moves.
pub(super) fn ready(yes: bool, what: &str) -> Result<(), CliError> {
    tell(&format!(
        "\n{what}. Check that the assembly is on the table under its normal load, the stinger is attached, the \
         amplifier is on and nobody touches the rig.\n"
    ));
    if yes {
        tell_line!("ready? yes (--yes)");
        return Ok(());
    }
    tell("Enter when ready; q quit: ");
    // write errors are ignored: without an answer there is an error below
    let _ = std::io::stderr().flush();
    let mut line = String::new();
    match std::io::stdin().lock().read_line(&mut line) {
        Ok(length) if length > 0 && line.trim().is_empty() => Ok(()),
        Ok(length) if length > 0 => Err(CliError::Bad("stopped at the prompt; nothing has moved".into())),
        _ => Err(CliError::Bad("a person must answer, and there is no terminal: use --yes".into())),
    }
}

fn range(text: &str) -> Result<[f64; 2], String> {
    let wrong = "write LO:HI in Hz, two different numbers over 0";
    let (low, high) = text.split_once(':').ok_or(wrong)?;
    let ends = [positive(low).map_err(|_| wrong)?, positive(high).map_err(|_| wrong)?];
    if ends[0] == ends[1] { Err(wrong.into()) } else { Ok(ends) }
}

fn limit(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("write CHANNEL=VALUE")?;
    Ok((name.to_owned(), positive(value)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_and_limits_are_read() {
        assert_eq!(range("100:400"), Ok([100.0, 400.0]));
        for wrong in ["100", "100:", "100:100", "-1:5", "a:b"] {
            assert!(range(wrong).is_err(), "{wrong}");
        }
        assert_eq!(limit("LDV_A=2e-3"), Ok(("LDV_A".into(), 2e-3)));
        assert!(limit("LDV_A").is_err() && limit("LDV_A=-1").is_err());
    }
}
