//! Rigs whose bodies bend.
#![allow(clippy::unwrap_used)]

use jointrig_hil_sim::rig::structure::Structure;
use jointrig_hil_sim::rig::{Configuration, Rig, RigConfig};

const ELASTIC: &str = include_str!("../../rigs/elastic.toml");

#[test]
fn probe() {
    let rigid = RigConfig::default();
    let rig = RigConfig::from_toml(ELASTIC).unwrap();
    println!("{:?}\n{:?}", rigid.truth(), rig.truth());
    for configuration in Configuration::ALL {
        println!("{configuration} {}", Structure::new(&rig, configuration).order());
    }
    let start = std::time::Instant::now();
    let _ = Rig::new(&rigid, 1).unwrap();
    println!("rigid {:?}", start.elapsed());
    let start = std::time::Instant::now();
    let it = Rig::new(&rig, 1).unwrap();
    println!("elastic {:?} {:?}", start.elapsed(), it.fallback());
}
