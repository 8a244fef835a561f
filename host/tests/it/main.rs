//! Integration tests of the library and the command, one program so that it is linked once.

mod accuracy;
mod averaged;
mod between_arms;
mod bridge;
mod cmif;
mod cut;
mod decoupling_reference;
mod explained;
mod fit;
mod hammer_slip;
mod hysteresis;
mod hysteresis_reference;
mod identify;
mod identities;
mod imported;
mod kept_files;
mod line_noise;
mod malformed;
mod records;
mod rewrites;
mod scripted_device;
mod shaker;
#[cfg(feature = "sim")]
mod simulated;
mod spectra_reference;
mod untrusted_files;
mod verdict;
mod verdict_reference;
mod words;
