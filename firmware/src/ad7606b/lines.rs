//! How many DOUT lines a chip answers on.

/// Lines on which data comes out at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Lines {
    /// DOUTA.
    One,
    /// DOUTA and DOUTB.
    Two,
    /// DOUTA to DOUTD.
    Four,
    /// DOUTA to DOUTH (AD7606C only).
    Eight,
}

impl Lines {
    /// Its code in the CONFIG register.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// How many there are.
    #[must_use]
    pub const fn count(self) -> usize {
        1 << self as u8
    }
}
