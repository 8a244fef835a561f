//! The result: k_T and c_T with their confidence intervals, the sources of uncertainty of a
//! compliance, and k_T(f); with tests of the estimate's assumptions on its residuals, and the band
//! in which the model holds: beyond it an arm or a specimen bends, or the load cells' calibration
//! ends.
//!
//! The bodies are rigid up to their first bending mode, whose frequency is unknown before the
//! measurement. The residuals of a fit over the whole band show it: if they contradict the model at
//! one end of the band, the lines there carry no information on the contact and are left out. Only
//! the ends are removed. A contradiction in the middle means that a point is misplaced or loose,
//! and stays a doubt.

use super::block::Block;
use super::contradictions::{self, Changes, Contradiction, Worst};
use super::parameters::{COMPLIANCE, Cause, FORM, HAMMER, MASS_ERROR, Parameters, RETARDATION};
use super::solver::{BIN_HZ, Bin, Certainty, Solution};
use super::{ContactError, Fit, HeldOut, Input, SecondPath};
use crate::band::Band;
use crate::hysteresis::contact_drift::ContactDrift;
use crate::identified::COMPLIANCE_HALF_WIDTH;
use crate::substructuring::geometry::Grouping;
use crate::substructuring::joint_over_bands::NORMAL_95;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::collections::BTreeMap;

/// k_T of one frequency bin, N/m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OfFrequency {
    /// Centre of the bin, Hz.
    pub frequency_hz: f64,
    /// k_T in the bin, N/m.
    pub k_t_n_per_m: Interval,
}

/// Stiffness and damping of the contact, with diagnostics.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stiffness {
    /// k_T, N/m. The interval is that of the compliance, inverted.
    pub k_t_n_per_m: Interval,
    /// c_T, N s/m.
    pub c_t_n_s_per_m: Interval,
    /// The lines used, Hz.
    pub band_hz: Band,
    /// Lines used, over all impacts.
    pub lines: usize,
    /// Relative standard deviation of k_T by cause; the squares add up.
    pub budget: BTreeMap<Cause, f64>,
    /// Whether nothing measures specimen B itself, so that k_T is the stiffness between specimen
    /// A's surface and arm B: the bulk of specimen B and its clamp are part of it.
    pub includes_specimen_b: bool,
    /// k_T bin by bin.
    pub of_frequency: Vec<OfFrequency>,
    /// Tests of the assumptions.
    pub diagnosis: Diagnosis,
    /// Stated quantities that the data contradict. Their priors are widened, so that the interval
    /// contains their errors.
    pub contradictions: Vec<Contradiction>,
    /// The assumptions that do not hold.
    pub doubts: Vec<Doubt>,
    /// χ² per degree of freedom over all signals.
    pub chi_square: f64,
    /// Cells predicted without their own signals.
    pub held_out: Vec<HeldOut>,
}

/// Assembles the result of a fit with these changes of the priors.
///
/// # Errors
/// [`ContactError::NotIdentified`] if the compliance cannot be distinguished from zero.
pub fn of(input: &Input<'_>, fit: &Fit, changes: &Changes) -> Result<Stiffness, ContactError> {
    let Fit { parameters, blocks, solution, .. } = fit;
    let covariance = &solution.certainty.covariance;
    let misfit = solution.chi_square.max(1.0);
    let (compliance, row) = of_contact(&solution.p);
    let variances = of_sum(&row, parameters, &solution.certainty, misfit);
    let (mut k_t, mut budget) = stiffness_of(compliance, variances)?;
    let k = k_t.mean;
    // c = β/c₀, which the hammer's gain scales as it scales k
    let beta = solution.p[RETARDATION];
    let mut slopes = &row * (-beta * k * k);
    slopes[RETARDATION] = k;
    let of_damping = (covariance * &slopes).dot(&slopes);
    let balance = force_balance(input, fit, misfit);
    let contradictions: Vec<Contradiction> = changes.contradictions(fit).into_iter().chain(balance).collect();
    // on the known mass, an error of its weight looks like one of the hammer or of all vibrometers,
    // which k_T is in proportion to: the interval contains both
    let scale = |one: &Contradiction| match (one.what.as_str(), one.off.first()?) {
        (FORCE_BALANCE, [off, _]) => Some(off.abs()),
        // the logarithm of a ratio
        (MASS_ERROR, [off, sigma]) => Some((off.abs() + NORMAL_95 * sigma).exp_m1()),
        _ => None,
    };
    let false_scale = contradictions.iter().filter_map(scale).reduce(f64::max);
    let of_scale = (false_scale.unwrap_or(0.0) / NORMAL_95 * beta * k).powi(2);
    let spread = NORMAL_95 * (of_damping.max(0.0) * misfit + of_scale).sqrt();
    let c_t = Interval { mean: beta * k, ci95: [beta * k - spread, beta * k + spread] };

    let diagnosis = diagnose(fit);
    let mut doubts = diagnosis.doubts(contradictions::remain(fit));
    if let Some(off) = false_scale {
        match offset(k_t, &mut budget, Cause::Gains, off) {
            Some(wide) => k_t = wide,
            None if doubts.contains(&Doubt::Force) => {}
            None => doubts.push(Doubt::Force),
        }
    }
    Ok(Stiffness {
        k_t_n_per_m: k_t,
        c_t_n_s_per_m: c_t,
        band_hz: input.band_hz,
        lines: blocks.iter().filter(|block| block.counts).map(|block| block.lines.len()).sum(),
        budget,
        includes_specimen_b: input.includes_specimen_b(),
        of_frequency: of_frequency(blocks, solution, compliance),
        contradictions,
        doubts,
        diagnosis,
        chi_square: solution.chi_square,
        held_out: Vec::new(),
    })
}

/// The contact's compliance, m/N, and its derivatives by the parameters: all signals are per newton
/// that the hammer shows.
pub fn of_contact(p: &[f64]) -> (f64, DVector<f64>) {
    let mut row = DVector::zeros(p.len());
    row[COMPLIANCE] = 1.0 + p[HAMMER];
    row[HAMMER] = p[COMPLIANCE];
    (p[COMPLIANCE] * (1.0 + p[HAMMER]), row)
}

/// Name of the contradiction between the hammer's force and the load cells'.
pub const FORCE_BALANCE: &str = "the hammer's force cell";

/// Standard deviations beyond which the load cells show more force than the hammer gives: this is a
/// single test, and the sign alone is impossible.
const IMPOSSIBLE: f64 = 3.0;

/// Part of the force that passes beside the load cells in addition to the stated part, above which
/// a statement is false: rods and cables are seldom known better.
const MUCH_BESIDE: f64 = 0.1;

/// Whether the force of the hits on B alone contradicts the load cells. In slow motion the hammer's
/// force is the load cells' plus what passes beside them: a part that cannot be negative, and that
/// the plan may state. The form of the force shows that part, as far as both gains are right.
fn force_balance(input: &Input<'_>, fit: &Fit, misfit: f64) -> Option<Contradiction> {
    let load_cells = fit.load_cells_n_per_m?;
    let mut row = DVector::zeros(fit.solution.p.len());
    row[FORM] = 1.0;
    row[FORM + 2] = load_cells.recip();
    // the force that the hammer shows, per newton of the load cells
    let shown = row.dot(&DVector::from_column_slice(&fit.solution.p));
    let hammer = 1.0 + fit.solution.p[HAMMER];
    row[HAMMER] = -shown / hammer;
    let beside = shown / hammer - 1.0;
    let fitted: f64 = of_sum(&row, &fit.parameters, &fit.solution.certainty, misfit).values().sum();
    let sigma = fitted.sqrt().hypot(input.priors.gain);
    let false_ = beside < -IMPOSSIBLE * sigma
        || input.parallel_path.is_some_and(|stated| beside > stated + MUCH_BESIDE.max(IMPOSSIBLE * sigma));
    let off = beside - input.parallel_path.unwrap_or(0.0);
    false_.then(|| Contradiction::by(FORCE_BALANCE, Cause::Gains, [off, sigma]))
}

impl Stiffness {
    /// Allows for a contact that changed during the hits on A: the interval then contains its
    /// stiffness in the first and in the last of them. If it changed so much that no interval is
    /// useful, this is a doubt.
    pub fn allow_for(&mut self, drift: &ContactDrift) {
        let own = Contradiction::by("the contact", Cause::Drift, [drift.change, drift.std]);
        self.contradictions.push(own);
        match over_time(self.k_t_n_per_m, &mut self.budget, drift) {
            Some(k_t) => self.k_t_n_per_m = k_t,
            None => self.doubts.push(Doubt::Drift),
        }
    }

    /// Allows for a part of the force that passes beside the contact: the interval then contains
    /// k_T with and without it. If no interval is useful, this is a doubt.
    pub fn allow_for_path(&mut self, path: &SecondPath) {
        let what = format!("a second path of {:.1} N/µm", 1e-6 * path.stiffness_n_per_m);
        let own = Contradiction::by(&what, Cause::SecondPath, [path.part, path.std()]);
        self.contradictions.push(own);
        match beside(self.k_t_n_per_m, &mut self.budget, path) {
            Some(k_t) => self.k_t_n_per_m = k_t,
            None => self.doubts.push(Doubt::SecondPath),
        }
    }
}

/// k_T with an interval that contains it with and without the part of the force that passes beside
/// the contact; `None` if no useful interval remains.
pub fn beside(k_t: Interval, budget: &mut BTreeMap<Cause, f64>, path: &SecondPath) -> Option<Interval> {
    offset(k_t, budget, Cause::SecondPath, path.part + NORMAL_95 * path.std())
}

/// k_T with an interval that contains the stiffness in the first and in the last hits; `None` if it
/// changed by too much for that. The change at the spots is larger at the contact itself, because
/// what else gives between the spots does not change.
pub fn over_time(k_t: Interval, budget: &mut BTreeMap<Cause, f64>, drift: &ContactDrift) -> Option<Interval> {
    let at_the_contact = (k_t.mean / drift.at_the_spots_n_per_m).max(1.0);
    let change = 0.5 * at_the_contact * (drift.change.abs() + NORMAL_95 * drift.std);
    offset(k_t, budget, Cause::Drift, change)
}

/// k_T with an interval that is wider by this much on both sides, relative to the value, for an
/// error that is there for certain; `None` if no useful interval remains.
fn offset(k_t: Interval, budget: &mut BTreeMap<Cause, f64>, cause: Cause, by: f64) -> Option<Interval> {
    // relative to the compliance, in which the interval is symmetrical
    let half = 0.5 * k_t.mean * (k_t.ci95[0].recip() - k_t.ci95[1].recip());
    let whole = half + by;
    if whole >= COMPLIANCE_HALF_WIDTH {
        return None;
    }
    // the part that, added in squares as all others, gives the sum
    let part = (whole * whole - half * half).sqrt() / NORMAL_95;
    let share = budget.entry(cause).or_default();
    *share = share.hypot(part);
    Some(Interval { mean: k_t.mean, ci95: [k_t.mean / (1.0 + whole), k_t.mean / (1.0 - whole)] })
}

fn of_frequency(blocks: &[Block], solution: &Solution, compliance: f64) -> Vec<OfFrequency> {
    let mut lows: Vec<f64> = solution.bins.iter().map(|bin| bin.low_hz).collect();
    lows.sort_by(f64::total_cmp);
    lows.dedup();
    let scale = 1.0 + solution.p[HAMMER];
    let at = |low: f64| {
        let part = part(blocks, solution, |_, at| at == low)?;
        let (mean, half) = (compliance + scale * part.deviation, NORMAL_95 * scale * part.sigma);
        let interval = Interval { mean: mean.recip(), ci95: [(mean + half).recip(), (mean - half).recip()] };
        let known = half < COMPLIANCE_HALF_WIDTH * mean;
        known.then_some(OfFrequency { frequency_hz: low + 0.5 * BIN_HZ, k_t_n_per_m: interval })
    };
    lows.into_iter().filter_map(at).collect()
}

/// A value with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// The value.
    pub mean: f64,
    /// Its 95 % interval, lower and upper end.
    pub ci95: [f64; 2],
}

/// A relative share of the uncertainty below this is rounding: the cause does not affect the
/// signals.
const ROUNDING: f64 = 1e-9;

/// Variances by cause, in the squared unit of the uncertain quantity; they add up.
pub type Variances = BTreeMap<Cause, f64>;

/// Variances of Σ row_i p_i by cause.
pub fn of_sum(row: &DVector<f64>, parameters: &Parameters, certainty: &Certainty, misfit: f64) -> Variances {
    let variance = (&certainty.covariance * row).dot(row);
    // the estimate's response to an error of a prior, whose precision enters as half an inverse
    // variance
    let answer = &certainty.answer * row;
    let mut variances = Variances::new();
    let mut noise = variance;
    for (own, answer) in parameters.all().iter().zip(answer.iter()) {
        if !own.sigma.is_finite() || own.sigma == 0.0 || own.cause == Cause::Noise {
            continue;
        }
        let share = (answer / own.sigma).powi(2);
        *variances.entry(own.cause).or_default() += share;
        noise -= share;
    }
    variances.insert(Cause::Noise, noise.max(0.0));
    variances.insert(Cause::Misfit, (variance * (misfit - 1.0)).max(0.0));
    variances
}

/// k_T of a compliance in m/N with these variances, and its relative standard deviation by cause.
///
/// # Errors
/// [`ContactError::NotIdentified`] if the compliance cannot be distinguished from zero.
pub fn stiffness_of(
    compliance: f64,
    variances: Variances,
) -> Result<(Interval, BTreeMap<Cause, f64>), ContactError> {
    let half = NORMAL_95 * variances.values().sum::<f64>().sqrt();
    if !(compliance > 0.0 && half < COMPLIANCE_HALF_WIDTH * compliance) {
        let stiffest = compliance + half;
        return Err(ContactError::NotIdentified(if stiffest > 0.0 {
            format!(
                "the contact is too stiff to be distinguished from a rigid one: k_T is above {:.0} N/µm",
                1e-6 / stiffest
            )
        } else {
            "the estimated compliance is negative".into()
        }));
    }
    let ci95 = [1.0 / (compliance + half), 1.0 / (compliance - half)];
    let shares = variances.into_iter().map(|(cause, variance)| (cause, variance.sqrt() / compliance));
    let counts = |share: &(Cause, f64)| share.1 > ROUNDING;
    Ok((Interval { mean: 1.0 / compliance, ci95 }, shares.filter(counts).collect()))
}

/// χ² per degree of freedom above which a kind of signal contradicts the model, allowing for the
/// uncertainty of the noise itself.
const CONTRADICTED: f64 = 10.0;
/// Standard deviations by which one of about a hundred stated quantities may be off.
const BEYOND: f64 = 5.0;
/// Standard deviations by which two readings of k_T may differ.
const APART: f64 = 4.0;

/// Part of the signals of specimen A's points above which they are doubted, as those of a loose
/// point: where only two impacts on A show the aims, these leave up to 5 %.
const LOOSE: f64 = 0.06;

/// The residual of some signals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SignalResidual {
    /// χ² per degree of freedom: 1 where only noise is left.
    pub chi_square: f64,
    /// Rms of the residual relative to the signals' rms, both weighted by the noise.
    pub part: f64,
}

/// Signals that are judged together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signals {
    /// All signals of the hits on B alone: they test the force's form.
    Calibration,
    /// The points on specimen A.
    SpecimenA,
    /// The spots in the assembly.
    Spots,
}

impl Signals {
    /// All kinds of signals.
    pub const ALL: [Self; 3] = [Self::Calibration, Self::SpecimenA, Self::Spots];

    /// Indices of their kinds of rows.
    fn kinds(self) -> &'static [usize] {
        match self {
            Self::Calibration => &[0, 1, 3, 5],
            Self::SpecimenA => &[4],
            Self::Spots => &[1, 2],
        }
    }

    /// The assumption that they contradict.
    fn doubt(self) -> Doubt {
        match self {
            Self::Calibration => Doubt::Force,
            Self::SpecimenA => Doubt::SpecimenA,
            Self::Spots => Doubt::Spots,
        }
    }

    /// Fraction of the signal that may remain unexplained in addition to noise. Aim errors leave
    /// about a per cent of a strong local mode, which the misfit in the interval covers; a
    /// misplaced or loose point leaves more.
    fn unexplained(self) -> f64 {
        match self {
            Self::Calibration => 0.01,
            Self::SpecimenA => 0.04,
            Self::Spots => 0.02,
        }
    }

    /// The model's residual of these signals in some bins.
    pub fn left<'a>(self, blocks: &[Block], bins: impl Iterator<Item = &'a Bin>) -> SignalResidual {
        let alone = self == Self::Calibration;
        let own = bins.filter(|bin| blocks[bin.block].along_z.is_some() == alone);
        let kinds = own.flat_map(|bin| self.kinds().iter().map(move |k| bin.normal.kinds[*k]));
        let [chi, expected, signal] =
            kinds.fold([0.0; 3], |sum: [f64; 3], of| std::array::from_fn(|i| sum[i] + of[i]));
        SignalResidual {
            chi_square: if expected > 1e-9 { chi / expected } else { 0.0 },
            part: if signal > 0.0 { (chi / signal).sqrt() } else { 0.0 },
        }
    }

    /// Whether this residual of all lines puts the result in doubt.
    fn doubted(self, left: SignalResidual) -> bool {
        self.contradict(left) && (self != Self::SpecimenA || left.part > LOOSE)
    }

    /// Whether this residual contradicts the model.
    pub fn contradict(self, left: SignalResidual) -> bool {
        left.chi_square > CONTRADICTED && left.part > self.unexplained()
    }
}

/// The quantity that deviates most from its stated value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Farthest {
    /// Name of the position, angle, gain or delay.
    pub what: String,
    /// Its deviation: if the data contradict it, in standard deviations of the deviation, else in
    /// stated ones.
    pub deviations: f64,
}

/// How well each assumption holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// Residual of the force's form in the hits on B alone.
    pub calibration: SignalResidual,
    /// Residual of specimen A's points as points of a rigid body.
    pub specimen_a: SignalResidual,
    /// Residual of the spots.
    pub spots: SignalResidual,
    /// χ² per degree of freedom of k_T(f) being a single number.
    pub flatness_chi_square: f64,
    /// The position, angle, gain or delay that the data contradict most, or else the one that
    /// deviates most from its stated value; none if nothing is stated.
    pub farthest: Option<Farthest>,
    /// Difference between the compliance from hits on A and from hits on the moving mass, in
    /// standard deviations; none if only one was hit.
    pub sides_apart: Option<f64>,
}

/// An assumption that does not hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Doubt {
    /// The form does not reproduce the force in the hits on B alone.
    Force,
    /// Specimen A does not move as a rigid body, or a point is misplaced.
    SpecimenA,
    /// A spot does not move with its body.
    Spots,
    /// A position, angle, gain or delay deviates from its stated value by more than its stated
    /// error allows.
    Stated,
    /// k_T changes with frequency.
    Flatness,
    /// k_T depends on where the structure is hit.
    Sides,
    /// The contact changed while it was hit, by too much for one number.
    Drift,
    /// Much of the force passes beside the contact.
    SecondPath,
}

/// The compliance from a subset of the lines, with all other parameters from all lines: its
/// difference from the overall estimate, and its standard deviation.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// Deviation, m/N.
    deviation: f64,
    /// Standard deviation, m/N.
    sigma: f64,
}

/// The compliance of the lines that `of` selects by block and bin, as an additional parameter next
/// to all others (score test).
fn part(blocks: &[Block], solution: &Solution, of: impl Fn(&Block, f64) -> bool) -> Option<Part> {
    let mut own = 0.0;
    let mut slope = 0.0;
    let mut coupling = DVector::zeros(solution.p.len());
    for bin in &solution.bins {
        let block = &blocks[bin.block];
        if block.along_z.is_some() || !of(block, bin.low_hz) {
            continue;
        }
        let weight = solution.shared.recip();
        let row = block.local(COMPLIANCE);
        own += weight * bin.normal.information[(row, row)];
        slope += weight * bin.normal.gradient[row];
        for (i, parameter) in block.parameters.iter().enumerate() {
            coupling[*parameter] += weight * bin.normal.information[(row, i)];
        }
    }
    // half of the inverse
    let explained = 2.0 * quadratic(&solution.certainty.answer, &coupling);
    let left = own - explained;
    (left > 1e-6 * own && own > 0.0).then(|| Part { deviation: -slope / left, sigma: (0.5 / left).sqrt() })
}

fn quadratic(matrix: &DMatrix<f64>, v: &DVector<f64>) -> f64 {
    (matrix * v).dot(v)
}

/// Tests every assumption. Aims are not candidates for the largest deviation: on the moving mass
/// they absorb the effect of shifts of the hammer. Neither are guesses.
fn diagnose(fit: &Fit) -> Diagnosis {
    let Fit { parameters, blocks, solution, .. } = fit;
    let contradicted =
        contradictions::worst(fit).map(|Worst { what, deviations, .. }| Farthest { what, deviations });
    let stated =
        parameters.all().iter().zip(&solution.p).filter(|(own, _)| {
            own.stated && !matches!(own.cause, Cause::Noise | Cause::Aim) && own.sigma > 0.0
        });
    let farthest = stated
        .map(|(own, value)| (own, own.deviations(*value, &solution.p)))
        .max_by(|(_, a), (_, b)| a.total_cmp(b))
        .map(|(own, deviations)| Farthest { what: own.name.clone(), deviations });
    let mut lows: Vec<f64> = solution.bins.iter().map(|bin| bin.low_hz).collect();
    lows.sort_by(f64::total_cmp);
    lows.dedup();
    let parts: Vec<Part> = lows.iter().filter_map(|low| part(blocks, solution, |_, at| at == *low)).collect();
    let flatness: f64 = parts.iter().map(|p| (p.deviation / p.sigma).powi(2)).sum();
    let on_mass = |block: &Block| block.grouping == Grouping::InternalA;
    let hit = |wanted: bool| blocks.iter().any(|b| b.along_z.is_none() && on_mass(b) == wanted);
    let sides =
        (hit(true) && hit(false)).then(|| part(blocks, solution, |block, _| on_mass(block))).flatten();
    Diagnosis {
        calibration: Signals::Calibration.left(blocks, solution.bins.iter()),
        specimen_a: Signals::SpecimenA.left(blocks, solution.bins.iter()),
        spots: Signals::Spots.left(blocks, solution.bins.iter()),
        farthest: contradicted.or(farthest),
        flatness_chi_square: if parts.is_empty() { 1.0 } else { flatness / parts.len() as f64 },
        sides_apart: sides.map(|part| part.deviation / part.sigma),
    }
}

impl Diagnosis {
    /// The assumptions that do not hold; `contradicted` states whether the data contradict
    /// something stated.
    fn doubts(&self, contradicted: bool) -> Vec<Doubt> {
        let left = [self.calibration, self.specimen_a, self.spots];
        let contradicting =
            Signals::ALL.into_iter().zip(left).filter(|(signals, left)| signals.doubted(*left));
        let mut all: Vec<Doubt> = contradicting.map(|(signals, _)| signals.doubt()).collect();
        if contradicted || self.farthest.as_ref().is_some_and(|one| one.deviations > BEYOND) {
            all.push(Doubt::Stated);
        }
        if self.flatness_chi_square > CONTRADICTED {
            all.push(Doubt::Flatness);
        }
        if self.sides_apart.is_some_and(|apart| apart.abs() > APART) {
            all.push(Doubt::Sides);
        }
        all
    }
}

/// A narrower band hardly determines a stiffness and a damping, Hz. A contradiction at all
/// frequencies is not a matter of the band.
const NARROWEST_HZ: f64 = 200.0;

/// The band without the ends at which the residuals contradict the model; the whole band if too
/// little would remain or nothing contradicts.
pub fn trusted(blocks: &[Block], bins: &[Bin], whole: Band) -> Band {
    let mut lows: Vec<f64> = bins.iter().map(|bin| bin.low_hz).collect();
    lows.sort_by(f64::total_cmp);
    lows.dedup();
    let holds = |low: &f64| {
        let own = || bins.iter().filter(|bin| bin.low_hz == *low);
        Signals::ALL.iter().all(|signals| !signals.contradict(signals.left(blocks, own())))
    };
    let good: Vec<bool> = lows.iter().map(holds).collect();
    let (Some(first), Some(last)) = (good.iter().position(|g| *g), good.iter().rposition(|g| *g)) else {
        return whole;
    };
    let low_hz = if first == 0 { whole.low_hz } else { lows[first] };
    // a line on the edge belongs to the next bin
    let high_hz = if last + 1 == lows.len() { whole.high_hz } else { (lows[last] + BIN_HZ).next_down() };
    if high_hz - low_hz < NARROWEST_HZ { whole } else { Band { low_hz, high_hz } }
}
