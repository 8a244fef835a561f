//! `laws`: friction laws from the loops of a contact, and files for programs that simulate it.

use super::error::CliError;
use super::export::levels;
use super::modes::is_campaign;
use super::output;
use super::output::{not_negative, positive};
use crate::campaign::store::Store;
use crate::exchange::loop_table::read_loops;
use crate::exchange::read_hysteresis;
use crate::exchange::tables_output::write_rows;
use crate::friction::{
    FrictionCoefficients, JudgedLaw, LawChoice, LawKind, LawRefusal, LoopEnds, MeasuredLoop, choose,
};
use crate::hysteresis::{Correction, HysteresisRecord, analyse};
use crate::report::words::number::prefixed;
use crate::untrusted_text::tell_line;
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Most points of a loop that are fitted: means of neighbouring points beyond that.
const MOST_POINTS: usize = 256;

/// Fit friction laws to hysteresis loops, each with its 95 % intervals, and refuse those that do
/// not fit.
///
/// FILE is a campaign with levels of the shaker, one record as for `hysteresis` (.npz), or a table
/// of loops (.csv): columns `loop`, `displacement_m` and `force_n`, one cycle for each loop. All
/// loops are fitted together, as of one contact. What the intervals cover is in
/// docs/friction-laws.md.
#[derive(Debug, Args)]
pub struct Laws {
    /// A campaign (.jrig), a record (.npz), or a table of loops (.csv).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Only these laws: jenkins, mindlin, dahl, valanis, bouc-wen, iwan [default: all].
    #[arg(long = "law", value_name = "NAME", value_delimiter = ',', value_parser = kind)]
    kinds: Vec<LawKind>,
    /// Only these levels of a campaign, by their number in levels.csv [default: all at one
    /// frequency, without lost samples].
    #[arg(long = "level", value_name = "NUMBER", value_delimiter = ',')]
    levels: Vec<i64>,
    /// Normal load, N, for the friction coefficients [default: that of the plan or the record].
    #[arg(long, value_name = "N", value_parser = positive)]
    normal_load: Option<f64>,
    /// Normal stiffness of the contact, N/m, copied into the elements.
    #[arg(long, value_name = "N_PER_M", value_parser = positive)]
    normal_stiffness: Option<f64>,
    /// Error of the force in addition to its noise, as a fraction of each loop's force amplitude:
    /// what the law or the rig leaves unexplained. Zero claims that a right law differs from the
    /// loops by their noise only.
    #[arg(long, value_name = "FRACTION", default_value_t = 0.0, value_parser = not_negative)]
    force_error: f64,
    /// Folder for law.json, law.csv, elements.csv and loops.csv; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print law.json on stdout.
    #[arg(long)]
    json: bool,
}

/// The loops of one contact.
struct LoopsOfOneContact {
    loops: Vec<(String, MeasuredLoop)>,
    normal_load_n: Option<f64>,
}

/// law.json.
#[derive(Serialize)]
struct LawDocument<'a> {
    /// Name of the file that the loops are from.
    file: String,
    normal_load_n: Option<f64>,
    normal_stiffness_n_per_m: Option<f64>,
    force_error: f64,
    /// Name of the law to use; null if the best one is refused.
    chosen: Option<&'static str>,
    #[serde(flatten)]
    choice: &'a LawChoice,
    loops: Vec<LoopRow<'a>>,
    /// Elements in parallel of the chosen law; empty if it has none.
    elements: Vec<ContactElement>,
}

#[derive(Serialize)]
struct LoopRow<'a> {
    name: &'a str,
    amplitude_m: f64,
    energy_j: f64,
    energy_std_j: f64,
    coefficients: Option<FrictionCoefficients>,
    #[serde(flatten)]
    ends: LoopEnds,
}

/// A node-to-node element: a spring with a slider.
#[derive(Serialize)]
struct ContactElement {
    k_t_n_per_m: f64,
    k_n_n_per_m: Option<f64>,
    mu: Option<f64>,
    n0_n: Option<f64>,
    limit_n: f64,
}

impl Laws {
    pub fn run(self) -> Result<(), CliError> {
        let bad = |what: String| CliError::Bad(format!("{}: {what}", self.file.display()));
        let mut contact = self.contact()?;
        contact.normal_load_n = self.normal_load.or(contact.normal_load_n);
        if contact.loops.is_empty() {
            return Err(bad("it has no loop: measure levels with `jointrig shaker`, or name others".into()));
        }
        let loops: Vec<MeasuredLoop> =
            contact.loops.iter().map(|(_, one)| one.clone().with_force_error(self.force_error)).collect();
        let kinds = if self.kinds.is_empty() { &LawKind::ALL[..] } else { &self.kinds[..] };
        let choice = choose(kinds, &loops).map_err(|error| bad(error.to_string()))?;
        let document = self.document(&contact, &choice);
        if let Some(folder) = &self.out {
            write(folder, &document, &loops, &contact)?;
        }
        if self.json { output::json(&document) } else { output::lines(lines(&document)) }
    }

    fn contact(&self) -> Result<LoopsOfOneContact, CliError> {
        let named = |name: &str| {
            let name = name.to_owned();
            move |what: String| CliError::Bad(format!("{}, loop {name}: {what}", self.file.display()))
        };
        if self.file.extension().is_some_and(|ending| ending == "csv") {
            let tables = read_loops(&self.file).map_err(|error| CliError::Bad(error.to_string()))?;
            let loops = tables
                .into_iter()
                .map(|one| {
                    let found = MeasuredLoop::thinned(&one.displacement_m, &one.force_n, MOST_POINTS)
                        .map_err(|error| named(&one.name)(error.to_string()))?;
                    Ok((one.name, found))
                })
                .collect::<Result<_, CliError>>()?;
            return Ok(LoopsOfOneContact { loops, normal_load_n: None });
        }
        let averaged = |name: &str, record: &HysteresisRecord| {
            let wrong = named(name);
            let found = analyse(record).map_err(|error| wrong(error.to_string()))?;
            MeasuredLoop::thinned(&found.loop_displacement_m, &found.loop_force_n, MOST_POINTS)
                .map_err(|error| wrong(error.to_string()))
        };
        if !is_campaign(&self.file)? {
            let record = read_hysteresis(&self.file).map_err(|error| CliError::Bad(error.to_string()))?;
            let loops = vec![("1".to_owned(), averaged("1", &record)?)];
            return Ok(LoopsOfOneContact { loops, normal_load_n: record.normal_load_n });
        }
        let store = Store::open_read_only(&self.file)?;
        let plan = store.plan()?;
        let known = plan.contact.as_ref().map(|contact| *contact.get_ref()).unwrap_or_default();
        let correction =
            (known.effective_mass_kg.is_some() || known.parallel_path.is_some()).then(|| Correction {
                effective_mass_kg: known.effective_mass_kg.unwrap_or(0.0),
                parallel_path: known.parallel_path.unwrap_or(0.0),
            });
        let mut loops = Vec::new();
        for row in store.levels()?.iter().flatten() {
            let wanted = if self.levels.is_empty() {
                row.whole() && row.level().end_hz.is_none()
            } else {
                self.levels.contains(&row.id)
            };
            if !wanted {
                continue;
            }
            let record = levels::record(&store, row)?;
            let record = correction.as_ref().map_or_else(|| record.clone(), |by| by.applied(&record));
            let name = row.id.to_string();
            match averaged(&name, &record) {
                Ok(one) => loops.push((name, one)),
                // one level without a loop does not take the others' law
                Err(error) => tell_line!("jointrig: left out: {error}"),
            }
        }
        Ok(LoopsOfOneContact { loops, normal_load_n: known.normal_load_n })
    }

    fn document<'a>(&self, contact: &'a LoopsOfOneContact, choice: &'a LawChoice) -> LawDocument<'a> {
        let chosen = choice.chosen();
        let load_n = contact.normal_load_n;
        let row = |(name, one): &'a (String, MeasuredLoop)| LoopRow {
            name,
            amplitude_m: one.amplitude_m(),
            energy_j: one.energy_j(),
            energy_std_j: one.energy_std_j(),
            coefficients: load_n.and_then(|load_n| FrictionCoefficients::of(one, load_n)),
            ends: LoopEnds::of(one),
        };
        let elements = chosen.and_then(|judged| judged.fit.law.slider_elements()).unwrap_or_default();
        let limit_n: f64 = elements.iter().map(|element| element.limit_n).sum();
        let stiffness: f64 = elements.iter().map(|element| element.k_t_n_per_m).sum();
        let element = |one: &crate::friction::SliderElement| {
            // all elements have the contact's coefficient and a part of its load
            let mu = load_n.map(|load_n| limit_n / load_n);
            ContactElement {
                k_t_n_per_m: one.k_t_n_per_m,
                k_n_n_per_m: self.normal_stiffness.map(|k| k * one.k_t_n_per_m / stiffness),
                mu,
                n0_n: mu.map(|mu| one.limit_n / mu),
                limit_n: one.limit_n,
            }
        };
        LawDocument {
            file: self.file.file_name().unwrap_or(self.file.as_os_str()).to_string_lossy().into_owned(),
            normal_load_n: load_n,
            normal_stiffness_n_per_m: self.normal_stiffness,
            force_error: self.force_error,
            chosen: chosen.map(|judged| judged.fit.law.kind().name()),
            choice,
            loops: contact.loops.iter().map(row).collect(),
            elements: elements.iter().map(element).collect(),
        }
    }
}

fn kind(text: &str) -> Result<LawKind, String> {
    LawKind::ALL.into_iter().find(|kind| kind.name() == text).ok_or_else(|| {
        let names = LawKind::ALL.map(LawKind::name).join(", ");
        format!("`{text}` is no law: choose from {names}")
    })
}

/// Writes law.json, loops.csv with all loops, and where a law is chosen, law.csv with its
/// parameters and elements.csv with its elements.
fn write(
    folder: &Path,
    document: &LawDocument<'_>,
    loops: &[MeasuredLoop],
    contact: &LoopsOfOneContact,
) -> Result<(), CliError> {
    let failed = |doing| move |source| CliError::File { path: folder.into(), doing, source };
    std::fs::create_dir_all(folder).map_err(failed("making the folder"))?;
    // those of an earlier run must not pass for this one's
    for name in ["law.csv", "elements.csv"] {
        match std::fs::remove_file(folder.join(name)) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                return Err(CliError::File {
                    path: folder.join(name),
                    doing: "removing the earlier",
                    source,
                });
            }
            _ => {}
        }
    }
    let text = serde_json::to_string_pretty(document)
        .map_err(|error| CliError::Bad(format!("law.json could not be written: {error}")))?;
    std::fs::write(folder.join("law.json"), text + "\n").map_err(failed("writing law.json"))?;
    let rows = |name: &str, rows: &[Vec<String>]| {
        write_rows(&folder.join(name), rows).map_err(|error| CliError::Bad(error.to_string()))
    };
    let heading = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    let optional = |value: Option<f64>| value.map(|v| v.to_string()).unwrap_or_default();
    let chosen = document.choice.chosen();
    if let Some(judged) = chosen {
        let mut table = vec![heading(&["parameter", "value", "std", "low", "high"])];
        table.extend(judged.fit.parameters.iter().map(|p| {
            let values = [p.value, p.std, p.ci95[0], p.ci95[1]].map(|v| v.to_string());
            std::iter::once(p.name.to_owned()).chain(values).collect()
        }));
        rows("law.csv", &table)?;
        if !document.elements.is_empty() {
            let mut table =
                vec![heading(&["element", "k_t_n_per_m", "k_n_n_per_m", "mu", "n0_n", "limit_n"])];
            table.extend(document.elements.iter().enumerate().map(|(number, one)| {
                vec![
                    (number + 1).to_string(),
                    one.k_t_n_per_m.to_string(),
                    optional(one.k_n_n_per_m),
                    optional(one.mu),
                    optional(one.n0_n),
                    one.limit_n.to_string(),
                ]
            }));
            rows("elements.csv", &table)?;
        }
    }
    let mut table = vec![heading(&["loop", "displacement_m", "force_n", "law_force_n"])];
    for (number, ((name, _), one)) in contact.loops.iter().zip(loops).enumerate() {
        let x = one.smooth_displacement_m();
        let law = chosen.map(|judged| (judged.fit.law.steady(x), judged.fit.loops[number].offset_n));
        for (i, (x, force)) in x.iter().zip(one.force_n()).enumerate() {
            let again = law.as_ref().map(|(force, offset_n)| force[i] + offset_n);
            table.push(vec![name.clone(), x.to_string(), force.to_string(), optional(again)]);
        }
    }
    rows("loops.csv", &table)?;
    tell_line!(
        "jointrig: {}: law.json, loops.csv{}",
        folder.display(),
        match (chosen, document.elements.len()) {
            (None, _) => "",
            (Some(_), 0) => ", law.csv",
            (Some(_), _) => ", law.csv, elements.csv",
        }
    );
    Ok(())
}

fn lines(document: &LawDocument<'_>) -> Vec<String> {
    let mut lines: Vec<String> = document.choice.laws.iter().flat_map(law_lines).collect();
    for one in &document.loops {
        let coefficients = one.coefficients.map_or_else(String::new, |c| {
            format!(", μ by peak {:.3}, by energy {:.3}, by plateau {:.3}", c.peak, c.energy, c.plateau)
        });
        lines.push(format!(
            "loop {}: ± {}, {} per cycle, {}{coefficients}",
            one.name,
            prefixed(one.amplitude_m, "m"),
            prefixed(one.energy_j, "J"),
            ends_in_words(one.ends),
        ));
    }
    lines.push(match document.chosen {
        Some(law) => format!("law to use: {law}"),
        None => "no law fits: the best one is refused (see above); state what the loops leave unexplained with --force-error, or fit fewer loops".into(),
    });
    lines
}

/// An interval that reaches to this many times the value says nothing about the other end.
const NO_LIMIT: f64 = 1000.0;

fn law_lines(judged: &JudgedLaw) -> Vec<String> {
    let fit = &judged.fit;
    let verdict = if judged.refusals.is_empty() { "accepted" } else { "refused" };
    let mut lines =
        vec![format!("{}: {verdict}, BIC {:.1}, weight {:.3}", fit.law.kind(), fit.bic, judged.weight)];
    lines.extend(fit.parameters.iter().map(|p| {
        let (name, factor, unit, places) = match p.name {
            "k_t_n_per_m" => ("k_T", 1e-6, " N/µm", 2),
            "limit_n" => ("limit", 1.0, " N", 2),
            name => (name, 1.0, "", 4),
        };
        let number = |value: f64| format!("{:.places$}", factor * value);
        let [low, high] = p.ci95;
        let interval = if high > NO_LIMIT * p.value.abs() {
            format!("from {}, no upper limit", number(low))
        } else {
            format!("{} to {}", number(low), number(high))
        };
        let unsure = if p.identified { "" } else { " (not identified)" };
        format!("  {name} {}{unit} ({interval}){unsure}", number(p.value))
    }));
    lines.extend(judged.refusals.iter().map(|refusal| format!("  refused: {}", refusal_in_words(refusal))));
    lines
}

fn refusal_in_words(refusal: &LawRefusal) -> String {
    match refusal {
        LawRefusal::Residual { excess, smooth_excess } => format!(
            "its residuals exceed the noise by {excess:.1} standard deviations, their smooth part by {smooth_excess:.1}"
        ),
        LawRefusal::Energy { amplitude_m, change } => {
            format!("its energy is {:+.1} % off at ± {}", 100.0 * change, prefixed(*amplitude_m, "m"))
        }
        LawRefusal::NotDetermined => "the loops do not determine all of its parameters".into(),
        LawRefusal::Evidence { behind } => {
            format!("another law explains the loops better by far (BIC larger by {behind:.1})")
        }
        other => format!("{other:?}"),
    }
}

fn ends_in_words(ends: LoopEnds) -> String {
    match ends {
        LoopEnds::NoPlateau => "no gross slip".into(),
        LoopEnds::Plain => "plain".into(),
        LoopEnds::Sloped { rise } => format!("sloped ({:+.1} %)", 100.0 * rise),
        LoopEnds::Hooked { rise } => format!("hooked ({:+.1} %)", 100.0 * rise),
        LoopEnds::Wedge { rise } => format!("wedge ({:+.1} %)", 100.0 * rise),
    }
}
