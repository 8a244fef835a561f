//! The campaign file from Python: `docs/read_campaign.py` decodes every record to the same codes.
#![allow(clippy::unwrap_used)]

use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use jointrig::campaign::store::Store;
use jointrig::campaign::store::codec;
use jointrig_tests::campaign::{plan, rows, run};

#[test]
fn python_reads_the_same_codes() {
    let ready = Command::new("python3").args(["-c", "import numpy, pcodec"]).output();
    if !ready.is_ok_and(|ready| ready.status.success()) {
        eprintln!("left out: python3 with numpy and pcodec is not here (`pip install numpy pcodec`)");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.jrig");
    let transport = "sim:".parse::<jointrig::device::address::Address>().unwrap().open(3).unwrap();
    run(&file, &plan(2, &[("AJB", &["AZ3"], &["A3"])]), transport);
    let store = Store::open_read_only(&file).unwrap();
    let mut expected = String::new();
    for row in rows(&store) {
        let crc = codec::checksum(&store.samples(&row).unwrap());
        // writing to a string cannot fail
        writeln!(expected, "{} {} {crc}", row.id, row.verdict).unwrap();
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/read_campaign.py");
    let read = Command::new("python3").arg(&script).arg(&file).output().unwrap();
    assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
    assert_eq!(String::from_utf8_lossy(&read.stdout), expected);
    let text = std::fs::read_to_string(script).unwrap();
    let decoder =
        text.lines().skip_while(|line| !line.starts_with("def codes")).take_while(|line| !line.is_empty());
    assert!(decoder.count() <= 10, "the decoder stays within ten lines");
}
