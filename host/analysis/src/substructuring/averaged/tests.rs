use super::*;
use crate::substructuring::exact_rig_tests::rig;

const BAND: Band = Band { low_hz: 300.0, high_hz: 600.0 };
const NOWHERE_WRONG: Priors = Priors { position_m: 0.0, aim_m: 0.0, hammer_angle_rad: 0.0 };

/// The propagation compared with the effect of actually moving sensors and impacts, for a degree of
/// freedom where it matters.
#[test]
fn the_sensitivity_is_the_difference_quotient() {
    let ([_, _, ajb], geometry) = rig();
    // without priors all weights are equal, whatever is moved
    let estimate = |geometry: &Geometry, dof: Dof| {
        averaged(&ajb, geometry, IdmSet::Six, BAND, &NOWHERE_WRONG).expect("exact data").joint[&dof].stiffness
    };
    let mut squares = BTreeMap::from([(Dof::Z, 0.0), (Dof::Rx, 0.0)]);
    let step = 1e-7;
    let mut moved = Vec::new();
    for axis in 0..3 {
        for name in ["A1", "A2", "A3", "B1", "B2", "B3"] {
            let mut one = geometry.clone();
            one.ajb.channels.iter_mut().filter(|p| p.name == name).for_each(|p| p.position_m[axis] += step);
            moved.push(one);
        }
        for i in 0..geometry.ajb.impacts.len() {
            let mut one = geometry.clone();
            one.ajb.impacts[i].position_m[axis] += step;
            moved.push(one);
        }
    }
    for (dof, square) in &mut squares {
        let base = estimate(&geometry, *dof);
        *square = moved.iter().map(|one| ((estimate(one, *dof) - base) / step).powi(2)).sum();
    }
    let one_metre = Priors { position_m: 1.0, ..NOWHERE_WRONG };
    let prepared = Prepared::of(&ajb, &geometry, IdmSet::Six, BAND, &NOWHERE_WRONG).expect("exact data");
    let propagated = |d: usize| {
        let y = SensitivitySums::weighted(&prepared.sums[d], prepared.weights[d].iter().copied())
            .geometry_variance(&one_metre)
            .sqrt();
        let k = prepared.estimate_of(d).stiffness;
        k * k * y * balance(IdmSet::Six)[d].powi(2)
    };
    let quotient = squares[&Dof::Rx].sqrt();
    // a one-sided difference quotient with steps of 1e-7 m over 4 cm, and the square of the loss
    // factor
    assert!((propagated(3) / quotient - 1.0).abs() < 1e-2, "{} against {quotient}", propagated(3));
    // k_z is the force without any rotation: a position error common to all cells does not affect
    // it, in spite of the 40 mm
    assert!(
        propagated(2) < 1e-6 * 180e6 / 0.04 && squares[&Dof::Z].sqrt() < 1e-3 * 180e6 / 0.04,
        "{squares:?}"
    );
}
