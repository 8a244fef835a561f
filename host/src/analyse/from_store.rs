//! Access to a campaign file as measurements: records decoded, in SI units, one cell at a time,
//! from any thread; the file's provenance, how much of the plan was measured, and the FRFs of one
//! configuration over any range of lines.

use super::assemble::{everything, hits};
use super::averages::{Asked, CellAverage, CellSums};
use super::campaign::analyse_measurements;
use super::cell::{
    CellName, ContactDelays, Hit, KnownContact, MassCell, Measurements, OpenAndClosed, Progress, SensorMass,
    ShakerLevel, Wanted,
};
use super::chosen::DataQuality;
use super::findings::Findings;
use super::missing::Missing;
use super::modal::{FoundModes, NoModes};
use super::plan_geometry::{geometry, places};
use super::wear::wear;
use crate::campaign::plan::{OpenJointCells, Plan, ResponsePoint, structure};
use crate::campaign::run::shaking;
use crate::campaign::run::tally::Tally;
use crate::campaign::store::Store;
use crate::campaign::store::cell_table::CellRow;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::frf_table::ImportedFrf;
use crate::campaign::store::level_table::LevelRow;
use crate::campaign::store::record_table::{Damaged, RecordRow};
use crate::campaign::store::rows::{Rows, places as response_places};
use crate::campaign::store::session_table::SessionInfo;
use crate::contact::{Bulk, ContactPriors};
use crate::device::channels::ChannelMap;
use crate::device::samples::ChannelView;
use crate::hysteresis::HysteresisRecord;
use crate::results;
use crate::results::{Calibrated, Cells, Completeness, HitRow, Source, rounded};
use crate::spectra::MotionQuantity;
use crate::structure::Structure;
use crate::substructuring::geometry::{Geometry, Grouping};
use crate::substructuring::{Band, Frf};
use jointrig_protocol::channel::{Quantity, Role};
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// Why a campaign file cannot be analysed, or one of its cells cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum AnalyseError {
    /// The file cannot be read, or a record is damaged.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A channel that is required for analysing an impact is missing.
    #[error("record {record}: its session has no channel for {role}")]
    NoChannel {
        /// The record.
        record: i64,
        /// The missing channel.
        role: &'static str,
    },
    /// One cell has records of two sampling rates.
    #[error(
        "record {record} was sampled at {rate_hz} Hz, earlier ones at {others_hz} Hz, so their spectra have different lines: refuse one or the other and measure again"
    )]
    Rate {
        /// The record.
        record: i64,
        /// Its rate, Hz.
        rate_hz: f64,
        /// Rate of the earlier records, Hz.
        others_hz: f64,
    },
    /// The response channels of the file's sessions measure different quantities, or a quantity
    /// that is not motion.
    #[error(
        "the vibrometer's channels measure {0}: velocity, displacement or acceleration is needed, the same in all sessions"
    )]
    Quantity(String),
}

/// Time kept before the trigger, s: the force window begins 1 ms before the pulse, which is 51
/// scans at 51.2 kHz.
const LEAD_S: f64 = 1.25e-3;

/// The part of each record that is analysed: the same length for all, so that their FRFs have the
/// same lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnalysedLength {
    /// The plan's length, s.
    plan_s: f64,
    /// Lengths of the kept records that were imported from files.
    imported: Option<ImportedLengths>,
    /// Whether records were measured in this campaign; these have the plan's length.
    measured: bool,
}

/// Lengths of the kept records that were imported from files, s.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ImportedLengths {
    /// Length of the shortest record, from its first sample on.
    shortest: f64,
    /// Length of the longest record, from its first sample on.
    longest: f64,
    /// Shortest and longest length after the time kept before the trigger.
    from_lead: [f64; 2],
}

impl AnalysedLength {
    /// Lengths of the kept records of a campaign.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of(store: &Store, plan: &Plan) -> Result<Self, StoreError> {
        let sessions = store.sessions()?;
        let imported: HashSet<i64> = (sessions.iter())
            .filter(|(_, info)| info.board == SessionInfo::IMPORTED)
            .map(|(id, _)| *id)
            .collect();
        let mut found =
            AnalysedLength { plan_s: plan.record.get_ref().length_s, imported: None, measured: false };
        if imported.is_empty() {
            return Ok(AnalysedLength { measured: true, ..found });
        }
        let mut rates = HashMap::new();
        for id in &imported {
            rates.insert(*id, f64::from(store.channels(*id)?.rate_hz));
        }
        for record in store.records()?.iter().flatten().filter(|record| record.kept()) {
            let Some(rate_hz) = rates.get(&record.session) else {
                found.measured = true;
                continue;
            };
            let own_s = record.scans as f64 / rate_hz;
            let after_s = record.scans.saturating_sub(first_sample(record, *rate_hz)) as f64 / rate_hz;
            found.imported = Some(found.imported.map_or(
                ImportedLengths { shortest: own_s, longest: own_s, from_lead: [after_s; 2] },
                |so_far| ImportedLengths {
                    shortest: so_far.shortest.min(own_s),
                    longest: so_far.longest.max(own_s),
                    from_lead: [so_far.from_lead[0].min(after_s), so_far.from_lead[1].max(after_s)],
                },
            ));
        }
        Ok(found)
    }

    /// The length to which records are used from their first sample on; `None` if the plan's length
    /// applies.
    fn whole_s(&self) -> Option<f64> {
        let imported = self.imported.filter(|_| !self.measured)?;
        // a record of the plan's length additionally contains the time before the trigger
        let as_planned = (0.0..=LEAD_S).contains(&(imported.from_lead[0] - self.plan_s));
        (!as_planned).then_some(imported.shortest)
    }

    /// The range of samples of a record that is analysed. Records that are used whole begin with
    /// their first sample, so that their lines are those of their own length; longer ones are cut
    /// at the end before the part ahead of the hit is shortened.
    pub fn samples(&self, record: &RecordRow, rate_hz: f64) -> Range<usize> {
        let length = |seconds: f64| (seconds * rate_hz).round() as usize;
        let lead = first_sample(record, rate_hz);
        match self.whole_s().map(length) {
            Some(whole) => {
                let from = lead.min(record.scans.saturating_sub(whole));
                from..from + whole
            }
            None => lead..lead + length(self.plan_s),
        }
    }

    /// A message about imported records whose length differs from that of the plan.
    pub fn notice(&self) -> Option<String> {
        let ImportedLengths { shortest, longest, from_lead } = self.imported?;
        let plan_s = self.plan_s;
        if self.measured {
            return (from_lead[1] > plan_s + LEAD_S).then(|| {
                format!(
                    "imported records last up to {:.3} s after the hit: they are cut to the plan's length_s of {plan_s} s, which the \
                     measured records have",
                    from_lead[1]
                )
            });
        }
        if longest - shortest > LEAD_S {
            return Some(format!(
                "imported records last from {shortest:.3} to {longest:.3} s: the analysis cuts all of them to {:.3} s, so that their FRFs have \
                 the same lines",
                self.whole_s().unwrap_or(plan_s)
            ));
        }
        self.whole_s().map(|whole_s| {
            format!(
                "imported records last {whole_s:.3} s, and the plan's length_s is {plan_s} s: they are used in full, with a line every {:.3} Hz",
                1.0 / whole_s
            )
        })
    }
}

/// Fewest samples before the analysed part of a record whose mean is subtracted from it: the mean
/// of fewer adds more than a tenth to the noise at 100 Hz.
const FEWEST_BEFORE: usize = 128;

/// What a sensor shows before a hit, in the samples' own unit: the mean of the samples before
/// `start`, which the hit has not reached; 0 if there are too few.
///
/// It is the sensor's offset, or the velocity of a body on a soft support that still sways from the
/// hit before, too slowly for the wait between hits to notice. Either begins with the record, as a
/// step, whose spectrum falls with frequency like that of a free body: a sway of 3 % of the
/// velocity after the hit changes single lines of its FRF by 4 %.
pub fn before_the_hit(samples: ChannelView<'_>, start: usize) -> f64 {
    let before = samples.part(0, start);
    if before.len() < FEWEST_BEFORE { 0.0 } else { before.mean().unwrap_or(0.0) }
}

/// The first sample of a record that is analysed. A soft pulse needs more samples before the
/// trigger, because the trigger is on its flank.
fn first_sample(record: &RecordRow, rate_hz: f64) -> usize {
    let lead_s = LEAD_S.max(1e-6 * f64::from(record.shot.width_us));
    record.trigger_index.saturating_sub((lead_s * rate_hz).ceil() as usize)
}

/// Analyses a campaign file for the joint. Values in `known` take precedence over those of the
/// plan.
///
/// # Errors
/// The file itself cannot be read. Missing or damaged parts of it are reported in the findings
/// instead.
pub fn analyse(
    store: &Store,
    wanted: Wanted,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Findings, AnalyseError> {
    let file = CampaignFile::open(store, wanted.known)?;
    let (source, completeness) = (file.source(store)?, file.completeness());
    let found = analyse_measurements(&file, wanted, progress);
    let cells = Some(file.cell_rows(&found.data_quality));
    let (geometry, hits) = (places(&file.plan), file.hit_rows());
    let mut found = Findings { source, completeness, geometry, cells, hits, ..found };
    match wear(store) {
        Ok(wear) => found.wear = wear,
        Err(error) => found.missing.push(Missing::Wear(error.to_string())),
    }
    Ok(found)
}

pub(super) struct PlannedCell {
    pub(super) id: i64,
    /// The cell whose hits fill this one, if it is not struck itself.
    pub(super) lead: Option<i64>,
    pub(super) name: CellName,
    row: CellRow,
    given_up: Option<String>,
}

/// A campaign file as a source of measurements.
pub struct CampaignFile {
    pub(super) path: PathBuf,
    pub(super) plan: Plan,
    known: KnownContact,
    geometry: Geometry,
    quantity: MotionQuantity,
    pub(super) cells: Vec<PlannedCell>,
    pub(super) tally: Tally,
    pub(super) records: HashMap<i64, Vec<Result<RecordRow, Damaged>>>,
    /// Of each session, with the specimens' vibrometers positive along the sliding direction.
    channels: HashMap<i64, ChannelMap>,
    analysed: AnalysedLength,
    /// Open connections that no thread uses at the moment: an SQLite connection can be passed
    /// between threads but not shared.
    idle: Mutex<Vec<Store>>,
}

impl CampaignFile {
    /// Reads everything except the samples. Values in `known` take precedence over those of the
    /// plan.
    ///
    /// # Errors
    /// The file cannot be read, or its sessions measure different quantities.
    pub fn open(store: &Store, known: KnownContact) -> Result<Self, AnalyseError> {
        let plan = store.plan()?;
        let planned = plan.contact.as_ref().map(|contact| *contact.get_ref()).unwrap_or_default();
        let known = KnownContact {
            normal_load_n: known.normal_load_n.or(planned.normal_load_n),
            parallel_path: known.parallel_path.or(planned.parallel_path),
            effective_mass_kg: known.effective_mass_kg.or(planned.effective_mass_kg),
        };
        let (rows, all) = (store.cells()?, store.records()?);
        let shared = Rows::new(&plan, &rows);
        let tally = Tally::new(&rows, shared.clone(), &all);
        let given_up: HashMap<i64, Option<String>> =
            rows.iter().map(|row| (row.id, row.given_up.clone())).collect();
        let cells = rows
            .into_iter()
            .map(|row| {
                let lead = shared.lead(row.id);
                PlannedCell {
                    id: row.id,
                    lead,
                    name: CellName {
                        configuration: structure(row.cell.configuration),
                        impact: row.cell.impact.clone(),
                        response: row.cell.response.clone(),
                    },
                    given_up: given_up.get(&lead.unwrap_or(row.id)).cloned().flatten(),
                    row,
                }
            })
            .collect();
        let mut records: HashMap<i64, Vec<Result<RecordRow, Damaged>>> = HashMap::new();
        for record in all {
            let cell = record.as_ref().map_or_else(|damaged| damaged.place.cell, |row| row.cell);
            records.entry(cell).or_default().push(record);
        }
        let mut channels = HashMap::new();
        for (session, _) in store.sessions()? {
            channels.insert(session, plan.along_sliding(store.channels(session)?));
        }
        Ok(CampaignFile {
            path: store.path().into(),
            geometry: geometry(&plan),
            quantity: response_quantity(&plan, channels.values())?,
            analysed: AnalysedLength::of(store, &plan)?,
            known,
            plan,
            cells,
            tally,
            records,
            channels,
            idle: Mutex::new(Vec::new()),
        })
    }

    /// The records used for a cell: its own, and those of the cell whose hits fill it.
    fn records_for(&self, cell: &PlannedCell) -> impl Iterator<Item = &Result<RecordRow, Damaged>> {
        let struck = [Some(cell.id), cell.lead].into_iter().flatten();
        struck.filter_map(|id| self.records.get(&id)).flatten()
    }

    /// The kept records that are used for a cell.
    pub(super) fn kept_records(&self, name: &CellName) -> Vec<i64> {
        let Some(cell) = self.cells.iter().find(|cell| cell.name == *name) else { return Vec::new() };
        self.records_for(cell).flatten().filter(|record| record.kept()).map(|record| record.id).collect()
    }

    /// The cell of the last record, where hammer and vibrometer are; `None` without records.
    pub(super) fn last_struck(&self) -> Option<CellName> {
        let last = self.records.values().flatten().flatten().max_by_key(|record| record.id)?;
        self.cells.iter().find(|cell| cell.id == last.cell).map(|cell| cell.name.clone())
    }

    /// Runs `work` with a connection that no other thread uses.
    fn with_reader<T>(
        &self,
        work: impl FnOnce(&Store) -> Result<T, AnalyseError>,
    ) -> Result<T, AnalyseError> {
        // the list of connections is valid even after a poisoned lock
        let waiting = || self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let idle = waiting().pop();
        let store = match idle {
            Some(store) => store,
            None => Store::open_read_only(&self.path)?,
        };
        let result = work(&store);
        waiting().push(store);
        result
    }

    /// Reads a record's signals for a cell into `hit`, including those at the contact if requested;
    /// returns its sampling rate, Hz.
    fn read_hit(
        &self,
        store: &Store,
        cell: &CellRow,
        record: &RecordRow,
        contact: bool,
        hit: &mut Hit,
    ) -> Result<f64, AnalyseError> {
        let missing = |role| AnalyseError::NoChannel { record: record.id, role };
        let map = self.channels.get(&record.session).ok_or(missing("anything"))?;
        let rate = map.fs_hz();
        let force = map.place(Role::HammerForce).ok_or(missing("the hammer's force"))?;
        let responses = response_places(&self.plan, cell, record, map).ok_or(missing("the response"))?;
        let is_velocity = |place: usize| map.channels[place].quantity == Quantity::Velocity;
        let cells = self.plan.load_cells(map);
        let at_contact = match (map.place(Role::SpecimenA), map.place(Role::SpecimenB)) {
            (Some(a), Some(b)) if contact && is_velocity(a) && is_velocity(b) && !cells.is_empty() => {
                Some((a, b))
            }
            _ => None,
        };
        let delay = |place: usize| f64::from(map.channels[place].delay_ns) * 1e-9;
        let late = |place: usize| delay(place) - delay(force);
        hit.record = record.id;
        hit.of_row = record.cell != cell.id;
        hit.response.resize_with(responses.len(), Vec::new);
        hit.response_delay_s = responses.iter().map(|place| late(*place)).collect();
        let only_force = contact && at_contact.is_none() && !cells.is_empty();
        hit.load_cells = only_force.then(|| {
            let mut signal = hit.load_cells.take().unwrap_or_default();
            signal.tangential_n.clear();
            signal.delay_s = late(cells[0].0);
            signal
        });
        hit.contact = at_contact.map(|(a, b)| {
            let mut signals = hit.contact.take().unwrap_or_default();
            signals.tangential_n.clear();
            // the load cells share one amplifier, so they have the same delay
            signals.delay_s =
                ContactDelays { specimen_a: late(a), specimen_b: late(b), load_cells: late(cells[0].0) };
            signals
        });
        // unpack only the channels that are needed
        let mut wanted: Vec<usize> = std::iter::once(force).chain(responses.iter().copied()).collect();
        if let Some((a, b)) = at_contact {
            wanted.extend([a, b]);
        }
        if at_contact.is_some() || only_force {
            wanted.extend(cells.iter().map(|(place, _)| *place));
        }
        let mut seen = HashSet::new();
        wanted.retain(|place| seen.insert(*place));
        // exactly as many samples as the plan's length, so that two seconds give lines every 0.5 Hz
        let analysed = self.analysed.samples(record, rate);
        store.each_channel(record, &wanted, |place, samples| {
            let before = before_the_hit(samples, analysed.start);
            let samples = samples.part(analysed.start, analysed.end);
            let units = map.units(place, samples.of()).unwrap_or(0.0);
            if place == force {
                map.si_into(place, samples, &mut hit.force_n);
            }
            let write = |signal: &mut Vec<f64>| {
                map.si_into(place, samples, signal);
                for value in signal {
                    *value -= units * before;
                }
            };
            for (signal, _) in hit.response.iter_mut().zip(&responses).filter(|(_, own)| **own == place) {
                write(signal);
            }
            let tangential_n = match (at_contact, &mut hit.contact, &mut hit.load_cells) {
                (Some((a, b)), Some(signals), _) => {
                    if place == a {
                        write(&mut signals.specimen_a_m_per_s);
                    }
                    if place == b {
                        write(&mut signals.specimen_b_m_per_s);
                    }
                    &mut signals.tangential_n
                }
                (None, _, Some(signal)) => &mut signal.tangential_n,
                _ => return,
            };
            for (_, part) in cells.iter().filter(|(own, _)| *own == place) {
                tangential_n.resize(samples.len(), 0.0);
                samples.put(tangential_n, |sum, sample| *sum += part * ((sample - before) * units));
            }
        })?;
        Ok(rate)
    }
}

impl CampaignFile {
    fn level(&self, store: &Store, row: &LevelRow) -> Result<ShakerLevel, String> {
        if !row.gaps.is_empty() {
            return Err("some of its samples were lost during transmission: measure it again".into());
        }
        let channels = self.channels.get(&row.session).ok_or("its session is missing")?;
        let samples = store.level_samples(row).map_err(|error| error.to_string())?;
        let record = shaking::record(channels, &self.plan.load_cells(channels), &samples, &row.level())
            .map_err(|error| error.to_string())?;
        let record = HysteresisRecord { normal_load_n: self.known.normal_load_n, ..record };
        Ok(ShakerLevel { id: row.id, moment: row.moment, level: row.level(), record })
    }
}

impl Measurements for CampaignFile {
    type Error = AnalyseError;

    fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    fn sigma_per_s(&self) -> f64 {
        self.plan.window.get_ref().exponential_per_s
    }

    fn quantity(&self) -> MotionQuantity {
        self.quantity
    }

    fn cells(&self) -> Vec<CellName> {
        let apart = [self.known_mass().map(|cell| cell.name), self.open_joint().map(|cells| cells.open)];
        let names = self.cells.iter().map(|c| &c.name);
        names.filter(|name| !apart.iter().flatten().any(|own| own == *name)).cloned().collect()
    }

    fn session_of(&self, record: i64) -> Option<i64> {
        let rows = self.records.values().flatten().flatten();
        rows.filter(|row| row.id == record).map(|row| row.session).next()
    }

    fn given_up(&self) -> Vec<(CellName, String)> {
        self.cells.iter().filter_map(|c| Some((c.name.clone(), c.given_up.clone()?))).collect()
    }

    fn imported(&self, structure: Structure) -> Result<Option<ImportedFrf>, AnalyseError> {
        self.with_reader(|store| Ok(store.frf(structure.name())?))
    }

    fn known_contact(&self) -> KnownContact {
        self.known
    }

    fn spots_m(&self) -> Option<[[f64; 3]; 2]> {
        let at = |name: &str| {
            self.plan
                .geometry
                .sensor
                .iter()
                .map(toml::Spanned::get_ref)
                .find(|s| s.name == name)
                .map(|s| s.position_m)
        };
        Some([at("LDV_A")?, at("LDV_B")?])
    }

    fn specimens(&self) -> [Option<Bulk>; 2] {
        self.plan.known_specimens()
    }

    fn contact_priors(&self) -> ContactPriors {
        self.plan.priors.as_ref().map_or_else(ContactPriors::default, |priors| priors.get_ref().known())
    }

    fn point_sigma_m(&self, point: &str) -> Option<f64> {
        let mut points = self.plan.geometry.response.iter().map(toml::Spanned::get_ref);
        points.find(|own| own.name == point)?.sigma_m
    }

    fn is_fixed(&self, point: &str) -> bool {
        self.plan.own_channels(point).is_some()
    }

    fn has_all_lasers(&self, point: &str) -> bool {
        self.plan.response(point).is_some_and(|point| point.lasers)
    }

    fn known_mass(&self) -> Option<MassCell> {
        let (own, cell) = (self.plan.known_mass.as_ref()?.get_ref(), self.plan.known_mass_cell()?);
        Some(MassCell {
            name: CellName { configuration: Structure::B, impact: cell.impact, response: cell.response },
            mass_kg: own.mass_kg,
            sigma: own.sigma(),
            axis: cell.axis,
            lasers: cell.lasers,
        })
    }

    fn open_joint(&self) -> Option<OpenAndClosed> {
        let OpenJointCells { open, closed, axes } = self.plan.open_joint_cells()?;
        let [open, closed] = [open, closed].map(|[impact, response]| CellName {
            configuration: Structure::Ajb,
            impact,
            response,
        });
        Some(OpenAndClosed { open, closed, axes })
    }

    fn sensor_masses(&self) -> Vec<SensorMass> {
        let points = self.plan.geometry.response.iter().map(toml::Spanned::get_ref);
        let own = |point: &ResponsePoint| {
            Some(SensorMass {
                point: point.name.clone(),
                grouping: Grouping::try_from(point.grouping).ok()?,
                mass_kg: 1e-3 * point.mass_g?,
            })
        };
        points.filter_map(own).collect()
    }

    fn shaker_levels(&self) -> (Vec<ShakerLevel>, Vec<String>) {
        let (mut levels, mut complaints) = (Vec::new(), Vec::new());
        let read = self.with_reader(|store| {
            for row in store.levels()? {
                let row = match row {
                    Ok(row) => row,
                    Err(damaged) => {
                        complaints.push(format!(
                            "Shaker, level {} is damaged ({}) and was left out.",
                            damaged.id, damaged.what
                        ));
                        continue;
                    }
                };
                match self.level(store, &row) {
                    Ok(level) => levels.push(level),
                    Err(why) => {
                        complaints.push(format!("Shaker, {} ({}): {why}.", row.level(), row.moment.name()));
                    }
                }
            }
            Ok(())
        });
        complaints.extend(read.err().map(|error| format!("The shaker's levels: {error}.")));
        (levels, complaints)
    }

    fn each_hit(
        &self,
        cell: &CellName,
        contact: bool,
        look: &mut dyn FnMut(&Hit, f64),
    ) -> Result<Vec<String>, AnalyseError> {
        let Some(planned) = self.cells.iter().find(|c| c.name == *cell) else { return Ok(Vec::new()) };
        self.with_reader(|store| {
            // reuse the same buffers for every hit
            let (mut left_out, mut rate_hz, mut hit) = (Vec::new(), None, Hit::default());
            for record in self.records_for(planned) {
                let record = match record {
                    Ok(record) if record.kept() => record,
                    Ok(_) => continue,
                    Err(Damaged { place, what }) => {
                        left_out.push(format!("record {} is damaged ({what}) and was left out", place.id));
                        continue;
                    }
                };
                match self.read_hit(store, &planned.row, record, contact, &mut hit) {
                    Ok(rate) => {
                        let others_hz = *rate_hz.get_or_insert(rate);
                        if others_hz != rate {
                            return Err(AnalyseError::Rate { record: record.id, rate_hz: rate, others_hz });
                        }
                        look(&hit, rate);
                    }
                    Err(AnalyseError::Store(StoreError::Damaged { record, what, .. })) => {
                        left_out.push(format!("record {record} is damaged ({what}) and was left out"));
                    }
                    Err(other) => return Err(other),
                }
            }
            Ok(left_out)
        })
    }
}

fn response_quantity<'a>(
    plan: &Plan,
    maps: impl Iterator<Item = &'a ChannelMap>,
) -> Result<MotionQuantity, AnalyseError> {
    let mut found: Vec<Quantity> = Vec::new();
    for map in maps {
        // ignore a vibrometer that measures no point of the plan
        let points = plan.geometry.response.iter().map(toml::Spanned::get_ref);
        for place in points.filter_map(|point| plan.response_places(&point.name, map)).flatten() {
            let quantity = map.channels[place].quantity;
            if !found.contains(&quantity) {
                found.push(quantity);
            }
        }
    }
    match found[..] {
        // nothing was connected yet, so nothing will be read either
        [] | [Quantity::Velocity] => Ok(MotionQuantity::Velocity),
        [Quantity::Displacement] => Ok(MotionQuantity::Displacement),
        [Quantity::Acceleration] => Ok(MotionQuantity::Acceleration),
        _ => Err(AnalyseError::Quantity(found.iter().map(|q| q.unit()).collect::<Vec<_>>().join(" and "))),
    }
}

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
        source.measured_again = store.measured_again()?;
        source.temperature_c = temperature_c(store)?;
        Ok(source)
    }

    /// Every cell of the plan, in order, with its data quality.
    pub(super) fn cell_rows(&self, data_quality: &DataQuality) -> Cells {
        let rows = self.cells.iter().map(|cell| {
            let count = self.tally.cell(cell.id);
            let name = &cell.name;
            let own = data_quality.cells.iter().find(|h| h.name == *name);
            results::CellRow {
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
        Cells { cells: rows.collect(), frequency_hz: data_quality.frequency_hz.clone() }
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

/// From counts per cell: whether the cell is struck itself rather than filled by the hits of
/// another, and (planned, kept, refused by verdict).
pub fn completeness<'a>(
    name: &str,
    cells: impl IntoIterator<Item = (bool, (usize, usize, Vec<(&'a str, usize)>))>,
) -> Completeness {
    let mut sum = Completeness { configuration: name.into(), ..Completeness::default() };
    for (struck, (wanted, kept, refused)) in cells {
        sum.cells += 1;
        sum.cells_complete += usize::from(kept >= wanted);
        if !struck {
            continue;
        }
        sum.wanted += wanted;
        sum.kept += kept;
        for (verdict, count) in refused {
            *sum.refused.entry(verdict.to_owned()).or_default() += count;
        }
    }
    sum
}

/// Minimum, mean and maximum temperature, °C; `None` without measurements.
pub(super) fn temperature_c(store: &Store) -> Result<Option<[f64; 3]>, AnalyseError> {
    let all: Vec<f64> = store.temperatures()?.iter().map(|row| row.celsius).collect();
    let (least, most) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), celsius| {
        (least.min(*celsius), most.max(*celsius))
    });
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    Ok((!all.is_empty()).then(|| [least, mean, most].map(|celsius| rounded(celsius, 4))))
}

/// The change made by every calibration, in the order of entry, relative to the first session to
/// which it applies.
pub(super) fn calibrated(store: &Store) -> Result<Vec<Calibrated>, AnalyseError> {
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

impl CampaignFile {
    /// The FRFs of a configuration's kept hits between two frequencies, Hz, for every pair of the
    /// geometry, computed as in the analysis, with the number of hits in each (outputs × inputs);
    /// and messages about cells and records that cannot be used. `None` without a kept hit.
    pub fn measured(
        &self,
        structure: Structure,
        lines_hz: [f64; 2],
    ) -> (Option<(Frf, DMatrix<usize>)>, Vec<String>) {
        let own: Vec<&CellName> =
            self.cells.iter().map(|cell| &cell.name).filter(|name| name.configuration == structure).collect();
        let one = |name: &&CellName| {
            let complaint =
                |what: String| format!("{structure}: cell {} × {}: {what}.", name.impact, name.response);
            let mut sums = CellSums::new((*name).clone(), self.sigma_per_s(), Asked::default(), lines_hz);
            let (mut some, mut unfit) = (false, None);
            let read = self.each_hit(name, false, &mut |hit, fs_hz| {
                some = true;
                if unfit.is_none() {
                    unfit = sums.add(hit, fs_hz).err();
                }
            });
            let left_out = match read {
                Ok(left_out) => left_out,
                Err(error) => return (None, vec![complaint(error.to_string())]),
            };
            let mut complaints: Vec<String> = left_out.into_iter().map(complaint).collect();
            if !some {
                return (None, complaints);
            }
            let found = unfit.map_or_else(|| sums.finish(), Err);
            complaints.extend(found.as_ref().err().map(|error| complaint(error.to_string())));
            (found.ok(), complaints)
        };
        let (averages, complaints): (Vec<_>, Vec<_>) = own.par_iter().map(one).unzip();
        let averages: Vec<CellAverage> = averages.into_iter().flatten().collect();
        let complaints = complaints.concat();
        let points = self.geometry().points(structure);
        let found = everything(points, &averages, self.quantity());
        (found.map(|frf| (frf, hits(points, &averages))), complaints)
    }

    /// The modes of a structure from its FRFs, in `band`.
    ///
    /// # Errors
    /// [`NoModes`].
    pub fn modes(&self, structure: Structure, frf: &Frf, band: Band) -> Result<FoundModes, NoModes> {
        FoundModes::of_structure(structure, frf, self.geometry().points(structure), band)
    }
}

#[cfg(test)]
#[path = "from_store_tests.rs"]
mod tests;
