//! The figures, one file each: results in, an SVG text out, or nothing when the results lack the data.

mod backbone;
mod comparison;
mod contact_loop;
mod impacts;
mod interface_modes;
mod joint_spectrum;
mod levels;
mod rebuilt;
mod receptances;
mod shaker_loops;
mod specimens;

pub use backbone::backbone;
pub use comparison::comparison;
pub use contact_loop::contact_loop;
pub use impacts::impacts;
pub use interface_modes::interface_modes;
pub use joint_spectrum::joint_spectrum;
pub use levels::levels;
pub use rebuilt::rebuilt;
pub use receptances::receptances;
pub use shaker_loops::shaker_loops;
pub use specimens::specimens;

use super::drawing::Stroke;
use super::panel::{BLUE, GREEN, VERMILION};

/// Width of every figure, in the drawing's own pixels.
const WIDTH: f64 = 1040.0;

/// The line of an IDM set, the same in every figure.
fn idm_stroke(idms: usize) -> Stroke {
    match idms {
        2 => Stroke::new(GREEN, 1.0),
        4 => Stroke::new(VERMILION, 1.0),
        _ => Stroke::new(BLUE, 1.3),
    }
}
