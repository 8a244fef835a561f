//! `wear`: slides a contact for many cycles, and shows what has been measured.

use super::error::CliError;
use super::output;
use super::output::positive;
use super::shaker::{ShakingArgs, ready};
use crate::advice;
use crate::analyse::wear::wear;
use crate::campaign::plan::{Plan, WearPlan};
use crate::campaign::run::progress::Pace;
use crate::campaign::run::shaking::ChannelLimits;
use crate::campaign::run::shaking::Onlookers;
use crate::campaign::run::shaking::wear::{self as run, WearEnd, WearOptions, WearState, WearSummary};
use crate::campaign::store::Store;
use crate::device::address::Address;
use crate::device::logs::Tables;
use crate::device::session::Session;
use crate::report::words::number::{count, decimals, micro};
use crate::results::WearRuns;
use crate::untrusted_text::tell_line;
use clap::Args;
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;

/// Wear a contact: the shaker slides it for many cycles at one amplitude, and every cycle's k_T,
/// friction, energy and amplitude are stored.
///
/// Without --device: what the file's wear runs have measured, by decades of cycles. Without --freq,
/// --amplitude and --cycles: the run of the plan's [wear]. --cycles and --energy count all runs of
/// the file, so the same command resumes a run that was ended or killed. Impact cells and levels
/// may be measured in between. The structure on the table must be the assembly.
#[derive(Debug, Args)]
pub struct Wear {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Device address, e.g. sim:RIG.toml, usb:, serial:/dev/ttyACM0 or tcp:127.0.0.1:4000.
    #[arg(long, value_name = "ADDR")]
    device: Option<String>,
    /// Frequency, Hz [default: that of the plan].
    #[arg(long = "freq", value_name = "HZ", value_parser = positive)]
    frequency: Option<f64>,
    /// Amplitude of the relative displacement, m [default: that of the plan].
    #[arg(long, value_name = "M", value_parser = positive)]
    amplitude: Option<f64>,
    /// Cycles of all runs of the file after which the run ends [default: those of the plan].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    cycles: Option<u64>,
    /// Energy dissipated in all runs of the file after which the run ends, J [default: that of the
    /// plan].
    #[arg(long, value_name = "J", value_parser = positive)]
    energy: Option<f64>,
    #[command(flatten)]
    shaking: ShakingArgs,
}

impl Wear {
    pub fn run(self) -> Result<(), CliError> {
        let Some(device) = &self.device else { return self.show() };
        let address: Address = device.parse()?;
        let mut store = Store::open(&self.file)?;
        let plan = store.plan()?;
        let wanted = self.wanted(&plan)?;
        let stop = Arc::default();
        let mut onlooker = self.shaking.page.start(Some(&self.file), &stop, false)?;
        let before = store.wear_total()?;
        let transport = address.open_worn(self.shaking.seed, before.energy_j)?;
        let mut session = Session::open(transport, &address.to_string())?;
        session.look_for_log_tables(Tables::new(self.shaking.log_tables.clone()));
        onlooker.tap.take().into_iter().for_each(|tap| session.watch(tap));
        let info = session.info()?;
        if info.drive_v > 0.0 && !info.stage {
            ready(
                self.shaking.yes,
                &format!("a wear run of {} cycles", count(wanted.cycles.saturating_sub(before.cycles))),
            )?;
        }
        output::catch(&stop, "block of cycles");
        tell_line!(
            "{} Hz, {} µm; {} of {} cycles and {} J are in the file",
            wanted.frequency_hz,
            decimals(1e6 * wanted.amplitude_m, 3),
            count(before.cycles),
            count(wanted.cycles),
            decimals(before.energy_j, 3)
        );
        let options = WearOptions {
            run: wanted,
            normal_load_n: plan.contact.as_ref().and_then(|own| own.get_ref().normal_load_n),
            most_drive_v: self.shaking.max_drive,
            limits: ChannelLimits(self.shaking.limits.clone()),
            new_structure: self.shaking.new_structure,
            stop,
        };
        let onlookers = Onlookers { watch: onlooker.watch.clone(), edits: onlooker.edits.take() };
        let pace = Pace::default();
        let ended = run::run(&mut store, &mut session, &options, &onlookers, &mut |state| {
            if pace.is_due() {
                tell_line!("{}", told(state));
            }
        });
        let summary = ended?;
        let found = wear(&store)?;
        store.close()?;
        tell_line!(
            "{}; {} cycles in this run, {} in the file; the shaker is at rest",
            summary.end,
            count(summary.after.cycles - summary.before.cycles),
            count(summary.after.cycles)
        );
        self.print(found.as_ref(), Some(&summary))?;
        match summary.end {
            WearEnd::Interrupted => {
                Err(CliError::Bad("stopped; run the same command again to continue from here".into()))
            }
            _ => Ok(()),
        }
    }

    /// What the file contains.
    fn show(&self) -> Result<(), CliError> {
        let store = Store::open_read_only(&self.file)?;
        let found = wear(&store)?;
        if found.is_none() {
            return Err(CliError::Bad(format!(
                "{}: it has no wear run; measure one with --device ADDR",
                advice::quoted(&self.file)
            )));
        }
        self.print(found.as_ref(), None)
    }

    fn print(&self, found: Option<&WearRuns>, summary: Option<&WearSummary>) -> Result<(), CliError> {
        if self.shaking.json {
            return output::json(&json!({
                "file": self.file.display().to_string(),
                "end": summary.map(|summary| summary.end.name()),
                "cycles_of_this_run": summary.map(|summary| summary.after.cycles - summary.before.cycles),
                "wear": found,
            }));
        }
        found.map_or(Ok(()), |found| output::lines(lines(found)))
    }

    fn wanted(&self, plan: &Plan) -> Result<WearPlan, CliError> {
        let planned = plan.wear.as_ref().map(toml::Spanned::get_ref);
        let missing = |flag: &str| CliError::Usage(format!("the plan has no [wear]: give {flag}"));
        let wanted = WearPlan {
            frequency_hz: self
                .frequency
                .or(planned.map(|own| own.frequency_hz))
                .ok_or_else(|| missing("--freq HZ"))?,
            amplitude_m: self
                .amplitude
                .or(planned.map(|own| own.amplitude_m))
                .ok_or_else(|| missing("--amplitude M"))?,
            cycles: self.cycles.or(planned.map(|own| own.cycles)).ok_or_else(|| missing("--cycles N"))?,
            energy_j: self.energy.or(planned.and_then(|own| own.energy_j)),
            friction_coefficient: planned.and_then(|own| own.friction_coefficient),
            largest_amplitude_m: planned.and_then(|own| own.largest_amplitude_m),
            temperature_c: planned.and_then(|own| own.temperature_c),
            normal_load: planned.map(|own| own.normal_load.clone()).unwrap_or_default(),
        };
        if wanted.largest_amplitude_m.is_some_and(|most| most <= wanted.amplitude_m) {
            return Err(CliError::Usage(
                "--amplitude is not below the plan's wear.largest_amplitude_m, which ends the run".into(),
            ));
        }
        Ok(wanted)
    }
}

/// Progress as text.
fn told(state: &WearState) -> String {
    let k = state.stiffness_n_per_m.map(|k| format!(", k {} N/µm", decimals(micro(k), 1)));
    let friction = state.friction_n.map(|n| format!(", µN {} N", decimals(n, 1)));
    let amplitude = state.amplitude_m.map(|m| format!(", Δx {} µm", decimals(1e6 * m, 3)));
    let parts: String = [k, friction, amplitude].into_iter().flatten().collect();
    format!("{} cycles, {} J{parts}", count(state.total.cycles), decimals(state.total.energy_j, 3))
}

/// The decades as a table.
fn lines(found: &WearRuns) -> Vec<String> {
    let number = |value: Option<f64>, places: usize| value.map_or("–".into(), |v| decimals(v, places));
    let mut lines = vec![format!(
        "{:>21} {:>11} {:>11} {:>8} {:>7} {:>9} {:>12} {:>12}",
        "cycles", "k_T N/µm", "tangent", "µN N", "µ", "Δx µm", "energy J", "up to J"
    )];
    lines.extend(found.decades.iter().map(|decade| {
        format!(
            "{:>21} {:>11} {:>11} {:>8} {:>7} {:>9} {:>12} {:>12}",
            format!("{} to {}", decade.first, decade.last),
            number(decade.k_t_n_per_m.map(micro), 2),
            number(decade.tangent_n_per_m.map(micro), 2),
            number(decade.friction_n, 2),
            number(decade.friction_coefficient, 4),
            number(decade.amplitude_m.map(|m| 1e6 * m), 3),
            decimals(decade.energy_j, 4),
            decimals(decade.energy_to_j, 4),
        )
    }));
    lines.push(format!(
        "{} cycles, {} J, {} raw loops; {} cycles could not be measured",
        count(found.cycles),
        decimals(found.energy_j, 4),
        count(found.loops),
        count(found.unmeasured)
    ));
    lines
}
