//! Linear propagation: the effect of an error of one cell, one position or one angle on the joint's
//! compliance.
//!
//! δ(Y⁻¹) = −Y⁻¹ δY Y⁻¹, so the sensitivity of y = 1/Z^J_dd to the cells is a sum of two dyads, Φ =
//! −y²/2 Σ (T_uᵀ u)(T_f v)ᵀ with u a row and v a column of Y⁻¹. A sensor misplaced by δ measures
//! e·(θ × δ) more, where θ is the rotation of its virtual point; a hit misplaced by δ adds the
//! moment δ × e; a hammer tilted by α pushes along e + α × e. All three are errors of cells, so one
//! Φ covers them all.

use super::assembly::Assembly;
use super::assembly::Axes;
use super::{Line, Priors, compliance};
use crate::C;
use crate::substructuring::product::product;
use nalgebra::Vector3;

/// Weighted sums over lines: the sensitivities to errors common to all lines, and the variance of
/// the noise.
#[derive(Clone)]
pub(super) struct SensitivitySums {
    pub(super) noise_variance: f64,
    channel_position: Vec<Vector3<C>>,
    impact_position: Vec<Vector3<C>>,
    impact_angle: Vec<Vector3<C>>,
    /// Per sensor and impact.
    channel_aim: Vec<Vector3<C>>,
    impact_aim: Vec<Vector3<C>>,
}

impl SensitivitySums {
    /// Σ w · line, in the lines' order; variances with w².
    pub(super) fn weighted(
        lines: &[SensitivitySums],
        weights: impl IntoIterator<Item = f64>,
    ) -> SensitivitySums {
        let mut total = lines[0].clone();
        total.noise_variance = 0.0;
        total.parts_mut().into_iter().flatten().for_each(|v| *v = Vector3::zeros());
        for (line, w) in lines.iter().zip(weights) {
            total.noise_variance += w * w * line.noise_variance;
            for (sum, part) in total.parts_mut().into_iter().zip(line.parts()) {
                sum.iter_mut().zip(part).for_each(|(a, b)| *a += *b * C::from(w));
            }
        }
        total
    }

    fn parts(&self) -> [&Vec<Vector3<C>>; 5] {
        [
            &self.channel_position,
            &self.impact_position,
            &self.channel_aim,
            &self.impact_aim,
            &self.impact_angle,
        ]
    }

    fn parts_mut(&mut self) -> [&mut Vec<Vector3<C>>; 5] {
        [
            &mut self.channel_position,
            &mut self.impact_position,
            &mut self.channel_aim,
            &mut self.impact_aim,
            &mut self.impact_angle,
        ]
    }

    /// Variance of the real part due to errors of position, aim and angle: the square of each
    /// sensitivity times the standard deviation of its prior.
    pub(super) fn geometry_variance(&self, priors: &Priors) -> f64 {
        let Priors { position_m, aim_m, hammer_angle_rad } = *priors;
        let deviations = [position_m, position_m, aim_m, aim_m, hammer_angle_rad];
        let sensitivities = self.parts().into_iter().zip(deviations);
        sensitivities
            .flat_map(|(all, deviation)| all.iter().flatten().map(move |c| (c.re * deviation).powi(2)))
            .sum()
    }
}

impl Assembly {
    /// Sensitivities of the joint's compliance along every degree of freedom at line `l`, whose
    /// inverse admittance is `z`.
    pub(super) fn sums(&self, l: usize, z: &Line) -> Vec<SensitivitySums> {
        let layout = &self.layout;
        let n = z.nrows() / 2;
        let cells = &self.cells[l];
        let impacts = layout.impacts.len();
        let zeros = |count| vec![Vector3::zeros(); count];
        let none = SensitivitySums {
            noise_variance: 0.0,
            channel_position: zeros(layout.points),
            impact_position: zeros(impacts),
            impact_angle: zeros(impacts),
            channel_aim: zeros(layout.points * impacts),
            impact_aim: zeros(layout.points * impacts),
        };
        let mut sums = vec![none; n];
        // u and v of every degree of freedom, transformed to the cells
        let (to_channels, to_impacts) =
            (product(&layout.t_u.transpose(), &z.transpose()), product(&layout.t_f, z));
        let scales: Vec<C> = (0..n).map(|d| -compliance(z, d).powi(2) * 0.5).collect();
        let phi = |d: usize, o: usize, i: usize| {
            let dyads =
                to_channels[(o, d)] * to_impacts[(i, n + d)] + to_channels[(o, n + d)] * to_impacts[(i, d)];
            dyads * scales[d]
        };
        let (motion, wrench) = (product(&layout.t_u, cells), product(cells, &layout.t_f));
        let sides = [0, 1].map(|side| side * n);
        // rotations due to each impact at both virtual points; below, forces and moments of both
        // virtual points at each channel
        let rotations: Vec<[Vector3<C>; 2]> = (0..impacts)
            .map(|i| sides.map(|from| along(&layout.rotations, |at| motion[(from + at, i)])))
            .collect();
        for (o, channel) in layout.channels.iter().enumerate() {
            let forces = sides.map(|from| along(&layout.translations, |at| wrench[(o, from + at)]));
            let moments = sides.map(|from| along(&layout.rotations, |at| wrench[(o, from + at)]));
            for (i, impact) in layout.impacts.iter().enumerate() {
                let by_channel = cross(channel.direction, rotations[i][channel.side]);
                let (force, moment) = (forces[impact.side], moments[impact.side]);
                let by_impact = cross(impact.direction, moment);
                // δY = (force + moment × r) · δe
                let by_angle = cross(impact.direction, force - cross(impact.offset, moment));
                let cell = channel.point * impacts + i;
                let variance = self.variance.as_ref().map_or(0.0, |variance| variance[l][(o, i)]);
                for (d, sums) in sums.iter_mut().enumerate() {
                    let factor = phi(d, o, i);
                    sums.noise_variance += factor.norm_sqr() * variance;
                    sums.channel_position[channel.point] += by_channel * factor;
                    sums.channel_aim[cell] += by_channel * factor;
                    sums.impact_position[i] += by_impact * factor;
                    sums.impact_aim[cell] += by_impact * factor;
                    sums.impact_angle[i] += by_angle * factor;
                }
            }
        }
        sums
    }
}

/// The three translations or rotations of a virtual point from its degrees of freedom, in metres or
/// radians; zero for those that the IDM set does not contain.
fn along(axes: &Axes, of: impl Fn(usize) -> C) -> Vector3<C> {
    Vector3::from(axes.map(|axis| axis.map_or(C::default(), |(at, scale)| of(at) / scale)))
}

fn cross(a: Vector3<f64>, b: Vector3<C>) -> Vector3<C> {
    a.map(C::from).cross(&b)
}
