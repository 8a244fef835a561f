//! USB: device, receive and transmit in one task, built anew when the bus comes up at the other
//! speed.

use embassy_futures::select::{select, select3, select4};
use embassy_stm32::peripherals::{PA11, PA12, USB_OTG_HS};
use embassy_stm32::usb::{Config, Driver, InterruptHandler};
use embassy_stm32::{Peri, bind_interrupts, pac};
use embassy_time::{Duration, Timer};
use embassy_usb_driver::{Direction, EndpointAddress};
use jointrig_firmware::board::NoStage;
use jointrig_firmware::usb::mended::{Mended, Registers};
use jointrig_firmware::usb::{self, Buffers, Speed, Usb, build};
use jointrig_firmware::{receive, transmit};

use crate::{Shared, slow, watchdog};

/// Bytes from the host.
pub type Source = usb::Source<'static, Mended<Driver<'static, USB_OTG_HS>, Otg>>;
/// Bytes to the host.
pub type Sink = usb::Sink<'static, Mended<Driver<'static, USB_OTG_HS>, Otg>>;

/// Packets that wait for their readers: two bulk endpoints, the control endpoint.
const RECEIVED_BYTES: usize = 2 * 512 + 64 + 64;
/// Between two signs of life. 400 frames of high speed and 50 of full speed: no multiple of the 16
/// 384 after which their number comes round.
const BEAT: Duration = Duration::from_millis(50);
/// Between two looks at the speed.
const LOOK: Duration = Duration::from_millis(10);
/// DSTS.ENUMSPD of a high-speed bus; every other value is full speed.
const ENUMERATED_HIGH: u8 = 0;

bind_interrupts!(struct Irqs {
    OTG_HS => InterruptHandler<USB_OTG_HS>;
});

/// The core's registers (RM0456, "OTG_HS device registers"; the bits are also those of the driver's
/// own register table).
pub struct Otg;

impl Registers for Otg {
    fn forget_suspend(&mut self) {
        let otg = pac::USB_OTG_HS;
        if !otg.dsts().read().suspsts() {
            // bits are cleared by writing them; this writes no other
            otg.gintsts().write(|w| w.set_usbsusp(true));
        }
    }

    fn begin_with_data0(&mut self, endpoint: EndpointAddress) {
        let otg = pac::USB_OTG_HS;
        critical_section::with(|_| match endpoint.direction() {
            Direction::Out => otg.doepctl(endpoint.index()).modify(|w| w.set_sd0pid_sevnfrm(true)),
            Direction::In => otg.diepctl(endpoint.index()).modify(|w| w.set_sd0pid_sevnfrm(true)),
        });
    }
}

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
        // see `vbus`
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
            build(Mended::new(driver, Otg), &mut buffers, embassy_stm32::uid::uid_hex(), speed);
        let mut stage = NoStage;
        select4(
            device.run(),
            transmit::transmit(core, &mut sink),
            receive::receive(core, &mut source, &mut stage),
            select3(beat(), other_than(speed), vbus(false)),
        )
        .await;
        speed = enumerated().unwrap_or(speed);
        // whatever was on its way is lost, and nobody can take back what was ordered
        core.link_is_cut();
        if !slow::has_vbus() {
            // a device without power from the bus holds none of its lines up (USB 2.0, 7.1.5 and
            // 7.2.1)
            pac::USB_OTG_HS.dctl().modify(|w| w.set_sdis(true));
            select(beat(), vbus(true)).await;
        }
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

/// Waits until the bus has power, or has none. The driver's own detection wants VBUS at PA9, which
/// on the Nucleo is the ST-LINK's serial port; the board brings it to PC2 instead (docs/WIRING.md).
async fn vbus(there: bool) {
    while slow::has_vbus() != there {
        Timer::after(LOOK).await;
    }
}

/// Waits until the bus is of another speed than the descriptors are for.
async fn other_than(speed: Speed) {
    while enumerated().is_none_or(|found| found == speed) {
        Timer::after(LOOK).await;
    }
}

/// Beats while the bus makes progress, or has no host to make any with: on a bus that runs the
/// number of the frame moves every millisecond (USB 2.0, 5.3.3), whatever the host reads. A core
/// that is configured and stands still is one that hangs.
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
