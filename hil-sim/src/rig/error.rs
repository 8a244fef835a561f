//! Errors of rig descriptions and of requests to a rig.

use super::Configuration;

/// What went wrong, where, and what to do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RigError {
    /// The rig file cannot be parsed.
    #[error("rig file{}: {reason}", line.map(|line| format!(", line {line}")).unwrap_or_default())]
    Document {
        /// Line of the file, from 1.
        line: Option<usize>,
        /// The reason, in words.
        reason: String,
    },
    /// A field has an invalid value.
    #[error("rig field {field}{} {reason}", line.map(|line| format!(" (line {line})")).unwrap_or_default())]
    Field {
        /// Path of the field.
        field: String,
        /// Why it is invalid.
        reason: String,
        /// Line of the rig file, from 1, where the file sets it.
        line: Option<usize>,
    },
    /// No such impact or response point in this configuration.
    #[error("no {kind} point {name:?} in configuration {configuration}; there are: {}", valid.join(", "))]
    UnknownPoint {
        /// `impact` or `response`.
        kind: &'static str,
        /// The requested name.
        name: String,
        /// The configuration on the rig.
        configuration: Configuration,
        /// The valid names.
        valid: Vec<String>,
    },
    /// The requested point is on a body that this configuration does not have.
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
