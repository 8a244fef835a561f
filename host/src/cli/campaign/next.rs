//! `campaign next`: which further cells shrink k_T's interval most per minute, and when a wanted
//! interval is reached. `campaign run --until` measures them.

use crate::analyse::CellName;
use crate::analyse::next_cell::{Averaged, NextError, Outlook, Times, Visit, outlook};
use crate::campaign::run::further::{Choice, ChooseFurther, FurtherCell};
use crate::campaign::store::Store;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::report::words::next_sentences as say;
use crate::structure::Structure;
use clap::Args;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Show which further cells shrink k_T's interval most per minute.
#[derive(Debug, Args)]
pub struct Next {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Relative half width of k_T's 95 % interval that is wanted, such as 2%: which visits reach
    /// it.
    #[arg(long, value_name = "PERCENT", value_parser = percent)]
    until: Option<f64>,
    /// Largest number of further hits.
    #[arg(long, value_name = "N", default_value_t = FURTHER_HITS)]
    further_hits: usize,
    #[command(flatten)]
    durations: Durations,
    /// Print one JSON document on stdout.
    #[arg(long)]
    json: bool,
}

/// Durations from which minutes are counted.
#[derive(Debug, Clone, Copy, Default, Args)]
#[allow(clippy::struct_field_names, reason = "the unit ends each name, as everywhere")]
pub struct Durations {
    /// Duration of a hit with rest and storing, s [default: the plan's record and 3 s].
    #[arg(long, value_name = "S", value_parser = output::positive)]
    hit_s: Option<f64>,
    /// Duration of moving the vibrometer to another response, s [default: 20].
    #[arg(long, value_name = "S", value_parser = output::not_negative)]
    vibrometer_s: Option<f64>,
    /// Duration of moving the hammer to another impact, s [default: 60].
    #[arg(long, value_name = "S", value_parser = output::not_negative)]
    hammer_s: Option<f64>,
    /// Duration of changing from the assembly to B alone or back, s [default: 1800].
    #[arg(long, value_name = "S", value_parser = output::not_negative)]
    structure_s: Option<f64>,
    /// Duration of measuring the places of one cause again (spots, contact, points) with half their
    /// stated errors, min; without it, only hits are considered.
    #[arg(long, value_name = "MIN", value_parser = output::positive)]
    again_min: Option<f64>,
}

impl Durations {
    /// With the plan's and the usual durations for those that are not given.
    fn times(self, store: &Store) -> Result<Times, CliError> {
        let usual = Times::of(&store.plan()?);
        Ok(Times {
            hit_s: self.hit_s.unwrap_or(usual.hit_s),
            vibrometer_s: self.vibrometer_s.unwrap_or(usual.vibrometer_s),
            hammer_s: self.hammer_s.unwrap_or(usual.hammer_s),
            structure_s: self.structure_s.unwrap_or(usual.structure_s),
            again_s: self.again_min.map(|minutes| 60.0 * minutes),
        })
    }
}

/// Default of the largest number of further hits.
pub const FURTHER_HITS: usize = 500;

/// Cells in the table.
const SHOWN: usize = 8;

/// A half width as a fraction, from a percentage.
pub fn percent(text: &str) -> Result<f64, String> {
    let number = text.strip_suffix('%').and_then(|number| number.trim().parse::<f64>().ok());
    match number {
        Some(number) if number > 0.0 && number < 100.0 => Ok(number / 100.0),
        _ => Err("write a percentage above 0, such as 2%".into()),
    }
}

impl Next {
    pub fn run(self) -> Result<(), CliError> {
        let store = Store::open_read_only(&self.file)?;
        let times = self.durations.times(&store)?;
        let found = outlook(&store, times, &mut Averaged::default()).map_err(bad)?;
        let cells = found.each_cell();
        let route = self.until.map(|until| found.route(until, self.further_hits, &|_| false));
        if self.json {
            return output::json(&document(&found, &cells, self.until, route.as_deref()));
        }
        output::lines(say::now(&found))?;
        output::lines(
            std::iter::once(say::table_head()).chain(cells.iter().take(SHOWN).map(say::table_row)),
        )?;
        output::lines(found.again().iter().map(say::again_row))?;
        let mut limits = say::limits(&found);
        if let (Some(until), Some(route)) = (self.until, &route) {
            let told = say::route(&found, until, self.further_hits, route);
            // for a half width that is not reached, the smallest one that further hits give
            limits.retain(|limit| !told.ends_with(limit.as_str()));
            output::lines([told])?;
        }
        output::lines(limits)
    }
}

fn bad(error: NextError) -> CliError {
    match error {
        NextError::Analyse(error) => error.into(),
        other @ NextError::NoStiffness(_) => CliError::Bad(other.to_string()),
    }
}

fn document(found: &Outlook, cells: &[Visit], until: Option<f64>, route: Option<&[Visit]>) -> Value {
    let finite = |value: f64| value.is_finite().then_some(value);
    let visit = |visit: &Visit| {
        json!({
            "configuration": visit.cell.configuration.name(),
            "impact": visit.cell.impact,
            "response": visit.cell.response,
            "hits": visit.hits,
            "more": visit.more,
            "minutes": visit.seconds / 60.0,
            "half_width": finite(visit.half_width),
        })
    };
    let name = |cell: &CellName| json!({ "configuration": cell.configuration.name(), "impact": cell.impact, "response": cell.response });
    let route = until.zip(route).map(|(until, visits)| {
        let then = visits.last().map_or(found.half_width(), |last| last.half_width);
        json!({
            "half_width": until,
            "reached": found.half_width() <= until,
            "reachable": then <= until,
            "hits": visits.iter().map(|visit| visit.more).sum::<usize>(),
            "minutes": visits.iter().map(|visit| visit.seconds).sum::<f64>() / 60.0,
            "visits": visits.iter().map(visit).collect::<Vec<_>>(),
        })
    });
    let budget: serde_json::Map<String, Value> =
        found.budget().into_iter().map(|(cause, share)| (cause.name().into(), json!(share))).collect();
    let dominating = found.dominating().map(|own| {
        json!({ "cause": own.cause.name(), "share": own.share, "half_width_if_halved": own.half_width_if_halved })
    });
    json!({
        "version": 1,
        "k_t_n_per_m": found.k_t_n_per_m,
        "half_width": finite(found.half_width()),
        "hits": found.hits,
        "doubts": found.doubts,
        "again": found.again().iter().map(|own| json!({
            "cause": own.cause.name(), "minutes": own.seconds / 60.0, "half_width": finite(own.half_width),
        })).collect::<Vec<_>>(),
        "slips": found.slips,
        "times": found.times,
        "cells": cells.iter().map(visit).collect::<Vec<_>>(),
        "until": route,
        "with_four_times_the_hits": {
            "all": finite(found.grown(None)),
            "AJB": finite(found.grown(Some(Structure::Ajb))),
            "B": finite(found.grown(Some(Structure::B))),
        },
        "budget": budget,
        "dominating": dominating,
        "unpredicted": found.unpredicted.iter().map(name).collect::<Vec<_>>(),
    })
}

/// Chooses cells until k_T's interval has the wanted half width.
pub struct Until {
    half_width: f64,
    times: Times,
    /// Hits that may still be chosen.
    left: usize,
    averaged: Averaged,
}

impl Until {
    /// With at most this many further hits.
    pub fn new(
        store: &Store,
        until: f64,
        durations: Durations,
        further_hits: usize,
    ) -> Result<Self, CliError> {
        Ok(Until {
            half_width: until,
            times: durations.times(store)?,
            left: further_hits,
            averaged: Averaged::default(),
        })
    }
}

/// The part of the visits to the wanted half width that are made before the next estimate.
const BEFORE_THE_NEXT: usize = 3;

impl ChooseFurther for Until {
    fn next(
        &mut self,
        file: &Path,
        excluded: &(dyn Fn(&FurtherCell) -> bool + Sync),
    ) -> Result<Choice, String> {
        let store = Store::open_read_only(file).map_err(|error| error.to_string())?;
        let found = match outlook(&store, self.times, &mut self.averaged) {
            Ok(found) => found,
            Err(why @ NextError::NoStiffness(_)) => {
                return Ok(Choice::Enough { reached: false, why: why.to_string() });
            }
            Err(error) => return Err(error.to_string()),
        };
        if found.half_width() <= self.half_width {
            return Ok(Choice::Enough { reached: true, why: say::reached(&found, self.half_width) });
        }
        if let Some(why) = say::in_doubt(&found) {
            return Ok(Choice::Enough { reached: false, why });
        }
        let further = |cell: &CellName, more: usize| FurtherCell {
            configuration: cell.configuration.name(),
            impact: cell.impact.clone(),
            response: cell.response.clone(),
            more: more as u32,
        };
        // an assembly that is taken apart in between is another contact afterwards
        let elsewhere = |cell: &CellName| found.mounted().is_some_and(|own| own != cell.configuration);
        let route =
            found.route(self.half_width, self.left, &|cell| elsewhere(cell) || excluded(&further(cell, 0)));
        let now = route.len().div_ceil(BEFORE_THE_NEXT);
        if let Some(again) = found.rather_again(&route[..now]) {
            return Ok(Choice::Enough { reached: false, why: say::rather_again(&found, &again) });
        }
        // what is beyond the predicted hits is predicted again with those on the way there
        if route.is_empty() || !found.within_reach(self.half_width, found.mounted()) || self.left == 0 {
            let why = say::route(&found, self.half_width, self.left, &route);
            return Ok(Choice::Enough { reached: false, why });
        }
        let cells: Vec<FurtherCell> =
            route[..now].iter().map(|visit| further(&visit.cell, visit.more)).collect();
        self.left -= cells.iter().map(|cell| cell.more as usize).sum::<usize>();
        Ok(Choice::Cells { cells, why: say::route(&found, self.half_width, self.left, &route) })
    }
}

#[cfg(test)]
mod tests {
    use super::percent;

    #[test]
    fn a_half_width_is_a_percentage() {
        assert_eq!((percent("2%"), percent("0.5 %")), (Ok(0.02), Ok(0.005)));
        for wrong in ["2", "0%", "-1%", "100%", "nan%", "%", "x"] {
            assert!(percent(wrong).is_err(), "{wrong}");
        }
    }
}
