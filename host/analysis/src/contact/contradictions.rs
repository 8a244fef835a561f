//! Stated quantities that the data contradict: which ones, and by how much.
//!
//! Every stated position, gain and delay has a prior with a standard deviation σ. The fit moves it
//! by d, and if the statement is true, d has the variance σ² − C, where C is its variance after the
//! fit (Baarda's test for outlying observations). A quantity that moves much farther is not as
//! stated: its prior is then widened so that the data alone determine it, and k_T's interval
//! widens with it. The one with the most significant deviation is widened first, and the fit is
//! repeated, because a single false statement moves others too.
//!
//! A position is tested as a whole. Quantities that the data hardly determine cannot be tested.

use super::block::{Block, Group, POINT};
use super::parameters::{Cause, Parameter};
use super::{ContactError, Fit};
use crate::C;
use nalgebra::{DMatrix, DVector, SymmetricEigen, Vector3};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// χ² beyond which a quantity with one, two or three coordinates is contradicted: five standard
/// deviations of a single one. Some sixty are tested, and where few impacts show the aims,
/// deviations scatter more than by chance.
const CONTRADICTED: [f64; 3] = [25.0, 30.0, 35.0];
/// The same for all quantities of a kind, as deviations of a normal distribution.
const KIND_CONTRADICTED: f64 = 4.5;
/// Least part of the prior's variance that the data must remove for a test: below this, the
/// linearised fit does not predict the deviation well.
const TESTABLE: f64 = 0.2;
/// Largest z component of the direction of a hit whose tilt is tested: the z component of a hit
/// along z falls with the square of the tilt, so that its deviations are not normal.
const ACROSS: f64 = 0.5;
/// Factor by which the prior of a contradicted quantity is widened: the data then determine it.
const FREED: f64 = 40.0;
/// Most quantities that are freed one by one; if more are off, their kind is.
const MOST: usize = 3;
/// Most widenings of kinds.
const MOST_KINDS: usize = 4;
/// Least factor of such a widening.
const LEAST_SCATTER: f64 = 1.5;
/// Factor by which exchanging the positions of two points must lower what rigid motion does not
/// explain. If none are exchanged, every exchange raises it.
const MUCH_LESS: f64 = 1.5;

/// A stated quantity that the data contradict. Its prior has been widened.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contradiction {
    /// What is off: a point, a spot, the gain or delay of a sensor, or all quantities of a kind.
    pub what: String,
    /// The cause under which its uncertainty is listed.
    pub cause: Cause,
    /// By how much it is off, with the standard deviation of that: along x, y and z for a position
    /// (m), relative for a gain and for the contact's change, s for a delay. Empty if a kind is
    /// off.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub off: Vec<[f64; 2]>,
    /// How many times farther than stated the quantities of a kind scatter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scatter: Option<f64>,
    /// The point at whose stated position this one was found, and the reverse.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub exchanged_with: Option<String>,
}

/// Changes of the stated priors.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Changes {
    /// Quantities that the data alone determine.
    quantities: Vec<String>,
    /// Factors on the standard deviations of kinds.
    kinds: BTreeMap<Cause, f64>,
    /// Two points with exchanged positions.
    exchanged: Option<[String; 2]>,
}

/// A position without its axis, or the parameter's own name.
fn quantity(name: &str) -> &str {
    ["x of ", "y of ", "z of "].iter().find_map(|axis| name.strip_prefix(axis)).unwrap_or(name)
}

fn tested(own: &Parameter) -> bool {
    let tested = match own.cause {
        Cause::Spots
        | Cause::Centre
        | Cause::SpecimenPoints
        | Cause::ArmPoints
        | Cause::Gains
        | Cause::Skew
        | Cause::SensorAxes => true,
        Cause::HammerTilt => own.tilted.is_some_and(|[z, _]| z.abs() < ACROSS),
        Cause::Noise | Cause::Aim | Cause::Bending | Cause::Drift | Cause::SecondPath | Cause::Misfit => {
            false
        }
    };
    tested && own.stated && own.sigma.is_finite() && own.sigma > 0.0
}

/// The fit with the priors of contradicted quantities widened as far as needed; `fit` fits with
/// changed priors, `exchanged` says which points are exchanged. If what is contradicted cannot be
/// found, the fit with the stated priors is returned.
///
/// # Errors
/// As the fit with stated priors.
pub fn resolved(
    exchanged: &Changes,
    fit: impl Fn(&Changes) -> Result<Fit, ContactError>,
) -> Result<(Fit, Changes), ContactError> {
    let stated = fit(exchanged)?;
    if !remain(&stated) {
        return Ok((stated, exchanged.clone()));
    }
    let one_by_one = || {
        let mut changes = Changes { quantities: vec![worst(&stated)?.what], ..exchanged.clone() };
        loop {
            let found = fit(&changes).ok()?;
            let Some(worst) = worst(&found) else {
                return Some((found, changes)).filter(|(fit, _)| !remain(fit));
            };
            if changes.quantities.len() == MOST {
                return None;
            }
            changes.quantities.push(worst.what);
        }
    };
    let kind_by_kind = || {
        let mut changes = exchanged.clone();
        let mut worst_kind = worst_kind(&stated);
        for _ in 0..MOST_KINDS {
            let (cause, scatter) = worst_kind?;
            *changes.kinds.entry(cause).or_insert(1.0) *= scatter.max(LEAST_SCATTER);
            let found = fit(&changes).ok()?;
            if !remain(&found) {
                return Some((found, changes));
            }
            worst_kind = self::worst_kind(&found);
        }
        None
    };
    Ok(one_by_one().or_else(kind_by_kind).unwrap_or((stated, exchanged.clone())))
}

/// Part of the motion of a body's points that a rigid motion does not explain, relative to their
/// rms, both weighted by the noise; none if no impact has enough points. `exchanged` are two points
/// (index of the first coordinate) with exchanged positions.
fn not_rigid(
    blocks: &[Block],
    parameters: &[Parameter],
    group: Group,
    exchanged: Option<[usize; 2]>,
) -> Option<f64> {
    let position = |point: usize| {
        let [one, other] = exchanged.unwrap_or([point; 2]);
        let at = match point {
            _ if point == one => other,
            _ if point == other => one,
            _ => point,
        };
        Vector3::from_fn(|axis, _| parameters[at + axis].start)
    };
    let (mut left, mut whole) = (0.0, 0.0);
    for block in blocks {
        let rows: Vec<(usize, [f64; 6])> = (block.rows.iter().enumerate())
            .filter(|(_, row)| row.channel >= POINT && block.cells[row.cell].group == group)
            .map(|(r, row)| {
                let cell = &block.cells[row.cell];
                let along = Vector3::from(cell.axes[row.channel - POINT].direction);
                let turn = position(cell.point).cross(&along);
                (r, [along.x, along.y, along.z, turn.x, turn.y, turn.z])
            })
            .collect();
        // three points along three axes
        if rows.len() < 9 {
            continue;
        }
        for line in &block.lines {
            let weight = |r: usize| line.weight[rows[r].0];
            let q = DMatrix::from_fn(rows.len(), 6, |r, c| weight(r) * rows[r].1[c]).qr().q();
            for part in [|v: C| v.re, |v: C| v.im] {
                let seen = DVector::from_fn(rows.len(), |r, _| weight(r) * part(line.value[rows[r].0]));
                let rigid = &q * (q.transpose() * &seen);
                left += (&seen - rigid).norm_squared();
                whole += seen.norm_squared();
            }
        }
    }
    (whole > 0.0).then(|| (left / whole).sqrt())
}

impl Changes {
    /// Two points of a body that are exchanged: with their positions exchanged, the body moves as a
    /// rigid one, and without it does not. `blocks` were formed with these parameters.
    pub fn of_exchanged(blocks: &[Block], parameters: &[Parameter]) -> Self {
        let exchanged = [Group::ArmB, Group::SpecimenA, Group::SpecimenB].into_iter().find_map(|group| {
            let points: BTreeSet<usize> = (blocks.iter().flat_map(|block| &block.cells))
                .filter(|cell| cell.group == group)
                .map(|cell| cell.point)
                .collect();
            let points: Vec<usize> = points.into_iter().collect();
            let stated = not_rigid(blocks, parameters, group, None)?;
            let pairs = (0..points.len()).flat_map(|i| (0..i).map(move |k| (i, k)));
            let mut left: Vec<(f64, [usize; 2])> = pairs
                .map(|(i, k)| [points[i], points[k]])
                .filter_map(|pair| Some((not_rigid(blocks, parameters, group, Some(pair))?, pair)))
                .collect();
            left.sort_by(|(a, _), (b, _)| a.total_cmp(b));
            let (best, pair) = left.first()?;
            (best * MUCH_LESS < stated).then(|| pair.map(|at| quantity(&parameters[at].name).to_owned()))
        });
        Changes { exchanged, ..Changes::default() }
    }

    /// Changes the priors. Quantities that the data alone determine no longer count as stated.
    pub fn apply(&self, parameters: &mut [Parameter]) {
        if let Some([one, other]) = &self.exchanged {
            let of = |what: &String| -> Vec<usize> {
                (0..parameters.len()).filter(|i| quantity(&parameters[*i].name) == what).collect()
            };
            for (i, k) in of(one).into_iter().zip(of(other)) {
                let start = parameters[i].start;
                parameters[i].start = parameters[k].start;
                parameters[k].start = start;
            }
        }
        for own in parameters.iter_mut().filter(|own| tested(own)) {
            if self.quantities.iter().any(|what| what == quantity(&own.name)) {
                own.sigma *= FREED;
                own.stated = false;
            } else if let Some(factor) = self.kinds.get(&own.cause) {
                own.sigma *= factor;
            }
        }
    }

    /// What was widened, with the values that `fit` found.
    pub fn contradictions(&self, fit: &Fit) -> Vec<Contradiction> {
        let of = |what: &String| {
            let own = &quantities(fit, |_| true)[what];
            let (first, p) = (&fit.parameters.all()[own[0]], &fit.solution.p);
            let sigma = |i: usize| fit.solution.certainty.covariance[(i, i)].max(0.0).sqrt();
            let off = |i: &usize| [p[*i] - fit.parameters.all()[*i].expected(p), sigma(*i)];
            Contradiction { off: own.iter().map(off).collect(), ..Contradiction::new(what, first.cause) }
        };
        let kind = |(cause, scatter): (&Cause, &f64)| Contradiction {
            scatter: Some(*scatter),
            ..Contradiction::new(cause.name(), *cause)
        };
        let exchanged = self.exchanged.iter().map(|[one, other]| Contradiction {
            exchanged_with: Some(other.clone()),
            ..Contradiction::new(one, fit.parameters.all()[quantities(fit, |_| true)[one][0]].cause)
        });
        self.quantities.iter().map(of).chain(self.kinds.iter().map(kind)).chain(exchanged).collect()
    }
}

impl Contradiction {
    /// Something that is off by this much, each with its standard deviation.
    pub fn by(what: &str, cause: Cause, off: [f64; 2]) -> Self {
        Contradiction { off: vec![off], ..Contradiction::new(what, cause) }
    }

    fn new(what: &str, cause: Cause) -> Self {
        Contradiction { what: what.to_owned(), cause, off: Vec::new(), scatter: None, exchanged_with: None }
    }
}

/// The quantities of some parameters, with the indices of these.
fn quantities(fit: &Fit, chosen: impl Fn(&Parameter) -> bool) -> BTreeMap<String, Vec<usize>> {
    let mut all: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (i, own) in fit.parameters.all().iter().enumerate().filter(|(_, own)| chosen(own)) {
        all.entry(quantity(&own.name).to_owned()).or_default().push(i);
    }
    all
}

/// Deviations in stated standard deviations, and their covariance if the statements are true.
fn deviations(fit: &Fit, own: &[usize]) -> (DVector<f64>, DMatrix<f64>) {
    let (all, answer) = (fit.parameters.all(), &fit.solution.certainty.answer);
    let p = &fit.solution.p;
    let d = |n: usize, _| (p[own[n]] - all[own[n]].expected(p)) / all[own[n]].sigma;
    let covariance = DMatrix::from_fn(own.len(), own.len(), |r, c| {
        let (i, j) = (own[r], own[c]);
        f64::from(u8::from(r == c)) - answer[(i, j)] / (all[i].sigma * all[j].sigma)
    });
    (DVector::from_fn(own.len(), d), covariance)
}

/// A quantity that is not as stated.
#[derive(Debug, Clone, PartialEq)]
pub struct Worst {
    /// Its name.
    pub what: String,
    /// Its deviation in standard deviations of the deviation.
    pub deviations: f64,
    cause: Cause,
    /// χ² over its limit.
    excess: f64,
}

/// The quantity whose deviation exceeds its limit most.
pub fn worst(fit: &Fit) -> Option<Worst> {
    let exceeding = quantities(fit, tested).into_iter().filter_map(|(what, own)| {
        let (d, covariance) = deviations(fit, &own);
        let eigen = SymmetricEigen::new(covariance);
        let along = eigen.eigenvectors.transpose() * d;
        let parts = along.iter().zip(eigen.eigenvalues.iter()).filter(|(_, of)| **of > TESTABLE);
        let (count, chi_square) = parts.fold((0, 0.0), |(n, sum), (d, of)| (n + 1, sum + d * d / of));
        let excess = chi_square / CONTRADICTED.get(usize::checked_sub(count, 1)?)?;
        let cause = fit.parameters.all()[own[0]].cause;
        (excess > 1.0).then(|| Worst { what, deviations: chi_square.sqrt(), cause, excess })
    });
    exceeding.max_by(|a, b| a.excess.total_cmp(&b.excess))
}

/// The kind that scatters most, or that of the worst quantity, with its scatter.
fn worst_kind(fit: &Fit) -> Option<(Cause, f64)> {
    let of_worst = worst(fit).map(|worst| (worst.cause, scatter(fit, worst.cause)));
    kinds(fit).into_iter().chain(of_worst).max_by(|(_, a), (_, b)| a.total_cmp(b))
}

/// Rms of the deviations of a kind's quantities, in stated standard deviations.
fn scatter(fit: &Fit, cause: Cause) -> f64 {
    let of_kind = quantities(fit, |own| tested(own) && own.cause == cause);
    let squares: Vec<f64> = of_kind.values().flatten().map(|i| deviations(fit, &[*i]).0[0].powi(2)).collect();
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

/// The kinds whose quantities scatter farther than stated, with the factor.
fn kinds(fit: &Fit) -> Vec<(Cause, f64)> {
    let mut sums: BTreeMap<Cause, [f64; 2]> = BTreeMap::new();
    for i in quantities(fit, tested).into_values().flatten() {
        let (d, covariance) = deviations(fit, &[i]);
        if covariance[(0, 0)] > TESTABLE {
            let [squares, freedom] = sums.entry(fit.parameters.all()[i].cause).or_default();
            *squares += d[0] * d[0];
            *freedom += covariance[(0, 0)];
        }
    }
    let excess = |(cause, [squares, freedom]): (Cause, [f64; 2])| {
        // Wilson and Hilferty: the cube root of χ² per degree of freedom is nearly normal
        let (part, width) = (squares / freedom, 2.0 / (9.0 * freedom));
        let normal = (part.cbrt() - (1.0 - width)) / width.sqrt();
        (normal > KIND_CONTRADICTED).then_some((cause, part.sqrt()))
    };
    sums.into_iter().filter_map(excess).collect()
}

/// Whether a stated quantity or kind is contradicted.
pub fn remain(fit: &Fit) -> bool {
    worst(fit).is_some() || !kinds(fit).is_empty()
}
