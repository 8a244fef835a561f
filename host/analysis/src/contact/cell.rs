//! The signals of a cell: the point on the specimen or arm along x, y and z, the spots next to the
//! contact, the load cells.

use super::ContactError;
use crate::band::Band;
use crate::frf::MotionQuantity;
use crate::spectra::CrossSpectra;
use crate::structure::Structure;
use crate::substructuring::geometry::Grouping;
use num_complex::Complex;

/// Relative accuracy assumed for any signal, whatever its noise: it covers windows, interpolated
/// delays and the ringing of the force cell.
const RELATIVE_FLOOR: f64 = 5e-4;

/// The kept hits of one impact with one response point.
#[derive(Debug, Clone, Copy)]
pub struct ContactCell<'a> {
    /// The assembly AJB, or B alone.
    pub structure: Structure,
    /// The impact's name.
    pub impact: &'a str,
    /// Position of the impact, m.
    pub impact_m: [f64; 3],
    /// Unit vector of the hammer's push.
    pub direction: [f64; 3],
    /// Grouping of the impact's point: impacts of one grouping are on one body.
    pub impact_grouping: Grouping,
    /// The response point's name.
    pub point: &'a str,
    /// Position of the response point, m.
    pub point_m: [f64; 3],
    /// Standard deviation of that position along each axis, m; none if [`super::ContactPriors`]
    /// give it for this kind of point.
    pub point_sigma_m: Option<f64>,
    /// Grouping of the response point: arm B's interface, or a specimen.
    pub point_grouping: Grouping,
    /// The point's motion along x, y and z, then the velocity of the spots on A and B along z
    /// (m/s), then the load cells' sum (N), with an exponential window of about [`SIGMA_PER_S`].
    pub spectra: &'a CrossSpectra,
    /// The physical quantity of the point's motion.
    pub quantity: MotionQuantity,
}

/// Damping of the exponential window that suits the contact best, 1/s.
///
/// All relations used here hold at every complex s. Heavy damping uses only the first part of the
/// response after the hit, where the signals are strong. At 2.3 /s, which FBS needs for its lightly
/// damped modes, most of a line is noise, and the noise in the signals that the force is computed
/// from biases the fit.
pub const SIGMA_PER_S: f64 = 50.0;

/// Channels of a cell: T, spot B, spot A, then the point along x, y and z.
pub(super) const CHANNELS: usize = 6;

/// Index of each channel among a cell's spectra.
const OUTPUT: [usize; CHANNELS] = [5, 4, 3, 0, 1, 2];

/// A cell's values, per newton of the hammer: motion as displacement (m/N), force in N/N.
#[derive(Debug, Clone)]
pub(super) struct CellValues {
    /// By line and channel.
    pub value: Vec<[Complex<f64>; CHANNELS]>,
    /// Mean auto-spectrum of the force, by line (N² s²).
    pub force: Vec<f64>,
    /// Order of differentiation of each channel as it was measured.
    pub order: [i32; CHANNELS],
    /// Noise power of each channel as measured: the signal's variance per hit, (own unit × s)².
    pub noise: [f64; CHANNELS],
    /// Kept hits.
    pub hits: usize,
}

/// The cell's values at some of its lines. The noise is taken as white over `band_hz`, because a
/// single line of a few hits hardly determines its noise.
///
/// # Errors
/// The spectra do not have six outputs, or have other lines.
pub(super) fn values(
    cell: &ContactCell<'_>,
    chosen: &[usize],
    band_hz: Band,
) -> Result<CellValues, ContactError> {
    let spectra = cell.spectra;
    if spectra.outputs() != CHANNELS || chosen.iter().any(|l| *l >= spectra.lines()) {
        return Err(ContactError::Unlike { impact: cell.impact.into(), point: cell.point.into() });
    }
    let response = cell.quantity.order_of_s();
    let order = [0, 1, 1, response, response, response];
    let inside: Vec<usize> =
        (0..spectra.lines()).filter(|l| band_hz.contains(spectra.frequency_hz()[*l])).collect();
    let hits = spectra.hits() as f64;
    let noise = std::array::from_fn(|c| {
        // a single hit does not determine its noise
        if spectra.hits() < 2 {
            return f64::NAN;
        }
        // of both parts, of one hit; the textbook formula divides by n where n − 1 is unbiased
        let scale = 2.0 * hits * hits / (hits - 1.0);
        let power = |l: &usize| spectra.variance(*l, OUTPUT[c]) * spectra.force(*l) * scale;
        inside.iter().map(power).sum::<f64>() / inside.len() as f64
    });
    let line = |&l: &usize| std::array::from_fn(|c| spectra.h1(l, OUTPUT[c]) / spectra.s(l).powi(order[c]));
    Ok(CellValues {
        value: chosen.iter().map(line).collect(),
        force: chosen.iter().map(|l| spectra.force(*l)).collect(),
        order,
        noise,
        hits: spectra.hits(),
    })
}

/// Averages the noise over channels that share an instrument and its distance: the spots and the
/// load cells over all cells of an impact, the three axes of the vibrometer within each cell. A
/// cell with a single hit has no noise estimate, so its point gets the mean noise of the impact's
/// other points. None if no cell has two hits.
pub(super) fn pool(cells: &mut [CellValues]) -> Option<()> {
    for cell in cells.iter_mut() {
        let mean = cell.noise[3..].iter().sum::<f64>() / 3.0;
        cell.noise[3..].fill(mean);
    }
    for channel in 0..CHANNELS {
        let known: Vec<f64> =
            cells.iter().map(|cell| cell.noise[channel]).filter(|n| n.is_finite()).collect();
        if known.is_empty() {
            return None;
        }
        let mean = known.iter().sum::<f64>() / known.len() as f64;
        for cell in cells.iter_mut().filter(|cell| channel < 3 || !cell.noise[channel].is_finite()) {
            cell.noise[channel] = mean;
        }
    }
    Some(())
}

impl CellValues {
    /// Standard deviation of a channel's complex noise at a line.
    pub fn sigma(&self, line: usize, channel: usize, s: Complex<f64>) -> f64 {
        let power = self.noise[channel] / (self.force[line] * self.hits as f64);
        let noise = power / s.norm_sqr().powi(self.order[channel]);
        (noise + (RELATIVE_FLOOR * self.value[line][channel].norm()).powi(2)).sqrt()
    }

    /// Whether a channel has a finite value and a known noise at a line.
    pub fn usable(&self, line: usize, channel: usize, s: Complex<f64>) -> bool {
        let sigma = self.sigma(line, channel, s);
        self.value[line][channel].is_finite() && sigma.is_finite() && sigma > 0.0
    }
}
