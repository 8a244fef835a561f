//! The friction rig: 24 degrees of freedom (30 with a clamp on side B, more where bodies bend), a
//! hammer, a shaker and ten or more channels.
//!
//! Axes: x lateral, y vertical (normal load), z horizontal (sliding); origin at the contact's
//! centre; SI units. One [`Rig`] is one device. It advances by whole scans: [`Rig::scan`] advances
//! structure, bolt and shaker by one scan period and samples all channels at its end. The stuck
//! structure is advanced exactly (see [`stepper`]), so the scan rate does not change the physics; a
//! contact that slips ([`sliders`]) is advanced in smaller steps.
//!
//! **What a record depends on.** Noise, scatter and aiming errors are keyed to (seed,
//! configuration, cell, attempt, purpose) and counted from the last [`Rig::stage`] or
//! [`Rig::fire`]: never to absolute time, never to what happened in other cells. [`Rig::stage`]
//! puts the structure at rest. Within a cell the decay of an earlier hit is physical and does
//! depend on the scans that have passed since. The only exceptions are a contact that drifts, which
//! also depends on the hits and scans since the rig was started, and one that wears, which depends
//! on the energy that its friction has dissipated ([`Rig::worn_j`]).
//!
//! **Cost.** A scan of the assembly at 51.2 kHz takes about 0.1 µs; `benches/rig.rs` measures it.
//! Bodies that bend triple the number of modes. No mode is dropped: the static flexibility of a
//! specimen is in modes at 100 kHz and above, and without them FRFs at 5 kHz would be wrong by more
//! than 1 %. After a hit these modes decay within milliseconds and are then skipped, so that a
//! record takes about as long as with rigid bodies; while the shaker drives, twice as long.

use channels::{EXCITATION, FIRST_SIGNAL, FORCE};
use config::BodyName;
use force::ForceSegment;
use key::stream;
use plant::Plant;
use sensors::Sensors;
use sensors::{Direct, FixedSensors};
use stepper::{ScanForces, Slipping, Span, Stepper};

pub use channels::{CHANNELS, Channel, Measured};
pub use config::RigConfig;
pub use configuration::{Configuration, Quantity};
pub use hammer::{Hit, Mishap};
pub use plant::Stepping;
pub use probe::Aim;
pub use probe::Probe;
pub use sensors::Flaws;
pub use sensors::{FixedFlaw, FixedRows};
pub use structure::exact_frf;
pub use truth::JointState;
pub use truth::Truth;

mod beam;
pub(crate) mod channels;
pub mod config;
mod configuration;
pub mod force;
pub mod hammer;
mod key;
pub mod modal;
mod plant;
mod probe;
pub mod sensors;
pub mod sliders;
pub mod stepper;
pub mod structure;
mod truth;

/// One rig.
#[derive(Debug, Clone)]
pub struct Rig {
    config: RigConfig,
    seed: u64,
    period_s: f64,
    /// The ten, then the fixed sensors.
    channels: Vec<Channel>,
    /// The channels that the front end has; `None` if it has all.
    connected: Option<Connected>,
    flaws: Flaws,
    plants: [Plant; 3],
    known_mass: Option<Plant>,
    /// The assembly with its joint open.
    open: Option<(Box<RigConfig>, Plant)>,
    stepping: Stepping,
    configuration: Configuration,
    impact: String,
    response: String,
    attempt: u32,
    aim: Aim,
    stepper: Stepper,
    /// The joint's sliders, if it can slip and is present.
    slipping: Option<Slipping>,
    sensors: Sensors,
    fixed: FixedSensors,
    direct: Vec<Direct>,
    /// Hammer forces that act now or later, on the clock below.
    pending: Vec<ForceSegment>,
    /// Scans since the last stage or fire.
    scans: u64,
    drive_v: f64,
    truth: [f64; CHANNELS],
    coil_pulses_s: Vec<f64>,
    last_hit: Option<Hit>,
    /// Scans since the rig was started: only a contact that drifts depends on them.
    total_scans: u64,
    /// Hits since then, also only for such a contact.
    total_hits: u64,
    /// The rig with its contact as it is now, if it drifts or wears.
    changed: Option<Box<RigConfig>>,
    /// Hits and scans up to which the contact had drifted when the cell was staged.
    drifted_to: (u64, u64),
    /// Energy that the contact's friction had dissipated when the cell was staged (J).
    worn_before_j: f64,
    /// The same energy up to which the contact stays as it is now (J).
    steady_until_j: f64,
}

impl Rig {
    /// A rig at rest, staged in the assembly at the first impact and the first response of
    /// `config`.
    ///
    /// # Errors
    /// [`RigError::Field`] for an invalid value; [`RigError::Structure`] if the structure's
    /// matrices cannot be factored.
    pub fn new(config: &RigConfig, seed: u64) -> Result<Self, RigError> {
        Self::with_stepping(config, seed, Stepping::Fastest)
    }

    /// As [`Rig::new`], with a chosen way of advancing the structure.
    ///
    /// # Errors
    /// As [`Rig::new`].
    pub fn with_stepping(config: &RigConfig, seed: u64, stepping: Stepping) -> Result<Self, RigError> {
        config.check()?;
        let period_s = 1.0 / f64::from(config.scan_rate_hz);
        let plant = |configuration| Plant::new(config, configuration, stepping, period_s);
        let plants = [plant(Configuration::A)?, plant(Configuration::B)?, plant(Configuration::Ajb)?];
        let known_mass = config
            .known_mass
            .as_ref()
            .map(|mass| Plant::of_known_mass(mass, config, stepping, period_s))
            .transpose()?;
        let open = match &config.open_joint {
            Some(_) => {
                let opened = Box::new(config.opened());
                let plant = Plant::new(&opened, Configuration::Ajb, stepping, period_s)?;
                Some((opened, plant))
            }
            None => None,
        };
        let ten = channels::channels(&config.sensors);
        let flaws = Flaws::new(seed, config, &ten);
        let sensors = Sensors::new(config, &ten, &flaws, None, stream(seed, &["at rest"]));
        let fixed = FixedSensors::new(config, &flaws.fixed, flaws.latency_scans, stream(seed, &["at rest"]));
        let channels: Vec<Channel> = ten.into_iter().chain(sensors::fixed_channels(config)).collect();
        let connected = Connected::of(&channels, &config.sensors.left_out);
        let configuration = Configuration::Ajb;
        // check() has verified that there is at least one of each.
        let (impact, response) = (&config.impacts[0], &config.responses[0]);
        let words = [configuration.as_str(), &impact.name, &response.name];
        let aim = Aim::new(seed, words, &config.errors, impact, response, false);
        let (stepper, slipping) = plants[configuration as usize].aimed(config, &flaws, &aim, &channels)?;
        let mut rig = Self {
            seed,
            period_s,
            plants,
            known_mass,
            open,
            configuration,
            impact: impact.name.clone(),
            response: response.name.clone(),
            attempt: 0,
            aim,
            stepper,
            slipping,
            sensors,
            fixed,
            direct: Vec::new(),
            channels,
            connected,
            flaws,
            pending: Vec::new(),
            scans: 0,
            drive_v: 0.0,
            truth: [0.0; CHANNELS],
            coil_pulses_s: Vec::new(),
            last_hit: None,
            total_scans: 0,
            total_hits: 0,
            changed: None,
            drifted_to: (0, 0),
            worn_before_j: 0.0,
            steady_until_j: f64::INFINITY,
            stepping,
            config: config.clone(),
        };
        let (impact, response) = (rig.impact.clone(), rig.response.clone());
        if config.contact.wear.is_some() {
            // the fully worn contact must be possible too
            let worn = rig.config_after((0, 0), f64::INFINITY);
            let plant = Plant::new(&worn, configuration, stepping, period_s)?;
            plant.aimed(&worn, &rig.flaws, &rig.aim, &rig.channels)?;
        }
        rig.stage(configuration, &impact, &response, 0)?;
        Ok(rig)
    }

    /// The same rig after its contact's friction has dissipated the energy `worn_j` (J), at rest in
    /// the cell that is staged. Only a contact that wears depends on it.
    ///
    /// # Errors
    /// [`RigError::Field`] for an energy that is negative or not a number.
    pub fn after_wear(mut self, worn_j: f64) -> Result<Self, RigError> {
        config::worn(worn_j)?;
        self.slipping = None;
        self.worn_before_j = worn_j;
        let (impact, response) = (self.impact.clone(), self.response.clone());
        self.stage(self.configuration, &impact, &response, self.attempt)?;
        Ok(self)
    }

    /// Scans per second (Hz).
    pub fn scan_rate_hz(&self) -> u32 {
        self.config.scan_rate_hz
    }

    /// The ten channels as far as the front end has them, then the fixed sensors, in the order of
    /// the codes.
    pub fn channels(&self) -> &[Channel] {
        self.connected.as_ref().map_or(&self.channels, |connected| &connected.channels)
    }

    /// The rig's parameters.
    pub fn config(&self) -> &RigConfig {
        &self.config
    }

    /// The device's seed.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The current configuration.
    pub fn configuration(&self) -> Configuration {
        self.configuration
    }

    /// Number of the next attempt within the cell.
    pub fn attempt(&self) -> u32 {
        self.attempt
    }

    /// Moves hammer and vibrometer to a cell. In a laboratory this takes minutes: the structure is
    /// at rest afterwards, the shaker off, and the next [`Rig::fire`] is number `attempt` of the
    /// cell.
    ///
    /// # Errors
    /// [`RigError::UnknownPoint`] listing the valid names; the rig is unchanged.
    pub fn stage(
        &mut self,
        configuration: Configuration,
        impact: &str,
        response: &str,
        attempt: u32,
    ) -> Result<(), RigError> {
        let hit = self.config.impact(configuration, impact)?;
        let seen = self.config.response(configuration, response)?;
        let words = [configuration.as_str(), impact, response];
        let on_known_mass = [hit.body, seen.body].contains(&BodyName::KnownMass);
        if hit.body != seen.body && on_known_mass {
            return Err(RigError::ApartFromKnownMass { impact: impact.into(), response: response.into() });
        }
        let opens = self
            .config
            .open_joint_in(configuration)
            .map_or([false; 2], |open| [open.impact.name == impact, open.response.name == response]);
        if opens[0] != opens[1] {
            return Err(RigError::HalfOpen { impact: impact.into(), response: response.into() });
        }
        let mark = self.config.spots.mark.as_ref();
        let at_mark = configuration == Configuration::B
            && (on_known_mass || mark.is_some_and(|mark| mark.name == response));
        let aim = Aim::new(self.seed, words, &self.config.errors, hit, seen, at_mark);
        let speckle = seen.speckle;
        let worn_j = self.worn_j();
        let drifted_to = (self.total_hits, self.total_scans);
        let changes = self.config.contact.drifts() || self.config.contact.wear.is_some();
        let open = self.open.as_ref().filter(|_| opens[0]);
        let changed = (configuration == Configuration::Ajb && changes && open.is_none())
            .then(|| Box::new(self.config_after(drifted_to, worn_j)));
        let config = changed.as_deref().or(open.map(|(config, _)| &**config)).unwrap_or(&self.config);
        let fresh = match &changed {
            Some(config) => Some(Plant::new(config, configuration, self.stepping, self.period_s)?),
            None => None,
        };
        let own = self.known_mass.as_ref().filter(|_| on_known_mass).or(open.map(|(_, plant)| plant));
        let plant = fresh.as_ref().or(own).unwrap_or(&self.plants[configuration as usize]);
        let (stepper, slipping) = plant.aimed(config, &self.flaws, &aim, &self.channels)?;
        self.direct = plant.direct(config, &self.flaws, &aim);
        if let Some(fresh) = fresh {
            self.plants[configuration as usize] = fresh;
        }
        self.changed = changed;
        self.drifted_to = drifted_to;
        self.worn_before_j = worn_j;
        self.steady_until_j = self.steady_until(worn_j);
        self.aim = aim;
        self.stepper = stepper;
        self.slipping = slipping;
        self.configuration = configuration;
        impact.clone_into(&mut self.impact);
        response.clone_into(&mut self.response);
        self.attempt = attempt;
        let idle = self.shot(attempt, "idle");
        let speckle = speckle.then(|| self.shot(attempt, "idle speckle"));
        let ten = channels::channels(&self.config.sensors);
        self.sensors = Sensors::new(&self.config, &ten, &self.flaws, speckle, idle);
        let idle = self.shot(attempt, "idle fixed");
        self.fixed = FixedSensors::new(&self.config, &self.flaws.fixed, self.flaws.latency_scans, idle);
        self.pending.clear();
        self.scans = 0;
        self.drive_v = 0.0;
        self.truth = [0.0; CHANNELS];
        self.coil_pulses_s.clear();
        self.last_hit = None;
        Ok(())
    }

    /// Energises the hammer's coil for `pulse_s` from the next scan on. A pulse that is not a
    /// positive number does nothing.
    ///
    /// Increments the attempt's number for the next fire.
    pub fn fire(&mut self, pulse_s: f64) {
        if !(pulse_s.is_finite() && pulse_s > 0.0) {
            return;
        }
        let now_s = self.time_s(self.scans);
        self.pending.retain(|segment| segment.end_s > now_s);
        for segment in &mut self.pending {
            *segment = segment.seen_from(now_s);
        }
        let attempt = self.attempt;
        let hit = hammer::strike(&self.config.hammer, pulse_s, attempt, &mut self.shot(attempt, "hit"));
        self.pending.extend_from_slice(&hit.contacts);
        self.sensors.restart(self.shot(attempt, "shot"), self.shot(attempt, "shot speckle"));
        self.fixed.restart(self.shot(attempt, "shot fixed"));
        self.scans = 0;
        self.coil_pulses_s.push(pulse_s);
        self.last_hit = Some(hit);
        self.total_hits += 1;
        self.attempt = attempt.wrapping_add(1);
    }

    /// Ends a running coil pulse now: the bolt flies as after a pulse of the elapsed duration. A
    /// contact that has already begun remains; only the force with which the coil would still have
    /// pressed is removed.
    pub fn coil_off(&mut self) {
        let now_s = self.time_s(self.scans);
        let Some(hit) = self.last_hit.as_mut().filter(|hit| now_s < hit.pulse_s) else { return };
        let (attempt, ordered) = (hit.attempt, std::mem::take(&mut hit.contacts));
        let mut cut = hammer::strike(&self.config.hammer, now_s, attempt, &mut self.shot(attempt, "hit"));
        if ordered.first().is_some_and(|contact| contact.start_s <= now_s) {
            cut.contacts = ordered.iter().filter_map(|contact| contact.until(now_s)).collect();
        }
        self.pending.retain(|segment| !ordered.contains(segment));
        self.pending.extend_from_slice(&cut.contacts);
        if let Some(last) = self.coil_pulses_s.last_mut() {
            *last = now_s;
        }
        self.last_hit = Some(cut);
    }

    /// Sets the shaker's drive (V), held until it is set again and limited like the amplifier; NaN
    /// mutes it.
    ///
    /// The excitation channel reads the force that acted during the scan that it ends.
    pub fn drive(&mut self, volts: f64) {
        let limit = self.config.shaker.limit_v;
        self.drive_v = if volts.is_nan() { 0.0 } else { volts.clamp(-limit, limit) };
    }

    /// Sets the normal load N (N) from the next scan on, as the pneumatic actuator does: the
    /// contact carries at most μN along z. It is kept through later stagings. The linear law has no
    /// limit, whatever the load.
    ///
    /// # Errors
    /// [`RigError::Field`] for a load that is negative, not a number, or too large for a load that
    /// varies; the rig is unchanged.
    pub fn set_normal_load(&mut self, normal_load_n: f64) -> Result<(), RigError> {
        let before = std::mem::replace(&mut self.config.contact.normal_load_n, normal_load_n);
        if let Err(error) = self.config.check() {
            self.config.contact.normal_load_n = before;
            return Err(error);
        }
        if let Some(slipping) = &mut self.slipping {
            slipping.load(normal_load_n);
        }
        Ok(())
    }

    /// Advances exactly one scan period and samples: one 16-bit word per channel, in order, then
    /// the lower words of wide codes ([`jointrig_protocol::block`]). A shorter slice receives the
    /// first words; the end of a longer one is unchanged.
    pub fn scan(&mut self, codes: &mut [i16]) {
        let Some(mut connected) = self.connected.take() else { return self.scan_all(codes) };
        self.scan_all(&mut connected.codes);
        // the upper words, or 16-bit codes, of all channels; then the lower words
        let all = self.channels.len();
        let places = connected.places.iter().copied();
        for (code, place) in codes.iter_mut().zip(places.clone().chain(places.map(|place| all + place))) {
            *code = connected.codes[place];
        }
        self.connected = Some(connected);
    }

    fn scan_all(&mut self, codes: &mut [i16]) {
        if let Some(hand) = self.config.hammer.hand
            && self.scans == (hand.every_s * f64::from(self.config.scan_rate_hz)).round() as u64
        {
            self.fire(hand.pulse_s);
        }
        let (from_s, to_s) = (self.time_s(self.scans), self.time_s(self.scans + 1));
        self.scans += 1;
        self.total_scans += 1;
        let shaker_n = self.drive_v * self.config.shaker.gain_n_per_v;
        let forces = ScanForces { from_s, to_s, hammer: &self.pending, shaker_n };
        match &mut self.slipping {
            None => self.stepper.advance(Span::Scan, &forces),
            Some(slipping) => slipping.advance(&mut self.stepper, &forces),
        }
        if self.steady_until_j < f64::INFINITY && self.worn_j() > self.steady_until_j {
            self.wear();
        }
        self.truth[FORCE] = self.sensors.hammer_n(&self.pending, from_s, to_s);
        self.truth[FIRST_SIGNAL..EXCITATION].copy_from_slice(&self.stepper.signals());
        self.truth[EXCITATION] = shaker_n;
        // only fixed sensors read it
        let hammer_n: f64 = if self.direct.is_empty() {
            0.0
        } else {
            self.pending.iter().map(|segment| segment.value_n(to_s)).sum()
        };
        if self.pending.first().is_some_and(|segment| segment.end_s <= to_s) {
            self.pending.retain(|segment| segment.end_s > to_s);
        }
        let (codes, lower) = codes.split_at_mut(codes.len().min(self.channels.len()));
        self.sensors.convert(self.truth, codes, lower);
        if self.channels.len() > CHANNELS {
            let (stepper, direct) = (&self.stepper, &self.direct);
            let push_n = self.slipping.as_ref().map_or(0.0, |slipping| slipping.sliders().push_n());
            let read = |into: &mut [f64]| {
                stepper.fixed(into);
                for (signal, direct) in into.iter_mut().zip(direct) {
                    *signal += direct.hammer * hammer_n + direct.shaker * shaker_n + direct.joint * push_n;
                }
            };
            let [codes, lower] = [codes, lower].map(|words| words.get_mut(CHANNELS..).unwrap_or_default());
            self.fixed.convert(read, codes, lower);
        }
    }

    /// The rig with its contact as it is now.
    fn current(&self) -> &RigConfig {
        let open = self.open().map(|(config, _)| &**config);
        self.changed.as_deref().or(open).unwrap_or(&self.config)
    }

    /// The rig after its contact has drifted for these hits and scans, and dissipated this energy.
    fn config_after(&self, (hits, scans): (u64, u64), worn_j: f64) -> RigConfig {
        let contact = self.config.contact.drifted(hits, self.time_s(scans)).worn(worn_j);
        RigConfig { contact, ..self.config.clone() }
    }

    fn steady_until(&self, worn_j: f64) -> f64 {
        self.config.contact.wear.map_or(f64::INFINITY, |wear| wear.steady_until_j(worn_j))
    }

    /// Applies the law of wear in the middle of the motion.
    ///
    /// # Panics
    /// Never: [`Rig::with_stepping`] has built the unworn and the fully worn contact, and all
    /// others lie between them.
    fn wear(&mut self) {
        let worn_j = self.worn_j();
        self.steady_until_j = self.steady_until(worn_j);
        // only the assembly has a contact
        let place = Configuration::Ajb as usize;
        let config = self.config_after(self.drifted_to, worn_j);
        let plant = Plant::new(&config, Configuration::Ajb, self.stepping, self.period_s)
            .expect("lies between two contacts that were built");
        let (mut stepper, mut slipping) = plant
            .aimed(&config, &self.flaws, &self.aim, &self.channels)
            .expect("lies between two contacts that were built");
        stepper.set_state(&plant.state_of(&self.plants[place], &self.stepper));
        if let (Some(now), Some(before)) = (&mut slipping, &self.slipping) {
            now.continues(before);
        }
        self.direct = plant.direct(&config, &self.flaws, &self.aim);
        self.plants[place] = plant;
        (self.stepper, self.slipping) = (stepper, slipping);
        self.changed = Some(Box::new(config));
    }

    fn time_s(&self, scans: u64) -> f64 {
        scans as f64 * self.period_s
    }

    fn shot(&self, attempt: u32, purpose: &str) -> key::Stream {
        let number = attempt.to_string();
        let words = [self.configuration.as_str(), &self.impact, &self.response, &number, purpose];
        stream(self.seed, &words)
    }
}

/// True values that only the simulator knows; for tests.
impl Rig {
    /// The true geometry of the cell, errors included.
    pub fn aim(&self) -> &Aim {
        &self.aim
    }

    /// Errors of this campaign's instruments: true positions of the spots, true gains, skews and
    /// cross-talk.
    pub fn flaws(&self) -> &Flaws {
        &self.flaws
    }

    /// The noise-free signals of the last scan, before cross-talk, gain, delay and polarity, in the
    /// channels' units; the hammer's force with its cell's ringing.
    pub fn truth(&self) -> &[f64; CHANNELS] {
        &self.truth
    }

    /// Coil-on time (s) of every fire since the last stage.
    pub fn coil_pulses_s(&self) -> &[f64] {
        &self.coil_pulses_s
    }

    /// The last fire since the last stage: its mishap and its contacts, on a clock that starts at
    /// the fire.
    pub fn last_hit(&self) -> Option<&Hit> {
        self.last_hit.as_ref()
    }

    /// The assembly with its joint open, if that is staged.
    fn open(&self) -> Option<&(Box<RigConfig>, Plant)> {
        let of_impact = self.config.open_joint_in(self.configuration).map(|open| &open.impact.name);
        self.open.as_ref().filter(|_| of_impact == Some(&self.impact))
    }

    /// What is stepped: the known mass if it is struck, the assembly with its joint open, else the
    /// staged configuration.
    fn plant(&self) -> &Plant {
        let known_mass = self.known_mass.as_ref().filter(|_| self.aim.impact.body == BodyName::KnownMass);
        let open = self.open().map(|(_, plant)| plant);
        known_mass.or(open).unwrap_or(&self.plants[self.configuration as usize])
    }

    /// Energy that the contact's friction has dissipated in the rig's life (J): what a contact that
    /// wears depends on.
    pub fn worn_j(&self) -> f64 {
        self.worn_before_j + self.slipping.as_ref().map_or(0.0, |slipping| slipping.sliders().friction_j())
    }

    /// Current mechanical energy of the structure (J).
    pub fn energy_j(&self) -> f64 {
        let plant = self.plant();
        plant.energy_j(self.current(), &self.stepper, self.slipping.as_ref())
    }

    /// Current state of the joint; `None` outside the assembly.
    pub fn joint(&self) -> Option<JointState> {
        let plant = self.plant();
        plant.joint_state(self.current(), &self.stepper, self.slipping.as_ref())
    }

    /// Current true displacement (m) and velocity (m/s) along a probe; `None` if its body is not
    /// present.
    pub fn motion(&self, probe: &Probe) -> Option<(f64, f64)> {
        self.plant().motion(&self.stepper, probe)
    }

    /// Why the staged configuration is stepped by its matrix exponential, if it is.
    pub fn fallback(&self) -> Option<modal::ModalError> {
        self.plant().fallback()
    }
}

/// What went wrong, where, and what to do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RigError {
    /// The rig file cannot be parsed.
    #[error("rig file{}: {reason}", line.map(|line| format!(", line {line}")).unwrap_or_default())]
    Document {
        /// Line of the file, from 1.
        line: Option<usize>,
        /// The reason, in words.
        reason: String,
    },
    /// A field has an invalid value.
    #[error("rig field {field}{} {reason}", line.map(|line| format!(" (line {line})")).unwrap_or_default())]
    Field {
        /// Path of the field.
        field: String,
        /// Why it is invalid.
        reason: String,
        /// Line of the rig file, from 1, where the file sets it.
        line: Option<usize>,
    },
    /// Hammer and vibrometer are to be on the known mass and on another body.
    #[error(
        "impact {impact} and response {response} are not both on the known mass, which is connected to nothing: move both there, or neither"
    )]
    ApartFromKnownMass {
        /// The impact.
        impact: String,
        /// The response.
        response: String,
    },
    /// One of hammer and vibrometer is to be at its point of the open joint, the other not.
    #[error(
        "impact {impact} and response {response}: only one of them is a point of the open joint; the joint is either open or closed"
    )]
    HalfOpen {
        /// The impact.
        impact: String,
        /// The response.
        response: String,
    },
    /// No such impact or response point in this configuration.
    #[error("no {kind} point {name:?} in configuration {configuration}; there are: {}", valid.join(", "))]
    UnknownPoint {
        /// `impact` or `response`.
        kind: &'static str,
        /// The requested name.
        name: String,
        /// The configuration on the rig.
        configuration: Configuration,
        /// The valid names.
        valid: Vec<String>,
    },
    /// The requested point is on a body that this configuration does not have.
    #[error("a point sits on {body}, which configuration {configuration} does not have")]
    MissingBody {
        /// The body.
        body: String,
        /// The configuration.
        configuration: Configuration,
    },
    /// The structure's matrices cannot be factored.
    #[error("configuration {configuration}: {what}; check masses, inertias and stiffnesses")]
    Structure {
        /// The configuration.
        configuration: Configuration,
        /// What failed.
        what: &'static str,
    },
}

/// The channels of a front end that lacks some of the rig's.
#[derive(Debug, Clone)]
struct Connected {
    channels: Vec<Channel>,
    /// Their indices among all.
    places: Vec<usize>,
    /// The codes of all channels in the last scan, and the lower words of wide ones.
    codes: Vec<i16>,
}

impl Connected {
    /// `None` if none is left out.
    fn of(all: &[Channel], left_out: &[String]) -> Option<Self> {
        let there = all.iter().enumerate().filter(|(_, channel)| !left_out.contains(&channel.name));
        let (channels, places) = there.map(|(place, channel)| (channel.clone(), place)).unzip();
        (!left_out.is_empty()).then(|| Self { channels, places, codes: vec![0; 2 * all.len()] })
    }
}

/// `v` normalised to length one; `v` must not be zero.
pub(super) fn normalized(v: [f64; 3]) -> [f64; 3] {
    // Divided by the largest component first, so that the squares of very small or large vectors
    // neither underflow nor overflow.
    let largest = v.iter().fold(0.0_f64, |largest, c| largest.max(c.abs()));
    let v = v.map(|c| c / largest);
    let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
    v.map(|c| c / length)
}
