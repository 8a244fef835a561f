//! Decoding a minute of ten channels from the bytes on the link to samples, compared with a copy of
//! the bytes and their CRC.

use super::noise::numbers;
use super::row::{RUNS, Row, quickest};
use jointrig::device::link::Link;
use jointrig::device::stream::Stream;
use jointrig::device::transport::Transport;
use jointrig_protocol::block::{Block, Header};
use jointrig_protocol::frame::{Frame, Kind, Writer, encode};
use jointrig_protocol::hello::{Hello, Role};
use jointrig_protocol::limits::{MAX_WIRE, scans_per_block};
use std::error::Error;
use std::hint::black_box;
use std::io;
use std::sync::Arc;
use std::time::Duration;

const CHANNELS: usize = 10;
const SCANS: usize = 60 * 51_200;

/// A transport over bytes in memory.
struct Tape {
    bytes: Arc<Vec<u8>>,
    at: usize,
    packets: bool,
}

impl Transport for Tape {
    fn read(&mut self, buf: &mut [u8], _timeout: Duration) -> io::Result<usize> {
        let rest = &self.bytes[self.at..];
        let count = rest.len().min(buf.len());
        buf[..count].copy_from_slice(&rest[..count]);
        self.at += count;
        Ok(count)
    }

    fn write_all(&mut self, _bytes: &[u8]) -> io::Result<()> {
        Ok(())
    }

    fn keeps_packets(&self) -> bool {
        self.packets
    }
}

/// A row for each way of framing.
pub fn rows() -> Result<Vec<Row>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for (packets, name) in [(true, "packets"), (false, "COBS")] {
        let bytes = Arc::new(wire(packets)?);
        let mut copy = vec![0; bytes.len()];
        let [ours, least] = quickest(
            RUNS,
            [&mut || assert_eq!(decoded(&bytes, packets), SCANS as u64, "every scan arrives"), &mut || {
                black_box(&mut copy).copy_from_slice(black_box(&bytes));
                black_box(crc32fast::hash(&bytes));
            }],
        );
        let megabytes = bytes.len() as f64 / 1e6;
        rows.push(
            Row::of(
                format!("frames in {name} to scans, 60 s of {CHANNELS} channels ({megabytes:.0} MB)"),
                ours,
            )
            .against("memcpy and CRC-32 of the bytes", least, None),
        );
    }
    Ok(rows)
}

/// The bytes that a device sends.
fn wire(packets: bool) -> Result<Vec<u8>, Box<dyn Error>> {
    let each = scans_per_block(CHANNELS).ok_or("a block holds no scan")?;
    let noise: Vec<u8> =
        numbers(each * CHANNELS, 1).iter().flat_map(|v| ((v * 3e3) as i16).to_le_bytes()).collect();
    let mut bytes = Vec::new();
    // a reader expects COBS until the device's Hello announces packets
    let hello = Hello { role: Role::Device, packets, ..Hello::host(1) };
    bytes.extend(encode(Kind::Hello, &hello.to_bytes(), &mut [0; MAX_WIRE])?);
    let mut writer = Writer::new(Kind::Samples);
    for first in (0..SCANS).step_by(each) {
        let scans = each.min(SCANS - first);
        let header =
            Header { flags: 0, map: 0, scans: scans as u8, epoch: 1, first_scan: first as u64 }.to_bytes();
        let end = header.len() + 2 * scans * CHANNELS;
        let payload = writer.payload_mut();
        payload[..header.len()].copy_from_slice(&header);
        payload[header.len()..end].copy_from_slice(&noise[..end - header.len()]);
        bytes.extend(if packets { writer.seal_packet(end)? } else { writer.seal(end)? });
    }
    Ok(bytes)
}

/// Number of decoded scans.
fn decoded(bytes: &Arc<Vec<u8>>, packets: bool) -> u64 {
    let mut link = Link::new(Box::new(Tape { bytes: bytes.clone(), at: 0, packets }));
    let mut stream = Stream::new(1, 0, 0, CHANNELS, 51_200);
    let mut take = |frame: Frame<'_>| {
        let block = Block::from_payload(frame.payload);
        assert!(
            frame.kind == Kind::Hello || block.is_some_and(|block| stream.take(&block)),
            "a block of this stream"
        );
    };
    while link.receive(Duration::ZERO, &mut take).is_ok_and(|more| more) {}
    stream.accounts().received
}
