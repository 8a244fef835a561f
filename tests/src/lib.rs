//! Whole-system scenarios live in this package.
