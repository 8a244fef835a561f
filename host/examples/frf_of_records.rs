//! FRFs of impact records: `cargo run --release --example frf_of_records -- records.npz`.

use std::path::PathBuf;

use jointrig::campaign::verdict::{Limits, Verdict, judge_all};
use jointrig::exchange::read_impacts;
use jointrig::spectra::{FrfSettings, estimate, usable_band};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let given = std::env::args_os().nth(1).map(PathBuf::from);
    let path =
        given.unwrap_or_else(|| concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/impacts/good.npz").into());
    let records = read_impacts(&path)?;
    let verdicts = judge_all(&records, &Limits::default(), None);
    let good: Vec<bool> = verdicts.iter().map(|verdict| verdict.kind == Verdict::Good).collect();
    let y = estimate(&records, &good, &FrfSettings::default())?;
    let band = usable_band(y.frequency_hz(), &y.force_spectrum(), 6.0);
    println!("{} of {} hits are good", good.iter().filter(|good| **good).count(), good.len());
    match band {
        Some(band) => println!("excited from {:.0} to {:.0} Hz", band.low_hz, band.high_hz),
        None => println!("the hits have no force"),
    }
    Ok(())
}
