//! Frequency response functions: one complex matrix per line, the quantity of its values, and their
//! noise.

pub mod common_lines;
mod matrix;
pub mod noise;

pub use matrix::COHERENCE_ROUNDING;
pub use matrix::Frf;
pub use matrix::FrfError;
pub use matrix::MotionQuantity;
pub(crate) use matrix::block;
