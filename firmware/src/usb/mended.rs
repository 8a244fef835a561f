//! Workarounds for faults of this USB core's driver.
//!
//! embassy-usb-synopsys-otg 0.3.3, the version that embassy-stm32 0.6.0 uses, has three faults that
//! were fixed after its last release (embassy pull request 6687, August 2026;
//! docs/dependencies.md):
//!
//! - A suspend that was latched before a bus reset is reported after it, and the device sleeps
//!   while the host communicates with it.
//! - An endpoint that is enabled again continues with its old data toggle, where USB 2.0, 9.1.1.5
//!   requires DATA0: the first packet afterwards is taken for a repetition. The same applies when a
//!   halt is cleared (USB 2.0, 9.4.5).
//! - A packet that was pending while its endpoint was disabled is read when the endpoint is enabled
//!   again: [`super::link`] discards it.

use embassy_usb::driver::{
    Bus, Driver, EndpointAddress, EndpointAllocError, EndpointType, Event, Unsupported,
};

/// The register accesses that the workarounds need.
pub trait Registers {
    /// Clears a latched suspend, unless the bus is suspended now.
    fn forget_suspend(&mut self);
    /// Makes the endpoint's next packet DATA0.
    fn begin_with_data0(&mut self, endpoint: EndpointAddress);
}

/// A driver with the workarounds.
pub struct Mended<D, R> {
    driver: D,
    registers: R,
}

impl<D, R> Mended<D, R> {
    /// Wraps a driver.
    pub fn new(driver: D, registers: R) -> Self {
        Self { driver, registers }
    }
}

impl<'d, D: Driver<'d>, R: Registers + 'd> Driver<'d> for Mended<D, R> {
    type EndpointOut = D::EndpointOut;
    type EndpointIn = D::EndpointIn;
    type ControlPipe = D::ControlPipe;
    type Bus = MendedBus<D::Bus, R>;

    fn alloc_endpoint_out(
        &mut self,
        ep_type: EndpointType,
        ep_addr: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointOut, EndpointAllocError> {
        self.driver.alloc_endpoint_out(ep_type, ep_addr, max_packet_size, interval_ms)
    }

    fn alloc_endpoint_in(
        &mut self,
        ep_type: EndpointType,
        ep_addr: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointIn, EndpointAllocError> {
        self.driver.alloc_endpoint_in(ep_type, ep_addr, max_packet_size, interval_ms)
    }

    fn start(self, control_max_packet_size: u16) -> (Self::Bus, Self::ControlPipe) {
        let (bus, control) = self.driver.start(control_max_packet_size);
        (MendedBus { bus, registers: self.registers }, control)
    }
}

/// A driver's bus with the workarounds.
pub struct MendedBus<B, R> {
    bus: B,
    registers: R,
}

impl<B: Bus, R: Registers> Bus for MendedBus<B, R> {
    async fn enable(&mut self) {
        self.bus.enable().await;
    }

    async fn disable(&mut self) {
        self.bus.disable().await;
    }

    async fn poll(&mut self) -> Event {
        let event = self.bus.poll().await;
        if event == Event::Reset {
            self.registers.forget_suspend();
        }
        event
    }

    fn endpoint_set_enabled(&mut self, endpoint: EndpointAddress, enabled: bool) {
        self.bus.endpoint_set_enabled(endpoint, enabled);
        // endpoint 0 is excluded: the core sets its toggles with each SETUP
        if enabled && endpoint.index() != 0 {
            self.registers.begin_with_data0(endpoint);
        }
    }

    fn endpoint_set_stalled(&mut self, endpoint: EndpointAddress, stalled: bool) {
        self.bus.endpoint_set_stalled(endpoint, stalled);
        if !stalled && endpoint.index() != 0 {
            self.registers.begin_with_data0(endpoint);
        }
    }

    fn endpoint_is_stalled(&mut self, endpoint: EndpointAddress) -> bool {
        self.bus.endpoint_is_stalled(endpoint)
    }

    fn force_reset(&mut self) -> Result<(), Unsupported> {
        self.bus.force_reset()
    }

    async fn remote_wakeup(&mut self) -> Result<(), Unsupported> {
        self.bus.remote_wakeup().await
    }
}
