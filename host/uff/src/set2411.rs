//! Data set 2411: nodes, double precision. Format 4I10 and, on the next line, 3D25.16.

use super::lines::{Lines, Wrong};
use super::number;
use super::set15::{self, Node};
use crate::lines::Output;

/// Its sequence of numbers is the same as in set 15.
pub(super) fn read(lines: Lines<'_>) -> Result<Vec<Node>, Wrong> {
    set15::read(lines)
}

pub(super) fn write(nodes: &[Node], out: &mut Output) -> Result<(), String> {
    out.open(2411, "");
    for node in nodes {
        out.line(&set15::first_line(node)?);
        for x in node.position {
            number::print(&mut out.bytes, x, 25, 16);
        }
        out.line("");
    }
    out.close();
    Ok(())
}
