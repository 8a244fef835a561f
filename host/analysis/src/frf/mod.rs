//! Frequency response functions: one complex matrix per line, what its values are, and their noise.

mod matrix;
pub mod noise;
mod quantity;

pub(crate) use matrix::block;
pub use matrix::{FrfError, FrfMatrix};
pub use noise::FrfNoise;
pub use quantity::{MotionQuantity, Quantity};
