//! For any bytes: no panic, no endless loop, and every good data set before the damage is still
//! read.

use super::round_trip_tests::set;
use super::*;
use proptest::collection::vec;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, rng_seed: proptest::test_runner::RngSeed::Fixed(15), ..ProptestConfig::default() })]

    #[test]
    fn truncated_at_any_byte_the_sets_before_are_read(sets in vec(set(), 1..4)) {
        let bytes = write(&sets).expect("writable");
        let ends: Vec<usize> = (1..=sets.len()).map(|n| write(&sets[..n]).expect("writable").len()).collect();
        for length in 0..bytes.len() {
            let whole = ends.iter().filter(|end| **end <= length).count();
            let read = read(&bytes[..length]);
            // the last line's end may be missing
            prop_assert!(read.sets.len() == whole || (read.sets.len() == whole + 1 && ends.contains(&(length + 1))));
            prop_assert_eq!(&read.sets[..], &sets[..read.sets.len()]);
        }
    }

    #[test]
    fn a_flipped_byte_harms_no_set_before_it(sets in vec(set(), 1..4), at in any::<prop::sample::Index>(), value in any::<u8>()) {
        let mut bytes = write(&sets).expect("writable");
        let at = at.index(bytes.len());
        bytes[at] = value;
        let read = read(&bytes);
        let before = (1..=sets.len()).take_while(|n| write(&sets[..*n]).expect("writable").len() <= at).count();
        prop_assert_eq!(&read.sets[..before], &sets[..before]);
    }

    #[test]
    fn noise_is_survived(noise in vec(any::<u8>(), 0..4000), words in vec("(    -1|    58|    58b     1     2|    15|  2412|  [0-9]{1,9}|[-+.0-9eEdD]{1,30}| {1,20}|\r|\n|\n|\n)", 0..300)) {
        read(&noise);
        let read = read(words.concat().as_bytes());
        prop_assert!(read.sets.len() + read.faults.len() + read.skipped.len() <= words.len());
    }
}

#[test]
fn a_count_that_promises_too_much_reserves_nothing() {
    let good = write(&[DataSet::Function(Box::new(super::foreign_tests::small()))]).expect("writable");
    let text = String::from_utf8(good).expect("ASCII");
    let huge = text.replacen("         6         2         1", "         6 999999999         1", 1);
    assert_ne!(text, huge);
    let read = read(huge.as_bytes());
    assert!(read.sets.is_empty() && read.faults[0].reason.contains("999999999"), "{:?}", read.faults);
}

#[test]
fn many_empty_data_sets_end_the_reading_and_it_is_said() {
    let bytes = b"-1\n58\n\n\n\n\n\n\n5 0 1\n\n\n\n\n-1\n".repeat(100_000);
    let read = read(&bytes);
    assert!(read.sets.len() < 40_000, "{}", read.sets.len());
    let last = read.faults.last().expect("a fault");
    assert!(last.reason.contains("left unread"), "{last}");
}

#[test]
fn numbers_too_narrow_for_any_column_are_refused_before_they_are_read() {
    let good = write(&[DataSet::Function(Box::new(super::foreign_tests::small()))]).expect("writable");
    let text = String::from_utf8(good).expect("ASCII");
    let huge = text.replacen("         6         2         1", "         6   5000000         1", 1);
    let end = huge.rfind("    -1").expect("an end");
    let huge = format!("{}\n{}\n{}", &huge[..end], "0 ".repeat(10_000_000), &huge[end..]);
    let read = read(huge.as_bytes());
    assert!(read.sets.is_empty() && read.faults[0].reason.contains("columns"), "{:?}", read.faults);
}

#[test]
fn binary_data_full_of_ends_that_are_none_take_no_time() {
    let mut bytes = b"    -1\n    58b     1     2          11           9\n".to_vec();
    bytes.extend(b"\n\n\n\n\n\n         5  99999999         1\n\n\n\n\n");
    bytes.extend(b"    -1".repeat(1_000_000));
    let begun = std::time::Instant::now();
    assert!(read(&bytes).sets.is_empty());
    assert!(begun.elapsed().as_secs() < 5, "{:?}", begun.elapsed());
}

#[test]
fn a_line_of_megabytes_is_looked_at_in_part() {
    let mut bytes = b"    -1\n    58\n".to_vec();
    bytes.extend("é".repeat(2_000_000).bytes());
    bytes.extend(b"\n\n\n\n\n\n         5         0         1\n\n\n\n\n    -1\n");
    let read = read(&bytes);
    let id = &read.functions().next().expect("a function").id[0];
    assert!(id.len() <= 1000 && id.chars().all(|letter| letter == 'é'), "{}", id.len());
}
