//! Sine of an angle in fractions of a turn, for the drive.
//!
//! micromath's sine is accurate to a thousandth, which would cause harmonics at −60 dB in the
//! drive; libm's uses double precision, which a Cortex-M33 computes in software. A polynomial over
//! a quarter turn avoids both drawbacks.

/// Taylor coefficients of sin(π/2 · x) in odd powers of x. The first omitted term bounds the error
/// by (π/2)¹¹/11! = 3.6e-6: a ninth of a 16-bit code.
const COEFFICIENTS: [f32; 5] = [1.570_796_4, -0.645_964_1, 0.079_692_63, -0.004_681_754, 0.000_160_441_2];

/// sin of `angle`, in units of 2⁻³² turn. Error below 4e-6.
pub fn sine(angle: u32) -> f32 {
    // −1 to 1 over the half turn around zero; the other half turn is its mirror image
    let quarters = angle.cast_signed();
    let folded = if (-0x4000_0000..=0x4000_0000).contains(&quarters) {
        quarters
    } else {
        i32::MIN.wrapping_sub(quarters)
    };
    let x = folded as f32 / 1_073_741_824.0;
    let square = x * x;
    x * COEFFICIENTS.iter().rev().fold(0.0, |sum, coefficient| sum * square + coefficient)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_sine_within_its_bound_all_around() {
        let mut worst = 0.0_f64;
        for angle in (0..=u32::MAX).step_by(99_991) {
            let exact = (f64::from(angle) / 4_294_967_296.0 * core::f64::consts::TAU).sin();
            worst = worst.max((f64::from(sine(angle)) - exact).abs());
        }
        assert!(worst < 4e-6, "{worst}");
    }

    #[test]
    fn quarters_are_exact_enough_and_the_halves_mirror() {
        assert_eq!(sine(0), 0.0);
        assert!((sine(1 << 30) - 1.0).abs() < 4e-6);
        assert!(sine(1 << 31).abs() < 1e-9);
        assert!((sine(3 << 30) + 1.0).abs() < 4e-6);
        for angle in [1_u32, 77_777, 1 << 29, (1 << 30) + 5] {
            assert_eq!(sine(angle), -sine(angle.wrapping_neg()));
        }
    }
}
