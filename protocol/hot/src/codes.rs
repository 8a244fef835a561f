//! Detects codes at either end of the converter's range.

/// Whether any code is at either end of the range.
#[must_use]
pub fn is_over(codes: &[[u8; 2]]) -> bool {
    codes.iter().any(|pair| matches!(i16::from_le_bytes(*pair), i16::MAX | i16::MIN))
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
