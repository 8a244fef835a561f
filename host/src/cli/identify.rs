//! `identify`: the joint's stiffness from FRF matrices measured anywhere.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;

use super::analyse::{where_to_look, write_into};
use super::error::CliError;
use super::output;
use crate::analyse::{BANDS, Findings, Fit, Missing, NoFit, Substructured, fits};
use crate::exchange::{PositionsError, read_frf_file, read_positions};
use crate::report::{document, words};
use crate::results::{Joint, Results, Source};
use crate::structure::Structure;
use crate::substructuring::averaged::{Priors, averaged};
use crate::substructuring::fit;
use crate::substructuring::{Band, Dof, Frf, Geometry, IdmSet, Method, identify};

/// Identify a joint from FRFs of A, B and the assembly, measured anywhere.
///
/// The first line is the number; what could not be applied to these files comes after. Exits with 1 and the reasons when nothing was
/// identified, or when a method or a set of modes that was named gave nothing.
#[derive(Debug, Args)]
pub struct Identify {
    /// FRFs of substructure A alone: .npz, or a universal file (58 or 58b; .uff, .unv).
    #[arg(long, value_name = "FILE")]
    a: PathBuf,
    /// FRFs of substructure B alone.
    #[arg(long, value_name = "FILE")]
    b: PathBuf,
    /// FRFs of the assembly.
    #[arg(long, value_name = "FILE")]
    ajb: PathBuf,
    /// Where sensors and impacts are: the pyFBS workbook (.xlsx), a folder of its tables as .csv, or .toml.
    #[arg(long, value_name = "FILE")]
    geometry: PathBuf,
    /// Decoupling methods, by name [default: all that work line by line]; `fit`, which takes a few seconds for each band, where asked for.
    #[arg(long = "method", value_name = "METHOD", value_delimiter = ',')]
    methods: Vec<Asked>,
    /// For `fit`: K and C full and symmetric instead of diagonal.
    #[arg(long)]
    full_joint: bool,
    /// For `fit` of files without `variance`: noise of each value's real and of its imaginary part, as a fraction of the file's rms at the line.
    #[arg(long, value_name = "FRACTION", value_parser = not_negative)]
    noise: Option<f64>,
    /// Interface deformation modes of each virtual point: 2, 4 or 6 (several with commas), or one set by the names of its modes, for
    /// example x,z,ry; x…rz are rigid, ex…bzy flexible as in pyFBS. Repeats [default: 2,4,6].
    #[arg(long, value_name = "N|MODES")]
    idms: Vec<IdmSets>,
    /// Bands in Hz, ends included [default: 300:600, 100:800 and 100:300, as far as the files reach].
    #[arg(long = "band", value_name = "LO:HI", value_delimiter = ',', value_parser = band)]
    bands: Vec<Band>,
    /// How far a sensor or impact may be from where the geometry has it, m (standard deviation along each axis).
    #[arg(long, value_name = "M", default_value_t = Priors::default().position_m, value_parser = not_negative)]
    position_error: f64,
    /// What each new aim at a cell adds to that, m.
    #[arg(long, value_name = "M", default_value_t = Priors::default().aim_m, value_parser = not_negative)]
    aim_error: f64,
    /// The hammer's tilt, rad.
    #[arg(long, value_name = "RAD", default_value_t = Priors::default().hammer_angle_rad, value_parser = not_negative)]
    angle_error: f64,
    /// For `fit`: how much A and B alone may differ from A and B in the assembly (standard deviation), as a fraction of their admittance.
    #[arg(long, value_name = "FRACTION", default_value_t = fit::Options::default().mounting, value_parser = not_negative)]
    mounting_error: f64,
    /// Folder for results.json and report.html.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print results.json on stdout instead of a summary.
    #[arg(long)]
    json: bool,
}

impl Identify {
    pub fn run(self) -> Result<(), CliError> {
        let [a, b, ajb] = [read(&self.a)?, read(&self.b)?, read(&self.ajb)?];
        let (geometry, notes) = read_geometry(&self.geometry)?;
        for note in notes {
            eprintln!("jointrig: {note}");
        }
        let methods: Vec<Method> = if self.methods.is_empty() {
            Method::ALL.to_vec()
        } else {
            self.methods
                .iter()
                .filter_map(|m| if let Asked::ByLine(m) = m { Some(*m) } else { None })
                .collect()
        };
        let asked = self.idms.iter().flat_map(|sets| sets.0.iter().copied());
        let idms: Vec<IdmSet> = if self.idms.is_empty() { IdmSet::ALL.to_vec() } else { asked.collect() };
        let bands = if self.bands.is_empty() { default_bands(&ajb)? } else { self.bands.clone() };
        let mut found = Findings { source: self.source(), ..Findings::default() };
        if !methods.is_empty() {
            let identified = identify(&a, &b, &ajb, &geometry, &methods, &idms, &bands).map_err(bad)?;
            let of_frfs = Substructured::of([&a, &b, &ajb], &geometry, &self.priors(), identified);
            found.missing.extend(of_frfs.cmif.as_ref().err().cloned().map(Missing::Cmif));
            found.substructured = Some(of_frfs);
        }
        // the estimates with an interval need whole rigid motions
        if idms.contains(&IdmSet::Six) && methods.contains(&Method::Inverse) {
            let of = |band| averaged(&ajb, &geometry, IdmSet::Six, band, &self.priors());
            // where it cannot be had, the reason is among the refusals of `inverse` already
            found.recommended = bands.iter().filter_map(|band| of(*band).ok()).collect();
        }
        if self.methods.contains(&Asked::Fit) {
            found.fits = self.fits([a, b, ajb], &geometry, &idms, &bands);
        }
        let results = document(found);
        if let Some(folder) = &self.out {
            write_into(&results, folder, &[])?;
        }
        if self.json {
            output::json(&results)?;
        } else {
            output::lines(words::headline::between_the_arms(&results))?;
            output::lines(words::summary(&results))?;
            output::lines(self.out.iter().map(|folder| where_to_look(folder)))?;
        }
        self.found_what_was_asked(&results)
    }

    /// Whether every method and every set of modes that was named gave a row, and whether any row is a number.
    fn found_what_was_asked(&self, results: &Results) -> Result<(), CliError> {
        let of_method =
            |row: &Joint, asked: &Option<Asked>| asked.is_none_or(|asked| row.method == asked.name());
        let of_set = |row: &Joint, set: &Option<IdmSet>| set.is_none_or(|set| row.modes == set.dofs());
        let methods: Vec<Option<Asked>> = any_or(self.methods.iter().copied());
        let sets: Vec<Option<IdmSet>> = any_or(self.idms.iter().flat_map(|sets| sets.0.iter().copied()));
        let there = |method: &Option<Asked>, set: &Option<IdmSet>| {
            results.joint.iter().any(|row| of_method(row, method) && of_set(row, set))
        };
        let all = methods.iter().all(|method| sets.iter().all(|set| there(method, set)));
        let is_number = |row: &Joint| row.identified() || row.sliding_stiffness().is_none();
        let recommended = results.recommended.iter().any(|r| r.joint.values().any(|dof| dof.identified));
        if all && (recommended || results.joint.iter().any(is_number)) {
            return Ok(());
        }
        Err(CliError::Bad(refusals(results).unwrap_or_else(|| {
            "nothing was identified: scatter or noise is larger than every value (the rows above say by how much); average more hits, \
             or choose another --band"
                .into()
        })))
    }

    fn priors(&self) -> Priors {
        Priors { position_m: self.position_error, aim_m: self.aim_error, hammer_angle_rad: self.angle_error }
    }

    /// The fit with each set of modes over each band.
    fn fits(&self, frfs: [Frf; 3], geometry: &Geometry, idms: &[IdmSet], bands: &[Band]) -> Vec<Fit> {
        let shape = if self.full_joint { fit::Shape::Full } else { fit::Shape::Diagonal };
        let options = fit::Options {
            priors: self.priors(),
            shape,
            mounting: self.mounting_error,
            ..fit::Options::default()
        };
        let mut known = Vec::new();
        for (name, frf) in Structure::ALL.into_iter().zip(frfs) {
            known.push(match self.noise {
                _ if frf.variance().is_some() => frf,
                Some(fraction) => frf.with_relative_noise(fraction),
                None => {
                    let refused =
                        |set: &IdmSet| Fit { idms: *set, outcome: Err(NoFit::FileWithoutVariance(name)) };
                    return idms.iter().map(refused).collect();
                }
            });
        }
        fits([&known[0], &known[1], &known[2]], geometry, idms, bands, &options)
    }

    fn source(&self) -> Source {
        let mut source = Source {
            file: self.ajb.file_name().unwrap_or(self.ajb.as_os_str()).to_string_lossy().into_owned(),
            kind: "frf".into(),
            ..Source::default()
        };
        let files = [("a", &self.a), ("b", &self.b), ("ajb", &self.ajb), ("geometry", &self.geometry)];
        for (name, path) in files {
            source.settings.insert(name.into(), path.display().to_string().into());
        }
        source
    }
}

/// A method as it may be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Asked {
    /// One that works line by line.
    ByLine(Method),
    /// Maximum likelihood over all lines.
    Fit,
}

impl Asked {
    fn name(self) -> &'static str {
        match self {
            Self::ByLine(method) => method.name(),
            Self::Fit => fit::NAME,
        }
    }
}

/// What was named, or the one wish for anything.
fn any_or<T>(named: impl Iterator<Item = T>) -> Vec<Option<T>> {
    let named: Vec<Option<T>> = named.map(Some).collect();
    if named.is_empty() { vec![None] } else { named }
}

impl FromStr for Asked {
    type Err = String;
    fn from_str(name: &str) -> Result<Self, String> {
        if name == fit::NAME {
            return Ok(Asked::Fit);
        }
        name.parse().map(Asked::ByLine).map_err(|reason: String| format!("{reason}, {}", fit::NAME))
    }
}

/// One line for each reason, with the methods it stopped.
fn refusals(results: &Results) -> Option<String> {
    let mut by_reason: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for r in &results.refused {
        by_reason.entry(&r.reason).or_default().push(format!("{} with {} IDMs", r.method, r.idms));
    }
    let lines: Vec<String> =
        by_reason.iter().map(|(reason, who)| format!("refused {}: {reason}", who.join(", "))).collect();
    (!lines.is_empty()).then(|| lines.join("\n"))
}

/// The default bands that hold a line of the files.
fn default_bands(frf: &Frf) -> Result<Vec<Band>, CliError> {
    let bands: Vec<Band> =
        BANDS.into_iter().filter(|band| frf.frequency_hz().iter().any(|f| band.contains(*f))).collect();
    if bands.is_empty() {
        let (first, last) = (frf.frequency_hz().first(), frf.frequency_hz().last());
        return Err(CliError::Bad(format!(
            "none of the default bands holds a line of the files, which cover {first:?} to {last:?} Hz: give --band LO:HI"
        )));
    }
    Ok(bands)
}

/// The geometry, and what a reader must know about it.
fn read_geometry(path: &Path) -> Result<(Geometry, Vec<String>), CliError> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        let text = std::fs::read_to_string(path).map_err(|source| CliError::Read {
            path: path.into(),
            doing: "reading the geometry",
            source,
        })?;
        let geometry: Geometry =
            toml::from_str(&text).map_err(|e| {
                let line = e.span().map_or(1, |at| 1 + text[..at.start].matches('\n').count());
                CliError::Bad(format!(
                    "{}, line {line}: {}; a geometry has `a`, `b` and `ajb`, each with `channels` and `impacts`, and both \
                     virtual points (docs/coming-from-pyfbs.md)",
                    path.display(),
                    e.message()
                ))
            })?;
        return Ok((geometry, Vec::new()));
    }
    let positions = read_positions(path).map_err(|e: PositionsError| bad(e))?;
    Ok((positions.geometry, positions.warnings))
}

fn bad(error: impl std::fmt::Display) -> CliError {
    CliError::Bad(error.to_string())
}

/// What one `--idms` asks for: the paper's sets by their sizes, or one set by its modes.
#[derive(Debug, Clone, PartialEq)]
struct IdmSets(Vec<IdmSet>);

impl FromStr for IdmSets {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let words: Vec<&str> = text.split(',').map(str::trim).collect();
        let sizes: Result<Vec<usize>, _> = words.iter().map(|w| w.parse()).collect();
        if let Ok(sizes) = sizes {
            let set = |count| {
                IdmSet::from_count(count).ok_or_else(|| {
                    format!("there is no set of {count} modes: 2, 4 or 6, or name the modes (x,z,ry)")
                })
            };
            return sizes.into_iter().map(set).collect::<Result<_, _>>().map(IdmSets);
        }
        let modes: Vec<Dof> = words.iter().map(|w| w.parse()).collect::<Result<_, _>>()?;
        let set = IdmSet::of(&modes).ok_or_else(|| format!("`{text}` names a mode twice"))?;
        Ok(IdmSets(vec![set]))
    }
}

/// FRFs from an npz or a universal file; what was left out is said.
fn read(path: &Path) -> Result<Frf, CliError> {
    let (frf, warnings) = read_frf_file(path).map_err(bad)?;
    for warning in &warnings {
        eprintln!("jointrig: {}: {warning}", path.display());
    }
    Ok(frf)
}

fn band(text: &str) -> Result<Band, String> {
    let wrong = || format!("`{text}` is no band: write LO:HI in Hz, for example 300:600");
    let (low, high) = text.split_once(':').ok_or_else(wrong)?;
    let number = |text: &str| f64::from_str(text.trim()).ok().filter(|f| f.is_finite() && *f >= 0.0);
    let (low_hz, high_hz) = (number(low).ok_or_else(wrong)?, number(high).ok_or_else(wrong)?);
    if low_hz > high_hz {
        return Err(format!("`{text}`: the band ends before it begins"));
    }
    Ok(Band { low_hz, high_hz })
}

fn not_negative(text: &str) -> Result<f64, String> {
    f64::from_str(text)
        .ok()
        .filter(|v| v.is_finite() && *v >= 0.0)
        .ok_or_else(|| format!("`{text}`: a standard deviation is a number, zero or more"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_and_sets_are_read_or_refused_in_words() {
        assert_eq!(band("300:600"), Ok(Band { low_hz: 300.0, high_hz: 600.0 }));
        for wrong in ["300", "600:300", "a:b", "300:inf", "-1:5"] {
            assert!(band(wrong).is_err(), "{wrong}");
        }
        assert_eq!("4".parse(), Ok(IdmSets(vec![IdmSet::Four])));
        assert_eq!("2, 6".parse(), Ok(IdmSets(vec![IdmSet::Two, IdmSet::Six])));
        let chosen = IdmSet::of(&[Dof::X, Dof::Z, Dof::Ry]).expect("three modes");
        assert_eq!("x,z,ry".parse(), Ok(IdmSets(vec![chosen])));
        assert!("3".parse::<IdmSets>().is_err_and(|e| e.contains("2, 4 or 6")));
        assert!("x,q".parse::<IdmSets>().is_err_and(|e| e.contains("`q`")));
        assert!("x,x".parse::<IdmSets>().is_err_and(|e| e.contains("twice")));
        assert!(not_negative("-0.1").is_err() && not_negative("5e-4").is_ok());
    }
}
