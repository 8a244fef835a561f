//! Log macros: `defmt` on a board, `log` on a PC, no output when neither feature is enabled.
#![allow(unused_macros, reason = "one set of macros for every level, whether or not each is used today")]

macro_rules! info {
    ($($args:tt)*) => {{
        #[cfg(feature = "defmt")]
        defmt::info!($($args)*);
        #[cfg(all(feature = "log", not(feature = "defmt")))]
        log::info!($($args)*);
    }};
}

macro_rules! warning {
    ($($args:tt)*) => {{
        #[cfg(feature = "defmt")]
        defmt::warn!($($args)*);
        #[cfg(all(feature = "log", not(feature = "defmt")))]
        log::warn!($($args)*);
    }};
}

pub(crate) use {info, warning};
