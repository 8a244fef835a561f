//! The rig in software.
