//! `import`: FRFs and impact records from elsewhere.

use std::path::{Path, PathBuf};

use clap::Args;
use jointrig_protocol::channel::{Axis, Channel, Quantity, Role};
use jointrig_protocol::shot::{Phase, Shot};

use super::error::CliError;
use super::output;
use crate::campaign::judge::{ByRecord, Judge};
use crate::campaign::others::Others;
use crate::campaign::plan::{Cell, configuration_name};
use crate::campaign::rows::{Counters, NewRecord, Samples, SessionInfo};
use crate::campaign::store::{Store, utc_now};
use crate::device::channels::ChannelMap;
use crate::device::recording::Recording;
use crate::exchange::frf_uff::read_frf_uff;
use crate::exchange::{read_impacts, write_frf};
use crate::spectra::{ImpactRecords, MotionQuantity, Pulse};

/// Codes on either side of zero that the largest value of a channel becomes: full scale stays free, so that nothing reads as overload.
const TOP_CODE: f64 = 32_000.0;

/// Bring FRFs or impact records from elsewhere into jointrig's own files.
///
/// FRFs: a universal file (58, 58b) becomes an npz FRF file. Impact records: an npz of one impact position with the three
/// axes x, y, z of one response location goes into a campaign file, where every hit is judged like a measured one.
#[derive(Debug, Args)]
pub struct Import {
    /// A universal file with FRFs, or an npz of impact records.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// FRFs: the npz file to write.
    #[arg(long, value_name = "FILE.npz", conflicts_with = "into", required_unless_present = "into")]
    out: Option<PathBuf>,
    /// Records: the campaign file that they go into (`jointrig campaign new` makes one).
    #[arg(long, value_name = "FILE.jrig", requires_all = ["configuration", "impact", "response"])]
    into: Option<PathBuf>,
    /// Records: the configuration that was hit (A, B or AJB).
    #[arg(long, value_name = "NAME")]
    configuration: Option<String>,
    /// Records: the impact's name in the plan.
    #[arg(long, value_name = "NAME")]
    impact: Option<String>,
    /// Records: the response location's name in the plan.
    #[arg(long, value_name = "NAME")]
    response: Option<String>,
}

impl Import {
    pub fn run(self) -> Result<(), CliError> {
        match (&self.out, &self.into) {
            (Some(out), _) => self.frfs(out),
            (None, Some(into)) => self.records(into),
            (None, None) => {
                Err(CliError::Usage("give --out FILE.npz for FRFs, or --into FILE.jrig for records".into()))
            }
        }
    }

    fn frfs(&self, out: &Path) -> Result<(), CliError> {
        let bad = |error: &dyn std::fmt::Display| CliError::Bad(error.to_string());
        let (frf, warnings) = read_frf_uff(&self.file).map_err(|e| bad(&e))?;
        for warning in &warnings {
            eprintln!("{}: {warning}", self.file.display());
        }
        write_frf(out, &frf, &[]).map_err(|e| bad(&e))?;
        output::lines([format!(
            "{}: {} of {} outputs, {} inputs, {} lines",
            out.display(),
            frf.quantity,
            frf.outputs.len(),
            frf.inputs.len(),
            frf.lines.len()
        )])
    }

    fn records(&self, into: &Path) -> Result<(), CliError> {
        let records = read_impacts(&self.file).map_err(|e| CliError::Bad(e.to_string()))?;
        let mut store = Store::open(into)?;
        let plan = store.plan()?;
        let (row, attempt) = self.cell(&store)?;
        let (map, codes) = quantised(&records)
            .map_err(|reason| CliError::Bad(format!("{}: {reason}", self.file.display())))?;
        let recordings: Vec<Recording> = codes
            .into_iter()
            .zip(&records.force_n)
            .enumerate()
            .map(|(hit, (codes, force_n))| {
                let pulse = Pulse::locate(force_n).ok_or_else(|| {
                    CliError::Bad(format!(
                        "{}: hit {hit} has no force pulse: take it out",
                        self.file.display()
                    ))
                })?;
                Ok(recording(hit, codes, map.len(), &pulse))
            })
            .collect::<Result<_, CliError>>()?;
        let session = store.begin_session(&self.session(), &map)?;
        let (mut kept, mut others) = (0, Others::default());
        let hits = recordings.len();
        for (hit, recording) in recordings.into_iter().enumerate() {
            let judgement = ByRecord.judge(&row.1, &plan, &map, &recording, &others);
            if judgement.kind == crate::campaign::judge::Kind::Good {
                others.learn(&plan, &map, &Samples::of(&recording));
            }
            kept += usize::from(judgement.kind == crate::campaign::judge::Kind::Good);
            eprintln!("hit {hit}: {} ({})", judgement.kind, judgement.sentence);
            let record = NewRecord {
                cell: row.0,
                attempt: attempt + hit as u32,
                session,
                utc: utc_now(),
                // when it was measured is not known here
                utc_error_s: None,
                recording,
                judgement,
            };
            store.insert(&record, &Counters::default())?;
        }
        let rounding: Vec<String> = map
            .channels
            .iter()
            .map(|c| format!("{} {:.1e} {}", c.name, 0.5 * c.units_per_code().abs(), c.quantity.unit()))
            .collect();
        store.log(&format!("imported {hits} hits from {}", self.file.display()))?;
        store.close()?;
        output::lines([
            format!("{}: {kept} of {hits} hits are good", into.display()),
            format!("stored in 16 bits, rounded by at most: {}", rounding.join(", ")),
        ])
    }

    /// The cell's id and name, and the first attempt that is free in it.
    fn cell(&self, store: &Store) -> Result<((i64, Cell), u32), CliError> {
        let wanted =
            [&self.configuration, &self.impact, &self.response].map(|name| name.as_deref().unwrap_or(""));
        let found = store.cells()?.into_iter().find(|row| {
            let Cell { configuration, impact, response, .. } = &row.cell;
            [configuration_name(*configuration), impact, response] == wanted
        });
        let Some(row) = found else {
            return Err(CliError::Usage(format!(
                "{} has no cell of configuration `{}`, impact `{}`, response `{}`: `jointrig campaign status` lists its cells",
                store.path().display(),
                wanted[0],
                wanted[1],
                wanted[2]
            )));
        };
        let attempts = store.records()?.iter().filter(|r| r.cell == row.id).map(|r| r.attempt + 1).max();
        Ok(((row.id, row.cell), attempts.unwrap_or(0)))
    }

    fn session(&self) -> SessionInfo {
        let name = self.file.file_name().unwrap_or(self.file.as_os_str()).to_string_lossy();
        SessionInfo {
            address: format!("file:{name}"),
            board: "imported".into(),
            serial: String::new(),
            firmware_version: String::new(),
            target: String::new(),
            build: 0,
            schema_hash: 0,
        }
    }
}

/// The records as 16-bit codes, channel after channel for each hit, with the scales that belong to them.
fn quantised(records: &ImpactRecords) -> Result<(ChannelMap, Vec<Vec<i16>>), String> {
    let rate_hz = records.fs_hz.round();
    if !(1.0..=f64::from(u32::MAX)).contains(&rate_hz) || (rate_hz - records.fs_hz).abs() > 1e-6 * rate_hz {
        return Err(format!("the sampling rate of {} Hz is no whole number: resample", records.fs_hz));
    }
    let channels = records.response.first().map_or(0, Vec::len);
    if channels != 3 {
        return Err(format!(
            "there are {channels} responses: the three axes x, y, z of one location are needed"
        ));
    }
    let quantity = match records.quantity {
        MotionQuantity::Displacement => Quantity::Displacement,
        MotionQuantity::Velocity => Quantity::Velocity,
        MotionQuantity::Acceleration => Quantity::Acceleration,
    };
    let kinds = [
        ("force", Role::HammerForce, Quantity::Force),
        ("x", Role::Response(Axis::X), quantity),
        ("y", Role::Response(Axis::Y), quantity),
        ("z", Role::Response(Axis::Z), quantity),
    ];
    let signal = |hit: usize, place: usize| -> &[f64] {
        if place == 0 { &records.force_n[hit] } else { &records.response[hit][place - 1] }
    };
    let mut map = ChannelMap { id: 0, rate_hz: rate_hz as u32, channels: Vec::new() };
    for (place, (name, role, quantity)) in kinds.into_iter().enumerate() {
        let mut largest = 0.0f64;
        for hit in 0..records.force_n.len() {
            if let Some(sample) = signal(hit, place).iter().position(|v| !v.is_finite()) {
                return Err(format!("hit {hit}, {name}, sample {sample} is not a number: take the hit out"));
            }
            largest = signal(hit, place).iter().fold(largest, |m, v| m.max(v.abs()));
        }
        let range_v = 10.0f32;
        // code 32000 for the largest value, rounded up to what a float holds
        let units_per_volt = (largest.max(1e-30) * 32_768.0 / TOP_CODE / f64::from(range_v)) as f32;
        map.channels.push(Channel {
            name: name.parse().map_err(|_| format!("`{name}` is too long a name"))?,
            role,
            quantity,
            units_per_volt,
            range_v,
            delay_ns: 0,
            bits: 16,
        });
    }
    let codes = (0..records.force_n.len())
        .map(|hit| {
            (0..map.len())
                .flat_map(|place| {
                    let unit = map.channels[place].units_per_code();
                    signal(hit, place).iter().map(move |v| (v / unit).round() as i16)
                })
                .collect()
        })
        .collect();
    Ok((map, codes))
}

fn recording(hit: usize, codes: Vec<i16>, channels: usize, pulse: &Pulse) -> Recording {
    Recording {
        epoch: 0,
        first_scan: 0,
        trigger_index: pulse.start,
        channels,
        codes,
        gaps: Vec::new(),
        shot: Shot {
            number: hit as u32,
            phase: Phase::Done,
            fired_at: 0,
            trigger: pulse.start as u64,
            pulse_us: 0,
            peak_n: pulse.peak_n as f32,
            width_us: 0.0,
            rebound_ratio: 0.0,
            rebound_after: 0,
            friction_peak_n: 0.0,
            quiet_ratio: 0.0,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_bits_keep_each_channel_to_its_own_rounding() {
        let records = ImpactRecords {
            fs_hz: 51_200.0,
            force_n: vec![vec![0.0, 50.0, 0.1], vec![0.0, -25.0, 0.0]],
            response: vec![vec![vec![1e-6, -2e-3, 0.0], vec![0.0; 3], vec![1.0, 2.0, 3.0]]; 2],
            quantity: MotionQuantity::Velocity,
        };
        let (map, codes) = quantised(&records).expect("three axes");
        for (place, wanted) in
            [(0, &records.force_n[0]), (1, &records.response[0][0]), (3, &records.response[0][2])]
        {
            let unit = map.channels[place].units_per_code();
            for (code, value) in codes[0][3 * place..].iter().zip(wanted) {
                assert!((f64::from(*code) * unit - value).abs() <= 0.5001 * unit, "{place}");
                assert!(code.unsigned_abs() <= 32_001);
            }
        }
        let two = ImpactRecords { response: vec![vec![vec![0.0; 3]; 2]; 2], ..records };
        assert!(quantised(&two).expect_err("two axes").contains("x, y, z"));
    }
}
