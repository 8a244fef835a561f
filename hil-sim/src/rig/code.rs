//! The converters: from a value in units of codes to the integer code.

/// Rounded to the nearest code, saturating.
#[inline]
pub(super) fn code(exact: f64) -> i16 {
    // At 1.5 · 2^52 the last bit of an f64 is one, so the sum rounds and its low bits are the
    // integer. Unlike a cast, this needs no branch, so the ten channels are vectorised. The
    // comparisons map NaN to the lower limit.
    const ONES_PLACE: f64 = 6_755_399_441_055_744.0;
    let above = if exact > -32768.0 { exact } else { -32768.0 };
    let within = if above < 32767.0 { above } else { 32767.0 };
    (within + ONES_PLACE).to_bits() as i16
}
