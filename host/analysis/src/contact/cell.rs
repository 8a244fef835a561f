//! What is measured in a cell: the point on the specimen or arm along x, y and z, the spots beside the contact, the load cells.

use super::ContactError;
use crate::band::Band;
use crate::frf::MotionQuantity;
use crate::spectra::CrossSpectra;
use crate::structure::Structure;
use crate::substructuring::geometry::Grouping;
use num_complex::Complex;

/// Below this fraction of a signal nothing is believed, whatever its noise: windows, interpolated delays, the force cell's ringing.
const RELATIVE_FLOOR: f64 = 5e-4;

/// The kept hits of one impact with one response point.
#[derive(Debug, Clone, Copy)]
pub struct ContactCell<'a> {
    /// The assembly, or B alone.
    pub structure: Structure,
    /// The impact's name.
    pub impact: &'a str,
    /// Where the hammer hits, m.
    pub impact_m: [f64; 3],
    /// Unit vector along which it pushes.
    pub direction: [f64; 3],
    /// What the impact's point is for: impacts of one grouping are on one body.
    pub impact_grouping: Grouping,
    /// The response point's name.
    pub point: &'a str,
    /// Where it is, m.
    pub point_m: [f64; 3],
    /// How well that is known, standard deviation along each axis, m; none where [`super::ContactPriors`] say it of its kind.
    pub point_sigma_m: Option<f64>,
    /// What it is for: arm B's interface, or a specimen.
    pub point_grouping: Grouping,
    /// The point's motion along x, y and z, then the velocity of the spots on A and B along z (m/s), then the load cells' sum (N); with
    /// an exponential window of [`SIGMA_PER_S`] or so.
    pub spectra: &'a CrossSpectra,
    /// What the point's motion is.
    pub quantity: MotionQuantity,
}

/// The exponential window's damping that the contact is best read with, 1/s.
///
/// All relations used here hold at every complex s. Heavy damping asks only what comes soon after the hit, where the signals are
/// strong: at 2.3 /s, which FBS needs for its lightly damped modes, most of a line is noise, and the noise in what the force is formed
/// from bends the fit.
pub const SIGMA_PER_S: f64 = 50.0;

/// Channels of a cell: T, spot B, spot A, then the point along x, y and z.
pub(super) const CHANNELS: usize = 6;

/// Where the channels are among a cell's spectra.
const OUTPUT: [usize; CHANNELS] = [5, 4, 3, 0, 1, 2];

/// A cell's values, per newton of the hammer: motion as displacement (m/N), force in N/N.
#[derive(Debug, Clone)]
pub(super) struct Values {
    /// By line and channel.
    pub value: Vec<[Complex<f64>; CHANNELS]>,
    /// Mean auto-spectrum of the force, by line (N² s²).
    pub force: Vec<f64>,
    /// Order of differentiation of each channel as it was measured.
    pub order: [i32; CHANNELS],
    /// Power of each channel's noise as it was measured: a signal's variance per hit, in its own unit times s, squared.
    pub noise: [f64; CHANNELS],
    /// Kept hits.
    pub hits: usize,
}

/// The cell's values at some of its lines. The noise is taken as white over `band_hz`: a line of a few hits tells next to nothing of its own.
///
/// # Errors
/// Spectra that have not six outputs, or other lines.
pub(super) fn values(
    cell: &ContactCell<'_>,
    chosen: &[usize],
    band_hz: Band,
) -> Result<Values, ContactError> {
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
        // a single hit does not tell its noise
        if spectra.hits() < 2 {
            return f64::NAN;
        }
        // of both parts, of one hit; the textbook divides by n what n − 1 hits have told
        let scale = 2.0 * hits * hits / (hits - 1.0);
        let power = |l: &usize| spectra.variance(*l, OUTPUT[c]) * spectra.force(*l) * scale;
        inside.iter().map(power).sum::<f64>() / inside.len() as f64
    });
    let line = |&l: &usize| std::array::from_fn(|c| spectra.h1(l, OUTPUT[c]) / spectra.s(l).powi(order[c]));
    Ok(Values {
        value: chosen.iter().map(line).collect(),
        force: chosen.iter().map(|l| spectra.force(*l)).collect(),
        order,
        noise,
        hits: spectra.hits(),
    })
}

/// What the noise of a channel is taken for: the mean of those that share an instrument and its distance. The spots and the load
/// cells do in all cells of an impact, the three axes of the vibrometer in each cell. A cell with a single hit tells no noise of its own: its point
/// is taken to be as noisy as the impact's others. None where no cell has two hits.
pub(super) fn pool(cells: &mut [Values]) -> Option<()> {
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

impl Values {
    /// Standard deviation of a channel's complex noise at a line.
    pub fn sigma(&self, line: usize, channel: usize, s: Complex<f64>) -> f64 {
        let power = self.noise[channel] / (self.force[line] * self.hits as f64);
        let noise = power / s.norm_sqr().powi(self.order[channel]);
        (noise + (RELATIVE_FLOOR * self.value[line][channel].norm()).powi(2)).sqrt()
    }

    /// Whether a channel is a number with a known noise at a line.
    pub fn usable(&self, line: usize, channel: usize, s: Complex<f64>) -> bool {
        let sigma = self.sigma(line, channel, s);
        self.value[line][channel].is_finite() && sigma.is_finite() && sigma > 0.0
    }
}
