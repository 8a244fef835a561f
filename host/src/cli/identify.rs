//! `identify`: the joint's stiffness from FRF matrices measured anywhere.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;

use super::error::CliError;
use super::output;
use crate::exchange::{PositionsError, read_frf, read_frf_noise, read_positions};
use crate::results::campaign::{BANDS_HZ, shaped};
use crate::results::{Results, Source, words};
use crate::substructuring::averaged::{Priors, averaged};
use crate::substructuring::noise::FrfNoise;
use crate::substructuring::{Band, FrfMatrix, Geometry, IdmSet, Method, identify};

/// Identify a joint from FRFs of A, B and the assembly, measured anywhere.
///
/// Prints what could be identified; exits with 1 and the reason when anything that was asked for had to be refused.
#[derive(Debug, Args)]
pub struct Identify {
    /// FRFs of substructure A alone (.npz).
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
    /// Decoupling methods, by name [default: all].
    #[arg(long = "method", value_name = "METHOD", value_delimiter = ',')]
    methods: Vec<Method>,
    /// Interface deformation modes of each virtual point: 2, 4 or 6 [default: all three].
    #[arg(long, value_name = "N", value_delimiter = ',', value_parser = idm_set)]
    idms: Vec<IdmSet>,
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
    /// Print results.json on stdout instead of a summary.
    #[arg(long)]
    json: bool,
}

impl Identify {
    pub fn run(self) -> Result<(), CliError> {
        let frf = |path: &Path| read_frf(path).map_err(bad);
        let (a, b, ajb) = (frf(&self.a)?, frf(&self.b)?, frf(&self.ajb)?);
        let (geometry, notes) = read_geometry(&self.geometry)?;
        let noise = read_frf_noise(&self.ajb, &ajb).map_err(bad)?;
        for note in notes {
            eprintln!("jointrig: {note}");
        }
        let methods = if self.methods.is_empty() { Method::ALL.to_vec() } else { self.methods.clone() };
        let idms = if self.idms.is_empty() { IdmSet::ALL.to_vec() } else { self.idms.clone() };
        let bands = if self.bands.is_empty() { default_bands(&ajb)? } else { self.bands.clone() };
        let mut results = Results::new(self.source());
        let found = identify(&a, &b, &ajb, &geometry, &methods, &idms, &bands).map_err(bad)?;
        let (joint, spectrum, refused) = shaped(&found);
        results.joint = joint;
        results.joint_spectrum = spectrum;
        results.refused = refused;
        // the estimates with an interval need whole rigid motions
        if idms.contains(&IdmSet::Six) && methods.contains(&Method::Inverse) {
            self.with_intervals(&mut results, &ajb, noise.as_ref(), &geometry, &bands);
        }
        let printed =
            if self.json { output::json(&results) } else { output::lines(words::summary(&results)) };
        printed?;
        match refusals(&results) {
            Some(reasons) => Err(CliError::Bad(reasons)),
            None => Ok(()),
        }
    }

    /// The recommended estimate over each band.
    fn with_intervals(
        &self,
        results: &mut Results,
        ajb: &FrfMatrix,
        noise: Option<&FrfNoise>,
        geometry: &Geometry,
        bands: &[Band],
    ) {
        let priors = Priors {
            position_m: self.position_error,
            aim_m: self.aim_error,
            hammer_angle_rad: self.angle_error,
        };
        for band in bands {
            // where it cannot be had, the reason is among the refusals of `inverse` already
            if let Ok(estimate) = averaged(ajb, noise, geometry, IdmSet::Six, *band, &priors) {
                results.recommended.push(estimate);
            }
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
fn default_bands(frf: &FrfMatrix) -> Result<Vec<Band>, CliError> {
    let bands: Vec<Band> = BANDS_HZ
        .into_iter()
        .map(|[low_hz, high_hz]| Band { low_hz, high_hz })
        .filter(|band| frf.frequency_hz.iter().any(|f| band.contains(*f)))
        .collect();
    if bands.is_empty() {
        let (first, last) = (frf.frequency_hz.first(), frf.frequency_hz.last());
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

fn idm_set(text: &str) -> Result<IdmSet, String> {
    let count: usize = text.parse().map_err(|_| format!("`{text}` is no number: 2, 4 or 6"))?;
    IdmSet::from_count(count).ok_or_else(|| format!("there is no set of {count} modes: 2, 4 or 6"))
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
        assert_eq!(idm_set("4"), Ok(IdmSet::Four));
        assert!(idm_set("3").is_err_and(|e| e.contains("2, 4 or 6")));
        assert!(not_negative("-0.1").is_err() && not_negative("5e-4").is_ok());
    }
}
