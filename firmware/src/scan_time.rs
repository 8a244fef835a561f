//! Conversions between times and scans without 64-bit division: this processor has none, and the
//! code for it takes a kilobyte of flash.

/// Number of scans in `ms`, rounded down; exact for times up to a day at any rate below 4 MHz.
pub(crate) fn scans_in_ms(ms: u32, rate_hz: u32) -> u64 {
    u64::from(ms / 1000) * u64::from(rate_hz) + u64::from(ms % 1000 * rate_hz / 1000)
}

/// Duration of `scans` in ms, with a relative accuracy of 1e-6. Durations above 2³² scans saturate.
pub(crate) fn ms_of_scans(scans: u64, rate_hz: u32) -> u32 {
    (u32::try_from(scans).unwrap_or(u32::MAX) as f32 * (1000.0 / rate_hz as f32)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_agree_with_the_division() {
        for rate_hz in [1, 48_000, 51_200, 102_400] {
            for ms in [0, 1, 999, 1000, 1001, 59_999, 60_000, 86_400_000] {
                assert_eq!(scans_in_ms(ms, rate_hz), u64::from(ms) * u64::from(rate_hz) / 1000);
            }
            for scans in [0_u64, 51, 51_200, 3_072_000] {
                let exact = scans * 1000 / u64::from(rate_hz);
                let off = u64::from(ms_of_scans(scans, rate_hz)).abs_diff(exact);
                assert!(off <= 1 + exact / 1_000_000, "{scans} at {rate_hz}");
            }
        }
    }
}
