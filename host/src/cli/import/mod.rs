//! `import`: imports FRFs and impact records measured with other systems.

mod cut;
mod exported;
mod folder;
mod follow;
mod names;
mod records;

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use nalgebra::{DMatrix, Scalar};
use num_complex::Complex;

use super::error::CliError;
use super::output;
use crate::analyse;
use crate::campaign::archive::restore::is_archive;
use crate::campaign::cut::Only;
use crate::campaign::cut::marker::Marker;
use crate::campaign::import::CellName;
use crate::campaign::import::assign::Calibrations;
use crate::campaign::plan::level::Moment;
use crate::campaign::plan::{configuration_name, structure};
use crate::campaign::store::Store;
use crate::campaign::verdict::Verdict;
use crate::exchange::frf_npz::direction_arrays;
use crate::exchange::{LabelledFrf, StatedUnits, read_frf_file, write_frf};
use crate::frf::Frf;
use crate::substructuring::geometry::Configuration as Points;
use crate::untrusted_text::tell_line;
use folder::Wishes;
use names::Pattern;

/// Import FRFs or impact records measured with other systems.
///
/// FRFs (npz, or universal file 58, 58b) are converted to an npz FRF file with --out, or imported
/// into a campaign file with --into and --configuration: they are used for that configuration as if
/// it had been measured with jointrig. Impact records of one impact position and one response
/// location along x, y, z (npz, or time responses in a universal file) are imported into a cell of
/// a campaign file, with --impact and --response in addition; every hit is judged like a measured
/// one.
///
/// A folder that `jointrig export` wrote is imported as a whole with --into alone: plan, sessions,
/// records with all channels and verdicts, levels, calibrations, notes. The campaign file is made
/// if it does not exist, and its analysis gives the same results.
///
/// Files with all channels (csv with a heading like `hammer (N), LDV_A (mm/s)`, wav, universal
/// files whose labels name them, npz with names, units, signals and fs) hold one or more hits of a
/// cell with load cells, specimens and other sensors; --calibrate states the sensitivities of
/// voltages.
///
/// Any other folder is imported into a campaign file with --into alone: files named
/// CONFIGURATION_IMPACT_RESPONSE are cells, files named CONFIGURATION contain FRFs, and universal
/// files may name impact and response in their labels; for all others a table (--names) states the
/// content. The import adds to existing data; what is already present is not stored again, so the
/// command may be repeated.
///
/// With --follow, each file is imported as soon as it is complete in the folder, until the campaign
/// is complete or Ctrl-C is pressed: for systems that write a file for each hit or each place. Its
/// verdicts are printed, `jointrig serve FILE.jrig` shows them, and the same command continues after
/// an interruption.
///
/// A continuous recording (npz, wav, csv or universal file with all channels; --calibrate as above) is
/// cut with --cut: its hits are found, judged and
/// fitted to the plan's order (--order plan) by the structure's response, or to a table (--table).
/// What was found is printed before it is stored; where a place is not certain, nothing is stored, and
/// the message lists what to state.
#[derive(Debug, Args)]
#[allow(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
pub struct Import {
    /// An npz or universal file, or a folder of them.
    #[arg(value_name = "FILE|DIR")]
    file: PathBuf,
    /// FRFs: the npz file to write.
    #[arg(long, value_name = "FILE.npz", conflicts_with = "into", required_unless_present = "into")]
    out: Option<PathBuf>,
    /// The campaign file to import into (`jointrig campaign new` creates one).
    #[arg(long, value_name = "FILE.jrig")]
    into: Option<PathBuf>,
    /// The configuration that was measured (A, B or AJB).
    #[arg(long, value_name = "NAME", requires = "into")]
    configuration: Option<String>,
    /// Records: the impact's name in the plan.
    #[arg(long, value_name = "NAME", requires_all = ["into", "response"])]
    impact: Option<String>,
    /// Records: the response location's name in the plan.
    #[arg(long, value_name = "NAME", requires_all = ["into", "impact"])]
    response: Option<String>,
    /// Folder: a csv table with the columns file, configuration, impact, response.
    #[arg(long, value_name = "TABLE.csv", requires = "into")]
    names: Option<PathBuf>,
    /// Units that override those of the file's labels:
    /// response=mm/s,force=lbf,time=ms,frequency=rad/s.
    #[arg(long, value_name = "UNITS", default_value = "")]
    units: StatedUnits,
    /// Folder: the form of the files' names, without ending, such as
    /// {configuration}_{impact}_{response}_{hit}; without {response} for a plan with fixed sensors.
    #[arg(long, value_name = "PATTERN", requires = "into", conflicts_with = "names")]
    pattern: Option<Pattern>,
    /// Files with all channels: name and sensitivity of recorded voltages,
    /// CHANNEL=NAME:SENSITIVITY[,…], such as 'ai0=hammer:2.25 mV/N,ai1=LDV_A:125 mm/s/V'; ai3=-
    /// leaves a channel out.
    #[arg(long, value_name = "CHANNELS", requires = "into", default_value = "", hide_default_value = true)]
    calibrate: Calibrations,
    /// Drop earlier records of a file with the same name, and existing FRFs; the file keeps both
    /// and logs the replacement.
    #[arg(long, requires = "into")]
    replace: bool,
    /// Folder: import each file that appears in it, until the campaign is complete or Ctrl-C is
    /// pressed.
    #[arg(long, requires = "into", conflicts_with_all = ["cut", "impact", "response"])]
    follow: bool,
    /// Following a folder: a file is complete when its size and its time have not changed for so
    /// long. Use 3 for a FAT disk or a network share, whose times are coarse.
    #[arg(long, value_name = "SECONDS", requires = "follow", value_parser = output::positive, default_value = "1")]
    settle: f64,
    /// Cut a continuous recording into hits.
    #[arg(long, requires = "into")]
    cut: bool,
    /// Continuous recording: the places were struck in this order; deviations are found or asked
    /// about.
    #[arg(long, value_enum, requires = "cut")]
    order: Option<CutOrder>,
    /// Continuous recording: a csv table with the columns hit (or time_s), configuration, impact,
    /// response.
    #[arg(long, value_name = "TABLE.csv", requires = "cut")]
    table: Option<PathBuf>,
    /// Continuous recording: the channel whose level is STEP times the number of the place that is
    /// struck, in the plan's order from 1 (0: no place), such as ai7:0.5.
    #[arg(long, value_name = "CHANNEL:STEP", requires = "cut", conflicts_with = "order")]
    marker: Option<Marker>,
    /// Continuous recording of the shaker: store its steady parts as levels, measured before or
    /// after the cells.
    #[arg(long, value_name = "before|after", requires = "cut", conflicts_with_all = ["order", "table", "marker"])]
    levels: Option<Moment>,
    /// Continuous recording: tell what was found, and store nothing.
    #[arg(long, requires = "cut")]
    dry_run: bool,
}

/// The order in which the places of a continuous recording were struck.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum CutOrder {
    /// The plan's, as `jointrig campaign run` measures.
    Plan,
}

pub(super) use names::universal_files;

fn bad(error: impl std::fmt::Display) -> CliError {
    CliError::Bad(error.to_string())
}

impl Import {
    pub fn run(self) -> Result<(), CliError> {
        let (replace, units) = (self.replace, &self.units);
        match (&self.out, &self.into, &self.configuration, &self.impact, &self.response) {
            (None, Some(into), ..) if self.cut => cut::import(&cut::Recorded {
                file: &self.file,
                into,
                only: Only {
                    configuration: self.configuration.as_deref(),
                    impact: self.impact.as_deref(),
                    response: self.response.as_deref(),
                },
                in_order: self.order == Some(CutOrder::Plan),
                table: self.table.as_deref(),
                marker: self.marker.as_ref(),
                dry_run: self.dry_run,
                replace,
                calibrate: &self.calibrate,
                levels: self.levels,
            }),
            (None, Some(into), configuration, None, None) if self.follow => {
                let settle = Duration::try_from_secs_f64(self.settle)
                    .map_err(|_| CliError::Usage("--settle: too many seconds".into()))?;
                follow::follow(&self.file, into, &self.wishes(configuration.as_deref()), settle)
            }
            (None, Some(into), None, None, None)
                if self.names.is_none() && self.pattern.is_none() && is_archive(&self.file) =>
            {
                exported::import(&self.file, into)
            }
            (None, Some(into), configuration, None, None) if self.file.is_dir() => {
                folder::import(&self.file, into, &self.wishes(configuration.as_deref()))
            }
            (Some(out), ..) => self.convert(out),
            (None, Some(into), Some(configuration), Some(impact), Some(response)) => {
                let cell = CellName { configuration, impact, response };
                records::import(&self.file, into, &cell, replace, (units, &self.calibrate))
            }
            (None, Some(into), Some(configuration), ..) => {
                let store = Store::open(into)?;
                let name = self.file.file_name().unwrap_or(self.file.as_os_str()).to_string_lossy();
                let told = frfs(&store, &Frfs { file: &self.file, name: &name, configuration, replace, units })?;
                store.close()?;
                output::lines(told)
            }
            _ => Err(CliError::Usage(
                "give --out FILE.npz for an FRF file, or --into FILE.jrig with --configuration (and for records --impact \
                 and --response); a folder needs only --into"
                    .into(),
            )),
        }
    }

    /// What is stated about the files of a folder.
    fn wishes<'w>(&'w self, configuration: Option<&'w str>) -> Wishes<'w> {
        Wishes {
            configuration,
            names: self.names.as_deref(),
            pattern: self.pattern.as_ref(),
            calibrate: &self.calibrate,
            replace: self.replace,
            units: &self.units,
        }
    }

    fn convert(&self, out: &Path) -> Result<(), CliError> {
        let read = read(&self.file, &self.units)?;
        write_frf(out, &read.frf, &direction_arrays(&read)).map_err(bad)?;
        output::lines([
            format!("{}: {}", self.file.display(), read.taken),
            format!("{}: {}", out.display(), described(&read.frf)),
        ])
    }
}

fn read(file: &Path, units: &StatedUnits) -> Result<LabelledFrf, CliError> {
    let read = read_frf_file(file, units).map_err(bad)?;
    for note in &read.notes {
        tell_line!("{}: {note}", file.display());
    }
    Ok(read)
}

/// FRFs of a whole configuration.
struct Frfs<'f> {
    file: &'f Path,
    /// Name of the file in the campaign file.
    name: &'f str,
    configuration: &'f str,
    /// Whether they may replace others.
    replace: bool,
    /// Units that override those of its labels.
    units: &'f StatedUnits,
}

/// Imports them into a campaign file; returns messages for the user.
fn frfs(store: &Store, from: &Frfs<'_>) -> Result<Vec<String>, CliError> {
    let into = store.path().display();
    let plan = store.plan()?;
    let configuration = plan.configuration(from.configuration).ok_or_else(|| {
        CliError::Usage(format!(
            "there is no configuration `{}`: A, B or AJB (which is A joined to B){}",
            from.configuration,
            plan.own_names().map_or(String::new(), |names| format!("; {names}"))
        ))
    })?;
    let name = configuration_name(configuration);
    let geometry = analyse::geometry_as_planned(&plan);
    let points = geometry.points(structure(configuration));
    let read = read(from.file, from.units)?;
    let taken = read.taken.clone();
    let (frf, turned) = read.along(points).map_err(|what| bad(format!("{}: {what}", from.file.display())))?;
    check_names(from.file, &frf, name, points).map_err(CliError::Bad)?;
    let cells = store.cells()?;
    let own =
        |id: i64| cells.iter().any(|row| row.id == id && configuration_name(row.cell.configuration) == name);
    let kept =
        store.records()?.iter().flatten().filter(|r| own(r.cell) && r.verdict == Verdict::Good).count();
    if kept > 0 {
        return Err(CliError::Bad(format!(
            "{into}: {name} has {kept} good hits of its own, and a configuration has either hits or imported FRFs: import into \
             a campaign that has no hits there"
        )));
    }
    match store.frf(name)? {
        Some(there) if same(&there.frf, &frf) => {
            return Ok(vec![format!(
                "{into}: {name}: the same FRFs are there already, from {}",
                there.source
            )]);
        }
        Some(there) if !from.replace => {
            return Err(CliError::Bad(format!(
                "{into}: {name} has other FRFs already, from {} ({}): --replace uses these instead",
                there.source, there.utc
            )));
        }
        _ => {}
    }
    store.insert_frf(configuration, from.name, &frf)?;
    store.log(&format!("imported FRFs of {name} from {}", from.file.display()))?;
    let taken = [&[taken], &turned[..]].concat().join(", ");
    let mut told =
        vec![format!("{}: {taken}", from.file.display()), format!("{into}: {name}: {}", described(&frf))];
    if frf.variance().is_none() {
        told.push(
            "the file states no variance of its values: results identified from them have no interval from their noise"
                .into(),
        );
    }
    Ok(told)
}

/// Whether both are the same FRFs. A missing pair contains NaN, which does not equal itself.
fn same(one: &Frf, other: &Frf) -> bool {
    fn alike(one: f64, other: f64) -> bool {
        one == other || (one.is_nan() && other.is_nan())
    }
    fn all<T: Scalar + Copy>(
        one: Option<&[DMatrix<T>]>,
        other: Option<&[DMatrix<T>]>,
        alike: impl Fn(T, T) -> bool,
    ) -> bool {
        let (Some(one), Some(other)) = (one, other) else { return one.is_none() == other.is_none() };
        one.len() == other.len()
            && one.iter().zip(other).all(|(one, other)| {
                one.len() == other.len() && one.iter().zip(other.iter()).all(|(a, b)| alike(*a, *b))
            })
    }
    let frame = |frf: &Frf| (frf.quantity(), frf.outputs().to_vec(), frf.inputs().to_vec());
    frame(one) == frame(other)
        && alike(one.sigma_per_s(), other.sigma_per_s())
        && one.frequency_hz() == other.frequency_hz()
        && all(Some(one.lines()), Some(other.lines()), |a: Complex<f64>, b| {
            alike(a.re, b.re) && alike(a.im, b.im)
        })
        && all(one.variance(), other.variance(), alike)
        && all(one.coherence(), other.coherence(), alike)
}

/// Checks names: those that the plan does not have are an error; points of the plan that were not
/// measured are reported.
fn check_names(file: &Path, frf: &Frf, name: &str, points: &Points) -> Result<(), String> {
    let sides =
        [("outputs", frf.outputs(), points.output_names()), ("inputs", frf.inputs(), points.input_names())];
    for (side, found, known) in sides {
        let strange: Vec<&str> = found.iter().filter(|n| !known.contains(n)).map(String::as_str).collect();
        if !strange.is_empty() {
            return Err(format!(
                "{}: {side} {} are not among those of {name} in the plan ({}): rename them, or add them to the plan's geometry",
                file.display(),
                strange.join(", "),
                known.join(", ")
            ));
        }
        let absent: Vec<&str> = known.iter().filter(|n| !found.contains(n)).map(String::as_str).collect();
        if !absent.is_empty() {
            tell_line!("{}: {side} of the plan that are not in it: {}", file.display(), absent.join(", "));
        }
    }
    Ok(())
}

fn described(frf: &Frf) -> String {
    format!(
        "{} of {} outputs, {} inputs, {} lines",
        frf.quantity().frf_name(),
        frf.outputs().len(),
        frf.inputs().len(),
        frf.lines().len()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frf::MotionQuantity;

    #[test]
    fn what_was_imported_is_known_again_with_its_holes() {
        let of = |value: f64| {
            let hole = Complex::new(f64::NAN, f64::NAN);
            let line = DMatrix::from_row_slice(1, 2, &[Complex::new(value, 0.0), hole]);
            let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
            Frf::new(
                vec![10.0],
                0.0,
                MotionQuantity::Velocity,
                names(&["A1"]),
                names(&["F1", "F2"]),
                vec![line],
            )
            .expect("all agree")
        };
        assert!(of(1.0) != of(1.0), "which is why they are compared otherwise");
        assert!(same(&of(1.0), &of(1.0)) && !same(&of(1.0), &of(2.0)));
        let with = of(1.0).with_variance(vec![DMatrix::from_element(1, 2, f64::NAN)]).expect("fits");
        assert!(same(&with, &with.clone()) && !same(&with, &of(1.0)));
    }
}
