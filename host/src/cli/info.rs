//! `info`: shows a device's identity and state.
//!
//! `devices`: lists connected controllers and ports without opening them: opening a port could
//! reset an unrelated device.

use super::error::CliError;
use super::output;
use crate::device::address::Address;
use crate::device::channels::ChannelMap;
use crate::device::error::{UDEV_RULE, flash_file};
use crate::device::logs::Tables;
use crate::device::serial::ports;
use crate::device::session::Session;
use crate::device::usb;
use clap::Args;
use jointrig_protocol::slow::{Slow, Supply};
use jointrig_protocol::sync::{Clock, Sync};
use jointrig_protocol::usb::PRODUCT;
use serde::Serialize;
use serde_json::json;
use serialport::SerialPortType;
use std::path::PathBuf;

/// This program's version.
const HOST_VERSION: &str = env!("CARGO_PKG_VERSION");

/// Whether firmware and program are of the same release.
fn fits(firmware: &str) -> bool {
    firmware == HOST_VERSION
}

/// Name of the channel that a supply feeds.
fn name_of(supply: Supply, map: &ChannelMap) -> &str {
    map.channels.get(usize::from(supply.channel)).map_or("?", |channel| channel.name.as_str())
}

/// The supplies, as JSON.
fn supplies(slow: &Slow, map: &ChannelMap) -> Vec<serde_json::Value> {
    let one = |supply: &Supply| {
        let fault = supply.fault().map(|fault| format!("{fault:?}").to_lowercase());
        json!({ "channel": name_of(*supply, map), "bias_v": supply.bias_v, "fault": fault })
    };
    slow.supplies.iter().map(one).collect()
}

/// Clock and edges, as JSON.
fn sync_value(sync: &Sync) -> serde_json::Value {
    let (clock, rate_hz) = match sync.clock {
        Clock::Internal => ("internal", None),
        Clock::External { rate_hz } => ("external", Some(rate_hz)),
    };
    json!({
        "clock": clock,
        "rate_hz": rate_hz,
        "fault": sync.fault.map(|fault| format!("{fault:?}").to_lowercase()),
        "ppm": sync.ppm,
        "edges": sync.edges,
        "edges_lost": sync.edges_lost,
        "pulses": sync.pulses,
    })
}

/// Clock and edges, as text.
fn sync_line(sync: &Sync) -> String {
    let clock = match (sync.clock, sync.fault) {
        (Clock::Internal, _) => "its own".into(),
        (Clock::External { rate_hz }, None) => format!("external, {rate_hz} Hz {:+.1} ppm", sync.ppm),
        (Clock::External { rate_hz }, Some(fault)) => format!("external, {rate_hz} Hz: {fault}"),
    };
    let (edges, lost, pulses) = (sync.edges, sync.edges_lost, sync.pulses);
    format!(
        "  clock of the scans: {clock}; sync input: {edges} edges, {lost} of them too fast; sync output: {pulses} pulses"
    )
}

/// Show a device: handshake, channels, firmware version, counters.
#[derive(Debug, Args)]
pub struct Info {
    /// Device address, e.g. sim:, usb:, serial:/dev/ttyACM0, tcp:127.0.0.1:4000,
    /// "bridge:python my_daq.py".
    #[arg(long, value_name = "ADDR")]
    device: String,
    /// Folder with the tables that decode the controller's log lines [default: that of the
    /// environment variable JOINTRIG_LOG_TABLES].
    #[arg(long, value_name = "DIR")]
    log_tables: Option<PathBuf>,
    /// Print one JSON document on stdout.
    #[arg(long)]
    json: bool,
}

impl Info {
    pub fn run(self) -> Result<(), CliError> {
        let address: Address = self.device.parse()?;
        let mut session = Session::open(address.open(0)?, &self.device)?;
        session.look_for_log_tables(Tables::new(self.log_tables));
        let info = session.info()?;
        let map = session.channels(&info)?;
        let status = session.status()?;
        let hello = *session.hello();
        let slow = session.slow()?.unwrap_or_default();
        let sync = session.sync()?;
        if self.json {
            let channels: Vec<_> = (map.channels.iter().zip(0..))
                .map(|(channel, place)| {
                    json!({
                        "name": channel.name,
                        "role": format!("{:?}", channel.role),
                        "unit": channel.quantity.unit(),
                        "range": map.full_scale(place),
                        "units_per_code": channel.units_per_code(),
                        "delay_s": f64::from(channel.delay_ns) * 1e-9,
                        "bits": channel.bits,
                    })
                })
                .collect();
            return output::json(&json!({
                "name": info.board,
                "address": self.device,
                "serial": info.serial,
                "firmware_version": info.version,
                "target": info.target,
                "build": format!("{:016x}", info.build),
                "protocol": format!("{}.{}", hello.major, hello.minor),
                "schema_hash": format!("{:016x}", hello.schema),
                "scan_rate_hz": info.scan_rate_hz,
                "ring_scans": info.ring_scans,
                "coil_cap_us": info.coil_cap_us,
                "stage": info.stage,
                "drive_v": info.drive_v,
                "reset": info.reset,
                "fits": fits(&info.version),
                "channels": channels,
                "shaker": format!("{:?}", status.shaker),
                "hammer": format!("{:?}", status.hammer),
                "interlock_closed": status.interlock_closed,
                "emergency_stop": status.emergency_stop,
                "streaming": status.streaming,
                "temperature_c": slow.temperature_c,
                "supplies": supplies(&slow, &map),
                "sync": sync.as_ref().map(sync_value),
                "counters": status.counters,
            }));
        }
        let mut text = vec![
            format!("{} (serial number {}) at {}", info.board, info.serial, self.device),
            format!("  firmware {} for {}, build {:016x}", info.version, info.target, info.build),
            format!("  started by {}", info.reset),
            format!("  protocol {}.{}, schema {:016x}", hello.major, hello.minor, hello.schema),
            format!(
                "  {} scans per second, {:.1} s of them can be sent again",
                info.scan_rate_hz,
                f64::from(info.ring_scans) / f64::from(info.scan_rate_hz.max(1))
            ),
            format!(
                "  hammer: {:?}; shaker: {}; interlock {}; emergency stop {}",
                status.hammer,
                if info.drive_v > 0.0 { format!("{:?}", status.shaker) } else { "none".into() },
                if status.interlock_closed { "closed" } else { "OPEN" },
                if status.emergency_stop { "LATCHED" } else { "released" },
            ),
            format!("  channels ({}):", map.len()),
        ];
        text.extend((map.channels.iter().zip(0..)).map(|(channel, place)| {
            let range = map.full_scale(place).unwrap_or(0.0);
            format!(
                "    {place:>2} {:<16} ±{range:.4} {:<6} {:?}",
                channel.name.as_str(),
                channel.quantity.unit(),
                channel.role
            )
        }));
        text.extend(slow.temperature_c.map(|celsius| format!("  specimen: {celsius:.1} °C")));
        text.extend(slow.supplies.iter().map(|supply| {
            let name = name_of(*supply, &map);
            let bias = supply.bias_v;
            match supply.fault() {
                None => format!("  supply of `{name}`: {bias:.1} V of bias, a sensor is there"),
                Some(fault) => format!("  supply of `{name}`: {bias:.1} V of bias: {fault}"),
            }
        }));
        text.extend(sync.as_ref().map(sync_line));
        if !fits(&info.version) {
            text.push(format!(
                "  this program is version {HOST_VERSION} and speaks the same protocol; flash its firmware from {}",
                flash_file(&self.device)
            ));
        }
        let counters = status.counters;
        text.push(format!(
            "  counters: {} frames in, {} bad; scans produced {}, sent {}, resent {}, dropped {}, missed {}; log lines dropped {}",
            counters.frames_in,
            counters.frames_bad,
            counters.scans_produced,
            counters.scans_sent,
            counters.scans_resent,
            counters.scans_dropped,
            counters.scans_missed,
            counters.logs_dropped,
        ));
        output::lines(text)
    }
}

/// List connected devices.
#[derive(Debug, Args)]
pub struct Devices {
    /// Print one JSON document on stdout.
    #[arg(long)]
    json: bool,
    /// Print the udev rule by which Linux lets you open the controller, instead of the list.
    #[arg(long, conflicts_with = "json")]
    udev_rule: bool,
}

#[derive(Debug, Serialize)]
struct FoundDevices {
    address: String,
    name: String,
    serial: Option<String>,
}

impl Devices {
    pub fn run(self) -> Result<(), CliError> {
        if self.udev_rule {
            return output::lines(UDEV_RULE.lines().map(str::to_owned));
        }
        let mut found = Vec::new();
        if cfg!(feature = "sim") {
            found.push(FoundDevices {
                address: "sim:".into(),
                name: "built-in simulated rig".into(),
                serial: None,
            });
        }
        match usb::attached() {
            Ok(list) => found.extend(list.into_iter().map(|one| FoundDevices {
                address: one.address(),
                name: PRODUCT.into(),
                serial: one.serial,
            })),
            Err(error) => log::warn!("USB devices cannot be listed: {error}"),
        }
        match ports() {
            Ok(ports) => found.extend(ports.into_iter().map(|port| {
                let (name, serial) = match port.port_type {
                    SerialPortType::UsbPort(usb) => {
                        (usb.product.unwrap_or_else(|| "USB serial port".into()), usb.serial_number)
                    }
                    _ => ("serial port".into(), None),
                };
                FoundDevices { address: format!("serial:{}", port.port_name), name, serial }
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
