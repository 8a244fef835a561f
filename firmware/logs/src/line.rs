//! What is read of a controller's log.

use log::Level;

/// One line of a controller's log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// How important it is; a line without a level counts as information.
    pub level: Level,
    /// The device's time in seconds, where the image tells it, and the text.
    pub text: String,
}
