//! Steady parts of a shaker's recording.
