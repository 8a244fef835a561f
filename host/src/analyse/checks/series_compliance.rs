//! Checks for a compliance in series between the arms' points and the contact, by comparing FBS
//! with loops.

use crate::hysteresis::OverCycles;
use crate::identified::SCATTER_OF_LINES;
use crate::results::{MAIN_BAND, headline_rank};
use crate::substructuring::averaged::Averaged;
use crate::substructuring::direct::Direct;
use crate::substructuring::joint_over_bands::NORMAL_95;
use crate::substructuring::{BandStatistic, Dof, JointRow};

/// If loops are stiffer than FBS by more than this factor, there is a compliance between arm and
/// specimen.
const SERIES_RATIO: f64 = 1.5;

/// The relative scatter of T/Δx over lines must be below this for the comparison.
const CLEAR: f64 = 0.3;

/// The FBS stiffness between the arms over the main band: the recommended estimate if it identified
/// one, otherwise the headline's row.
pub fn between_the_arms<'a>(
    recommended: &[Averaged],
    rows: impl Iterator<Item = &'a JointRow>,
) -> Option<BandStatistic> {
    let quoted = recommended.iter().find(|r| r.band_hz == MAIN_BAND);
    let z = quoted.and_then(|r| r.joint.get(&Dof::Z)).filter(|z| z.identified);
    z.map(|z| BandStatistic { mean: z.stiffness, std: z.std, median: z.stiffness, ci95: Some(z.ci95) })
        .or_else(|| {
            let along_z = |row: &'a JointRow| {
                let z = row.stiffness_n_per_m.get(&Dof::Z)?;
                (z.mean.is_finite() && z.std.is_finite()).then_some((row, *z))
            };
            rows.filter(|row| row.band_hz == MAIN_BAND)
                .filter_map(along_z)
                .max_by_key(|(row, _)| headline_rank(&row.method, row.idms))
                .map(|(_, z)| z)
        })
}

/// The stiffness from the vibrometers on the specimens: T/Δx in the frequency domain if its scatter
/// is low enough, otherwise the impacts' loops.
pub fn at_the_specimens(direct: Option<&Direct>, loops: Option<OverCycles>) -> Option<OverCycles> {
    direct
        .map(|direct| (direct.stiffness_n_per_m, direct.lines))
        .filter(|(k, _)| k.std < CLEAR * k.mean)
        .map(|(k, lines)| OverCycles { mean: k.mean, std: k.std, cycles: lines, ci95: None })
        .or(loops)
}

/// The stiffness from both, N/m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sizes {
    /// FBS between the arms.
    pub fbs_n_per_m: f64,
    /// Loops at the specimens.
    pub loops_n_per_m: f64,
}

impl Sizes {
    /// Ratio of the stiffness at the specimens to that between the arms.
    pub fn ratio(&self) -> f64 {
        self.loops_n_per_m / self.fbs_n_per_m
    }
}

/// Result of comparing FBS between the arms with the loops at the specimens.
///
/// A flexible clamp lies between the arms' points and the contact, but not between the vibrometers'
/// points and the contact; then 1/k_FBS = 1/k_T + 1/k_clamp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SeriesCompliance {
    /// Only one of them is available.
    NotBoth,
    /// FBS did not identify a stiffness.
    NotIdentified,
    /// The loops are stiffer: there is this compliance between arms and contact.
    ClampGivesWay {
        /// Both stiffnesses.
        sizes: Sizes,
        /// The series compliance, m/N.
        compliance_m_per_n: f64,
        /// Its standard deviation, m/N.
        std_m_per_n: f64,
    },
    /// The loops are softer, which no series compliance explains.
    Softer(Sizes),
    /// Both agree.
    SameSize(Sizes),
}

impl SeriesCompliance {
    /// Compares them.
    pub fn of(fbs: Option<&BandStatistic>, loops: Option<OverCycles>) -> Self {
        let (Some(fbs), Some(loops)) = (fbs, loops) else { return Self::NotBoth };
        let (k_fbs, k_loops) = (fbs.mean, loops.mean);
        if k_fbs <= 0.0 || k_loops <= 0.0 || fbs.std > SCATTER_OF_LINES * k_fbs {
            return Self::NotIdentified;
        }
        let sizes = Sizes { fbs_n_per_m: k_fbs, loops_n_per_m: k_loops };
        if sizes.ratio() > SERIES_RATIO {
            // independent measurements, so the variances of the compliances add
            let std_m_per_n = (fbs.std / (k_fbs * k_fbs)).hypot(loops.std / (k_loops * k_loops));
            return Self::ClampGivesWay {
                sizes,
                compliance_m_per_n: 1.0 / k_fbs - 1.0 / k_loops,
                std_m_per_n,
            };
        }
        if sizes.ratio() < 1.0 / SERIES_RATIO {
            return Self::Softer(sizes);
        }
        Self::SameSize(sizes)
    }

    /// Passed, failed, or `None` if undecided.
    pub fn ok(&self) -> Option<bool> {
        match self {
            Self::ClampGivesWay { .. } => Some(false),
            Self::SameSize(_) => Some(true),
            Self::NotBoth | Self::NotIdentified | Self::Softer(_) => None,
        }
    }

    /// Stiffness between arms and contact, with the ends of its 95 % interval, N/m; an upper end
    /// that does not exist is infinite.
    pub fn between_n_per_m(&self) -> Option<[f64; 3]> {
        let Self::ClampGivesWay { compliance_m_per_n, std_m_per_n, .. } = self else { return None };
        let (c, std) = (compliance_m_per_n, std_m_per_n);
        let [low, high] = [c + NORMAL_95 * std, c - NORMAL_95 * std].map(|c| 1.0 / c);
        Some([1.0 / c, low, if high > 0.0 { high } else { f64::INFINITY }])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fbs(mean: f64, std: f64) -> BandStatistic {
        BandStatistic { mean, std, median: mean, ci95: None }
    }

    fn loops(mean: f64) -> OverCycles {
        OverCycles { mean, std: 4e6, cycles: 70, ci95: None }
    }

    #[test]
    fn a_soft_clamp_is_found_with_its_stiffness() {
        // the default rig: contact 180, clamp 31.2 N/µm
        let k = 1.0 / (1.0 / 180e6 + 1.0 / 31.2e6);
        let check = SeriesCompliance::of(Some(&fbs(k, 1e6)), Some(loops(180e6)));
        assert_eq!(check.ok(), Some(false));
        let [series, low, high] = check.between_n_per_m().expect("the clamp gives way");
        assert!((series / 31.2e6 - 1.0).abs() < 1e-9);
        // σ of the two compliances: 1e6/26.59e6² and 4e6/180e6², in quadrature 1.42e-9 m/N of
        // 32.05e-9
        assert!((low / 28.7e6 - 1.0).abs() < 0.01 && (high / 34.2e6 - 1.0).abs() < 0.01, "{low:e} {high:e}");
    }

    #[test]
    fn a_stiff_clamp_passes_and_noise_decides_nothing() {
        let ok = |fbs: Option<&BandStatistic>, loops| SeriesCompliance::of(fbs, loops).ok();
        assert_eq!(ok(Some(&fbs(179e6, 9e6)), Some(loops(181e6))), Some(true));
        assert_eq!(ok(Some(&fbs(26e6, 45e6)), Some(loops(181e6))), None);
        assert_eq!(ok(Some(&fbs(280e6, 4e6)), Some(loops(150e6))), None);
        assert_eq!(ok(None, Some(loops(181e6))), None);
        assert_eq!(ok(Some(&fbs(26e6, 1e6)), None), None);
    }
}
