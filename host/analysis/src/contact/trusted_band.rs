//! The band in which the model holds: beyond it an arm or a specimen bends, or the load cells'
//! calibration ends.
//!
//! The bodies are rigid up to their first bending mode, whose frequency is unknown before the
//! measurement. The residuals of a fit over the whole band show it: if they contradict the model at
//! one end of the band, the lines there carry no information on the contact and are left out. Only
//! the ends are removed. A contradiction in the middle means that a point is misplaced or loose,
//! and stays a doubt.

use super::bins::{BIN_HZ, Bin};
use super::block::Block;
use super::diagnosis::Signals;
use crate::band::Band;

/// A narrower band hardly determines a stiffness and a damping, Hz. A contradiction at all
/// frequencies is not a matter of the band.
const NARROWEST_HZ: f64 = 200.0;

/// The band without the ends at which the residuals contradict the model; the whole band if too
/// little would remain or nothing contradicts.
pub fn trusted(blocks: &[Block], bins: &[Bin], whole: Band) -> Band {
    let mut lows: Vec<f64> = bins.iter().map(|bin| bin.low_hz).collect();
    lows.sort_by(f64::total_cmp);
    lows.dedup();
    let holds = |low: &f64| {
        let own = || bins.iter().filter(|bin| bin.low_hz == *low);
        Signals::ALL.iter().all(|signals| !signals.contradict(signals.left(blocks, own())))
    };
    let good: Vec<bool> = lows.iter().map(holds).collect();
    let (Some(first), Some(last)) = (good.iter().position(|g| *g), good.iter().rposition(|g| *g)) else {
        return whole;
    };
    let low_hz = if first == 0 { whole.low_hz } else { lows[first] };
    // a line on the edge belongs to the next bin
    let high_hz = if last + 1 == lows.len() { whole.high_hz } else { (lows[last] + BIN_HZ).next_down() };
    if high_hz - low_hz < NARROWEST_HZ { whole } else { Band { low_hz, high_hz } }
}
