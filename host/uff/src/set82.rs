//! Data set 82: a trace line. Format 3I10; 80A1; 8I10.

use super::lines::{Lines, Words, Wrong, integer};
use super::number;
use crate::lines::{Output, integers};

/// A line through nodes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TraceLine {
    /// Its number.
    pub number: i64,
    /// Its colour.
    pub color: i64,
    /// Its name.
    pub name: String,
    /// Nodes to draw to, in order; 0 lifts the pen for the next.
    pub nodes: Vec<i64>,
}

pub(super) fn read(mut lines: Lines<'_>) -> Result<TraceLine, Wrong> {
    let first = lines.text("the trace line's number")?;
    let words = first.words();
    let number = |at: usize| words.get(at).map_or(Some(0), |w| integer(w));
    let (Some(line), Some(count), Some(color)) = (number(0), number(1), number(2)) else {
        return Err(first.wrong("the trace line's number, count of nodes and colour are expected"));
    };
    let name = lines.text("the trace line's name")?.label();
    let mut words = Words::new(lines);
    let mut nodes = Vec::new();
    while !words.is_empty() {
        nodes.push(words.integer("a node's number")?);
    }
    // more than stated is common (one writer counts each node once); fewer means that some are lost
    if number::count(nodes.len()) < count {
        return Err(first.wrong(format!("{count} nodes are announced, but {} are there", nodes.len())));
    }
    Ok(TraceLine { number: line, color, name, nodes })
}

pub(super) fn write(line: &TraceLine, out: &mut Output) -> Result<(), String> {
    out.open(82, "");
    let count = number::count(line.nodes.len());
    out.line(&integers("a number of the trace line", &[line.number, count, line.color], 10)?);
    out.label("the trace line's name", &line.name)?;
    for nodes in line.nodes.chunks(8) {
        out.line(&integers("a node's number", nodes, 10)?);
    }
    out.close();
    Ok(())
}
