//! The axes of a universal file's functions: types and labels of ordinate, denominator and
//! abscissa, the units in data set 164, and the number of digits with which the abscissa was
//! printed.

use super::uff::{Abscissa, Axis, Contents, DataSet, Encoding, Function, Units, quantity};
use super::units::{Dimension, StatedUnits, Unit, told};
use crate::spectra::MotionQuantity;

/// Data set 164: factors by which SI values are multiplied to give the file's values.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct UnitSystem {
    length: f64,
    force: f64,
    description: String,
}

/// Factors of length and force for each unit code of data set 164.
const CODES: [(i64, &str, f64, f64); 9] = [
    (1, "m and N", 1.0, 1.0),
    (2, "ft and lbf", 1.0 / 0.3048, 1.0 / 4.448_221_615_260_5),
    (3, "m and kgf", 1.0, 1.0 / 9.806_65),
    (4, "ft and pdl", 1.0 / 0.3048, 1.0 / 0.138_254_954_376),
    (5, "mm and mN", 1e3, 1e3),
    (6, "cm and cN", 1e2, 1e2),
    (7, "in and lbf", 1.0 / 0.0254, 1.0 / 4.448_221_615_260_5),
    (8, "mm and kgf", 1e3, 1.0 / 9.806_65),
    (10, "mm and N", 1e3, 1.0),
];

/// Factors with a smaller relative difference are equal: writers print at least four digits.
const SAME_FACTOR: f64 = 1e-3;

fn same_factor(one: f64, other: f64) -> bool {
    (one / other - 1.0).abs() < SAME_FACTOR
}

impl UnitSystem {
    fn of(units: &Units) -> Result<Self, String> {
        let Units { code, length, force, .. } = units;
        for (what, factor) in [("length", *length), ("force", *force)] {
            if !(factor.is_finite() && factor > 0.0) {
                return Err(format!("data set 164 has {factor} for the factor of {what}: it must be over 0"));
            }
        }
        if let Some((_, names, own_length, own_force)) = CODES.iter().find(|(own, ..)| own == code)
            && !(same_factor(*length, *own_length) && same_factor(*force, *own_force))
        {
            return Err(format!(
                "data set 164 contradicts itself: its code {code} means {names}, but its factors are {length} for length and {force} for force"
            ));
        }
        let description = units.description.trim().to_owned();
        Ok(UnitSystem { length: *length, force: *force, description })
    }

    /// Factor from the file's unit of this dimension to SI.
    fn factor(&self, dimension: Dimension) -> f64 {
        dimension.factor(1.0 / self.length, 1.0 / self.force)
    }

    fn is_si(&self) -> bool {
        same_factor(self.length, 1.0) && same_factor(self.force, 1.0)
    }

    fn words(&self) -> String {
        let factors = format!("{} to the metre, {} to the newton", self.length, self.force);
        match self.description.as_str() {
            "" => format!("data set 164 ({factors})"),
            description => format!("data set 164 (`{description}`: {factors})"),
        }
    }
}

/// Every function of a file with the data set 164 that precedes it.
///
/// # Errors
/// A data set 164 that cannot be read or contradicts itself.
pub(super) fn with_units(contents: &Contents) -> Result<Vec<(&Function, Option<UnitSystem>)>, String> {
    if let Some(fault) = contents.faults.iter().find(|fault| fault.data_set == 164) {
        return Err(format!("the units of the file cannot be read ({fault}): export it again"));
    }
    let (mut system, mut all) = (None, Vec::new());
    for set in &contents.sets {
        match set {
            DataSet::Units(units) => system = Some(UnitSystem::of(units)?),
            DataSet::Function(function) => all.push((&**function, system.clone())),
            _ => {}
        }
    }
    Ok(all)
}

/// The unit of one axis: its factor to SI, and its description for messages.
struct AxisUnit {
    factor: f64,
    /// For a motion per force: the part of the factor that comes from the force.
    per_force: Option<f64>,
    dimension: Dimension,
    words: String,
}

/// An axis, and what determines its unit.
struct LabelledAxis<'a> {
    /// `ordinate`, `denominator`, `abscissa`.
    name: &'a str,
    axis: &'a Axis,
    system: Option<&'a UnitSystem>,
    stated: Option<&'a str>,
    /// The key of `--units` that states this unit.
    key: &'a str,
}

impl LabelledAxis<'_> {
    /// Its unit, of the first of the dimensions `wanted` that fits.
    fn unit(&self, wanted: &[Dimension]) -> Result<AxisUnit, String> {
        let LabelledAxis { name, axis, system, stated, key } = self;
        let made = |unit: Unit, words: String| {
            let is_ratio = wanted.contains(&unit.dimension) && unit.dimension.is_per_force();
            AxisUnit {
                factor: unit.factor,
                per_force: is_ratio.then_some(unit.of_force),
                dimension: unit.dimension,
                words,
            }
        };
        if let Some(label) = stated {
            let unit = Unit::parse(label, wanted)
                .map_err(|error| format!("`--units {key}={label}` does not fit the {name}: {error}"))?;
            return Ok(made(unit, format!("{label} as stated")));
        }
        let Some(label) = told(&axis.unit) else {
            let dimension = wanted[0];
            let (factor, words) = match system {
                Some(system) if !system.is_si() => (system.factor(dimension), system.words()),
                Some(_) => (1.0, "SI by data set 164".into()),
                None => (1.0, "SI, because there is no label".into()),
            };
            return Ok(AxisUnit { factor, per_force: None, dimension, words });
        };
        let unit = Unit::parse(label, wanted).map_err(|error| {
            format!(
                "the {name} is labelled `{label}`: {error}; correct the label, or state its unit with `--units {key}=UNIT`"
            )
        })?;
        if let Some(system) = system.filter(|system| !same_factor(unit.factor, system.factor(unit.dimension)))
        {
            return Err(format!(
                "the {name} is labelled `{label}`, which contradicts {}: correct one of them, or state the unit with `--units {key}=UNIT`",
                system.words()
            ));
        }
        Ok(made(unit, label.into()))
    }
}

/// The motions that an ordinate's type allows, with their dimensions.
fn motions(axis: &Axis) -> Result<Vec<(MotionQuantity, Dimension)>, String> {
    let all = [
        (quantity::DISPLACEMENT, MotionQuantity::Displacement, Dimension::DISPLACEMENT),
        (quantity::VELOCITY, MotionQuantity::Velocity, Dimension::VELOCITY),
        (quantity::ACCELERATION, MotionQuantity::Acceleration, Dimension::ACCELERATION),
    ];
    let own: Vec<_> = all
        .iter()
        .filter(|(kind, ..)| [*kind, quantity::UNKNOWN].contains(&axis.quantity))
        .map(|(_, motion, dimension)| (*motion, *dimension))
        .collect();
    match own.len() {
        0 => Err(format!(
            "the ordinate is of type {}: 8 (displacement), 11 (velocity) or 12 (acceleration) is needed",
            type_name(axis.quantity)
        )),
        _ => Ok(own),
    }
}

/// The number of an axis type with its meaning.
pub(super) fn type_name(kind: i64) -> String {
    let known = [
        (quantity::UNKNOWN, "unknown"),
        (1, "general"),
        (2, "stress"),
        (3, "strain"),
        (5, "temperature"),
        (quantity::DISPLACEMENT, "displacement"),
        (9, "reaction force"),
        (quantity::VELOCITY, "velocity"),
        (quantity::ACCELERATION, "acceleration"),
        (quantity::FORCE, "force"),
        (15, "pressure"),
        (16, "mass"),
        (quantity::TIME, "time"),
        (quantity::FREQUENCY, "frequency"),
        (19, "revolutions per minute"),
        (20, "order"),
    ];
    match known.iter().find(|(own, _)| *own == kind) {
        Some((_, name)) => format!("{kind} ({name})"),
        None => kind.to_string(),
    }
}

/// The scale of values: their factor to SI, their quantity, and a description for messages.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scale {
    pub factor: f64,
    pub quantity: MotionQuantity,
    /// For example `mobility in (mm/s)/N`.
    pub words: String,
    /// What is uncertain.
    pub note: Option<String>,
}

/// Dimensions allowed for a motion; for a rotation, the angular ones too.
fn wanted_of(motions: &[(MotionQuantity, Dimension)], rotates: bool) -> Vec<Dimension> {
    let own = motions.iter().map(|(_, dimension)| *dimension);
    if rotates { own.clone().map(Dimension::rotating).chain(own).collect() } else { own.collect() }
}

fn rotates(f: &Function) -> bool {
    (4..=6).contains(&f.response.direction.saturating_abs())
}

/// The motion whose unit has this dimension, where the type left it open.
fn decided(
    motions: &[(MotionQuantity, Dimension)],
    dimension: Dimension,
    is_told: bool,
) -> Result<MotionQuantity, String> {
    let of = |(_, own): &&(MotionQuantity, Dimension)| {
        [*own, own.rotating(), own.per_force(), own.rotating().per_force()].contains(&dimension)
    };
    match motions {
        [(only, _)] => Ok(*only),
        _ if !is_told => Err(
            "the ordinate is of type 0 (unknown) and has no unit: 8 (displacement), 11 (velocity) or 12 (acceleration) is needed".into(),
        ),
        _ => motions.iter().find(of).map(|(motion, _)| *motion).ok_or_else(|| "the ordinate is not a motion".into()),
    }
}

/// The scale of an FRF's values: motion per force.
pub(super) fn frf_scale(
    f: &Function,
    system: Option<&UnitSystem>,
    stated: &StatedUnits,
) -> Result<Scale, String> {
    let [_, ordinate, denominator, _] = &f.axes;
    let motions = motions(ordinate)?;
    let note = is_force(denominator, stated)?;
    let place = |name, axis, stated, key| LabelledAxis { name, axis, system, stated, key };
    let top = place("ordinate", ordinate, stated.response.as_deref(), "response");
    let own = wanted_of(&motions, rotates(f));
    let ratios: Vec<Dimension> = own.iter().map(|d| d.per_force()).collect();
    let above = top.unit(&[own, ratios].concat())?;
    let is_told = top.stated.is_some() || told(&ordinate.unit).is_some();
    let motion = decided(&motions, above.dimension, is_told)?;
    let bottom = place("denominator", denominator, stated.force.as_deref(), "force");
    let name = motion.frf_name();
    if let Some(of_force) = above.per_force {
        // the label includes the force already: a separate force unit must be the same
        let is_told = bottom.stated.is_some() || told(&denominator.unit).is_some();
        let below = if is_told { Some(bottom.unit(&[Dimension::FORCE])?) } else { None };
        if let Some(below) = below.filter(|below| !same_factor(below.factor * of_force, 1.0)) {
            return Err(format!(
                "the ordinate is in {} and the denominator in {}: these are two units of force; correct one of them, or state both with `--units response=UNIT,force=UNIT`",
                above.words, below.words
            ));
        }
        return Ok(Scale {
            factor: above.factor,
            quantity: motion,
            words: format!("{name} in {}", above.words),
            note,
        });
    }
    let below = bottom.unit(&[Dimension::FORCE])?;
    let words = if above.words == below.words {
        format!("{name} in {}", above.words)
    } else {
        format!("{name}: {} in {}, force in {}", motion.name(), above.words, below.words)
    };
    Ok(Scale { factor: above.factor / below.factor, quantity: motion, words, note })
}

/// Refuses a denominator that is not a force; returns a note where its type is unknown.
fn is_force(denominator: &Axis, stated: &StatedUnits) -> Result<Option<String>, String> {
    match (denominator.quantity, denominator.exponents) {
        (quantity::FORCE | 9, _) => Ok(None),
        (quantity::UNKNOWN, [0, 0, 0]) if stated.force.is_none() && told(&denominator.unit).is_none() => {
            Ok(Some("the denominator's type is 0 (unknown): it is taken for a force".into()))
        }
        (quantity::UNKNOWN, [0, 0 | 1, 0]) => Ok(None),
        (other, _) => Err(format!(
            "the denominator is of type {}: an FRF here is a motion per force (type 13), and this is not one (a transmissibility?)",
            type_name(other)
        )),
    }
}

/// The factor from a frequency axis to Hz, and a description where it is not 1.
pub(super) fn frequency_scale(axis: &Axis, stated: &StatedUnits) -> Result<(f64, Option<String>), String> {
    if ![quantity::FREQUENCY, quantity::UNKNOWN].contains(&axis.quantity) && stated.frequency.is_none() {
        return Err(format!(
            "the abscissa is of type {}: 18 (frequency) is needed",
            type_name(axis.quantity)
        ));
    }
    let label = stated.frequency.as_deref().or(told(&axis.unit));
    let Some(label) = label else { return Ok((1.0, None)) };
    let unit = Unit::of_frequency(label).map_err(|error| {
        format!("the abscissa is labelled `{label}`: {error}; correct the label, or state its unit with `--units frequency=UNIT`")
    })?;
    Ok((unit.factor, (unit.factor != 1.0).then(|| format!("frequency in {label}"))))
}

/// The factor from a time axis to s, and a description where it is not 1.
pub(super) fn time_scale(axis: &Axis, stated: &StatedUnits) -> Result<(f64, Option<String>), String> {
    if ![quantity::TIME, quantity::UNKNOWN].contains(&axis.quantity) && stated.time.is_none() {
        return Err(format!("the abscissa is of type {}: 17 (time) is needed", type_name(axis.quantity)));
    }
    let place =
        LabelledAxis { name: "abscissa", axis, system: None, stated: stated.time.as_deref(), key: "time" };
    let unit = place.unit(&[Dimension::TIME])?;
    Ok((unit.factor, (unit.factor != 1.0).then(|| format!("time in {}", unit.words))))
}

/// The factor from a force over time to N, and a description of its unit.
pub(super) fn force_scale(
    f: &Function,
    system: Option<&UnitSystem>,
    stated: &StatedUnits,
) -> Result<(f64, String), String> {
    let place = LabelledAxis {
        name: "force",
        axis: &f.axes[1],
        system,
        stated: stated.force.as_deref(),
        key: "force",
    };
    place.unit(&[Dimension::FORCE]).map(|unit| (unit.factor, unit.words))
}

/// The scale of a motion over time.
pub(super) fn motion_scale(
    f: &Function,
    system: Option<&UnitSystem>,
    stated: &StatedUnits,
) -> Result<Scale, String> {
    let axis = &f.axes[1];
    let motions = motions(axis)?;
    let stated = stated.response.as_deref();
    let place = LabelledAxis { name: "response", axis, system, stated, key: "response" };
    let unit = place.unit(&wanted_of(&motions, rotates(f)))?;
    let motion = decided(&motions, unit.dimension, stated.is_some() || told(&axis.unit).is_some())?;
    Ok(Scale {
        factor: unit.factor,
        quantity: motion,
        words: format!("{} in {}", motion.name(), unit.words),
        note: None,
    })
}

/// A function's abscissa values in SI, and the error of each that its printed digits allow.
#[derive(Debug, Clone, Copy)]
pub(super) struct Places<'f> {
    abscissa: &'f Abscissa,
    encoding: Encoding,
    factor: f64,
}

impl<'f> Places<'f> {
    /// Abscissa of a function; `factor` converts it to SI.
    pub fn of(f: &'f Function, factor: f64) -> Self {
        Places { abscissa: &f.abscissa, encoding: f.encoding, factor }
    }

    /// Whether two abscissas are written identically.
    pub fn are(&self, other: &Places<'_>) -> bool {
        (self.factor, self.encoding) == (other.factor, other.encoding) && self.abscissa == other.abscissa
    }

    /// The abscissa of value `i`.
    pub fn at(&self, i: usize) -> f64 {
        self.factor * self.abscissa.at(i)
    }

    /// The error bound of the abscissa of value `i`.
    pub fn error(&self, i: usize) -> f64 {
        let is_single = |number: f64| f64::from(number as f32) == number;
        let of = |number: f64| match (self.abscissa, self.encoding) {
            // places next to values of double precision may be single
            (Abscissa::Uneven(_), Encoding::Binary(_)) if is_single(number) => single_precision(number),
            _ => half_of_last_digit(number),
        };
        let own = match self.abscissa {
            Abscissa::Even { start, step } => of(*start) + i as f64 * of(*step),
            Abscissa::Uneven(_) => of(self.abscissa.at(i)),
        };
        self.factor.abs() * own
    }
}

/// Relative rounding of a number in single precision.
const SINGLE: f64 = 6e-8;

/// The error bound of a number stored in single precision: the rounding of that precision, and of a
/// number with so few digits that it was printed before, also half a unit of its last digit.
fn single_precision(number: f64) -> f64 {
    let single = number as f32;
    let digits =
        format!("{:e}", single.abs()).bytes().take_while(|b| *b != b'e').filter(u8::is_ascii_digit).count();
    let rounding = SINGLE * number.abs();
    if digits > LEAST_DIGITS as usize {
        return rounding;
    }
    let printed = format!("{single:e}").parse().map_or(0.0, half_of_last_digit);
    rounding + printed
}

/// Digits that columns of 13 hold at least; trailing zeros among them do not show in the parsed
/// number.
const LEAST_DIGITS: i32 = 6;

/// Most digits of a number that was printed into columns of 13.
const MOST_DIGITS: usize = 8;

/// Half a unit of the last digit that a number was printed with; for a number with more digits than
/// a column of 13 holds, the rounding of an f64.
pub(super) fn half_of_last_digit(number: f64) -> f64 {
    if number == 0.0 || !number.is_finite() {
        return 0.0;
    }
    let text = format!("{:e}", number.abs());
    let Some((digits, exponent)) = text.split_once('e') else { return 0.0 };
    let count = digits.len() - usize::from(digits.contains('.'));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if count > MOST_DIGITS {
        return f64::EPSILON * number.abs();
    }
    let count = i32::try_from(count).unwrap_or(LEAST_DIGITS).max(LEAST_DIGITS);
    0.5 * 10f64.powi(exponent - count + 1)
}

/// When samples were taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sampling {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// Error bound of the rate, Hz.
    pub fs_error: f64,
    /// Time of the first sample, s.
    pub start_s: f64,
    /// Error bound of that time, s.
    pub start_error_s: f64,
}

impl Sampling {
    /// Sampling of evenly spaced samples; listed times count as even where their digits allow it.
    ///
    /// # Errors
    /// The samples are not evenly spaced, or there is no valid rate.
    pub fn of(places: &Places<'_>, samples: usize) -> Result<Self, String> {
        let (start_s, start_error_s) = (places.at(0), places.error(0));
        let (step, step_error) = match places.abscissa {
            Abscissa::Even { step, .. } => {
                (places.factor * step, places.factor.abs() * half_of_last_digit(*step))
            }
            Abscissa::Uneven(_) => {
                let last = samples.saturating_sub(1).max(1);
                let step = (places.at(last) - start_s) / last as f64;
                let uneven = |i: usize| {
                    let expected = start_s + i as f64 * step;
                    let error = start_error_s + places.error(i) + places.error(last) + 1e-9 * step.abs();
                    (places.at(i) - expected).abs() > error
                };
                if let Some(i) = (0..samples).find(|i| uneven(*i)) {
                    return Err(format!(
                        "its samples are not evenly spaced (sample {i} is at {} s): resample it",
                        places.at(i)
                    ));
                }
                (step, (start_error_s + places.error(last)) / last as f64)
            }
        };
        let rate = 1.0 / step;
        if !(rate.is_finite() && rate > 0.0 && start_s.is_finite()) {
            return Err(format!("its time step is {step} s"));
        }
        // the largest step gives the lowest rate; 1e-9 is added for the rounding of these sums
        let error = step_error * (1.0 + 1e-9);
        let (low, high) = (1.0 / (step + error), 1.0 / (step - error).max(f64::MIN_POSITIVE));
        let fs_hz = roundest(low, high).unwrap_or(rate);
        Ok(Sampling { fs_hz, fs_error: high - low, start_s, start_error_s })
    }
}

/// The whole number between two bounds with the most trailing zeros: the likely rate before its
/// step was rounded for printing. `None` where there is no whole number between the bounds.
fn roundest(low: f64, high: f64) -> Option<f64> {
    let slack = 1e-9 * high;
    let (low, high) = (low - slack, high + slack);
    (0..=9).rev().find_map(|zeros| {
        let unit = 10f64.powi(zeros);
        let found = (high / unit).floor() * unit;
        (found >= low && found > 0.0).then_some(found)
    })
}

#[cfg(test)]
mod tests {
    use super::super::uff::{Values, kind};
    use super::*;

    fn axis(quantity: i64, unit: &str) -> Axis {
        Axis { quantity, unit: unit.into(), ..Axis::default() }
    }

    fn frf(ordinate: (i64, &str), denominator: (i64, &str)) -> Function {
        let mut f =
            Function::new(kind::FRF, Abscissa::Even { start: 0.0, step: 1.0 }, Values::Complex(vec![]));
        f.axes = [
            axis(18, "Hz"),
            axis(ordinate.0, ordinate.1),
            axis(denominator.0, denominator.1),
            Axis::default(),
        ];
        f
    }

    fn units(code: i64, description: &str, length: f64, force: f64) -> Units {
        Units { code, description: description.into(), length, force, ..Units::si() }
    }

    #[test]
    fn labels_of_ordinate_and_denominator_are_applied_once() {
        let millimetres = UnitSystem::of(&units(9, "mm, N, s", 1e3, 1.0)).expect("factors");
        for (ordinate, denominator, system, factor) in [
            ((11, ""), (13, ""), None, 1.0),
            ((11, "mm/s"), (13, "N"), None, 1e-3),
            ((11, "mm/s"), (13, "mN"), None, 1.0),
            ((11, "mm/s"), (13, ""), None, 1e-3),
            ((11, "(mm/s)/N"), (13, ""), None, 1e-3),
            ((11, "(mm/s)/N"), (13, "N"), None, 1e-3),
            ((11, "(mm/s)/kN"), (13, "kN"), None, 1e-6),
            ((12, "g"), (13, "lbf"), None, 9.80665 / 4.448_221_615_260_5),
            ((12, "1/kg"), (13, "N"), None, 1.0),
            ((0, "mm/s²"), (13, "N"), None, 1e-3),
            ((11, ""), (13, ""), Some(&millimetres), 1e-3),
            ((11, "mm/s"), (13, "N"), Some(&millimetres), 1e-3),
            ((12, "(mm/s^2)/N"), (13, ""), Some(&millimetres), 1e-3),
        ] {
            let scale = frf_scale(&frf(ordinate, denominator), system, &StatedUnits::default());
            let scale = scale.unwrap_or_else(|error| panic!("{ordinate:?} {denominator:?}: {error}"));
            assert!((scale.factor / factor - 1.0).abs() < 1e-9, "{ordinate:?} {denominator:?}: {scale:?}");
        }
        let stated: StatedUnits = "response=mm/s,force=lbf".parse().expect("units");
        let scale = frf_scale(&frf((11, "wrong"), (13, "mV")), Some(&millimetres), &stated).expect("stated");
        assert!((scale.factor * 1e3 * 4.448_221_615_260_5 - 1.0).abs() < 1e-9, "{scale:?}");
    }

    #[test]
    fn what_contradicts_itself_is_refused_with_both_named() {
        let si = UnitSystem::of(&units(1, "SI", 1.0, 1.0)).expect("factors");
        let millimetres = UnitSystem::of(&units(10, "mm and N", 1e3, 1.0)).expect("factors");
        for (ordinate, denominator, system, parts) in [
            ((11, "mm/s"), (13, "N"), Some(&si), ["`mm/s`", "data set 164"]),
            ((11, "m/s"), (13, "N"), Some(&millimetres), ["`m/s`", "data set 164 (`mm and N`"]),
            ((11, ""), (13, "kN"), Some(&millimetres), ["`kN`", "data set 164"]),
            ((11, "m/s^2"), (13, "N"), None, ["`m/s^2`", "a velocity"]),
            ((11, "(mm/s)/N"), (13, "mN"), None, ["(mm/s)/N", "mN"]),
            ((11, "mm/s"), (13, "mV"), None, ["`mV`", "denominator"]),
            ((12, ""), (12, "m/s^2"), None, ["denominator", "12 (acceleration)"]),
            ((12, ""), (8, ""), None, ["denominator", "8 (displacement)"]),
            ((12, ""), (0, "m/s^2"), None, ["denominator", "a force"]),
            ((13, ""), (13, ""), None, ["ordinate", "13 (force)"]),
            ((0, ""), (13, ""), None, ["ordinate", "0 (unknown)"]),
        ] {
            let said =
                frf_scale(&frf(ordinate, denominator), system, &StatedUnits::default()).expect_err("refused");
            assert!(parts.iter().all(|part| said.contains(part)), "{ordinate:?} {denominator:?}: {said}");
        }
        for wrong in [
            units(5, "mm", 1.0, 1.0),
            units(1, "SI", 1e3, 1.0),
            units(9, "", 0.0, 1.0),
            units(9, "", f64::NAN, 1.0),
        ] {
            assert!(UnitSystem::of(&wrong).expect_err("refused").contains("data set 164"));
        }
        let unknown = frf_scale(&frf((12, "m/s^2"), (0, "")), None, &StatedUnits::default()).expect("read");
        assert!(unknown.note.expect("a word").contains("unknown"));
        let stated: StatedUnits = "response=g".parse().expect("a unit");
        let said = frf_scale(&frf((11, ""), (13, "")), None, &stated).expect_err("no velocity");
        assert!(said.contains("response=g") && said.contains("a velocity"), "{said}");
    }

    #[test]
    fn rates_are_what_they_were_before_their_step_was_printed() {
        let sampled = |abscissa: Abscissa| {
            let f = Function::new(kind::TIME, abscissa, Values::Real(vec![]));
            Sampling::of(&Places::of(&f, 1.0), 4096).map(|sampling| sampling.fs_hz)
        };
        for rate in [
            51_200.0, 65_536.0, 48_000.0, 44_100.0, 10_240.0, 12_800.0, 25_600.0, 204_800.0, 102_400.0,
            2048.0,
        ] {
            let printed: f64 = format!("{:.5e}", 1.0 / rate).parse().expect("a number");
            assert_eq!(sampled(Abscissa::Even { start: 0.0, step: printed }), Ok(rate));
            let listed = |digits: usize| {
                let place = |i: usize| format!("{:.digits$e}", i as f64 / rate).parse().expect("a number");
                Abscissa::Uneven((0..4096).map(place).collect())
            };
            assert_eq!(sampled(listed(5)), Ok(rate));
            assert_eq!(sampled(listed(16)), Ok(rate));
        }
        // no whole number within the printed digits: the rate as printed
        for rate in [51_200.0 / 3.0, 12_800.5, 1000.0 / 7.0] {
            let found = sampled(Abscissa::Even { start: 0.0, step: 1.0 / rate }).expect("a rate");
            assert!((found / rate - 1.0).abs() < 1e-12, "{found}");
        }
        let mut times: Vec<f64> = (0..4096).map(|i| f64::from(i) * 1e-3).collect();
        times[7] += 1e-5;
        assert!(sampled(Abscissa::Uneven(times)).expect_err("uneven").contains("sample 7"));
        for step in [0.0, -1.0, f64::NAN] {
            assert!(sampled(Abscissa::Even { start: 0.0, step }).expect_err("no rate").contains("time step"));
        }
    }

    #[test]
    fn digits_are_counted_from_the_number() {
        for (number, half) in
            [(300.0, 5e-4), (19.9219, 5e-5), (1.953_125e-5, 0.5e-11), (-0.25, 5e-7), (0.0, 0.0)]
        {
            assert!((half_of_last_digit(number) - half).abs() <= 1e-12 * half, "{number}");
        }
        assert!(half_of_last_digit(1.0 / 3.0) < 1e-15);
    }
}
