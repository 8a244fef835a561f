//! Whether A and B, coupled by the identified joint, reproduce the measured assembly within noise
//! and errors of geometry.
//!
//! FBS assumes that A and B are coupled by the joint only. If another path couples them (springs to
//! a common ground: the paper's rig above 800 Hz), or if the joint is not a spring and damper,
//! back-coupling fails. It also fails, by tens of per cent, if sensors and hits are half a
//! millimetre off. Therefore the calculation is repeated with positions, aims, angles and noise
//! drawn from their assumed distributions. The resulting change of the difference between coupled
//! and measured assembly is the part that such errors explain.

use super::averaged::Priors;
use super::geometry::{Configuration, Geometry, Point};
use super::identify::back_coupled;
use super::idm::IdmSet;
use super::joint_over_bands::median;
use crate::band::Band;
use crate::frf::Frf;
use crate::parallel::prelude::*;
use nalgebra::{Complex, Unit, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::collections::HashMap;

/// Largest number of lines evaluated: resonances are wider than their spacing.
const LINES: usize = 400;
/// Number of draws: their mean square is then known to about a quarter.
const DRAWS: u64 = 12;
/// Fixed seed, so that the same data give the same values.
const SEED: u64 = 0x6261_636b;
/// Lines within ± this many Hz are judged together by their median, so that a single resonance,
/// which errors of position shift, does not decide.
const AROUND_HZ: f64 = 75.0;
/// An error up to this many times the explained one is not significant: a dozen draws and a few
/// resonances allow no finer distinction.
pub const USUAL: f64 = 2.0;
/// An error of more than this many times the explained one has another cause.
pub const BEYOND: f64 = 6.0;
/// An error below this fraction of the assembly's admittance is negligible.
const SMALL: f64 = 0.05;

/// Error of back-coupling, and the part of it that noise and errors of geometry explain.
#[derive(Debug, Clone, PartialEq)]
pub struct Explained {
    /// Lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// ‖coupled − measured‖ / ‖measured‖ at both virtual points, median around each line.
    pub error: Vec<f64>,
    /// Root mean square change of the difference due to the drawn errors, in the same unit.
    pub explained: Vec<f64>,
}

impl Explained {
    /// Couples A and B by the mean of Eq. (A.1) over `band`, at the nominal geometry and at drawn
    /// ones. Noise is drawn only if it is known. None if the virtual points cannot be formed or no
    /// line lies in the band.
    pub fn of(
        frfs: [&Frf; 3],
        geometry: &Geometry,
        idms: IdmSet,
        band: Band,
        priors: &Priors,
    ) -> Option<Explained> {
        let [a, b, ajb] = frfs.map(thinned);
        let nominal = back_coupled([&a, &b, &ajb], geometry, idms, band)?;
        // squared change of the difference, per draw and line
        let changes: Vec<Vec<f64>> = (0..DRAWS)
            .into_par_iter()
            .map(|draw| {
                let mut stream = Xoshiro256PlusPlus::seed_from_u64(SEED + draw);
                let geometry =
                    Wrong { priors, common: HashMap::new(), stream: &mut stream }.geometry(geometry);
                let [a, b, ajb] = [&a, &b, &ajb].map(|frf| drawn(frf, &mut stream));
                let drawn = back_coupled([&a, &b, &ajb], &geometry, idms, band)?;
                let lines = drawn.difference.iter().zip(&nominal.difference);
                Some(lines.map(|(d, n)| (d - n).norm_squared()).collect())
            })
            .collect::<Option<_>>()?;
        let frequency_hz = nominal.frequency_hz.clone();
        let squares: Vec<f64> = nominal.error().iter().map(|e| e * e).collect();
        let mean: Vec<f64> = (0..squares.len())
            .map(|l| changes.iter().map(|change| change[l]).sum::<f64>() / DRAWS as f64)
            .collect();
        let [error, explained] = [squares, mean]
            .map(|squares| medians_around(&frequency_hz, &squares).iter().map(|e| e.sqrt()).collect());
        Some(Explained { frequency_hz, error, explained })
    }

    /// Whether the error at a line is at most `times` the explained one.
    fn agrees(&self, line: usize, times: f64) -> bool {
        let (e, x) = (self.error[line], self.explained[line]);
        e <= (times * x).hypot(SMALL)
    }

    /// The range around the middle of `band` in which every line's error is at most `times` the
    /// explained one, Hz; none if the middle's is not.
    pub fn range(&self, band: Band, times: f64) -> Option<[f64; 2]> {
        let middle = self.frequency_hz.partition_point(|f| *f < 0.5 * (band.low_hz + band.high_hz));
        let middle = middle.min(self.frequency_hz.len().checked_sub(1)?);
        if !self.agrees(middle, times) {
            return None;
        }
        let low = (0..middle).rev().take_while(|l| self.agrees(*l, times)).last().unwrap_or(middle);
        let high =
            (middle..self.frequency_hz.len()).take_while(|l| self.agrees(*l, times)).last().unwrap_or(middle);
        Some([self.frequency_hz[low], self.frequency_hz[high]])
    }

    /// Medians of error and explained error over a band; none if it contains no line.
    pub fn medians(&self, band: Band) -> Option<[f64; 2]> {
        let inside: Vec<usize> =
            (0..self.frequency_hz.len()).filter(|&l| band.contains(self.frequency_hz[l])).collect();
        let of = |values: &[f64]| median(&inside.iter().map(|&l| values[l]).collect::<Vec<f64>>());
        (!inside.is_empty()).then(|| [of(&self.error), of(&self.explained)])
    }
}

/// Medians over ± [`AROUND_HZ`].
fn medians_around(frequency_hz: &[f64], values: &[f64]) -> Vec<f64> {
    (frequency_hz.iter())
        .map(|f| {
            let from = frequency_hz.partition_point(|g| *g < f - AROUND_HZ);
            let to = frequency_hz.partition_point(|g| *g <= f + AROUND_HZ);
            median(&values[from..to])
        })
        .collect()
}

/// A configuration's FRFs at some of their lines, with their smooth noise.
fn thinned(frf: &Frf) -> Frf {
    let step = frf.lines().len().div_ceil(LINES).max(1);
    let lines: Vec<usize> = (0..frf.lines().len()).step_by(step).collect();
    let thin = frf.at(&lines);
    if frf.variance().is_none() {
        return thin;
    }
    let smooth = frf.smooth_variance();
    let kept = lines.iter().map(|&l| smooth[l].clone()).collect();
    thin.with_variance(kept).expect("smoothing keeps the shape")
}

/// The FRFs with drawn noise added.
fn drawn(frf: &Frf, stream: &mut Xoshiro256PlusPlus) -> Frf {
    let Some(variance) = frf.variance() else { return frf.clone() };
    frf.clone().map_lines(|line, mut y| {
        for (y, v) in y.iter_mut().zip(variance[line].iter()) {
            let part = Complex::new(normal(stream), normal(stream));
            if v.is_finite() {
                *y += part * v.max(0.0).sqrt();
            }
        }
    })
}

fn normal(stream: &mut Xoshiro256PlusPlus) -> f64 {
    StandardNormal.sample(stream)
}

/// Draws a geometry that could equally be the true one.
struct Wrong<'a> {
    priors: &'a Priors,
    /// Offset and tilt of a sensor or impact in every configuration, by its name.
    common: HashMap<String, [Vector3<f64>; 2]>,
    stream: &'a mut Xoshiro256PlusPlus,
}

impl Wrong<'_> {
    fn geometry(&mut self, nominal: &Geometry) -> Geometry {
        let mut geometry = nominal.clone();
        for points in [&mut geometry.a, &mut geometry.b, &mut geometry.ajb] {
            self.configuration(points);
        }
        geometry
    }

    fn vector(&mut self, std: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| normal(self.stream)) * std
    }

    fn common(&mut self, kind: &str, name: &str) -> [Vector3<f64>; 2] {
        let key = format!("{kind} {name}");
        if let Some(known) = self.common.get(&key) {
            return *known;
        }
        let Priors { position_m, hammer_angle_rad, .. } = *self.priors;
        let drawn = [self.vector(position_m), self.vector(hammer_angle_rad)];
        self.common.insert(key, drawn);
        drawn
    }

    fn configuration(&mut self, points: &mut Configuration) {
        let aim_m = self.priors.aim_m;
        let mut aims: HashMap<String, Vector3<f64>> = HashMap::new();
        // points on specimens are in no coupling: drawing them too would only shift the random
        // stream of the others
        let on_arms = |points: &&mut Point| !points.grouping.is_specimen();
        for channel in points.channels.iter_mut().filter(on_arms) {
            let [offset, _] = self.common("sensor", &channel.name);
            // the three axes of a sensor share one aim
            let aim = match aims.get(&channel.name) {
                Some(aim) => *aim,
                None => self.vector(aim_m),
            };
            aims.insert(channel.name.clone(), aim);
            channel.position_m = (channel.position() + offset + aim).into();
        }
        for impact in points.impacts.iter_mut().filter(on_arms) {
            let [offset, turn] = self.common("impact", &impact.name);
            let aim = self.vector(aim_m);
            impact.position_m = (impact.position() + offset + aim).into();
            impact.direction = turned(impact, turn).into();
        }
    }
}

fn turned(impact: &Point, turn: Vector3<f64>) -> Vector3<f64> {
    match Unit::try_new(turn, 0.0) {
        Some(axis) => UnitQuaternion::from_axis_angle(&axis, turn.norm()) * impact.direction(),
        None => impact.direction(),
    }
}
