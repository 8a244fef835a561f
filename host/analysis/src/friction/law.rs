//! The laws, their parameters, and the force along a path of displacements.
//!
//! One stroke of each:
//!
//! - Jenkins: a spring up to the limit (Jenkins, J. Appl. Mech. 29 (1962) 1);
//! - Mindlin: Y (1 − (1 − 2k|x|/3Y)^3/2) (Mindlin & Deresiewicz, J. Appl. Mech. 20 (1953) 327);
//! - Iwan: sliders of density R φ^χ below φ_max, and the rest at φ_max (Segalman, J. Appl. Mech. 72
//!   (2005) 752);
//! - Dahl: dF/dx = σ (1 − sF/F_C)^i (Dahl, The Aerospace Corporation TOR-0158 (1968));
//! - Bouc–Wen: dF/dx = k (1 − |F/Y|^n (β sgn(sF) + γ)/(β + γ)) (Wen, J. Eng. Mech. 102 (1976) 249);
//! - Valanis: dF/dx = E₀ (1 − w)/(1 − κw), w = s(F − E_t x)/(Y(1 − κE_t/E₀)) (Gaul & Nitsche, Appl.
//!   Mech. Rev. 54 (2001) 93).
//!
//! s is the sign of the velocity. The first three follow Masing's rules: after a reversal the
//! backbone is doubled, a closed inner loop is forgotten, and beyond the largest displacement so
//! far the path returns to the backbone. The others depend on the last point only.
//!
//! Some laws contain others: Iwan (β → ∞), Dahl (i → 0), Bouc–Wen (n → ∞, β = γ) and Valanis
//! (κ → 1, E_t = 0) become Jenkins; Dahl with i = 1 is Bouc–Wen with n = 1, γ = 0 and Valanis with
//! κ = E_t = 0.

use super::FrictionError;
use super::curve::TravelCurve;
use crate::hysteresis::loops::swing;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// The periodic force of a law without memory is found when one cycle changes it by less than this
/// fraction of its limit.
const PERIODIC: f64 = 1e-10;

/// Most cycles until then.
const MOST_CYCLES: usize = 200;

/// Which law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LawKind {
    /// One spring and one slider.
    Jenkins,
    /// Microslip that grows from the edge of a contact between spheres.
    Mindlin,
    /// Dahl's law with its exponent.
    Dahl,
    /// Valanis' endochronic law.
    Valanis,
    /// Bouc's and Wen's law without a spring in parallel.
    BoucWen,
    /// Segalman's four-parameter Iwan law.
    Iwan,
}

/// The range of a parameter, and the scale on which it is fitted and its interval is symmetric.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ParameterScale {
    /// Above 0; logarithm.
    Positive,
    /// Above −1; logarithm of the value plus one.
    AboveMinusOne,
    /// Between 0 and 1; logit.
    Share,
    /// Below 1; linear.
    BelowOne,
}

/// A parameter of a law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LawParameter {
    /// Name, with its unit unless it is a ratio.
    pub name: &'static str,
    pub(super) scale: ParameterScale,
    /// Where the fit looks for it, on its scale; beyond, the law is that at the end to within any
    /// noise.
    pub(super) search: [f64; 2],
}

impl LawParameter {
    const fn new(name: &'static str, scale: ParameterScale, search: [f64; 2]) -> Self {
        Self { name, scale, search }
    }

    fn range(&self) -> (&'static str, fn(f64) -> bool) {
        match self.scale {
            ParameterScale::Positive => ("(0, ∞)", |v| v > 0.0),
            ParameterScale::AboveMinusOne => ("(−1, ∞)", |v| v > -1.0),
            ParameterScale::Share => ("(0, 1)", |v| v > 0.0 && v < 1.0),
            ParameterScale::BelowOne => ("(−∞, 1)", |v| v < 1.0),
        }
    }

    /// From the value to the scale of the fit.
    pub(super) fn scaled(self, value: f64) -> f64 {
        match self.scale {
            ParameterScale::Positive => value.ln(),
            ParameterScale::AboveMinusOne => value.ln_1p(),
            ParameterScale::Share => (value / (1.0 - value)).ln(),
            ParameterScale::BelowOne => value,
        }
    }

    /// Back from the scale of the fit.
    pub(super) fn unscaled(self, scaled: f64) -> f64 {
        match self.scale {
            ParameterScale::Positive => scaled.exp(),
            ParameterScale::AboveMinusOne => scaled.exp_m1(),
            ParameterScale::Share => 1.0 / (1.0 + (-scaled).exp()),
            ParameterScale::BelowOne => scaled,
        }
    }

    /// d value / d scaled.
    pub(super) fn derivative(self, value: f64) -> f64 {
        match self.scale {
            ParameterScale::Positive => value,
            ParameterScale::AboveMinusOne => value + 1.0,
            ParameterScale::Share => value * (1.0 - value),
            ParameterScale::BelowOne => 1.0,
        }
    }
}

const ANYWHERE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
/// k_T: the slope of the virgin curve at zero force, N/m.
const STIFFNESS: LawParameter = LawParameter::new("k_t_n_per_m", ParameterScale::Positive, ANYWHERE);
/// The force that the law approaches while it slides, N.
const LIMIT: LawParameter = LawParameter::new("limit_n", ParameterScale::Positive, ANYWHERE);

impl LawKind {
    /// All laws, those with fewer parameters first.
    pub const ALL: [Self; 6] =
        [Self::Jenkins, Self::Mindlin, Self::Dahl, Self::Valanis, Self::BoucWen, Self::Iwan];

    /// Its name in text and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Jenkins => "jenkins",
            Self::Mindlin => "mindlin",
            Self::Dahl => "dahl",
            Self::Valanis => "valanis",
            Self::BoucWen => "bouc-wen",
            Self::Iwan => "iwan",
        }
    }

    /// Its parameters. The first is always k_T (`k_t_n_per_m`), the second the limit (`limit_n`).
    ///
    /// - Dahl: `exponent` i.
    /// - Valanis: `slip_slope_ratio` E_t/E₀, `kappa` κ; its limit is Y, the force at which the line
    ///   of sliding crosses zero displacement being Y (1 − E_t/E₀).
    /// - Bouc–Wen: `exponent` n, `beta_share` β/(β + γ). Below 0.5 small inner loops can produce
    ///   energy.
    /// - Iwan: `chi` χ, `beta` β.
    pub const fn parameters(self) -> &'static [LawParameter] {
        const JENKINS: [LawParameter; 2] = [STIFFNESS, LIMIT];
        const DAHL: [LawParameter; 3] =
            [STIFFNESS, LIMIT, LawParameter::new("exponent", ParameterScale::Positive, [-3.0, 4.0])];
        const VALANIS: [LawParameter; 4] = [
            STIFFNESS,
            LIMIT,
            LawParameter::new("slip_slope_ratio", ParameterScale::BelowOne, [-2.0, 0.95]),
            LawParameter::new("kappa", ParameterScale::Share, [-12.0, 12.0]),
        ];
        const BOUC_WEN: [LawParameter; 4] = [
            STIFFNESS,
            LIMIT,
            LawParameter::new("exponent", ParameterScale::Positive, [-3.0, 4.0]),
            LawParameter::new("beta_share", ParameterScale::Positive, [-4.0, 2.0]),
        ];
        const IWAN: [LawParameter; 4] = [
            STIFFNESS,
            LIMIT,
            LawParameter::new("chi", ParameterScale::AboveMinusOne, [-4.0, 3.0]),
            LawParameter::new("beta", ParameterScale::Positive, [-10.0, 10.0]),
        ];
        match self {
            Self::Jenkins | Self::Mindlin => &JENKINS,
            Self::Dahl => &DAHL,
            Self::Valanis => &VALANIS,
            Self::BoucWen => &BOUC_WEN,
            Self::Iwan => &IWAN,
        }
    }
}

impl std::fmt::Display for LawKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}

/// A law with its parameters, each within its range.
#[derive(Debug, Clone, PartialEq)]
pub struct FrictionLaw {
    kind: LawKind,
    values: Vec<f64>,
}

/// As `{"law": name, parameter: value, …}`.
impl Serialize for FrictionLaw {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut map = to.serialize_map(Some(1 + self.values.len()))?;
        map.serialize_entry("law", self.kind.name())?;
        for (parameter, value) in self.parameters() {
            map.serialize_entry(parameter.name, &value)?;
        }
        map.end()
    }
}

impl FrictionLaw {
    /// A law from the values of its parameters, in the order of [`LawKind::parameters`].
    ///
    /// # Errors
    /// Another number of values, or a value outside its range.
    pub fn new(kind: LawKind, values: &[f64]) -> Result<Self, FrictionError> {
        let (law, parameters) = (kind.name(), kind.parameters());
        if values.len() != parameters.len() {
            let (expected, given) = (parameters.len(), values.len());
            return Err(FrictionError::ParameterCount { law, expected, given });
        }
        for (parameter, &value) in parameters.iter().zip(values) {
            let (range, inside) = parameter.range();
            if !value.is_finite() || !inside(value) {
                return Err(FrictionError::Parameter { law, parameter: parameter.name, value, range });
            }
        }
        Ok(Self { kind, values: values.to_vec() })
    }

    /// Which law.
    pub fn kind(&self) -> LawKind {
        self.kind
    }

    /// Its parameters with their values.
    pub fn parameters(&self) -> impl Iterator<Item = (LawParameter, f64)> {
        self.kind.parameters().iter().copied().zip(self.values.iter().copied())
    }

    /// k_T, N/m: the slope of the virgin curve at zero force.
    pub fn k_t_n_per_m(&self) -> f64 {
        self.values[0]
    }

    /// The force that the law approaches while it slides, N. Valanis' force continues to rise by
    /// its slip slope.
    pub fn limit_n(&self) -> f64 {
        self.values[1]
    }

    /// The force (N) at each displacement (m) of a path that starts at its first point without
    /// force and without memory.
    pub fn along(&self, path_m: &[f64]) -> Vec<f64> {
        let Some(&first) = path_m.first() else { return Vec::new() };
        let mut state = LawState::new(self, first, swing(path_m));
        path_m.iter().map(|&x| state.step(x)).collect()
    }

    /// The force (N) at each displacement (m) of a closed path that is repeated until the force is
    /// periodic. The virgin curve starts at the middle of the path; a law without memory forgets
    /// that, the others are symmetric about it.
    pub fn steady(&self, cycle_m: &[f64]) -> Vec<f64> {
        let Some(&first) = cycle_m.first() else { return Vec::new() };
        let (low, high) = ends(cycle_m);
        let mut state = LawState::new(self, 0.5 * (low + high), high - low);
        let turns = turning_points(cycle_m);
        state.step(high);
        state.step(low);
        // the force only depends on the turning points
        let mut before = f64::NAN;
        for _ in 0..MOST_CYCLES {
            for &turn in &turns {
                state.step(turn);
            }
            let now = state.step(first);
            if (now - before).abs() <= PERIODIC * self.limit_n() {
                break;
            }
            before = now;
        }
        cycle_m.iter().map(|&x| state.step(x)).collect()
    }

    /// Whether it follows Masing's rules.
    pub fn is_masing(&self) -> bool {
        matches!(self.kind, LawKind::Jenkins | LawKind::Mindlin | LawKind::Iwan)
    }

    /// The virgin curve of a law that follows Masing's rules: force (N) at a displacement (m) of
    /// any sign.
    fn backbone(&self, x_m: f64) -> f64 {
        let (k, limit, u) = (self.values[0], self.values[1], x_m.abs());
        let force = match self.kind {
            LawKind::Mindlin => {
                let rest = (1.0 - k * u / (1.5 * limit)).max(0.0);
                limit * (1.0 - rest * rest.sqrt())
            }
            LawKind::Iwan => {
                let (chi, beta) = (self.values[2], self.values[3]);
                let part = u / self.all_slide_m();
                if part >= 1.0 {
                    limit
                } else {
                    // K_T u − R u^(χ+2) / ((χ+1)(χ+2)), with R φ_max^(χ+1) / (χ+1) = K_T / (1+β)
                    k * u * (1.0 - part.powf(chi + 1.0) / ((1.0 + beta) * (chi + 2.0)))
                }
            }
            _ => (k * u).min(limit),
        };
        force.copysign(x_m)
    }

    /// The curve of a law that does not follow Masing's rules, for paths of this swing, m.
    fn curve(&self, swing_m: f64) -> TravelCurve {
        match self.kind {
            LawKind::Dahl => TravelCurve::Power { exponent: self.values[2] },
            LawKind::Valanis => {
                let (ratio, kappa) = (self.values[2], self.values[3]);
                TravelCurve::Rational { q: kappa * (1.0 - ratio) / (1.0 - kappa * ratio) }
            }
            _ => {
                let (n, share) = (self.values[2], self.values[3]);
                let g = |v: f64| {
                    // for a force against the motion, β changes its sign: γ − β = (1 − 2 share)
                    let weight = if v > 0.0 { 1.0 } else { 1.0 - 2.0 * share };
                    1.0 - weight * v.abs().powf(n)
                };
                // a stroke can begin where another one of the same length has ended
                TravelCurve::integrated(g, 2.0 * swing_m * self.values[0] / self.values[1])
            }
        }
    }

    /// Slope of the spring in parallel, N/m, and the limit of the hysteretic force, N.
    fn parallel_spring(&self) -> (f64, f64) {
        match self.kind {
            LawKind::Valanis => (self.values[0] * self.values[2], self.values[1] * (1.0 - self.values[2])),
            _ => (0.0, self.values[1]),
        }
    }
}

/// One of the elements in parallel that a law is replaced by: a spring up to a limit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SliderElement {
    /// Stiffness, N/m.
    pub k_t_n_per_m: f64,
    /// Limit, N.
    pub limit_n: f64,
}

/// Elements that replace a law with a curved backbone: half of them slide at displacements in a
/// geometric row, half at equal distances, each relative to that of the last one.
const ELEMENTS: usize = 60;

/// Where the first element slides, and where the geometric row ends.
const GEOMETRIC: [f64; 2] = [5e-3, 0.4];

impl FrictionLaw {
    /// Springs with sliders in parallel that replace a law that follows Masing's rules: one for
    /// Jenkins, 60 for the others, whose backbone is then a polygon with corners on the law's.
    /// `None` for a law that does not follow Masing's rules: it has no such elements.
    pub fn slider_elements(&self) -> Option<Vec<SliderElement>> {
        let (k, limit) = (self.values[0], self.values[1]);
        let slides_m = match self.kind {
            LawKind::Jenkins => {
                return Some(vec![SliderElement { k_t_n_per_m: k, limit_n: limit }]);
            }
            LawKind::Mindlin => 1.5 * limit / k,
            LawKind::Iwan => self.all_slide_m(),
            _ => return None,
        };
        let half = ELEMENTS / 2;
        let [first, change] = GEOMETRIC;
        let geometric = (0..half).map(|i| first * (change / first).powf(i as f64 / (half - 1) as f64));
        let equal = (1..=half).map(|i| change + (1.0 - change) * i as f64 / half as f64);
        let corners: Vec<f64> = geometric.chain(equal).map(|part| part * slides_m).collect();
        let mut before = (0.0, 0.0);
        let mut slopes: Vec<f64> = corners
            .iter()
            .map(|&x| {
                let here = (x, self.backbone(x));
                let slope = (here.1 - before.1) / (here.0 - before.0);
                before = here;
                slope
            })
            .collect();
        slopes.push(0.0);
        let element = |(i, &x): (usize, &f64)| {
            let own = slopes[i] - slopes[i + 1];
            SliderElement { k_t_n_per_m: own, limit_n: own * x }
        };
        Some(corners.iter().enumerate().map(element).filter(|e| e.k_t_n_per_m > 0.0).collect())
    }

    /// φ_max of an Iwan law: the displacement at which its last slider slides, m.
    fn all_slide_m(&self) -> f64 {
        let (k, limit, chi, beta) = (self.values[0], self.values[1], self.values[2], self.values[3]);
        // mean position of the power law's sliders, as a fraction of φ_max
        let mean = (chi + 1.0) / (chi + 2.0);
        limit * (1.0 + beta) / (k * (beta + mean))
    }
}

/// A law on its way along a path.
#[derive(Debug, Clone)]
pub struct LawState<'a> {
    law: &'a FrictionLaw,
    at_m: f64,
    force_n: f64,
    /// Displacement without force.
    origin_m: f64,
    memory: LawMemory,
}

#[derive(Debug, Clone)]
enum LawMemory {
    /// Turning points (m, N) that are not closed, and the direction of motion.
    Masing { turns: Vec<(f64, f64)>, direction: f64 },
    /// Only the hysteretic force, over its limit.
    Last { part: f64, curve: TravelCurve, slope: f64, limit: f64 },
}

impl<'a> LawState<'a> {
    /// A law at rest at this displacement (m) without force and memory; `swing_m` bounds the
    /// distance between the turning points of the path.
    pub fn new(law: &'a FrictionLaw, at_m: f64, swing_m: f64) -> Self {
        let memory = if law.is_masing() {
            LawMemory::Masing { turns: Vec::new(), direction: 0.0 }
        } else {
            let (slope, limit) = law.parallel_spring();
            LawMemory::Last { part: 0.0, curve: law.curve(swing_m), slope, limit }
        };
        Self { law, at_m, force_n: 0.0, origin_m: at_m, memory }
    }

    /// Moves to this displacement (m) without reversal and returns the force there, N.
    pub fn step(&mut self, to_m: f64) -> f64 {
        let by = to_m - self.at_m;
        if by == 0.0 {
            return self.force_n;
        }
        let towards = by.signum();
        match &mut self.memory {
            LawMemory::Masing { turns, direction } => {
                if *direction == -towards {
                    turns.push((self.at_m, self.force_n));
                }
                *direction = towards;
                loop {
                    // a closed loop is forgotten with both of its turning points
                    match turns[..] {
                        [(first, _)] if (to_m - self.origin_m).abs() >= (first - self.origin_m).abs() => {
                            turns.clear();
                        }
                        [.., (before, _), _] if towards * (to_m - before) >= 0.0 => {
                            turns.truncate(turns.len() - 2);
                        }
                        _ => break,
                    }
                }
                self.force_n = match turns.last() {
                    Some((x, f)) => f + 2.0 * self.law.backbone(0.5 * (to_m - x)),
                    None => self.law.backbone(to_m - self.origin_m),
                };
            }
            LawMemory::Last { part, curve, slope, limit } => {
                // the travel in units of limit over stiffness, at the slope of zero force
                let travel = by.abs() * self.law.values[0] / self.law.values[1];
                *part = towards * curve.after(towards * *part, travel);
                self.force_n = *slope * (to_m - self.origin_m) + *limit * *part;
            }
        }
        self.at_m = to_m;
        self.force_n
    }
}

/// Smallest and largest value.
pub(super) fn ends(x: &[f64]) -> (f64, f64) {
    x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)))
}

/// The points of a closed path at which its direction changes.
fn turning_points(cycle: &[f64]) -> Vec<f64> {
    let mut turns: Vec<f64> = Vec::new();
    let mut direction = 0.0;
    let mut last = cycle[0];
    for &x in cycle.iter().skip(1).chain(cycle.first()) {
        let by = x - last;
        if by != 0.0 {
            if direction == -by.signum() {
                turns.push(last);
            }
            direction = by.signum();
            last = x;
        }
    }
    turns
}
