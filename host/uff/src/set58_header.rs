//! The header of data sets 58 and 58b: the eleven lines before the values.

use super::function::{Axis, Dof, Precision};
use super::lines::{Lines, Record, Span, Wrong, integer, real, unless_none};

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
