//! Frequency-based substructuring: the joint's dynamic stiffness from FRFs of A, B and the assembly
//! AJB.
//!
//! Pure functions of arrays and geometry. The modules, in order of use:
//!
//! 1. [`frf`](crate::frf): FRF matrices with named rows and columns, converted to receptances by
//!    dividing by s = σ + iω.
//! 2. [`geometry`]: positions of the points and their purpose (`Grouping`).
//! 3. [`idm`], [`vpt`]: measured points onto the motions of one virtual point, or of any number;
//!    [`quality`] measures what is lost.
//! 4. [`decoupling`]: the methods, all returning Z^J per line; [`pseudo_inverse`] inverts
//!    without truncating.
//! 5. [`joint_over_bands`]: K and C per line and over bands, with scatter, interval and warnings.
//! 6. [`identify`](mod@identify): the entry point for all of the above;
//!    [`line_noise`](mod@line_noise): the effect of the FRFs' noise on each line of a result.
//! 7. [`averaged`](mod@averaged): the recommended estimate with its interval, and the bootstrap
//!    over hits. Both start from [`noise`](crate::frf::noise).
//! 8. [`fit`]: K and C by maximum likelihood over all measured blocks;
//!    [`between_arms`](mod@between_arms): chooses between the two estimates.
//! 9. [`coupling`]: the inverse problem, from parts to the assembly; [`cmif`](mod@cmif): how many
//!    modes the interface needs; [`BackCoupling`](coupling::BackCoupling): whether the identified
//!    joint reproduces the measured assembly, and [`explained`]: which errors may prevent it;
//!    [`quality`] also checks passivity and reciprocity; [`semm`](mod@semm): a model corrected by a
//!    measurement.
//!
//! All FRFs of a campaign must share one exponential window: every method is algebraic in s, so it
//! is exact on s = σ + iω, but only if A, B and AJB are on the same s. Degrees of freedom are
//! ordered x, y, z, rx, ry, rz.

pub mod averaged;
pub mod between_arms;
pub mod cmif;
pub mod coupling;
pub mod decoupling;
pub mod direct;
#[cfg(test)]
mod exact_rig_tests;
pub mod explained;
pub mod fit;
pub mod geometry;
pub mod identify;
pub mod idm;
mod interface_data;
pub mod joint_over_bands;
pub mod line_noise;
pub mod method;
mod product;
pub mod pseudo_inverse;
pub mod quality;
mod reduced;
pub mod semm;
pub mod vpt;

pub use crate::band::Band;
pub use crate::frf::common_lines::CommonLines;
pub use crate::frf::{Frf, FrfError, MotionQuantity};
pub use crate::structure::{Abc, Structure};
pub use geometry::{Configuration, Geometry, Grouping, Point};
pub use identify::{
    Decoupled, Identification, IdentifyError, Refused, decouple, identify, keep_common_lines, line_noise,
};
pub use idm::{Dof, IdmSet};
pub use joint_over_bands::{BandStatistic, JointRow, JointSpectrum};
pub use method::Method;
pub use quality::{Internals, VirtualPointQuality};
