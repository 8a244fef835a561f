//! From a record of a sliding contact to its tangential stiffness k_T.
//!
//! ```sh
//! cargo run -p jointrig-analysis --example loop_to_kt
//! ```
//!
//! A shaker moves a contact by ±3 µm at 100 Hz. loop.csv holds the velocities on both sides of the
//! contact and the tangential force, 10 240 samples per second. They were computed for a Jenkins
//! contact: a spring of 180 N/µm that slides at 150 N.

mod csv;

use jointrig_analysis::hysteresis::{HysteresisRecord, RelativeMotion, analyse};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rows = csv::rows("loop.csv")?;
    let column = |c: usize| rows.iter().map(|row| row[c].parse()).collect::<Result<Vec<f64>, _>>();
    let record = HysteresisRecord {
        fs_hz: 10_240.0,
        motion: RelativeMotion::Velocity { a_m_per_s: column(0)?, b_m_per_s: column(1)? },
        force_n: column(2)?,
        excitation_hz: Some(100.0),
        normal_load_n: Some(300.0),
    };
    let found = analyse(&record)?;
    println!("shape of the loop   {:?}, ±{:.2} µm", found.shape, found.amplitude_m * 1e6);
    if let Some(k_t) = found.k_t_n_per_m {
        println!("k_T, stick part     {:6.1} N/µm", k_t.mean * 1e-6);
    }
    println!("k_eq, whole loop    {:6.1} N/µm", found.k_eq_n_per_m.mean * 1e-6);
    if let Some(energy) = found.energy_j {
        println!("energy of a cycle   {:6.2} mJ", energy.mean * 1e3);
    }
    if let (Some(limit), Some(mu)) = (found.friction_limit_n, found.friction_coefficient) {
        println!("friction limit      {limit:6.1} N, coefficient {mu:.2}");
    }
    Ok(())
}
