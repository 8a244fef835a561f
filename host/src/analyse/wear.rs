//! The wear runs of a campaign, summed by decades of cycles, and their curve.

use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::hysteresis::wear::{CycleSums, Decades};
use crate::results::{WearMeans, WearRuns};

/// A point of the curve has this many times the cycles of the point before: some 400 points from
/// 100 cycles to 10⁷.
const SPACING: f64 = 1.03;

/// Reads every cycle of the file; `None` if there is none.
///
/// # Errors
/// The file cannot be read, or a block is damaged.
pub fn wear(store: &Store) -> Result<Option<WearRuns>, StoreError> {
    let total = store.wear_total()?;
    if total.cycles == 0 {
        return Ok(None);
    }
    let (mut decades, mut unmeasured) = (Decades::default(), 0);
    store.each_wear_cycle(|_, number, cycle, _| {
        unmeasured += u64::from(cycle.reading.is_none());
        decades.of(number).add(number, cycle.reading.as_ref(), cycle.energy_j, cycle.normal_load_n);
    })?;
    let mut energy_to_j = 0.0;
    let one = |decade: &CycleSums| {
        energy_to_j += decade.energy_j;
        means(decade, energy_to_j)
    };
    let decades = decades.iter().map(one).collect();
    let loops = store.wear_loops()?.len() as u64;
    let curve = curve(store)?;
    Ok(Some(WearRuns { cycles: total.cycles, energy_j: total.energy_j, unmeasured, loops, decades, curve }))
}

/// [`WearRuns::curve`], for which some hundred blocks are read, however many the file has.
///
/// # Errors
/// The file cannot be read, or one of these blocks is damaged.
pub fn curve(store: &Store) -> Result<Vec<WearMeans>, StoreError> {
    let total = store.wear_total()?.cycles;
    let mut all = Vec::new();
    let mut next = 1;
    while let Some((row, cycles)) = store.wear_block_with(next)? {
        let mut sums = CycleSums::default();
        for (number, cycle) in (row.cycles_before + 1..).zip(&cycles) {
            sums.add(number, cycle.reading.as_ref(), cycle.energy_j, cycle.normal_load_n);
        }
        all.push(means(&sums, row.energy_before_j + row.energy_j));
        let last = row.cycles_before + row.count;
        if last >= total {
            break;
        }
        next = ((last as f64 * SPACING).ceil() as u64).clamp(last + 1, total);
    }
    Ok(all)
}

fn means(of: &CycleSums, energy_to_j: f64) -> WearMeans {
    let slips = of.slipping > 0;
    let stiffness = of.stiffness_n_per_m();
    WearMeans {
        first: of.numbers[0],
        last: of.numbers[1],
        slipping: of.slipping,
        k_t_n_per_m: stiffness.filter(|_| slips),
        tangent_n_per_m: stiffness.filter(|_| !slips),
        friction_n: of.friction_n(),
        friction_coefficient: of.friction_coefficient(),
        amplitude_m: of.amplitude_m(),
        energy_j: of.energy_j,
        energy_to_j,
    }
}
