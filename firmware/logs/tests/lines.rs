//! Decoding of intact and damaged lines.
#![cfg(feature = "decode")]

use jointrig_logs::example::{SHOT, WARNING, image, line, shot};
use jointrig_logs::{Line, Table};
use log::Level;
use proptest::prelude::*;

fn table() -> Table {
    Table::of_image(&image(0x0102_0304_0506_0708)).expect("a table")
}

fn read(bytes: &[u8]) -> (Vec<Line>, usize) {
    let mut lines = Vec::new();
    let lost = table().lines(bytes, |line| lines.push(line));
    (lines, lost)
}

#[test]
fn lines_have_their_level_the_devices_time_and_their_text() {
    assert_eq!(table().build(), 0x0102_0304_0506_0708);
    let mut bytes = vec![0];
    bytes.extend(line(WARNING, 1_500_000, &70_000_u32.to_le_bytes()));
    bytes.extend(line(SHOT, 2_000_001, &shot(12, "AJB")));
    let expected = [(Level::Warn, "1.500000 pressure 70000"), (Level::Info, "2.000001 shot 12 of AJB")];
    let expected = expected.map(|(level, text)| Line { level, text: text.into() });
    assert_eq!(read(&bytes), (expected.to_vec(), 0));
}

#[test]
fn a_damaged_line_costs_no_other_and_is_counted() {
    let good = line(WARNING, 1, &2_u32.to_le_bytes());
    let cut = &line(SHOT, 1, &shot(12, "a name"))[3..];
    let unknown = line(77, 1, &[]);
    let bytes = [&good[..], cut, &good, &unknown, &good, &good[..good.len() - 1]].concat();
    let (lines, lost) = read(&bytes);
    assert_eq!((lines.len(), lost), (3, cut.len() + unknown.len() + good.len() - 1));
}

#[test]
fn what_is_missing_in_an_image_is_said() {
    for (bytes, word) in [(&b"no image"[..], "no ELF image"), (&image(1)[..40], "no ELF image")] {
        let why = Table::of_image(bytes).err().expect("refused");
        assert!(why.contains(word), "{why}");
    }
}

proptest! {
    /// For any input, each byte is part of a line or counted, and nothing panics.
    #[test]
    fn any_bytes_are_lines_or_counted(bytes in prop::collection::vec(any::<u8>(), 0..1_000)) {
        let (lines, lost) = read(&bytes);
        let counted = bytes.split_inclusive(|byte| *byte == 0).filter(|one| *one != [0]);
        let (pieces, all) = counted.fold((0, 0), |(pieces, all), one| (pieces + 1, all + one.len()));
        prop_assert!(lines.len() <= pieces && lost <= all);
        prop_assert!((lost == all) == lines.is_empty());
    }

    /// A line with any of its bits flipped, between two intact ones.
    #[test]
    fn a_flipped_bit_leaves_the_neighbours_alone(at in 0..20_usize, bit in 0..8_u32) {
        let good = line(WARNING, 5, &6_u32.to_le_bytes());
        let mut damaged = line(SHOT, 7, &shot(8, "the ninth"));
        let at = at % (damaged.len() - 1);
        damaged[at] ^= 1 << bit;
        let (lines, _) = read(&[&good[..], &damaged, &good].concat());
        let whole = lines.iter().filter(|line| line.text == "0.000005 pressure 6").count();
        prop_assert_eq!(whole, 2);
    }
}
