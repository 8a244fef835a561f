//! Which FRFs the report shows: a driving point and a transfer of every configuration.

use super::averages::CellAverage;
use crate::results::{FrfCurve, Role, rounded};
use crate::spectra::MotionQuantity;
use crate::substructuring::geometry::{Configuration, Grouping, Point};
use num_complex::Complex;
use std::f64::consts::TAU;

/// Driving point: the response along z nearest to an impact along z. Transfer: the same impact, across the joint in
/// the assembly, at the far end otherwise.
pub fn curves(
    configuration: &str,
    points: &Configuration,
    cells: &[CellAverage],
    sigma_per_s: f64,
    quantity: MotionQuantity,
) -> Vec<FrfCurve> {
    let along_z = |p: &&Point| p.direction[2].abs() > 0.9;
    let mut pairs: Vec<(&Point, &Point, &CellAverage, f64)> = Vec::new();
    for impact in points.impacts.iter().filter(along_z) {
        for channel in points.channels.iter().filter(along_z) {
            let cell = cells.iter().find(|c| c.name.impact == impact.name && c.name.response == channel.name);
            if let Some(cell) = cell {
                pairs.push((impact, channel, cell, (impact.position() - channel.position()).norm()));
            }
        }
    }
    let same_side = |a: &Point, b: &Point| on_a(a.grouping) == on_a(b.grouping);
    let driving = pairs
        .iter()
        .filter(|(i, c, ..)| same_side(i, c))
        // in the assembly the joint is excited from A
        .min_by(|x, y| {
            (!on_a(x.0.grouping), x.3)
                .partial_cmp(&(!on_a(y.0.grouping), y.3))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
    let Some(driving) = driving else { return Vec::new() };
    let others = || pairs.iter().filter(|(i, c, ..)| i.name == driving.0.name && c.name != driving.1.name);
    let across = others().filter(|(i, c, ..)| !same_side(i, c)).min_by(|x, y| x.3.total_cmp(&y.3));
    let transfer = across.or_else(|| others().max_by(|x, y| x.3.total_cmp(&y.3)));
    [(Role::DrivingPoint, Some(driving)), (Role::Transfer, transfer)]
        .into_iter()
        .filter_map(|(role, pair)| {
            let (impact, channel, cell, _) = pair?;
            Some(curve(configuration, role, impact, channel, cell, sigma_per_s, quantity))
        })
        .collect()
}

/// A point of each arm along z from `impact`, in the assembly: what the specimens are compared with.
pub fn arms(
    impact: &str,
    points: &Configuration,
    cells: &[CellAverage],
    sigma_per_s: f64,
    quantity: MotionQuantity,
) -> Vec<FrfCurve> {
    let Some(hit) = points.impacts.iter().find(|p| p.name == impact) else { return Vec::new() };
    let arm = |role: Role, grouping: Grouping| {
        let measured = |channel: &&Point| channel.grouping == grouping && channel.direction[2].abs() > 0.9;
        points.channels.iter().filter(measured).find_map(|channel| {
            let own = |c: &&CellAverage| c.name.impact == impact && c.name.response == channel.name;
            let cell = cells.iter().filter(|c| c.name.configuration == "AJB").find(own)?;
            Some(curve("AJB", role, hit, channel, cell, sigma_per_s, quantity))
        })
    };
    let both = [arm(Role::ArmA, Grouping::InterfaceA), arm(Role::ArmB, Grouping::InterfaceB)];
    both.into_iter().flatten().collect()
}

fn on_a(grouping: Grouping) -> bool {
    matches!(grouping, Grouping::InterfaceA | Grouping::InternalA)
}

fn curve(
    configuration: &str,
    role: Role,
    impact: &Point,
    channel: &Point,
    cell: &CellAverage,
    sigma_per_s: f64,
    quantity: MotionQuantity,
) -> FrfCurve {
    let order = quantity.frf().order_of_s();
    // receptance along the two directions, hit and response both counted positive along z: a driving point starts at 0°
    let sign = impact.direction[2].signum();
    let receptance = cell.h1[2]
        .iter()
        .zip(&cell.frequency_hz)
        .map(|(h, f)| h * sign * Complex::new(sigma_per_s, TAU * f).powi(-order));
    let (magnitude_m_per_n, phase_deg) =
        receptance.map(|y| (rounded(y.norm(), 5), rounded(y.arg().to_degrees(), 5))).unzip();
    let coherence = if cell.records.len() > 1 {
        cell.coherence[2].iter().map(|c| rounded(if c.is_finite() { *c } else { 0.0 }, 5)).collect()
    } else {
        Vec::new()
    };
    FrfCurve {
        configuration: configuration.into(),
        role,
        output: channel.description.clone(),
        input: impact.name.clone(),
        hits: cell.records.len(),
        first_hz: cell.frequency_hz.first().copied().unwrap_or(0.0),
        step_hz: cell.step_hz,
        magnitude_m_per_n,
        phase_deg,
        coherence,
    }
}
