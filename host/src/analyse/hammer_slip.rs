//! Collects every hit's response per newton, by cell, to detect whether the contact slips under the
//! hammer.

use super::cell::{CellName, Hit};
use crate::hysteresis::hammer_slip::{CellHits, HammerSlip, HitResponse, HitSignals};

/// The response per newton of one hit that moves the contact.
#[derive(Debug, Clone, PartialEq)]
pub struct HitAtContact {
    /// Its cell: hits of one cell share place, aim and direction.
    pub cell: CellName,
    /// T, v_A and v_B.
    pub response: HitResponse,
}

/// From one hit; `None` if it lacks the contact's signals, or is too short.
pub fn of_hit(cell: &CellName, fs_hz: f64, hit: &Hit) -> Option<HitAtContact> {
    let signals = hit.contact.as_ref()?;
    let delays = signals.delay_s;
    let response = HitResponse::of(&HitSignals {
        fs_hz,
        hammer_n: &hit.force_n,
        contact: [&signals.tangential_n, &signals.specimen_a_m_per_s, &signals.specimen_b_m_per_s],
        delay_s: [delays.load_cells, delays.specimen_a, delays.specimen_b],
    })?;
    Some(HitAtContact { cell: cell.clone(), response })
}

/// The verdict from all hits; they must be ordered by cell.
pub fn told(hits: &[HitAtContact]) -> HammerSlip {
    let cells: Vec<CellHits<'_>> = hits
        .chunk_by(|a, b| a.cell == b.cell)
        .map(|own| CellHits { impact: &own[0].cell.impact, hits: own.iter().map(|h| &h.response).collect() })
        .collect();
    HammerSlip::of(&cells)
}
