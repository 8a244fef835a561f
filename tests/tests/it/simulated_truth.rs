//! The truth of a simulated rig is stored in the campaign file only if the runner itself simulated
//! it.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use jointrig::campaign::store::Store;
use jointrig::campaign::store::{ContactLaw, SimulatedRig};
use jointrig::device::address::Address;
use jointrig::device::transport::Transport;
use jointrig_hil_sim::board::VirtualBoard;
use jointrig_hil_sim::rig::RigConfig;
use jointrig_hil_sim::serve;
use jointrig_tests::campaign::{plan, run};

const RIG: &str = "name = \"tilted\"\n[contact]\nlaw = \"jenkins\"\nstiffness_n_per_m = [1.8e8, 2.6e8, 1.1e8]\n\
                   [clamp_b]\nrigid = false\n";

/// One cell on the specimen, two hits.
fn measure(file: &Path, transport: Box<dyn Transport>) {
    let (summary, _) = run(file, &plan(2, &[("AJB", &["AZ1"], &["S1"])]), transport);
    assert_eq!(summary.kept, 2);
}

#[test]
fn a_campaign_on_sim_keeps_the_rigs_truth() {
    let folder = tempfile::tempdir().unwrap();
    let description = folder.path().join("rig.toml");
    std::fs::write(&description, RIG).unwrap();
    let file = folder.path().join("c.jrig");
    let address: Address = format!("sim:{}", description.display()).parse().unwrap();
    measure(&file, address.open(11).unwrap());

    let store = Store::open_read_only(&file).unwrap();
    let SimulatedRig { name, seed, parameters } = store.simulated_rig().unwrap().unwrap();
    assert_eq!((name.as_str(), seed), ("tilted", 11));
    // SHA-256 in base64
    assert_eq!(parameters.unwrap().len(), 44);
    let (kept, truth) =
        (store.simulated_truth().unwrap().unwrap(), RigConfig::from_toml(RIG).unwrap().truth());
    assert_eq!(kept.contact_k_t_n_per_m, 1.1e8);
    assert_eq!(kept.contact_c_t_n_s_per_m, truth.contact_c_t_n_s_per_m);
    assert_eq!(kept.between_arms_k_n_per_m, truth.between_arms_k_n_per_m);
    assert_eq!(kept.clamps_k_n_per_m, truth.clamps_k_n_per_m);
    assert_eq!((kept.law, kept.slip_limit_n), (ContactLaw::Jenkins, Some(180.0)));
    assert!(store.meta("simulated_truth").unwrap().unwrap().starts_with('{'));
}

#[test]
fn a_device_behind_a_socket_leaves_none() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address: Address = format!("tcp:{}", listener.local_addr().unwrap()).parse().unwrap();
    // the thread ends with the test's process
    std::thread::spawn(move || {
        let (_board, mut link) = VirtualBoard::start(Some(RIG), 11).unwrap();
        serve::tcp(&mut link, &listener)
    });
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("c.jrig");
    measure(&file, address.open(11).unwrap());
    let store = Store::open_read_only(&file).unwrap();
    assert_eq!((store.simulated_rig().unwrap(), store.simulated_truth().unwrap()), (None, None));
}
