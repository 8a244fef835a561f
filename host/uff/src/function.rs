//! A function at a degree of freedom, as data sets 58 and 58b hold it.

use super::number;
use num_complex::Complex;

/// Kinds of function (record 6, field 1). Other kinds are read and written by their number.
pub mod kind {
    /// Unknown.
    pub const GENERAL: i64 = 0;
    /// Time response.
    pub const TIME: i64 = 1;
    /// Auto-spectrum.
    pub const AUTO_SPECTRUM: i64 = 2;
    /// Cross-spectrum.
    pub const CROSS_SPECTRUM: i64 = 3;
    /// Frequency response function.
    pub const FRF: i64 = 4;
    /// Coherence.
    pub const COHERENCE: i64 = 6;
    /// Power spectral density.
    pub const PSD: i64 = 9;
}

/// What an axis measures (records 8 to 11, field 1).
pub mod quantity {
    /// Unknown.
    pub const UNKNOWN: i64 = 0;
    /// Displacement, m.
    pub const DISPLACEMENT: i64 = 8;
    /// Velocity, m/s.
    pub const VELOCITY: i64 = 11;
    /// Acceleration, m/s².
    pub const ACCELERATION: i64 = 12;
    /// Excitation force, N.
    pub const FORCE: i64 = 13;
    /// Time, s.
    pub const TIME: i64 = 17;
    /// Frequency, Hz.
    pub const FREQUENCY: i64 = 18;
}

/// A degree of freedom.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Dof {
    /// Name of the entity, at most 10 characters; empty for none.
    pub entity: String,
    /// Node.
    pub node: i64,
    /// ±1, 2, 3 along x, y, z; ±4, 5, 6 about them; 0 a scalar.
    pub direction: i64,
}

/// Width of the floats of the ordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 4 bytes, or 6 digits.
    Single,
    /// 8 bytes, or 13 digits.
    Double,
}

/// Positions of the values.
#[derive(Debug, Clone, PartialEq)]
pub enum Abscissa {
    /// At start + i × step.
    Even {
        /// Position of the first value.
        start: f64,
        /// The distance between values.
        step: f64,
    },
    /// At these positions, one for each value.
    Uneven(Vec<f64>),
}

impl Abscissa {
    /// Even if `places` equal start and step, as printed in the header, to a millionth of a step;
    /// otherwise uneven.
    pub fn of(places: &[f64]) -> Self {
        let (Some(&start), Some(&last)) = (places.first(), places.last()) else {
            return Abscissa::Uneven(places.to_vec());
        };
        let step = if places.len() > 1 { (last - start) / (places.len() - 1) as f64 } else { 1.0 };
        let even = Abscissa::Even { start: as_printed(start), step: as_printed(step) };
        let fits = places.iter().enumerate().all(|(i, x)| (even.at(i) - x).abs() <= 1e-6 * step.abs());
        if fits { even } else { Abscissa::Uneven(places.to_vec()) }
    }

    /// The position of value `i`; NaN beyond the end of uneven positions.
    pub fn at(&self, i: usize) -> f64 {
        match self {
            Abscissa::Even { start, step } => start + i as f64 * step,
            Abscissa::Uneven(places) => places.get(i).copied().unwrap_or(f64::NAN),
        }
    }
}

/// A number as printed in the 13 columns of the header.
fn as_printed(value: f64) -> f64 {
    let mut text = Vec::new();
    number::print(&mut text, value, 13, 6);
    number::parse(text.trim_ascii()).unwrap_or(f64::NAN)
}

/// The ordinate.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Real.
    Real(Vec<f64>),
    /// Complex.
    Complex(Vec<Complex<f64>>),
}

impl Values {
    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Values::Real(values) => values.len(),
            Values::Complex(values) => values.len(),
        }
    }

    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Description of an axis.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Axis {
    /// Its quantity.
    pub quantity: i64,
    /// Exponents of length, force and temperature.
    pub exponents: [i64; 3],
    /// Its label, at most 20 characters.
    pub label: String,
    /// Its unit, at most 20 characters.
    pub unit: String,
}

/// Byte order of binary values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ByteOrder {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

/// How the values are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// As text (58).
    Ascii,
    /// As IEEE floats (58b).
    Binary(ByteOrder),
}

/// A function at a degree of freedom.
#[derive(Debug, Clone, PartialEq)]
pub struct Function {
    /// Five lines of at most 80 characters; empty for none.
    pub id: [String; 5],
    /// Its kind, see [`kind`].
    pub kind: i64,
    /// Its number.
    pub number: i64,
    /// Its version or position in a sequence.
    pub version: i64,
    /// Load case; 0 is excitation at one point.
    pub load_case: i64,
    /// Position and direction of the response.
    pub response: Dof,
    /// Position and direction of the reference.
    pub reference: Dof,
    /// Width of the values.
    pub precision: Precision,
    /// Positions of the values.
    pub abscissa: Abscissa,
    /// The values.
    pub values: Values,
    /// A third coordinate.
    pub z: f64,
    /// Abscissa, ordinate, ordinate's denominator, z.
    pub axes: [Axis; 4],
    /// How the values are stored.
    pub encoding: Encoding,
}

impl Function {
    /// Values as double-precision text, without names, positions and units: fill in the known
    /// fields with `..Function::new(…)`.
    pub fn new(kind: i64, abscissa: Abscissa, values: Values) -> Self {
        Function {
            id: Default::default(),
            kind,
            number: 0,
            version: 0,
            load_case: 0,
            response: Dof::default(),
            reference: Dof::default(),
            precision: Precision::Double,
            abscissa,
            values,
            z: 0.0,
            axes: Default::default(),
            encoding: Encoding::Ascii,
        }
    }
}
