//! Checks that what a device reports about itself and its scans is possible. Sizes, scales and
//! indices are computed from it, so a faulty or malicious device is refused with a message before
//! anything moves and before anything is stored.

use jointrig_protocol::answer::{Answer, Counters, Info, Status};
use jointrig_protocol::channel::{Channel, WIDE_BITS};
use jointrig_protocol::event::{self, Event};
use jointrig_protocol::hello::Hello;
use jointrig_protocol::limits::{CHANNEL_CAPACITY, COIL_PULSE_CAP_US};
use jointrig_protocol::shot::Shot;
use jointrig_protocol::slow::Slow;

/// Scans that a ring may hold. The upper bound exceeds the memory of any controller and is small
/// for a host.
const RING_SCANS: std::ops::RangeInclusive<u32> = 256..=1 << 20;

/// Scans per second, Hz: from a slow strain gauge to the fastest 16-bit converter.
const RATE_HZ: std::ops::RangeInclusive<u32> = 100..=2_000_000;

/// Largest scan index: 285 years at a million scans per second. Sums of such indices stay exact.
pub(super) const LAST_SCAN: u64 = 1 << 53;

/// The widest range of a channel, V, or in the unit of the samples of a recorder that delivers
/// engineering units (1 GN).
const RANGE_V: f32 = 1e9;

/// Longest delay of a signal, ns.
const DELAY_NS: u32 = 1_000_000_000;

/// Furthest scan ahead of the newest one that may be waited for, s.
pub(super) const AHEAD_S: f64 = 3600.0;

/// What is impossible, as the end of a sentence whose subject is the device.
pub(super) type Claim = Result<(), String>;

fn refuse(holds: bool, what: impl FnOnce() -> String) -> Claim {
    if holds { Ok(()) } else { Err(what()) }
}

/// Checks the device's hello.
pub(super) fn of_hello(hello: &Hello) -> Claim {
    refuse(RING_SCANS.contains(&hello.ring_scans), || {
        format!(
            "says that it keeps {} scans to send again: {} to {} are possible",
            hello.ring_scans,
            RING_SCANS.start(),
            RING_SCANS.end()
        )
    })
}

/// Checks the device's description.
pub(super) fn of_info(info: &Info, hello: &Hello) -> Claim {
    let Info { channels, scan_rate_hz, ring_scans, coil_cap_us, drive_v, .. } = *info;
    refuse((1..=CHANNEL_CAPACITY).contains(&usize::from(channels)), || {
        format!("says that a scan has {channels} channels: 1 to {CHANNEL_CAPACITY} are possible")
    })?;
    refuse(RATE_HZ.contains(&scan_rate_hz), || {
        format!(
            "says that it takes {scan_rate_hz} scans a second: {} to {} are possible",
            RATE_HZ.start(),
            RATE_HZ.end()
        )
    })?;
    refuse(ring_scans == hello.ring_scans, || {
        format!("says that it keeps {ring_scans} scans, but said {} before", hello.ring_scans)
    })?;
    refuse(coil_cap_us <= COIL_PULSE_CAP_US, || {
        format!(
            "says that its coil takes pulses of {coil_cap_us} µs: at most {COIL_PULSE_CAP_US} µs are allowed"
        )
    })?;
    refuse(drive_v.is_finite() && drive_v >= 0.0, || format!("says that its drive gives {drive_v} V"))
}

/// Checks a channel, which follows the channels `before`.
pub(super) fn of_channel(channel: &Channel, before: &[Channel]) -> Claim {
    let (place, name) = (before.len(), channel.name.as_str());
    refuse(!name.trim().is_empty() && before.iter().all(|other| other.name != channel.name), || {
        format!("calls channel {place} `{name}`, like another one: each needs its own name")
    })?;
    let Channel { units_per_volt, range_v, delay_ns, bits, .. } = *channel;
    refuse(units_per_volt.is_normal(), || {
        format!("says that `{name}` has {units_per_volt} units per volt: a number that is not 0 is needed")
    })?;
    refuse(range_v.is_normal() && (0.0..=RANGE_V).contains(&range_v), || {
        format!(
            "says that `{name}` has a range of ±{range_v} V: a number above 0 and up to {RANGE_V} is needed"
        )
    })?;
    refuse(channel.units_per_code_f32().is_normal(), || {
        format!("says that a code of `{name}` is {} units", channel.units_per_code_f32())
    })?;
    refuse(delay_ns <= DELAY_NS, || {
        format!("says that `{name}` lags by {delay_ns} ns: at most {DELAY_NS} are possible")
    })?;
    refuse((1..=WIDE_BITS).contains(&bits), || {
        format!("says that `{name}` has {bits} bits: 1 to {WIDE_BITS} are possible")
    })
}

/// Checks the slow values.
pub(super) fn of_slow(slow: &Slow) -> Claim {
    let celsius = slow.temperature_c.unwrap_or(0.0);
    refuse((-273.2..=2000.0).contains(&celsius), || format!("says that the specimen has {celsius} °C"))?;
    let strange = slow.supplies.iter().find(|supply| !supply.bias_v.is_finite());
    refuse(strange.is_none(), || "says that a supply's bias is not a number".into())
}

/// Checks the index of a scan.
fn scan(what: &str, at: u64) -> Claim {
    refuse(at <= LAST_SCAN, || format!("says that {what} at scan {at}: no stream gets that far"))
}

fn of_shot(shot: &Shot) -> Claim {
    scan("the coil went on", shot.fired_at)?;
    scan("the hammer hit", shot.trigger)?;
    for (what, value) in [
        ("peak", shot.peak_n),
        ("width", shot.width_us),
        ("rebound", shot.rebound_ratio),
        ("friction", shot.friction_peak_n),
        ("motion before it", shot.quiet_ratio),
    ] {
        refuse(value.is_finite(), || format!("says that the {what} of shot {} is {value}", shot.number))?;
    }
    Ok(())
}

fn of_counters(counters: &Counters) -> Claim {
    scan("the last one was produced", counters.scans_produced)?;
    scan("the last one was missed", counters.scans_missed)
}

fn of_status(status: &Status) -> Claim {
    scan("the next one is", status.next_scan)?;
    scan("its ring begins", status.oldest_scan)?;
    of_counters(&status.counters)?;
    status.shot.as_ref().map_or(Ok(()), of_shot)
}

/// Checks an answer.
pub(super) fn of_answer(answer: &Answer) -> Claim {
    match answer {
        Answer::Status(status) => of_status(status),
        Answer::Sync(sync) => {
            refuse(sync.ppm.is_finite(), || format!("says that its clock is {} ppm off", sync.ppm))
        }
        Answer::Started { first_scan, .. } => scan("its stream begins", *first_scan),
        Answer::Staged { at_scan } => scan("everything is in place", *at_scan),
        _ => Ok(()),
    }
}

/// Checks an event.
pub(super) fn of_event(event: &event::Numbered) -> Claim {
    match &event.event {
        Event::Shot(shot) => of_shot(shot),
        Event::Counters(counters) => of_counters(counters),
        Event::Lost { first_scan, .. } => scan("it lost some", *first_scan),
        Event::Edge(edge) => scan("an edge came to its sync port", edge.at.scan),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use jointrig_protocol::channel::{Quantity, Role};

    fn channel() -> Channel {
        Channel {
            name: "force".parse().expect("short"),
            role: Role::HammerForce,
            quantity: Quantity::Force,
            units_per_volt: -44.6,
            range_v: 10.0,
            delay_ns: 0,
            bits: 16,
        }
    }

    #[test]
    fn a_scale_that_is_no_number_is_refused_with_its_channel() {
        assert_eq!(of_channel(&channel(), &[]), Ok(()));
        for wrong in [0.0, f32::NAN, f32::INFINITY, f32::MIN_POSITIVE / 2.0] {
            for channel in
                [Channel { units_per_volt: wrong, ..channel() }, Channel { range_v: wrong, ..channel() }]
            {
                let said = of_channel(&channel, &[]).expect_err("no scale");
                assert!(said.contains("`force`") && said.contains("needed"), "{said}");
            }
        }
        assert!(of_channel(&Channel { range_v: -10.0, ..channel() }, &[]).is_err());
        assert!(of_channel(&Channel { units_per_volt: f32::MAX, ..channel() }, &[]).is_err());
        assert!(of_channel(&channel(), &[channel()]).is_err(), "two of one name");
    }
}
