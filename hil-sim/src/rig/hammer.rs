//! The automatic hammer: a coil accelerates a bolt against a return spring, and the bolt flies
//! freely after the pulse.
//!
//! m x'' = coil − preload − k x while the current is on, m x'' = −preload − k x after it. Both are
//! solved in closed form, as are the arrival times, so a pulse has no step size. At the surface
//! (x = gap) the structure counts as rigid: the tip's spring reverses the bolt in a half-sine of
//! duration π √(m/k_tip) and peak v √(m k_tip), and a fraction of the speed is left. With too short
//! a pulse the bolt turns back before it arrives. With a longer one it is faster, until it arrives
//! with the current still on; with a still longer one the coil pushes it on: it strikes again, and
//! finally rests on the surface until the current ends. The rest stop absorbs the bolt without a
//! rebound.

use std::f64::consts::PI;

use super::config::Hammer;
use super::force::ForceSegment;
use super::key::{Stream, normal, uniform};

/// A bolt slower than this (m/s) no longer bounces: below it the peak of a contact is about a
/// newton.
const RESTING_SPEED: f64 = 5e-3;
/// Maximum number of contacts per pulse; restitution makes more impossible for any pulse that a
/// coil survives.
const MOST_CONTACTS: usize = 16;

/// Disturbance of a hit, if any.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mishap {
    /// No disturbance.
    None,
    /// A second pulse follows.
    DoubleHit,
    /// Much too weak.
    Weak,
    /// Beyond the sensors' range.
    Overload,
}

/// Effect of one coil pulse.
#[derive(Debug, Clone, PartialEq)]
pub struct Hit {
    /// Number of the attempt within the cell.
    pub attempt: u32,
    /// Time for which the coil was energised (s).
    pub pulse_s: f64,
    /// The disturbance.
    pub mishap: Mishap,
    /// Forces on the structure along the impact, on a clock that starts with the coil pulse; empty
    /// if the bolt did not arrive.
    pub contacts: Vec<ForceSegment>,
}

impl Hit {
    /// The largest true force (N); zero if the bolt did not arrive.
    pub fn peak_n(&self) -> f64 {
        self.contacts.iter().map(|contact| contact.amplitude_n).fold(0.0, f64::max)
    }
}

/// Duration of an undisturbed contact (s).
pub fn nominal_width_s(hammer: &Hammer) -> f64 {
    PI * (hammer.bolt_kg / hammer.tip_n_per_m).sqrt()
}

/// Fires the coil for `pulse_s`; scatter and mishaps come from `stream`, warming from the attempt's
/// number in its cell.
pub fn strike(hammer: &Hammer, pulse_s: f64, attempt: u32, stream: &mut Stream) -> Hit {
    // All are drawn in a fixed order, used or not, so that changing one parameter does not change
    // the other draws.
    let speed_scatter = (1.0 + hammer.speed_scatter * normal(stream)).max(0.0);
    let width_scatter = (1.0 + hammer.width_scatter * normal(stream)).max(0.1);
    let luck = uniform(stream);
    let (first, second) = (uniform(stream), uniform(stream));
    let between = |[low, high]: [f64; 2], at: f64| low + (high - low) * at;

    let warm = hammer.warming * (1.0 - (-f64::from(attempt) / hammer.warming_attempts).exp());
    let mut contacts = flight(hammer, pulse_s, hammer.coil_n * (1.0 - warm));
    for contact in &mut contacts {
        if contact.omega > 0.0 {
            let (width, peak) = (contact.width_s() * width_scatter, contact.amplitude_n * speed_scatter);
            *contact = ForceSegment::half_sine(contact.start_s, width, peak);
        }
    }
    let mut mishap = Mishap::None;
    let odds = &hammer.mishaps;
    if let Some(hit) = contacts.first().copied() {
        if luck < odds.double_hit {
            mishap = Mishap::DoubleHit;
            contacts.truncate(1);
            contacts.push(ForceSegment::half_sine(
                hit.start_s + between(odds.double_delay_s, second),
                hit.width_s(),
                hit.amplitude_n * between(odds.double_fraction, first),
            ));
        } else if luck < odds.double_hit + odds.weak {
            mishap = Mishap::Weak;
            scale(&mut contacts, between(odds.weak_fraction, first));
        } else if luck < odds.double_hit + odds.weak + odds.overload {
            mishap = Mishap::Overload;
            scale(&mut contacts, between(odds.overload_factor, first));
        }
    }
    Hit { attempt, pulse_s, mishap, contacts }
}

fn scale(contacts: &mut [ForceSegment], factor: f64) {
    for contact in contacts {
        contact.amplitude_n *= factor;
    }
}

/// The bolt's contacts for a coil force `coil_n` that lasts `pulse_s`.
fn flight(hammer: &Hammer, pulse_s: f64, coil_n: f64) -> Vec<ForceSegment> {
    let width_s = nominal_width_s(hammer);
    let per_speed = (hammer.bolt_kg * hammer.tip_n_per_m).sqrt();
    let pressing_n = coil_n - hammer.preload_n - hammer.spring_n_per_m * hammer.gap_m;
    let mut contacts = Vec::new();
    let mut bolt = Bolt { t_s: 0.0, x_m: 0.0, v_m_s: 0.0 };
    while contacts.len() < MOST_CONTACTS {
        let Some(arrival) = bolt.arrives(hammer, pulse_s, coil_n) else { break };
        bolt = arrival;
        if bolt.v_m_s < RESTING_SPEED {
            if bolt.t_s < pulse_s && pressing_n > 0.0 {
                contacts.push(ForceSegment::steady(bolt.t_s, pulse_s, pressing_n));
            }
            break;
        }
        contacts.push(ForceSegment::half_sine(bolt.t_s, width_s, bolt.v_m_s * per_speed));
        bolt.t_s += width_s;
        bolt.v_m_s *= -hammer.restitution;
    }
    contacts
}

/// State of the bolt; x from the rest stop towards the surface.
#[derive(Debug, Clone, Copy)]
struct Bolt {
    t_s: f64,
    x_m: f64,
    v_m_s: f64,
}

impl Bolt {
    /// The bolt when it next reaches the surface, if it does.
    fn arrives(self, hammer: &Hammer, pulse_s: f64, coil_n: f64) -> Option<Self> {
        let driven = (coil_n - hammer.preload_n) / hammer.spring_n_per_m;
        let mut bolt = self;
        if bolt.t_s < pulse_s {
            if bolt.x_m <= 0.0 && driven <= 0.0 {
                return None;
            }
            let swing = Swing::new(hammer, bolt, driven);
            if let Some(arrival) = swing.reaches(hammer.gap_m).filter(|arrival| arrival.t_s <= pulse_s) {
                return Some(arrival);
            }
            bolt = swing.at(pulse_s);
            if bolt.x_m <= 0.0 {
                return None;
            }
        }
        Swing::new(hammer, bolt, -hammer.preload_n / hammer.spring_n_per_m).reaches(hammer.gap_m)
    }
}

/// x = centre + amplitude cos(ω (t − t0) + phase): the bolt on its return spring under a constant
/// force.
struct Swing {
    t0_s: f64,
    centre_m: f64,
    amplitude_m: f64,
    omega: f64,
    phase: f64,
}

impl Swing {
    fn new(hammer: &Hammer, bolt: Bolt, centre_m: f64) -> Self {
        let omega = (hammer.spring_n_per_m / hammer.bolt_kg).sqrt();
        let (from_centre, per_omega) = (bolt.x_m - centre_m, -bolt.v_m_s / omega);
        Self {
            t0_s: bolt.t_s,
            centre_m,
            amplitude_m: from_centre.hypot(per_omega),
            omega,
            phase: per_omega.atan2(from_centre),
        }
    }

    fn at(&self, t_s: f64) -> Bolt {
        let angle = self.omega * (t_s - self.t0_s) + self.phase;
        Bolt {
            t_s,
            x_m: self.centre_m + self.amplitude_m * angle.cos(),
            v_m_s: -self.amplitude_m * self.omega * angle.sin(),
        }
    }

    /// The next time x rises through `level_m`, before the bolt falls back onto the rest stop.
    fn reaches(&self, level_m: f64) -> Option<Bolt> {
        let cosine = (level_m - self.centre_m) / self.amplitude_m;
        if cosine.is_nan() || cosine.abs() > 1.0 {
            return None;
        }
        // Rising means sin < 0: the angle is −acos, plus whole turns; strictly after the start.
        let turn = 2.0 * PI;
        let rising = -cosine.acos();
        let mut ahead = (rising - self.phase).rem_euclid(turn);
        // When leaving the surface the bolt falls through the level; rounding must not make that an
        // arrival.
        if ahead < 1e-9 {
            ahead += turn;
        }
        let floor = -self.centre_m / self.amplitude_m;
        if floor.abs() <= 1.0 {
            let falling = (floor.acos() - self.phase).rem_euclid(turn);
            if falling > 1e-9 && falling < ahead {
                return None;
            }
        }
        Some(self.at(self.t0_s + ahead / self.omega))
    }
}
