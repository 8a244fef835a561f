//! H1 and coherence of many hits, compared with pyFRF and with only the transforms of the same
//! records.

use super::noise::numbers;
use super::peers::{self, Peers};
use super::row::{RUNS, Row, quickest};
use jointrig::spectra::{
    ForceWeighting, FrfSettings, ImpactRecords, MotionQuantity, Origin, Windowing, estimate,
};
use rayon::prelude::*;
use realfft::RealFftPlanner;
use serde_json::json;
use std::error::Error;
use std::hint::black_box;

const HITS: usize = 100;
const RESPONSES: usize = 10;
const SAMPLES: usize = 102_400;

/// The single row of this part.
pub fn rows(all: &Peers) -> Result<Vec<Row>, Box<dyn Error>> {
    let records = ImpactRecords {
        fs_hz: 51_200.0,
        force_n: (0..HITS).map(|h| numbers(SAMPLES, h as u64)).collect(),
        response: (0..HITS)
            .map(|h| (0..RESPONSES).map(|r| numbers(SAMPLES, (1000 * h + r) as u64)).collect())
            .collect(),
        quantity: MotionQuantity::Velocity,
    };
    // the whole record, as the peer uses it
    let settings = FrfSettings {
        windowing: Windowing {
            force_before_s: 1.0,
            force_after_s: 10.0,
            force_taper_s: 0.0,
            sigma_per_s: 0.0,
            force_weighting: ForceWeighting::Exponential,
        },
        origin: Origin::At(0.0),
        ..FrfSettings::default()
    };
    let used = vec![true; HITS];
    let mut failed = None;
    let [ours, bare] = quickest(
        RUNS,
        [
            &mut || match estimate(black_box(&records), &used, &settings) {
                Ok(y) => drop(black_box(y)),
                Err(error) => failed = Some(error),
            },
            &mut || transforms(black_box(&records)),
        ],
    );
    if let Some(error) = failed {
        return Err(error.into());
    }
    let job = json!({ "hits": HITS, "responses": RESPONSES, "samples": SAMPLES });
    let theirs = all.run("spectra.py", &job.to_string())?;
    let peer = theirs.as_ref().and_then(|t| peers::quickest(&t["seconds"]));
    Ok(vec![
        Row::of(
            format!("H1 and coherence, {HITS} hits × {} channels × {SAMPLES} samples", 1 + RESPONSES),
            ours,
        )
        .beside("pyFRF", peer, 6.0)
        .against("the FFTs alone, both cores", bare, Some(1.2)),
    ])
}

/// Only the transform of every channel of every hit, with the same library. It works in place and
/// the records are needed again, so each is copied once, which is included.
fn transforms(records: &ImpactRecords) {
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(SAMPLES);
    let signals: Vec<&Vec<f64>> = records.force_n.iter().chain(records.response.iter().flatten()).collect();
    signals.par_chunks(signals.len().div_ceil(rayon::current_num_threads())).for_each(|signals| {
        let (mut signal, mut spectrum) = (fft.make_input_vec(), fft.make_output_vec());
        let mut scratch = fft.make_scratch_vec();
        for own in signals {
            signal.copy_from_slice(own);
            fft.process_with_scratch(&mut signal, &mut spectrum, &mut scratch).expect("lengths fit");
            black_box(&mut spectrum);
        }
    });
}
