//! campaign

pub mod verdict;
