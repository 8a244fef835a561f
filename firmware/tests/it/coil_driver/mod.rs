//! The hammer's coil driver and its guard chain, modelled as circuits (docs/WIRING.md): the gate
//! for every input at 0, at 1 and disconnected, the longest pulse and the shortest pause that the
//! hardware alone permits, and whether levels, currents and times suit the parts.
//!
//! docs/WIRING.md and docs/safety.md contain the tables that these tests generate, verbatim.
#![allow(clippy::unwrap_used)]

mod chain;
mod driver;
mod levels;
mod one_shot;
mod states;
mod timing;
mod truth_table;

use std::path::Path;

/// Asserts that a page of the documentation contains these lines.
fn page_holds(page: &str, lines: &[String]) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs").join(page);
    let text = std::fs::read_to_string(&path).unwrap();
    let wanted = lines.join("\n");
    assert!(text.contains(&wanted), "docs/{page} must say what the circuit does:\n\n{wanted}\n");
}
