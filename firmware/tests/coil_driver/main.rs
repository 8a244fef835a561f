//! The hammer's coil driver and its guard chain as circuits (docs/WIRING.md): what the gate does
//! for every input at 0, at 1 and with its wire off, how long a pulse and how short a pause the
//! hardware alone allows, and whether levels, currents and times fit the parts.
//!
//! docs/WIRING.md and docs/safety.md hold the tables that these tests make, word for word.
#![allow(clippy::unwrap_used)]

mod chain;
mod driver;
mod levels;
mod one_shot;
mod states;
mod timing;
mod truth_table;

use std::path::Path;

/// Asserts that a page of the documentation holds these lines.
fn page_holds(page: &str, lines: &[String]) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs").join(page);
    let text = std::fs::read_to_string(&path).unwrap();
    let wanted = lines.join("\n");
    assert!(text.contains(&wanted), "docs/{page} must say what the circuit does:\n\n{wanted}\n");
}
