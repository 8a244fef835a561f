//! The values of one array: numbers of any width and either byte order, texts, and the order of
//! their axes.

use num_complex::Complex;

use super::npy_header::Header;

/// Converts the bytes of an element to a number; the second argument is whether they are
/// big-endian.
pub(super) type FromBytes = fn(&[u8], bool) -> Complex<f64>;

/// The function that reads a number of this type from its bytes; `None` for other types.
pub(super) fn number_of(header: &Header) -> Option<FromBytes> {
    /// The bytes of an element in little-endian order.
    fn low_first<const N: usize>(bytes: &[u8], big: bool) -> [u8; N] {
        let mut word = [0; N];
        word.copy_from_slice(bytes);
        if big {
            word.reverse();
        }
        word
    }
    macro_rules! real {
        ($of:ty) => {
            |bytes, big| Complex::new(<$of>::from_le_bytes(low_first(bytes, big)) as f64, 0.0)
        };
    }
    macro_rules! complex {
        ($of:ty, $width:literal) => {
            |bytes, big| {
                let part = |bytes| f64::from(<$of>::from_le_bytes(low_first(bytes, big)));
                Complex::new(part(&bytes[..$width]), part(&bytes[$width..]))
            }
        };
    }
    Some(match (header.kind, header.width) {
        ('f', 4) => real!(f32),
        ('f', 8) => real!(f64),
        ('c', 8) => complex!(f32, 4),
        ('c', 16) => complex!(f64, 8),
        ('i', 1) => real!(i8),
        ('i', 2) => real!(i16),
        ('i', 4) => real!(i32),
        ('i', 8) => real!(i64),
        ('u', 1) => real!(u8),
        ('u', 2) => real!(u16),
        ('u', 4) => real!(u32),
        ('u', 8) => real!(u64),
        _ => return None,
    })
}

/// The text of an element without its zero padding.
pub(super) fn letters(bytes: &[u8], header: &Header) -> Result<String, String> {
    let damaged = || "is damaged (its text is none)".to_owned();
    if header.kind != 'U' {
        let end = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
        return Ok(std::str::from_utf8(&bytes[..end]).map_err(|_| damaged())?.into());
    }
    let mut text = String::new();
    for letter in bytes.as_chunks::<4>().0 {
        let code = if header.big { u32::from_be_bytes(*letter) } else { u32::from_le_bytes(*letter) };
        text.push(char::from_u32(code).ok_or_else(damaged)?);
    }
    text.truncate(text.trim_end_matches('\0').len());
    Ok(text)
}

/// Rearranges stored values so that the last index runs fastest.
pub(super) fn in_c_order<T: Clone>(values: Vec<T>, header: &Header) -> Vec<T> {
    let shape = &header.shape;
    if !header.fortran || shape.len() < 2 {
        return values;
    }
    let mut index = vec![0; shape.len()];
    let mut out = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        let at = shape.iter().zip(&index).rev().fold(0, |at, (&n, &i)| at * n + i);
        out.push(values[at].clone());
        for axis in (0..shape.len()).rev() {
            index[axis] += 1;
            if index[axis] < shape[axis] {
                break;
            }
            index[axis] = 0;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fortran_order_is_turned() {
        // column by column: (0,0) (1,0) (0,1) (1,1) (0,2) (1,2)
        let of =
            |shape: &[usize]| Header { kind: 'f', width: 8, big: false, fortran: true, shape: shape.into() };
        let turned = in_c_order(vec![1, 4, 2, 5, 3, 6], &of(&[2, 3]));
        assert_eq!(turned, [1, 2, 3, 4, 5, 6]);
        let three = in_c_order((0..24).collect(), &of(&[2, 3, 4]));
        // (1, 2, 3) is at 1 + 2·2 + 6·3 in Fortran order and last in C order
        assert_eq!(three[23], 23);
        // (0, 1, 2) is at 0 + 2·1 + 6·2
        assert_eq!(three[4 + 2], 14);
    }

    #[test]
    fn numbers_and_texts_of_either_byte_order() {
        let of = |kind, width, big| Header { kind, width, big, fortran: false, shape: Vec::new() };
        let number =
            |kind, bytes: &[u8], big| number_of(&of(kind, bytes.len(), big)).map(|number| number(bytes, big));
        assert_eq!(number('i', &[0xfe, 0xff], false), Some(Complex::new(-2.0, 0.0)));
        assert_eq!(number('u', &[1, 2], true), Some(Complex::new(258.0, 0.0)));
        let parts = [2.5f32.to_be_bytes(), (-1.0f32).to_be_bytes()].concat();
        assert_eq!(number('c', &parts, true), Some(Complex::new(2.5, -1.0)));
        assert_eq!(number('f', &[0; 2], false), None);
        let text = [0, 0, 0, 0xb5, 0, 0, 0, b'm', 0, 0, 0, 0];
        assert_eq!(letters(&text, &of('U', 12, true)).as_deref(), Ok("µm"));
        assert_eq!(letters(b"a\0", &of('S', 2, false)).as_deref(), Ok("a"));
        assert!(letters(&[0xff; 4], &of('U', 4, false)).is_err());
    }
}
