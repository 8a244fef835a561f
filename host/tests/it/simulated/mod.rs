//! Simulated campaigns as FRFs: the rig's exact mobility at each cell's true (erroneous) geometry,
//! with the noise of the vibrometer, the exponential window and the average of eight hits. No
//! record is computed, so a campaign takes a fraction of a second.

use jointrig::exchange::read_positions;
use jointrig::substructuring::averaged::CellHits;
use jointrig::substructuring::geometry::{Configuration as Points, Geometry};
use jointrig::substructuring::{Frf, MotionQuantity};
use jointrig_hil_sim::rig::structure::Structure;
use jointrig_hil_sim::rig::{Aim, Configuration, RigConfig};
use nalgebra::{Complex, DMatrix, DVector};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use realfft::RealFftPlanner;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Damping of the exponential window, 1/s; the length of a record, s; hits averaged.
pub const SIGMA: f64 = 2.3;
const RECORD_S: f64 = 2.0;
const HITS: usize = 8;
/// Enough for lines up to 1 kHz.
const RATE_HZ: f64 = 2048.0;
/// The hammer's half-sine.
const PEAK_N: f64 = 50.0;
const WIDTH_S: f64 = 0.41e-3;

/// One configuration as measured.
pub struct Measurement {
    pub frf: Frf,
    /// The hits of every sensor and impact, if they were kept.
    pub hits: Vec<CellHits>,
}

/// A campaign: A, B and AJB.
pub struct Campaign {
    pub a: Measurement,
    pub b: Measurement,
    pub ajb: Measurement,
}

/// The nominal geometry, as the analyst knows it.
pub fn geometry() -> Geometry {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/positions/positions.xlsx");
    read_positions(&path).expect("test data").geometry
}

/// The rig with a rigid clamp and this contact stiffness along z, N/m.
pub fn rigid_rig(contact_n_per_m: f64) -> RigConfig {
    let mut config = RigConfig::default();
    config.clamp.rigid = true;
    config.contact.stiffness_n_per_m[2] = contact_n_per_m;
    config
}

/// A campaign on `config` with this vibrometer floor, (m/s)/√Hz, over lines of `low_hz` to
/// `high_hz`.
pub fn campaign(config: &RigConfig, floor: f64, seed: u64, band_hz: [f64; 2]) -> Campaign {
    let geometry = geometry();
    let one = |configuration, points: &Points| measure(config, configuration, points, floor, seed, band_hz);
    Campaign {
        a: one(Configuration::A, &geometry.a),
        b: one(Configuration::B, &geometry.b),
        ajb: one(Configuration::Ajb, &geometry.ajb),
    }
}

/// One configuration, averaged; the hits are not kept.
pub fn measure(
    config: &RigConfig,
    configuration: Configuration,
    points: &Points,
    floor: f64,
    seed: u64,
    band_hz: [f64; 2],
) -> Measurement {
    simulate(config, configuration, points, floor, seed, band_hz, false)
}

/// The same with every hit's spectra, for the bootstrap: hundreds of megabytes for a wide band.
pub fn measure_with_hits(
    config: &RigConfig,
    configuration: Configuration,
    points: &Points,
    floor: f64,
    seed: u64,
    band_hz: [f64; 2],
) -> Measurement {
    simulate(config, configuration, points, floor, seed, band_hz, true)
}

fn simulate(
    config: &RigConfig,
    configuration: Configuration,
    points: &Points,
    floor: f64,
    seed: u64,
    band_hz: [f64; 2],
    keep_hits: bool,
) -> Measurement {
    let structure = Structure::new(config, configuration);
    let first = (band_hz[0] * RECORD_S).ceil() as usize;
    let last = (band_hz[1] * RECORD_S).floor() as usize;
    let frequency_hz: Vec<f64> = (first..=last).map(|l| l as f64 / RECORD_S).collect();
    let (rows, columns) = (points.channels.len(), points.impacts.len());
    // true rows and columns of every cell
    let mut seen: Vec<Vec<DVector<f64>>> = Vec::new();
    let mut hit: Vec<Vec<DVector<f64>>> = Vec::new();
    for impact in &points.impacts {
        let at = config.impact(configuration, &impact.name).expect("the workbook's impacts are the rig's");
        let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
        for channel in &points.channels {
            let to = config.response(configuration, &channel.name).expect("and its responses");
            let words = [configuration.as_str(), impact.name.as_str(), channel.name.as_str()];
            let aim = Aim::new(seed, words, &config.errors, at, to, false);
            let axis = channel.direction.iter().position(|d| *d == 1.0).expect("channels along the axes");
            outputs.push(structure.row(&aim.response[axis]).expect("its body is there"));
            inputs.push(structure.row(&aim.impact).expect("its body is there"));
        }
        seen.push(outputs);
        hit.push(inputs);
    }
    let mut lines: Vec<DMatrix<Complex<f64>>> = frequency_hz
        .iter()
        .map(|f| {
            let s = Complex::new(SIGMA, TAU * f);
            let n = structure.order();
            // coordinates of unit mass, because metres and radians would cost digits
            let scale = structure.mass.diagonal().map(|m| 1.0 / m.sqrt());
            let z = DMatrix::from_fn(n, n, |i, j| {
                (s * s * structure.mass[(i, j)] + s * structure.damping[(i, j)] + structure.stiffness[(i, j)])
                    * scale[i]
                    * scale[j]
            });
            let inverse = z.try_inverse().expect("damped");
            let y = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
            DMatrix::from_fn(rows, columns, |o, i| {
                let moved = y.map(|v| v * s) * hit[i][o].map(Complex::from);
                seen[i][o].iter().zip(moved.iter()).map(|(r, m)| m * *r).sum()
            })
        })
        .collect();
    let mut variance = vec![DMatrix::zeros(rows, columns); lines.len()];
    let force: Vec<f64> = frequency_hz.iter().map(|f| half_sine(*f)).collect();
    let samples = (RATE_HZ * RECORD_S) as usize;
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(samples);
    let mut spectrum = fft.make_output_vec();
    let place = ["A", "B", "AJB"].iter().position(|c| *c == configuration.as_str()).expect("one of three");
    let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed * 1000 + place as u64);
    let mut hits = Vec::new();
    for i in 0..columns {
        let mut cell: Option<CellHits> = None;
        for o in 0..rows {
            let (mut sum, mut square) = (vec![Complex::default(); lines.len()], vec![0.0; lines.len()]);
            let mut cross = vec![Vec::new(); lines.len()];
            for _ in 0..HITS {
                let mut signal: Vec<f64> = (0..samples)
                    .map(|t| {
                        let white: f64 = StandardNormal.sample(&mut stream);
                        white * floor * (RATE_HZ / 2.0).sqrt() * (-SIGMA * t as f64 / RATE_HZ).exp()
                    })
                    .collect();
                fft.process(&mut signal, &mut spectrum).expect("lengths fit");
                for (l, force) in force.iter().enumerate() {
                    let n = spectrum[first + l] / (RATE_HZ * force);
                    sum[l] += n;
                    square[l] += n.norm_sqr();
                    if keep_hits {
                        cross[l].push((lines[l][(o, i)] + n) * force * force);
                    }
                }
            }
            for l in 0..lines.len() {
                let mean = sum[l] / HITS as f64;
                lines[l][(o, i)] += mean;
                // variance of one part of the mean: half the complex sample variance, divided by
                // the number of hits
                variance[l][(o, i)] =
                    (square[l] - HITS as f64 * mean.norm_sqr()) / (HITS - 1) as f64 / HITS as f64 / 2.0;
            }
            if !keep_hits {
                continue;
            }
            // the three axes of a sensor are adjacent in the workbook
            let channel = &points.channels[o];
            if cell.as_ref().is_none_or(|_| o > 0 && points.channels[o - 1].name != channel.name) {
                hits.extend(cell.take());
                cell = Some(CellHits {
                    input: points.input_names()[i].clone(),
                    outputs: Vec::new(),
                    auto: force.iter().map(|f| vec![f * f; HITS]).collect(),
                    cross: vec![Vec::new(); lines.len()],
                });
            }
            if let Some(cell) = &mut cell {
                cell.outputs.push(points.output_names()[o].clone());
                cell.cross.iter_mut().zip(cross).for_each(|(all, own)| all.push(own));
            }
        }
        hits.extend(cell);
    }
    let (outputs, inputs) = (points.output_names(), points.input_names());
    let frf = Frf::new(frequency_hz, SIGMA, MotionQuantity::Velocity, outputs, inputs, lines);
    Measurement { frf: frf.and_then(|frf| frf.with_variance(variance)).expect("all agree"), hits }
}

/// Magnitude of the hammer's spectrum, N s.
fn half_sine(frequency_hz: f64) -> f64 {
    let turns = frequency_hz * WIDTH_S;
    PEAK_N * WIDTH_S * 2.0 / PI * (PI * turns).cos() / (1.0 - 4.0 * turns * turns)
}
