//! Data set 164: units. Format I10, 20A1, I10; 3D25.17; D25.17.

use super::lines::{Lines, Words, Wrong, integer, unless_none};
use super::number;
use crate::lines::{Output, integers, label};

/// Units of the file. A value in the file divided by its factor is SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Units {
    /// 1 SI (m, N), 2 foot and pound-force, 5 mm and mN, 7 inch and pound-force, 9 others.
    pub code: i64,
    /// Description of the units.
    pub description: String,
    /// 1 absolute, 2 relative temperatures.
    pub temperature_mode: i64,
    /// Factor of length.
    pub length: f64,
    /// Factor of force.
    pub force: f64,
    /// Factor of temperature.
    pub temperature: f64,
    /// Offset of temperature.
    pub temperature_offset: f64,
}

impl Units {
    /// Metre, newton, kelvin.
    pub fn si() -> Self {
        Units {
            code: 1,
            description: "SI".into(),
            temperature_mode: 1,
            length: 1.0,
            force: 1.0,
            temperature: 1.0,
            temperature_offset: 0.0,
        }
    }
}

pub(super) fn read(mut lines: Lines<'_>) -> Result<Units, Wrong> {
    let first = lines.text("the units' code")?;
    let [code, description, mode] = first.columns([10, 20, 10]);
    let number =
        |field: &str| integer(field).ok_or_else(|| first.wrong(format!("`{field}` is not a whole number")));
    let (code, temperature_mode) = (number(&code)?, number(&mode)?);
    let mut words = Words::new(lines);
    Ok(Units {
        code,
        description: unless_none(&description),
        temperature_mode,
        length: words.real("the factor of length")?,
        force: words.real("the factor of force")?,
        temperature: words.real("the factor of temperature")?,
        // absolute temperatures have no offset, and some writers omit it
        temperature_offset: if words.is_empty() { 0.0 } else { words.real("the offset of temperature")? },
    })
}

pub(super) fn write(units: &Units, out: &mut Output) -> Result<(), String> {
    out.open(164, "");
    let line = integers("the units' code", &[units.code], 10)?
        + &label("the units' description", &units.description, 20)?
        + &integers("the temperature mode", &[units.temperature_mode], 10)?;
    out.line(&line);
    for row in [&[units.length, units.force, units.temperature][..], &[units.temperature_offset]] {
        let mut text = Vec::new();
        for value in row {
            number::print(&mut text, *value, 25, 16);
        }
        // the format uses D exponents
        text.iter_mut().filter(|b| **b == b'e').for_each(|b| *b = b'D');
        out.bytes.append(&mut text);
        out.line("");
    }
    out.close();
    Ok(())
}
