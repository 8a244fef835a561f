//! A campaign's analysis compared with unpacking and transforming its data; and the growth of time
//! and memory with hits and cells.

use super::growth::{Cost, Growth, TIMES, measured};
use super::row::{Row, quickest};
use jointrig::analyse::{CampaignFile, Wanted, analyse};
use jointrig::campaign::store::Store;
use jointrig::campaign::store::record_table::RecordRow;
use jointrig::device::address::Address;
use jointrig::device::transport::Transport;
use jointrig::structure::Structure;
use jointrig_tests::campaign::{plan, run};
use peak_alloc::PeakAlloc;
use rayon::prelude::*;
use realfft::RealFftPlanner;
use std::error::Error;
use std::hint::black_box;
use std::path::{Path, PathBuf};

const RUNS: usize = 3;
const LINES_HZ: [f64; 2] = [10.0, 1000.0];
const IMPACTS: [&str; 12] =
    ["AZ1", "AZ2", "AZ3", "AY1", "AY2", "AY3", "AX1", "AX2", "AX3", "I_MZ", "I_KX", "I_KY"];
const RESPONSES: [&str; 4] = ["A1", "A2", "A3", "A4"];

/// The demo's campaign: 276 cells, three hits each, some of them at the contact.
pub fn rows(folder: &Path) -> Result<Vec<Row>, Box<dyn Error>> {
    let path = folder.join("demo.jrig");
    let text = include_str!("../../docs/plans/demo.toml");
    run(&path, text, simulated()?);
    let store = Store::open_read_only(&path)?;
    let kept: Vec<i64> =
        store.records()?.into_iter().flatten().filter(RecordRow::kept).map(|row| row.id).collect();
    let mut failed = None;
    let [ours, least] = quickest(
        RUNS,
        [
            &mut || match analyse(&store, Wanted::default(), &|_| {}) {
                Ok(found) => drop(black_box(found)),
                Err(error) => failed = Some(error),
            },
            &mut || unpacked_and_transformed(&path, &kept),
        ],
    );
    if let Some(error) = failed {
        return Err(error.into());
    }
    Ok(vec![
        Row::of(format!("analysis of the demo's campaign, {} hits, with fit and contact", kept.len()), ours)
            .against("unpacking and transforming every channel once, both cores", least, None),
    ])
}

/// The built-in rig.
fn simulated() -> Result<Box<dyn Transport>, Box<dyn Error>> {
    Ok("sim:".parse::<Address>()?.open(1)?)
}

/// Reads each record from the file, and unpacks and transforms each of its channels once: the
/// minimum work of an analysis.
fn unpacked_and_transformed(path: &Path, records: &[i64]) {
    records.par_chunks(records.len().div_ceil(rayon::current_num_threads())).for_each(|records| {
        let store = Store::open_read_only(path).expect("just measured");
        let mut planner = RealFftPlanner::<f64>::new();
        for id in records {
            let blob = store.stored_bytes(*id).expect("just measured");
            let mut rest = &blob[..];
            while let Some((length, after)) = rest.split_first_chunk::<4>() {
                let (chunk, after) = after.split_at(u32::from_le_bytes(*length) as usize);
                rest = after;
                let codes: Vec<i16> = pco::standalone::simple_decompress(chunk).expect("just written");
                // two seconds, as in the analysis
                let mut signal: Vec<f64> = codes.iter().take(102_400).copied().map(f64::from).collect();
                let fft = planner.plan_fft_forward(signal.len());
                let mut spectrum = fft.make_output_vec();
                fft.process(&mut signal, &mut spectrum).expect("lengths fit");
                black_box(spectrum);
            }
        }
    });
}

/// FRFs of a part of configuration A: with more hits in each cell, and with more cells.
pub fn growth(folder: &Path, heap: PeakAlloc) -> Result<Vec<Growth>, Box<dyn Error>> {
    let of_hits = [campaign(folder, 1, 3, 4)?, campaign(folder, 4, 3, 4)?, campaign(folder, 16, 3, 4)?];
    let of_cells = [campaign(folder, 4, 3, 1)?, campaign(folder, 4, 12, 1)?, campaign(folder, 4, 12, 4)?];
    Ok(vec![
        Growth {
            what: "FRFs of a campaign with more hits in each of 12 cells".into(),
            steps: of_files(heap, &of_hits),
            flat_memory: true,
        },
        Growth {
            what: "FRFs of a campaign with more cells of 4 hits".into(),
            steps: of_files(heap, &of_cells),
            flat_memory: false,
        },
    ])
}

fn campaign(folder: &Path, wanted: u32, impacts: usize, responses: usize) -> Result<PathBuf, Box<dyn Error>> {
    let path = folder.join(format!("{wanted}-{impacts}-{responses}.jrig"));
    let text = plan(wanted, &[("A", &IMPACTS[..impacts], &RESPONSES[..responses])])
        .replace("minimum = 2", "minimum = 1")
        .replace("most = 12", "most = 40");
    run(&path, &text, simulated()?);
    Ok(path)
}

/// Time and memory to compute the FRFs of a file of each size.
fn of_files(heap: PeakAlloc, paths: &[PathBuf; TIMES.len()]) -> [Cost; TIMES.len()] {
    let stores = paths.each_ref().map(|path| Store::open_read_only(path).expect("just measured"));
    let jobs = stores.each_ref().map(|store| {
        let file = CampaignFile::open(store, Wanted::default().known).expect("just measured");
        move || {
            let (found, complaints) = file.measured(Structure::A, LINES_HZ);
            assert!(found.is_some() && complaints.is_empty(), "{complaints:?}");
            black_box(found);
        }
    });
    measured(heap, jobs)
}
