//! The order of the two forces of a plan with `force.softer`.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::plan::CONTACT;
use jointrig::campaign::store::Store;
use jointrig::device::address::Address;
use jointrig_tests::campaign::{rows, run, without_known_mass};

#[test]
fn every_second_cell_of_an_impact_begins_with_the_softer_force() {
    let whole = without_known_mass(CONTACT);
    let (head, rest) = whole.split_once("# B alone").unwrap();
    let (_, geometry) = rest.split_once("# Grouping").unwrap();
    let cells = "[[configuration]]\nname = \"AJB\"\nimpacts = [\"AZ1\", \"AZ3\"]\nresponses = [\"C1\", \"C3\", \"B1\"]\n\n";
    let plan = format!("{head}{cells}# Grouping{geometry}")
        .replace("wanted = 6", "wanted = 2")
        .replace("length_s = 2.0", "length_s = 1.0")
        .replace("exponential_per_s = 2.3", "exponential_per_s = 4.6");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.jrig");
    let address: Address = "sim:".parse().unwrap();
    let (summary, _) = run(&file, &plan, address.open(3).unwrap());
    assert_eq!(summary.kept, 12);
    let store = Store::open_read_only(&file).unwrap();
    let records = rows(&store);
    for (cell, softer_first) in store.cells().unwrap().iter().zip([false, true, false].into_iter().cycle()) {
        let own = records.iter().filter(|row| row.cell == cell.id && row.kept());
        let [first, second] = own.map(|row| row.peak_n).collect::<Vec<_>>()[..] else { panic!("two hits") };
        // 0.7 of the target, while the runner still looks for the pulse
        let ratio = if softer_first { first / second } else { second / first };
        assert!((0.5..0.9).contains(&ratio), "{:?}: {first} N, then {second} N", cell.cell);
    }
}
