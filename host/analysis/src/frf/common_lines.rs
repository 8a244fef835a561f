//! Finds the lines that several sets of FRFs share, although their files print them with different
//! digits or cover different bands.
//!
//! A universal file prints start and step of its lines, or every line, with six digits. Two files
//! of the same lines may then differ by some millionths of a frequency; such lines count as equal.
//! FRFs whose bands overlap partly share the lines of the overlap.

use super::Frf;
use crate::structure::{Abc, Structure};

/// Frequencies that differ by at most this fraction are the same line: start, step and line are
/// printed with six digits or more, each rounded by at most 5e-6 of its value, in either file.
pub const PRINTED: f64 = 1e-5;

/// Frequencies that differ by more than this fraction of the distance to the next line are
/// different lines, regardless of the printed digits.
const OF_SPACING: f64 = 0.1;

/// Two frequency axes that do not belong to one grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OtherLines {
    /// Line of the first axis, Hz.
    pub one_hz: f64,
    /// Line of the second axis, Hz: the nearest line, which differs from it.
    pub other_hz: f64,
}

/// Pairs of indices (in the first, in the second) of the lines that two rising axes share.
/// `tolerance` returns how far apart two lines may be because of printed digits. In the band that
/// both cover, all lines of at least one of the two must be shared: a grid of 1 Hz and one of 2 Hz
/// share every second line, grids of 19 and 20 Hz do not match.
///
/// # Errors
/// [`OtherLines`] with the first lines that differ.
pub fn shared(
    one: &[f64],
    other: &[f64],
    tolerance: impl Fn(usize, usize) -> f64,
) -> Result<Vec<(usize, usize)>, OtherLines> {
    let (mut i, mut j, mut pairs) = (0, 0, Vec::new());
    let (mut of_one, mut of_other) = (None, None);
    while let (Some(&f), Some(&g)) = (one.get(i), other.get(j)) {
        let most = tolerance(i, j).min(OF_SPACING * spacing(one, i).min(spacing(other, j)));
        let apart = Some(OtherLines { one_hz: f, other_hz: g });
        if (f - g).abs() <= most {
            pairs.push((i, j));
            (i, j) = (i + 1, j + 1);
        } else if f < g {
            // a line before the start of the second axis cannot be shared and is no mismatch
            of_one = of_one.or(apart.filter(|_| j > 0));
            i += 1;
        } else {
            of_other = of_other.or(apart.filter(|_| i > 0));
            j += 1;
        }
    }
    match (of_one, of_other) {
        _ if pairs.is_empty() => {
            let first = |axis: &[f64]| axis.first().copied().unwrap_or(f64::NAN);
            Err(OtherLines { one_hz: first(one), other_hz: first(other) })
        }
        (Some(apart), Some(_)) => Err(apart),
        _ => Ok(pairs),
    }
}

/// Distance from a line to the nearest other one, Hz.
fn spacing(axis: &[f64], line: usize) -> f64 {
    let to = |neighbour: Option<&f64>| neighbour.map_or(f64::INFINITY, |f| (f - axis[line]).abs());
    to(line.checked_sub(1).and_then(|before| axis.get(before))).min(to(axis.get(line + 1)))
}

/// Whether two axes are equal within the rounding of six printed digits.
///
/// # Errors
/// [`OtherLines`] with the first lines that differ.
pub fn same(one: &[f64], other: &[f64]) -> Result<(), OtherLines> {
    let tolerance = |i: usize, j: usize| PRINTED * one[i].max(other[j]);
    let pairs = shared(one, other, tolerance)?;
    if pairs.len() == one.len() && pairs.len() == other.len() {
        return Ok(());
    }
    let place = pairs.iter().position(|(i, j)| i != j).unwrap_or(pairs.len());
    let at = |axis: &[f64]| axis.get(place).or(axis.last()).copied().unwrap_or(f64::NAN);
    Err(OtherLines { one_hz: at(one), other_hz: at(other) })
}

/// The common lines of FRFs whose lines are not identical.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommonLines {
    /// Lines that all three have.
    pub lines: usize,
    /// The first of them, Hz.
    pub low_hz: f64,
    /// The last of them, Hz.
    pub high_hz: f64,
    /// Number of lines that each had.
    pub of: Abc<usize>,
}

/// Restricts the FRFs of A, B and the assembly to the lines that all three share, and returns those
/// lines if any were removed. On an error, nothing is changed.
///
/// # Errors
/// The structure whose lines do not match those of A, and the first pair that differs (A's line,
/// then its own). If no line is common to all three, the first lines of B and of the assembly.
pub fn keep_common_lines(files: &mut [Frf; 3]) -> Result<Option<CommonLines>, (Structure, OtherLines)> {
    let [a, b, ajb] = files.each_ref().map(Frf::frequency_hz);
    let with_a = |other: &[f64], structure: Structure| {
        let tolerance = |i: usize, j: usize| PRINTED * a[i].max(other[j]);
        shared(a, other, tolerance).map_err(|apart| (structure, apart))
    };
    let (of_b, of_ajb) = (with_a(b, Structure::B)?, with_a(ajb, Structure::Ajb)?);
    let mut places: [Vec<usize>; 3] = Default::default();
    let mut rest = of_ajb.iter().peekable();
    for (line, of_b) in of_b {
        while rest.next_if(|(other, _)| *other < line).is_some() {}
        if let Some((_, of_ajb)) = rest.next_if(|(other, _)| *other == line) {
            for (place, own) in places.iter_mut().zip([line, of_b, *of_ajb]) {
                place.push(own);
            }
        }
    }
    let lines = places[0].len();
    let (Some(first), Some(last)) = (places[0].first(), places[0].last()) else {
        let first = |axis: &[f64]| axis.first().copied().unwrap_or(f64::NAN);
        return Err((Structure::Ajb, OtherLines { one_hz: first(b), other_hz: first(ajb) }));
    };
    let of = Abc { a: a.len(), b: b.len(), ajb: ajb.len() };
    if [of.a, of.b, of.ajb] == [lines; 3] {
        return Ok(None);
    }
    let left = CommonLines { lines, low_hz: a[*first], high_hz: a[*last], of };
    for (frf, own) in files.iter_mut().zip(&places) {
        *frf = frf.at(own);
    }
    Ok(Some(left))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frf::MotionQuantity;
    use nalgebra::{Complex, DMatrix};

    fn frf(frequency_hz: &[f64]) -> Frf {
        let line = |f: &f64| DMatrix::from_element(1, 1, Complex::new(f.round(), 0.0));
        let (names, lines) = (vec!["p".into()], frequency_hz.iter().map(line).collect());
        Frf::new(frequency_hz.to_vec(), 0.0, MotionQuantity::Velocity, names.clone(), names, lines)
            .expect("rising")
    }

    fn grid(start: f64, step: f64, count: usize) -> Vec<f64> {
        (0..count).map(|i| start + i as f64 * step).collect()
    }

    #[test]
    fn printed_digits_make_no_other_line_and_overlapping_bands_share_theirs() {
        let exact = grid(300.078_125, 19.921_875, 16);
        let printed: Vec<f64> = exact.iter().map(|f| format!("{f:.5e}").parse().expect("a number")).collect();
        let even = grid(300.078, 19.9219, 16);
        let mut all = [frf(&printed), frf(&even), frf(&exact)];
        assert_eq!(keep_common_lines(&mut all), Ok(None));
        assert_eq!(all[0].lines().len(), 16);
        assert!(same(&printed, &even).is_ok());

        let mut cut = [frf(&exact[2..]), frf(&even), frf(&exact[..14])];
        let left = keep_common_lines(&mut cut).expect("one grid").expect("fewer lines");
        assert_eq!((left.lines, left.of), (12, Abc { a: 14, b: 16, ajb: 14 }));
        assert!((left.low_hz - exact[2]).abs() < 1e-9 && (left.high_hz - exact[13]).abs() < 1e-9);
        let [a, b, ajb] = cut;
        assert_eq!((a.lines(), ajb.lines().len()), (b.lines(), 12), "the same lines of each");

        let mut fine = [grid(0.0, 1.0, 21), grid(4.0, 2.0, 9), grid(0.0, 1.0, 15)].map(|axis| frf(&axis));
        assert_eq!(keep_common_lines(&mut fine).expect("every second line").expect("fewer").lines, 6);
    }

    #[test]
    fn other_grids_are_refused_with_the_lines_that_differ() {
        for (wrong, apart) in [
            (grid(300.5, 4.0, 76), (300.0, 300.5)),
            (grid(300.0, 4.1, 76), (304.0, 304.1)),
            (grid(700.0, 4.0, 10), (300.0, 700.0)),
            (grid(300.1, 4.0, 76), (300.0, 300.1)),
        ] {
            let a = grid(300.0, 4.0, 76);
            let mut all = [frf(&a), frf(&wrong), frf(&a)];
            let (structure, found) = keep_common_lines(&mut all).expect_err("other lines");
            assert_eq!((structure, all[1].frequency_hz()), (Structure::B, &wrong[..]), "nothing was changed");
            assert!(
                (found.one_hz - apart.0).abs() < 5.0 && (found.other_hz - apart.1).abs() < 5.0,
                "{found:?}"
            );
            assert!(same(&a, &wrong).is_err());
        }
        // lines closer together than six digits can resolve are compared within a fraction of their
        // spacing
        assert!(shared(&grid(8000.0, 0.01, 9), &grid(8000.005, 0.01, 9), |_, _| 0.08).is_err());
    }
}
