//! Sum over one channel in a block of scans.

/// Sum of every `channels`-th code, starting at index `place`; 0 when `channels` is 0.
#[inline(never)]
#[must_use]
pub fn sum(codes: &[[u8; 2]], channels: usize, place: usize) -> i32 {
    let column = codes.get(place..).unwrap_or_default();
    if channels == 0 {
        return 0;
    }
    column.iter().step_by(channels).map(|code| i32::from(i16::from_le_bytes(*code))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_is_summed() {
        let codes: [[u8; 2]; 12] =
            core::array::from_fn(|i| (i as u16).cast_signed().wrapping_sub(6).to_le_bytes());
        assert_eq!(sum(&codes, 4, 1), -5 - 1 + 3);
        assert_eq!(sum(&codes, 4, 12), 0);
        assert_eq!(sum(&codes, 0, 1), 0);
        assert_eq!(sum(&[i16::MIN.to_le_bytes(); 12], 1, 0), 12 * i32::from(i16::MIN));
    }
}
