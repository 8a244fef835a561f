//! Which further cells shrink k_T's interval most per minute, and when a wanted interval is
//! reached, from the fit of the hits so far (`contact::forecast`): hits in cells that have some,
//! and cells of the plan that have none.
//!
//! A visit to a cell costs the moves to it, from where hammer and vibrometer are, and its hits.
//! Visits are chosen one after another, each the one with the largest gain per minute. That a
//! visit's gain only falls as other hits are added saves most of the predictions.

use super::cell::{CellName, KnownContact, Measurements};
use super::cells_stage::{Cells, drift_of_the_contact, read, slip_under_the_hammer};
use super::contact_answer::{cells as contact_cells, input, reads};
use super::from_store::{AnalyseError, CampaignFile};
use super::separate_cells::{known_mass, second_path};
use crate::campaign::plan::Plan;
use crate::campaign::store::Store;
use crate::contact::{
    Axes, Cause, ContactError, Doubt, Forecast, ForecastCell, Interval, PlannedCell, SecondPath, Stiffness,
    forecast,
};
use crate::structure::Structure;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// Why there is no prediction.
#[derive(Debug, thiserror::Error)]
pub enum NextError {
    /// The campaign file cannot be read.
    #[error(transparent)]
    Analyse(#[from] AnalyseError),
    /// There is no k_T yet whose interval could shrink.
    #[error(
        "there is no k_T yet, so nothing can be predicted: {0}. Measure the plan's cells first (`jointrig campaign run`)"
    )]
    NoStiffness(#[from] ContactError),
}

/// Durations from which minutes are counted, s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Times {
    /// A hit: until the structure is at rest, the record, and its storing.
    pub hit_s: f64,
    /// Moving the vibrometer to another response.
    pub vibrometer_s: f64,
    /// Moving the hammer to another impact.
    pub hammer_s: f64,
    /// Changing the structure, from B alone to the assembly or back.
    pub structure_s: f64,
    /// Measuring the places of one cause again, with half their stated errors; `None` if that is
    /// not possible.
    pub again_s: Option<f64>,
}

impl Times {
    /// Time for a record's structure to come to rest and the record to be stored, s.
    const REST_S: f64 = 3.0;
    /// Default durations of the moves, s.
    const MOVES_S: [f64; 3] = [20.0, 60.0, 1800.0];

    /// The usual durations, with the record length of the plan.
    pub fn of(plan: &Plan) -> Self {
        let [vibrometer_s, hammer_s, structure_s] = Self::MOVES_S;
        let hit_s = plan.record.get_ref().length_s + Self::REST_S;
        Times { hit_s, vibrometer_s, hammer_s, structure_s, again_s: None }
    }

    /// Duration of the moves from one cell to another, s; the first cell of all needs both. Sensors
    /// that stay do not move.
    pub fn moves_s(&self, from: Option<&CellName>, to: &CellName, stays: bool) -> f64 {
        let other = |of: fn(&CellName) -> &str| from.is_none_or(|from| of(from) != of(to));
        let structure = from.is_some_and(|from| from.configuration != to.configuration);
        let hammer = structure || other(|cell| &cell.impact);
        let vibrometer = !stays && (structure || other(|cell| &cell.response));
        [(structure, self.structure_s), (hammer, self.hammer_s), (vibrometer, self.vibrometer_s)]
            .into_iter()
            .filter(|(moves, _)| *moves)
            .map(|(_, seconds)| seconds)
            .sum()
    }
}

/// Further hits in one cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Visit {
    /// The cell.
    pub cell: CellName,
    /// Good hits before the visit.
    pub hits: usize,
    /// Further good hits.
    pub more: usize,
    /// Duration of its moves and hits, s.
    pub seconds: f64,
    /// Relative half width of k_T's 95 % interval after the visit.
    pub half_width: f64,
}

/// Forecast of a campaign.
#[derive(Debug, Clone)]
pub struct Outlook {
    /// k_T of the hits with its interval, N/m, as `analyse` states it.
    pub k_t_n_per_m: Interval,
    /// Assumptions that do not hold, for which `analyse` gives no k_T.
    pub doubts: Vec<Doubt>,
    /// Whether the contact slips under the hammer, for which `analyse` gives no k_T.
    pub slips: bool,
    /// Good hits that the estimate uses.
    pub hits: usize,
    /// Cells of the plan without hits whose effect cannot be predicted.
    pub unpredicted: Vec<CellName>,
    /// The durations.
    pub times: Times,
    /// The cell that hammer and vibrometer are at.
    at: Option<CellName>,
    /// The forecast's cells.
    cells: Vec<OutlookCell>,
    forecast: Forecast,
    /// Fewest good hits of a cell.
    minimum: usize,
    /// Largest number of hits in one visit.
    most: usize,
}

/// A cell of the forecast.
#[derive(Debug, Clone, PartialEq)]
struct OutlookCell {
    name: CellName,
    /// Whether its sensors stay.
    stays: bool,
    /// Whether hits may be added: it was not given up.
    open: bool,
}

/// An upper bound of the gain of a visit to a cell.
#[derive(Debug, Clone, Copy)]
struct Bound {
    cell: usize,
    gain: f64,
    /// The step at which it was predicted.
    of: Option<usize>,
}

/// The cause of uncertainty that dominates when more hits hardly help.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dominating {
    /// The cause.
    pub cause: Cause,
    /// Relative standard deviation of k_T by it.
    pub share: f64,
    /// Relative half width of k_T's interval if its stated errors were half as large; `None` if
    /// nothing is stated of it.
    pub half_width_if_halved: Option<f64>,
}

/// Places that are measured again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Again {
    /// Which.
    pub cause: Cause,
    /// Duration, s.
    pub seconds: f64,
    /// Relative half width of k_T's 95 % interval with half their stated errors.
    pub half_width: f64,
}

/// Cells averaged before, so that only those with new hits are read again.
#[derive(Debug, Default)]
pub struct Averaged(Vec<(CellName, Vec<i64>, Cells)>);

impl Averaged {
    /// The averages of all cells that the contact's estimate uses.
    fn update(&mut self, file: &CampaignFile) -> Cells {
        let names = file.cells();
        let wanted = names.into_iter().filter(|name| reads(file.geometry(), name));
        let wanted: Vec<(CellName, Vec<i64>)> =
            wanted.map(|name| (name.clone(), file.kept_records(&name))).collect();
        let before = std::mem::take(&mut self.0);
        let stale = |(name, records): &(CellName, Vec<i64>)| {
            !before.iter().any(|(of, own, _)| of == name && own == records)
        };
        let new: Vec<(CellName, Vec<i64>, Cells)> = (wanted.par_iter().filter(|own| stale(own)))
            .map(|(name, records)| (name.clone(), records.clone(), read(file, name, false)))
            .collect();
        let kept = before
            .into_iter()
            .filter(|(name, records, _)| wanted.iter().any(|(of, own)| of == name && own == records));
        self.0 = kept.chain(new).collect();
        let place = |name: &CellName| wanted.iter().position(|(of, _)| of == name);
        self.0.sort_by_key(|(name, ..)| place(name));
        let mut all = Cells::default();
        for (.., cells) in &self.0 {
            all.averages.extend(cells.averages.iter().cloned());
            all.at_contact.extend(cells.at_contact.iter().cloned());
        }
        all
    }
}

/// The outlook of a campaign file; `averaged` keeps what a later call can use again.
///
/// # Errors
/// The file cannot be read, or there is no k_T yet.
pub fn outlook(store: &Store, times: Times, averaged: &mut Averaged) -> Result<Outlook, NextError> {
    let file = CampaignFile::open(store, KnownContact::default())?;
    let all = averaged.update(&file);
    let geometry = file.geometry();
    let cells = contact_cells(&file, &all.averages, |average| average.damped.as_ref());
    if cells.is_empty() {
        return Err(NextError::NoStiffness(ContactError::NoCells));
    }
    let abandoned: Vec<CellName> = file.given_up().into_iter().map(|(name, _)| name).collect();
    let open = |name: &CellName| !abandoned.contains(name);
    let without: Vec<CellName> = (file.cells().into_iter())
        .filter(|name| reads(geometry, name) && !file.is_fixed(&name.response) && open(name))
        .filter(|name| !all.averages.iter().any(|own| own.name == *name))
        .collect();
    // if the hits on the known mass or with the joint open cannot be read, the analysis reports it,
    // and the interval is that without them
    let mass = known_mass(&file).unwrap_or_default();
    let planned: Vec<PlannedCell<'_>> = without.iter().filter_map(|name| planned(&file, name)).collect();
    let (mut found, mut forecast) = forecast(&input(&file, cells, mass), &planned)?;
    if let Some(drift) = drift_of_the_contact(&all.at_contact).filter(|drift| drift.found() == Some(true)) {
        found.allow_for(&drift);
        forecast.state(&found.k_t_n_per_m);
    }
    if let Some(path) = second_path(&file).unwrap_or_default().filter(SecondPath::found) {
        found.allow_for_path(&path);
        forecast.state(&found.k_t_n_per_m);
    }
    let Stiffness { k_t_n_per_m, doubts, .. } = found;
    let cells: Vec<OutlookCell> = (forecast.cells().iter())
        .map(|cell| {
            let name = CellName {
                configuration: cell.structure,
                impact: cell.impact.clone(),
                response: cell.point.clone(),
            };
            OutlookCell { stays: file.is_fixed(&cell.point), open: open(&name), name }
        })
        .collect();
    let unpredicted =
        without.iter().filter(|name| !cells.iter().any(|own| own.name == **name)).cloned().collect();
    let hits = file.plan.hits.get_ref();
    Ok(Outlook {
        k_t_n_per_m,
        doubts,
        slips: slip_under_the_hammer(&all.at_contact).found() == Some(true),
        hits: forecast.cells().iter().map(|cell| cell.hits).sum(),
        unpredicted,
        times,
        at: file.last_struck(),
        cells,
        forecast,
        minimum: hits.minimum as usize,
        most: hits.most as usize,
    })
}

fn planned<'a>(file: &'a CampaignFile, name: &'a CellName) -> Option<PlannedCell<'a>> {
    let points = file.geometry().points(name.configuration);
    let own = || points.channels.iter().filter(|point| point.name == name.response);
    let point = own().next()?;
    Some(PlannedCell {
        structure: name.configuration,
        impact: &name.impact,
        point: &point.name,
        point_m: point.position_m,
        point_sigma_m: file.point_sigma_m(&point.name),
        point_grouping: point.grouping,
        axes: Axes::new(&own().map(|point| point.direction).collect::<Vec<_>>())?,
        lasers: file.has_all_lasers(&point.name),
    })
}

impl Outlook {
    /// Relative half width of k_T's 95 % interval.
    pub fn half_width(&self) -> f64 {
        self.forecast.half_width()
    }

    /// The structure that was struck last.
    pub fn mounted(&self) -> Option<Structure> {
        self.at.as_ref().map(|at| at.configuration)
    }

    /// Relative standard deviation of k_T by cause.
    pub fn budget(&self) -> BTreeMap<Cause, f64> {
        self.forecast.budget()
    }

    /// Half width with [`GROWTH`] times the hits: in the cells of one structure, or in all.
    pub fn grown(&self, of: Option<Structure>) -> f64 {
        self.forecast.half_width_with_hits(GROWTH, |cell| of.is_none_or(|of| cell.structure == of))
    }

    /// Whether ever more hits in the cells of one structure, or in all, could make the half width
    /// this small. More hits also locate the places better, so the variance is no straight line
    /// over 1/hits: extrapolating one would give up too early.
    pub fn within_reach(&self, until: f64, of: Option<Structure>) -> bool {
        let all = |cell: &ForecastCell| of.is_none_or(|of| cell.structure == of);
        self.forecast.half_width_with_hits(EVER, all) <= until
    }

    /// What a person can measure again, if that is allowed: half widths with half the stated errors
    /// of the places, one cause at a time, the smallest first.
    pub fn again(&self) -> Vec<Again> {
        let Some(seconds) = self.times.again_s else { return Vec::new() };
        let halved = |cause| Again { cause, seconds, half_width: self.forecast.half_width_with(cause, 0.5) };
        let budget = self.budget();
        let stated = PLACES.into_iter().filter(|cause| budget.get(cause).is_some_and(|share| *share > 0.0));
        let mut all: Vec<Again> = stated.map(halved).collect();
        all.sort_by(|one, other| one.half_width.total_cmp(&other.half_width));
        all
    }

    /// The places that shrink the interval more per minute when they are measured again than these
    /// visits do.
    pub fn rather_again(&self, visits: &[Visit]) -> Option<Again> {
        let now = self.half_width();
        let seconds: f64 = visits.iter().map(|visit| visit.seconds).sum();
        let by_hits = visits.last().map_or(0.0, |last| gain(now, last.half_width) / seconds);
        let best = self.again().into_iter().next()?;
        let by_places = gain(now, best.half_width) / best.seconds;
        (by_places > by_hits && gain(now, best.half_width) > WORTH_A_STOP * now).then_some(best)
    }

    /// A visit to the cell with this index from `from`.
    fn visit(&self, forecast: &Forecast, cell: usize, from: Option<&CellName>) -> Visit {
        let (name, more) = (&self.cells[cell].name, self.more(forecast, cell, from));
        let (hits, seconds) = (forecast.cells()[cell].hits, self.seconds(cell, more, from));
        let half_width = forecast.half_width_after(cell, more);
        Visit { cell: name.clone(), hits, more, seconds, half_width }
    }

    /// The number of hits for which the gain per minute is largest, if the noise of a cell with n
    /// hits counts as 1/n.
    fn more(&self, forecast: &Forecast, cell: usize, from: Option<&CellName>) -> usize {
        let hits = forecast.cells()[cell].hits;
        let best = (hits as f64 * self.seconds(cell, 0, from) / self.times.hit_s).sqrt().round() as usize;
        let least = if hits == 0 { self.minimum.max(1) } else { 1 };
        best.clamp(least, self.most.max(least)).min(self.room(forecast, cell).max(1))
    }

    /// Hits that may still be added to a cell before the next fit.
    fn room(&self, forecast: &Forecast, cell: usize) -> usize {
        let present = self.forecast.cells()[cell].hits.max(self.minimum);
        (GROWTH * present).saturating_sub(forecast.cells()[cell].hits)
    }

    /// Duration of a visit from `from`, s.
    fn seconds(&self, cell: usize, more: usize, from: Option<&CellName>) -> f64 {
        let own = &self.cells[cell];
        self.times.moves_s(from, &own.name, own.stays) + more as f64 * self.times.hit_s
    }

    /// Visits to each cell from where hammer and vibrometer are, the largest gain per minute first.
    pub fn each_cell(&self) -> Vec<Visit> {
        let now = self.half_width();
        let own = (0..self.cells.len()).into_par_iter().filter(|cell| self.cells[*cell].open);
        let mut all: Vec<Visit> =
            own.map(|cell| self.visit(&self.forecast, cell, self.at.as_ref())).collect();
        let rate = |visit: &Visit| gain(now, visit.half_width) / visit.seconds;
        all.sort_by(|a, b| rate(b).total_cmp(&rate(a)));
        all
    }

    /// The visits that reach the half width `until`, each the one with the largest gain per minute
    /// when it is made, with at most this many hits together. The last one has just as many hits as
    /// it needs. They may not reach it: then no further hit reaches it, or too many are needed.
    pub fn route(
        &self,
        until: f64,
        most_hits: usize,
        except: &(dyn Fn(&CellName) -> bool + Sync),
    ) -> Vec<Visit> {
        let mut forecast = self.forecast.clone();
        let mut at = self.at.clone();
        let (mut visits, mut left, mut step): (Vec<Visit>, _, _) = (Vec::new(), most_hits, 0);
        let open = |cell: &usize| self.cells[*cell].open && !except(&self.cells[*cell].name);
        let mut bounds: Vec<Bound> = (0..self.cells.len())
            .filter(open)
            .map(|cell| Bound { cell, gain: f64::INFINITY, of: None })
            .collect();
        while forecast.half_width() > until && left > 0 {
            step += 1;
            bounds.retain(|own| self.room(&forecast, own.cell) > 0);
            let Some(best) = self.best(&forecast, &mut bounds, at.as_ref(), step) else { break };
            let now = forecast.half_width();
            let mut visit = self.visit(&forecast, best, at.as_ref());
            if gain(now, visit.half_width) <= NOTHING {
                break;
            }
            if visit.half_width <= until {
                let reaches = |more: &usize| forecast.half_width_after(best, *more) <= until;
                visit.more = (1..visit.more).find(reaches).unwrap_or(visit.more);
            }
            visit.more = visit.more.min(left);
            visit.seconds = self.seconds(best, visit.more, at.as_ref());
            if !forecast.add(best, visit.more) {
                break;
            }
            visit.half_width = forecast.half_width();
            left -= visit.more;
            at = Some(visit.cell.clone());
            match visits.last_mut().filter(|last| last.cell == visit.cell) {
                Some(last) => {
                    last.more += visit.more;
                    last.seconds += visit.seconds;
                    last.half_width = visit.half_width;
                }
                None => visits.push(visit),
            }
        }
        visits
    }

    /// The cell with the largest gain per minute. Only those whose upper bound might be the largest
    /// are predicted again at this step.
    fn best(
        &self,
        forecast: &Forecast,
        bounds: &mut [Bound],
        at: Option<&CellName>,
        step: usize,
    ) -> Option<usize> {
        let now = forecast.half_width();
        bounds.par_iter_mut().filter(|own| own.of.is_none()).for_each(|own| {
            own.gain = gain(now, self.visit(forecast, own.cell, at).half_width);
            own.of = Some(step);
        });
        loop {
            // more hits than those of the bound gain at most in proportion
            let rate = |own: &Bound| own.gain / self.seconds(own.cell, self.more(forecast, own.cell, at), at);
            let best = bounds.iter_mut().max_by(|a, b| rate(a).total_cmp(&rate(b)))?;
            if best.of == Some(step) {
                return Some(best.cell);
            }
            best.gain = gain(now, self.visit(forecast, best.cell, at).half_width);
            best.of = Some(step);
        }
    }

    /// The largest cause of uncertainty besides noise.
    pub fn dominating(&self) -> Option<Dominating> {
        let budget = self.budget();
        let (cause, share) = budget
            .into_iter()
            .filter(|(cause, _)| *cause != Cause::Noise)
            .max_by(|a, b| a.1.total_cmp(&b.1))?;
        let stated = !matches!(cause, Cause::Misfit | Cause::Drift | Cause::SecondPath);
        let half_width_if_halved = stated.then(|| self.forecast.half_width_with(cause, 0.5));
        Some(Dominating { cause, share, half_width_if_halved })
    }
}

/// Largest ratio of a cell's hits to those of the fit: how well its signals follow the model below
/// its present noise, only more hits show.
pub const GROWTH: usize = 4;

/// Ratio of a cell's hits to those of the fit at which their noise is negligible.
const EVER: usize = 1000;

/// The causes that are places, which a person can measure again.
const PLACES: [Cause; 4] = [Cause::Spots, Cause::Centre, Cause::SpecimenPoints, Cause::ArmPoints];

/// A run stops for places only if they shrink the half width by more than this part.
const WORTH_A_STOP: f64 = 0.02;

/// A change of the relative half width below this is none.
const NOTHING: f64 = 1e-7;

/// By how much a visit lowers the half width.
fn gain(now: f64, then: f64) -> f64 {
    let gain = now - then;
    if gain.is_finite() { gain } else { f64::from(u8::from(now > then)) }
}
