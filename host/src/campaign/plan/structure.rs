//! The laboratory's names of the structures, and the sliding direction of the contact.

use jointrig_protocol::request::Configuration;
use serde::Deserialize;

use super::faults::Faults;
use super::{PRINTABLE, Plan, configuration_name, configuration_named, printable};

/// Longest name of a structure, characters.
const LONGEST: usize = 40;

/// Names in place of A, B and AJB, and the sliding direction in place of z.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StructurePlan {
    /// Name of A: the substructure that the shaker drives, or either one if there is no shaker.
    pub a: Option<String>,
    /// Name of B.
    pub b: Option<String>,
    /// Name of A joined to B.
    pub assembly: Option<String>,
    /// The sliding direction in the geometry's coordinates, a unit vector; z if absent.
    pub sliding: Option<[f64; 3]>,
}

impl StructurePlan {
    fn own(&self, configuration: Configuration) -> Option<&str> {
        match configuration {
            Configuration::A => self.a.as_deref(),
            Configuration::B => self.b.as_deref(),
            Configuration::Ajb => self.assembly.as_deref(),
        }
    }
}

/// All configurations.
pub(super) const ALL: [Configuration; 3] = [Configuration::A, Configuration::B, Configuration::Ajb];

impl Plan {
    /// The plan's name of a configuration.
    pub fn called(&self, configuration: Configuration) -> &str {
        let own = self.structure.as_ref().and_then(|own| own.get_ref().own(configuration));
        own.unwrap_or(configuration_name(configuration))
    }

    /// The configuration with that name: the plan's name, or A, B or AJB.
    pub fn configuration(&self, name: &str) -> Option<Configuration> {
        ALL.into_iter().find(|own| self.called(*own) == name).or_else(|| configuration_named(name))
    }

    /// The names that differ from A, B and AJB: `A is the frame, …`; `None` if none differs.
    pub fn own_names(&self) -> Option<String> {
        let named: Vec<String> = ALL
            .into_iter()
            .filter(|own| self.called(*own) != configuration_name(*own))
            .map(|own| format!("{} is {}", configuration_name(own), self.called(own)))
            .collect();
        (!named.is_empty()).then(|| named.join(", "))
    }

    /// The sliding direction in the geometry's coordinates.
    pub fn sliding(&self) -> [f64; 3] {
        self.structure.as_ref().and_then(|own| own.get_ref().sliding).unwrap_or([0.0, 0.0, 1.0])
    }

    /// The rows of the rotation from the geometry's coordinates to those of the interface: z is the
    /// sliding direction, and y is as close as possible to the geometry's y (to its x if the
    /// sliding direction is close to y). The identity if z is the sliding direction.
    pub fn to_interface(&self) -> [[f64; 3]; 3] {
        let z = unit(self.sliding());
        let guide = if z[1].abs() > 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
        let along = dot(guide, z);
        let y = unit([0, 1, 2].map(|i| guide[i] - along * z[i]));
        let x = [y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0]];
        [x, y, z]
    }

    /// Whether the sliding direction is z, so that measured data need no rotation.
    pub fn slides_along_z(&self) -> bool {
        self.sliding() == [0.0, 0.0, 1.0]
    }

    pub(super) fn check_structure(&self, faults: &mut Faults) {
        let Some(own) = &self.structure else { return };
        let (own, at) = (own.get_ref(), own.span().start);
        if let Some(sliding) = own.sliding {
            faults.unless(
                (dot(sliding, sliding).sqrt() - 1.0).abs() <= 1e-3,
                at,
                "structure.sliding must have length 1",
            );
        }
        for one in ALL {
            let Some(name) = own.own(one) else { continue };
            faults.unless(
                printable(name) && !name.contains(['/', '\\']) && name.chars().count() <= LONGEST,
                at,
                format!("structure: the name {name:?} must have {PRINTABLE}, no / or \\, and at most {LONGEST} characters"),
            );
            let other = ALL.into_iter().find(|other| {
                *other != one && (self.called(*other) == name || configuration_name(*other) == name)
            });
            faults.unless(
                other.is_none(),
                at,
                format!("structure: two configurations would be called `{name}`"),
            );
        }
    }

    /// The same plan with A, B and AJB in place of the plan's own names in the list of
    /// configurations, since files use these.
    pub(super) fn with_usual_names(mut self) -> Self {
        let known: Vec<Option<Configuration>> =
            self.configuration.iter().map(|block| self.configuration(block.name.get_ref())).collect();
        for (block, known) in self.configuration.iter_mut().zip(known) {
            if let Some(configuration) = known {
                *block.name.get_mut() = configuration_name(configuration).into();
            }
        }
        self
    }
}

/// The vector `v` after the rotation with these rows.
pub fn turned(rows: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    rows.map(|row| dot(row, v))
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.into_iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(super) fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    v.map(|x| x / length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::plan::SMALL;

    fn with(structure: &str) -> Result<Plan, String> {
        let text = SMALL.replacen("[record]", &format!("[structure]\n{structure}\n\n[record]"), 1);
        Plan::parse(&text, "plan").map_err(|error| error.to_string())
    }

    #[test]
    fn any_direction_becomes_z_of_a_right_handed_system() {
        let usual = with("").expect("a plan");
        assert_eq!(usual.to_interface(), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        assert!(usual.slides_along_z() && usual.own_names().is_none());
        for sliding in [[0.6, 0.8, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.48, -0.6, 0.64]] {
            let plan = with(&format!("sliding = {sliding:?}")).expect("a plan");
            let rows = plan.to_interface();
            for (i, a) in rows.into_iter().enumerate() {
                for (j, b) in rows.into_iter().enumerate() {
                    assert!((dot(a, b) - f64::from(u8::from(i == j))).abs() < 1e-12, "{rows:?}");
                }
            }
            let [x, y, z] = rows;
            let determinant = x[0] * (y[1] * z[2] - y[2] * z[1])
                + x[1] * (y[2] * z[0] - y[0] * z[2])
                + x[2] * (y[0] * z[1] - y[1] * z[0]);
            assert!((determinant - 1.0).abs() < 1e-12);
            let there = turned(&rows, sliding);
            assert!(there[0].abs() < 1e-12 && there[1].abs() < 1e-12 && (there[2] - 1.0).abs() < 1e-12);
        }
        let wrong = with("sliding = [1.0, 1.0, 0.0]").expect_err("no unit vector");
        assert!(wrong.contains("structure.sliding"), "{wrong}");
    }

    #[test]
    fn configurations_go_by_the_plans_names_or_the_usual_ones() {
        let names = "a = \"frame\"\nb = \"blade\"\nassembly = \"both\"";
        let plan = with(names).expect("a plan");
        assert_eq!(plan.configuration("blade"), Some(Configuration::B));
        assert_eq!(plan.configuration("B"), Some(Configuration::B));
        assert_eq!(plan.own_names().as_deref(), Some("A is frame, B is blade, AJB is both"));
        let cells = plan.cells().len();
        let text = SMALL
            .replacen("[record]", &format!("[structure]\n{names}\n\n[record]"), 1)
            .replace("name = \"AJB\"", "name = \"both\"")
            .replace("name = \"A\"\nimpacts", "name = \"frame\"\nimpacts");
        let own = Plan::parse(&text, "plan").expect("a plan");
        assert_eq!(own.cells().len(), cells);
        assert!(own.cells().iter().zip(plan.cells()).all(|(a, b)| *a == b));
        for wrong in ["a = \"B\"", "a = \"x\"\nb = \"x\"", "a = \" \"", "b = \"up/down\""] {
            assert!(with(wrong).is_err(), "{wrong}");
        }
    }
}
