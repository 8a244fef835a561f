//! Numbers on the command line.

/// A finite number over 0.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("write a number over 0".into()),
    }
}

/// A finite number of 0 or more.
pub fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value >= 0.0 && value.is_finite() => Ok(value),
        _ => Err("write a number that is not negative".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_and_what_is_no_number_are_refused() {
        assert_eq!((positive("1e-7"), not_negative("0")), (Ok(1e-7), Ok(0.0)));
        for wrong in ["0", "-1", "nan", "inf", "x", ""] {
            assert!(positive(wrong).is_err(), "{wrong}");
            assert!(not_negative(wrong).is_err() || wrong == "0", "{wrong}");
        }
    }
}
