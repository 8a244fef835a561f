//! The front door: three FRF matrices and the geometry in, the joint's stiffness by every method asked for out.

use super::consistency::{Consistency, consistency};
use super::decoupling::{
    DecouplingError, InverseBlock, PrimalBlock, interface, internal, internal_printed, inverse,
    observed_rank, primal,
};
use super::frf::{FrfError, FrfMatrix, Quantity};
use super::geometry::{Geometry, Grouping};
use super::idm::IdmSet;
use super::interface_data::{Found, InterfaceError, Measured, VirtualPoint, balance, scaled};
use super::joint::{Band, JointRow, JointSpectrum};
use super::method::Method;
use super::vpt::{reduce_inputs, reduce_outputs};
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;
use serde::Serialize;

type Line = DMatrix<Complex<f64>>;

/// Why nothing at all can be identified from these files.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum IdentifyError {
    /// One of the files is wrong in itself.
    #[error("{file}: {source}")]
    Frf {
        /// Which file.
        file: &'static str,
        /// Why.
        source: FrfError,
    },
    /// The files are not on the same lines.
    #[error(
        "{file} is on other frequency lines than A ({detail}): decoupling needs the same lines in all three; process the records alike"
    )]
    Axes {
        /// Which file.
        file: &'static str,
        /// The first difference.
        detail: String,
    },
    /// The files hold different quantities.
    #[error(
        "{file} holds {found}, A holds {expected}: convert them to one quantity first, or correct the label"
    )]
    Quantities {
        /// Which file.
        file: &'static str,
        /// Its quantity.
        found: Quantity,
        /// A's quantity.
        expected: Quantity,
    },
    /// The files were windowed differently.
    #[error(
        "{file} has an exponential window of {found} 1/s, A of {expected} 1/s: every FRF must be on the same s = σ + iω"
    )]
    Damping {
        /// Which file.
        file: &'static str,
        /// Its σ, 1/s.
        found: f64,
        /// A's σ, 1/s.
        expected: f64,
    },
    /// A band has no line.
    #[error(
        "no line lies in the band {low_hz}–{high_hz} Hz: the files cover {from_hz}–{to_hz} Hz in {lines} lines above 0 Hz"
    )]
    EmptyBand {
        /// Lowest frequency asked for, Hz.
        low_hz: f64,
        /// Highest frequency asked for, Hz.
        high_hz: f64,
        /// First line, Hz.
        from_hz: f64,
        /// Last line, Hz.
        to_hz: f64,
        /// Number of lines.
        lines: usize,
    },
    /// No method, IDM set or band was asked for.
    #[error("nothing to do: at least one method, one IDM set and one band are needed")]
    NothingAsked,
}

/// Why one method with one IDM set gave no result.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RefusedReason {
    /// The virtual points or internals cannot be formed.
    #[error(transparent)]
    Interface(#[from] InterfaceError),
    /// The method refuses the data at a line.
    #[error("at {frequency_hz} Hz: {source}")]
    Decoupling {
        /// The line, Hz.
        frequency_hz: f64,
        /// Why.
        source: DecouplingError,
    },
}

/// A method and IDM set that gave no result, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Refused {
    /// The method.
    pub method: Method,
    /// Number of interface deformation modes.
    pub idms: usize,
    /// Why, as a sentence.
    pub reason: String,
}

/// Quality of the virtual points of A alone and B alone for one IDM set.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VirtualPointQuality {
    /// `A` or `B`.
    pub substructure: &'static str,
    /// Number of interface deformation modes.
    pub idms: usize,
    /// Condition number of R_u, rotations scaled by 40 mm.
    pub condition_responses: f64,
    /// Condition number of R_f, rotations scaled by 40 mm.
    pub condition_impacts: f64,
    /// Names of the channels, in the order of `consistency.specific_sensor`.
    pub channels: Vec<String>,
    /// Names of the impacts, in the order of `consistency.specific_impact`.
    pub impacts: Vec<String>,
    /// Frequency of each line of `consistency.overall_*`, Hz.
    pub frequency_hz: Vec<f64>,
    /// What the virtual point keeps of motion and force.
    pub consistency: Consistency,
}

/// All that was identified.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identification {
    /// One row per method, IDM set and band that gave a result.
    pub joint: Vec<JointRow>,
    /// Z^J's diagonal over frequency, one per method and IDM set.
    pub spectra: Vec<JointSpectrum>,
    /// Methods that refused this data, with the reason.
    pub refused: Vec<Refused>,
    /// Quality of A's and B's virtual points.
    pub virtual_points: Vec<VirtualPointQuality>,
}

/// Identifies the joint from FRFs of A, B and AJB (all three alike in lines, quantity and window).
///
/// `internal` uses all impacts on A (Grouping 1 and 3) and all responses on B (2 and 4) as internals,
/// `internal-printed` the Grouping 3 impacts and the Grouping 4 responses. A row or column is used when the geometry
/// has it and the files have it. A line at 0 Hz is left out.
///
/// # Errors
/// [`IdentifyError`] when the files do not fit together. A method that cannot work on them is listed in
/// [`Identification::refused`] instead, so that the others still answer.
pub fn identify(
    a: &FrfMatrix,
    b: &FrfMatrix,
    ajb: &FrfMatrix,
    geometry: &Geometry,
    methods: &[Method],
    idms: &[IdmSet],
    bands: &[Band],
) -> Result<Identification, IdentifyError> {
    if methods.is_empty() || idms.is_empty() || bands.is_empty() {
        return Err(IdentifyError::NothingAsked);
    }
    check_alike(a, b, ajb)?;
    let receptance = |file: &'static str, y: &FrfMatrix| {
        y.band(f64::MIN_POSITIVE, f64::MAX)
            .to_receptance()
            .map_err(|source| IdentifyError::Frf { file, source })
    };
    let files = [receptance("A", a)?, receptance("B", b)?, receptance("AJB", ajb)?];
    for band in bands {
        if !files[0].frequency_hz.iter().any(|&f| band.contains(f)) {
            return Err(IdentifyError::EmptyBand {
                low_hz: band.low_hz,
                high_hz: band.high_hz,
                from_hz: files[0].frequency_hz.first().copied().unwrap_or(f64::NAN),
                to_hz: files[0].frequency_hz.last().copied().unwrap_or(f64::NAN),
                lines: files[0].lines.len(),
            });
        }
    }
    let rooms = Rooms {
        a: Measured { file: "A", frf: &files[0], points: &geometry.a },
        b: Measured { file: "B", frf: &files[1], points: &geometry.b },
        ajb: Measured { file: "AJB", frf: &files[2], points: &geometry.ajb },
        geometry,
    };
    let mut out = Identification { joint: vec![], spectra: vec![], refused: vec![], virtual_points: vec![] };
    for &set in idms {
        let reduced = Reduced::of(&rooms, set);
        if let Ok(reduced) = &reduced {
            out.virtual_points.extend(reduced.quality(&rooms));
        }
        for &method in methods {
            let z = match &reduced {
                Ok(reduced) => reduced.solve(&rooms, method),
                Err(error) => Err(error.clone().into()),
            };
            match z {
                Ok((z, notes)) => {
                    let spectrum = JointSpectrum::of(
                        method.name(),
                        set,
                        &files[0].frequency_hz,
                        files[0].sigma_per_s,
                        &z,
                    );
                    for &band in bands {
                        if let Some(mut row) = spectrum.over(band) {
                            row.warnings.splice(0..0, notes.iter().cloned());
                            out.joint.push(row);
                        }
                    }
                    out.spectra.push(spectrum);
                }
                Err(reason) => {
                    out.refused.push(Refused { method, idms: set.count(), reason: reason.to_string() });
                }
            }
        }
    }
    Ok(out)
}

fn check_alike(a: &FrfMatrix, b: &FrfMatrix, ajb: &FrfMatrix) -> Result<(), IdentifyError> {
    for (file, y) in [("A", a), ("B", b), ("AJB", ajb)] {
        y.check().map_err(|source| IdentifyError::Frf { file, source })?;
        if y.quantity != a.quantity {
            return Err(IdentifyError::Quantities { file, found: y.quantity, expected: a.quantity });
        }
        if (y.sigma_per_s - a.sigma_per_s).abs() > 1e-9 * a.sigma_per_s {
            return Err(IdentifyError::Damping { file, found: y.sigma_per_s, expected: a.sigma_per_s });
        }
        if y.frequency_hz.len() != a.frequency_hz.len() {
            let detail = format!("{} lines against {}", y.frequency_hz.len(), a.frequency_hz.len());
            return Err(IdentifyError::Axes { file, detail });
        }
        // A text format may have rounded the axis to seven digits.
        let differs = y.frequency_hz.iter().zip(&a.frequency_hz).find(|(f, g)| (*f - *g).abs() > 1e-6 * *g);
        if let Some((f, g)) = differs {
            return Err(IdentifyError::Axes { file, detail: format!("{f} Hz against {g} Hz") });
        }
    }
    Ok(())
}

/// The three measurements and the geometry.
struct Rooms<'a> {
    a: Measured<'a>,
    b: Measured<'a>,
    ajb: Measured<'a>,
    geometry: &'a Geometry,
}

/// Virtual points of A and B alone for one IDM set, with their admittances (rotations scaled to metres).
struct Reduced {
    idms: IdmSet,
    vp_a: VirtualPoint,
    vp_b: VirtualPoint,
    y_a: Vec<Line>,
    y_b: Vec<Line>,
}

type Solved = Result<(Vec<Line>, Vec<String>), RefusedReason>;

impl Reduced {
    fn of(rooms: &Rooms<'_>, idms: IdmSet) -> Result<Reduced, InterfaceError> {
        let vp_a = rooms.a.virtual_point(Grouping::InterfaceA, rooms.geometry, idms)?;
        let vp_b = rooms.b.virtual_point(Grouping::InterfaceB, rooms.geometry, idms)?;
        let y_a = Self::admittance(rooms.a, &vp_a, &vp_a, idms)?;
        let y_b = Self::admittance(rooms.b, &vp_b, &vp_b, idms)?;
        Ok(Reduced { idms, vp_a, vp_b, y_a, y_b })
    }

    /// T_u Y T_f between two virtual points of one file.
    fn admittance(
        file: Measured<'_>,
        out: &VirtualPoint,
        input: &VirtualPoint,
        idms: IdmSet,
    ) -> Result<Vec<Line>, InterfaceError> {
        let d = balance(idms);
        let lines = file.block(&out.rows, &input.columns)?;
        Ok(lines
            .par_iter()
            .map(|y| {
                let reduced = reduce_inputs(&reduce_outputs(&out.responses.t, y), &input.impacts.t);
                scaled(&reduced, Some(&d), Some(&d))
            })
            .collect())
    }

    fn quality(&self, rooms: &Rooms<'_>) -> Vec<VirtualPointQuality> {
        [("A", rooms.a, &self.vp_a), ("B", rooms.b, &self.vp_b)]
            .into_iter()
            .filter_map(|(substructure, file, vp)| {
                let lines = file.block(&vp.rows, &vp.columns).ok()?;
                Some(VirtualPointQuality {
                    substructure,
                    idms: self.idms.count(),
                    condition_responses: vp.responses.condition,
                    condition_impacts: vp.impacts.condition,
                    channels: vp.rows.names.clone(),
                    impacts: vp.columns.names.clone(),
                    frequency_hz: file.frf.frequency_hz.clone(),
                    consistency: consistency(&lines, &vp.responses, &vp.impacts),
                })
            })
            .collect()
    }

    fn solve(&self, rooms: &Rooms<'_>, method: Method) -> Solved {
        match method {
            Method::Internal => self.internals(
                rooms,
                &[Grouping::InterfaceA, Grouping::InternalA],
                &[Grouping::InterfaceB, Grouping::InternalB],
                false,
            ),
            Method::InternalPrinted => {
                self.internals(rooms, &[Grouping::InternalA], &[Grouping::InternalB], true)
            }
            Method::Interface => {
                let y = self.assembly(rooms)?;
                self.per_line(rooms, |l| interface(&self.y_a[l], &self.y_b[l], &y[l])).map(|z| (z, vec![]))
            }
            Method::PrimalA => {
                let y = self.assembly(rooms)?;
                self.per_line(rooms, |l| primal(PrimalBlock::A, &self.y_a[l], &y[l])).map(|z| (z, vec![]))
            }
            Method::PrimalB => {
                let y = self.assembly(rooms)?;
                self.per_line(rooms, |l| primal(PrimalBlock::B, &self.y_b[l], &y[l])).map(|z| (z, vec![]))
            }
            Method::Inverse => {
                let y = self.assembly(rooms)?;
                self.per_line(rooms, |l| inverse(InverseBlock::Ab, &y[l])).map(|z| (z, vec![]))
            }
            Method::InverseBa => {
                let y = self.assembly(rooms)?;
                self.per_line(rooms, |l| inverse(InverseBlock::Ba, &y[l])).map(|z| (z, vec![]))
            }
        }
    }

    /// Y^AJB_cc: both virtual points of the assembly, A's first.
    fn assembly(&self, rooms: &Rooms<'_>) -> Result<Vec<Line>, InterfaceError> {
        let n = self.idms.count();
        let vp = [
            rooms.ajb.virtual_point(Grouping::InterfaceA, rooms.geometry, self.idms)?,
            rooms.ajb.virtual_point(Grouping::InterfaceB, rooms.geometry, self.idms)?,
        ];
        let mut lines = vec![Line::zeros(2 * n, 2 * n); rooms.ajb.frf.lines.len()];
        for (r, out) in vp.iter().enumerate() {
            for (c, input) in vp.iter().enumerate() {
                for (line, y) in lines.iter_mut().zip(Self::admittance(rooms.ajb, out, input, self.idms)?) {
                    line.view_mut((r * n, c * n), (n, n)).copy_from(&y);
                }
            }
        }
        Ok(lines)
    }

    /// Both forms of Eq. (3): P, Q from the substructures, M from the assembly, at the internals that both have.
    fn internals(
        &self,
        rooms: &Rooms<'_>,
        impacts_on_a: &[Grouping],
        responses_on_b: &[Grouping],
        printed: bool,
    ) -> Solved {
        let d = balance(self.idms);
        let (columns_a, columns_ajb) = shared(rooms.a.inputs(impacts_on_a), rooms.ajb.inputs(impacts_on_a));
        let (rows_b, rows_ajb) = shared(rooms.b.outputs(responses_on_b), rooms.ajb.outputs(responses_on_b));
        let q_raw = rooms.a.block(&self.vp_a.rows, &columns_a)?;
        let p_raw = rooms.b.block(&rows_b, &self.vp_b.columns)?;
        let m = rooms.ajb.block(&rows_ajb, &columns_ajb)?;
        let q = |l: usize| scaled(&reduce_outputs(&self.vp_a.responses.t, &q_raw[l]), Some(&d), None);
        let p = |l: usize| scaled(&reduce_inputs(&p_raw[l], &self.vp_b.impacts.t), None, Some(&d));
        let mut notes = Vec::new();
        if printed && !m.is_empty() {
            let (n_b, n_a) = m[0].shape();
            let n_c = self.idms.count();
            if n_a.min(n_b) == 0 {
                let source = DecouplingError::TooFewInternals { impacts: n_a, responses: n_b, needed: n_c };
                let frequency_hz = rooms.ajb.frf.frequency_hz[0];
                return Err(RefusedReason::Decoupling { frequency_hz, source });
            }
            if n_a != n_c || n_b != n_c {
                let rank = observed_rank(&p(0), &q(0));
                notes.push(format!(
                    "Eq. 3 as printed with {n_a} internal impacts and {n_b} internal responses for {n_c} interface DoFs: Π has rank {rank} of {n_c}, \
                     so the result is right only for the interface forces that these internals generate, and biased otherwise; `internal` is the exact form"
                ));
            }
        }
        let method = if printed { internal_printed } else { internal };
        let z = self.per_line(rooms, |l| method(&self.y_a[l], &self.y_b[l], &p(l), &m[l], &q(l)))?;
        Ok((z, notes))
    }

    /// Solves every line and takes the rotations' scale out again: Z = D Z' D.
    fn per_line(
        &self,
        rooms: &Rooms<'_>,
        solve: impl Fn(usize) -> Result<Line, DecouplingError> + Sync,
    ) -> Result<Vec<Line>, RefusedReason> {
        let d = balance(self.idms);
        (0..self.y_a.len())
            .into_par_iter()
            .map(|l| {
                solve(l).map(|z| scaled(&z, Some(&d), Some(&d))).map_err(|source| RefusedReason::Decoupling {
                    frequency_hz: rooms.a.frf.frequency_hz[l],
                    source,
                })
            })
            .collect()
    }
}

/// Those rows (or columns) that both files have, in the order of the first.
fn shared(first: Found, second: Found) -> (Found, Found) {
    let mut one = Found { names: vec![], points: vec![], at: vec![] };
    let mut two = Found { names: vec![], points: vec![], at: vec![] };
    for (i, name) in first.names.iter().enumerate() {
        if let Some(j) = second.names.iter().position(|n| n == name) {
            one.names.push(name.clone());
            one.points.push(first.points[i].clone());
            one.at.push(first.at[i]);
            two.names.push(name.clone());
            two.points.push(second.points[j].clone());
            two.at.push(second.at[j]);
        }
    }
    (one, two)
}
