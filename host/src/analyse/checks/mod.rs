//! Checks of the credibility of the numbers: one file per check, with the figures behind it.

mod back_coupled;
mod contact_change;
mod enough_internals;
mod hidden_resonance;
mod rigid_motions;
mod same_structures;
mod series_compliance;

pub use back_coupled::{BackCoupled, Reach};
pub use contact_change::ContactChange;
pub use enough_internals::InternalsFound;
pub use hidden_resonance::HiddenResonance;
pub use rigid_motions::rigid_motions_suffice;
pub use same_structures::{SameStructures, Sameness};
pub use series_compliance::{SeriesCompliance, Sizes, at_the_specimens, between_the_arms};
