//! What a campaign file says of itself: where it comes from, and how much of its plan was measured.

use super::from_store::{AnalyseError, CampaignFile};
use super::hit_counts::completeness;
use crate::campaign::store::Store;
use crate::results::{Completeness, Source};
use crate::structure::Structure;

impl CampaignFile {
    /// Where the findings come from: file, device, settings, link.
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
        source.settings.insert("plan".into(), self.plan.name.clone().into());
        source.settings.insert("plan_file".into(), plan_file.into());
        source
            .settings
            .insert("plan_crc32".into(), format!("{:08x}", crc32fast::hash(text.as_bytes())).into());
        source
            .settings
            .insert("virtual_point_m".into(), serde_json::json!(self.plan.geometry.virtual_point_m));
        // what the simulated rig was seeded with, where it was one
        if let Some(seed) = store.meta("demo_seed")? {
            source.settings.insert("seed".into(), seed.into());
        }
        source.link = store.link_counters()?;
        Ok(source)
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
                    (count.wanted as usize, count.kept as usize, refused)
                });
                completeness(name.name(), own)
            })
            .collect()
    }
}
