//! spectra
pub mod records;
pub use records::{ImpactRecords, MotionQuantity};
