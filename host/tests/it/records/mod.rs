//! Impact records of a rig, computed without simulating them in time: the exact FRFs at each cell's
//! true (erroneous) geometry, times the hammer's spectrum, transformed to time, with the sensors'
//! noise. The analysis receives what it would read from a campaign file.

use jointrig::analyse::{CellName, ContactDelays, ContactSignals, Hit, Measurements};
use jointrig::exchange::read_positions;
use jointrig::spectra::MotionQuantity;
use jointrig::substructuring::geometry::{Geometry, Grouping};
use jointrig_hil_sim::rig::config::BodyName;
use jointrig_hil_sim::rig::structure::Structure;
use jointrig_hil_sim::rig::{Aim, Configuration, Probe, RigConfig};
use nalgebra::{Complex, DMatrix, DVector};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use realfft::RealFftPlanner;
use std::convert::Infallible;
use std::f64::consts::{PI, TAU};
use std::path::Path;

type C = Complex<f64>;

const RATE_HZ: f64 = 51_200.0;
const RECORD_S: f64 = 2.0;
const SAMPLES: usize = 102_400;
const HITS: i64 = 2;
/// Records are computed on s = σ + iω, where they decay before they repeat, and multiplied by
/// e^(σt) afterwards (1/s).
const SIGMA: f64 = 6.0;
/// The hammer's half-sine, and its start.
const PEAK_N: f64 = 50.0;
const WIDTH_S: f64 = 0.41e-3;
const START_S: f64 = 5e-3;
/// The force's spectrum is attenuated by exp(−(f / `FADE_HZ`)²): a Gaussian in time, so that
/// nothing rings before the pulse. (Such ringing would wrap round to the record's end, where e^(σt)
/// makes it 10⁵ times as large.)
const FADE_HZ: f64 = 1000.0;
/// Highest line, Hz: exp(−25) of the force is left there.
const HIGHEST_HZ: f64 = 5000.0;

/// The assembly of a rig, hit at its interface and on its moving mass.
pub struct Assembly {
    config: RigConfig,
    geometry: Geometry,
    structure: Structure,
    /// Receptance between generalised coordinates, line by line from 0 Hz, on s = σ + iω.
    compliance: Vec<DMatrix<C>>,
    force: Vec<C>,
    seed: u64,
}

impl Assembly {
    pub fn of(config: RigConfig, seed: u64) -> Assembly {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/positions/positions.xlsx");
        let geometry = read_positions(&path).expect("test data").geometry;
        let structure = Structure::new(&config, Configuration::Ajb);
        let lines = (HIGHEST_HZ * RECORD_S) as usize;
        let scale = structure.mass.diagonal().map(|m| 1.0 / m.sqrt());
        let compliance = (0..lines)
            .map(|l| {
                let s = variable(l);
                // coordinates of unit mass, because metres and radians would cost digits
                let z = DMatrix::from_fn(scale.len(), scale.len(), |i, j| {
                    (s * s * structure.mass[(i, j)]
                        + s * structure.damping[(i, j)]
                        + structure.stiffness[(i, j)])
                        * scale[i]
                        * scale[j]
                });
                let inverse = z.try_inverse().expect("damped");
                DMatrix::from_fn(scale.len(), scale.len(), |i, j| inverse[(i, j)] * scale[i] * scale[j])
            })
            .collect();
        let force = (0..lines).map(|l| half_sine(variable(l)) * fade(l as f64 / RECORD_S)).collect();
        Assembly { config, geometry, structure, compliance, force, seed }
    }

    fn signal(&self, spectrum: impl Fn(usize) -> C, floor: f64, stream: &mut Xoshiro256PlusPlus) -> Vec<f64> {
        let fft = RealFftPlanner::<f64>::new().plan_fft_inverse(SAMPLES);
        let mut lines = fft.make_input_vec();
        for (l, value) in lines.iter_mut().enumerate().take(self.force.len()) {
            *value = spectrum(l);
        }
        lines[0].im = 0.0;
        let mut signal = fft.make_output_vec();
        fft.process(&mut lines, &mut signal).expect("lengths fit");
        let step_hz = 1.0 / RECORD_S;
        for (t, value) in signal.iter_mut().enumerate() {
            let white: f64 = StandardNormal.sample(stream);
            *value = *value * step_hz * (SIGMA * t as f64 / RATE_HZ).exp() + floor * white;
        }
        signal
    }

    fn row(&self, probe: &Probe) -> DVector<C> {
        self.structure.row(probe).expect("its body is there").map(Complex::from)
    }
}

impl Measurements for Assembly {
    type Error = Infallible;

    fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    fn sigma_per_s(&self) -> f64 {
        2.3
    }

    fn quantity(&self) -> MotionQuantity {
        MotionQuantity::Velocity
    }

    fn cells(&self) -> Vec<CellName> {
        let interface = |g| matches!(g, Grouping::InterfaceA | Grouping::InterfaceB);
        let mut cells = Vec::new();
        for impact in &self.geometry.ajb.impacts {
            for channel in self.geometry.ajb.channels.iter().step_by(3).filter(|c| interface(c.grouping)) {
                // one cell is enough for the moving mass: its hits are only used for the contact
                let mass = impact.grouping == Grouping::InternalA && impact.direction[2].abs() > 0.9;
                if interface(impact.grouping) || (mass && channel.name == "A1") {
                    cells.push(CellName {
                        configuration: jointrig::structure::Structure::Ajb,
                        impact: impact.name.clone(),
                        response: channel.name.clone(),
                    });
                }
            }
        }
        cells
    }

    fn each_hit(
        &self,
        cell: &CellName,
        _: bool,
        look: &mut dyn FnMut(&Hit, f64),
    ) -> Result<Vec<String>, Infallible> {
        let config = &self.config;
        let impact =
            config.impact(Configuration::Ajb, &cell.impact).expect("the workbook's impacts are the rig's");
        let response = config.response(Configuration::Ajb, &cell.response).expect("and its responses");
        let words = ["AJB", cell.impact.as_str(), cell.response.as_str()];
        let aim = Aim::new(self.seed, words, &config.errors, impact, response, false);
        let column = self.row(&aim.impact);
        // generalised motion per newton of this hit
        let motion: Vec<DVector<C>> = self.compliance.iter().map(|y| y * &column).collect();
        let velocity = |probe: &Probe| -> Vec<C> {
            let row = self.row(probe);
            motion.iter().enumerate().map(|(l, m)| row.dot(m) * variable(l) * self.force[l]).collect()
        };
        let responses = aim.response.map(|probe| velocity(&probe));
        let spots = [&config.spots.ldv_a, &config.spots.ldv_b].map(|spot| velocity(&Probe::along_z(spot)));
        // the load cells' springs carry T: kz · z of arm B at each
        let tangential: Vec<C> = config
            .load_cells
            .iter()
            .map(|cell| {
                let probe =
                    Probe { body: BodyName::ArmB, position_m: cell.position_m, direction: [0.0, 0.0, 1.0] };
                self.row(&probe) * Complex::from(cell.stiffness_n_per_m[2])
            })
            .fold(Vec::new(), |sum: Vec<C>, row| {
                let own = motion.iter().enumerate().map(|(l, m)| row.dot(m) * self.force[l]);
                if sum.is_empty() { own.collect() } else { sum.iter().zip(own).map(|(a, b)| a + b).collect() }
            });
        let seed = cell
            .impact
            .bytes()
            .chain(cell.response.bytes())
            .fold(self.seed, |seed, byte| seed.wrapping_mul(31).wrapping_add(u64::from(byte)));
        let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed);
        let nyquist = (RATE_HZ / 2.0).sqrt();
        let floor = config.sensors.vibrometer.floor * nyquist;
        let spot_floor = config.sensors.ldv_a.floor * nyquist;
        let cell_noise = config.sensors.load_cells.noise_n * (config.load_cells.len() as f64).sqrt();
        for record in 1..=HITS {
            let hit = Hit {
                record,
                of_row: false,
                force_n: self.signal(|l| self.force[l], config.sensors.force.noise_n, &mut stream),
                response: (0..3)
                    .map(|axis| self.signal(|l| responses[axis][l], floor, &mut stream))
                    .collect(),
                response_delay_s: vec![0.0; 3],
                contact: Some(ContactSignals {
                    delay_s: ContactDelays::default(),
                    specimen_a_m_per_s: self.signal(|l| spots[0][l], spot_floor, &mut stream),
                    specimen_b_m_per_s: self.signal(|l| spots[1][l], spot_floor, &mut stream),
                    tangential_n: self.signal(|l| tangential[l], cell_noise, &mut stream),
                }),
                load_cells: None,
            };
            look(&hit, RATE_HZ);
        }
        Ok(Vec::new())
    }
}

/// s of a line, 1/s.
fn variable(line: usize) -> C {
    Complex::new(SIGMA, TAU * line as f64 / RECORD_S)
}

/// The hammer's spectrum on s, N s.
fn half_sine(s: C) -> C {
    let turn = PI / WIDTH_S;
    let end = (-s * WIDTH_S).exp() + 1.0;
    (-s * START_S).exp() * PEAK_N * turn * end / (s * s + turn * turn)
}

fn fade(frequency_hz: f64) -> f64 {
    (-(frequency_hz / FADE_HZ).powi(2)).exp()
}
