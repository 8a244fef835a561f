//! Signed directions of labels: ±1, 2, 3 along x, y, z. A value is along its label's signed
//! direction; this module compares it with the direction that a plan or a geometry gives for the
//! same point.

/// A label's direction for messages, such as `+z`; `None` where it is not along an axis.
pub fn axis_name(direction: i64) -> Option<String> {
    let axis = ["x", "y", "z"].get(usize::try_from(direction.unsigned_abs()).ok()?.checked_sub(1)?)?;
    Some(format!("{}{axis}", if direction < 0 { '−' } else { '+' }))
}

/// A direction of a plan or a geometry for messages: `−z`, or its three numbers.
pub fn vector_name(direction: [f64; 3]) -> String {
    match along(direction) {
        Some(axis) => axis_name(axis).unwrap_or_default(),
        None => format!("({})", direction.map(|v| format!("{}", (v * 1e3).round() / 1e3)).join(", ")),
    }
}

/// Least component with which a direction of three printed digits counts as along an axis.
const ALONG: f64 = 0.999;

/// ±1, 2, 3 where a unit vector is along an axis, else `None`.
pub(super) fn along(direction: [f64; 3]) -> Option<i64> {
    let found = (1..).zip(direction).find(|(_, part)| part.abs() > ALONG);
    found.map(|(axis, part)| if part < 0.0 { -axis } else { axis })
}

/// How a label's direction relates to the direction of its point in a plan or a geometry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beside {
    /// The same direction, or the label has none.
    Same,
    /// The opposite: the value changes its sign.
    Opposite,
    /// The point's direction is along no axis and makes an angle over 60° with the label's axis. A
    /// label cannot express such a direction, so it must refer to the sensor's own axes.
    Untold,
    /// Another axis.
    Other,
}

/// Compares a label's direction with that of its point.
pub fn beside(label: i64, direction: [f64; 3]) -> Beside {
    let Some(part) =
        usize::try_from(label.unsigned_abs()).ok().and_then(|axis| direction.get(axis.checked_sub(1)?))
    else {
        return Beside::Same;
    };
    let part = if label < 0 { -part } else { *part };
    match part {
        0.5.. => Beside::Same,
        ..=-0.5 => Beside::Opposite,
        _ if along(direction).is_none() => Beside::Untold,
        _ => Beside::Other,
    }
}

/// `A1 along −z turned`; lists at most five names.
pub(super) fn turned_words(turned: &[(String, i64)]) -> Option<String> {
    let named = |(name, direction): &(String, i64)| match axis_name(*direction) {
        Some(axis) => format!("{name} along {axis}"),
        None => name.clone(),
    };
    let first: Vec<String> = turned.iter().take(5).map(named).collect();
    let more = turned.len().saturating_sub(first.len());
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    (!first.is_empty()).then(|| format!("{}{more} turned", first.join(", ")))
}

/// As [`vector_name`], for several directions.
pub(super) fn vector_names(all: &[[f64; 3]]) -> String {
    all.iter().map(|axis| vector_name(*axis)).collect::<Vec<_>>().join(", ")
}
