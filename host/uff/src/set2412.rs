//! Data set 2412: elements. Format 6I10; for beams 3I10 more; 8I10.

use super::lines::{Lines, Words, Wrong};
use super::number::count;
use crate::lines::{Output, integers};

/// Descriptors of beams, which have an additional line: rod, linear, tapered, curved and parabolic
/// beam.
const BEAMS: [i64; 5] = [11, 21, 22, 23, 24];

/// A finite element, or a line or face of a drawing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element {
    /// Its number.
    pub label: i64,
    /// Its kind: 11 rod, 41 triangle, 44 quadrilateral and so on.
    pub descriptor: i64,
    /// Number of its physical properties.
    pub physical: i64,
    /// Number of its material.
    pub material: i64,
    /// Its colour.
    pub color: i64,
    /// Fields that only beams have.
    pub beam: Option<Beam>,
    /// Its nodes.
    pub nodes: Vec<i64>,
}

/// The additional line of a beam.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Beam {
    /// Node that orients it.
    pub orientation: i64,
    /// Cross-section at its first end.
    pub first_section: i64,
    /// Cross-section at its second end.
    pub second_section: i64,
}

pub(super) fn read(lines: Lines<'_>) -> Result<Vec<Element>, Wrong> {
    let mut words = Words::new(lines);
    let mut elements = Vec::new();
    while !words.is_empty() {
        let mut next = |what: &str| words.integer(what);
        let (label, descriptor) = (next("an element's number")?, next("the element's kind")?);
        let (physical, material) = (next("the element's properties")?, next("the element's material")?);
        let (color, many) = (next("the element's colour")?, next("the element's count of nodes")?);
        let beam = if BEAMS.contains(&descriptor) {
            Some(Beam {
                orientation: next("the beam's orientation")?,
                first_section: next("the beam's first section")?,
                second_section: next("the beam's second section")?,
            })
        } else {
            None
        };
        let nodes = (0..many).map(|_| next("a node of the element")).collect::<Result<_, _>>()?;
        elements.push(Element { label, descriptor, physical, material, color, beam, nodes });
    }
    Ok(elements)
}

pub(super) fn write(elements: &[Element], out: &mut Output) -> Result<(), String> {
    out.open(2412, "");
    for e in elements {
        if e.beam.is_some() != BEAMS.contains(&e.descriptor) {
            return Err(format!(
                "element {} of kind {}: kinds {BEAMS:?} are beams, no others",
                e.label, e.descriptor
            ));
        }
        let first = [e.label, e.descriptor, e.physical, e.material, e.color, count(e.nodes.len())];
        out.line(&integers("a number of an element", &first, 10)?);
        if let Some(Beam { orientation, first_section, second_section }) = e.beam {
            out.line(&integers("a number of a beam", &[orientation, first_section, second_section], 10)?);
        }
        for nodes in e.nodes.chunks(8) {
            out.line(&integers("a node's number", nodes, 10)?);
        }
    }
    out.close();
    Ok(())
}
