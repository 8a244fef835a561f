//! The device: the firmware's four functions as tasks with this board's parts.

use heapless::{String, Vec};
use jointrig_firmware::board::{self, Board};
use jointrig_firmware::lockstep::Setup;
use jointrig_firmware::ring::Slot;
use jointrig_firmware::{Core, Facts};
use jointrig_protocol::answer::{Info, Reset};
use jointrig_protocol::channel::{Channel, Name};
use jointrig_protocol::limits::{COIL_PULSE_CAP_US, MAX_CHANNELS, scans_per_block};
use static_cell::{ConstStaticCell, StaticCell};

use crate::executor;
use crate::parts::{Coil, Drive, Emulated, Inputs, Scans, Sink, Source, Stage};

/// Blocks in the ring: a second of sixteen channels at 51.2 kHz.
const SLOTS: usize = 3_414;

/// State shared by the tasks.
pub type Shared = Core<'static, <Emulated as Board>::Mutex>;

/// Runs the firmware forever.
///
/// # Panics
/// A set-up without channels, or a second call.
pub fn run(setup: &Setup) -> ! {
    static MEMORY: ConstStaticCell<[Slot; SLOTS]> = ConstStaticCell::new([Slot::EMPTY; SLOTS]);
    static CHANNELS: StaticCell<Vec<Channel, MAX_CHANNELS>> = StaticCell::new();
    static CORE: StaticCell<Shared> = StaticCell::new();

    let channels: &'static [Channel] = CHANNELS.init(setup.channels.clone());
    let per_block = scans_per_block(channels.len()).expect("a set-up names 1 to 16 channels");
    let facts = Facts {
        board: Name::try_from(Info::EMULATED_BOARD).unwrap_or_default(),
        serial: setup.serial.clone(),
        target: String::try_from(env!("JOINTRIG_TARGET")).unwrap_or_default(),
        build: jointrig_board_log::build_id(),
        scan_rate_hz: setup.scan_rate_hz,
        channels,
        coil_cap_us: COIL_PULSE_CAP_US,
        stage: true,
        sync: true,
        drive_v: board::Drive::full_scale_v(&Drive),
        reset: Reset::Power,
        boot: setup.boot,
    };
    let slots = (setup.slots as usize).clamp(1, SLOTS);
    let core: &'static Shared =
        CORE.init(Core::new(facts, &mut MEMORY.take()[..slots]).with_logs(&jointrig_board_log::TAP));
    let scans = Scans::new(core, per_block, channels.len(), setup.scan_rate_hz);
    executor::run(|spawner| {
        const ONCE: &str = "each task is made once";
        spawner.spawn(acquire(core, scans).expect(ONCE));
        spawner.spawn(receive(core).expect(ONCE));
        spawner.spawn(transmit(core).expect(ONCE));
        spawner.spawn(watch(core).expect(ONCE));
    })
}

#[embassy_executor::task]
async fn acquire(core: &'static Shared, mut scans: Scans) {
    jointrig_firmware::acquire::acquire(core, &mut scans, &mut Coil, &mut Drive, &mut Inputs::default())
        .await;
}

#[embassy_executor::task]
async fn receive(core: &'static Shared) {
    jointrig_firmware::receive::receive(core, &mut Source::default(), &mut Stage).await;
}

#[embassy_executor::task]
async fn transmit(core: &'static Shared) {
    jointrig_firmware::transmit::transmit(core, &mut Sink).await;
}

#[embassy_executor::task]
async fn watch(core: &'static Shared) {
    jointrig_firmware::watch::watch(core).await;
}
