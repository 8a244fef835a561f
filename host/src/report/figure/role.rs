//! The role of a mark (what it represents), the appearance of each role, light and dark, in report,
//! files and dashboard; and the axis against which marks are drawn: its quantity, unit and range.
//!
//! Colours follow Okabe and Ito, so that colour-blind readers can distinguish them; neighbouring
//! roles also differ in lightness and dash, so that they remain distinct in grey print. The
//! contrast with the background is at least 3 : 1 in light and dark, which a test verifies.

use serde::Serialize;
use std::fmt::Write;

macro_rules! roles {
    ($($(#[$about:meta])* $role:ident = $name:literal $light:literal $dark:literal $dash:literal $width:literal;)*) => {
        /// What a mark represents.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
        pub enum Role {
            $($(#[$about])* #[serde(rename = $name)] $role,)*
        }

        /// All roles.
        pub const ALL: &[Role] = &[$(Role::$role),*];

        impl Role {
            /// Its name in CSS classes and in JSON.
            pub const fn name(self) -> &'static str {
                match self { $(Role::$role => $name),* }
            }

            /// Its colour on a light background.
            pub const fn light(self) -> &'static str {
                match self { $(Role::$role => $light),* }
            }

            /// Its colour on a dark background.
            pub const fn dark(self) -> &'static str {
                match self { $(Role::$role => $dark),* }
            }

            /// Its dash pattern; empty for a solid line.
            pub const fn dash(self) -> &'static str {
                match self { $(Role::$role => $dash),* }
            }

            /// The width of its lines, px.
            pub const fn width(self) -> f64 {
                match self { $(Role::$role => $width),* }
            }
        }
    };
}

roles! {
    /// Specimen A.
    SpecimenA = "specimen-a" "#c24e00" "#ff9d5c" "" 1.4;
    /// Specimen B.
    SpecimenB = "specimen-b" "#0072b2" "#56b4e9" "" 1.4;
    /// Arm A.
    ArmA = "arm-a" "#c24e00" "#ff9d5c" "6 3" 1.1;
    /// Arm B.
    ArmB = "arm-b" "#0072b2" "#56b4e9" "6 3" 1.1;
    /// Δx between the specimens.
    Relative = "relative" "#00805d" "#2fc79a" "" 1.4;
    /// The force through the contact.
    Force = "force" "#333333" "#dddddd" "" 1.2;
    /// An estimate of the stiffness between the arms.
    BetweenArms = "between-arms" "#0072b2" "#56b4e9" "" 2.0;
    /// The answer: the contact's own stiffness.
    Answer = "answer" "#00704f" "#2fc79a" "" 3.0;
    /// Clamps in series with the contact.
    Clamp = "clamp" "#8a6100" "#e6b84c" "" 2.0;
    /// Results of loops or levels.
    Loops = "loops" "#c24e00" "#ff9d5c" "" 2.0;
    /// True values of a simulated rig, as an ideal measurement would find.
    Truth = "truth" "#7a2e8e" "#d69be6" "4 3" 1.8;
    /// Two interface deformation modes.
    Modes2 = "modes-2" "#00805d" "#2fc79a" "2 2" 1.1;
    /// Four interface deformation modes.
    Modes4 = "modes-4" "#c24e00" "#ff9d5c" "6 3" 1.1;
    /// Six interface deformation modes.
    Modes6 = "modes-6" "#0072b2" "#56b4e9" "" 1.4;
    /// Measured data.
    Measured = "measured" "#333333" "#dddddd" "" 1.1;
    /// A model's curve fitted to it.
    Fitted = "fitted" "#c24e00" "#ff9d5c" "7 4" 1.8;
    /// Noise.
    Noise = "noise" "#6b6b6b" "#a0a0a0" "3 3" 1.0;
    /// Data that are not credible or were refused.
    Refused = "refused" "#b0392b" "#ff8f80" "" 1.2;
    /// The first of several groups.
    Group1 = "group-1" "#0072b2" "#56b4e9" "" 1.2;
    /// The second group.
    Group2 = "group-2" "#c24e00" "#ff9d5c" "6 3" 1.2;
    /// The third group.
    Group3 = "group-3" "#00805d" "#2fc79a" "2 2" 1.2;
    /// The fourth group.
    Group4 = "group-4" "#a8488a" "#e39ac4" "8 3 2 3" 1.2;
    /// The fifth group.
    Group5 = "group-5" "#806600" "#e6b84c" "4 4" 1.2;
    /// The sixth and all further groups.
    Group6 = "group-6" "#333333" "#dddddd" "1 3" 1.2;
    /// The band over which results are quoted.
    Band = "band" "#b98900" "#e6b84c" "" 1.0;
    /// Where the hammer's force is too low.
    Unusable = "unusable" "#777777" "#9a9a9a" "" 1.0;
    /// The next positions of hammer and vibrometer.
    Next = "next" "#b0005e" "#ff7ab8" "" 2.4;
    /// A guide line.
    Guide = "guide" "#777777" "#9a9a9a" "3 3" 1.0;
}

impl Role {
    /// The role for one of several groups.
    pub fn group(index: usize) -> Role {
        const GROUPS: [Role; 6] =
            [Role::Group1, Role::Group2, Role::Group3, Role::Group4, Role::Group5, Role::Group6];
        GROUPS[index.min(GROUPS.len() - 1)]
    }

    /// The role for a set of interface deformation modes.
    pub fn modes(count: usize) -> Role {
        match count {
            2 => Role::Modes2,
            4 => Role::Modes4,
            _ => Role::Modes6,
        }
    }

    /// Opacity of an area of this role, 0…1.
    pub fn opacity(self) -> f64 {
        match self {
            Role::Band => 0.16,
            Role::Unusable => 0.22,
            _ => 0.2,
        }
    }
}

/// Background colour, light and dark.
pub const PAPER: [&str; 2] = ["#ffffff", "#16181b"];

/// The roles as CSS variables `--r-NAME`, with the dark colours if `dark`.
pub fn variables(dark: bool) -> String {
    let mut css = String::new();
    for role in ALL {
        let colour = if dark { role.dark() } else { role.light() };
        let _ = write!(css, "--r-{}:{colour};", role.name());
    }
    css
}

/// CSS classes that use the variables: `s-NAME` strokes, `f-NAME` fills.
pub fn classes() -> String {
    let mut css = String::new();
    for role in ALL {
        let name = role.name();
        let _ = write!(css, ".s-{name}{{stroke:var(--r-{name})}}.f-{name}{{fill:var(--r-{name})}}");
    }
    css
}

/// The same classes with the colours for a light background written out, for standalone files.
pub fn plain_classes() -> String {
    let mut css = String::new();
    for role in ALL {
        let (name, colour) = (role.name(), role.light());
        let _ = write!(css, ".s-{name}{{stroke:{colour}}}.f-{name}{{fill:{colour}}}");
    }
    css
}

/// Scale of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Spread {
    /// Linear.
    Linear,
    /// Logarithmic; both ends must be positive.
    Log,
}

/// One axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Axis {
    /// Quantity shown along it.
    pub quantity: String,
    /// Its unit; empty for a plain number.
    pub unit: &'static str,
    /// Scale.
    pub scale: Spread,
    /// Full range.
    pub range: [f64; 2],
    /// Ticks at multiples of this, e.g. for degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every: Option<f64>,
    /// Axes with the same link are zoomed together.
    #[serde(skip_serializing_if = "str::is_empty")]
    pub link: &'static str,
    /// Names instead of numbers, at 0, 1, 2 …; on a vertical axis they start at the top.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<String>,
}

impl Axis {
    /// A linear axis.
    pub fn linear(quantity: impl Into<String>, unit: &'static str, range: [f64; 2]) -> Self {
        Axis {
            quantity: quantity.into(),
            unit,
            scale: Spread::Linear,
            range,
            every: None,
            link: "",
            names: Vec::new(),
        }
    }

    /// A logarithmic axis.
    pub fn log(quantity: impl Into<String>, unit: &'static str, range: [f64; 2]) -> Self {
        Axis { scale: Spread::Log, ..Axis::linear(quantity, unit, range) }
    }

    /// Frequencies, Hz, zoomed together with all other frequency axes of the page.
    pub fn frequency(scale: Spread, range: [f64; 2]) -> Self {
        Axis { scale, link: "frequency", ..Axis::linear("frequency", "Hz", range) }
    }

    /// An axis of names.
    pub fn named(quantity: impl Into<String>, names: Vec<String>) -> Self {
        let range = [-0.5, names.len() as f64 - 0.5];
        Axis { names, ..Axis::linear(quantity, "", range) }
    }

    /// The same axis with ticks at multiples of `every`.
    #[must_use]
    pub fn every(self, every: f64) -> Self {
        Axis { every: Some(every), ..self }
    }

    /// The same axis, zoomed together with others of this link.
    #[must_use]
    pub fn linked(self, link: &'static str) -> Self {
        Axis { link, ..self }
    }

    /// The axis label.
    pub fn label(&self) -> String {
        if self.unit.is_empty() { self.quantity.clone() } else { format!("{}, {}", self.quantity, self.unit) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance by WCAG 2.
    fn luminance(colour: &str) -> f64 {
        let part = |at: usize| {
            let v = f64::from(u8::from_str_radix(&colour[at..at + 2], 16).expect("a colour")) / 255.0;
            if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * part(1) + 0.7152 * part(3) + 0.0722 * part(5)
    }

    #[test]
    fn every_role_stands_out_from_both_papers() {
        let contrast = |a: &str, b: &str| {
            let (a, b) = (luminance(a), luminance(b));
            (a.max(b) + 0.05) / (a.min(b) + 0.05)
        };
        for role in ALL {
            for (colour, paper) in [(role.light(), PAPER[0]), (role.dark(), PAPER[1])] {
                let found = contrast(colour, paper);
                assert!(found >= 3.0, "{}: {found:.2}", role.name());
            }
        }
    }
}
