//! From an FRF file to the modes of a structure.
//!
//! ```sh
//! cargo run -p jointrig-analysis --example modes
//! ```
//!
//! Three masses in a row on springs were hit at the first and at the last one (modes.csv:
//! mobilities of three outputs and two inputs, measured with an exponential window of 2.3 1/s). The
//! file was computed from the masses, springs and dampers by inverting the dynamic stiffness line
//! by line; the poles of that structure are printed beside those found.

mod csv;

use jointrig_analysis::band::Band;
use jointrig_analysis::modes::{DrivingPoint, Settings, identify, mac};
use nalgebra::Complex;

/// Natural frequency, Hz, and damping ratio of the structure.
const TRUE: [[f64; 2]; 3] = [
    [92.166_649_083_784_53, 0.001_547_255_372_471_01],
    [205.050_128_016_524_6, 0.002_655_961_483_409_758_5],
    [293.311_607_596_827_4, 0.002_111_018_532_358_678],
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let frf = csv::frf("modes.csv")?;
    let mut settings = Settings::of(Band { low_hz: 70.0, high_hz: 320.0 });
    // the first and the last mass have a hit and a sensor, both in the same direction
    settings.driving_points =
        [(0, 0), (2, 1)].map(|(output, input)| DrivingPoint { output, input, sign: 1.0 }).to_vec();
    let found = identify(&frf, &settings)?;
    println!("{} of {} modes, noise {:?}", found.modes.len(), TRUE.len(), found.noise);
    for (mode, [frequency_hz, damping_ratio]) in found.modes.iter().zip(TRUE) {
        let shape: Vec<String> =
            mode.shape.iter().map(|v| format!("{:+.3}", v.norm() * v.re.signum())).collect();
        println!(
            "{:9.4} Hz (true {frequency_hz:9.4}), damping {:.4} % (true {:.4} %), shape {}",
            mode.frequency_hz,
            100.0 * mode.damping_ratio,
            100.0 * damping_ratio,
            shape.join(" "),
        );
    }
    for (k, mode) in found.modes.iter().enumerate() {
        let row: Vec<String> =
            found.modes.iter().map(|other| format!("{:.3}", mac(&mode.shape, &other.shape))).collect();
        println!("MAC of mode {}: {}", k + 1, row.join(" "));
    }
    // scaled to unit modal mass the shapes of the masses are those of the eigenvalue problem
    for mode in &found.modes {
        let to_unit_mass = (Complex::i() * 2.0 * mode.pole_per_s.im).sqrt();
        let masses = [2.0, 1.2, 0.8];
        let modal_mass: f64 =
            mode.shape.iter().zip(masses).map(|(v, mass)| mass * (v * to_unit_mass).norm_sqr()).sum();
        println!("{:9.4} Hz: modal mass {modal_mass:.4} kg (1 for a mode in phase)", mode.frequency_hz);
    }
    let again = found.synthesise(frf.frequency_hz().to_vec(), frf.sigma_per_s(), frf.quantity())?;
    let (mut difference, mut all) = (0.0, 0.0);
    for (measured, synthesised) in frf.lines().iter().zip(again.lines()) {
        difference += (measured - synthesised).norm_squared();
        all += measured.norm_squared();
    }
    println!("the synthesis differs by {:.1e} of the FRFs", f64::sqrt(difference / all));
    let stable = found.chart.poles.iter().filter(|pole| pole.stable_in_damping).count();
    println!("stabilisation chart: {stable} of {} poles are stable in damping", found.chart.poles.len());
    Ok(())
}
