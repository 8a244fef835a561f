//! A kept campaign file of every version: each is read as it is, gives the same samples and
//! verdicts, and is continued as the newest version. Those of versions 2 and 3 were written by the
//! programs of their time. That of version 1 is the file of version 2 without the tables that came with version 2
//! (`chain`, `chain_head`, `temperatures`).
//!
//! A release that changes the file's tables adds a file of the version before here, and removes
//! none.

use jointrig::campaign::store::Store;
use jointrig::campaign::store::codec;
use jointrig::campaign::verdict::Verdict;
use jointrig::device::samples::SampleType;
use std::path::{Path, PathBuf};

/// What a kept file contains.
struct Kept {
    version: u32,
    /// By record: checksum of its samples as they were measured, type of every channel, and the
    /// verdict that counts.
    records: &'static [(u32, SampleType, Verdict)],
    /// Entries of the laboratory's calibrations.
    calibrations: usize,
}

/// The hits of the file of version 2.
const IMPORTED: [(u32, SampleType, Verdict); 3] = [
    (972_728_933, SampleType::I16, Verdict::Good),
    (863_935_319, SampleType::I16, Verdict::Good),
    (3_713_371_248, SampleType::I16, Verdict::Good),
];

const KEPT: [Kept; 3] = [
    Kept { version: 1, records: &IMPORTED, calibrations: 0 },
    Kept { version: 2, records: &IMPORTED, calibrations: 0 },
    Kept {
        version: 3,
        records: &[
            (2_281_631_549, SampleType::F32, Verdict::Good),
            (361_683_844, SampleType::F32, Verdict::Dropped),
            (2_214_252_333, SampleType::F64, Verdict::Good),
            (461_899_869, SampleType::F64, Verdict::Good),
        ],
        calibrations: 1,
    },
];

/// The newest version, with which every file is continued.
const NEWEST: u32 = 3;

fn path(version: u32) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/data/campaign_v{version}/old.jrig"))
}

/// The version that a file states in its first page (SQLite's `user_version`).
fn stated(path: &Path) -> u32 {
    let bytes = std::fs::read(path).expect("read");
    u32::from_be_bytes(bytes[60..64].try_into().expect("four bytes"))
}

fn check(store: &Store, kept: &Kept) {
    let version = kept.version;
    assert_eq!(store.verify().expect("checked"), [], "version {version}");
    let rows: Vec<_> = store.records().expect("rows").into_iter().map(|row| row.expect("whole")).collect();
    assert_eq!(rows.len(), kept.records.len(), "version {version}");
    for (row, (crc, of, verdict)) in rows.iter().zip(kept.records) {
        let samples = store.samples(row).expect("whole");
        assert!(samples.types().iter().all(|own| own == of), "version {version}, record {}", row.id);
        assert_eq!(codec::checksum(&samples), *crc, "version {version}, record {}", row.id);
        assert_eq!(
            (row.standing(), samples.scans()),
            (*verdict, 1024),
            "version {version}, record {}",
            row.id
        );
    }
    assert_eq!(store.plan().expect("a plan").name.get_ref(), "small");
    assert_eq!(store.calibrations().expect("read").len(), kept.calibrations, "version {version}");
}

#[test]
fn every_kept_campaign_is_read_as_it_is_and_continued_as_the_newest_version() {
    for kept in KEPT {
        let original = path(kept.version);
        let before = std::fs::read(&original).expect("read");
        assert_eq!(stated(&original), kept.version);
        check(&Store::open_read_only(&original).expect("read"), &kept);
        assert!(std::fs::read(&original).expect("read") == before, "reading changes nothing");

        let folder = tempfile::tempdir().expect("a folder");
        let copy = folder.path().join("copy.jrig");
        std::fs::write(&copy, before).expect("written");
        Store::open(&copy).expect("brought up").close().expect("closed");
        assert_eq!(stated(&copy), NEWEST);
        check(&Store::open_read_only(&copy).expect("read again"), &kept);
    }
}

#[test]
fn a_new_file_has_the_newest_kept_version() {
    let folder = tempfile::tempdir().expect("a folder");
    let new = folder.path().join("new.jrig");
    Store::create(&new, jointrig::campaign::plan::SMALL, "small.toml")
        .expect("created")
        .close()
        .expect("closed");
    assert_eq!(stated(&new), NEWEST);
    let newest = KEPT.iter().map(|kept| kept.version).max();
    assert_eq!(newest, Some(NEWEST), "keep a file of this version too: host/tests/data/campaign_v{NEWEST}");
}
