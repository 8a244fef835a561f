//! The structures that are measured: the two parts alone, and both joined.

use serde::{Deserialize, Serialize};
use std::fmt;

/// One of the three structures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Structure {
    /// Part A alone.
    A,
    /// Part B alone.
    B,
    /// The assembly of A, the joint and B.
    #[serde(rename = "AJB")]
    Ajb,
}

impl Structure {
    /// All structures, in order.
    pub const ALL: [Structure; 3] = [Structure::A, Structure::B, Structure::Ajb];

    /// The name used in files.
    pub fn name(self) -> &'static str {
        match self {
            Structure::A => "A",
            Structure::B => "B",
            Structure::Ajb => "AJB",
        }
    }

    /// The structure called `name`, if there is one.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|s| s.name() == name)
    }
}

impl fmt::Display for Structure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl From<Structure> for String {
    fn from(structure: Structure) -> String {
        structure.name().into()
    }
}

/// One value for each structure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Abc<T> {
    /// For A alone.
    pub a: T,
    /// For B alone.
    pub b: T,
    /// For the assembly.
    pub ajb: T,
}

impl<T> Abc<T> {
    /// The value that `of` returns for each structure.
    pub fn of(mut of: impl FnMut(Structure) -> T) -> Self {
        Abc { a: of(Structure::A), b: of(Structure::B), ajb: of(Structure::Ajb) }
    }

    /// The value of one structure.
    pub fn get(&self, structure: Structure) -> &T {
        match structure {
            Structure::A => &self.a,
            Structure::B => &self.b,
            Structure::Ajb => &self.ajb,
        }
    }

    /// Mutable access to the value of one structure.
    pub fn get_mut(&mut self, structure: Structure) -> &mut T {
        match structure {
            Structure::A => &mut self.a,
            Structure::B => &mut self.b,
            Structure::Ajb => &mut self.ajb,
        }
    }

    /// Applies `to` to each value.
    pub fn map<U>(self, mut to: impl FnMut(T) -> U) -> Abc<U> {
        Abc { a: to(self.a), b: to(self.b), ajb: to(self.ajb) }
    }

    /// A reference to each value.
    pub fn as_ref(&self) -> Abc<&T> {
        Abc { a: &self.a, b: &self.b, ajb: &self.ajb }
    }

    /// Each value with its structure, in order.
    pub fn each(self) -> [(Structure, T); 3] {
        [(Structure::A, self.a), (Structure::B, self.b), (Structure::Ajb, self.ajb)]
    }
}

impl<T> Abc<Option<T>> {
    /// All three values, or `None` if one is missing.
    pub fn all(self) -> Option<Abc<T>> {
        Some(Abc { a: self.a?, b: self.b?, ajb: self.ajb? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_files() {
        for structure in Structure::ALL {
            assert_eq!(Structure::from_name(structure.name()), Some(structure));
            assert_eq!(serde_json::to_value(structure).expect("a word"), structure.name());
        }
        assert_eq!(Structure::from_name("C"), None);
        let names = Abc::of(Structure::name);
        assert_eq!(names.each().map(|(s, name)| s.name() == name), [true; 3]);
        assert_eq!(Abc { a: Some(1), b: None, ajb: Some(3) }.all(), None);
    }
}
