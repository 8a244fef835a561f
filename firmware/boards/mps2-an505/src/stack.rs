//! The stack's high-water mark.
