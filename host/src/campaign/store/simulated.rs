//! Data about the simulated rig, if the device was simulated in the process that ran the campaign.
//!
//! Two notes of the file: the rig, and the result that an ideal measurement of it would give. The
//! runner writes them from the rig's parameters; nothing of them crosses the protocol, and no
//! estimator may read them.

use serde::{Deserialize, Serialize};

use super::Store;
use super::error::StoreError;
use crate::device::transport::Simulated;
use jointrig_protocol::answer::Info;

/// Keys of the notes.
const RIG: &str = "simulated_rig";
const TRUTH: &str = "simulated_truth";

/// Identifies a simulated rig.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SimulatedRig {
    /// The rig's name.
    pub name: String,
    /// Its seed.
    pub seed: u64,
    /// SHA-256 of all its parameters, in base64; `None` in files from before this was stored.
    #[serde(default)]
    pub parameters: Option<String>,
}

/// Force law of the contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ContactLaw {
    /// Stuck, whatever the force.
    Linear,
    /// One slider: stuck, then gross slip.
    Jenkins,
    /// Many sliders in parallel: microslip, then gross slip.
    Iwan,
}

/// The result that an ideal measurement of the simulated rig would give. Stiffness along z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulatedTruth {
    /// The contact's own tangential stiffness k_T in full stick, N/m.
    pub contact_k_t_n_per_m: f64,
    /// The contact's own tangential damping c_T, N s/m.
    pub contact_c_t_n_s_per_m: f64,
    /// Stiffness between the arms as substructuring finds it at the virtual points: contact and
    /// clamps in series, N/m.
    pub between_arms_k_n_per_m: f64,
    /// Stiffness of the clamps alone, defined the same way, N/m; `None` if they are rigid.
    pub clamps_k_n_per_m: Option<f64>,
    /// The contact's force law.
    pub law: ContactLaw,
    /// μN, above which the contact is in gross slip, N; `None` for the linear law. An Iwan contact
    /// slips partially below it.
    pub slip_limit_n: Option<f64>,
}

/// Whether a board of this name measures a simulated rig.
pub fn is_simulated_board(name: &str) -> bool {
    [Info::VIRTUAL_BOARD, Info::EMULATED_BOARD].contains(&name)
}

impl Store {
    /// Stores which simulated rig the campaign is run on, and its truth; the last session's values
    /// count.
    pub(crate) fn note_simulated(&self, simulated: &Simulated) -> Result<(), StoreError> {
        let rig = SimulatedRig {
            name: simulated.rig.clone(),
            seed: simulated.seed,
            parameters: Some(simulated.parameters.clone()),
        };
        let rig = serde_json::to_string(&rig).map_err(|error| self.content(error.to_string()))?;
        self.set_meta(RIG, &rig)?;
        self.set_meta(TRUTH, &simulated.truth.to_string())
    }

    /// The simulated rig that the campaign was run on; `None` if the device was not simulated in
    /// the runner's own process.
    ///
    /// # Errors
    /// The note cannot be read.
    pub fn simulated_rig(&self) -> Result<Option<SimulatedRig>, StoreError> {
        self.json(RIG)
    }

    /// Whether any session's device was simulated, in the runner's own process or over a
    /// connection.
    ///
    /// # Errors
    /// The notes or sessions cannot be read.
    pub fn is_simulated(&self) -> Result<bool, StoreError> {
        let behind_a_wire = self.sessions()?.iter().any(|(_, info)| is_simulated_board(&info.board));
        Ok(behind_a_wire || self.simulated_rig()?.is_some())
    }

    /// The result that an ideal measurement of the simulated rig would give; `None` if the device
    /// was not simulated in the runner's own process, and in files from before this was stored.
    ///
    /// # Errors
    /// The note cannot be read.
    pub fn simulated_truth(&self) -> Result<Option<SimulatedTruth>, StoreError> {
        self.json(TRUTH)
    }

    fn json<T: serde::de::DeserializeOwned>(&self, key: &str) -> Result<Option<T>, StoreError> {
        let read = |text: String| {
            serde_json::from_str(&text).map_err(|error| self.content(format!("the note {key}: {error}")))
        };
        self.meta(key)?.map(read).transpose()
    }
}
