//! Whether A and B, coupled by the joint found, are the measured assembly as well as noise and errors of geometry let them be.
//!
//! FBS takes A and B to be uncoupled but for the joint. Where another path couples them (springs to a common ground: the paper's
//! rig above 800 Hz) or the joint is no spring and damper, back-coupling fails; but it also fails, by tens of per cent, when sensors and hits
//! are half a millimetre off. So the same is done again with positions, aims, angles and noise drawn anew from what is assumed of
//! them: by as much as the difference between coupled and measured assembly then moves, such errors may have made it.

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

/// Lines that are looked at: resonances are wider than their distance.
const LINES: usize = 400;
/// Draws: their mean square is known to a quarter or so.
const DRAWS: u64 = 12;
/// Fixed, so that the same data give the same figures.
const SEED: u64 = 0x6261_636b;
/// Lines within ± this many Hz are judged together by their median: a single resonance, which errors of position move, decides nothing.
const AROUND_HZ: f64 = 75.0;
/// An error up to this many times what is explained is nothing: a dozen draws and a handful of resonances know no better.
pub const USUAL: f64 = 2.0;
/// An error this many times what is explained is another thing.
pub const BEYOND: f64 = 6.0;
/// An error below this part of the assembly's admittance matters to nobody.
const SMALL: f64 = 0.05;

/// Error of back-coupling, and how much of it noise and errors of geometry explain.
#[derive(Debug, Clone, PartialEq)]
pub struct Explained {
    /// Lines, Hz.
    pub frequency_hz: Vec<f64>,
    /// ‖coupled − measured‖ / ‖measured‖ at both virtual points, the median around each line.
    pub error: Vec<f64>,
    /// What drawn errors change the difference by, root mean square, in the same unit.
    pub explained: Vec<f64>,
}

impl Explained {
    /// Couples A and B by the mean of Eq. (A.1) over `band`, at the nominal geometry and at drawn ones. Noise that is not known is not
    /// drawn. None where the virtual points cannot be formed or no line lies in the band.
    pub fn of(
        frfs: [&Frf; 3],
        geometry: &Geometry,
        idms: IdmSet,
        band: Band,
        priors: &Priors,
    ) -> Option<Explained> {
        let [a, b, ajb] = frfs.map(thinned);
        let nominal = back_coupled([&a, &b, &ajb], geometry, idms, band)?;
        // per draw and line: the square of what the difference changes by
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

    /// Whether the error at a line is no larger than `times` what is explained.
    fn agrees(&self, line: usize, times: f64) -> bool {
        let (e, x) = (self.error[line], self.explained[line]);
        e <= (times * x).hypot(SMALL)
    }

    /// From where to where, around the middle of `band`, every line's error is at most `times` what is explained, Hz; none where the
    /// middle's is not.
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

    /// Medians of error and explained error over a band; none without a line in it.
    pub fn medians(&self, band: Band) -> Option<[f64; 2]> {
        let inside: Vec<usize> =
            (0..self.frequency_hz.len()).filter(|&l| band.contains(self.frequency_hz[l])).collect();
        let of = |values: &[f64]| median(&inside.iter().map(|&l| values[l]).collect::<Vec<f64>>());
        (!inside.is_empty()).then(|| [of(&self.error), of(&self.explained)])
    }
}

/// Medians within ± 75 Hz.
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

/// The FRFs with noise drawn once more.
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

/// Draws a geometry that may as well be the true one.
struct Wrong<'a> {
    priors: &'a Priors,
    /// Offset and tilt that a sensor or impact has in every configuration, by its name.
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
        // points on specimens are in no coupling: drawing them too would only shift the stream of the others
        let on_arms = |points: &&mut Point| !points.grouping.is_specimen();
        for channel in points.channels.iter_mut().filter(on_arms) {
            let [offset, _] = self.common("sensor", &channel.name);
            // the three axes of a sensor are aimed at once
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
