//! Frequency response functions: one complex matrix per line, the quantity of its values, and their
//! noise.

mod checks;
pub mod common_lines;
mod error;
mod matrix;
pub mod noise;
mod quantity;

pub use checks::COHERENCE_ROUNDING;
pub use error::FrfError;
pub use matrix::Frf;
pub(crate) use matrix::block;
pub use quantity::MotionQuantity;
