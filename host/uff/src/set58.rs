//! Data sets 58 and 58b: a function at a degree of freedom.

use super::blocks::Block;
use super::function::{Abscissa, Axis, ByteOrder, Dof, Encoding, Function, Precision, Values};
use super::lines::{Lines, Wrong};
use super::number;
use super::set58_values;
use crate::lines::{Output, integers, label};
use crate::set58_values::Dofs;

pub(super) fn read(block: &Block<'_>) -> Result<Function, Wrong> {
    let mut lines = Lines::of(block.body);
    let mut id: [String; 5] = Default::default();
    for (i, line) in id.iter_mut().enumerate() {
        *line = lines.text(&format!("text {}", i + 1))?.label();
    }
    let dofs = set58_values::dofs(&lines.text("the function's kind and places")?)?;
    let shape = set58_values::shape(&lines.text("the function's form of data")?)?;
    let mut axes: [Axis; 4] = Default::default();
    for (axis, what) in axes.iter_mut().zip(["abscissa", "ordinate", "denominator", "z axis"]) {
        *axis = set58_values::axis(&lines.text(what)?)?;
    }
    let (abscissa, values, encoding) = match block.binary {
        Some(data) => set58_values::read_binary(data, &shape, block.identifier)?,
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
                    "b{order:>6}{:>6}{:>12}{bytes:>12}{:>6}{:>6}{:>12}{:>12}",
                    2,
                    set58_values::LINES,
                    0,
                    0,
                    0,
                    0
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
    let line = integers("the count of values", &[kind, number::count(count), i64::from(even)], 10)?;
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
