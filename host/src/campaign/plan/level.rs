//! A level of the shaker: the controlled quantity and its amplitude, at one frequency or over a
//! sweep, before or after the hammer's cells.

use std::fmt;
use std::str::FromStr;

use jointrig_protocol::request::Control;

/// The quantity that is held constant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Held {
    /// The relative displacement of the specimens, m.
    Displacement,
    /// The excitation's force, N.
    Force,
    /// The drive, V.
    Drive,
}

impl Held {
    /// Its name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Displacement => "displacement",
            Self::Force => "force",
            Self::Drive => "drive",
        }
    }

    /// Formats an amplitude of it with a unit that suits its size.
    pub fn show(self, amplitude: f64) -> String {
        match self {
            Self::Displacement => format!("{} µm", brief(amplitude * 1e6)),
            Self::Force => format!("{} N", brief(amplitude)),
            Self::Drive => format!("{} V", brief(amplitude)),
        }
    }

    /// The command for the device.
    pub fn control(self, amplitude: f64) -> Control {
        match self {
            Self::Displacement => Control::Displacement { amplitude_m: amplitude as f32 },
            Self::Force => Control::Force { amplitude_n: amplitude as f32 },
            Self::Drive => Control::Drive,
        }
    }
}

impl FromStr for Held {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        [Self::Displacement, Self::Force, Self::Drive]
            .into_iter()
            .find(|held| held.name() == text)
            .ok_or_else(|| "write displacement, force or drive".into())
    }
}

/// When a level is measured: before and after, so that wear shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Moment {
    /// Before the hammer's cells.
    Before,
    /// After them.
    After,
}

impl Moment {
    /// Its name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Before => "before",
            Self::After => "after",
        }
    }
}

impl FromStr for Moment {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        [Self::Before, Self::After]
            .into_iter()
            .find(|moment| moment.name() == text)
            .ok_or_else(|| "write before or after".into())
    }
}

/// One level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Its frequency, or the first frequency of a sweep, Hz.
    pub frequency_hz: f64,
    /// The last frequency of a sweep, Hz; `None` for a step.
    pub end_hz: Option<f64>,
    /// The quantity that is held constant.
    pub held: Held,
    /// Its amplitude, m, N or V.
    pub amplitude: f64,
}

impl Level {
    /// Whether both are equal to within the precision of a command line (1e-6 relative).
    pub fn same(&self, other: &Self) -> bool {
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-6 * a.abs().max(b.abs());
        self.held == other.held
            && near(self.frequency_hz, other.frequency_hz)
            && near(self.amplitude, other.amplitude)
            && match (self.end_hz, other.end_hz) {
                (Some(a), Some(b)) => near(a, b),
                (None, None) => true,
                _ => false,
            }
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let amplitude = self.held.show(self.amplitude);
        match self.end_hz {
            None => write!(f, "{} Hz, {amplitude}", brief(self.frequency_hz)),
            Some(end) => write!(f, "sweep {}–{} Hz, {amplitude}", brief(self.frequency_hz), brief(end)),
        }
    }
}

/// At most four significant digits, no trailing zeros.
fn brief(value: f64) -> String {
    let digits = (3 - value.abs().max(1e-12).log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_named_in_units_of_their_size() {
        let level = Level { frequency_hz: 250.0, end_hz: None, held: Held::Displacement, amplitude: 1.5e-7 };
        assert_eq!(level.to_string(), "250 Hz, 0.15 µm");
        let sweep = Level { end_hz: Some(400.0), held: Held::Drive, amplitude: 0.25, ..level };
        assert_eq!(sweep.to_string(), "sweep 250–400 Hz, 0.25 V");
        assert!(level.same(&Level { amplitude: 1.500_000_1e-7, ..level }));
        assert!(!level.same(&Level { amplitude: 1.6e-7, ..level }) && !level.same(&sweep));
    }

    #[test]
    fn names_are_read_back() {
        for held in [Held::Displacement, Held::Force, Held::Drive] {
            assert_eq!(held.name().parse(), Ok(held));
        }
        for moment in [Moment::Before, Moment::After] {
            assert_eq!(moment.name().parse(), Ok(moment));
        }
        assert!("loud".parse::<Held>().is_err() && "during".parse::<Moment>().is_err());
    }
}
