//! `identify`: the joint's stiffness from FRF matrices measured anywhere.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;

use super::analyse::{where_to_look, write_into};
use super::error::CliError;
use super::output;
use crate::analyse::{Asked, IdmSets, Question};
use crate::exchange::{StatedUnits, read_frf_file, read_geometry};
use crate::report::{document, words};
use crate::results::Source;
use crate::substructuring::averaged::Priors;
use crate::substructuring::fit;
use crate::substructuring::{Band, Configuration, Frf};
use crate::untrusted_text::tell_line;

/// Identify a joint from any FRFs of A, B and the assembly.
///
/// The first line is the result; messages about parts of the files that could not be used follow.
/// Exits with 1 and the reasons if nothing was identified, or if a method or set of modes that was
/// named gave no result.
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
    /// Positions of sensors and impacts: the pyFBS workbook (.xlsx), a folder of its tables as
    /// .csv, or .toml.
    #[arg(long, value_name = "FILE")]
    geometry: PathBuf,
    /// Decoupling methods, by name [default: all that work line by line]; `fit`, which takes a few
    /// seconds for each band, runs only if named.
    #[arg(long = "method", value_name = "METHOD", value_delimiter = ',')]
    methods: Vec<Asked>,
    /// For `fit`: full symmetric K and C instead of diagonal ones.
    #[arg(long)]
    full_joint: bool,
    /// For `fit` of files without `variance`: noise of each value's real and imaginary part, as a
    /// fraction of the file's rms at the line.
    #[arg(long, value_name = "FRACTION", value_parser = not_negative)]
    noise: Option<f64>,
    /// Interface deformation modes of each virtual point: 2, 4 or 6 (several with commas), or one
    /// set by the names of its modes, for example x,z,ry; x…rz are rigid, ex…bzy flexible as in
    /// pyFBS. May be repeated [default: 2,4,6].
    #[arg(long, value_name = "N|MODES")]
    idms: Vec<IdmSets>,
    /// Bands in Hz, ends included [default: 300:600, 100:800 and 100:300, limited to the files'
    /// range].
    #[arg(long = "band", value_name = "LO:HI", value_delimiter = ',', value_parser = band)]
    bands: Vec<Band>,
    /// Position error of sensors and impacts relative to the geometry, m (standard deviation along
    /// each axis).
    #[arg(long, value_name = "M", default_value_t = Priors::default().position_m, value_parser = not_negative)]
    position_error: f64,
    /// Additional position error of each new aim at a cell, m.
    #[arg(long, value_name = "M", default_value_t = Priors::default().aim_m, value_parser = not_negative)]
    aim_error: f64,
    /// The hammer's tilt error, rad.
    #[arg(long, value_name = "RAD", default_value_t = Priors::default().hammer_angle_rad, value_parser = not_negative)]
    angle_error: f64,
    /// For `fit`: difference of A and B alone from A and B in the assembly (standard deviation), as
    /// a fraction of their admittance.
    #[arg(long, value_name = "FRACTION", default_value_t = fit::Options::default().mounting, value_parser = not_negative)]
    mounting_error: f64,
    /// Units that override those of the files' labels: response=mm/s,force=lbf,frequency=rad/s.
    #[arg(long, value_name = "UNITS", default_value = "")]
    units: StatedUnits,
    /// Folder for results.json and report.html.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print results.json on stdout instead of a summary.
    #[arg(long)]
    json: bool,
}

impl Identify {
    pub fn run(self) -> Result<(), CliError> {
        let (geometry, notes) = read_geometry(&self.geometry).map_err(bad)?;
        for note in notes {
            tell_line!("jointrig: {note}");
        }
        let read = |path, points| read(path, points, &self.units);
        let [a, b, ajb] =
            [read(&self.a, &geometry.a)?, read(&self.b, &geometry.b)?, read(&self.ajb, &geometry.ajb)?];
        let question = self.question();
        let found = question.answered(self.source(), [a, b, ajb], &geometry).map_err(bad)?;
        let results = document(found);
        if let Some(folder) = &self.out {
            write_into(&results, folder, &[])?;
        }
        if self.json {
            output::json(&results)?;
        } else {
            output::lines(words::brief::between_the_arms(&results))?;
            output::lines(words::summary(&results))?;
            output::lines(self.out.iter().map(|folder| where_to_look(folder)))?;
        }
        question.was_answered(&results).map_err(CliError::Bad)
    }

    fn question(&self) -> Question {
        Question {
            methods: self.methods.clone(),
            idms: self.idms.iter().flat_map(|sets| sets.0.iter().copied()).collect(),
            bands: self.bands.clone(),
            priors: Priors {
                position_m: self.position_error,
                aim_m: self.aim_error,
                hammer_angle_rad: self.angle_error,
            },
            full_joint: self.full_joint,
            noise: self.noise,
            mounting: self.mounting_error,
        }
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

fn bad(error: impl std::fmt::Display) -> CliError {
    CliError::Bad(error.to_string())
}

/// Reads FRFs from an npz or a universal file, along the directions of the geometry's points;
/// prints what was used, left out or reversed.
fn read(path: &Path, points: &Configuration, units: &StatedUnits) -> Result<Frf, CliError> {
    let read = read_frf_file(path, units).map_err(bad)?;
    let (taken, notes) = (read.taken.clone(), read.notes.clone());
    let (frf, turned) = read.along(points).map_err(|what| bad(format!("{}: {what}", path.display())))?;
    tell_line!("jointrig: {}: {}", path.display(), [&[taken], &turned[..]].concat().join(", "));
    for note in &notes {
        tell_line!("jointrig: {}: {note}", path.display());
    }
    Ok(frf)
}

/// A band in Hz, ends included.
pub(super) fn band(text: &str) -> Result<Band, String> {
    let wrong = || format!("`{text}` is not a band: write LO:HI in Hz, for example 300:600");
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
    fn bands_are_read_or_refused_in_words() {
        assert_eq!(band("300:600"), Ok(Band { low_hz: 300.0, high_hz: 600.0 }));
        for wrong in ["300", "600:300", "a:b", "300:inf", "-1:5"] {
            assert!(band(wrong).is_err(), "{wrong}");
        }
        assert!(not_negative("-0.1").is_err() && not_negative("5e-4").is_ok());
    }
}
