//! Data sets 58 and 58b: a function at a degree of freedom. Eleven header lines here, the values in [`super::set58_values`].

use super::blocks::Block;
use super::function::{Abscissa, Axis, ByteOrder, Dof, Encoding, Function, Precision, Values};
use super::number;
use super::set58_values;
use super::text::{Lines, Output, Record, Wrong, integer, integers, label, real, unless_none};

/// Lines of text before the values.
pub(super) const HEADER_LINES: usize = 11;

/// What the header says about the values.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    pub complex: bool,
    pub precision: Precision,
    pub points: usize,
    pub even: bool,
    pub start: f64,
    pub step: f64,
    pub z: f64,
}

/// Whether the identifier's line says that values are binary.
pub(super) fn is_binary(identifier: &[u8]) -> bool {
    matches!(identifier.first(), Some(b'b' | b'B'))
}

pub(super) fn read(block: &Block<'_>) -> Result<Function, Wrong> {
    let mut lines = Lines::new(block.body, block.body_offset);
    let mut id: [String; 5] = Default::default();
    for (i, line) in id.iter_mut().enumerate() {
        *line = lines.text(&format!("text {}", i + 1))?.label();
    }
    let dofs = dofs(&lines.text("the function's kind and places")?)?;
    let shape = shape(&lines.text("the function's form of data")?)?;
    let mut axes: [Axis; 4] = Default::default();
    for (axis, what) in axes.iter_mut().zip(["abscissa", "ordinate", "denominator", "z axis"]) {
        *axis = self::axis(&lines.text(what)?)?;
    }
    let (abscissa, values, encoding) = match block.binary {
        Some(data) => set58_values::read_binary(data, &shape, block)?,
        None => set58_values::read_text(lines, &shape)?,
    };
    let Dofs { kind, number, version, load_case, response, reference } = dofs;
    Ok(Function {
        id,
        kind,
        number,
        version,
        load_case,
        response,
        reference,
        precision: shape.precision,
        abscissa,
        values,
        z: shape.z,
        axes,
        encoding,
    })
}

/// Record 6.
struct Dofs {
    kind: i64,
    number: i64,
    version: i64,
    load_case: i64,
    response: Dof,
    reference: Dof,
}

fn dofs(record: &Record<'_>) -> Result<Dofs, Wrong> {
    let fields = record.columns([5, 10, 5, 10, 11, 10, 4, 11, 10, 4]);
    let words = record.words();
    // columns first; where they do not hold numbers, words in the same order
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

fn shape(record: &Record<'_>) -> Result<Shape, Wrong> {
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
        Some(Shape {
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

fn axis(record: &Record<'_>) -> Result<Axis, Wrong> {
    let [quantity, length, force, temperature, label, unit] = record.columns([10, 5, 5, 5, 21, 21]);
    let number = |field: &str| {
        integer(field).ok_or_else(|| {
            record.wrong(format!("`{field}` is no whole number in a line of I10,3I5,2(1X,20A1)"))
        })
    };
    Ok(Axis {
        quantity: number(&quantity)?,
        exponents: [number(&length)?, number(&force)?, number(&temperature)?],
        label: unless_none(&label),
        unit: unless_none(&unit),
    })
}

/// The form of data of a block whose body is the header alone.
pub(super) fn shape_of(block: &Block<'_>) -> Option<Shape> {
    let mut lines = Lines::new(block.body, block.body_offset);
    lines.nth(5)?;
    shape(&lines.text("").ok()?).ok()
}

pub(super) fn write(f: &Function, out: &mut Output) -> Result<(), String> {
    let count = f.values.len();
    if let Abscissa::Uneven(places) = &f.abscissa
        && places.len() != count
    {
        return Err(format!(
            "there are {} places and {count} values: one place for each value",
            places.len()
        ));
    }
    let complex = matches!(f.values, Values::Complex(_));
    let even = matches!(f.abscissa, Abscissa::Even { .. });
    match f.encoding {
        Encoding::Ascii => out.open(58, ""),
        Encoding::Binary(order) => {
            let order = if order == ByteOrder::Little { 1 } else { 2 };
            let bytes = set58_values::byte_count(f);
            out.open(
                58,
                &format!(
                    "b{order:>6}{:>6}{HEADER_LINES:>12}{bytes:>12}{:>6}{:>6}{:>12}{:>12}",
                    2, 0, 0, 0, 0
                ),
            );
        }
    }
    for (i, text) in f.id.iter().enumerate() {
        out.label(&format!("text {}", i + 1), text)?;
    }
    let dof = |what: &str, dof: &Dof| {
        let entity = label(&format!("the name of the {what}"), &dof.entity, 10)?;
        let entity = entity.trim_end();
        let node = integers("a node", &[dof.node], 10)?;
        Ok::<_, String>(format!(" {entity:>10}{node}{}", integers("a direction", &[dof.direction], 4)?))
    };
    out.line(&format!(
        "{}{}{}{}{}{}",
        integers("the kind", &[f.kind], 5)?,
        integers("the function's number", &[f.number], 10)?,
        integers("the version", &[f.version], 5)?,
        integers("the load case", &[f.load_case], 10)?,
        dof("response", &f.response)?,
        dof("reference", &f.reference)?,
    ));
    let kind = match (complex, f.precision) {
        (false, Precision::Single) => 2,
        (false, Precision::Double) => 4,
        (true, Precision::Single) => 5,
        (true, Precision::Double) => 6,
    };
    let (start, step) = match f.abscissa {
        Abscissa::Even { start, step } => (start, step),
        Abscissa::Uneven(_) => (0.0, 0.0),
    };
    let line = integers("the count of values", &[kind, super::count(count), i64::from(even)], 10)?;
    out.bytes.extend_from_slice(line.as_bytes());
    for value in [start, step, f.z] {
        number::print(&mut out.bytes, value, 13, 6);
    }
    out.line("");
    for axis in &f.axes {
        out.line(&format!(
            "{}{} {} {}",
            integers("an axis's quantity", &[axis.quantity], 10)?,
            integers("an exponent", &axis.exponents, 5)?,
            label("an axis's label", &axis.label, 20)?,
            label("an axis's unit", &axis.unit, 20)?,
        ));
    }
    set58_values::write(f, out);
    out.close();
    Ok(())
}
