//! A sweep: the frequency changes in small steps with continuous phase.
//!
//! The record of a sweep spans from rest to rest, so that the ratio of its spectra is the
//! structure's FRF, independent of the sweep rate and of the steps.

use super::error::ShakeError;
use super::order::Orders;
use crate::device::session::Session;

/// Time at one frequency, s: the device's lock-in measures over 80 ms and restarts with each order.
const STEP_S: f64 = 0.12;

/// Sweeps from the first to the last frequency (Hz) at `hz_per_s`.
///
/// # Errors
/// The user interrupts, the shaker stopped, or the device is disconnected.
pub fn go(
    session: &mut Session,
    orders: &mut Orders,
    [first_hz, last_hz]: [f64; 2],
    hz_per_s: f64,
) -> Result<(), ShakeError> {
    let rate_hz = orders.rate_hz();
    let steps = ((last_hz - first_hz).abs() / (hz_per_s * STEP_S)).ceil().max(1.0) as u64;
    let begun = session.expected()?;
    for step in 1..=steps {
        orders.tune(session, first_hz + (last_hz - first_hz) * step as f64 / steps as f64)?;
        orders.go_on(session, begun + (step as f64 * STEP_S * rate_hz) as u64)?;
    }
    Ok(())
}
