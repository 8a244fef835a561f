//! What the channels of a file are: their roles, quantities and scales, from the names and units of
//! the file, from sensitivities that the user states, or from the plan's `[[channel]]`.

use std::str::FromStr;

use jointrig_protocol::channel::{Channel, Quantity, Role};

use super::channel_file::{ChannelFile, FULL_SCALE, FileChannel};
use super::roles::{role_of, same_name};
use crate::campaign::plan::{Plan, SensorPlan};
use crate::device::channels::ChannelMap;
use crate::device::samples::{ChannelSamples, ChannelView, SampleType, Samples};
use crate::exchange::units::{Dimension, Unit};

/// What the user states about one channel of a file: `ai0=hammer:2.25 mV/N`.
#[derive(Clone, Debug, PartialEq)]
pub struct Stated {
    /// The channel's name in the file.
    channel: String,
    /// The name that it has from here on; `None` leaves the channel out.
    name: Option<String>,
    /// The sensor's scale.
    scale: Option<StatedScale>,
}

/// SI units per volt (or per full scale), and the quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
struct StatedScale {
    per_volt: f64,
    quantity: Quantity,
}

/// Several of them, separated by commas: `ai0=hammer:2.25 mV/N,ai1=LDV_A:125 mm/s/V,ai2=-`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Calibrations(Vec<Stated>);

impl FromStr for Calibrations {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split(',').map(str::trim).filter(|part| !part.is_empty());
        parts.map(str::parse).collect::<Result<Vec<Stated>, _>>().map(Self)
    }
}

impl FromStr for Stated {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || {
            format!(
                "`{text}`: write CHANNEL=NAME:SENSITIVITY, e.g. ai0=hammer:2.25 mV/N, or ai3=- to leave it out"
            )
        };
        let (channel, rest) = text.split_once('=').ok_or_else(form)?;
        let (name, scale) = rest.split_once(':').map_or((rest, None), |(name, scale)| (name, Some(scale)));
        let (channel, name) = (channel.trim().to_owned(), name.trim());
        if channel.is_empty() || name.is_empty() {
            return Err(form());
        }
        let scale =
            scale.map(|scale| sensitivity(scale).map_err(|what| format!("`{text}`: {what}"))).transpose()?;
        Ok(Self { channel, name: (name != "-").then(|| name.to_owned()), scale })
    }
}

/// The quantities that a channel may have, by dimension.
const QUANTITIES: [(Dimension, Quantity); 4] = [
    (Dimension::FORCE, Quantity::Force),
    (Dimension::VELOCITY, Quantity::Velocity),
    (Dimension::ACCELERATION, Quantity::Acceleration),
    (Dimension::DISPLACEMENT, Quantity::Displacement),
];

/// A unit of force or motion: its quantity, and its factor to SI.
pub(crate) fn measured_in(label: &str) -> Result<(Quantity, f64), String> {
    let unit =
        Unit::parse(label, &QUANTITIES.map(|(dimension, _)| dimension)).map_err(|error| error.to_string())?;
    let known = QUANTITIES.into_iter().find(|(dimension, _)| *dimension == unit.dimension);
    known.map(|(_, quantity)| (quantity, unit.factor)).ok_or_else(|| "it is no force or motion".into())
}

/// Volts (or full scales) in a unit of voltage; `None` for another unit.
pub(crate) fn volts(label: &str) -> Option<f64> {
    Some(match label.trim() {
        "V" | FULL_SCALE => 1.0,
        "mV" => 1e-3,
        "µV" | "uV" => 1e-6,
        _ => return None,
    })
}

/// `2.25 mV/N`, `10 mV/(m/s^2)`, `125 mm/s/V` or `50 N/V`.
fn sensitivity(text: &str) -> Result<StatedScale, String> {
    let form = || {
        format!(
            "`{}` is no sensitivity: write volts per unit or a unit per volt, e.g. 2.25 mV/N or 125 mm/s/V",
            text.trim()
        )
    };
    let text = text.trim();
    let digits = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+');
    let mut end = text.find(|c: char| !digits(c)).unwrap_or(text.len());
    // an exponent, but not the unit that begins with an e
    if text[end..].starts_with(['e', 'E']) {
        let rest = &text[end + 1..];
        let more = rest.find(|c: char| !digits(c)).unwrap_or(rest.len());
        if more > 0 {
            end += 1 + more;
        }
    }
    let value: f64 = text[..end].parse().map_err(|_| form())?;
    if !value.is_finite() || value == 0.0 {
        return Err("a sensitivity must not be 0".into());
    }
    let unit = text[end..].trim();
    if let Some((above, below)) = unit.split_once('/')
        && let Some(volts) = volts(above)
    {
        let (quantity, factor) = measured_in(below).map_err(|what| format!("`{below}`: {what}"))?;
        return Ok(StatedScale { per_volt: factor / (value * volts), quantity });
    }
    let (above, below) = unit.rsplit_once('/').ok_or_else(form)?;
    let volts = volts(below).ok_or_else(form)?;
    let (quantity, factor) = measured_in(above).map_err(|what| format!("`{above}`: {what}"))?;
    Ok(StatedScale { per_volt: value * factor / volts, quantity })
}

/// Whether a file names channels other than the force and the responses of a location: specimens,
/// load cells, the shaker's force.
pub fn names_the_contact(plan: &Plan, file: &ChannelFile) -> bool {
    let of_contact = |channel: &FileChannel| {
        let role = |quantity| role_of(plan, "", &channel.name, quantity);
        matches!(role(Quantity::Force), Some(Role::LoadCell | Role::Excitation))
            || matches!(role(Quantity::Velocity), Some(Role::SpecimenA | Role::SpecimenB))
    };
    file.channels.iter().any(of_contact)
}

/// A channel that is kept: its place in the file, its description, and the factor of its values.
struct Kept {
    place: usize,
    channel: Channel,
    /// Factor of floating-point values before they are stored; 1 leaves the samples as they came.
    factor: f64,
    /// Whether neither the plan nor the usual names know its name.
    unknown: bool,
}

/// The channels of a file as those of hits at `response`, and the samples of each hit in that
/// order.
///
/// A value with a unit of force or motion is stored in SI units; a value in volts, or in parts of a
/// recorder's full scale, is stored as it came, with the sensor's scale.
///
/// # Errors
/// A channel has no unit or no sensitivity, or its name is not known: the text says what to state.
pub fn assigned(
    plan: &Plan,
    response: &str,
    file: &ChannelFile,
    stated: &Calibrations,
) -> Result<(ChannelMap, Vec<Samples>), String> {
    let types = file.hits.first().map(Samples::types).unwrap_or_default();
    let of = Described { plan, response, keeps_unknown: false };
    let kept = of.all(&file.channels, &types, stated)?;
    let map = map_of(file.fs_hz, kept.iter().map(|own| own.channel.clone()).collect());
    let hit = |samples: &Samples| {
        let own = kept.iter().map(|kept| of_channel(samples.channel(kept.place), kept.factor)).collect();
        Samples::new(own).ok_or_else(|| "its channels differ in length".to_owned())
    };
    let hits = file.hits.iter().map(hit).collect::<Result<Vec<_>, _>>()?;
    Ok((map, hits))
}

/// The map of channels that are sampled at `fs_hz`.
fn map_of(fs_hz: f64, channels: Vec<Channel>) -> ChannelMap {
    let rate_hz = fs_hz.round();
    let exact_hz = (rate_hz != fs_hz).then_some(fs_hz);
    ChannelMap { id: 0, rate_hz: rate_hz as u32, exact_hz, channels }
}

/// The channels of a continuous recording.
pub struct AssignedRecording {
    /// Those that are kept.
    pub map: ChannelMap,
    /// Place of each of them in the file.
    pub places: Vec<usize>,
    /// Names of those that neither the plan nor the usual names know; they are auxiliary.
    pub unknown: Vec<String>,
}

/// As [`assigned`], for a continuous recording of `types`, whose samples all stay as they came:
/// factors to SI units are in the channels' scales. A name that is not known is kept as an
/// auxiliary channel (a marker, a tachometer), and so are its volts without a sensitivity.
///
/// # Errors
/// As [`assigned`].
pub fn assigned_recording(
    plan: &Plan,
    fs_hz: f64,
    (channels, types): (&[FileChannel], &[SampleType]),
    stated: &Calibrations,
) -> Result<AssignedRecording, String> {
    // hits of one recording may be at any location
    let of = Described { plan, response: "", keeps_unknown: true };
    let kept = of.all(channels, types, stated)?;
    let places = kept.iter().map(|own| own.place).collect();
    let unknown = kept.iter().filter(|own| own.unknown).map(|own| own.channel.name.to_string()).collect();
    let in_scale = |own: Kept| Channel {
        units_per_volt: (f64::from(own.channel.units_per_volt) * own.factor) as f32,
        range_v: (f64::from(own.channel.range_v) / own.factor) as f32,
        ..own.channel
    };
    let map = map_of(fs_hz, kept.into_iter().map(in_scale).collect());
    Ok(AssignedRecording { map, places, unknown })
}

/// The samples of a channel; values times a factor are in double precision.
fn of_channel(samples: ChannelView<'_>, factor: f64) -> ChannelSamples {
    if factor != 1.0 {
        let mut scaled = Vec::new();
        samples.scaled(factor, &mut scaled);
        return ChannelSamples::F64(scaled);
    }
    match samples {
        ChannelView::I16(own) => ChannelSamples::I16(own.to_vec()),
        ChannelView::I32(own) => ChannelSamples::I32(own.to_vec()),
        ChannelView::F32(own) => ChannelSamples::F32(own.to_vec()),
        ChannelView::F64(own) => ChannelSamples::F64(own.to_vec()),
    }
}

/// How the channels of a file are described.
#[derive(Clone, Copy)]
struct Described<'p> {
    plan: &'p Plan,
    response: &'p str,
    /// Whether a channel whose name is not known is kept as an auxiliary one, instead of refused.
    keeps_unknown: bool,
}

impl Described<'_> {
    /// The channels that are kept.
    fn all(
        &self,
        channels: &[FileChannel],
        types: &[SampleType],
        stated: &Calibrations,
    ) -> Result<Vec<Kept>, String> {
        for own in &stated.0 {
            if !channels.iter().any(|channel| same_name(&channel.name, &own.channel)) {
                let there: Vec<&str> = channels.iter().map(|channel| channel.name.as_str()).collect();
                return Err(format!(
                    "there is no channel `{}`, for which --calibrate states a sensor: it has {}",
                    own.channel,
                    there.join(", ")
                ));
            }
        }
        let mut kept = Vec::new();
        for (place, channel) in channels.iter().enumerate() {
            let of = types.get(place).copied().unwrap_or_default();
            if let Some(own) = self.one(channel, of, stated)? {
                kept.push(Kept { place, ..own });
            }
        }
        Ok(kept)
    }

    /// A channel with its role and scale; `None` for one that is left out.
    fn one(
        &self,
        channel: &FileChannel,
        of: SampleType,
        stated: &Calibrations,
    ) -> Result<Option<Kept>, String> {
        let Self { plan, response, keeps_unknown } = *self;
        let FileChannel { name: in_file, unit, full_scale, bits, delay_s } = channel;
        let own = stated.0.iter().find(|own| same_name(&own.channel, in_file));
        let name = match own {
            Some(Stated { name: None, .. }) => return Ok(None),
            Some(Stated { name: Some(name), .. }) => name,
            None => in_file,
        };
        // records find the channels of fixed sensors by the plan's spelling
        let mut fixed =
            plan.geometry.response.iter().filter_map(|point| point.get_ref().channels.as_ref()).flatten();
        let name = fixed.find(|own| same_name(own, name)).unwrap_or(name);
        let remedy = format!(
            "state its sensor with --calibrate '{in_file}=NAME:SENSITIVITY', e.g. '{in_file}=hammer:2.25 mV/N'"
        );
        let label = unit.as_deref();
        let planned =
            plan.channel.iter().map(toml::Spanned::get_ref).find(|sensor| same_name(&sensor.name, name));
        let volts = match (label.map(|label| (label, volts(label))), own.and_then(|own| own.scale)) {
            // without a unit, a stated sensitivity says that the values are volts
            (None, Some(_)) => Some(1.0),
            (Some((_, volts)), _) => volts,
            (None, None) => {
                return Err(format!(
                    "channel `{in_file}` has no unit: write it into the heading, `{in_file} (mm/s)`, or {remedy}"
                ));
            }
        };
        let (quantity, units_per_volt, factor, delay_s) = match (volts, own.and_then(|own| own.scale)) {
            (Some(volts), Some(scale)) => (scale.quantity, scale.per_volt, volts, *delay_s),
            (Some(volts), None) if keeps_unknown && planned.is_none() && !is_used(plan, name) => {
                (Quantity::Voltage, 1.0, volts, *delay_s)
            }
            (Some(volts), None) => {
                let (quantity, per_volt, late) = from_plan(name, planned)
                .ok_or_else(|| format!("channel `{in_file}` is in {}, and its sensitivity is not known: {remedy}, or give the plan a [[channel]] with the name of a force cell or vibrometer and its sensitivity_v", label.unwrap_or("V")))?;
                (quantity, per_volt, volts, late.unwrap_or(*delay_s))
            }
            (None, Some(_)) => {
                return Err(format!(
                    "channel `{in_file}` is in {}, not in volts: leave its sensitivity out of --calibrate",
                    label.unwrap_or_default()
                ));
            }
            (None, None) => {
                let label = label.unwrap_or_default();
                let (quantity, factor) = measured_in(label).map_err(|what| {
                    format!("channel `{in_file}`: its unit `{label}`: {what}; correct it, or {remedy}")
                })?;
                (quantity, 1.0, factor, *delay_s)
            }
        };
        // of codes the full scale is converted, and the samples stay as they came
        let (range_v, factor) = match (of.is_code(), full_scale) {
            (true, None) => {
                return Err(format!("channel `{in_file}` has codes whose full scale is not known: {remedy}"));
            }
            (true, Some(full_scale)) => (full_scale * factor, 1.0),
            (false, full_scale) => (full_scale.unwrap_or(0.0) * factor, factor),
        };
        let role = role_of(plan, response, name, quantity);
        let unknown = role.is_none();
        let role = role.or(keeps_unknown.then_some(Role::Auxiliary)).ok_or_else(|| {
        format!(
            "channel `{in_file}` ({}) is not known as `{name}`: names are hammer, x, y, z, LDV_A, LDV_B, LC1, excitation, and the \
             channels of the plan's fixed sensors. Rename it, or give --calibrate '{in_file}=NAME', or '{in_file}=-' to leave it out",
            quantity.unit()
        )
    })?;
        if !(0.0..1.0).contains(&delay_s) {
            return Err(format!("channel `{in_file}`: its delay of {delay_s} s must be 0 to 1 s"));
        }
        Ok(Some(Kept {
            place: 0,
            channel: Channel {
                name: name
                    .parse()
                    .map_err(|_| format!("the name `{name}` is too long: 24 letters at most"))?,
                role,
                quantity,
                // a negative full scale is a reversed sensor
                units_per_volt: (units_per_volt * if range_v < 0.0 { -1.0 } else { 1.0 }) as f32,
                range_v: range_v.abs() as f32,
                delay_ns: (1e9 * delay_s).round() as u32,
                bits: *bits,
            },
            factor,
            unknown,
        }))
    }
}

/// Whether an analysis would use a channel of this name if its quantity were known.
fn is_used(plan: &Plan, name: &str) -> bool {
    [Quantity::Force, Quantity::Velocity]
        .into_iter()
        .any(|quantity| role_of(plan, "", name, quantity).is_some())
}

/// Quantity, units per volt and delay of a channel whose sensor the plan describes. The plan does
/// not state the quantity: it is known of hammer, load cells, shaker and vibrometers.
fn from_plan(name: &str, planned: Option<&SensorPlan>) -> Option<(Quantity, f64, Option<f64>)> {
    let sensor = planned?;
    let sensitivity_v = sensor.sensitivity_v?;
    let plain = name.to_lowercase();
    let begins = |words: &[&str]| words.iter().any(|word| plain.starts_with(word));
    let quantity = if begins(&["hammer", "force", "lc", "load", "excitation", "stinger"]) {
        Quantity::Force
    } else if begins(&["ldv", "vib", "velocity"]) {
        Quantity::Velocity
    } else {
        return None;
    };
    let sign = sensor.polarity.map_or(1.0, f64::from);
    Some((quantity, sign / sensitivity_v, sensor.delay_s))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::plan::CONTACT;

    fn file(channels: &[(&str, Option<&str>)]) -> ChannelFile {
        let describe = |(name, unit): &(&str, Option<&str>)| FileChannel {
            name: (*name).into(),
            unit: unit.map(str::to_owned),
            full_scale: None,
            bits: 0,
            delay_s: 0.0,
        };
        let samples = channels.iter().map(|_| ChannelSamples::F64(vec![0.1, 2.0])).collect();
        ChannelFile {
            fs_hz: 51_200.0,
            channels: channels.iter().map(describe).collect(),
            hits: vec![Samples::new(samples).expect("equally long")],
        }
    }

    #[test]
    fn sensitivities_are_volts_per_unit_or_units_per_volt() {
        let near = |text: &str, per_volt: f64, quantity| {
            let found = sensitivity(text).expect("a sensitivity");
            assert!((found.per_volt / per_volt - 1.0).abs() < 1e-12, "{text}: {}", found.per_volt);
            assert_eq!(found.quantity, quantity);
        };
        near("2.25 mV/N", 1.0 / 2.25e-3, Quantity::Force);
        near("125 mm/s/V", 0.125, Quantity::Velocity);
        near("100 mV/g", 98.0665, Quantity::Acceleration);
        near("-10 mV/(m/s^2)", -100.0, Quantity::Acceleration);
        near("1e-2 V/N", 100.0, Quantity::Force);
        near("500 N/FS", 500.0, Quantity::Force);
        for text in ["", "2.25", "mV/N", "0 mV/N", "2 N/s", "2 mV/kg"] {
            assert!(sensitivity(text).is_err(), "{text}");
        }
    }

    #[test]
    fn channels_get_roles_and_scales_or_the_remedy_is_named() {
        let plan = Plan::parse(CONTACT, "contact.toml").expect("a plan");
        let assign = |channels: &[(&str, Option<&str>)], stated: &str| {
            assigned(&plan, "C1", &file(channels), &stated.parse().expect("stated"))
        };
        let usual =
            [("hammer", Some("N")), ("LDV_A", Some("mm/s")), ("ai7", Some("V")), ("spare", Some("V"))];
        let (map, hits) = assign(&usual, "ai7=LC1:4 mV/N,spare=-").expect("all are known");
        let roles: Vec<Role> = map.channels.iter().map(|channel| channel.role).collect();
        assert_eq!(roles, [Role::HammerForce, Role::SpecimenA, Role::LoadCell]);
        let si = |place: usize| map.to_si(place, hits[0].channel(place))[1];
        assert_eq!((si(0), si(2)), (2.0, 500.0));
        assert!((si(1) - 2e-3).abs() < 1e-18);
        assert_eq!(hits[0].channel(2), ChannelView::F64(&[0.1, 2.0]), "volts stay as they came");
        let refused = |channels: &[(&str, Option<&str>)], stated: &str, wanted: &str| {
            let said = assign(channels, stated).expect_err("refused");
            assert!(said.contains(wanted), "{said}");
        };
        refused(&[("hammer", None)], "", "write it into the heading");
        refused(&[("ai0", Some("V"))], "", "--calibrate 'ai0=NAME:SENSITIVITY'");
        refused(&[("thing", Some("mm/s"))], "", "'thing=-' to leave it out");
        refused(&[("hammer", Some("kg"))], "", "its unit `kg`");
        refused(&[("hammer", Some("N"))], "hammer=hammer:2 mV/N", "not in volts");
        refused(&[("hammer", Some("N"))], "ai9=hammer:2 mV/N", "there is no channel `ai9`");
        assert!("ai0".parse::<Calibrations>().expect_err("no name").contains("CHANNEL=NAME"));
    }
}
