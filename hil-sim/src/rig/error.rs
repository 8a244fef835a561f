//! What can be wrong with a rig or with what is asked of it.

use super::Configuration;

/// What went wrong, where, and what to do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RigError {
    /// The rig file is not a rig file.
    #[error("rig file{}: {reason}", line.map(|line| format!(", line {line}")).unwrap_or_default())]
    Document {
        /// Line of the file, from 1.
        line: Option<usize>,
        /// What is wrong, in words.
        reason: String,
    },
    /// A field has a value that no rig can have.
    #[error("rig field {field}{} {reason}", line.map(|line| format!(" (line {line})")).unwrap_or_default())]
    Field {
        /// Path of the field.
        field: String,
        /// What is wrong with it.
        reason: String,
        /// Line of the rig file, from 1, where the file sets it.
        line: Option<usize>,
    },
    /// No such impact or response point in this configuration.
    #[error("no {kind} point {name:?} in configuration {configuration}; there are: {}", valid.join(", "))]
    UnknownPoint {
        /// `impact` or `response`.
        kind: &'static str,
        /// The name asked for.
        name: String,
        /// The configuration on the rig.
        configuration: Configuration,
        /// The names that would do.
        valid: Vec<String>,
    },
    /// A point was asked for on a body that this configuration does not have.
    #[error("a point sits on {body}, which configuration {configuration} does not have")]
    MissingBody {
        /// The body.
        body: String,
        /// The configuration.
        configuration: Configuration,
    },
    /// The structure's matrices cannot be factored.
    #[error("configuration {configuration}: {what}; check masses, inertias and stiffnesses")]
    Structure {
        /// The configuration.
        configuration: Configuration,
        /// What failed.
        what: &'static str,
    },
}
