//! substructuring
