//! Numbers of kept and refused hits of a configuration.

use crate::results::Completeness;

/// From counts per cell: whether the cell is struck itself rather than filled by the hits of
/// another, and (planned, kept, refused by verdict).
pub fn completeness<'a>(
    name: &str,
    cells: impl IntoIterator<Item = (bool, (usize, usize, Vec<(&'a str, usize)>))>,
) -> Completeness {
    let mut sum = Completeness { configuration: name.into(), ..Completeness::default() };
    for (struck, (wanted, kept, refused)) in cells {
        sum.cells += 1;
        sum.cells_complete += usize::from(kept >= wanted);
        if !struck {
            continue;
        }
        sum.wanted += wanted;
        sum.kept += kept;
        for (verdict, count) in refused {
            *sum.refused.entry(verdict.to_owned()).or_default() += count;
        }
    }
    sum
}
