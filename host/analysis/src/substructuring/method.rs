//! The decoupling methods by name.

use serde::{Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// A decoupling method that works on FRF matrices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Method {
    /// Eq. (3), exact least-squares form.
    Internal,
    /// Eq. (3) as printed.
    InternalPrinted,
    /// Eq. (A.3), sign corrected.
    Interface,
    /// Eq. (A.2), block of A.
    PrimalA,
    /// Eq. (A.2), block of B.
    PrimalB,
    /// Eq. (A.1), block c(A), c(B).
    Inverse,
    /// Eq. (A.1), block c(B), c(A).
    InverseBa,
    /// Tol and Özgüven's rearrangement of Eq. (1) for hits and responses on A.
    InternalAa,
    /// The same for hits on B and responses on A.
    InternalAb,
    /// The same for hits and responses on B.
    InternalBb,
}

impl Method {
    /// The paper's methods, in the order of the results.
    pub const PAPER: [Method; 7] = [
        Method::Internal,
        Method::InternalPrinted,
        Method::Interface,
        Method::PrimalA,
        Method::PrimalB,
        Method::Inverse,
        Method::InverseBa,
    ];

    /// All of them, in the order of the results.
    pub const ALL: [Method; 10] = [
        Method::Internal,
        Method::InternalPrinted,
        Method::Interface,
        Method::PrimalA,
        Method::PrimalB,
        Method::Inverse,
        Method::InverseBa,
        Method::InternalAa,
        Method::InternalAb,
        Method::InternalBb,
    ];

    /// The name in command lines and results.
    pub fn name(self) -> &'static str {
        match self {
            Method::Internal => "internal",
            Method::InternalPrinted => "internal-printed",
            Method::Interface => "interface",
            Method::PrimalA => "primal-a",
            Method::PrimalB => "primal-b",
            Method::Inverse => "inverse",
            Method::InverseBa => "inverse-ba",
            Method::InternalAa => "internal-aa",
            Method::InternalAb => "internal-ab",
            Method::InternalBb => "internal-bb",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Method {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl FromStr for Method {
    type Err = String;
    fn from_str(name: &str) -> Result<Self, String> {
        Method::ALL.into_iter().find(|m| m.name() == name).ok_or_else(|| {
            format!("there is no method `{name}`: choose among {}", Method::ALL.map(Method::name).join(", "))
        })
    }
}
