//! Checks whether the contact changed during the measurement: the shaker's levels before and after
//! the hammer's cells.

use crate::analyse::shaker_levels::Analysed;
use crate::campaign::plan::level::{Level, Moment};
use crate::hysteresis::OverCycles;

/// Accepted relative change of a level's stiffness between before and after.
const CHANGE: f64 = 0.03;

/// The levels that were measured both times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactChange {
    /// Number of such levels.
    pub pairs: u32,
    /// Number of them whose change exceeds their scatter.
    pub beyond: u32,
    /// The largest change, relative to the stiffness before.
    pub worst: f64,
    /// The level with the largest change.
    pub worst_at: Level,
}

impl ContactChange {
    /// `None` if no level was measured both times.
    pub fn of(levels: &[Analysed<'_>]) -> Option<Self> {
        let of = |moment: Moment| levels.iter().filter(move |l| l.level.moment == moment);
        let slope = |one: &Analysed<'_>| one.raw.k_t_n_per_m.unwrap_or(one.raw.k_eq_n_per_m);
        let mut found: Option<Self> = None;
        for before in of(Moment::Before) {
            let Some(after) = of(Moment::After).find(|a| a.level.level.same(&before.level.level)) else {
                continue;
            };
            let (k, l) = (slope(before), slope(after));
            let change = l.mean / k.mean - 1.0;
            // standard errors of both means over their cycles
            let error = |k: &OverCycles| k.std / (k.cycles as f64).sqrt() / k.mean.abs();
            let beyond = change.abs() > CHANGE.max(3.0 * error(&k).hypot(error(&l)));
            let so_far =
                found.unwrap_or(Self { pairs: 0, beyond: 0, worst: 0.0, worst_at: after.level.level });
            let worse = found.is_none() || change.abs() > so_far.worst.abs();
            let (worst, worst_at) =
                if worse { (change, after.level.level) } else { (so_far.worst, so_far.worst_at) };
            found = Some(Self {
                pairs: so_far.pairs + 1,
                beyond: so_far.beyond + u32::from(beyond),
                worst,
                worst_at,
            });
        }
        found
    }
}
