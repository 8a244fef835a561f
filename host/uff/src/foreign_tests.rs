//! Files as other programs write them, with their peculiarities and errors.

use super::*;
use num_complex::Complex;

/// An FRF of two lines.
pub(super) fn small() -> Function {
    let abscissa = Abscissa::Even { start: 300.0, step: 20.0 };
    let values = Values::Complex(vec![Complex::new(1.5, -2.25), Complex::new(0.0, 1e-9)]);
    Function {
        id: [String::from("first"), String::new(), String::new(), String::new(), String::new()],
        response: Dof { entity: "A1".into(), node: 1, direction: 1 },
        reference: Dof { entity: "AZ1".into(), node: 101, direction: -3 },
        ..Function::new(kind::FRF, abscissa, values)
    }
}

fn text() -> String {
    String::from_utf8(write(&[DataSet::Function(Box::new(small()))]).expect("writable")).expect("ASCII")
}

fn binary(order: ByteOrder) -> Vec<u8> {
    let f = Function { encoding: Encoding::Binary(order), ..small() };
    write(&[DataSet::Function(Box::new(f))]).expect("writable")
}

fn only(bytes: &[u8]) -> Function {
    let read = read(bytes);
    match (&read.faults[..], &read.sets[..]) {
        ([], [DataSet::Function(f)]) => (**f).clone(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn line_ends_blanks_and_exponents_do_not_matter() {
    for changed in [
        text().replace('\n', "\r\n"),
        text().replace('\n', "\r"),
        text().replace('\n', "   \n"),
        text().replace("e+", "E+").replace("e-", "E-"),
        text().replace("e+", "D+").replace("e-", "d-"),
        text().replace("    -1\n", "-1\n"),
        text().lines().map(|l| l.trim_end().to_string() + "\n").collect(),
        text().trim_end().to_string(),
        format!("a preface\n\n{}", text()),
    ] {
        assert_eq!(only(changed.as_bytes()), small(), "{changed}");
    }
    // free columns
    let free = text().replace(
        "  1.500000000000e+00 -2.250000000000e+00  0.000000000000e+00  1.000000000000e-09",
        "1.5 -2.25\n0 1E-9",
    );
    assert_ne!(free, text());
    assert_eq!(only(free.as_bytes()), small());
}

#[test]
fn latin_1_is_read() {
    let mut bytes = text().replacen("first", "f?rst", 1).into_bytes();
    let at = bytes.iter().position(|b| *b == b'?').expect("the mark");
    bytes[at] = 0xB5;
    assert_eq!(only(&bytes).id[0], "fµrst");
}

#[test]
fn binary_of_both_orders_with_a_false_line_end_and_false_counts() {
    for order in [ByteOrder::Little, ByteOrder::Big] {
        let good = binary(order);
        let wanted = Function { encoding: Encoding::Binary(order), ..small() };
        assert_eq!(only(&good), wanted);
        let closing = good.len() - b"    -1\n".len();
        for end in [&b"\r\n"[..], b"\n", b"\r"] {
            let false_end = [&good[..closing], end, &good[closing..]].concat();
            assert_eq!(only(&false_end), wanted);
        }
        // some writers state half of the bytes
        let head = String::from_utf8_lossy(&good[..100]).into_owned();
        assert!(head.contains("          32"), "{head}");
        let mut false_count = good.clone();
        let at = head.find("          32").expect("the count");
        false_count[at..at + 12].copy_from_slice(b"          16");
        assert_eq!(only(&false_count), wanted);
        // and some end the file without a line end
        assert_eq!(only(&good[..good.len() - 1]), wanted);
    }
}

#[test]
fn binary_data_that_look_like_a_delimiter_are_data() {
    let look_alike = f64::from_le_bytes(*b"\n    -1\n");
    let f = Function {
        values: Values::Real(vec![look_alike; 3]),
        encoding: Encoding::Binary(ByteOrder::Little),
        ..small()
    };
    let bytes =
        write(&[DataSet::Function(Box::new(f.clone())), DataSet::Units(Units::si())]).expect("writable");
    let read = read(&bytes);
    assert_eq!(read.sets, [DataSet::Function(Box::new(f)), DataSet::Units(Units::si())]);
}

#[test]
fn a_first_byte_of_lf_after_a_header_whose_lines_end_with_cr_is_data() {
    for first in [*b"\n2345678", *b"\n\n\r\n5678"] {
        let f = Function {
            values: Values::Real(vec![f64::from_le_bytes(first); 3]),
            encoding: Encoding::Binary(ByteOrder::Little),
            ..small()
        };
        let bytes = write(&[DataSet::Function(Box::new(f.clone()))]).expect("writable");
        let data = bytes.len() - b"    -1\n".len() - 24;
        for end in ["\n", "\r", "\r\n"] {
            let head = String::from_utf8(bytes[..data].to_vec()).expect("ASCII").replace('\n', end);
            let all = [head.as_bytes(), &bytes[data..]].concat();
            assert_eq!(only(&all), f, "{end:?}");
        }
    }
}

#[test]
fn narrow_places_beside_double_values() {
    let head = binary(ByteOrder::Little);
    let start = head.len() - b"    -1\n".len() - 32;
    let header = String::from_utf8(head[..start].to_vec()).expect("ASCII");
    let uneven = header.replacen("         6         2         1", "         6         2         0", 1);
    let mut bytes = uneven.into_bytes();
    for (x, re, im) in [(1f32, 2f64, 3f64), (4.0, 5.0, 6.0)] {
        bytes.extend(x.to_le_bytes().into_iter().chain(re.to_le_bytes()).chain(im.to_le_bytes()));
    }
    bytes.extend(b"    -1\n");
    let f = only(&bytes);
    assert_eq!(f.abscissa, Abscissa::Uneven(vec![1.0, 4.0]));
    assert_eq!(f.values, Values::Complex(vec![Complex::new(2.0, 3.0), Complex::new(5.0, 6.0)]));
}

#[test]
fn what_cannot_be_read_is_named_and_the_rest_is_read() {
    let broken = text().replace("0.000000000000e+00", "0.00000*000000e+00");
    let unknown = "    -1\n  2414\nwhatever\n    -1\n";
    let ibm = {
        let mut bytes = binary(ByteOrder::Little);
        let at = String::from_utf8_lossy(&bytes[..40]).find("     2  ").expect("the format") + 5;
        bytes[at] = b'3';
        bytes
    };
    let bytes = [text().as_bytes(), broken.as_bytes(), unknown.as_bytes(), &ibm, text().as_bytes()].concat();
    let read = read(&bytes);
    assert_eq!(read.sets.len(), 2);
    assert_eq!(read.skipped, [Skipped { data_set: 2414, offset: 2 * text().len() }]);
    let (first, second) = (&read.faults[0], &read.faults[1]);
    assert_eq!((first.place, first.data_set), (2, 58));
    assert!(bytes[first.offset..].starts_with(b"0.00000*"), "{first}");
    assert!(first.to_string().contains("is not a number"), "{first}");
    assert!(second.reason.contains("IEEE"), "{second}");
}

#[test]
fn a_byte_order_mark_and_text_outside_the_data_sets_hide_no_function() {
    for encoded in [text().into_bytes(), binary(ByteOrder::Little)] {
        let both = [&encoded[..], &encoded].concat();
        for (before, said) in [
            ("\u{feff}", None),
            ("\u{feff}\r\n\r\n", None),
            ("exported by a front end", Some("exported by a front end")),
            ("exported by a front end\n", Some("exported by a front end")),
            ("\u{feff}two lines\r\nof text", Some("two lines")),
        ] {
            let read = read(&[before.as_bytes(), &both].concat());
            assert_eq!(read.functions().count(), 2, "{before:?}");
            assert!(read.faults.is_empty(), "{before:?}: {:?}", read.faults);
            let outside: Vec<&str> = read.outside.iter().map(|text| text.text.as_str()).collect();
            assert_eq!(outside, said.into_iter().collect::<Vec<_>>(), "{before:?}");
        }
        let between = read(&[&encoded[..], b"a remark\n\nof two lines\n", &encoded, b"the end"].concat());
        let place = |at: usize| (between.outside[at].offset, between.outside[at].lines);
        assert_eq!((place(0), place(1).1), ((encoded.len(), 2), 1));
        assert_eq!(between.functions().count(), 2);
    }
    // a data set whose opening line is lost is reported, and the next one is read
    let lost = text().replacen("    -1\n", "", 1);
    let read = read(&[lost.as_bytes(), text().as_bytes()].concat());
    assert_eq!((read.functions().count(), read.outside[0].text.as_str()), (1, "58"));
}

#[test]
fn zeros_that_fill_up_the_last_line_are_no_values_and_other_numbers_are_refused() {
    let last = "  1.500000000000e+00 -2.250000000000e+00  0.000000000000e+00  1.000000000000e-09\n";
    let fill = |more: &str| text().replacen(last, &format!("{}{more}\n", last.trim_end()), 1);
    for zeros in ["\n  0.000000000000e+00", "\n0 0 0 0", " 0.0 0.0 0.0", "\n -0.000000000000e+00  0.0"] {
        assert_ne!(fill(zeros), text());
        assert_eq!(only(fill(zeros).as_bytes()), small(), "{zeros:?}");
    }
    for more in ["\n  1.000000000000e+00", "\n0 0 0 0 0 0", "\n0 nan", "\n0 1"] {
        let read = read(fill(more).as_bytes());
        assert!(read.faults[0].reason.contains("or more numbers are there"), "{more:?}: {:?}", read.faults);
    }
}
