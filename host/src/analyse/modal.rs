//! The modes of one structure from its matrix of FRFs; [`crate::modes`] does the identification.
//!
//! FRFs of several impacts are never quite those of one linear structure: each aim at a cell has an
//! error of place and direction, so residues are not of rank one within the noise. With the noise
//! alone as variance, every such difference would be evidence for further modes, and the
//! identification of a campaign would take many minutes. The variances therefore include an error
//! of the FRFs themselves ([`FRF_ERROR`]).
//!
//! Of a campaign, the arms' outputs and one impact along each axis are used, with lines at most
//! [`STEP_HZ`] apart: the modes of both arms are in every column, and all columns would take ten
//! times as long.

use super::assemble;
use crate::exchange::LabelledFrf;
use crate::exchange::labelled_frf::Label;
use crate::frf::{Frf, FrfError};
use crate::modes::{self, DrivingPoint, Modes, ModesError, OutputPoint, Settings};
use crate::structure::Structure;
use crate::substructuring::Band;
use crate::substructuring::geometry::{Configuration, Point};
use nalgebra::DMatrix;
use num_complex::Complex;

/// The modes of one structure.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundModes {
    /// The structure; `None` for FRFs of a file.
    pub structure: Option<Structure>,
    /// Modes, residual terms and stabilisation chart.
    pub modes: Modes,
    /// Place and direction of each output, as far as they are known.
    pub points: Vec<OutputPoint>,
    /// Error of the FRFs in addition to their noise, relative.
    pub frf_error: f64,
    /// Number of driving points, which fix the scale of the shapes.
    pub driving_points: usize,
    /// Outputs and inputs that are not used because some of their FRFs are missing.
    pub left_out: Vec<String>,
    /// Why the variances of the FRFs are not used; then their error is `frf_error` alone, or, if
    /// that is zero, estimated from the residuals.
    pub without_variance: Option<String>,
}

/// Error of FRFs in addition to their noise, as a fraction of the FRFs' root mean square at the
/// line and of the value: an aim that is off by 0.5 mm at a lever of 50 mm.
pub const FRF_ERROR: f64 = 0.01;

/// The band in which a campaign's modes are identified, Hz: lower lines contain the drift after the
/// hammer's hit, and at higher ones arms of a real rig have many modes, which errors of place and
/// direction make uncertain.
pub const MODES_HZ: Band = Band { low_hz: 20.0, high_hz: 600.0 };

/// Largest distance of the lines used of a campaign, Hz: the exponential window alone makes every
/// peak about as wide.
const STEP_HZ: f64 = 1.0;

/// Most work of the search in a campaign's structure: some 20 s. The FRFs of a good campaign need a
/// hundredth of it.
const MOST_WORK: u64 = 10_000_000_000;

/// Where and how modes are searched for.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Search {
    /// The band.
    band: Band,
    /// Error of the FRFs in addition to their noise, relative.
    frf_error: f64,
    /// As in [`Settings`].
    most_work: u64,
}

/// Why a structure has no modes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NoModes {
    /// No cell has a value at every line of the band.
    #[error("no FRF has a value at every line from {} to {} Hz", .0.low_hz, .0.high_hz)]
    NoWholeCell(Band),
    /// They cannot be identified.
    #[error(transparent)]
    Modes(#[from] ModesError),
}

/// The band of all lines of these FRFs above 0 Hz.
fn whole_band(frf: &Frf) -> Band {
    let lines = frf.frequency_hz();
    let low_hz = lines.iter().copied().find(|f| *f > 0.0).unwrap_or(0.0);
    Band { low_hz, high_hz: lines.last().copied().unwrap_or(0.0) }
}

impl FoundModes {
    /// The modes of `frf`. Outputs and inputs with missing values are left out; `points_of` gives
    /// place and direction of outputs, `driving_points` the driving points of what is left.
    fn of(
        structure: Option<Structure>,
        frf: &Frf,
        Search { band, frf_error, most_work }: Search,
        points_of: impl Fn(&str) -> OutputPoint,
        driving_points: impl Fn(&Frf) -> Vec<DrivingPoint>,
    ) -> Result<Self, NoModes> {
        let (frf, left_out) = without_gaps(&frf.band(band.low_hz, band.high_hz), band)?;
        let settings = Settings { driving_points: driving_points(&frf), most_work, ..Settings::of(band) };
        let why = frf.variance().is_none().then(|| "the FRFs have no variance".to_owned());
        let (modes, without_variance) = match modes::identify(&with_error(&frf, frf_error)?, &settings) {
            Err(error @ ModesError::UnknownVariance { .. }) => {
                let frf = with_error(&frf.without_noise(), frf_error)?;
                (modes::identify(&frf, &settings)?, Some(error.to_string()))
            }
            found => (found?, why),
        };
        let points = modes.outputs.iter().map(|name| points_of(name)).collect();
        let driving_points = settings.driving_points.len();
        Ok(FoundModes { structure, modes, points, frf_error, driving_points, left_out, without_variance })
    }

    /// The modes of FRFs of a file or of arrays, in this band or on all their lines.
    ///
    /// # Errors
    /// [`NoModes`].
    pub fn of_labelled(read: &LabelledFrf, band: Option<Band>, frf_error: f64) -> Result<Self, NoModes> {
        let band = band.unwrap_or_else(|| whole_band(&read.frf));
        Self::of(
            None,
            &read.frf,
            Search { band, frf_error, most_work: Settings::of(band).most_work },
            |output| labelled_point(read, output),
            |frf| labelled_driving_points(frf, read),
        )
    }

    /// The modes of a campaign's structure: from the outputs on its arms and one impact along each
    /// axis.
    ///
    /// # Errors
    /// [`NoModes`].
    pub fn of_structure(
        structure: Structure,
        frf: &Frf,
        points: &Configuration,
        band: Band,
    ) -> Result<Self, NoModes> {
        let frf = few_columns(&few_lines(&frf.band(band.low_hz, band.high_hz))?, points, band)?;
        Self::of(
            Some(structure),
            &frf,
            Search { band, frf_error: FRF_ERROR, most_work: MOST_WORK },
            |name| of_points(points, name),
            |frf| driving_points(frf, points),
        )
    }
}

/// Every n-th line, at most [`STEP_HZ`] apart.
fn few_lines(frf: &Frf) -> Result<Frf, ModesError> {
    let lines = frf.frequency_hz();
    let step_hz = lines.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    // lines of 0.5 Hz have a rounding error
    let every = if step_hz > 0.0 { ((STEP_HZ / step_hz) + 1e-6) as usize } else { 1 }.max(1);
    if every == 1 {
        return Ok(frf.clone());
    }
    let (outputs, inputs) = (frf.outputs().to_vec(), frf.inputs().to_vec());
    let kept = Frf::new(
        lines.iter().copied().step_by(every).collect(),
        frf.sigma_per_s(),
        frf.quantity(),
        outputs,
        inputs,
        frf.lines().iter().step_by(every).cloned().collect(),
    )?;
    Ok(match frf.variance() {
        Some(variance) => kept.with_variance(variance.iter().step_by(every).cloned().collect())?,
        None => kept,
    })
}

/// The outputs on arms, and of each axis the impact on an arm with the largest ratio of FRFs to
/// noise; all impacts on arms if none is along an axis.
fn few_columns(frf: &Frf, points: &Configuration, band: Band) -> Result<Frf, NoModes> {
    let on_arm = |names: &[String], all: &[Point], known: &[String]| -> Vec<String> {
        let keep = |name: &&String| {
            known.iter().position(|own| own == *name).is_none_or(|at| !all[at].grouping.is_specimen())
        };
        names.iter().filter(keep).cloned().collect()
    };
    let outputs = on_arm(frf.outputs(), &points.channels, &points.output_names());
    let inputs = on_arm(frf.inputs(), &points.impacts, &points.input_names());
    let of_arms = frf.select(&outputs, &inputs).map_err(ModesError::Frf)?;
    // the median over the cells of how far the values stand above the noise; cells without values
    // count as zero
    let clear = |i: usize| {
        let of_output = |o: usize| {
            let of_line = |(l, line): (usize, &DMatrix<Complex<f64>>)| {
                let variance = of_arms.variance().map_or(1.0, |all| all[l][(o, i)]);
                line[(o, i)].norm_sqr() / variance
            };
            let sum: f64 = of_arms.lines().iter().enumerate().map(of_line).sum();
            if sum.is_finite() { sum.ln_1p() } else { 0.0 }
        };
        (0..outputs.len()).map(of_output).sum::<f64>()
    };
    let impact = |name: &String| {
        points.input_names().iter().position(|own| own == name).map(|at| points.impacts[at].direction)
    };
    let clear: Vec<f64> = (0..inputs.len()).map(clear).collect();
    let best_along = |axis: usize| {
        (0..inputs.len())
            .filter(|i| clear[*i] > 0.0 && impact(&inputs[*i]).is_some_and(|d| d[axis].abs() > 0.9))
            .max_by(|a, b| clear[*a].total_cmp(&clear[*b]))
    };
    let mut chosen: Vec<usize> = (0..3).filter_map(best_along).collect();
    if chosen.is_empty() {
        chosen = (0..inputs.len()).filter(|i| clear[*i] > 0.0).collect();
    }
    if chosen.is_empty() {
        return Err(NoModes::NoWholeCell(band));
    }
    let chosen: Vec<String> = chosen.into_iter().map(|i| inputs[i].clone()).collect();
    Ok(of_arms.select(&outputs, &chosen).map_err(ModesError::Frf)?)
}

/// The same FRFs, their variances enlarged by the relative error, which is all that FRFs without
/// variances have then.
fn with_error(frf: &Frf, error: f64) -> Result<Frf, ModesError> {
    if error == 0.0 {
        return Ok(frf.clone());
    }
    let enlarged = frf.lines().iter().enumerate().map(|(l, line)| {
        let mean_square = line.norm_squared() / line.len().max(1) as f64;
        // half of the squared modulus is the real part's share
        let own = line.map(|y| 0.5 * error * error * (mean_square + y.norm_sqr()));
        match frf.variance() {
            Some(variance) => own + &variance[l],
            None => own,
        }
    });
    let enlarged = enlarged.collect();
    Ok(frf.clone().with_variance(enlarged)?)
}

/// The largest part of the matrix that has all its values, and the names of what is left out.
fn without_gaps(frf: &Frf, band: Band) -> Result<(Frf, Vec<String>), NoModes> {
    let (outputs, inputs) = (frf.outputs(), frf.inputs());
    let finite = |o: usize, i: usize| frf.lines().iter().all(|line| line[(o, i)].is_finite());
    let whole: Vec<bool> = (0..outputs.len() * inputs.len())
        .map(|cell| finite(cell / inputs.len(), cell % inputs.len()))
        .collect();
    if whole.iter().all(|whole| *whole) {
        return Ok((frf.clone(), Vec::new()));
    }
    let (rows, columns) = assemble::complete(outputs.len(), inputs.len(), |o, i| whole[o * inputs.len() + i]);
    if rows.is_empty() || columns.is_empty() {
        return Err(NoModes::NoWholeCell(band));
    }
    let of = |names: &[String], kept: &[usize]| kept.iter().map(|k| names[*k].clone()).collect::<Vec<_>>();
    let kept = [of(outputs, &rows), of(inputs, &columns)];
    let left_out = [(outputs, &rows), (inputs, &columns)]
        .into_iter()
        .flat_map(|(names, kept)| {
            names.iter().enumerate().filter(|(at, _)| !kept.contains(at)).map(|(_, name)| name.clone())
        })
        .collect();
    let selected = frf.select(&kept[0], &kept[1]).map_err(|error: FrfError| ModesError::Frf(error))?;
    Ok((selected, left_out))
}

/// Place and direction of an output of a structure whose points are known.
pub fn of_points(points: &Configuration, output: &str) -> OutputPoint {
    let names = points.output_names();
    match names.iter().position(|name| name == output) {
        Some(at) => {
            let Point { name, position_m, direction, .. } = &points.channels[at];
            OutputPoint { name: name.clone(), position_m: Some(*position_m), direction: Some(*direction) }
        }
        None => OutputPoint { name: output.into(), position_m: None, direction: None },
    }
}

/// Greatest distance of an impact and a sensor that are at the same place, m.
const SAME_PLACE_M: f64 = 1e-4;

/// Least |cosine| of the angle between an impact and a channel along the same line.
const SAME_LINE: f64 = 0.999;

/// Impacts at the place and along the line of a channel.
fn driving_points(frf: &Frf, points: &Configuration) -> Vec<DrivingPoint> {
    let point = |names: Vec<String>, all: &'_ [Point], name: &str| {
        names.iter().position(|own| own == name).map(|at| all[at].clone())
    };
    let mut found = Vec::new();
    for (output, o) in frf.outputs().iter().zip(0..) {
        for (input, i) in frf.inputs().iter().zip(0..) {
            let Some(channel) = point(points.output_names(), &points.channels, output) else { continue };
            let Some(impact) = point(points.input_names(), &points.impacts, input) else { continue };
            let along = channel.direction().dot(&impact.direction());
            if (channel.position() - impact.position()).norm() < SAME_PLACE_M && along.abs() > SAME_LINE {
                found.push(DrivingPoint { output: o, input: i, sign: along.signum() });
            }
        }
    }
    found
}

/// Outputs and inputs of `frf` whose labels in the file it was read from name the same place and
/// axis; labels without an axis say nothing about it.
fn labelled_driving_points(frf: &Frf, read: &LabelledFrf) -> Vec<DrivingPoint> {
    let label = |names: &[String], labels: &[Label], name: &String| {
        names.iter().position(|own| own == name).and_then(|at| labels.get(at).cloned())
    };
    let mut found = Vec::new();
    for (name, output) in frf.outputs().iter().zip(0..) {
        let Some(sensor) = label(read.frf.outputs(), &read.outputs, name) else { continue };
        for (name, input) in frf.inputs().iter().zip(0..) {
            let Some(impact) = label(read.frf.inputs(), &read.inputs, name) else { continue };
            let same = sensor.name == impact.name && sensor.direction.abs() == impact.direction.abs();
            if same && sensor.direction != 0 {
                let sign = (sensor.direction.signum() * impact.direction.signum()) as f64;
                found.push(DrivingPoint { output, input, sign });
            }
        }
    }
    found
}

/// Place and direction of an output according to its label in a file, or to the axis in its name,
/// as in `A1:x`.
fn labelled_point(read: &LabelledFrf, output: &str) -> OutputPoint {
    let label = read.frf.outputs().iter().position(|own| own == output).map(|at| &read.outputs[at]);
    let axis = |axis: usize| {
        let mut direction = [0.0; 3];
        if let Some(along) = direction.get_mut(axis) {
            *along = 1.0;
        }
        direction
    };
    let named = output
        .rsplit_once(':')
        .and_then(|(name, a)| Some((name, ["x", "y", "z"].iter().position(|own| *own == a)?)));
    match (label.filter(|label| (1..=3).contains(&label.direction)), named) {
        (Some(label), _) => {
            let direction = Some(axis(label.direction as usize - 1));
            OutputPoint { name: label.name.clone(), position_m: None, direction }
        }
        (None, Some((name, a))) => {
            OutputPoint { name: name.into(), position_m: None, direction: Some(axis(a)) }
        }
        (None, None) => OutputPoint { name: output.into(), position_m: None, direction: None },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frf::MotionQuantity;
    use crate::substructuring::geometry::Grouping;

    const BAND: Band = Band { low_hz: 10.0, high_hz: 20.0 };

    /// Two channels on an arm and one on a specimen; impacts along z (two), y and x.
    fn points() -> Configuration {
        let point = |name: &str, description: &str, grouping, direction| Point {
            name: name.into(),
            description: description.into(),
            grouping,
            position_m: [0.01, 0.0, 0.0],
            direction,
        };
        let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let impact = |name: &str, direction| point(name, name, Grouping::InterfaceA, direction);
        Configuration {
            channels: vec![
                point("A1", "A1:z", Grouping::InterfaceA, z),
                point("A1", "A1:x", Grouping::InterfaceA, x),
                point("S1", "S1:z", Grouping::SpecimenA, z),
            ],
            impacts: vec![impact("Z1", [0.0, 0.0, -1.0]), impact("Z2", z), impact("Y1", y), impact("X1", x)],
        }
    }

    /// Lines of 0.5 Hz, all values one; the variance of `Z2` is a tenth of the others'.
    fn frf() -> Frf {
        let points = points();
        let frequency_hz: Vec<f64> = (20..=40).map(|k| 0.5 * f64::from(k)).collect();
        let lines = vec![DMatrix::from_element(3, 4, Complex::from(1.0)); frequency_hz.len()];
        let variance = DMatrix::from_fn(3, 4, |_, i| if i == 1 { 1e-5 } else { 1e-4 });
        let variance = vec![variance; lines.len()];
        let (outputs, inputs) = (points.output_names(), points.input_names());
        let whole = Frf::new(frequency_hz, 2.3, MotionQuantity::Velocity, outputs, inputs, lines);
        whole.expect("all agree").with_variance(variance).expect("all agree")
    }

    #[test]
    fn of_each_axis_the_clearest_impact_is_used_and_no_specimen() {
        let few = few_columns(&frf(), &points(), BAND).expect("columns");
        assert_eq!(few.inputs(), ["X1", "Y1", "Z2"]);
        assert_eq!(few.outputs().len(), 2);
        // a column with a gap is not as clear as a complete one
        let holed = frf().map_lines(|_, mut y| y[(0, 1)] = Complex::new(f64::NAN, 0.0));
        let few = few_columns(&holed, &points(), BAND).expect("columns");
        assert_eq!(few.inputs(), ["X1", "Y1", "Z1"]);
    }

    #[test]
    fn lines_are_one_hertz_apart_and_keep_their_variance() {
        let few = few_lines(&frf()).expect("lines");
        assert_eq!(few.frequency_hz(), [10.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0, 17.0, 18.0, 19.0, 20.0]);
        assert_eq!(few.variance().map(<[_]>::len), Some(11));
    }

    #[test]
    fn the_error_adds_to_the_variance_and_gaps_leave_out_what_they_belong_to() {
        let enlarged = with_error(&frf(), 0.1).expect("variances");
        let variance = enlarged.variance().expect("there")[0][(0, 0)];
        assert!((variance - (1e-4 + 0.01)).abs() < 1e-12, "{variance}");
        let without = with_error(&frf().without_noise(), 0.1).expect("variances");
        let variance = without.variance().expect("there")[0][(0, 0)];
        assert!((variance - 0.01).abs() < 1e-12, "{variance}");
        assert!(with_error(&frf().without_noise(), 0.0).expect("none").variance().is_none());
        let holed = frf().map_lines(|_, mut y| y[(0, 1)] = Complex::new(f64::NAN, 0.0));
        let (kept, left_out) = without_gaps(&holed, BAND).expect("some are whole");
        assert!(kept.check_finite().is_ok() && left_out.len() == 1, "{left_out:?}");
        let none = frf().map_lines(|_, mut y| y.fill(Complex::new(f64::NAN, 0.0)));
        assert_eq!(without_gaps(&none, BAND), Err(NoModes::NoWholeCell(BAND)));
    }

    #[test]
    fn an_impact_at_a_channel_along_its_line_is_a_driving_point() {
        let all = driving_points(&frf(), &points());
        let of_a1 = |at: &&DrivingPoint| at.output == 0;
        let signs: Vec<f64> = all.iter().filter(of_a1).map(|at| at.sign).collect();
        assert_eq!(signs, [-1.0, 1.0]);
    }
}
