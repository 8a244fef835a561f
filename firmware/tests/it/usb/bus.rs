//! The bus and the device's controller: the behaviour of a USB peripheral, simulated.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::future::poll_fn;
use std::rc::Rc;
use std::task::{Poll, Waker};

use embassy_usb_driver as driver;
use embassy_usb_driver::{
    Direction, EndpointAddress, EndpointAllocError, EndpointError, EndpointInfo, EndpointType, Event,
    Unsupported,
};

use jointrig_firmware::usb::mended::Registers;

/// One endpoint in one direction: a FIFO of one packet, as in the hardware.
#[derive(Default)]
pub struct End {
    pub info: Option<EndpointInfo>,
    pub enabled: bool,
    pub halted: bool,
    pub packet: Option<Vec<u8>>,
}

/// A control transfer in progress.
#[derive(Default)]
pub struct Control {
    pub setup: Option<[u8; 8]>,
    pub out: VecDeque<Vec<u8>>,
    pub into: Vec<u8>,
    /// Accepted, or refused with a stall.
    pub status: Option<bool>,
}

/// Register accesses of the driver's workarounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mend {
    SuspendForgotten,
    Data0(EndpointAddress),
}

impl Registers for Bus {
    fn forget_suspend(&mut self) {
        self.with(|wires| {
            wires.mends.push(Mend::SuspendForgotten);
            wires.events.retain(|event| *event != Event::Suspend);
        });
    }

    fn begin_with_data0(&mut self, endpoint: EndpointAddress) {
        self.with(|wires| wires.mends.push(Mend::Data0(endpoint)));
    }
}

#[derive(Default)]
pub struct Wires {
    pub mends: Vec<Mend>,
    pub out: [End; 8],
    pub into: [End; 8],
    pub events: VecDeque<Event>,
    pub powered: bool,
    pub address: u8,
    pub control: Control,
    waiting: Vec<Waker>,
}

impl Wires {
    pub fn end(&mut self, address: EndpointAddress) -> &mut End {
        if address.is_in() { &mut self.into[address.index()] } else { &mut self.out[address.index()] }
    }

    pub fn ends(&mut self) -> impl Iterator<Item = &mut End> {
        self.out.iter_mut().chain(&mut self.into)
    }
}

/// Shared by both sides; every change wakes all waiting tasks.
#[derive(Clone, Default)]
pub struct Bus(Rc<RefCell<Wires>>);

impl Bus {
    pub fn with<R>(&self, f: impl FnOnce(&mut Wires) -> R) -> R {
        let (result, waiting) = {
            let mut wires = self.0.borrow_mut();
            (f(&mut wires), std::mem::take(&mut wires.waiting))
        };
        waiting.into_iter().for_each(Waker::wake);
        result
    }

    /// Waits until `f` has a result.
    pub async fn until<R>(&self, mut f: impl FnMut(&mut Wires) -> Option<R>) -> R {
        let result = poll_fn(|context| {
            let mut wires = self.0.borrow_mut();
            if let Some(result) = f(&mut wires) {
                return Poll::Ready(result);
            }
            wires.waiting.push(context.waker().clone());
            Poll::Pending
        })
        .await;
        self.with(|_| ());
        result
    }
}

/// The device's end of the bus, implementing embassy's driver traits.
pub struct Device(pub Bus);
pub struct DeviceBus(Bus);
pub struct DeviceControl(Bus, u16);
pub struct DeviceEnd(Bus, EndpointInfo);

impl Device {
    fn allocate(
        &mut self,
        ep_type: EndpointType,
        wanted: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
        direction: Direction,
    ) -> Result<DeviceEnd, EndpointAllocError> {
        let info = self.0.with(|wires| {
            let free = |wires: &mut Wires, i: usize| {
                wires.end(EndpointAddress::from_parts(i, direction)).info.is_none()
            };
            let index =
                wanted.map_or_else(|| (1..8).find(|i| free(wires, *i)), |wanted| Some(wanted.index()));
            let addr = EndpointAddress::from_parts(index.ok_or(EndpointAllocError)?, direction);
            let info = EndpointInfo { addr, ep_type, max_packet_size, interval_ms };
            wires.end(addr).info = Some(info);
            Ok(info)
        })?;
        Ok(DeviceEnd(self.0.clone(), info))
    }
}

impl driver::Driver<'_> for Device {
    type EndpointOut = DeviceEnd;
    type EndpointIn = DeviceEnd;
    type ControlPipe = DeviceControl;
    type Bus = DeviceBus;

    fn alloc_endpoint_out(
        &mut self,
        ep_type: EndpointType,
        ep_addr: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<DeviceEnd, EndpointAllocError> {
        self.allocate(ep_type, ep_addr, max_packet_size, interval_ms, Direction::Out)
    }

    fn alloc_endpoint_in(
        &mut self,
        ep_type: EndpointType,
        ep_addr: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<DeviceEnd, EndpointAllocError> {
        self.allocate(ep_type, ep_addr, max_packet_size, interval_ms, Direction::In)
    }

    fn start(self, control_max_packet_size: u16) -> (DeviceBus, DeviceControl) {
        (DeviceBus(self.0.clone()), DeviceControl(self.0, control_max_packet_size))
    }
}

impl driver::Bus for DeviceBus {
    async fn enable(&mut self) {
        self.0.with(|wires| wires.powered = true);
    }

    async fn disable(&mut self) {
        self.0.with(|wires| {
            wires.powered = false;
            for end in wires.ends() {
                end.enabled = false;
                end.packet = None;
            }
        });
    }

    async fn poll(&mut self) -> Event {
        self.0.until(|wires| wires.events.pop_front()).await
    }

    fn endpoint_set_enabled(&mut self, address: EndpointAddress, enabled: bool) {
        self.0.with(|wires| {
            let end = wires.end(address);
            end.enabled = enabled;
            end.halted = false;
            if address.is_in() {
                end.packet = None;
            }
        });
    }

    fn endpoint_set_stalled(&mut self, address: EndpointAddress, halted: bool) {
        self.0.with(|wires| wires.end(address).halted = halted);
    }

    fn endpoint_is_stalled(&mut self, address: EndpointAddress) -> bool {
        self.0.with(|wires| wires.end(address).halted)
    }

    async fn remote_wakeup(&mut self) -> Result<(), Unsupported> {
        Err(Unsupported)
    }
}

impl driver::Endpoint for DeviceEnd {
    fn info(&self) -> &EndpointInfo {
        &self.1
    }

    async fn wait_enabled(&mut self) {
        self.0.until(|wires| wires.end(self.1.addr).enabled.then_some(())).await;
    }
}

impl driver::EndpointOut for DeviceEnd {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, EndpointError> {
        let packet = self
            .0
            .until(|wires| {
                let end = wires.end(self.1.addr);
                if !end.enabled {
                    return Some(Err(EndpointError::Disabled));
                }
                end.packet.take().map(Ok)
            })
            .await?;
        buffer.get_mut(..packet.len()).ok_or(EndpointError::BufferOverflow)?.copy_from_slice(&packet);
        Ok(packet.len())
    }
}

impl driver::EndpointIn for DeviceEnd {
    async fn write(&mut self, bytes: &[u8]) -> Result<(), EndpointError> {
        if bytes.len() > usize::from(self.1.max_packet_size) {
            return Err(EndpointError::BufferOverflow);
        }
        self.0
            .until(|wires| {
                let end = wires.end(self.1.addr);
                if !end.enabled {
                    return Some(Err(EndpointError::Disabled));
                }
                end.packet.is_none().then(|| {
                    end.packet = Some(bytes.to_vec());
                    Ok(())
                })
            })
            .await
    }
}

impl driver::ControlPipe for DeviceControl {
    fn max_packet_size(&self) -> usize {
        usize::from(self.1)
    }

    async fn setup(&mut self) -> [u8; 8] {
        self.0.until(|wires| wires.control.setup.take()).await
    }

    async fn data_out(&mut self, buffer: &mut [u8], _: bool, _: bool) -> Result<usize, EndpointError> {
        let packet = self.0.until(|wires| wires.control.out.pop_front()).await;
        buffer.get_mut(..packet.len()).ok_or(EndpointError::BufferOverflow)?.copy_from_slice(&packet);
        Ok(packet.len())
    }

    async fn data_in(&mut self, data: &[u8], _: bool, last: bool) -> Result<(), EndpointError> {
        assert!(data.len() <= usize::from(self.1));
        self.0.with(|wires| {
            wires.control.into.extend_from_slice(data);
            if last {
                wires.control.status = Some(true);
            }
        });
        Ok(())
    }

    async fn accept(&mut self) {
        self.0.with(|wires| wires.control.status = Some(true));
    }

    async fn reject(&mut self) {
        self.0.with(|wires| wires.control.status = Some(false));
    }

    async fn accept_set_address(&mut self, address: u8) {
        self.0.with(|wires| {
            wires.address = address;
            wires.control.status = Some(true);
        });
    }
}
