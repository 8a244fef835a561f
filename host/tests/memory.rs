//! No reader allocates more than a small multiple of the file's size, whatever the file declares.
//!
//! A single test in a separate program, because the counting allocator is global.

use jointrig::exchange::uff_output::write_records;
use jointrig::exchange::{
    StatedUnits, read_frf_file, read_hysteresis, read_impacts, read_positions, record_uff::read_record_file,
    write_impacts,
};
use jointrig::spectra::{ImpactRecords, MotionQuantity};
use peak_alloc::PeakAlloc;
use std::io::Write;
use std::path::{Path, PathBuf};

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Bytes allocated per byte of a file of arrays or functions: a 4-byte float becomes two 8-byte
/// ones (complex), once in the order of the file and once in ours, and the text of a number has at
/// least two bytes.
const OF_ARRAYS: usize = 16;
/// The same for a workbook, whose text is compressed and becomes a string for each of its cells.
const OF_WORKBOOKS: usize = 32;
/// Buffers that do not depend on the file.
const BUFFERS: usize = 1 << 20;

/// Uniform random numbers, the same in every run.
struct Uniform(u64);

impl Uniform {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as usize) % bound
    }
}

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file)
}

/// Peak of the memory allocated while `work` ran, beyond the initial usage.
fn allocated(work: impl FnOnce()) -> usize {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    work();
    MEMORY.peak_usage().saturating_sub(before)
}

fn write_noise(folder: &Path) {
    // noise, which cannot be compressed
    let signal = |seed: usize| {
        let mut uniform = Uniform(seed as u64);
        (0..500).map(|_| uniform.below(1 << 30) as f64 / 1e9).collect::<Vec<f64>>()
    };
    let records = ImpactRecords {
        fs_hz: 51_200.0,
        force_n: (0..4).map(signal).collect(),
        response: (0..4).map(|hit| (0..3).map(|axis| signal(hit + axis)).collect()).collect(),
        quantity: MotionQuantity::Velocity,
    };
    write_impacts(&folder.join("records.npz"), &records).expect("written");
    write_records(&folder.join("records.uff"), &records, "A1", "AZ1").expect("written");
}

#[test]
fn damaged_and_lying_files_cost_a_small_multiple_of_their_size() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_noise(folder.path());
    let at = folder.path().join("file");
    let mut uniform = Uniform(1);
    let sources = [
        (folder.path().join("records.npz"), OF_ARRAYS),
        (folder.path().join("records.uff"), OF_ARRAYS),
        (data("frf_rigid/A.npz"), OF_ARRAYS),
        (data("hysteresis/stuck/record.npz"), OF_ARRAYS),
        (data("positions/positions.xlsx"), OF_WORKBOOKS),
    ];
    for (source, multiple) in sources {
        let whole = std::fs::read(&source).expect("test data");
        let mut most = 0;
        for trial in 0..60 {
            let mut bytes = whole.clone();
            // the first unchanged; then a few bytes changed, mostly in the headers; some truncated
            for _ in 0..trial.min(1) * (1 + uniform.below(4)) {
                let near_an_end = uniform.below(bytes.len().min(600));
                let place = [near_an_end, bytes.len() - 1 - near_an_end, uniform.below(bytes.len())];
                let place = place[uniform.below(3)];
                bytes[place] = [0xff, 0x7f, b'9', uniform.below(256) as u8][uniform.below(4)];
            }
            if trial % 5 == 4 {
                bytes.truncate(uniform.below(bytes.len()));
            }
            std::fs::write(&at, &bytes).expect("written");
            let used = allocated(|| {
                // one after the other: each frees its result
                drop(read_frf_file(&at, &StatedUnits::default()));
                drop(read_impacts(&at));
                drop(read_hysteresis(&at));
                drop(read_record_file(&at, &StatedUnits::default()));
                drop(read_positions(&at));
            });
            most = most.max(used);
            let allowed = multiple * bytes.len() + BUFFERS;
            assert!(used <= allowed, "{} trial {trial}: {used} bytes for {}", source.display(), bytes.len());
        }
        println!(
            "{}: {:.1} times its {} bytes",
            source.display(),
            most as f64 / whole.len() as f64,
            whole.len()
        );
    }
    // headers that declare terabytes
    let mut archive = zip::ZipWriter::new(std::fs::File::create(&at).expect("writable"));
    for name in ["fs.npy", "force.npy", "frf.npy", "frequency.npy", "velocity_a.npy"] {
        archive.start_file(name, zip::write::SimpleFileOptions::default()).expect("entry");
        let mut npy = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (4000000000, 1000), }";
        npy.extend(format!("{header:<117}\n").bytes());
        archive.write_all(&npy).expect("written");
    }
    archive.finish().expect("closed");
    let used = allocated(|| {
        assert!(
            read_frf_file(&at, &StatedUnits::default()).is_err()
                && read_impacts(&at).is_err()
                && read_hysteresis(&at).is_err()
        );
    });
    assert!(used <= BUFFERS, "{used}");
}
