//! Units of measurements in imported files: one table, and a parser for the spellings in labels.
//!
//! A label is a product of symbols with powers: `mm/s`, `(mm/s)/N`, `m s^-2 N^-1`, `M/S**2`,
//! `in/sec²`, `1/kg`. [`Unit::parse`] returns its factor to SI and its dimension; a symbol that is
//! not in the table is an error that names it. For a label without a unit (`NONE`, blank, `-`),
//! [`told`] returns `None`; it means SI unless data set 164 of the file states other units.

use crate::frf::MotionQuantity;
use std::f64::consts::{PI, TAU};
use std::fmt;
use std::str::FromStr;

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.806_65;
/// Pound-force, N.
const POUND: f64 = 4.448_221_615_260_5;
/// Inch, m.
const INCH: f64 = 0.0254;

/// Exponents of length, time, force, angle and any electrical quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dimension {
    length: i8,
    time: i8,
    force: i8,
    angle: i8,
    electrical: i8,
}

impl Dimension {
    const NONE: Dimension = Dimension { length: 0, time: 0, force: 0, angle: 0, electrical: 0 };
    /// m.
    pub const DISPLACEMENT: Dimension = Dimension { length: 1, ..Dimension::NONE };
    /// m/s.
    pub const VELOCITY: Dimension = Dimension { length: 1, time: -1, ..Dimension::NONE };
    /// m/s².
    pub const ACCELERATION: Dimension = Dimension { length: 1, time: -2, ..Dimension::NONE };
    /// N.
    pub const FORCE: Dimension = Dimension { force: 1, ..Dimension::NONE };
    /// s.
    pub const TIME: Dimension = Dimension { time: 1, ..Dimension::NONE };
    /// Hz, as cycles per second.
    pub const FREQUENCY: Dimension = Dimension { time: -1, ..Dimension::NONE };
    /// rad/s.
    const ANGULAR_FREQUENCY: Dimension = Dimension { time: -1, angle: 1, ..Dimension::NONE };
    const VOLTAGE: Dimension = Dimension { electrical: 1, ..Dimension::NONE };
    const MASS: Dimension = Dimension { length: -1, time: 2, force: 1, ..Dimension::NONE };
    const PRESSURE: Dimension = Dimension { length: -2, force: 1, ..Dimension::NONE };
    const ANGLE: Dimension = Dimension { angle: 1, ..Dimension::NONE };

    /// The dimension of a motion.
    pub fn of(motion: MotionQuantity) -> Dimension {
        match motion {
            MotionQuantity::Displacement => Dimension::DISPLACEMENT,
            MotionQuantity::Velocity => Dimension::VELOCITY,
            MotionQuantity::Acceleration => Dimension::ACCELERATION,
        }
    }

    /// This dimension per newton.
    #[must_use]
    pub const fn per_force(self) -> Dimension {
        Dimension { force: self.force - 1, ..self }
    }

    /// Whether this is a quantity per newton.
    pub fn is_per_force(self) -> bool {
        self.force < 0
    }

    /// This dimension for a rotation: rad instead of m.
    #[must_use]
    pub const fn rotating(self) -> Dimension {
        Dimension { length: 0, angle: self.length, ..self }
    }

    /// The factor of a quantity of this dimension, from the factors of length and force.
    pub fn factor(self, length: f64, force: f64) -> f64 {
        length.powi(self.length.into()) * force.powi(self.force.into())
    }

    fn times(self, other: Dimension, power: i8) -> Option<Dimension> {
        let each = |own: i8, more: i8| more.checked_mul(power).and_then(|more| own.checked_add(more));
        Some(Dimension {
            length: each(self.length, other.length)?,
            time: each(self.time, other.time)?,
            force: each(self.force, other.force)?,
            angle: each(self.angle, other.angle)?,
            electrical: each(self.electrical, other.electrical)?,
        })
    }
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let known = [
            (Self::DISPLACEMENT, "a displacement"),
            (Self::VELOCITY, "a velocity"),
            (Self::ACCELERATION, "an acceleration"),
            (Self::FORCE, "a force"),
            (Self::TIME, "a time"),
            (Self::FREQUENCY, "a frequency"),
            (Self::ANGULAR_FREQUENCY, "an angular frequency"),
            (Self::MASS, "a mass"),
            (Self::PRESSURE, "a pressure"),
            (Self::ANGLE, "an angle"),
            (Self::DISPLACEMENT.per_force(), "a receptance"),
            (Self::VELOCITY.per_force(), "a mobility"),
            (Self::ACCELERATION.per_force(), "an accelerance"),
        ];
        if self.electrical != 0 {
            return f.write_str("electrical, a signal before its sensor's sensitivity was applied");
        }
        match known.iter().find(|(dimension, _)| dimension == self) {
            Some((_, name)) => f.write_str(name),
            None => f.write_str("of another quantity"),
        }
    }
}

/// A unit: its factor to SI, its dimension and its spelling.
#[derive(Debug, Clone, PartialEq)]
pub struct Unit {
    /// Factor from this unit to SI.
    pub factor: f64,
    /// Its dimension.
    pub dimension: Dimension,
    /// The part of `factor` that comes from units of force: 1000 for `mm/s/mN`.
    pub of_force: f64,
    /// The spelling in the label.
    pub label: String,
}

/// Why a label is not a unit of the wanted dimension.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum UnitError {
    /// A symbol that is not in the table.
    #[error("`{symbol}` is not a known unit")]
    Unknown {
        /// The symbol.
        symbol: String,
    },
    /// Capitals that may mean two units.
    #[error("`{symbol}` in capitals may be mega- or milli-")]
    Ambiguous {
        /// The symbol.
        symbol: String,
    },
    /// Not a product of symbols.
    #[error("it is not written as a unit")]
    Malformed,
    /// A unit of another dimension.
    #[error("it is {found}, but {} is needed", wanted.iter().map(ToString::to_string).collect::<Vec<_>>().join(" or "))]
    Dimension {
        /// The dimension found.
        found: Dimension,
        /// The dimensions wanted.
        wanted: Vec<Dimension>,
    },
}

/// The unit in a label; `None` for a label without one, such as blank or `NONE`.
pub fn told(label: &str) -> Option<&str> {
    let label = label.trim();
    let inside = label.strip_prefix('[').and_then(|label| label.strip_suffix(']'));
    let bare = inside.filter(|inside| !inside.contains(['[', ']'])).unwrap_or(label).trim();
    let nothing = ["", "-", "--", "none", "n/a", "na", "unknown", "undefined", "no unit", "no units"];
    (!nothing.contains(&bare.to_lowercase().as_str())).then_some(bare)
}

impl Unit {
    /// Parses a label as a unit of one of the dimensions `wanted`. `m/s N` and `m/s*N` are read as
    /// m/(s N) where only that has a wanted dimension.
    ///
    /// # Errors
    /// [`UnitError`] with the unknown symbol or with the dimension found.
    pub fn parse(label: &str, wanted: &[Dimension]) -> Result<Unit, UnitError> {
        let plain = plain(label);
        let capitals = !plain.chars().any(char::is_lowercase);
        let mut found = None;
        for products_first in [true, false] {
            let mut reading = LabelParser { rest: &plain, products_first, capitals, depth: 0 };
            let (factor, dimension, of_force) = reading.quotient()?;
            if !reading.rest.is_empty() {
                return Err(UnitError::Malformed);
            }
            if wanted.contains(&dimension) {
                return Ok(Unit { factor, dimension, of_force, label: label.trim().into() });
            }
            found.get_or_insert(dimension);
        }
        Err(match found {
            Some(found) => UnitError::Dimension { found, wanted: wanted.to_vec() },
            None => UnitError::Malformed,
        })
    }

    /// Parses the label of a frequency axis: hertz, or an angular frequency converted to hertz.
    ///
    /// # Errors
    /// [`UnitError`].
    pub fn of_frequency(label: &str) -> Result<Unit, UnitError> {
        let mut unit =
            Unit::parse(label, &[Dimension::FREQUENCY, Dimension::ANGULAR_FREQUENCY]).map_err(|error| {
                match error {
                    UnitError::Dimension { found, .. } => {
                        UnitError::Dimension { found, wanted: vec![Dimension::FREQUENCY] }
                    }
                    other => other,
                }
            })?;
        if unit.dimension == Dimension::ANGULAR_FREQUENCY {
            unit.factor /= TAU;
            unit.dimension = Dimension::FREQUENCY;
        }
        Ok(unit)
    }
}

/// The label with one spelling of powers, products and prefixes.
fn plain(label: &str) -> String {
    let mut out = String::with_capacity(label.len() + 4);
    let mut raised = false;
    for letter in label.trim().chars() {
        let power = "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().position(|own| own == letter);
        if (power.is_some() || letter == '⁻') && !raised {
            out.push('^');
        }
        raised = power.is_some() || letter == '⁻';
        match (power, letter) {
            (Some(digit), _) => out.extend(char::from_digit(digit as u32, 10)),
            (_, '⁻' | '−' | '–') => out.push('-'),
            (_, 'µ' | 'μ') => out.push('u'),
            (_, '·' | '⋅' | '×' | '∙' | '•') => out.push('*'),
            (_, '÷' | '∕' | '⁄') => out.push('/'),
            (_, '[' | '{') => out.push('('),
            (_, ']' | '}') => out.push(')'),
            (_, letter) => out.push(letter),
        }
    }
    out.replace("**", "^").replace(" per ", "/").replace(" PER ", "/")
}

/// Factor to SI, dimension, and the part of the factor that comes from units of force.
type Product = (f64, Dimension, f64);

const ONE: Product = (1.0, Dimension::NONE, 1.0);

fn times(one: Product, other: Product, power: i8) -> Result<Product, UnitError> {
    let dimension = one.1.times(other.1, power).ok_or(UnitError::Malformed)?;
    Ok((one.0 * other.0.powi(power.into()), dimension, one.2 * other.2.powi(power.into())))
}

/// Parser state of a label. Grammar: quotients of products of powers of symbols.
struct LabelParser<'t> {
    rest: &'t str,
    /// Whether a product binds more tightly than a quotient: `m/s N` is m/(s N).
    products_first: bool,
    /// Whether the label has no lower-case letters.
    capitals: bool,
    depth: u8,
}

/// Deepest nesting of brackets; units have one or two.
const MOST_DEPTH: u8 = 8;

impl LabelParser<'_> {
    fn skip_blanks(&mut self) {
        self.rest = self.rest.trim_start();
    }

    /// Consumes `letter` if the rest begins with it; returns whether it did.
    fn takes(&mut self, letter: char) -> bool {
        let rest = self.rest.trim_start().strip_prefix(letter);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn quotient(&mut self) -> Result<Product, UnitError> {
        let mut all = self.product()?;
        while self.takes('/') {
            let below = if self.products_first { self.product()? } else { self.power()? };
            all = times(all, below, -1)?;
            if !self.products_first {
                all = self.further(all)?;
            }
        }
        Ok(all)
    }

    fn product(&mut self) -> Result<Product, UnitError> {
        let own = self.power()?;
        self.further(own)
    }

    /// Multiplies `all` by the factors that follow.
    fn further(&mut self, mut all: Product) -> Result<Product, UnitError> {
        let begins = |c: char| c.is_alphabetic() || matches!(c, '(' | '°');
        loop {
            self.skip_blanks();
            // a sign before a digit belongs to a power, and a point before a digit to a number
            if let Some(rest) =
                self.rest.strip_prefix(['*', '.', '-']).filter(|rest| rest.starts_with(begins))
            {
                self.rest = rest;
            } else if !self.rest.starts_with(begins) {
                return Ok(all);
            }
            let own = self.power()?;
            all = times(all, own, 1)?;
        }
    }

    fn power(&mut self) -> Result<Product, UnitError> {
        let own = self.atom()?;
        let marked = self.takes('^');
        let bracket = marked && self.takes('(');
        let rest = if marked { self.rest.trim_start() } else { self.rest };
        let sign = usize::from(rest.starts_with(['-', '+']));
        let digits = rest[sign..].bytes().take_while(u8::is_ascii_digit).count();
        if digits == 0 {
            return if marked { Err(UnitError::Malformed) } else { Ok(own) };
        }
        let exponent: i8 = rest[..sign + digits].parse().map_err(|_| UnitError::Malformed)?;
        self.rest = &rest[sign + digits..];
        if (bracket && !self.takes(')')) || exponent.abs() > 9 {
            return Err(UnitError::Malformed);
        }
        times(ONE, own, exponent)
    }

    fn atom(&mut self) -> Result<Product, UnitError> {
        if self.takes('(') {
            self.depth += 1;
            let own = if self.depth < MOST_DEPTH { self.quotient() } else { Err(UnitError::Malformed) };
            self.depth -= 1;
            return own.and_then(|own| if self.takes(')') { Ok(own) } else { Err(UnitError::Malformed) });
        }
        self.skip_blanks();
        // the numerator of 1/kg
        if let Some(rest) =
            self.rest.strip_prefix('1').filter(|r| !r.starts_with(|c: char| c.is_ascii_digit()))
        {
            self.rest = rest;
            return Ok(ONE);
        }
        let is_letter = |c: char| c.is_alphabetic() || matches!(c, '%' | '°' | '"' | '\'' | '_' | '#');
        let end = self.rest.find(|c: char| !is_letter(c)).unwrap_or(self.rest.len());
        // symbols that contain a digit
        let end = if self.rest.starts_with("g0") { 2 } else { end };
        let (name, rest) = self.rest.split_at(end);
        if name.is_empty() {
            return Err(UnitError::Malformed);
        }
        let found = symbol(name, self.capitals)?;
        self.rest = rest;
        Ok(found)
    }
}

/// SI prefixes with their factors.
const PREFIXES: [(&str, f64); 9] = [
    ("p", 1e-12),
    ("n", 1e-9),
    ("u", 1e-6),
    ("m", 1e-3),
    ("c", 1e-2),
    ("d", 1e-1),
    ("k", 1e3),
    ("M", 1e6),
    ("G", 1e9),
];

/// SI prefixes as words.
const PREFIX_WORDS: [(&str, f64); 6] =
    [("nano", 1e-9), ("micro", 1e-6), ("milli", 1e-3), ("centi", 1e-2), ("kilo", 1e3), ("mega", 1e6)];

/// A row of the table: names, factor to SI, dimension, and whether SI prefixes are allowed.
struct KnownUnit {
    names: &'static [&'static str],
    factor: f64,
    dimension: Dimension,
    prefixed: bool,
}

const fn si(names: &'static [&'static str], dimension: Dimension) -> KnownUnit {
    KnownUnit { names, factor: 1.0, dimension, prefixed: true }
}

const fn other(names: &'static [&'static str], factor: f64, dimension: Dimension) -> KnownUnit {
    KnownUnit { names, factor, dimension, prefixed: false }
}

/// Every known unit. A full name takes precedence over a prefix and a name: `min` is a minute, `kg`
/// a kilogram, `ft` a foot.
const TABLE: &[KnownUnit] = &[
    si(&["m", "metre", "meter", "metres", "meters"], Dimension::DISPLACEMENT),
    si(&["s", "sec", "secs", "second", "seconds"], Dimension::TIME),
    si(&["N", "newton", "newtons"], Dimension::FORCE),
    si(&["Hz", "hertz"], Dimension::FREQUENCY),
    si(&["Pa", "pascal"], Dimension::PRESSURE),
    si(&["rad", "radian", "radians"], Dimension::ANGLE),
    si(&["V", "volt", "volts"], Dimension::VOLTAGE),
    si(&["A", "ampere", "amp", "C", "coulomb", "ohm", "Ohm"], Dimension::VOLTAGE),
    other(&["EU", "counts", "count", "cts", "LSB", "adc"], 1.0, Dimension::VOLTAGE),
    other(&["kg", "kilogram", "kilograms"], 1.0, Dimension::MASS),
    // length
    other(&["micron", "microns"], 1e-6, Dimension::DISPLACEMENT),
    other(&["in", "inch", "inches", "\""], INCH, Dimension::DISPLACEMENT),
    other(&["uin", "microinch"], 1e-6 * INCH, Dimension::DISPLACEMENT),
    other(&["mil", "mils", "thou"], 1e-3 * INCH, Dimension::DISPLACEMENT),
    other(&["ft", "foot", "feet"], 12.0 * INCH, Dimension::DISPLACEMENT),
    other(&["yd", "yard"], 36.0 * INCH, Dimension::DISPLACEMENT),
    // velocity and acceleration
    other(&["ips"], INCH, Dimension::VELOCITY),
    other(&["fps"], 12.0 * INCH, Dimension::VELOCITY),
    other(&["mps"], 1.0, Dimension::VELOCITY),
    KnownUnit {
        names: &["g", "gn", "g_n", "G", "gee"],
        factor: GRAVITY,
        dimension: Dimension::ACCELERATION,
        prefixed: true,
    },
    other(&["g0", "grav"], GRAVITY, Dimension::ACCELERATION),
    KnownUnit { names: &["Gal", "gal"], factor: 1e-2, dimension: Dimension::ACCELERATION, prefixed: true },
    // force
    other(&["lbf", "lb", "lbs", "pound", "pounds"], POUND, Dimension::FORCE),
    other(&["klbf", "klb", "kip", "kips"], 1e3 * POUND, Dimension::FORCE),
    other(&["ozf", "oz", "ounce", "ounces"], POUND / 16.0, Dimension::FORCE),
    other(&["pdl", "poundal"], 0.138_254_954_376, Dimension::FORCE),
    other(&["kgf", "kp"], GRAVITY, Dimension::FORCE),
    other(&["gf"], 1e-3 * GRAVITY, Dimension::FORCE),
    other(&["tf"], 1e3 * GRAVITY, Dimension::FORCE),
    other(&["dyn", "dyne", "dynes"], 1e-5, Dimension::FORCE),
    other(&["daN"], 10.0, Dimension::FORCE),
    // time, angle and turns
    other(&["min", "minute", "minutes"], 60.0, Dimension::TIME),
    other(&["h", "hour", "hours", "hr"], 3600.0, Dimension::TIME),
    other(&["deg", "degree", "degrees", "°"], PI / 180.0, Dimension::ANGLE),
    other(&["rev", "revs", "r", "U", "cycle", "cycles", "turn"], TAU, Dimension::ANGLE),
    other(&["rpm", "cpm"], TAU / 60.0, Dimension::ANGULAR_FREQUENCY),
    other(&["cps", "rps"], TAU, Dimension::ANGULAR_FREQUENCY),
    // two symbols written without a separator
    other(&["Ns"], 1.0, Dimension { time: 1, ..Dimension::FORCE }),
    other(&["Nm"], 1.0, Dimension { length: 1, ..Dimension::FORCE }),
    other(&["lbfs"], POUND, Dimension { time: 1, ..Dimension::FORCE }),
    other(&["psi"], POUND / (INCH * INCH), Dimension::PRESSURE),
];

fn symbol(name: &str, capitals: bool) -> Result<Product, UnitError> {
    // MN, MHZ: in capitals these may mean MN and MHz, or mN and mHz
    let behind_mega = name.strip_prefix('M').map(str::to_lowercase);
    if capitals && behind_mega.is_some_and(|rest| ["n", "hz", "pa", "v"].contains(&rest.as_str())) {
        return Err(UnitError::Ambiguous { symbol: name.into() });
    }
    let lower = name.to_lowercase();
    exactly(name, str::eq)
        .or_else(|| exactly(&lower, str::eq_ignore_ascii_case))
        .ok_or_else(|| UnitError::Unknown { symbol: name.into() })
}

/// The unit of this name; `same` compares names.
fn exactly(name: &str, same: impl Fn(&str, &str) -> bool) -> Option<Product> {
    let product = |row: &KnownUnit, prefix: f64| {
        let factor = prefix * row.factor;
        (factor, row.dimension, if row.dimension.force == 0 { 1.0 } else { factor })
    };
    let named = |name: &str| TABLE.iter().find(|row| row.names.iter().any(|own| same(own, name)));
    if let Some(row) = named(name) {
        return Some(product(row, 1.0));
    }
    PREFIXES.iter().chain(&PREFIX_WORDS).find_map(|(prefix, factor)| {
        let row = named(name.strip_prefix(prefix)?).filter(|row| row.prefixed)?;
        // a megametre, a megasecond or a giga-g is probably a spelling mistake
        let likely = *factor < 1e6
            || !matches!(row.dimension, Dimension::DISPLACEMENT | Dimension::TIME | Dimension::ACCELERATION);
        likely.then(|| product(row, *factor))
    })
}

/// Units that the user states, which override those of a file: `response=mm/s,force=lbf`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StatedUnits {
    /// Unit of the motion, or of the motion per force.
    pub response: Option<String>,
    /// Unit of the force.
    pub force: Option<String>,
    /// Unit of the frequency lines of FRFs.
    pub frequency: Option<String>,
    /// Unit of the sampling times.
    pub time: Option<String>,
}

impl FromStr for StatedUnits {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let motions = [Dimension::DISPLACEMENT, Dimension::VELOCITY, Dimension::ACCELERATION];
        let mut all = StatedUnits::default();
        for part in text.split(',').filter(|_| !text.trim().is_empty()) {
            let form =
                "write response=UNIT, force=UNIT, frequency=UNIT or time=UNIT, with commas between them";
            let Some((name, label)) = part.split_once('=') else { return Err(format!("`{part}`: {form}")) };
            let (name, label) = (name.trim(), label.trim());
            let (place, checked) = match name {
                "response" => {
                    let wanted = [motions, motions.map(Dimension::per_force)].concat();
                    (&mut all.response, Unit::parse(label, &wanted))
                }
                "force" => (&mut all.force, Unit::parse(label, &[Dimension::FORCE])),
                "frequency" => (&mut all.frequency, Unit::of_frequency(label)),
                "time" => (&mut all.time, Unit::parse(label, &[Dimension::TIME])),
                _ => return Err(format!("`{name}` cannot have a unit: {form}")),
            };
            checked.map_err(|error| format!("{name}={label}: {error}"))?;
            if place.replace(label.into()).is_some() {
                return Err(format!("the unit of {name} is given twice"));
            }
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(label: &str, wanted: Dimension, factor: f64) {
        let unit = Unit::parse(label, &[wanted]).unwrap_or_else(|error| panic!("{label}: {error}"));
        assert!((unit.factor / factor - 1.0).abs() < 1e-12, "{label}: {} for {factor}", unit.factor);
    }

    #[test]
    fn every_way_of_writing_a_unit_gives_its_factor() {
        let (x, v, a, f) =
            (Dimension::DISPLACEMENT, Dimension::VELOCITY, Dimension::ACCELERATION, Dimension::FORCE);
        for (label, wanted, factor) in [
            ("m", x, 1.0),
            ("MM", x, 1e-3),
            ("µm", x, 1e-6),
            ("μm", x, 1e-6),
            ("um", x, 1e-6),
            ("UM", x, 1e-6),
            ("micrometer", x, 1e-6),
            ("nm", x, 1e-9),
            ("Mm", x, 1e-3),
            ("mil", x, 2.54e-5),
            ("[in]", x, 0.0254),
            ("mm/s", v, 1e-3),
            ("MM/SEC", v, 1e-3),
            ("m s^-1", v, 1.0),
            ("m·s⁻¹", v, 1.0),
            ("in/s", v, 0.0254),
            ("ips", v, 0.0254),
            ("mm per s", v, 1e-3),
            ("mm/ms", v, 1.0),
            ("m/s2", a, 1.0),
            ("m/s^2", a, 1.0),
            ("m/s**2", a, 1.0),
            ("M/S^2", a, 1.0),
            ("m/s²", a, 1.0),
            ("m/s/s", a, 1.0),
            ("m*s^(-2)", a, 1.0),
            ("mm/s²", a, 1e-3),
            ("in/sec^2", a, 0.0254),
            ("ft/s2", a, 0.3048),
            ("g", a, 9.80665),
            ("G", a, 9.80665),
            ("gn", a, 9.80665),
            ("g0", a, 9.80665),
            ("mg", a, 9.80665e-3),
            ("Gal", a, 1e-2),
            ("mGal", a, 1e-5),
            ("N", f, 1.0),
            ("mN", f, 1e-3),
            ("kN", f, 1e3),
            ("KN", f, 1e3),
            ("µN", f, 1e-6),
            ("lbf", f, 4.448_221_615_260_5),
            ("LBF", f, 4.448_221_615_260_5),
            ("ozf", f, 4.448_221_615_260_5 / 16.0),
            ("kgf", f, 9.80665),
            ("dyn", f, 1e-5),
            ("kg m/s^2", f, 1.0),
        ] {
            close(label, wanted, factor);
        }
        for (label, motion, factor) in [
            ("(mm/s)/N", v, 1e-3),
            ("m/s/N", v, 1.0),
            ("m/(s N)", v, 1.0),
            ("m/s N", v, 1.0),
            ("m/s*N", v, 1.0),
            ("m/Ns", v, 1.0),
            ("[m/s]/[N]", v, 1.0),
            ("m s^-2 N^-1", a, 1.0),
            ("(m/s^2)/N", a, 1.0),
            ("m/s²/N", a, 1.0),
            ("m/(N·s²)", a, 1.0),
            ("m/s^2 N", a, 1.0),
            ("g/N", a, 9.80665),
            ("G/LBF", a, 9.80665 / 4.448_221_615_260_5),
            ("(in/s^2)/lbf", a, 0.0254 / 4.448_221_615_260_5),
            ("1/kg", a, 1.0),
            ("kg^-1", a, 1.0),
            ("mm/N", x, 1e-3),
            ("um/kN", x, 1e-9),
            ("mm/s/mN", v, 1.0),
            ("mm/s/MN", v, 1e-9),
        ] {
            close(label, motion.per_force(), factor);
        }
        let of_force = |label: &str| {
            Unit::parse(label, &[v.per_force()]).unwrap_or_else(|error| panic!("{label}: {error}")).of_force
        };
        assert!((of_force("mm/s/mN") - 1e3).abs() < 1e-9 && (of_force("mm/s/N") - 1.0).abs() < 1e-12);
    }

    #[test]
    fn frequencies_are_hertz_whatever_they_are_counted_in() {
        for (label, factor) in [
            ("Hz", 1.0),
            ("HZ", 1.0),
            ("hz", 1.0),
            ("kHz", 1e3),
            ("rad/s", 1.0 / TAU),
            ("rad/sec", 1.0 / TAU),
            ("rad s^-1", 1.0 / TAU),
            ("krad/s", 1e3 / TAU),
            ("deg/s", 1.0 / 360.0),
            ("rpm", 1.0 / 60.0),
            ("RPM", 1.0 / 60.0),
            ("r/min", 1.0 / 60.0),
            ("1/min", 1.0 / 60.0),
            ("1/s", 1.0),
            ("cycles/s", 1.0),
            ("cps", 1.0),
        ] {
            let unit = Unit::of_frequency(label).unwrap_or_else(|error| panic!("{label}: {error}"));
            assert!((unit.factor / factor - 1.0).abs() < 1e-12, "{label}: {}", unit.factor);
        }
        for (label, factor) in [("s", 1.0), ("ms", 1e-3), ("MS", 1e-3), ("µs", 1e-6), ("min", 60.0)] {
            close(label, Dimension::TIME, factor);
        }
    }

    #[test]
    fn what_is_no_such_unit_is_named() {
        let said = |label: &str, wanted| Unit::parse(label, &[wanted]).expect_err(label).to_string();
        let force = Dimension::FORCE;
        for label in ["V", "mV", "mV/V", "pC", "A", "EU", "counts"] {
            assert!(
                said(label, force).contains("sensitivity") || label == "mV/V",
                "{label}: {}",
                said(label, force)
            );
        }
        assert!(said("mV/V", force).contains("a force is needed"));
        assert!(said("furlong", Dimension::DISPLACEMENT).contains("`furlong`"));
        assert!(said("mm/fortnight", Dimension::VELOCITY).contains("`fortnight`"));
        assert!(said("MN", force).contains("mega- or milli-"));
        assert!(said("m/s", Dimension::ACCELERATION).contains("a velocity, but an acceleration is needed"));
        assert!(said("m/s", Dimension::VELOCITY.per_force()).contains("a mobility is needed"));
        for malformed in
            ["m/", "(m", "m)", "m^", "m^x", "/", "^2", "m//s", "m^99", "3 m", "m.", "((((((((((m))))))))))"]
        {
            assert!(Unit::parse(malformed, &[Dimension::DISPLACEMENT]).is_err(), "{malformed}");
        }
        for silent in ["", " ", "NONE", "none", "-", "[]", "[-]", "N/A", "Unknown"] {
            assert_eq!(told(silent), None, "{silent:?}");
        }
        assert_eq!(told(" [mm/s] "), Some("mm/s"));
    }

    #[test]
    fn stated_units_are_read_or_refused_in_words() {
        let stated: StatedUnits = "response=mm/s, force=lbf".parse().expect("units");
        assert_eq!((stated.response.as_deref(), stated.force.as_deref()), (Some("mm/s"), Some("lbf")));
        assert!("response=(mm/s)/N,frequency=rad/s,time=ms".parse::<StatedUnits>().is_ok());
        for (wrong, part) in [
            ("mm/s", "response=UNIT"),
            ("colour=red", "`colour`"),
            ("force=mV", "sensitivity"),
            ("force=N,force=lbf", "given twice"),
            ("response=N", "a force"),
        ] {
            let said = wrong.parse::<StatedUnits>().expect_err(wrong);
            assert!(said.contains(part), "{wrong}: {said}");
        }
    }
}
