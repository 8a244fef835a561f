//! USB: device, receive and transmit in one task, built anew when the bus comes up at the other speed.

use embassy_futures::select::{select, select4};
use embassy_stm32::peripherals::{PA11, PA12, USB_OTG_HS};
use embassy_stm32::usb::{Config, Driver, InterruptHandler};
use embassy_stm32::{Peri, bind_interrupts, pac};
use embassy_time::{Duration, Timer};
use jointrig_firmware::board::NoStage;
use jointrig_firmware::usb::{self, Buffers, Speed, Usb, build};
use jointrig_firmware::{receive, transmit};

use crate::{Shared, watchdog};

/// Bytes from the host.
pub type Source = usb::Source<'static, Driver<'static, USB_OTG_HS>>;
/// Bytes to the host.
pub type Sink = usb::Sink<'static, Driver<'static, USB_OTG_HS>>;

/// Packets that wait for their readers: two bulk endpoints, the control endpoint.
const RECEIVED_BYTES: usize = 2 * 512 + 64 + 64;
/// Between two signs of life. 400 frames of high speed and 50 of full speed: no multiple of the 16 384 after which their number
/// comes round.
const BEAT: Duration = Duration::from_millis(50);
/// Between two looks at the speed.
const LOOK: Duration = Duration::from_millis(10);
/// DSTS.ENUMSPD of a high-speed bus; every other value is full speed.
const ENUMERATED_HIGH: u8 = 0;

bind_interrupts!(struct Irqs {
    OTG_HS => InterruptHandler<USB_OTG_HS>;
});

/// Runs for ever.
#[embassy_executor::task]
pub async fn task(
    core: &'static Shared,
    mut controller: Peri<'static, USB_OTG_HS>,
    mut plus: Peri<'static, PA12>,
    mut minus: Peri<'static, PA11>,
) {
    let mut speed = Speed::High;
    loop {
        let mut received = [0; RECEIVED_BYTES];
        let mut buffers = Buffers::new();
        let mut config = Config::default();
        // the board is powered by its ST-LINK or by the rig: VBUS is not what keeps it alive
        config.vbus_detection = false;
        let driver = Driver::new_hs(
            controller.reborrow(),
            Irqs,
            plus.reborrow(),
            minus.reborrow(),
            &mut received,
            config,
        );
        let Usb { mut device, mut source, mut sink } =
            build(driver, &mut buffers, embassy_stm32::uid::uid_hex(), speed);
        let mut stage = NoStage;
        select4(
            device.run(),
            transmit::transmit(core, &mut sink),
            receive::receive(core, &mut source, &mut stage),
            select(beat(), other_than(speed)),
        )
        .await;
        speed = enumerated().unwrap_or(speed);
        defmt::info!("USB again, for {}", speed);
    }
}

/// The speed of the bus, once the host has given us an address on it.
fn enumerated() -> Option<Speed> {
    let otg = pac::USB_OTG_HS;
    if otg.dcfg().read().dad() == 0 {
        return None;
    }
    let high = otg.dsts().read().enumspd().to_bits() == ENUMERATED_HIGH;
    Some(if high { Speed::High } else { Speed::Full })
}

/// Waits until the bus is of another speed than the descriptors are for.
async fn other_than(speed: Speed) {
    while enumerated().is_none_or(|found| found == speed) {
        Timer::after(LOOK).await;
    }
}

/// Beats while the bus makes progress, or has no host to make any with: on a bus that runs the number of the frame moves every
/// millisecond (USB 2.0, 5.3.3), whatever the host reads. A core that is configured and stands still is one that hangs.
async fn beat() -> ! {
    let mut before = None;
    loop {
        let otg = pac::USB_OTG_HS;
        let state = otg.dsts().read();
        let without_host = otg.dcfg().read().dad() == 0 || state.suspsts();
        let frame = state.fnsof();
        if without_host || before != Some(frame) {
            watchdog::LINK.beat();
        }
        before = Some(frame);
        Timer::after(BEAT).await;
    }
}
