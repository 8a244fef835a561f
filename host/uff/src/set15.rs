//! Data set 15: nodes, single precision. Format 4I10, 3E13.5.

use super::lines::{Lines, Words, Wrong};
use super::number;
use crate::lines::{Output, integers};

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

pub(super) fn write(nodes: &[Node], out: &mut Output) -> Result<(), String> {
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

/// The integers of a node.
pub(super) fn first_line(node: &Node) -> Result<String, String> {
    let Node { label, definition_system, displacement_system, color, .. } = *node;
    integers("a number of a node", &[label, definition_system, displacement_system, color], 10)
}
