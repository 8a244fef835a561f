//! One whole hit, sample by sample, compared with an independent implementation's record.

#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use std::sync::Arc;

use jointrig_hil_sim::rig::config::BodyName;
use jointrig_hil_sim::rig::force::ForceSegment;
use jointrig_hil_sim::rig::modal::StateSpace;
use jointrig_hil_sim::rig::modal::modes;
use jointrig_hil_sim::rig::stepper::{Aimed, ModalStepper, ScanForces, Span};
use jointrig_hil_sim::rig::structure::Structure;
use jointrig_hil_sim::rig::{Configuration, FixedRows, Probe, RigConfig};
use nalgebra::DVector;

#[test]
fn a_hit_on_az3_is_the_reference_record_but_for_its_noise() {
    let text = include_str!("../data/impact_record.csv");
    let record: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|row| row.split(',').map(|value| value.parse().unwrap()).collect())
        .collect();
    let mut config = RigConfig::default();
    // The record was simulated with a friction element along z without a parallel dashpot.
    config.contact.damping_s[2] = 0.0;
    let structure = Structure::new(&config, Configuration::Ajb);
    let space = StateSpace::new(&structure).unwrap();
    let velocity = |probe: &Probe| space.velocity(&structure.row(probe).unwrap());
    let cell = |index: usize| {
        let cell = &config.load_cells[index];
        let probe = Probe { body: BodyName::ArmB, position_m: cell.position_m, direction: [0.0, 0.0, 1.0] };
        space.displacement(&structure.row(&probe).unwrap()) * cell.stiffness_n_per_m[2]
    };
    let none = DVector::zeros(space.order());
    let aimed = Aimed {
        rows: [
            none.clone(),
            none.clone(),
            none.clone(),
            velocity(&Probe::along_z(&config.spots.ldv_a)),
            velocity(&Probe::along_z(&config.spots.ldv_b)),
            cell(0),
            cell(1),
            cell(2),
        ],
        hammer: space
            .input(&structure.row(&config.impact(Configuration::Ajb, "AZ3").unwrap().probe()).unwrap()),
        shaker: none,
        // Smaller than anything compared below.
        steps: [1e-9; 8],
        joint: None,
        fixed: FixedRows::default(),
    };
    let period_s = 1.0 / 51_200.0;
    let mut stepper = ModalStepper::new(&Arc::new(modes(&space).unwrap()), &aimed, period_s);
    // As specified for the record: half-sine of 50 N and 0.41 ms on AZ3 at t = 2 ms, sample n at t
    // = n / fs.
    let hit = [ForceSegment::half_sine(2e-3, 4.1e-4, 50.0)];
    let mut errors = vec![Vec::new(); 5];
    for (n, row) in record.iter().enumerate() {
        for (channel, error) in errors.iter_mut().enumerate() {
            error.push(row[channel] - stepper.signals()[3 + channel]);
        }
        let (from_s, to_s) = (n as f64 * period_s, (n + 1) as f64 * period_s);
        stepper.advance(Span::Scan, &ScanForces { from_s, to_s, hammer: &hit, shaker_n: 0.0 });
    }
    // The record's noise: 0.05 µm/s/√Hz up to 25.6 kHz, 0.02 N; any offset is subtracted here.
    let noise = [8e-6, 8e-6, 0.02, 0.02, 0.02];
    for (channel, error) in errors.iter().enumerate() {
        let mean = error.iter().sum::<f64>() / error.len() as f64;
        let rms = (error.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / error.len() as f64).sqrt();
        println!("{channel}: {rms:.3e}, offset {mean:.2e}");
        // 3000 samples give an rms to 1.3 %; four times that.
        assert!((rms / noise[channel] - 1.0).abs() < 0.055, "channel {channel}: {rms:.3e}");
    }
}
