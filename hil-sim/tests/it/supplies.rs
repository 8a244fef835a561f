//! Sensors with a constant-current supply: without a sensor, motion that needs it is refused. Also
//! the specimen's temperature.
#![allow(clippy::unwrap_used)]

use crate::support;

use jointrig_hil_sim::rig::RigConfig;
use jointrig_hil_sim::rig::config::Cable;
use jointrig_protocol::answer::{Answer, Hammer, Refusal};
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::request::{Control, Request, Shake};
use jointrig_protocol::slow::{Slow, Supply, SupplyFault};
use support::{SmallHost, Started};

const RATE: u32 = 51_200;
/// Indices of the two force cells in a scan.
const FORCE: u8 = 0;
const EXCITATION: u8 = 9;

fn slow(host: &mut SmallHost) -> Slow {
    match host.ask(Request::Slow) {
        Ok(Answer::Slow(slow)) => slow,
        other => panic!("no slow values but {other:?}"),
    }
}

/// Continues until the device has measured this at the supply of a channel: a virtual board runs up
/// to half a second ahead of its host.
fn until_measured(host: &mut SmallHost, channel: u8, fault: Option<SupplyFault>) {
    let own = |slow: &Slow| slow.supplies.iter().find(|supply| supply.channel == channel).map(Supply::fault);
    while own(&slow(host)) != Some(fault) {
        host.go_on(2_400);
    }
}

fn shake() -> Request {
    Request::Shake(Shake {
        step: Shake::step_of(100.0, RATE),
        control: Control::Drive,
        amplitude_v: 0.01,
        slew_v_per_s: 1.0,
        valid_ms: 60_000,
        limits: heapless::Vec::new(),
    })
}

/// Requirements for any board, native or emulated.
fn keeps_its_promises(start: impl Fn(&RigConfig) -> Started) {
    let faults = [(Cable::Open, SupplyFault::Open), (Cable::Short, SupplyFault::Short)];
    for (cable, fault) in faults {
        // faulty from the start: arming is refused, the shaker is not affected
        let mut config = RigConfig::default();
        config.surroundings.force_cable = cable;
        let (_board, controls, link) = start(&config);
        let mut host = SmallHost::new(link);
        host.start();
        host.go_on(2_400);
        let refused = Err(Refusal::Supply { channel: FORCE, fault });
        assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), refused);
        assert_eq!(host.ask(shake()), Ok(Answer::Done));
        assert_eq!(host.ask(Request::Rest), Ok(Answer::Done));
        host.until("rest", |host| host.events.contains(&Event::ShakerRests));
        // repaired, and faulty again while the hammer is armed
        controls.set_force_cable(Cable::Sensor);
        until_measured(&mut host, FORCE, None);
        assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
        controls.set_force_cable(cable);
        until_measured(&mut host, FORCE, Some(fault));
        assert_eq!(host.status().hammer, Hammer::Disarmed);
        let told = Event::Disarmed(Reason::Supply { channel: FORCE });
        host.until("the disarming", |host| host.events.contains(&told));
        assert_eq!(controls.coil_pulses_us(), [0_u32; 0]);

        // the shaker's force cell: refused, and stopped
        controls.set_force_cable(Cable::Sensor);
        controls.set_excitation_cable(cable);
        until_measured(&mut host, EXCITATION, Some(fault));
        assert_eq!(host.ask(shake()), Err(Refusal::Supply { channel: EXCITATION, fault }));
        until_measured(&mut host, FORCE, None);
        assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
        assert_eq!(host.ask(Request::Disarm), Ok(Answer::Done));
        controls.set_excitation_cable(Cable::Sensor);
        until_measured(&mut host, EXCITATION, None);
        until_measured(&mut host, FORCE, None);
        assert_eq!(host.ask(shake()), Ok(Answer::Done));
        controls.set_excitation_cable(cable);
        let told = Event::ShakerStops(Reason::Supply { channel: EXCITATION });
        host.until("the shaker's stop", |host| host.events.contains(&told));
    }

    // a specimen that warms by 1 K/s
    let mut config = RigConfig::default();
    config.surroundings.temperature_c = 25.0;
    config.surroundings.warming_k_per_s = 1.0;
    let (_board, _, link) = start(&config);
    let mut host = SmallHost::new(link);
    assert!(slow(&mut host).temperature_c.is_some(), "it is known before there is a stream");
    host.start();
    host.go_on(2_400);
    let begun = slow(&mut host);
    assert!(begun.supplies.iter().all(|supply| supply.fault().is_none()) && begun.supplies.len() == 2);
    let celsius = f64::from(begun.temperature_c.unwrap());
    host.go_on(2 * u64::from(RATE));
    let warmer = f64::from(slow(&mut host).temperature_c.unwrap());
    // measured ten times a second, with up to half a second of scans in transit
    assert!(
        (25.0..26.0).contains(&celsius) && (warmer - celsius - 2.0).abs() < 0.7,
        "{celsius}, then {warmer}"
    );
}

#[test]
fn the_native_board_asks_its_supplies() {
    keeps_its_promises(support::native);
}

#[cfg(unix)]
#[test]
fn so_does_the_binary() {
    if let Some(image) = support::image() {
        keeps_its_promises(|config| support::emulated(&image, config));
    }
}
