//! Kept and refused hits of a configuration.

use crate::results::Completeness;

/// From counts per cell: (wanted, kept, refused by verdict).
pub fn completeness<'a>(
    name: &str,
    cells: impl IntoIterator<Item = (usize, usize, Vec<(&'a str, usize)>)>,
) -> Completeness {
    let mut sum = Completeness { configuration: name.into(), ..Completeness::default() };
    for (wanted, kept, refused) in cells {
        sum.cells += 1;
        sum.wanted += wanted;
        sum.kept += kept;
        sum.cells_complete += usize::from(kept >= wanted);
        for (verdict, count) in refused {
            *sum.refused.entry(verdict.to_owned()).or_default() += count;
        }
    }
    sum
}
