//! The header (the eleven lines before the values) and the values of data sets 58 and 58b.
//!
//! Text: 6E13.5 for single precision, 4E20.12 for double, with 2(E13.5,E20.12) and E13.5,2E20.12 if
//! abscissa values are stored with double values. Binary: the same sequence of numbers as IEEE
//! floats. Abscissa values with double values are written as double, as common programs do; 4-byte
//! abscissa values with 8-byte values, as in the standard, are also read.

use crate::function::{Abscissa, Axis, ByteOrder, Dof, Encoding, Function, Precision, Values};
use crate::lines::Output;
use crate::lines::{Lines, Record, Span, Words, Wrong, integer, real, unless_none};
use crate::number;
use num_complex::Complex;

impl ValueShape {
    /// Number of numbers per value: its abscissa value if stored, and one or two parts.
    fn numbers(&self) -> usize {
        usize::from(!self.even) + 1 + usize::from(self.complex)
    }
}

/// Widths in bytes of abscissa value and part that a file may have, the most likely first.
fn widths(shape: &ValueShape) -> [(usize, usize); 3] {
    match (shape.precision, shape.even) {
        (Precision::Single, _) => [(4, 4), (8, 8), (8, 4)],
        (Precision::Double, _) => [(8, 8), (4, 8), (4, 4)],
    }
}

/// Bytes of all values with these widths.
fn bytes_for(shape: &ValueShape, (place, part): (usize, usize)) -> Option<usize> {
    let places = if shape.even { 0 } else { place };
    shape.points.checked_mul(places + part * (1 + usize::from(shape.complex)))
}

/// Possible byte counts of the data of a 58b: the count that its header states, and those that
/// follow from its form of data. Writers disagree.
pub(super) fn byte_counts(identifier: Span<'_>, header: Span<'_>) -> Vec<usize> {
    let identifier = String::from_utf8_lossy(identifier.bytes);
    let announced: Option<usize> = identifier.split_whitespace().nth(4).and_then(|word| word.parse().ok());
    let mut counts: Vec<usize> = Vec::new();
    if let Some(shape) = shape_of(header) {
        counts.extend(widths(&shape).into_iter().filter_map(|w| bytes_for(&shape, w)));
    }
    counts.extend(announced);
    counts
}

/// Values in binary.
pub(super) fn read_binary(
    data: Span<'_>,
    shape: &ValueShape,
    identifier: Span<'_>,
) -> Result<(Abscissa, Values, Encoding), Wrong> {
    let wrong = |reason: String| Wrong { offset: identifier.offset, reason };
    let identifier = String::from_utf8_lossy(identifier.bytes);
    let mut words = identifier.split_whitespace().skip(1);
    let order = match words.next() {
        Some("1") => ByteOrder::Little,
        Some("2") => ByteOrder::Big,
        other => {
            return Err(wrong(format!(
                "the byte order is `{}`: 1 (little) or 2 (big) is known",
                other.unwrap_or("")
            )));
        }
    };
    if let Some(format) = words.next().filter(|format| !["2", "0"].contains(format)) {
        return Err(wrong(format!(
            "the floats are of format `{format}`: only 2 (IEEE 754) is known, write the file in it"
        )));
    }
    let fitting = widths(shape).into_iter().find(|w| bytes_for(shape, *w) == Some(data.bytes.len()));
    let Some((place, part)) = fitting else {
        let reason = format!("{} bytes of binary data do not make {} values", data.bytes.len(), shape.points);
        return Err(Wrong { offset: data.offset, reason });
    };
    let float = |bytes: &[u8]| match (bytes, order) {
        (&[a, b, c, d], ByteOrder::Little) => f32::from_le_bytes([a, b, c, d]).into(),
        (&[a, b, c, d], ByteOrder::Big) => f32::from_be_bytes([a, b, c, d]).into(),
        (&[a, b, c, d, e, f, g, h], ByteOrder::Little) => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        (&[a, b, c, d, e, f, g, h], ByteOrder::Big) => f64::from_be_bytes([a, b, c, d, e, f, g, h]),
        // widths are 4 or 8
        _ => f64::NAN,
    };
    let place = if shape.even { 0 } else { place };
    let all = data.bytes.chunks_exact((place + part * (1 + usize::from(shape.complex))).max(1));
    let places = if shape.even { Vec::new() } else { all.clone().map(|v| float(&v[..place])).collect() };
    let values = if shape.complex {
        Values::Complex(
            all.map(|v| Complex::new(float(&v[place..place + part]), float(&v[place + part..]))).collect(),
        )
    } else {
        Values::Real(all.map(|v| float(&v[place..])).collect())
    };
    Ok((abscissa(shape, places), values, Encoding::Binary(order)))
}

/// Bytes of a number in text, including its blank: the standard's columns have 13 and 20.
const NARROWEST: usize = 6;
/// Number of numbers that may be narrower, as in manually typed files of zeros.
const NARROW: usize = 1 << 20;

/// Reads values in text: by columns, or by words if the columns are not the standard's.
pub(super) fn read_text(lines: Lines<'_>, shape: &ValueShape) -> Result<(Abscissa, Values, Encoding), Wrong> {
    let start = lines.offset();
    let wanted = shape.points.checked_mul(shape.numbers());
    let wrong = |there: &str| {
        let reason =
            format!("{} values of {} numbers each are announced, but {there}", shape.points, shape.numbers());
        Wrong { offset: start, reason }
    };
    let there = lines.rest().len();
    let Some(wanted) = wanted.filter(|wanted| *wanted <= there) else {
        return Err(wrong(&format!("{there} bytes are there")));
    };
    if wanted > there / NARROWEST + NARROW {
        return Err(wrong(&format!(
            "{there} bytes are there: write each number into the standard's columns (E13.5 or E20.12)"
        )));
    }
    let found = match by_columns(lines.clone(), Numbers::new(shape, wanted)) {
        Some(numbers) if numbers.count == wanted => numbers,
        _ => by_words(lines, Numbers::new(shape, wanted))?,
    };
    if found.count != wanted {
        let more = if found.count > wanted { " or more" } else { "" };
        return Err(wrong(&format!("{}{more} numbers are there", found.count)));
    }
    let values = if shape.complex { Values::Complex(found.complex) } else { Values::Real(found.real) };
    Ok((abscissa(shape, found.places), values, Encoding::Ascii))
}

/// Maximum number of zeros that pad a line: one less than the numbers in a line of the standard.
const MOST_FILL: usize = 5;

/// Collects numbers in the order of the file directly into their final arrays, so that there is
/// never a second copy.
struct Numbers<'s> {
    shape: &'s ValueShape,
    wanted: usize,
    count: usize,
    /// Zeros after the last number that is needed.
    fill: usize,
    part: usize,
    half: f64,
    places: Vec<f64>,
    real: Vec<f64>,
    complex: Vec<Complex<f64>>,
}

impl<'s> Numbers<'s> {
    fn new(shape: &'s ValueShape, wanted: usize) -> Self {
        let points = wanted / shape.numbers();
        let room = |there: bool| if there { points } else { 0 };
        Numbers {
            shape,
            wanted,
            count: 0,
            fill: 0,
            part: 0,
            half: 0.0,
            places: Vec::with_capacity(room(!shape.even)),
            real: Vec::with_capacity(room(!shape.complex)),
            complex: Vec::with_capacity(room(shape.complex)),
        }
    }

    /// Takes the next number; false if there are more than needed. Zeros that pad the last line are
    /// not counted.
    fn take(&mut self, number: f64) -> bool {
        if self.count == self.wanted && number == 0.0 && self.fill < MOST_FILL {
            self.fill += 1;
            return true;
        }
        self.count += 1;
        if self.count > self.wanted {
            return false;
        }
        let own = self.part + usize::from(self.shape.even);
        match own {
            0 => self.places.push(number),
            1 if self.shape.complex => self.half = number,
            1 => self.real.push(number),
            _ => self.complex.push(Complex::new(self.half, number)),
        }
        self.part = (self.part + 1) % self.shape.numbers();
        true
    }
}

fn abscissa(shape: &ValueShape, places: Vec<f64>) -> Abscissa {
    if shape.even {
        Abscissa::Even { start: shape.start, step: shape.step }
    } else {
        Abscissa::Uneven(places)
    }
}

/// Column widths of a line, repeated: abscissa values with double values are narrower.
fn column_widths(complex: bool, precision: Precision, even: bool) -> &'static [usize] {
    match (precision, even, complex) {
        (Precision::Single, ..) => &[13; 6],
        (Precision::Double, true, _) => &[20; 4],
        (Precision::Double, false, false) => &[13, 20, 13, 20],
        (Precision::Double, false, true) => &[13, 20, 20],
    }
}

fn by_columns<'s>(lines: Lines<'_>, mut numbers: Numbers<'s>) -> Option<Numbers<'s>> {
    let shape = numbers.shape;
    let widths = column_widths(shape.complex, shape.precision, shape.even);
    for (_, line) in lines {
        let mut rest = line;
        for width in widths {
            if rest.trim_ascii_start().is_empty() {
                rest = &[];
                break;
            }
            let (field, after) = rest.split_at_checked(*width).unwrap_or((rest, &[]));
            // a column that begins with a digit may have begun one column earlier
            if field[0].is_ascii_digit() || !numbers.take(number::parse(field.trim_ascii())?) {
                return None;
            }
            rest = after;
        }
        if !rest.trim_ascii().is_empty() {
            return None;
        }
    }
    Some(numbers)
}

fn by_words<'s>(lines: Lines<'_>, mut numbers: Numbers<'s>) -> Result<Numbers<'s>, Wrong> {
    let mut words = Words::new(lines);
    while !words.is_empty() && numbers.take(words.real("a value")?) {}
    Ok(numbers)
}

/// Number of bytes of a function's binary data as written here.
pub(super) fn byte_count(f: &Function) -> usize {
    let width = if f.precision == Precision::Single { 4 } else { 8 };
    let parts = 1 + usize::from(matches!(f.values, Values::Complex(_)));
    f.values.len() * width * (parts + usize::from(matches!(f.abscissa, Abscissa::Uneven(_))))
}

/// Writes the values in the function's encoding.
pub(super) fn write(f: &Function, out: &mut Output) {
    match f.encoding {
        Encoding::Ascii => write_text(f, out),
        Encoding::Binary(order) => write_binary(f, order, &mut out.bytes),
    }
}

/// All numbers of a function in the order of the file.
fn for_each_number(f: &Function, mut take: impl FnMut(f64)) {
    for i in 0..f.values.len() {
        if let Abscissa::Uneven(places) = &f.abscissa {
            take(places[i]);
        }
        match &f.values {
            Values::Real(values) => take(values[i]),
            Values::Complex(values) => {
                take(values[i].re);
                take(values[i].im);
            }
        }
    }
}

fn write_text(f: &Function, out: &mut Output) {
    let (complex, even) =
        (matches!(f.values, Values::Complex(_)), matches!(f.abscissa, Abscissa::Even { .. }));
    let widths = column_widths(complex, f.precision, even);
    out.bytes.reserve(f.values.len() * (widths.iter().sum::<usize>() + 1));
    let mut column = 0;
    for_each_number(f, |value| {
        let width = widths[column];
        number::print(&mut out.bytes, value, width, if width == 13 { 5 } else { 12 });
        column += 1;
        if column == widths.len() {
            out.bytes.push(b'\n');
            column = 0;
        }
    });
    if column > 0 {
        out.bytes.push(b'\n');
    }
}

fn write_binary(f: &Function, order: ByteOrder, out: &mut Vec<u8>) {
    out.reserve(byte_count(f));
    for_each_number(f, |value| match (f.precision, order) {
        (Precision::Single, ByteOrder::Little) => out.extend_from_slice(&(value as f32).to_le_bytes()),
        (Precision::Single, ByteOrder::Big) => out.extend_from_slice(&(value as f32).to_be_bytes()),
        (Precision::Double, ByteOrder::Little) => out.extend_from_slice(&value.to_le_bytes()),
        (Precision::Double, ByteOrder::Big) => out.extend_from_slice(&value.to_be_bytes()),
    });
}

/// Number of text lines before the values.
pub(super) const LINES: usize = 11;

/// Description of the values in the header.
#[derive(Debug, Clone, Copy)]
pub(super) struct ValueShape {
    pub complex: bool,
    pub precision: Precision,
    pub points: usize,
    pub even: bool,
    pub start: f64,
    pub step: f64,
    pub z: f64,
}

/// Whether the identifier line declares binary values.
pub(super) fn is_binary(identifier: &[u8]) -> bool {
    matches!(identifier.first(), Some(b'b' | b'B'))
}

/// Record 6.
pub(super) struct Dofs {
    pub kind: i64,
    pub number: i64,
    pub version: i64,
    pub load_case: i64,
    pub response: Dof,
    pub reference: Dof,
}

pub(super) fn dofs(record: &Record<'_>) -> Result<Dofs, Wrong> {
    let fields = record.columns([5, 10, 5, 10, 11, 10, 4, 11, 10, 4]);
    let words = record.words();
    // columns first; if they do not contain numbers, words in the same order
    let from = |f: [&str; 10]| {
        let dof = |at: usize| {
            Some(Dof {
                entity: unless_none(f[at]),
                node: integer(f[at + 1])?,
                direction: integer(f[at + 2])?,
            })
        };
        Some(Dofs {
            kind: integer(f[0])?,
            number: integer(f[1])?,
            version: integer(f[2])?,
            load_case: integer(f[3])?,
            response: dof(4)?,
            reference: dof(7)?,
        })
    };
    from(fields.each_ref().map(String::as_str)).or_else(|| from(words.try_into().ok()?)).ok_or_else(|| {
        record.wrong("the line of kind, response and reference is not 2(I5,I10),2(1X,10A1,I10,I4)")
    })
}

pub(super) fn shape(record: &Record<'_>) -> Result<ValueShape, Wrong> {
    let fields = record.columns([10, 10, 10, 13, 13, 13]);
    let words = record.words();
    let from = |f: &[&str]| {
        let integer_at = |i: usize| integer(f.get(i).copied().unwrap_or(""));
        let real_at = |i: usize| real(f.get(i).copied().unwrap_or(""));
        let (complex, precision) = match integer_at(0)? {
            2 => (false, Precision::Single),
            4 => (false, Precision::Double),
            5 => (true, Precision::Single),
            6 => (true, Precision::Double),
            _ => return None,
        };
        Some(ValueShape {
            complex,
            precision,
            points: usize::try_from(integer_at(1)?).ok()?,
            even: match integer_at(2)? {
                0 => false,
                1 => true,
                _ => return None,
            },
            start: real_at(3)?,
            step: real_at(4)?,
            z: real_at(5)?,
        })
    };
    from(&fields.each_ref().map(String::as_str)).or_else(|| from(&words)).ok_or_else(|| {
        record.wrong(
            "the form of data is not: type 2, 4, 5 or 6, count, spacing 0 or 1, start, step, z (3I10,3E13.5)",
        )
    })
}

pub(super) fn axis(record: &Record<'_>) -> Result<Axis, Wrong> {
    let [quantity, length, force, temperature, label, unit] = record.columns([10, 5, 5, 5, 21, 21]);
    let number = |field: &str| {
        integer(field).ok_or_else(|| {
            record.wrong(format!("`{field}` is not a whole number in a line of I10,3I5,2(1X,20A1)"))
        })
    };
    Ok(Axis {
        quantity: number(&quantity)?,
        exponents: [number(&length)?, number(&force)?, number(&temperature)?],
        label: unless_none(&label),
        unit: unless_none(&unit),
    })
}

/// The form of data in these lines.
pub(super) fn shape_of(header: Span<'_>) -> Option<ValueShape> {
    let mut lines = Lines::of(header);
    lines.nth(5)?;
    shape(&lines.text("").ok()?).ok()
}
