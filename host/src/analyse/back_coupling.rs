//! The check whether A and B, coupled by the joint found, are the measured assembly.

use crate::results::number::short;
use crate::results::{Check, MAIN_BAND};
use crate::substructuring::explained::{BEYOND, Explained, USUAL};

/// Name of the check.
pub const BACK_COUPLING: &str = "back-coupling";

/// Up to here the default bands reach; what lies above costs no result, Hz.
const USED_HZ: f64 = 800.0;
/// Where errors of position and noise alone may be off by this part, nothing can be told.
const BLIND: f64 = 1.0;

/// From where to where the joint of the main band, with A and B, describes the assembly.
pub fn check(found: &Explained) -> Option<Check> {
    let [error, explained] = found.medians(MAIN_BAND)?;
    let last = *found.frequency_hz.last()?;
    let percent = |part: f64| if part < 1e-3 { "less than 0.1".into() } else { short(100.0 * part) };
    let sizes = format!(
        "in the main band they are {} % off, and noise and errors of position explain {} %",
        percent(error),
        percent(explained)
    );
    let coupled = "A and B, coupled by the joint of Eq. A.1 (its mean over the main band)";
    let whole = |range: Option<[f64; 2]>| {
        range.is_some_and(|[from, to]| from <= MAIN_BAND.low_hz && to >= USED_HZ.min(last))
    };
    let check = match found.range(MAIN_BAND, BEYOND) {
        _ if explained > BLIND => Check::new(
            BACK_COUPLING,
            None,
            format!("Whether {coupled}, are the measured assembly cannot be told: {sizes}."),
        ),
        range if whole(range) && !whole(found.range(MAIN_BAND, USUAL)) => Check::new(
            BACK_COUPLING,
            None,
            format!(
                "{coupled}, give the measured assembly no worse than {} times what noise and errors of position explain ({sizes}): too little to call it another path, too \
                 much to exclude one.",
                short(BEYOND)
            ),
        ),
        Some([from, to]) if whole(Some([from, to])) => Check::new(
            BACK_COUPLING,
            Some(true),
            format!(
                "{coupled}, give the measured assembly from {} to {} Hz: {sizes}. Nothing shows another path between A and B.",
                short(from),
                short(to)
            ),
        ),
        Some([from, to]) if from <= MAIN_BAND.low_hz && to >= MAIN_BAND.high_hz => Check::new(
            BACK_COUPLING,
            Some(false),
            format!(
                "{coupled}, give the measured assembly up to {} Hz ({sizes}), but not above: another path couples A and B there (springs or a foundation that \
                 both stand on), or the joint has a mass. Use no lines above it.",
                short(to)
            ),
        )
        .at(to),
        Some([from, to]) => Check::new(
            BACK_COUPLING,
            Some(false),
            format!(
                "{coupled}, give the measured assembly only from {} to {} Hz: {sizes}. Elsewhere a single stiffness does not describe what was measured: A or B changed, \
                 another path couples them, or the joint is no spring and damper.",
                short(from),
                short(to)
            ),
        )
        .at(if to < MAIN_BAND.high_hz { to } else { from }),
        None => Check::new(
            BACK_COUPLING,
            Some(false),
            format!(
                "{coupled}, do not give the measured assembly: {sizes}. The joint is no spring and damper, A or B changed between the configurations, \
                 or another path couples them."
            ),
        ),
    };
    Some(check.with("median_error", error).with("median_explained", explained))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An error of 2 % below a frequency and of `above` from there on, where errors of position explain 6 %.
    fn found(edge_hz: f64, above: f64) -> Explained {
        let frequency_hz: Vec<f64> = (10..1000).map(f64::from).collect();
        Explained {
            error: frequency_hz.iter().map(|f| if *f < edge_hz { 0.02 } else { above }).collect(),
            explained: vec![0.06; frequency_hz.len()],
            frequency_hz,
        }
    }

    #[test]
    fn what_errors_of_position_explain_is_no_finding() {
        let fine = check(&found(500.0, 0.1)).expect("lines");
        assert_eq!(fine.ok, Some(true), "{}", fine.meaning);
        assert!((fine.values["median_explained"] - 0.06).abs() < 1e-12);
        let between = check(&found(500.0, 0.2)).expect("lines");
        assert_eq!(between.ok, None, "{}", between.meaning);
        let mut blind = found(500.0, 0.15);
        blind.explained.fill(1.5);
        assert_eq!(check(&blind).expect("lines").ok, None);
    }

    #[test]
    fn a_path_above_a_frequency_is_named_with_it() {
        let path = check(&found(700.0, 0.6)).expect("lines");
        assert_eq!((path.ok, path.frequency_hz), (Some(false), Some(699.0)));
        assert!(path.meaning.contains("Use no lines above"), "{}", path.meaning);
        // beyond what any band uses it costs nothing
        assert_eq!(check(&found(900.0, 0.6)).expect("lines").ok, Some(true));
        // in the main band it is not a path above
        let inside = check(&found(500.0, 0.6)).expect("lines");
        assert_eq!((inside.ok, inside.frequency_hz), (Some(false), Some(499.0)));
        assert!(check(&found(0.0, 0.6)).expect("lines").meaning.contains("do not give"));
    }
}
