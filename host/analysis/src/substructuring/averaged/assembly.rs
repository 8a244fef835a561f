//! The assembly's interface cells: their positions, their receptances and noise over a band, their
//! reduction to two virtual points, and the effect of an error of one cell, one position or one
//! angle on the joint's compliance, by linear propagation.
//!
//! δ(Y⁻¹) = −Y⁻¹ δY Y⁻¹, so the sensitivity of y = 1/Z^J_dd to the cells is a sum of two dyads, Φ =
//! −y²/2 Σ (T_uᵀ u)(T_f v)ᵀ with u a row and v a column of Y⁻¹. A sensor misplaced by δ measures
//! e·(θ × δ) more, where θ is the rotation of its virtual point; a hit misplaced by δ adds the
//! moment δ × e; a hammer tilted by α pushes along e + α × e. All three are errors of cells, so one
//! Φ covers them all.

use super::{AveragedError, Line, Priors, compliance};
use crate::C;
use crate::band::Band;
use crate::frf::Frf;
use crate::structure::Structure;
use crate::substructuring::geometry::{Geometry, Grouping, Point};
use crate::substructuring::idm::{Dof, IdmSet};
use crate::substructuring::interface_data::{Found, LocatedVirtualPoint, Measured, balance};
use crate::substructuring::product::product;
use crate::substructuring::vpt::{reduce_inputs, reduce_outputs};
use nalgebra::{Complex, DMatrix, Vector3};

/// The assembly's FRFs reduced to its two virtual points, with the data needed to relate an error
/// to its cell.
pub(super) struct Assembly {
    pub(super) frequency_hz: Vec<f64>,
    pub(super) s: Vec<Complex<f64>>,
    /// Interface cells (channels of A then B × impacts on A then B), receptance, m/N.
    pub(super) cells: Vec<Line>,
    /// Variance of the cells' real parts; none where it is not known.
    pub(super) variance: Option<Vec<DMatrix<f64>>>,
    pub(super) layout: Layout,
    /// Names of the cells' rows and columns.
    pub(super) outputs: Vec<String>,
    pub(super) inputs: Vec<String>,
}

impl Assembly {
    pub(super) fn of(
        ajb: &Frf,
        geometry: &Geometry,
        idms: IdmSet,
        band: Band,
    ) -> Result<Assembly, AveragedError> {
        let in_band: Vec<usize> = (0..ajb.frequency_hz().len())
            .filter(|&l| ajb.frequency_hz()[l] > 0.0 && band.contains(ajb.frequency_hz()[l]))
            .collect();
        if in_band.is_empty() {
            return Err(AveragedError::EmptyBand { low_hz: band.low_hz, high_hz: band.high_hz });
        }
        let file = Measured { file: Structure::Ajb, frf: ajb, points: &geometry.ajb };
        let a = file.virtual_point(Grouping::InterfaceA, geometry, idms)?;
        let b = file.virtual_point(Grouping::InterfaceB, geometry, idms)?;
        let (rows, columns) = (joined(&a.rows, &b.rows), joined(&a.columns, &b.columns));
        let cut = ajb.band(band.low_hz.max(f64::MIN_POSITIVE), band.high_hz);
        let cells = Measured { frf: &cut, ..file }.block(&rows, &columns)?;
        let order = ajb.quantity().order_of_s();
        let s: Vec<Complex<f64>> = in_band.iter().map(|&l| ajb.s(l)).collect();
        let cells = cells.iter().zip(&s).map(|(y, s)| y * s.powi(-order)).collect();
        let variance = ajb
            .receptance_variance(&in_band, &rows.at, &columns.at)
            // if the variance of one cell is unknown, the whole is unknown: an interval of part of
            // the errors would be useless
            .filter(|v| v.iter().all(|line| line.iter().all(|v| v.is_finite())));
        let frequency_hz = in_band.iter().map(|&l| ajb.frequency_hz()[l]).collect();
        let layout = Layout::new(&a, &b, &rows, &columns, geometry, idms);
        Ok(Assembly { frequency_hz, s, cells, variance, layout, outputs: rows.names, inputs: columns.names })
    }

    /// Mean spacing of the lines, Hz.
    pub(super) fn step_hz(&self) -> f64 {
        let n = self.frequency_hz.len();
        if n < 2 { f64::INFINITY } else { (self.frequency_hz[n - 1] - self.frequency_hz[0]) / (n - 1) as f64 }
    }
}

fn joined(first: &Found, second: &Found) -> Found {
    let both = |a: &[String], b: &[String]| a.iter().chain(b).cloned().collect();
    Found {
        names: both(&first.names, &second.names),
        points: first.points.iter().chain(&second.points).cloned().collect(),
        at: first.at.iter().chain(&second.at).copied().collect(),
    }
}

/// A channel or impact with the data that the propagation needs.
pub(super) struct PlacedPoint {
    pub(super) direction: Vector3<f64>,
    pub(super) offset: Vector3<f64>,
    /// 0 for A's virtual point, 1 for B's.
    pub(super) side: usize,
    /// Index of the sensor: its axes share one error of position.
    pub(super) point: usize,
}

/// The transformations of both virtual points combined, and the places of channels and impacts.
pub(super) struct Layout {
    /// 2n_c × channels and impacts × 2n_c, rotations scaled.
    pub(super) t_u: DMatrix<f64>,
    pub(super) t_f: DMatrix<f64>,
    pub(super) channels: Vec<PlacedPoint>,
    pub(super) impacts: Vec<PlacedPoint>,
    pub(super) points: usize,
    pub(super) translations: Axes,
    pub(super) rotations: Axes,
}

/// Index of the degree of freedom along each axis in the IDM set, and its scale; none if the set
/// does not contain it.
pub(super) type Axes = [Option<(usize, f64)>; 3];

impl Layout {
    pub(super) fn new(
        a: &LocatedVirtualPoint,
        b: &LocatedVirtualPoint,
        rows: &Found,
        columns: &Found,
        geometry: &Geometry,
        idms: IdmSet,
    ) -> Layout {
        let n = idms.count();
        let d = balance(idms);
        let (rows_a, columns_a) = (a.rows.at.len(), a.columns.at.len());
        let t_u = DMatrix::from_fn(2 * n, rows.at.len(), |r, c| match (r < n, c < rows_a) {
            (true, true) => a.responses.t[(r, c)] * d[r],
            (false, false) => b.responses.t[(r - n, c - rows_a)] * d[r - n],
            _ => 0.0,
        });
        let t_f = DMatrix::from_fn(columns.at.len(), 2 * n, |r, c| match (r < columns_a, c < n) {
            (true, true) => a.impacts.t[(r, c)] * d[c],
            (false, false) => b.impacts.t[(r - columns_a, c - n)] * d[c - n],
            _ => 0.0,
        });
        let origins = [geometry.virtual_point_a_m, geometry.virtual_point_b_m].map(Vector3::from);
        let place = |p: &Point, side: usize, point: usize| PlacedPoint {
            direction: p.direction(),
            offset: p.position() - origins[side],
            side,
            point,
        };
        let mut names: Vec<&str> = Vec::new();
        let mut channels = Vec::new();
        for (i, channel) in rows.points.iter().enumerate() {
            let at = names.iter().position(|name| *name == channel.name).unwrap_or(names.len());
            if at == names.len() {
                names.push(&channel.name);
            }
            channels.push(place(channel, usize::from(i >= rows_a), at));
        }
        let impacts = columns
            .points
            .iter()
            .enumerate()
            .map(|(i, impact)| place(impact, usize::from(i >= columns_a), i))
            .collect();
        let axes = |dofs: [Dof; 3]| dofs.map(|dof| idms.position(dof).map(|at| (at, d[at])));
        let translations = axes([Dof::X, Dof::Y, Dof::Z]);
        let rotations = axes([Dof::Rx, Dof::Ry, Dof::Rz]);
        Layout { t_u, t_f, channels, impacts, points: names.len(), translations, rotations }
    }

    /// T_u Y T_f: reduces cells to both virtual points, rotations scaled.
    pub(super) fn reduce(&self, cells: &Line) -> Line {
        reduce_inputs(&reduce_outputs(&self.t_u, cells), &self.t_f)
    }
}

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
