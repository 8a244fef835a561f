//! spectra
