//! Frequency response functions: one complex matrix per line, what its values are, and their noise.

mod checks;
mod error;
mod matrix;
pub mod noise;
mod quantity;

pub use error::FrfError;
pub use matrix::Frf;
pub(crate) use matrix::block;
pub use quantity::MotionQuantity;
