//! Vectors of lines compared with one line at a time.

use super::super::product::product as product_of_one;
use super::super::pseudo_inverse::full_rank_inverse;
use super::*;
use crate::vectors::wide;
use nalgebra::{Complex, DMatrix};
use proptest::prelude::*;
use pulp::{Scalar, WithSimd};

type Line = DMatrix<Complex<f64>>;

/// The inverses of all these matrices; none where the rank is not beyond doubt.
struct Inverses<'a>(&'a [Line]);

impl WithSimd for Inverses<'_> {
    type Output = Vec<Option<Line>>;

    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let (rows, columns) = self.0[0].shape();
        let (rows, columns): (Vec<usize>, Vec<usize>) = ((0..rows).collect(), (0..columns).collect());
        let (pool, mut found) = (Pool::new(simd), Vec::new());
        while found.len() < self.0.len() {
            let (first, mut reliable) = (found.len(), Reliable::all(simd));
            let a = Matrix::read(&pool, &lines(&pool, self.0, first), &rows, &columns);
            let inverses = inverse(a, &mut reliable);
            let lanes = 0..S::F64_LANES.min(self.0.len() - first);
            found.extend(lanes.map(|lane| reliable.at(lane).then(|| inverses.line(lane))));
        }
        found
    }
}

/// Products of these with their adjoints, and of the adjoints with a real matrix on the right and
/// on the left.
struct Products<'a>(&'a [Line]);

impl WithSimd for Products<'_> {
    type Output = Vec<[Line; 3]>;

    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let (rows, columns) = self.0[0].shape();
        let (rows, columns): (Vec<usize>, Vec<usize>) = ((0..rows).collect(), (0..columns).collect());
        let real = self.0[0].map(|v| v.re);
        let (pool, mut found) = (Pool::new(simd), Vec::new());
        for first in (0..self.0.len()).step_by(S::F64_LANES) {
            let a = Matrix::read(&pool, &lines(&pool, self.0, first), &rows, &columns);
            let adjoint = a.adjoint();
            let all = [product(&a, &adjoint), times(&adjoint, &real), to_left_of(&real, &adjoint)];
            let lanes = 0..S::F64_LANES.min(self.0.len() - first);
            found.extend(lanes.map(|lane| all.each_ref().map(|all| all.line(lane))));
        }
        found
    }
}

const SHAPES: [(usize, usize); 9] =
    [(1, 1), (2, 2), (6, 6), (7, 7), (12, 12), (5, 2), (12, 6), (6, 15), (3, 7)];
/// More than a vector of eight, with the last vector not full.
const LINES: usize = 11;

/// Matrices of different lines: if `alike`, equal except for a factor, so that their pivots are in
/// the same rows.
fn matrices((rows, columns): (usize, usize), alike: bool, v: &[f64]) -> Vec<Line> {
    let one = |line: usize| {
        let at = if alike { 0 } else { line };
        let part = |i: usize| (1.0 + 0.1 * line as f64) * v[(i + 577 * at) % v.len()];
        Line::from_fn(rows, columns, |r, c| {
            Complex::new(part(2 * (r * columns + c)), part(2 * (r * columns + c) + 1))
        })
    };
    (0..LINES).map(one).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, rng_seed: proptest::test_runner::RngSeed::Fixed(11), ..ProptestConfig::default() })]

    /// Identical to the last bit, for any vector width and any neighbouring lines.
    #[test]
    fn inverses_are_those_of_each_line_by_itself(v in prop::collection::vec(-1.0..1.0f64, 1301), alike: bool) {
        for shape in SHAPES {
            let all = matrices(shape, alike, &v);
            let own: Vec<Line> = all.iter().map(|a| full_rank_inverse(a, "A").expect("full rank")).collect();
            for found in [wide(Inverses(&all)), Scalar.vectorize(Inverses(&all))] {
                prop_assert_eq!(found.len(), LINES);
                for (found, own) in found.iter().zip(&own) {
                    prop_assert_eq!(found.as_ref(), Some(own), "{:?}", shape);
                }
            }
        }
    }

    #[test]
    fn products_are_those_of_each_line_by_itself(v in prop::collection::vec(-1.0..1.0f64, 1301)) {
        for shape in SHAPES {
            let all = matrices(shape, false, &v);
            let real = all[0].map(|v| v.re);
            for found in [wide(Products(&all)), Scalar.vectorize(Products(&all))] {
                prop_assert_eq!(found.len(), LINES);
                for (found, a) in found.iter().zip(&all) {
                    let adjoint = a.adjoint();
                    prop_assert_eq!(&found[0], &product_of_one(a, &adjoint));
                    prop_assert_eq!(&found[1], &product_of_one(&adjoint, &real));
                    prop_assert_eq!(&found[2], &product_of_one(&real, &adjoint));
                }
            }
        }
    }
}

/// One line near rank loss, one with a NaN, one with an infinity, one of zeros: they are reported
/// as doubtful, and their neighbours are unchanged.
#[test]
fn a_line_in_doubt_does_not_touch_its_neighbours() {
    for shape in SHAPES {
        let v: Vec<f64> = (0..1301).map(|i| (1.0 + 0.7 * f64::from(i * i)).sin()).collect();
        let mut all = matrices(shape, false, &v);
        let last = shape.0.max(shape.1) - 1;
        for (bad, value) in [(2, f64::NAN), (4, f64::INFINITY)] {
            all[bad][(last % shape.0, last % shape.1)].im = value;
        }
        all[6].fill(Complex::default());
        if shape.0.min(shape.1) > 1 {
            let (rows, columns) = shape;
            // the last row or column of the smaller side is nearly equal to the first one
            for i in 0..rows.max(columns) {
                let (from, to) =
                    if rows < columns { ((0, i), (rows - 1, i)) } else { ((i, 0), (i, columns - 1)) };
                let near = all[8][from] + 1e-10 * all[8][to];
                all[8][to] = near;
            }
        }
        for found in [wide(Inverses(&all)), Scalar.vectorize(Inverses(&all))] {
            for (line, found) in found.iter().enumerate() {
                let doubtful = [2, 4, 6].contains(&line) || (line == 8 && shape.0.min(shape.1) > 1);
                let own = full_rank_inverse(&all[line], "A").ok();
                assert_eq!(found.as_ref(), own.as_ref().filter(|_| !doubtful), "{shape:?}, line {line}");
            }
        }
    }
}
