//! A campaign over the emulated controller gives the records of the native virtual board.
//!
//! `cargo xtask test` builds the image and names it in `JOINTRIG_MPS2_IMAGE`; without it the test says so.
#![allow(clippy::unwrap_used)]

use jointrig::device::address::Address;
use jointrig_tests::campaign::{Kept, plan, run};

fn over(address: &str) -> Vec<Kept> {
    let three_cells =
        plan(2, &[("A", &["AZ3"], &["A3"]), ("B", &["BY1"], &["B4"]), ("AJB", &["AZ3"], &["B3"])]);
    let folder = tempfile::tempdir().unwrap();
    let transport = address.parse::<Address>().unwrap().open(7).unwrap();
    let (summary, records) = run(&folder.path().join("c.jrig"), &three_cells, transport);
    assert_eq!((summary.kept, summary.accounts.unexplained()), (6, 0));
    records
}

#[test]
fn a_campaign_over_the_emulated_controller_gives_the_same_records() {
    if std::env::var_os("JOINTRIG_MPS2_IMAGE").is_none() {
        eprintln!("left out: JOINTRIG_MPS2_IMAGE names no image; `cargo xtask test` builds one and sets it");
        return;
    }
    assert_eq!(over("qemu:"), over("sim:"));
}
