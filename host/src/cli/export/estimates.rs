//! Every stiffness estimate, one row each.

use crate::exchange::typed_table::{Kind, Table, Value};
use crate::results::{Joint, Results};
use crate::substructuring::Band;
use crate::substructuring::Dof;

/// `method` is `contact` and `between-arms` for the result, `recommended`, or a decoupling method;
/// `ci95_low`, `ci95_high` are missing if no interval is known; `identified` is 1 or 0, and missing
/// in directions other than the sliding direction, which are not judged.
const ESTIMATES: [(&str, Kind); 10] = [
    ("method", Kind::Text),
    ("idms", Kind::Whole),
    ("band_low_hz", Kind::Real),
    ("band_high_hz", Kind::Real),
    ("dof", Kind::Text),
    ("stiffness_n_per_m", Kind::Real),
    ("ci95_low", Kind::Real),
    ("ci95_high", Kind::Real),
    ("identified", Kind::Whole),
    ("why", Kind::Text),
];

/// The result, the recommended estimates, every method, and refused estimates.
pub(super) fn table(results: &Results) -> Table {
    let mut table = Table::new(&ESTIMATES);
    if let Some(answer) = &results.answer {
        let contact = answer.contact.k_t_n_per_m;
        let band = answer.contact.band_hz.map(|[low_hz, high_hz]| Band { low_hz, high_hz });
        let why = answer.contact.why.as_str();
        row(
            &mut table,
            ("contact", None, band, "z"),
            contact.map(|k| k.mean),
            contact.map(|k| k.ci95),
            Some(contact.is_some()),
            why,
        );
        let arms = answer.between_arms.k_n_per_m;
        let why = answer.between_arms.why.as_str();
        row(
            &mut table,
            ("between-arms", None, None, "z"),
            arms.map(|k| k.mean),
            arms.map(|k| k.ci95),
            Some(arms.is_some()),
            why,
        );
    }
    for averaged in &results.recommended {
        for (dof, found) in averaged.joint.iter().filter(|(dof, _)| [Dof::X, Dof::Y, Dof::Z].contains(dof)) {
            let of = ("recommended", Some(averaged.idms), Some(averaged.band_hz), dof.name());
            row(&mut table, of, Some(found.stiffness), Some(found.ci95), Some(found.identified), "");
        }
    }
    for joint in &results.joint {
        for (dof, found) in &joint.stiffness_n_per_m {
            let of = (joint.method.as_str(), Some(joint.idms), Some(joint.band_hz), dof.as_str());
            row(&mut table, of, Some(found.mean), found.ci95, judged(joint, dof), &joint.warnings.join("; "));
        }
    }
    for refused in &results.refused {
        let of = (refused.method.as_str(), Some(refused.idms), None, "");
        row(&mut table, of, None, None, Some(false), &refused.reason);
    }
    table
}

/// Whether it is identified; only the sliding direction is judged.
fn judged(joint: &Joint, dof: &str) -> Option<bool> {
    (dof == Dof::Z.name()).then(|| joint.identified())
}

/// Method, modes, band and direction of an estimate.
type Of<'a> = (&'a str, Option<usize>, Option<Band>, &'a str);

fn row(
    table: &mut Table,
    (method, idms, band, dof): Of<'_>,
    mean: Option<f64>,
    ci95: Option<[f64; 2]>,
    identified: Option<bool>,
    why: &str,
) {
    let text = |text: &str| if text.is_empty() { Value::Missing } else { text.into() };
    table.push(vec![
        method.into(),
        idms.into(),
        band.map(|band| band.low_hz).into(),
        band.map(|band| band.high_hz).into(),
        text(dof),
        mean.into(),
        ci95.map(|[low, _]| low).into(),
        ci95.map(|[_, high]| high).into(),
        identified.map(u8::from).into(),
        text(why),
    ]);
}
