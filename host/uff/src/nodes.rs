//! Data sets 15 and 2411: nodes. The numbers of 15 are in single precision, format 4I10, 3E13.5;
//! those of 2411 in double precision, 4I10 and, on the next line, 3D25.16.

use super::lines::{Lines, Output, Words, Wrong, integers};
use super::number;

/// A node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node {
    /// Its number.
    pub label: i64,
    /// The coordinate system that defines its position.
    pub definition_system: i64,
    /// The coordinate system of its displacements.
    pub displacement_system: i64,
    /// Its colour.
    pub color: i64,
    /// x, y, z in the file's unit of length (m unless a units set says otherwise).
    pub position: [f64; 3],
}

/// The sequence of numbers is the same in both sets.
pub(super) fn read(lines: Lines<'_>) -> Result<Vec<Node>, Wrong> {
    let mut words = Words::new(lines);
    let mut nodes = Vec::new();
    while !words.is_empty() {
        nodes.push(Node {
            label: words.integer("a node's number")?,
            definition_system: words.integer("the node's definition system")?,
            displacement_system: words.integer("the node's displacement system")?,
            color: words.integer("the node's colour")?,
            position: [words.real("the node's x")?, words.real("the node's y")?, words.real("the node's z")?],
        });
    }
    Ok(nodes)
}

pub(super) fn write_single(nodes: &[Node], out: &mut Output) -> Result<(), String> {
    out.open(15, "");
    for node in nodes {
        let line = first_line(node)?;
        out.bytes.extend_from_slice(line.as_bytes());
        for x in node.position {
            number::print(&mut out.bytes, x, 13, 5);
        }
        out.line("");
    }
    out.close();
    Ok(())
}

pub(super) fn write_double(nodes: &[Node], out: &mut Output) -> Result<(), String> {
    out.open(2411, "");
    for node in nodes {
        out.line(&first_line(node)?);
        for x in node.position {
            number::print(&mut out.bytes, x, 25, 16);
        }
        out.line("");
    }
    out.close();
    Ok(())
}

/// The integers of a node.
fn first_line(node: &Node) -> Result<String, String> {
    let Node { label, definition_system, displacement_system, color, .. } = *node;
    integers("a number of a node", &[label, definition_system, displacement_system, color], 10)
}
