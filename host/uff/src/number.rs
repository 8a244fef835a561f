//! Decimal numbers as Fortran, C and Python write them.

/// 10⁰ … 10²², which f64 holds exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

/// Parses `word`, correctly rounded: exponents by e, E, d, D or by their sign alone (`1.5-101`);
/// also `nan` and `inf`.
pub(super) fn parse(word: &[u8]) -> Option<f64> {
    quick(word).or_else(|| thorough(word))
}

/// Numbers of up to 15 digits with small exponents, for which one exact multiplication or division
/// rounds correctly.
fn quick(word: &[u8]) -> Option<f64> {
    let (negative, mut rest) = match word {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] | rest => (false, rest),
    };
    let (mut mantissa, mut digits, mut exponent, mut after_point) = (0u64, 0, 0i32, false);
    while let [byte, tail @ ..] = rest {
        match byte {
            b'0'..=b'9' => {
                mantissa = mantissa * 10 + u64::from(byte - b'0');
                digits += 1;
                exponent -= i32::from(after_point);
                if digits > 15 {
                    return None;
                }
            }
            b'.' if !after_point => after_point = true,
            b'e' | b'E' | b'd' | b'D' => break,
            _ => return None,
        }
        rest = tail;
    }
    if digits == 0 {
        return None;
    }
    if let [_, tail @ ..] = rest {
        exponent += match tail {
            [b'+', a, b] if a.is_ascii_digit() && b.is_ascii_digit() => two(*a, *b),
            [b'-', a, b] if a.is_ascii_digit() && b.is_ascii_digit() => -two(*a, *b),
            _ => return None,
        };
    }
    let power = *POWERS.get(exponent.unsigned_abs() as usize)?;
    let value = if exponent < 0 { mantissa as f64 / power } else { mantissa as f64 * power };
    Some(if negative { -value } else { value })
}

fn two(a: u8, b: u8) -> i32 {
    i32::from(a - b'0') * 10 + i32::from(b - b'0')
}

/// All other numbers, with the standard library.
fn thorough(word: &[u8]) -> Option<f64> {
    let mut text = String::with_capacity(word.len() + 1);
    let mut last = ' ';
    for &byte in word {
        let c = match byte {
            b'd' | b'D' if last.is_ascii_digit() || last == '.' => 'e',
            b'0'..=b'9' | b'+' | b'-' | b'.' | b'a'..=b'z' | b'A'..=b'Z' => char::from(byte),
            _ => return None,
        };
        // an exponent without its letter
        if matches!(c, '+' | '-') && (last.is_ascii_digit() || last == '.') {
            text.push('e');
        }
        text.push(c);
        last = c;
    }
    text.parse().ok()
}

/// A count as an integer of the format.
pub(super) fn count(n: usize) -> i64 {
    i64::try_from(n).unwrap_or(i64::MAX)
}

/// `value` as printed by C's `%{width}.{digits}e`, with at most `digits` digits, and no more than
/// fit the column after one blank.
pub(super) fn print(out: &mut Vec<u8>, value: f64, width: usize, digits: usize) {
    use std::io::Write;
    let mut text = [0u8; 40];
    for digits in (0..=digits).rev() {
        let mut rest = &mut text[..];
        // 40 bytes are enough for any f64 of at most 17 digits, and writing to a slice cannot fail
        // otherwise
        let _ = write!(rest, "{value:.digits$e}");
        let length = 40 - rest.len();
        let text = &text[..length];
        // Rust writes e5 and e-5 where C and Fortran write e+05 and e-05; NaN and inf have no
        // exponent
        let (mantissa, exponent) = match text.iter().position(|b| *b == b'e') {
            Some(at) => (&text[..at], &text[at + 1..]),
            None => (text, &[][..]),
        };
        let (sign, figures): (&[u8], &[u8]) = match exponent {
            [] => (b"", b""),
            [b'-', figures @ ..] => (b"e-", figures),
            figures => (b"e+", figures),
        };
        let zero = usize::from(figures.len() == 1);
        let length = mantissa.len() + sign.len() + zero + figures.len();
        if length < width || digits == 0 {
            out.extend(std::iter::repeat_n(b' ', width.saturating_sub(length)));
            out.extend_from_slice(mantissa);
            out.extend_from_slice(sign);
            out.extend_from_slice(&b"0"[..zero]);
            out.extend_from_slice(figures);
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn quick_and_thorough_agree(value in any::<f64>(), small in -1e6..1e6f64, digits in 0..17usize) {
            for value in [value, small] {
                let text = format!("{value:.digits$e}");
                let exact: f64 = text.parse().expect("a number");
                let read = parse(text.as_bytes()).expect("a number");
                prop_assert!(read.to_bits() == exact.to_bits() || (read.is_nan() && exact.is_nan()));
                let mut out = Vec::new();
                print(&mut out, small, 26, digits.min(16));
                let exact: f64 = format!("{small:.*e}", digits.min(16)).parse().expect("a number");
                prop_assert_eq!(parse(out.trim_ascii()), Some(exact));
            }
        }
    }

    #[test]
    fn every_spelling_is_understood() {
        for (text, value) in [
            ("1.5E+02", 150.0),
            ("1.5d2", 150.0),
            ("-1.5D-02", -0.015),
            ("1.5-101", 1.5e-101),
            ("+.5", 0.5),
            ("3", 3.0),
            ("1.e+03", 1000.0),
            ("inf", f64::INFINITY),
            ("1.2345678901234567e+00", 1.234_567_890_123_456_7),
        ] {
            assert_eq!(parse(text.as_bytes()), Some(value), "{text}");
        }
        assert!(parse(b"nan").expect("NaN").is_nan());
        for text in ["", "-", "e5", "1.2.3", "****", "1e", "0x10", "1 2", "--1", "1e+", "\u{e4}"] {
            assert_eq!(parse(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn columns_are_c_columns() {
        let printed = |value, width, digits| {
            let mut out = Vec::new();
            print(&mut out, value, width, digits);
            String::from_utf8(out).expect("ASCII")
        };
        assert_eq!(printed(-1.5, 13, 5), " -1.50000e+00");
        assert_eq!(printed(1.0 / 51200.0, 13, 6), " 1.953125e-05");
        assert_eq!(printed(-1e-300, 20, 12), " -1.00000000000e-300");
        assert_eq!(printed(f64::NAN, 13, 5), "          NaN");
    }
}
