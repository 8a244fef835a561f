//! Expected size of the coefficients of the force's form, from the stiffness that the load cells
//! show.

use super::block::{Block, Group};
use super::parameters::{FORM, Parameters};
use std::f64::consts::TAU;

/// Stiffness parallel to the load cells, relative to theirs, K = |T/z_B|.
const BESIDE: f64 = 0.5;

/// Damping over K, s.
const DAMPING_S: f64 = 3e-5;

/// Arm B's mass resonates on K above this frequency, Hz.
const LOWEST_HZ: f64 = 250.0;

/// Sets the priors of the form: for z_B these values, for rotations the same times the lever arm of
/// arm B's points. They keep the form from fitting noise where the hits hardly determine it.
pub fn scale_form(parameters: &mut Parameters, blocks: &[Block]) {
    let mut stiffness: Vec<f64> = Vec::new();
    let mut lever_m: f64 = 0.0;
    let start = |at: usize| parameters.all()[at].start;
    for block in blocks.iter().filter(|b| b.along_z.is_some_and(|at| start(at).abs() > 0.5)) {
        let place = |channel| block.rows.iter().position(|row| row.cell == 0 && row.channel == channel);
        if let (Some(t), Some(spot)) = (place(0), place(1)) {
            stiffness.extend(block.lines.iter().map(|line| (line.value[t] / line.value[spot]).norm()));
        }
        for cell in block.cells.iter().filter(|cell| cell.group == Group::ArmB) {
            lever_m = lever_m.max(start(cell.point).hypot(start(cell.point + 1)));
        }
    }
    stiffness.sort_by(f64::total_cmp);
    let Some(k) = stiffness.get(stiffness.len() / 2).copied() else { return };
    let mass = k / (TAU * LOWEST_HZ).powi(2);
    for (term, sigma) in [BESIDE * k, DAMPING_S * k, mass].into_iter().enumerate() {
        for (of, lever) in [1.0, lever_m, lever_m].into_iter().enumerate() {
            parameters.narrow(FORM + 2 + 3 * of + term, sigma * lever);
        }
    }
}
