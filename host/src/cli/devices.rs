//! `devices`: lists connected controllers and ports without opening them: opening a port could
//! reset an unrelated device.

use clap::Args;
use jointrig_protocol::usb::PRODUCT;
use serde::Serialize;
use serialport::SerialPortType;

use super::error::CliError;
use super::output;
use crate::device::usb;

/// List connected devices.
#[derive(Debug, Args)]
pub struct Devices {
    /// Print one JSON document on stdout.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Found {
    address: String,
    name: String,
    serial: Option<String>,
}

impl Devices {
    pub fn run(self) -> Result<(), CliError> {
        let mut found = Vec::new();
        if cfg!(feature = "sim") {
            found.push(Found { address: "sim:".into(), name: "built-in simulated rig".into(), serial: None });
        }
        match usb::attached() {
            Ok(list) => found.extend(list.into_iter().map(|one| Found {
                address: one.address(),
                name: PRODUCT.into(),
                serial: one.serial,
            })),
            Err(error) => log::warn!("USB devices cannot be listed: {error}"),
        }
        match serialport::available_ports() {
            Ok(ports) => found.extend(ports.into_iter().map(|port| {
                let (name, serial) = match port.port_type {
                    SerialPortType::UsbPort(usb) => {
                        (usb.product.unwrap_or_else(|| "USB serial port".into()), usb.serial_number)
                    }
                    _ => ("serial port".into(), None),
                };
                Found { address: format!("serial:{}", port.port_name), name, serial }
            })),
            Err(error) => log::warn!("serial ports cannot be listed: {error}"),
        }
        if self.json {
            return output::json(&serde_json::json!({ "devices": found }));
        }
        output::lines(found.into_iter().map(|device| {
            let serial = device.serial.map(|serial| format!(", serial number {serial}")).unwrap_or_default();
            format!("{:<28} {}{serial}", device.address, device.name)
        }))
    }
}
