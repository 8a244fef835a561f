//! A USB host in the same process: enumeration, control requests, bulk packets.

use embassy_usb_driver::{EndpointAddress, Event};

use super::bus::Bus;

/// The device responded with a stall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stall;

pub struct Host(pub Bus);

/// One interface of an enumerated device, with its bulk endpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interface {
    pub number: u8,
    pub class: u8,
    pub out: u8,
    pub into: u8,
}

/// Result of an enumeration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    pub device: Vec<u8>,
    pub configuration: Vec<u8>,
    pub interfaces: Vec<Interface>,
    /// Attributes and packet size of each endpoint.
    pub endpoints: Vec<(u8, u16)>,
}

impl Found {
    pub fn vendor(&self) -> Interface {
        *self.interfaces.iter().find(|interface| interface.class == 0xFF).unwrap()
    }

    /// The data interface of the serial port.
    pub fn serial_port(&self) -> Interface {
        *self.interfaces.iter().find(|interface| interface.class == 0x0A).unwrap()
    }
}

impl Host {
    async fn control(&self, setup: [u8; 8], data: &[u8]) -> Result<Vec<u8>, Stall> {
        self.0.with(|wires| {
            wires.control.status = None;
            wires.control.into.clear();
            wires.control.out = data.chunks(64).map(<[u8]>::to_vec).collect();
            wires.control.setup = Some(setup);
        });
        self.0
            .until(|wires| {
                let accepted = wires.control.status.take()?;
                Some(if accepted { Ok(std::mem::take(&mut wires.control.into)) } else { Err(Stall) })
            })
            .await
    }

    pub async fn ask(
        &self,
        kind: u8,
        request: u8,
        value: u16,
        index: u16,
        length: u16,
    ) -> Result<Vec<u8>, Stall> {
        let ([v0, v1], [i0, i1], [l0, l1]) = (value.to_le_bytes(), index.to_le_bytes(), length.to_le_bytes());
        self.control([kind | 0x80, request, v0, v1, i0, i1, l0, l1], &[]).await
    }

    pub async fn tell(
        &self,
        kind: u8,
        request: u8,
        value: u16,
        index: u16,
        data: &[u8],
    ) -> Result<(), Stall> {
        let ([v0, v1], [i0, i1]) = (value.to_le_bytes(), index.to_le_bytes());
        let [l0, l1] = (data.len() as u16).to_le_bytes();
        self.control([kind, request, v0, v1, i0, i1, l0, l1], data).await.map(drop)
    }

    pub async fn string(&self, index: u8) -> String {
        let bytes = self.ask(0, 6, 0x0300 | u16::from(index), 0x0409, 255).await.unwrap();
        let units: Vec<u16> =
            bytes[2..].as_chunks::<2>().0.iter().map(|unit| u16::from_le_bytes(*unit)).collect();
        String::from_utf16(&units).unwrap()
    }

    /// Plugs the cable in if necessary, and enumerates like a host.
    pub async fn enumerate(&self) -> Found {
        if !self.0.with(|wires| wires.powered) {
            self.0.with(|wires| wires.events.push_back(Event::PowerDetected));
            self.0.until(|wires| wires.powered.then_some(())).await;
        }
        self.reset().await;
        let device = self.ask(0, 6, 0x0100, 0, 18).await.unwrap();
        self.tell(0, 5, 7, 0, &[]).await.unwrap();
        assert_eq!(self.0.with(|wires| wires.address), 7);
        let head = self.ask(0, 6, 0x0200, 0, 9).await.unwrap();
        let length = u16::from_le_bytes([head[2], head[3]]);
        let configuration = self.ask(0, 6, 0x0200, 0, length).await.unwrap();
        assert_eq!(configuration.len(), usize::from(length));
        self.tell(0, 9, u16::from(configuration[5]), 0, &[]).await.unwrap();
        let (interfaces, endpoints) = parse(&configuration);
        Found { device, configuration, interfaces, endpoints }
    }

    /// A bus reset, as after an error or on request of a program.
    pub async fn reset(&self) {
        self.0.with(|wires| {
            wires.address = 0;
            // received packets remain in the driver; packets to be sent are lost
            wires.ends().for_each(|end| end.enabled = false);
            wires.into.iter_mut().for_each(|end| end.packet = None);
            wires.events.push_back(Event::Reset);
        });
        self.0.until(|wires| wires.events.is_empty().then_some(())).await;
    }

    /// Suspends the bus.
    pub async fn suspend(&self) {
        self.tell_of(Event::Suspend).await;
    }

    /// Resumes the bus.
    pub async fn resume(&self) {
        self.tell_of(Event::Resume).await;
    }

    async fn tell_of(&self, event: Event) {
        self.0.with(|wires| wires.events.push_back(event));
        self.0.until(|wires| wires.events.is_empty().then_some(())).await;
    }

    /// Unplugs the cable.
    pub async fn unplug(&self) {
        self.0.with(|wires| wires.events.push_back(Event::PowerRemoved));
        self.0.until(|wires| (!wires.powered).then_some(())).await;
    }

    /// Sends one packet; waits until the device has taken the previous one.
    pub async fn put(&self, endpoint: u8, bytes: &[u8]) -> Result<(), Stall> {
        let address = EndpointAddress::from(endpoint);
        self.0
            .until(|wires| {
                let end = wires.end(address);
                assert!(bytes.len() <= usize::from(end.info.unwrap().max_packet_size));
                if end.halted {
                    return Some(Err(Stall));
                }
                (end.enabled && end.packet.is_none()).then(|| {
                    end.packet = Some(bytes.to_vec());
                    Ok(())
                })
            })
            .await
    }

    /// Receives one packet; waits until there is one.
    pub async fn take(&self, endpoint: u8) -> Result<Vec<u8>, Stall> {
        let address = EndpointAddress::from(endpoint);
        self.0
            .until(|wires| {
                let end = wires.end(address);
                if end.halted { Some(Err(Stall)) } else { end.packet.take().map(Ok) }
            })
            .await
    }

    /// One transfer as an operating system reads it: packets up to the first short one.
    pub async fn transfer(&self, endpoint: u8, packet: u16) -> Vec<u8> {
        let mut bytes = Vec::new();
        loop {
            let part = self.take(endpoint).await.unwrap();
            bytes.extend_from_slice(&part);
            if part.len() < usize::from(packet) {
                return bytes;
            }
        }
    }
}

fn parse(configuration: &[u8]) -> (Vec<Interface>, Vec<(u8, u16)>) {
    let (mut interfaces, mut endpoints) = (Vec::<Interface>::new(), Vec::new());
    let mut rest = configuration;
    while let Some(length) = rest.first() {
        let (descriptor, after) = rest.split_at(usize::from(*length));
        rest = after;
        match descriptor[1] {
            4 => interfaces.push(Interface { number: descriptor[2], class: descriptor[5], out: 0, into: 0 }),
            5 => {
                let interface = interfaces.last_mut().unwrap();
                let side = if descriptor[2] & 0x80 == 0 { &mut interface.out } else { &mut interface.into };
                *side = descriptor[2];
                endpoints.push((descriptor[3], u16::from_le_bytes([descriptor[4], descriptor[5]])));
            }
            _ => {}
        }
    }
    (interfaces, endpoints)
}
