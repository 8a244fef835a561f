//! USB: device, receive and transmit in one task, rebuilt when the bus comes up at the other speed.

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

/// Buffer for received packets: two bulk endpoints, the control endpoint.
const RECEIVED_BYTES: usize = 2 * 512 + 64 + 64;
/// Interval between two signs of life. It is 400 frames at high speed and 50 at full speed: not a
/// multiple of the 16 384 after which the frame number wraps.
const BEAT: Duration = Duration::from_millis(50);
/// Interval between two checks of the speed.
const LOOK: Duration = Duration::from_millis(10);
/// DSTS.ENUMSPD of a high-speed bus; every other value is full speed.
const ENUMERATED_HIGH: u8 = 0;

bind_interrupts!(struct Irqs {
    OTG_HS => InterruptHandler<USB_OTG_HS>;
});

/// The core's registers (RM0456, "OTG_HS device registers"; the bits also match the driver's own
/// register table).
pub struct Otg;

impl Registers for Otg {
    fn forget_suspend(&mut self) {
        let otg = pac::USB_OTG_HS;
        if !otg.dsts().read().suspsts() {
            // bits are cleared by writing 1; this clears no other
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

/// Runs forever.
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
        // data in transit are lost, and requests can no longer be cancelled
        core.link_is_cut();
        if !slow::has_vbus() {
            // a device without bus power must not pull up any of its lines (USB 2.0, 7.1.5 and
            // 7.2.1)
            pac::USB_OTG_HS.dctl().modify(|w| w.set_sdis(true));
            select(beat(), vbus(true)).await;
        }
        defmt::info!("USB again, for {}", speed);
    }
}

/// The speed of the bus, once the host has assigned an address.
fn enumerated() -> Option<Speed> {
    let otg = pac::USB_OTG_HS;
    if otg.dcfg().read().dad() == 0 {
        return None;
    }
    let high = otg.dsts().read().enumspd().to_bits() == ENUMERATED_HIGH;
    Some(if high { Speed::High } else { Speed::Full })
}

/// Waits until the bus has power, or has none. The driver's own detection requires VBUS at PA9,
/// which on the Nucleo is the ST-LINK's serial port; the board connects VBUS to PC2 instead
/// (docs/WIRING.md).
async fn vbus(there: bool) {
    while slow::has_vbus() != there {
        Timer::after(LOOK).await;
    }
}

/// Waits until the bus speed differs from that of the descriptors.
async fn other_than(speed: Speed) {
    while enumerated().is_none_or(|found| found == speed) {
        Timer::after(LOOK).await;
    }
}

/// Signals life while the bus makes progress, or while there is no host: on an active bus, the
/// frame number changes every millisecond (USB 2.0, 5.3.3), whether or not the host reads. A core
/// that is configured and whose frame number does not change has hung.
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
