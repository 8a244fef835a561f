//! The two converters: their pins, and their set-up before the rings take over.

use core::convert::Infallible;
use core::mem::forget;

use embassy_futures::yield_now;
use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, Input, Level, Output, OutputType, Pin, Pull, Speed};
use embassy_stm32::mode::Blocking;
use embassy_stm32::peripherals::{
    GPDMA1_CH0, GPDMA1_CH1, PA5, PA6, PA7, PD0, PD1, PD3, PD4, PD9, PE4, PE5, PE6, PE12, SPI1, SPI2,
};
use embassy_stm32::spi::mode::Master;
use embassy_stm32::spi::{self, Config, Instance, MODE_2, MisoPin, MosiPin, RxDma, SckPin, Spi};
use embassy_stm32::time::Hertz;
use embassy_time::{Duration, Timer, block_for};
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::ErrorType as PinErrorType;
use embedded_hal::spi::{ErrorType as SpiErrorType, Operation, SpiBus, SpiDevice};
use jointrig_firmware::ad7606b::part::{AD7606B, Lines, Oversampling};
use jointrig_firmware::ad7606b::{CHANNELS, Converter, Error, Range, Settings};

/// Settings of both converters. Eight conversions are averaged: this takes 10 µs, which together
/// with the read-out of 3.6 µs leaves 5 µs of the 19.5 µs between two scans. All ranges are the
/// same, so that all channels have the same phase: docs/WIRING.md.
pub const SETTINGS: Settings = Settings {
    ranges: [Range::Volts10; CHANNELS],
    oversampling: Oversampling::X8,
    lines: Lines::One,
    crc: true,
    wide_band: false,
};
/// Clock for register accesses: slow, because they are not time-critical.
const REGISTER_HZ: Hertz = Hertz(2_500_000);
/// Alternate function of the serial port's select pin: 5 on PE12 (SPI1_NSS) and PD0 (SPI2_NSS).
const SELECT_FUNCTION: u8 = 5;
/// Consecutive conversions with small codes before an input counts as open: 5 ms.
const OPEN_AFTER: u8 = 255;

/// Why a converter could not be set up.
pub type Fault = Error<spi::Error, Infallible>;

/// One converter's pins, port and DMA channel.
pub struct Chip<Port, Clock, Sdi, Dout, Select, Reset, Busy, Dma>
where
    Port: Instance,
    Clock: SckPin<Port>,
    Sdi: MosiPin<Port>,
    Dout: MisoPin<Port>,
    Select: Pin,
    Reset: Pin,
    Busy: Pin,
    Dma: RxDma<Port>,
{
    /// The serial port.
    pub port: Peri<'static, Port>,
    /// SCLK.
    pub clock: Peri<'static, Clock>,
    /// SDI.
    pub sdi: Peri<'static, Sdi>,
    /// DOUTA.
    pub dout: Peri<'static, Dout>,
    /// CS.
    pub select: Peri<'static, Select>,
    /// RESET.
    pub reset: Peri<'static, Reset>,
    /// BUSY.
    pub busy: Peri<'static, Busy>,
    /// DMA channel that transfers the data to the ring.
    pub dma: Peri<'static, Dma>,
}

/// Channels 1 to 8.
pub type First = Chip<SPI1, PA5, PA7, PA6, PE12, PE5, PE4, GPDMA1_CH0>;
/// Channels 9 to 16.
pub type Second = Chip<SPI2, PD1, PD4, PD3, PD0, PE6, PD9, GPDMA1_CH1>;

/// Both.
pub struct Chips {
    /// Channels 1 to 8.
    pub first: First,
    /// Channels 9 to 16.
    pub second: Second,
}

/// Delays of whole µs. embassy's implementation uses a 64-bit division of ns, which takes a
/// kilobyte.
struct Pause;

impl DelayNs for Pause {
    fn delay_ns(&mut self, ns: u32) {
        block_for(Duration::from_micros(ns.div_ceil(1000).into()));
    }
}

impl embedded_hal_async::delay::DelayNs for Pause {
    async fn delay_ns(&mut self, ns: u32) {
        Timer::after_micros(ns.div_ceil(1000).into()).await;
    }
}

/// A port that frames each access with a select pin.
struct Framed<'a> {
    bus: Spi<'a, Blocking, Master>,
    select: Output<'a>,
}

impl SpiErrorType for Framed<'_> {
    type Error = spi::Error;
}

impl SpiDevice for Framed<'_> {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), spi::Error> {
        self.select.set_low();
        let done = operations.iter_mut().try_for_each(|operation| match operation {
            Operation::Read(bytes) => SpiBus::read(&mut self.bus, bytes),
            Operation::Write(bytes) => SpiBus::write(&mut self.bus, bytes),
            Operation::Transfer(into, from) => SpiBus::transfer(&mut self.bus, into, from),
            Operation::TransferInPlace(bytes) => SpiBus::transfer_in_place(&mut self.bus, bytes),
            Operation::DelayNs(ns) => {
                DelayNs::delay_ns(&mut Pause, *ns);
                Ok(())
            }
        });
        self.select.set_high();
        done
    }
}

/// A pin that is polled: only for the few conversions of the self-test.
struct Asked<'a>(Input<'a>);

impl PinErrorType for Asked<'_> {
    type Error = Infallible;
}

impl Asked<'_> {
    async fn until(&self, high: bool) -> Result<(), Infallible> {
        while self.0.is_high() != high {
            yield_now().await;
        }
        Ok(())
    }
}

impl embedded_hal_async::digital::Wait for Asked<'_> {
    async fn wait_for_high(&mut self) -> Result<(), Infallible> {
        self.until(true).await
    }

    async fn wait_for_low(&mut self) -> Result<(), Infallible> {
        self.until(false).await
    }

    async fn wait_for_rising_edge(&mut self) -> Result<(), Infallible> {
        self.until(false).await?;
        self.until(true).await
    }

    async fn wait_for_falling_edge(&mut self) -> Result<(), Infallible> {
        self.until(true).await?;
        self.until(false).await
    }

    async fn wait_for_any_edge(&mut self) -> Result<(), Infallible> {
        let now = self.0.is_high();
        self.until(!now).await
    }
}

/// As [`Chip::set_up`], but not generic, so that the code exists only once for both chips.
async fn set_up(
    port: Framed<'_>,
    reset: Output<'_>,
    busy: Input<'_>,
    convst: &mut Output<'_>,
) -> Result<(), Fault> {
    let mut busy = Asked(busy);
    let mut converter = Converter::new(port, reset, &AD7606B);
    converter.reset(&mut Pause)?;
    converter.configure(&SETTINGS)?;
    converter.self_test(convst, &mut busy, &mut Pause).await?;
    converter.watch_inputs(0xFF, OPEN_AFTER)?;
    let (_, reset) = converter.into_adc_mode()?;
    // RESET must remain driven low while the converter operates
    forget(reset);
    Ok(())
}

impl<Port, Clock, Sdi, Dout, Select, Reset, Busy, Dma> Chip<Port, Clock, Sdi, Dout, Select, Reset, Busy, Dma>
where
    Port: Instance,
    Clock: SckPin<Port>,
    Sdi: MosiPin<Port>,
    Dout: MisoPin<Port>,
    Select: Pin,
    Reset: Pin,
    Busy: Pin,
    Dma: RxDma<Port>,
{
    /// Resets, configures and tests the converter, and leaves it in ADC mode.
    ///
    /// # Errors
    /// The fault found.
    pub async fn set_up(&mut self, convst: &mut Output<'_>) -> Result<(), Fault> {
        let mut config = Config::default();
        config.mode = MODE_2;
        config.frequency = REGISTER_HZ;
        let bus = Spi::new_blocking(
            self.port.reborrow(),
            self.clock.reborrow(),
            self.sdi.reborrow(),
            self.dout.reborrow(),
            config,
        );
        let select = Output::new(self.select.reborrow(), Level::High, Speed::High);
        let reset = Output::new(self.reset.reborrow(), Level::Low, Speed::Low);
        let busy = Input::new(self.busy.reborrow(), Pull::Down);
        set_up(Framed { bus, select }, reset, busy, convst).await
    }

    /// Sets the pin functions used while the rings are filled: the port drives select and clock by
    /// itself, and SDI is low, because anything else would be a command.
    pub fn ready_for_ring(&mut self) {
        let mut config = Config::default();
        config.mode = MODE_2;
        config.gpio_speed = Speed::VeryHigh;
        // these stay as they are until the next set-up, which reconfigures them: dropping must not
        // undo them
        forget(Spi::new_blocking_rxonly(
            self.port.reborrow(),
            self.clock.reborrow(),
            self.dout.reborrow(),
            config,
        ));
        forget(Output::new(self.sdi.reborrow(), Level::Low, Speed::Low));
        let mut select = Flex::new(self.select.reborrow());
        select.set_as_af_unchecked(SELECT_FUNCTION, AfType::output(OutputType::PushPull, Speed::VeryHigh));
        forget(select);
        forget(Input::new(self.busy.reborrow(), Pull::Down));
    }

    /// The port's DMA request number.
    pub fn request(&self) -> u8 {
        self.dma.request()
    }
}
