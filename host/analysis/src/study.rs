//! Studies of several campaigns: how a quantity depends on a covariate, and how much it varies
//! between reassemblies and within one.
//!
//! Model: y_i = level + f(x_i) + b_g(i) + w_i + m_i. f is a line or a smooth curve, zero at x̄.
//! m_i is the campaign's own error, whose variance is known, w_i the variation within a reassembly
//! and b_g that between reassemblies, all normally distributed and independent. An error that all
//! campaigns share (the same spots, the same calibration) moves the level only.
//!
//! The curve is a natural cubic spline with four knots, evenly over the ranks of the covariate's
//! values: a line, and two functions that bend (Hastie, Tibshirani, Friedman 2009, section 5.2.1).
//!
//! The two unknown variances are estimated by REML. Intervals come from generalised pivotal
//! quantities (Hannig, Iyer, Patterson 2006), which hold for few groups too: the weighted sum of
//! squares within the groups, and the remainder of the whole weighted sum of squares, are
//! distributed as χ² whatever the variances are; solving both for the variances with drawn values
//! of χ² gives their distribution, and with it that of level and slope.

use crate::contact::Interval;
use crate::student::{NORMAL_95, student_95};
use nalgebra::{SMatrix, SVector};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_distr::{ChiSquared, Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Draws of the pivotal quantities.
const DRAWS: usize = 4000;

/// Seed of the draws, so that the same campaigns give the same interval.
const SEED: u64 = 1;

/// Largest number of reassemblies that is proposed.
const MOST_GROUPS: usize = 1000;

/// Knots of the curve, and coefficients of the model: level, slope, and two of functions that bend.
const KNOTS: usize = 4;

/// Fewest different values of the covariate for a curve: two more than it has coefficients.
const LEAST_FOR_CURVE: usize = KNOTS + 2;

/// The coefficients of level, slope and curve; those that a model lacks are zero.
type Coefficients = SVector<f64, KNOTS>;

/// A matrix of as many rows and columns.
type Square = SMatrix<f64, KNOTS, KNOTS>;

/// How the quantity may depend on the covariate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dependence {
    /// A straight line.
    Line,
    /// A smooth curve.
    Curve,
}

/// One campaign of a study.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// The quantity; its logarithm for relative variances and power laws.
    pub value: f64,
    /// Variance of its own error, in the squared unit of the value; errors that all campaigns share
    /// are not part of it.
    pub variance: f64,
    /// The covariate, or its logarithm.
    pub covariate: f64,
    /// Its reassembly; campaigns of one reassembly have the same number.
    pub group: usize,
}

/// Why there is no trend.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// Too few campaigns.
    #[error("{campaigns} campaigns: a level needs at least {least}; add campaigns")]
    TooFew {
        /// Number of campaigns.
        campaigns: usize,
        /// Fewest that are needed.
        least: usize,
    },
    /// Too few different values of the covariate for a curve.
    #[error(
        "a curve needs {LEAST_FOR_CURVE} different values of the covariate (with one value in each reassembly, as many reassemblies), and there are {values}; fit a line, or add campaigns"
    )]
    TooFewForCurve {
        /// Number of values.
        values: usize,
    },
    /// A value, a covariate or a variance is NaN or infinite, or a variance is negative.
    #[error(
        "campaign {campaign} (counted from 0): value, covariate and variance must be finite, and the variance not negative"
    )]
    NotFinite {
        /// Index of the campaign.
        campaign: usize,
    },
}

/// The dependence of a quantity on a covariate.
#[derive(Debug, Clone, PartialEq)]
pub struct Trend {
    /// The value at [`Trend::at`]; its interval includes the shared error.
    pub level: Interval,
    /// Mean of the covariate.
    pub at: f64,
    /// Change of the value per unit of the covariate; none if all covariates are equal, if too few
    /// campaigns differ in it, or for a curve.
    pub slope: Option<Interval>,
    /// Whether a curve bends, or else could be a line; none for a line, and if rounding hides it.
    pub bends: Option<bool>,
    /// Standard deviation between reassemblies; none if there is only one.
    pub between: Option<Interval>,
    /// Standard deviation between campaigns of one reassembly, beyond their own errors; none if no
    /// reassembly has two campaigns: then it is part of `between`.
    pub within: Option<Interval>,
    /// Number of campaigns.
    pub campaigns: usize,
    /// Number of reassemblies.
    pub groups: usize,
    /// The columns of the model.
    model: Model,
    /// The estimated coefficients.
    estimate: Coefficients,
    /// The coefficients of each draw.
    drawn: Vec<Coefficients>,
    /// Standard deviation of the shared error.
    shared_std: f64,
    /// Mean of the campaigns' own variances.
    own_variance: f64,
}

/// The functions of the covariate that the model adds up: constant, line, and the bending ones.
#[derive(Debug, Clone, PartialEq)]
struct Model {
    /// Mean of the covariate, at which all but the constant are zero.
    at: f64,
    /// Number of functions: 1, 2 or [`KNOTS`].
    columns: usize,
    /// The curve's knots; empty without a curve.
    knots: Vec<f64>,
}

impl Model {
    /// The functions' values; zero for those that the model lacks.
    fn row(&self, covariate: f64) -> Coefficients {
        let mut row = Coefficients::zeros();
        row[0] = 1.0;
        if self.columns > 1 {
            row[1] = covariate - self.at;
        }
        if let [first, .., before_last, last] = self.knots[..] {
            // cubic between the knots, straight beyond them; the knots' distance as the unit
            let scaled = |x: f64| (x - first) / (last - first);
            let above = |x: f64, knot: f64| (scaled(x) - scaled(knot)).max(0.0).powi(3);
            let d = |x: f64, knot: f64| (above(x, knot) - above(x, last)) / (1.0 - scaled(knot));
            for (place, knot) in self.knots[..KNOTS - 2].iter().enumerate() {
                let bent = |x: f64| d(x, *knot) - d(x, before_last);
                row[2 + place] = bent(covariate) - bent(self.at);
            }
        }
        row
    }
}

/// Observations sorted by group, with the groups' ranges.
struct Grouped {
    all: Vec<Observation>,
    /// The model's functions at each observation.
    rows: Vec<Coefficients>,
    ends: Vec<usize>,
    model: Model,
    /// The functions that vary within groups, as linearly independent ones.
    vary_within: Vec<usize>,
}

/// The variances between groups and within.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Variances {
    between: f64,
    within: f64,
}

/// Generalised least squares for given variances.
struct Solved {
    estimate: Coefficients,
    /// R, where R Rᵀ is their covariance.
    root: Square,
    /// yᵀ P y: the weighted sum of squares of the residuals.
    squares: f64,
    /// ln |V| + ln |Xᵀ V⁻¹ X|.
    log_determinants: f64,
}

impl Grouped {
    fn new(observations: &[Observation], dependence: Dependence) -> Result<Self, StudyError> {
        let mut all = observations.to_vec();
        all.sort_by_key(|one| one.group);
        let n = all.len();
        let ends: Vec<usize> = (1..=n).filter(|i| *i == n || all[*i].group != all[i - 1].group).collect();
        let at = all.iter().map(|one| one.covariate).sum::<f64>() / n as f64;
        let size = all.iter().map(|one| one.covariate.abs()).fold(0.0, f64::max);
        // rounding of the mean
        let differ = |a: f64, b: f64| (a - b).abs() > 1e-12 * size;
        let starts = || std::iter::once(0).chain(ends.iter().copied());
        let inside = starts().zip(&ends).any(|(start, end)| {
            all[start..*end].iter().any(|one| differ(one.covariate, all[start].covariate))
        });
        let mut values: Vec<f64> = all.iter().map(|one| one.covariate).collect();
        values.sort_by(f64::total_cmp);
        values.dedup_by(|a, b| !differ(*a, *b));
        // with two campaigns, or two groups without a difference inside, a line fits exactly
        let levels = if inside { n } else { ends.len() };
        let mut model = Model { at, columns: 1, knots: Vec::new() };
        if dependence == Dependence::Curve {
            let values_known = values.len().min(levels);
            if values_known < LEAST_FOR_CURVE {
                return Err(StudyError::TooFewForCurve { values: values_known });
            }
            model.columns = KNOTS;
            model.knots = (0..KNOTS).map(|knot| values[knot * (values.len() - 1) / (KNOTS - 1)]).collect();
        } else if values.len() > 1 && levels > 2 {
            model.columns = 2;
        }
        let rows = all.iter().map(|one| model.row(one.covariate)).collect();
        let mut found = Self { all, rows, ends, model, vary_within: Vec::new() };
        found.vary_within = found.varying_within();
        Ok(found)
    }

    /// Each group's observations with their rows.
    fn groups(&self) -> impl Iterator<Item = impl Iterator<Item = (&Observation, &Coefficients)> + Clone> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, end)| self.all[start..*end].iter().zip(&self.rows[start..*end]))
    }

    /// The functions that differ within groups and are no sums of others that do, by
    /// orthogonalising their deviations from the groups' means.
    fn varying_within(&self) -> Vec<usize> {
        let mut orthogonal: Vec<Vec<f64>> = Vec::new();
        let mut found = Vec::new();
        for place in 1..self.model.columns {
            let mut column = Vec::new();
            for group in self.groups() {
                let count = group.clone().count() as f64;
                let mean = group.clone().map(|(_, row)| row[place]).sum::<f64>() / count;
                column.extend(group.map(|(_, row)| row[place] - mean));
            }
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let whole = self.rows.iter().map(|row| row[place] * row[place]).sum::<f64>();
            for other in &orthogonal {
                let part = dot(&column, other) / dot(other, other);
                column.iter_mut().zip(other).for_each(|(value, other)| *value -= part * other);
            }
            // far above rounding, far below what a study of a few campaigns could see
            if dot(&column, &column) > 1e-8 * whole {
                orthogonal.push(column);
                found.push(place);
            }
        }
        found
    }

    /// Degrees of freedom within the groups, and of the remainder.
    fn freedoms(&self) -> [usize; 2] {
        let (n, groups) = (self.all.len(), self.ends.len());
        let within = (n - groups).saturating_sub(self.vary_within.len());
        [within, (n - within).saturating_sub(self.model.columns)]
    }

    /// Sums over the groups for given variances: information, right side, weighted sum of squares
    /// of the values, and the logarithm of |V|. Without `of_means`, those of the deviations from
    /// the groups' weighted means only.
    fn sums(&self, variances: Variances, of_means: bool) -> Sums {
        let (mut sums, columns) = (Sums::default(), self.model.columns);
        for group in self.groups() {
            let weight = |one: &Observation| (one.variance + variances.within).recip();
            let (mut w1, mut x, mut y) = (0.0, Coefficients::zeros(), 0.0);
            for (one, row) in group.clone() {
                let w = weight(one);
                w1 += w;
                x += w * row;
                y += w * one.value;
                sums.log -= w.ln();
            }
            (x, y) = (x / w1, y / w1);
            // V⁻¹ of a diagonal matrix plus a constant (Sherman and Morrison), as deviations from
            // the weighted mean and the mean itself: without cancellation for any weights
            for (one, row) in group {
                sums.add(columns, weight(one), row - x, one.value - y);
            }
            if of_means {
                sums.add(columns, w1 / (1.0 + variances.between * w1), x, y);
                sums.log += (variances.between * w1).ln_1p();
            }
        }
        sums
    }

    /// The weighted sum of squares within the groups, at this variance within.
    fn squares_within(&self, within: f64) -> f64 {
        let sums = self.sums(Variances { between: 0.0, within }, false);
        sums.solve(|place| self.vary_within.contains(&place)).squares
    }

    fn solve(&self, variances: Variances) -> Solved {
        self.sums(variances, true).solve(|place| place < self.model.columns)
    }

    /// −2 ln of the restricted likelihood, but for a constant.
    fn deviance(&self, variances: Variances) -> f64 {
        let solved = self.solve(variances);
        solved.squares + solved.log_determinants
    }

    /// The variances by REML: a grid of standard deviations, refined around its best point.
    fn restricted_likelihood(&self, scale: f64) -> Variances {
        const POINTS: i32 = 8;
        let [free_within, free_between] = self.freedoms();
        let at = |free: usize, std: f64| if free == 0 { 0.0 } else { std.max(0.0) };
        let mut best = ([0.0, 0.0], f64::INFINITY);
        let mut step = 2.0 * scale / f64::from(POINTS);
        let mut centre = [scale, scale];
        let half = POINTS / 2;
        // the last step is below 1e-6 of the values' scatter
        while step > 1e-7 * scale {
            for i in -half..=half {
                for j in -half..=half {
                    let between = at(free_between, centre[0] + f64::from(i) * step);
                    let within = at(free_within, centre[1] + f64::from(j) * step);
                    let deviance =
                        self.deviance(Variances { between: between * between, within: within * within });
                    if deviance < best.1 {
                        best = ([between, within], deviance);
                    }
                }
            }
            centre = best.0;
            step /= 4.0;
        }
        let [between, within] = best.0;
        Variances { between: between * between, within: within * within }
    }
}

/// See [`Grouped::sums`].
#[derive(Default)]
struct Sums {
    information: Square,
    right: Coefficients,
    squares: f64,
    log: f64,
}

impl Sums {
    /// Adds an observation; only the lower triangle of the information is filled.
    fn add(&mut self, columns: usize, weight: f64, row: Coefficients, value: f64) {
        for i in 0..columns {
            let weighted = weight * row[i];
            for j in 0..=i {
                self.information[(i, j)] += weighted * row[j];
            }
            self.right[i] += weighted * value;
        }
        self.squares += weight * value * value;
    }

    /// Generalised least squares for the coefficients that `free` selects; the others are zero.
    fn solve(self, free: impl Fn(usize) -> bool) -> Solved {
        let (mut information, mut right) = (self.information, self.right);
        for place in (0..KNOTS).filter(|place| !free(*place)) {
            information.fill_row(place, 0.0);
            information.fill_column(place, 0.0);
            // an own equation, so that the factor exists; it adds nothing to the determinant
            information[(place, place)] = 1.0;
            right[place] = 0.0;
        }
        // L Lᵀ = information; the columns have different units
        let scale = information.diagonal().map(|d| if d > 0.0 { d.sqrt() } else { 1.0 });
        let unit = Square::from_fn(|i, j| information[(i, j)] / (scale[i] * scale[j]));
        // dependent columns are left out before, so that only rounding can make a pivot zero or
        // negative; a number that is none gives no intervals
        let factor = nalgebra::Cholesky::new_with_substitute(unit, 1e-12)
            .map_or_else(|| Square::from_element(f64::NAN), |factor| factor.l());
        let lower = Square::from_fn(|i, j| scale[i] * factor[(i, j)]);
        let explained = lower.solve_lower_triangular(&right).unwrap_or_default();
        let upper = lower.transpose();
        let estimate = upper.solve_upper_triangular(&explained).unwrap_or_default();
        let root = upper.solve_upper_triangular(&Square::identity()).unwrap_or_default();
        Solved {
            estimate,
            root,
            squares: (self.squares - explained.norm_squared()).max(0.0),
            log_determinants: self.log + 2.0 * lower.diagonal().map(f64::ln).sum(),
        }
    }
}

/// The variance at which a falling function of it takes this value; 0 if it is below it already.
/// With equal weights, the reciprocal of a weighted sum of squares is linear in the variance, so
/// that regula falsi (with the Illinois rule) on it needs a few steps only.
fn variance_at(target: f64, scale: f64, squares: impl Fn(f64) -> f64) -> f64 {
    let above = |variance: f64| target / squares(variance).max(f64::MIN_POSITIVE) - 1.0;
    let (mut low, mut high) = (0.0, scale);
    let mut at_low = above(low);
    if at_low >= 0.0 || at_low.is_nan() {
        return 0.0;
    }
    let mut at_high = above(high);
    while at_high < 0.0 {
        (low, at_low) = (high, at_high);
        high *= 4.0;
        at_high = above(high);
        if !high.is_finite() {
            return low;
        }
    }
    for _ in 0..100 {
        let middle = if at_high.is_finite() {
            (low * at_high - high * at_low) / (at_high - at_low)
        } else {
            0.5 * (low + high)
        };
        let at_middle = above(middle);
        if at_middle.abs() < 1e-9 || high - low < 1e-12 * high {
            return middle;
        }
        if at_middle < 0.0 {
            (low, at_low) = (middle, at_middle);
            at_high *= 0.5;
        } else {
            (high, at_high) = (middle, at_middle);
            at_low *= 0.5;
        }
    }
    0.5 * (low + high)
}

/// Values of this distribution in random order, evenly over it: the medians of equal parts of many
/// sorted draws. The ends of intervals then scatter less than with as many independent draws.
fn stratified(draws: usize, rng: &mut Xoshiro256PlusPlus, distribution: impl Distribution<f64>) -> Vec<f64> {
    const PART: usize = 15;
    let mut many: Vec<f64> = (0..draws * PART).map(|_| distribution.sample(rng)).collect();
    many.sort_by(f64::total_cmp);
    let mut even: Vec<f64> = many.chunks(PART).map(|part| part[PART / 2]).collect();
    even.shuffle(rng);
    even
}

/// The central 95 % of these values.
fn central(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    let at = |part: f64| values[(part * (values.len() - 1) as f64).round() as usize];
    [at(0.025), at(0.975)]
}

/// Whether the draws of some coefficients contradict that all of them are zero: the estimate's
/// distance from zero, by the draws' covariance, is larger than that of 95 % of the draws from the
/// estimate. None if the covariance has no inverse.
fn contradict_zero(
    estimate: &Coefficients,
    drawn: &[Coefficients],
    places: std::ops::Range<usize>,
) -> Option<bool> {
    let mut covariance = Square::identity();
    let of_draws = |i: usize, j: usize| {
        let products = drawn.iter().map(|d| (d[i] - estimate[i]) * (d[j] - estimate[j]));
        products.sum::<f64>() / drawn.len() as f64
    };
    // in standard deviations, because the coefficients have different units
    let std = Coefficients::from_fn(|i, _| of_draws(i, i).sqrt().max(f64::MIN_POSITIVE));
    for i in places.clone() {
        for j in places.clone() {
            covariance[(i, j)] = of_draws(i, j) / (std[i] * std[j]);
        }
    }
    let inverse = covariance.try_inverse()?;
    let distance = |of: &dyn Fn(usize) -> f64| {
        let x = Coefficients::from_fn(|i, _| if places.contains(&i) { of(i) / std[i] } else { 0.0 });
        x.dot(&(inverse * x))
    };
    let limit = distance(&|i| estimate[i]);
    let farther = drawn.iter().filter(|d| distance(&|i| d[i] - estimate[i]) >= limit).count();
    Some((farther as f64) < 0.05 * drawn.len() as f64)
}

/// Fits level, dependence and variances to these campaigns. `shared_std` is the standard deviation
/// of an error that all of them share.
///
/// # Errors
/// [`StudyError`]: too few campaigns or values for the curve, or a number that is none.
pub fn trend(
    observations: &[Observation],
    shared_std: f64,
    dependence: Dependence,
) -> Result<Trend, StudyError> {
    with_draws(observations, shared_std, dependence, DRAWS)
}

fn with_draws(
    observations: &[Observation],
    shared_std: f64,
    dependence: Dependence,
    draws: usize,
) -> Result<Trend, StudyError> {
    const LEAST: usize = 3;
    if observations.len() < LEAST {
        return Err(StudyError::TooFew { campaigns: observations.len(), least: LEAST });
    }
    let sound = |one: &Observation| {
        [one.value, one.covariate, one.variance].iter().all(|v| v.is_finite()) && one.variance >= 0.0
    };
    if let Some(campaign) = observations.iter().position(|one| !sound(one)) {
        return Err(StudyError::NotFinite { campaign });
    }
    let mut study = Grouped::new(observations, dependence)?;
    let n = study.all.len() as f64;
    let mean = study.all.iter().map(|one| one.value).sum::<f64>() / n;
    let scatter = study.all.iter().map(|one| (one.value - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let own_variance = study.all.iter().map(|one| one.variance).sum::<f64>() / n;
    // without any scatter all weights would be infinite; this changes no digit that is shown
    let least = 1e-18 * (mean * mean + scatter + own_variance).max(f64::MIN_POSITIVE);
    study.all.iter_mut().for_each(|one| one.variance += least);
    let scale = scatter + own_variance + least;
    let [free_within, free_between] = study.freedoms();
    let best = study.restricted_likelihood(scale.sqrt());
    let estimate = study.solve(best).estimate;
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let [of_within, of_between] =
        [free_within, free_between].map(|free| match ChiSquared::new(free as f64) {
            Ok(chi) => stratified(draws, &mut rng, chi),
            // no degrees of freedom: the variance is not drawn either
            Err(_) => vec![0.0; draws],
        });
    let [constant, line, shared, bent @ ..]: [Vec<f64>; KNOTS + 1] =
        std::array::from_fn(|_| stratified(draws, &mut rng, StandardNormal));
    let normal = [[constant, line], bent].concat();
    let (mut drawn, mut between, mut within) = (Vec::new(), Vec::new(), Vec::new());
    for draw in 0..draws {
        let variance_within = if free_within == 0 {
            0.0
        } else {
            variance_at(of_within[draw], scale, |within| study.squares_within(within))
        };
        let inside = study.squares_within(variance_within);
        let variance_between = if free_between == 0 {
            0.0
        } else {
            variance_at(of_between[draw], scale, |between| {
                study.solve(Variances { between, within: variance_within }).squares - inside
            })
        };
        let solved = study.solve(Variances { between: variance_between, within: variance_within });
        let z = Coefficients::from_fn(|place, _| normal[place][draw]);
        let mut coefficients = solved.estimate + solved.root * z;
        coefficients[0] += shared_std * shared[draw];
        for place in study.model.columns..KNOTS {
            coefficients[place] = 0.0;
        }
        drawn.push(coefficients);
        between.push(variance_between.sqrt());
        within.push(variance_within.sqrt());
    }
    let of = |place: usize| Interval {
        mean: estimate[place],
        ci95: central(drawn.iter().map(|both| both[place]).collect()),
    };
    let scatter = |variance: f64, values: Vec<f64>, free: usize| {
        (free > 0).then(|| Interval { mean: variance.sqrt(), ci95: central(values) })
    };
    Ok(Trend {
        level: of(0),
        at: study.model.at,
        slope: (study.model.columns == 2).then(|| of(1)),
        bends: if study.model.columns == KNOTS { contradict_zero(&estimate, &drawn, 2..KNOTS) } else { None },
        between: scatter(best.between, between, free_between),
        within: scatter(best.within, within, free_within),
        campaigns: study.all.len(),
        groups: study.ends.len(),
        model: study.model,
        estimate,
        drawn,
        shared_std,
        own_variance,
    })
}

impl Trend {
    /// The line or curve at this covariate, with its 95 % interval.
    pub fn line(&self, covariate: f64) -> Interval {
        self.combined(&self.model.row(covariate))
    }

    /// How much more the line or curve is at the second covariate than at the first; none if there
    /// is only a level.
    pub fn change(&self, from: f64, to: f64) -> Option<Interval> {
        (self.model.columns > 1).then(|| self.combined(&(self.model.row(to) - self.model.row(from))))
    }

    fn combined(&self, row: &Coefficients) -> Interval {
        Interval {
            mean: row.dot(&self.estimate),
            ci95: central(self.drawn.iter().map(|coefficients| row.dot(coefficients)).collect()),
        }
    }

    /// Whether the value depends on the covariate: whether zero is outside the slope's interval, or
    /// outside the joint region of a curve's coefficients.
    pub fn found(&self) -> Option<bool> {
        match self.slope {
            Some(slope) => Some(slope.ci95[0] > 0.0 || slope.ci95[1] < 0.0),
            None if self.model.columns == KNOTS => contradict_zero(&self.estimate, &self.drawn, 1..KNOTS),
            None => None,
        }
    }

    /// Fewest reassemblies, of `each` campaigns, after which the level's 95 % interval is expected
    /// to be within ± `half_width`; `None` if the shared error alone is larger, or if more than a
    /// thousand would be needed.
    pub fn reassemblies_for(&self, half_width: f64, each: usize) -> Option<usize> {
        let variance = |scatter: Option<Interval>| scatter.map_or(0.0, |s| s.mean * s.mean);
        let own = (variance(self.within) + self.own_variance) / each.max(1) as f64;
        let of_one = variance(self.between) + own;
        (2..=MOST_GROUPS).find(|groups| {
            let of_mean = student_95(*groups - 1).powi(2) * of_one / *groups as f64;
            (of_mean + (NORMAL_95 * self.shared_std).powi(2)).sqrt() <= half_width
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drawn study: groups of `each` campaigns, own errors of unequal size.
    struct Drawn {
        groups: usize,
        each: usize,
        between: f64,
        within: f64,
        own: [f64; 2],
        slope: f64,
        shared: f64,
    }

    impl Drawn {
        fn observations(&self, seed: u64) -> Vec<Observation> {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
            let shared = self.shared * normal();
            let n = self.groups * self.each;
            let mut all = Vec::new();
            for group in 0..self.groups {
                let b = self.between * normal();
                for one in 0..self.each {
                    let i = group * self.each + one;
                    let covariate = i as f64 / (n - 1) as f64;
                    let own = self.own[i % 2];
                    let value = 5.0
                        + shared
                        + self.slope * (covariate - 0.5)
                        + b
                        + self.within * normal()
                        + own * normal();
                    all.push(Observation { value, variance: own * own, covariate, group });
                }
            }
            all
        }
    }

    fn covers(interval: Interval, truth: f64) -> bool {
        (interval.ci95[0]..=interval.ci95[1]).contains(&truth)
    }

    /// Draws in the tests that count coverage.
    const FEWER: usize = 400;

    /// How many of 200 intervals with 95 % cover by chance, in 99.9 % of such tests: 190 ± 10.
    const COVERING: std::ops::RangeInclusive<usize> = 180..=199;

    const KINDS: [Drawn; 3] = [
        Drawn {
            groups: 8,
            each: 4,
            between: 0.03,
            within: 0.01,
            own: [0.005, 0.01],
            slope: 0.05,
            shared: 0.0,
        },
        Drawn {
            groups: 12,
            each: 3,
            between: 0.01,
            within: 0.02,
            own: [0.01, 0.03],
            slope: 0.0,
            shared: 0.02,
        },
        Drawn {
            groups: 5,
            each: 6,
            between: 0.02,
            within: 0.02,
            own: [0.0, 0.0],
            slope: -0.03,
            shared: 0.01,
        },
    ];

    /// How often the intervals of level, slope, between and within cover the truth.
    fn covered(kind: &Drawn, seeds: std::ops::Range<u64>) -> [usize; 4] {
        let mut covered = [0; 4];
        for seed in seeds {
            let found = with_draws(&kind.observations(seed), kind.shared, Dependence::Line, FEWER)
                .expect("enough campaigns");
            let intervals = [
                (found.level, 5.0),
                (found.slope.expect("covariates differ"), kind.slope),
                (found.between.expect("several groups"), kind.between),
                (found.within.expect("several campaigns each"), kind.within),
            ];
            for (count, (interval, truth)) in covered.iter_mut().zip(intervals) {
                *count += usize::from(covers(interval, truth));
            }
        }
        covered
    }

    #[test]
    fn intervals_of_both_scatters_of_level_and_slope_cover_as_stated() {
        for (which, kind) in KINDS.iter().enumerate() {
            let covered = covered(kind, 0..200);
            assert!(covered.iter().all(|count| COVERING.contains(count)), "kind {which}: {covered:?}");
        }
    }

    #[test]
    #[ignore = "prints how often the intervals of 2000 studies of each kind cover; minutes"]
    fn coverage_table() {
        println!("| study | level | slope | between | within |");
        for (which, kind) in KINDS.iter().enumerate() {
            let percent = covered(kind, 10_000..12_000).map(|count| format!("{:.1}", count as f64 / 20.0));
            println!("| {which} | {} |", percent.join(" | "));
        }
    }

    /// 20 campaigns over which the contact changes by 5 %, with a scatter of 1 % and own errors of 1
    /// and 1.5 %; and the same without a change.
    #[test]
    fn a_drift_is_found_and_none_is_invented() {
        let kind = |slope| Drawn {
            groups: 20,
            each: 1,
            between: 0.01,
            within: 0.0,
            own: [0.01, 0.015],
            slope,
            shared: 0.03,
        };
        let found = |slope: f64| {
            let of = |seed| {
                with_draws(&kind(slope).observations(seed), 0.03, Dependence::Line, FEWER)
                    .expect("enough campaigns")
                    .found()
            };
            (0..200).filter(|seed| of(5000 + seed) == Some(true)).count()
        };
        let (hits, alarms) = (found(0.05), found(0.0));
        assert!(hits > 180, "{hits}");
        // 5 % of 200, plus what chance adds in 99.9 % of such tests
        assert!(alarms <= 20, "{alarms}");
    }

    /// Without own errors, a balanced study has REML estimates in closed form: the mean squares.
    #[test]
    fn restricted_likelihood_is_the_analysis_of_variance_of_a_balanced_study() {
        let kind = Drawn {
            groups: 7,
            each: 5,
            between: 0.05,
            within: 0.01,
            own: [0.0, 0.0],
            slope: 0.0,
            shared: 0.0,
        };
        for seed in 0..20 {
            let mut all = kind.observations(seed);
            for one in &mut all {
                one.covariate = 1.0;
            }
            let found = trend(&all, 0.0, Dependence::Line).expect("enough campaigns");
            let means: Vec<f64> =
                all.chunks(5).map(|group| group.iter().map(|one| one.value).sum::<f64>() / 5.0).collect();
            let squares = |values: &[f64]| {
                let mean = values.iter().sum::<f64>() / values.len() as f64;
                values.iter().map(|v| (v - mean).powi(2)).sum::<f64>()
            };
            let within: f64 = all
                .chunks(5)
                .map(|group| squares(&group.iter().map(|one| one.value).collect::<Vec<_>>()))
                .sum::<f64>()
                / 28.0;
            let between = squares(&means) / 6.0 - within / 5.0;
            assert!(found.slope.is_none() && between > 0.0);
            // the grid's last step
            let near = |found: Option<Interval>, variance: f64| {
                (found.expect("identified").mean / variance.sqrt() - 1.0).abs() < 1e-4
            };
            assert!(near(found.between, between) && near(found.within, within), "seed {seed}: {found:?}");
        }
    }

    /// Without groups and own errors, the interval of the slope is that of the ordinary regression.
    #[test]
    fn a_plain_series_gives_the_ordinary_regressions_interval() {
        let kind = Drawn {
            groups: 15,
            each: 1,
            between: 0.02,
            within: 0.0,
            own: [0.0, 0.0],
            slope: 0.1,
            shared: 0.0,
        };
        let all = kind.observations(3);
        let found = trend(&all, 0.0, Dependence::Line).expect("enough campaigns");
        let xx: f64 = all.iter().map(|one| (one.covariate - 0.5).powi(2)).sum();
        let mean = all.iter().map(|one| one.value).sum::<f64>() / 15.0;
        let slope = all.iter().map(|one| (one.covariate - 0.5) * one.value).sum::<f64>() / xx;
        let residual: f64 =
            all.iter().map(|one| (one.value - mean - slope * (one.covariate - 0.5)).powi(2)).sum();
        let half = student_95(13) * (residual / 13.0 / xx).sqrt();
        let own = found.slope.expect("covariates differ");
        assert!((own.mean / slope - 1.0).abs() < 1e-6, "{own:?} {slope}");
        // the ends are quantiles of 4000 draws
        let ratio = 0.5 * (own.ci95[1] - own.ci95[0]) / half;
        assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
        assert!(found.within.is_none(), "one campaign per reassembly says nothing about it");
    }

    /// A curve that is a line in truth: its joint test of the bend is wrong in 5 % of the studies,
    /// and that of the dependence for a quantity that does not depend on the covariate. The band
    /// covers the line, and for a truth that bends it covers that too.
    #[test]
    fn a_curve_covers_and_finds_bends_as_stated() {
        let kind = Drawn {
            groups: 8,
            each: 3,
            between: 0.01,
            within: 0.01,
            own: [0.005, 0.01],
            slope: 0.05,
            shared: 0.0,
        };
        let (mut alarms, mut seen, mut invented, mut covered) = (0, 0, 0, [0; 2]);
        // the spline follows it to a few per cent of its height, far below the band
        let hump = |x: f64| 0.1 * (std::f64::consts::PI * x).sin();
        for seed in 0..200 {
            let straight = kind.observations(7000 + seed);
            let (mut bent, mut level) = (straight.clone(), straight.clone());
            for one in &mut level {
                one.value -= 0.05 * (one.covariate - 0.5);
            }
            for one in &mut bent {
                one.value += hump(one.covariate);
            }
            let [level, line, curve] = [level, straight, bent]
                .map(|all| with_draws(&all, 0.0, Dependence::Curve, FEWER).expect("enough campaigns"));
            alarms += usize::from(line.bends == Some(true));
            seen += usize::from(curve.bends == Some(true));
            invented += usize::from(level.found() == Some(true));
            let x = 0.4;
            covered[0] += usize::from(covers(line.line(x), 5.0 + 0.05 * (x - 0.5)));
            covered[1] += usize::from(covers(curve.line(x), 5.0 + 0.05 * (x - 0.5) + hump(x)));
            assert_eq!(line.slope, None);
        }
        assert!(covered.iter().all(|count| COVERING.contains(count)), "{covered:?}");
        // 5 % of 200, plus what chance adds in 99.9 % of such tests
        assert!(alarms <= 20 && invented <= 20, "{alarms} {invented}");
        assert!(seen > 180, "{seen}");
    }

    /// Values without scatter: a natural spline with the same knots, and a line, are met exactly.
    /// Beyond the last knot the curve is straight.
    #[test]
    fn a_curve_is_the_natural_spline_and_straight_beyond_its_knots() {
        let of = |f: &dyn Fn(f64) -> f64| -> Trend {
            let one = |i: u8| Observation {
                value: f(f64::from(i)),
                variance: 1e-6,
                covariate: f64::from(i),
                group: usize::from(i),
            };
            trend(&(0..10).map(one).collect::<Vec<_>>(), 0.0, Dependence::Curve).expect("enough campaigns")
        };
        // knots 0, 3, 6, 9; cubic pieces whose second derivative is 0 at both ends
        let cube = |x: f64| x.max(0.0).powi(3);
        let spline = |x: f64| 1.0 + cube(x) - 3.0 * cube(x - 3.0) + 3.0 * cube(x - 6.0) - cube(x - 9.0);
        let found = of(&spline);
        for x in [-2.0, 0.5, 4.2, 8.9, 12.0] {
            let (own, truth) = (found.line(x).mean, spline(x));
            assert!((own - truth).abs() < 1e-6 * truth.abs().max(1.0), "{x}: {own} {truth}");
        }
        let line = of(&|x| 2.0 - 0.3 * x);
        assert!((line.line(20.0).mean + 4.0).abs() < 1e-6 && line.bends == Some(false));
        let change = line.change(0.0, 9.0).expect("a curve").mean;
        assert!((change + 2.7).abs() < 1e-6, "{change}");
    }

    #[test]
    fn a_curve_needs_six_values() {
        let one = |x: u8, group| Observation { value: 1.0, variance: 1.0, covariate: f64::from(x), group };
        let few: Vec<_> = (0..12).map(|i| one(i % 5, usize::from(i))).collect();
        assert_eq!(trend(&few, 0.0, Dependence::Curve), Err(StudyError::TooFewForCurve { values: 5 }));
        // with one value in each reassembly, it is the reassemblies that count
        let grouped: Vec<_> = (0..15).map(|i| one(i / 3, usize::from(i / 3))).collect();
        assert_eq!(trend(&grouped, 0.0, Dependence::Curve), Err(StudyError::TooFewForCurve { values: 5 }));
        let enough: Vec<_> = (0..12).map(|i| one(i % 6, usize::from(i))).collect();
        assert!(trend(&enough, 0.0, Dependence::Curve).is_ok());
    }

    #[test]
    fn what_all_share_widens_the_level_only_and_no_number_of_reassemblies_removes_it() {
        let kind = Drawn {
            groups: 10,
            each: 3,
            between: 0.02,
            within: 0.01,
            own: [0.01, 0.01],
            slope: 0.0,
            shared: 0.0,
        };
        let all = kind.observations(8);
        let [alone, sharing] =
            [0.0, 0.05].map(|std| trend(&all, std, Dependence::Line).expect("enough campaigns"));
        let width = |of: Interval| of.ci95[1] - of.ci95[0];
        assert_eq!(alone.slope.expect("differ").ci95, sharing.slope.expect("differ").ci95);
        assert!(width(sharing.level) > 1.9 * 1.96 * 0.05 && width(sharing.level) > 3.0 * width(alone.level));
        assert_eq!(sharing.reassemblies_for(0.05, 1), None);
        let needed = alone.reassemblies_for(0.03, 1).expect("within a thousand");
        let more = alone.reassemblies_for(0.015, 1).expect("within a thousand");
        assert!(needed >= 2 && more > needed, "{needed} {more}");
        // the number stated is the smallest one
        let half = |groups: usize| {
            let square = |of: Option<Interval>| of.map_or(0.0, |s| s.mean * s.mean);
            let one = square(alone.between) + square(alone.within) + 1e-4;
            student_95(groups - 1) * (one / groups as f64).sqrt()
        };
        assert!(half(needed) <= 0.03 && (needed == 2 || half(needed - 1) > 0.03), "{needed}");
    }

    #[test]
    fn equal_values_have_no_scatter_and_few_or_broken_ones_are_refused() {
        let one = |value, covariate, group| Observation { value, variance: 0.0, covariate, group };
        let same: Vec<_> = (0..6).map(|i| one(2.0, f64::from(i), i as usize / 2)).collect();
        let found = trend(&same, 0.0, Dependence::Line).expect("enough campaigns");
        assert!((found.level.mean - 2.0).abs() < 1e-9 && found.slope.expect("differ").mean.abs() < 1e-9);
        assert!(found.between.expect("three groups").mean < 1e-6);
        assert_eq!(
            trend(&same[..2], 0.0, Dependence::Line),
            Err(StudyError::TooFew { campaigns: 2, least: 3 })
        );
        let mut broken = same.clone();
        broken[4].variance = -1.0;
        assert_eq!(trend(&broken, 0.0, Dependence::Line), Err(StudyError::NotFinite { campaign: 4 }));
        broken[4].variance = f64::NAN;
        assert_eq!(trend(&broken, 0.0, Dependence::Line), Err(StudyError::NotFinite { campaign: 4 }));
    }
}
