//! Maps a panel's values to positions on the drawing.

use super::drawing::Area;

use crate::report::scale::Scale;

/// A panel with its frame and axes in pixels.
pub struct PanelFrame {
    /// The frame.
    pub area: Area,
    /// The horizontal axis.
    pub x: Scale,
    /// The vertical axis.
    pub y: Scale,
}
