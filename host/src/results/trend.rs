//! trend.json: how a quantity of several campaigns depends on a covariate, and how much it varies
//! between reassemblies. Standard deviations and changes are relative (of the logarithm).

use crate::contact::Interval;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// A quantity of each campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum StudiedQuantity {
    /// The contact's stiffness k_T, N/m.
    #[value(name = "k-t")]
    KT,
    /// The contact's damping c_T, N s/m.
    #[value(name = "c-t")]
    CT,
    /// The stiffness between the arms, N/m.
    #[value(name = "between-arms")]
    BetweenArms,
    /// The coefficient of friction, of the shaker's level with the largest amplitude that slips.
    #[value(name = "friction-coefficient")]
    FrictionCoefficient,
    /// The first mode of the assembly, Hz.
    #[value(name = "first-mode")]
    FirstMode,
}

impl StudiedQuantity {
    /// Its name with its unit, as in trend.json and as a column of tables.
    pub fn field(self) -> &'static str {
        match self {
            Self::KT => "k_t_n_per_m",
            Self::CT => "c_t_n_s_per_m",
            Self::BetweenArms => "between_arms_n_per_m",
            Self::FrictionCoefficient => "friction_coefficient",
            Self::FirstMode => "first_mode_hz",
        }
    }
}

impl Serialize for StudiedQuantity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.field())
    }
}

/// What was fitted to the quantity over the covariate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FittedForm {
    /// A line.
    Line,
    /// A line of the quantity's logarithm over that of the covariate.
    PowerLaw,
    /// A natural cubic spline.
    Curve,
}

/// The trend of a quantity over several campaigns.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrendOverCampaigns {
    /// The quantity.
    pub quantity: StudiedQuantity,
    /// The covariate.
    pub against: Option<String>,
    /// What was fitted; null without a covariate.
    pub dependence: Option<FittedForm>,
    /// The level at the covariate's mean (for a power law, its geometric mean).
    pub level: Interval,
    /// The covariate's mean.
    pub at: Option<f64>,
    /// Relative change per unit of the covariate; for a power law, the exponent; null for a curve.
    pub slope: Option<Interval>,
    /// Relative change from the covariate's smallest value to its largest.
    pub change: Option<Interval>,
    /// Whether the quantity depends on the covariate; null if it has none, or too few values.
    pub depends: Option<bool>,
    /// Whether a curve bends, or else could be a line; null unless a curve was fitted.
    pub bends: Option<bool>,
    /// Relative standard deviation between reassemblies.
    pub between: Option<Interval>,
    /// Relative standard deviation within a reassembly.
    pub within: Option<Interval>,
    /// Relative standard deviation of the error that all campaigns share.
    pub shared_std: f64,
    /// Reassemblies of as many campaigns as here, for a mean within ± `wanted_percent`; null if
    /// what all share prevents it.
    pub reassemblies_needed: Option<usize>,
    /// How far the mean may be off, %.
    pub wanted_percent: f64,
    /// The campaigns.
    pub campaigns: Vec<CampaignOfStudy>,
    /// The fitted line or curve, from the covariate's smallest value to its largest, evenly (for a
    /// power law, evenly in its logarithm); empty without a covariate.
    pub fitted: Vec<FittedPoint>,
    /// Files that are left out, each with the reason.
    pub left_out: BTreeMap<String, String>,
}

/// One campaign of the study.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CampaignOfStudy {
    /// What it found.
    #[serde(flatten)]
    pub found: FoundByCampaign,
    /// What the trend gives at its covariate.
    pub trend: Interval,
}

/// The quantity as one campaign found it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FoundByCampaign {
    /// Name of the campaign file.
    pub file: String,
    /// When it was started; results.json of the campaign states it.
    #[serde(skip)]
    pub started: Option<jiff::Timestamp>,
    /// The quantity with its interval.
    pub value: Interval,
    /// The covariate.
    pub covariate: Option<f64>,
    /// The reassembly.
    pub reassembly: Option<String>,
    /// Relative standard deviation of its own error.
    pub own_std: f64,
    /// Relative standard deviation of the error that it shares with the others.
    pub shared_std: f64,
    /// Whether the rig was simulated.
    pub simulated: bool,
}

/// One point of the fitted line or curve.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FittedPoint {
    /// The covariate.
    pub covariate: f64,
    /// The quantity.
    pub value: Interval,
}
