//! Whether the hits of a campaign make the contact slip, which only the simulator knows: the hits
//! are repeated on the rig alone.

use crate::drawn_campaigns::DrawnCampaign;
use jointrig_hil_sim::rig::{Configuration, Rig};

/// The hammer's coil pulse of `contact.toml` (s), which its runner then corrects.
const PULSE_S: f64 = 3.5e-3;

/// Length of the simulation (s): the contact is at rest again long before.
const LENGTH_S: f64 = 0.15;

/// Effect of one hit along z on the assembly's contact.
#[derive(Clone, Copy, Debug)]
pub struct Slid {
    /// Largest fraction of the contact's elements that slip simultaneously: 1 is gross slip.
    pub part: f64,
    /// Contribution of slip to the largest relative displacement: the distance slid over the
    /// largest elastic displacement μN/k_T.
    pub path: f64,
}

/// One hit at each impact point along z of `contact.toml`.
pub fn slid(campaign: &DrawnCampaign) -> Vec<Slid> {
    let config = campaign.rig();
    let k = config.contact.stiffness_n_per_m[2];
    let mut rig = Rig::new(&config, campaign.seed).unwrap();
    let mut codes = vec![0; rig.channels().len()];
    let mut hit = |impact: &str| {
        rig.stage(Configuration::Ajb, impact, "B1", 0).unwrap();
        rig.fire(PULSE_S);
        let scans = (LENGTH_S * f64::from(rig.scan_rate_hz())) as usize;
        let (mut part, mut path) = (0.0_f64, 0.0);
        for _ in 0..scans {
            rig.scan(&mut codes);
            let joint = rig.joint().unwrap();
            part = part.max(joint.sliding);
            path = joint.slid_m * k / joint.limit_n;
        }
        Slid { part, path }
    };
    ["AZ1", "AZ2", "AZ3"].map(&mut hit).to_vec()
}
