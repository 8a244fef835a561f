//! The wear runs of a campaign, summed by decades of cycles.

use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::hysteresis::wear::{Decade, Decades};
use crate::results::{WearDecade, WearRuns};

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
        decades.add(number, cycle.reading.as_ref(), cycle.energy_j, cycle.normal_load_n);
    })?;
    let mut energy_to_j = 0.0;
    let one = |decade: &Decade| {
        energy_to_j += decade.energy_j;
        let slips = decade.slipping > 0;
        let stiffness = decade.stiffness_n_per_m();
        WearDecade {
            first: decade.numbers[0],
            last: decade.numbers[1],
            slipping: decade.slipping,
            k_t_n_per_m: stiffness.filter(|_| slips),
            tangent_n_per_m: stiffness.filter(|_| !slips),
            friction_n: decade.friction_n(),
            friction_coefficient: decade.friction_coefficient(),
            amplitude_m: decade.amplitude_m(),
            energy_j: decade.energy_j,
            energy_to_j,
        }
    };
    let decades = decades.iter().map(one).collect();
    let loops = store.wear_loops()?.len() as u64;
    Ok(Some(WearRuns { cycles: total.cycles, energy_j: total.energy_j, unmeasured, loops, decades }))
}
