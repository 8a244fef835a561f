//! Loops over the codes of a block of scans: the sum over one channel, and whether any code is at
//! either end of the converter's range.

/// Whether any code is at either end of the range.
#[must_use]
pub fn is_over(codes: &[[u8; 2]]) -> bool {
    codes.iter().any(|pair| matches!(i16::from_le_bytes(*pair), i16::MAX | i16::MIN))
}

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
    fn both_ends_are_seen_wherever_they_stand() {
        for end in [i16::MIN, i16::MAX] {
            for count in 1..=40 {
                for at in 0..count {
                    let mut codes = [[0x34, 0x12]; 40];
                    assert!(!is_over(&codes[..count]));
                    codes[at] = end.to_le_bytes();
                    assert!(is_over(&codes[..count]), "{end} at {at} of {count}");
                }
            }
        }
    }
}

#[cfg(test)]
mod column_tests {
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
