//! Why levels cannot be measured, worded for the operator of the shaker.

use jointrig_protocol::answer::Info;
use jointrig_protocol::channel::Role;
use jointrig_protocol::event::Reason;
use jointrig_protocol::limits::SHAKE_SCANS_PER_CYCLE;

use super::LevelOptions;
use crate::campaign::plan::level::Held;
use crate::campaign::store::error::StoreError;
use crate::device::channels::ChannelMap;
use crate::device::error::DeviceError;

/// Why one level was not reached; other levels may still be reachable.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Shortfall {
    /// The largest drive does not reach the level.
    #[error(
        "out of reach: the largest drive of {drive_v} V gives less; raise the drive (--max-drive), or order a smaller amplitude"
    )]
    Weak {
        /// The largest drive, V.
        drive_v: f64,
    },
    /// The amplitude does not settle at the ordered value.
    #[error(
        "never settled: after {seconds} s its amplitude still varies between {:.1} and {:.1} % of the ordered value; move \
         further from the resonance, or look for a loose part", 100.0 * least, 100.0 * most
    )]
    NeverSettled {
        /// How long the device waited, s.
        seconds: f64,
        /// Smallest amplitude of the last windows, relative to the ordered one.
        least: f64,
        /// Largest amplitude of them, relative to the ordered one.
        most: f64,
    },
    /// A channel at the contact reached the end of its range during the record.
    #[error(
        "channel `{channel}` reached the end of its range: set a wider one at the sensor, or order a smaller amplitude"
    )]
    Clipped {
        /// The channel's name.
        channel: String,
    },
    /// The amplitude settled, then drifted during the record.
    #[error("settled, but drifted to {:.1} % of the ordered value while it was recorded; run the same command again", 100.0 * ratio)]
    Strayed {
        /// Amplitude over the record, relative to the ordered one.
        ratio: f64,
    },
}

/// Why the run ended.
#[derive(Debug, thiserror::Error)]
pub enum ShakeError {
    /// The file's records belong to another structure.
    #[error("{0}")]
    AnotherStructure(String),
    /// The campaign file.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The device.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The device does not fit.
    #[error("{address} cannot do that: {what}")]
    Unfit {
        /// The device.
        address: String,
        /// What is missing, and what to do.
        what: String,
    },
    /// The plan has no assembly to shake.
    #[error("the plan has no assembly (a configuration AJB): the shaker's levels are measured in it")]
    NoAssembly,
    /// The shaker stopped by itself.
    #[error(
        "the shaker stopped at {level}: {why}\nthe levels before it are in the file; run the same command again to go on"
    )]
    Stopped {
        /// The level.
        level: String,
        /// The cause, and what to do.
        why: String,
    },
    /// The shaker was ordered to rest and does not.
    #[error("{address}: the shaker does not come to rest; press the emergency stop")]
    DoesNotRest {
        /// The device.
        address: String,
    },
    /// A level that was stored cannot be found.
    #[error("level {0} was stored and cannot be read back: check the file with `jointrig campaign verify`")]
    Lost(i64),
    /// This level failed; the run continues.
    #[error(transparent)]
    Short(Shortfall),
    /// The user interrupted the run.
    #[error("interrupted")]
    Interrupted,
}

/// Whether the device has what the levels need.
pub fn check_fit(
    address: &str,
    info: &Info,
    channels: &ChannelMap,
    options: &LevelOptions,
) -> Result<(), ShakeError> {
    let unfit = |what: String| Err(ShakeError::Unfit { address: address.into(), what });
    if info.drive_v <= 0.0 {
        return unfit("it has no drive for a shaker (`jointrig info` says `shaker: none`)".into());
    }
    let needed = [
        (Role::SpecimenA, "the vibrometer on specimen A"),
        (Role::SpecimenB, "the vibrometer on specimen B"),
        (Role::LoadCell, "a load cell"),
        (Role::Excitation, "the excitation's force"),
    ];
    let force_held = options.levels.iter().any(|level| level.held == Held::Force);
    for (role, name) in needed {
        if channels.place(role).is_none() && (role != Role::Excitation || force_held) {
            return unfit(format!("it has no channel for {name}"));
        }
    }
    let known = |name: &String| channels.channels.iter().any(|channel| channel.name == name.as_str());
    if let Some((name, _)) = options.limits.0.iter().find(|(name, _)| !known(name)) {
        let names: Vec<&str> = channels.channels.iter().map(|channel| channel.name.as_str()).collect();
        return unfit(format!("it has no channel `{name}` to limit; its channels are {}", names.join(", ")));
    }
    let full_v = f64::from(info.drive_v);
    let highest_hz = f64::from(channels.rate_hz / SHAKE_SCANS_PER_CYCLE);
    for level in &options.levels {
        let drive_v = match level.held {
            Held::Drive => level.amplitude,
            _ => options.most_drive_v.unwrap_or(full_v),
        };
        if drive_v > full_v * (1.0 + 1e-6) {
            return unfit(format!("{level}: its drive reaches only {full_v} V, not {drive_v} V"));
        }
        if level.frequency_hz.max(level.end_hz.unwrap_or(0.0)) > highest_hz {
            return unfit(format!("{level}: its shaker reaches at most {highest_hz} Hz"));
        }
    }
    Ok(())
}

/// Why the shaker stopped, and what to do.
pub fn in_words(reason: Option<Reason>, channels: &ChannelMap, limit: impl Fn(u8) -> f32) -> String {
    match reason {
        Some(Reason::Limit { channel }) => {
            let (name, unit) = channels
                .channels
                .get(usize::from(channel))
                .map_or(("?", ""), |channel| (channel.name.as_str(), channel.quantity.unit()));
            format!(
                "channel `{name}` went beyond its limit of {:.4} {unit}; order a smaller amplitude or another frequency, or raise \
                 the limit (--limit {name}=VALUE) if the rig can take it",
                limit(channel)
            )
        }
        Some(Reason::Runaway) => {
            "its amplitude rose to 1.5 times the ordered value: a resonance is too close, or a sensor \
             was lost; check the vibrometers' signal, then try another frequency"
                .into()
        }
        Some(Reason::Interlock) => "the guard was opened: close it".into(),
        Some(Reason::EmergencyStop) => "the emergency stop: release and reset it at the rig".into(),
        Some(Reason::LinkLost) => {
            "the device received nothing from this program for a second: is the machine overloaded?".into()
        }
        Some(Reason::Expired) => "its order expired before it was renewed: is the machine overloaded?".into(),
        Some(Reason::Supply { channel }) => {
            let name = channels.channels.get(usize::from(channel)).map_or("?", |channel| &channel.name);
            format!("the sensor of channel `{name}` is missing: its cable is open or shorted")
        }
        Some(Reason::FrontEnd) => "the converters lost scans; see the controller's log".into(),
        Some(Reason::Clock) => "the external clock was lost: it stopped or left its tolerance".into(),
        Some(Reason::RanDry) => "its drive was not fed in time; see the controller's log".into(),
        Some(Reason::StreamEnded) => "the stream ended".into(),
        Some(Reason::Asked) => "another program asked for it".into(),
        Some(Reason::Fired | Reason::Weak) | None => {
            "the reason was lost in transmission; see the controller's log".into()
        }
    }
}
