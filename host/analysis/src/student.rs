//! Quantiles of Student's t for 95 % intervals.

/// Half width of a 95 % interval in standard deviations, for a normal distribution.
pub const NORMAL_95: f64 = 1.96;

/// Student's t, two-sided 95 %, for 1…9 degrees of freedom.
const FEW: [f64; 9] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262];

/// Half width of a 95 % interval in standard deviations that were estimated with this many degrees
/// of freedom. Beyond nine: expansion in 1/ν around the normal quantile (Abramowitz and Stegun
/// 26.7.5), within 1e-3. Infinite without any.
pub fn student_95(freedom: usize) -> f64 {
    match freedom {
        0 => f64::INFINITY,
        1..=9 => FEW[freedom - 1],
        _ => {
            let (z, v) = (1.959_964_f64, freedom as f64);
            let first = (z.powi(3) + z) / 4.0;
            let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0;
            let third = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0;
            z + first / v + second / v.powi(2) + third / v.powi(3)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_the_tabulated_ones() {
        for (freedom, t) in [(1, 12.7062), (4, 2.7764), (9, 2.2622), (10, 2.2281), (12, 2.1788), (30, 2.0423)]
        {
            let own = student_95(freedom);
            assert!((own / t - 1.0).abs() < 1e-3, "{freedom}: {own}");
        }
        assert!(student_95(0).is_infinite() && student_95(100_000) < 1.96001);
    }
}
