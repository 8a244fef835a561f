//! The report
