//! Information in a campaign file about itself: provenance, and how much of the plan was measured.

use super::analyse_error::AnalyseError;
use crate::campaign::store::Store;
use crate::results::{Calibrated, rounded};

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
