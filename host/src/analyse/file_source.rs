//! Information in a campaign file about itself: provenance, and how much of the plan was measured.

use super::analyse_error::AnalyseError;
use super::from_store::CampaignFile;
use super::heard::Heard;
use super::hit_counts::completeness;
use crate::campaign::store::Store;
use crate::results::{Calibrated, CellRow, Cells, Completeness, HitRow, Source, rounded};
use crate::structure::Structure;

impl CampaignFile {
    /// Provenance of the findings: file, device, settings, link.
    pub(super) fn source(&self, store: &Store) -> Result<Source, AnalyseError> {
        let file = self.path.file_name().unwrap_or(self.path.as_os_str()).to_string_lossy().into_owned();
        let mut source = Source { file, kind: "campaign".into(), ..Source::default() };
        source.started = self.records.values().flatten().flatten().map(|r| r.utc.clone()).min();
        let sessions = store.sessions()?;
        source.simulated = store.is_simulated()?;
        if let Some((_, info)) = sessions.last() {
            for (key, value) in [
                ("address", info.address.clone()),
                ("board", info.board.clone()),
                ("serial", info.serial.clone()),
                ("firmware_version", info.firmware_version.clone()),
                ("target", info.target.clone()),
                ("build", info.build.to_string()),
                ("schema_hash", info.schema_hash.to_string()),
                ("sessions", sessions.len().to_string()),
            ] {
                source.device.insert(key.into(), value);
            }
        }
        let (text, plan_file) = store.plan_text()?;
        source.settings.insert("plan".into(), self.plan.name.get_ref().clone().into());
        source.settings.insert("plan_file".into(), plan_file.into());
        source
            .settings
            .insert("plan_crc32".into(), format!("{:08x}", crc32fast::hash(text.as_bytes())).into());
        source
            .settings
            .insert("virtual_point_m".into(), serde_json::json!(self.plan.geometry.virtual_point_m));
        if let Some(names) = self.plan.own_names() {
            source.settings.insert("structure".into(), names.into());
        }
        if !self.plan.slides_along_z() {
            source.settings.insert("sliding_direction".into(), serde_json::json!(self.plan.sliding()));
        }
        // which simulated rig it was, and its random seed
        if let Some(rig) = store.simulated_rig()? {
            source.settings.insert("rig".into(), rig.name.into());
            source.settings.insert("seed".into(), rig.seed.to_string().into());
        } else if let Some(seed) = store.meta("demo_seed")? {
            source.settings.insert("seed".into(), seed.into());
        }
        source.link = store.link_counters()?;
        source.calibrations = calibrated(store)?;
        source.structure_changes = store.structure_changes()?;
        source.temperature_c = temperature_c(store)?;
        Ok(source)
    }

    /// Every cell of the plan, in order, with its data quality.
    pub(super) fn cell_rows(&self, heard: &Heard) -> Cells {
        let rows = self.cells.iter().map(|cell| {
            let count = self.tally.cell(cell.id);
            let name = &cell.name;
            let own = heard.cells.iter().find(|h| h.name == *name);
            CellRow {
                configuration: name.configuration.into(),
                impact: name.impact.clone(),
                response: name.response.clone(),
                wanted: count.wanted as usize,
                kept: count.kept as usize,
                refused: count
                    .refused
                    .iter()
                    .map(|(kind, n)| (kind.name().to_owned(), *n as usize))
                    .collect(),
                coherence: own.map_or_else(Vec::new, |h| h.coherence.clone()),
                random_error: own.and_then(|h| h.random_error),
            }
        });
        Cells { cells: rows.collect(), frequency_hz: heard.frequency_hz.clone() }
    }

    /// Every firing of the hammer with a readable record, in order.
    pub(super) fn hit_rows(&self) -> Vec<HitRow> {
        let mut rows: Vec<HitRow> = (self.records.values().flatten().flatten())
            .map(|r| HitRow {
                record: r.id,
                peak_n: rounded(r.peak_n, 5),
                pulse_us: r.pulse_us,
                verdict: r.standing().name().into(),
                kept: r.kept(),
            })
            .collect();
        rows.sort_by_key(|row| row.record);
        rows
    }

    /// How much of the plan was measured, by structure.
    pub(super) fn completeness(&self) -> Vec<Completeness> {
        let mut names: Vec<Structure> = Vec::new();
        for cell in &self.cells {
            if !names.contains(&cell.name.configuration) {
                names.push(cell.name.configuration);
            }
        }
        names
            .into_iter()
            .map(|name| {
                let own = self.cells.iter().filter(|c| c.name.configuration == name).map(|cell| {
                    let count = self.tally.cell(cell.id);
                    let refused = count.refused.iter().map(|(kind, n)| (kind.name(), *n as usize)).collect();
                    let hits = (count.wanted as usize, count.kept as usize, refused);
                    (cell.lead.is_none(), hits)
                });
                completeness(name.name(), own)
            })
            .collect()
    }
}

/// Minimum, mean and maximum temperature, °C; `None` without measurements.
fn temperature_c(store: &Store) -> Result<Option<[f64; 3]>, AnalyseError> {
    let all: Vec<f64> = store.temperatures()?.iter().map(|row| row.celsius).collect();
    let (least, most) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), celsius| {
        (least.min(*celsius), most.max(*celsius))
    });
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    Ok((!all.is_empty()).then(|| [least, mean, most].map(|celsius| rounded(celsius, 4))))
}

/// The change made by every calibration, in the order of entry, relative to the first session to
/// which it applies.
fn calibrated(store: &Store) -> Result<Vec<Calibrated>, AnalyseError> {
    let (sessions, all) = (store.sessions()?, store.calibrations()?);
    let mut rows = Vec::new();
    for (n, own) in all.iter().enumerate() {
        // a calibration that applies from a session which never took place changed nothing
        let Some((session, _)) = sessions.iter().find(|(id, _)| *id >= own.from_session) else { continue };
        let map = store.channels_as_measured(*session)?;
        let Some(channel) = map.channels.iter().find(|channel| channel.name == own.channel.as_str()) else {
            continue;
        };
        let mut before = channel.clone();
        let earlier =
            all[..n].iter().filter(|old| old.channel == own.channel && old.from_session <= *session);
        earlier.for_each(|old| old.apply(&mut before));
        let mut now = before.clone();
        own.apply(&mut now);
        let sensor = [own.model.clone(), own.serial.clone(), own.calibrated.clone()];
        rows.push(Calibrated {
            utc: own.utc.clone(),
            from_session: own.from_session,
            channel: own.channel.clone(),
            unit: channel.quantity.unit().into(),
            sensitivity_v: [&before, &now].map(|c| rounded(1.0 / f64::from(c.units_per_volt), 7)),
            delay_s: [&before, &now].map(|c| 1e-9 * f64::from(c.delay_ns)),
            uncertainty: own.uncertainty,
            sensor: sensor.into_iter().flatten().collect(),
            reason: own.reason.clone(),
        });
    }
    Ok(rows)
}
