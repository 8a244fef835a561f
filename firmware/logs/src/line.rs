//! A decoded line of a controller's log.

use log::Level;

/// One line of a controller's log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// Severity; a line without a level counts as information.
    pub level: Level,
    /// The device's time in seconds, if the image contains it, followed by the text.
    pub text: String,
}
