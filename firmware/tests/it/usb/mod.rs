//! Tests of the device's USB code, with the host in the same process.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod bus;
mod host;

use std::cell::{Cell, RefCell};
use std::pin::pin;

use embassy_futures::join::join;
use embassy_futures::select::{Either, select, select3};
use embassy_futures::{block_on, yield_now};
use jointrig_firmware::board::{ByteSink, ByteSource};
use jointrig_firmware::usb::mended::Mended;
use jointrig_firmware::usb::{Buffers, INTERFACE_GUID, Speed, VENDOR_CODE, build};
use jointrig_protocol::golden;
use jointrig_protocol::packet::Reader;
use jointrig_protocol::usb::{PRODUCT, PRODUCT_ID, VENDOR_ID};

use bus::{Bus, Device, Mend};
use embassy_usb_driver::{EndpointAddress, Event};
use host::{Host, Interface, Stall};

/// Data received by the device: bytes, or `None` where its source reported a cut.
type Heard = RefCell<Vec<Option<Vec<u8>>>>;

/// Runs `scenario` on the host's side while the device receives, and sends `frames` one after
/// another.
fn run<F: Future<Output = ()>>(
    speed: Speed,
    frames: &[Vec<u8>],
    scenario: impl FnOnce(Host, &'static Seen) -> F,
) {
    let bus = Bus::default();
    let seen: &'static Seen = Box::leak(Box::default());
    let device = async {
        let mut buffers = Buffers::new();
        let driver = Mended::new(Device(bus.clone()), bus.clone());
        let mut usb = build(driver, &mut buffers, "0042", speed);
        let hearing = async {
            let mut bytes = [0; 512];
            loop {
                let length = usb.source.read(&mut bytes).await;
                seen.heard.borrow_mut().push((length > 0).then(|| bytes[..length].to_vec()));
            }
        };
        let speaking = async {
            for frame in frames {
                usb.sink.write(frame).await;
                seen.written.set(seen.written.get() + 1);
            }
            std::future::pending::<()>().await;
        };
        select3(usb.device.run(), hearing, speaking).await;
    };
    let ended = block_on(select(device, scenario(Host(bus.clone()), seen)));
    assert!(matches!(ended, Either::Second(())), "the device ended by itself");
}

/// Data observed on the device's side.
#[derive(Default)]
struct Seen {
    heard: Heard,
    written: Cell<usize>,
}

impl Seen {
    fn bytes(&self) -> Vec<u8> {
        self.heard.borrow().iter().flatten().flatten().copied().collect()
    }

    fn cuts(&self) -> usize {
        self.heard.borrow().iter().filter(|heard| heard.is_none()).count()
    }
}

/// Lets the device proceed as far as it can without the host.
async fn settle() {
    for _ in 0..50 {
        yield_now().await;
    }
}

fn golden_frames() -> Vec<Vec<u8>> {
    let mut frames = Vec::new();
    golden::for_each(|_, wire| frames.push(wire.to_vec())).unwrap();
    frames
}

fn numbered(count: usize) -> Vec<Vec<u8>> {
    (0..count).map(|i| (0..503).map(|k| (i * 7 + k) as u8).collect()).collect()
}

#[test]
fn descriptors_at_both_speeds() {
    for (speed, packet) in [(Speed::High, 512), (Speed::Full, 64)] {
        run(speed, &[], async move |host, _| {
            let found = host.enumerate().await;
            assert_eq!(found.device[2..4], [0x10, 0x02], "USB 2.1: it has a BOS descriptor");
            assert_eq!(found.device[4..7], [0xEF, 0x02, 0x01], "functions are grouped");
            assert_eq!(found.device[8..12], [0x09, 0x12, 0x01, 0x00]);
            let bulk: Vec<_> = found.endpoints.iter().filter(|(kind, _)| *kind == 2).collect();
            assert_eq!(bulk, [&(2, packet); 4]);
            assert_eq!(found.interfaces.iter().map(|i| i.class).collect::<Vec<_>>(), [0xFF, 0x02, 0x0A]);
            assert_eq!(host.string(found.device[14]).await, "jointrig");
            assert_eq!(host.string(found.device[15]).await, PRODUCT);
            assert_eq!(host.string(found.device[16]).await, "0042");
        });
    }
}

#[test]
fn the_udev_rule_is_for_this_device() {
    let rule = include_str!("../../../../docs/udev/70-jointrig.rules");
    let lines: Vec<&str> = rule.lines().filter(|line| line.starts_with("SUBSYSTEM==")).collect();
    assert_eq!(lines.len(), 2, "the device and its serial port");
    for line in lines {
        assert!(line.contains(&format!("{{idVendor}}==\"{VENDOR_ID:04x}\"")));
        assert!(line.contains(&format!("{{idProduct}}==\"{PRODUCT_ID:04x}\"")));
        assert!(line.contains(&format!("{{product}}==\"{PRODUCT}\"")));
    }
}

#[test]
fn windows_is_told_to_use_winusb_for_the_vendor_interface_alone() {
    run(Speed::High, &[], async |host, _| {
        host.enumerate().await;
        let bos = host.ask(0, 6, 0x0F00, 0, 255).await.unwrap();
        // the platform capability of Microsoft OS 2.0 descriptors, and the request for them
        let uuid =
            [0xDF, 0x60, 0xDD, 0xD8, 0x89, 0x45, 0xC7, 0x4C, 0x9C, 0xD2, 0x65, 0x9D, 0x9E, 0x64, 0x8A, 0x9F];
        let at = bos.windows(16).position(|window| window == uuid).unwrap();
        let length = u16::from_le_bytes([bos[at + 20], bos[at + 21]]);
        assert_eq!(bos[at + 22], VENDOR_CODE);
        let set = host.ask(0x40, VENDOR_CODE, 0, 7, length).await.unwrap();
        assert_eq!(set.len(), usize::from(length));
        let compatible = set.windows(6).position(|window| window == b"WINUSB").unwrap();
        let guid: Vec<u8> = INTERFACE_GUID.encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert!(set.windows(guid.len()).any(|window| window == guid));
        // the preceding function subset begins at interface 0, which is the vendor interface
        let subset = set[..compatible].windows(4).rposition(|window| window == [8, 0, 2, 0]).unwrap();
        assert_eq!(set[subset + 4], 0);
    });
}

#[test]
fn an_unknown_request_stalls_and_harms_nothing() {
    run(Speed::High, &[], async |host, _| {
        host.enumerate().await;
        assert_eq!(host.ask(0x40, 0x55, 0, 0, 8).await, Err(Stall));
        assert_eq!(host.ask(0, 6, 0x0100, 0, 18).await.unwrap().len(), 18);
    });
}

#[test]
fn the_serial_port_takes_what_serial_ports_are_told() {
    run(Speed::High, &[], async |host, _| {
        let found = host.enumerate().await;
        let control = u16::from(found.serial_port().number - 1);
        let coding = [0x00, 0xC2, 0x01, 0x00, 0, 0, 8];
        host.tell(0x21, 0x20, 0, control, &coding).await.unwrap();
        assert_eq!(host.ask(0x21, 0x21, 0, control, 7).await.unwrap(), coding);
        host.tell(0x21, 0x22, 3, control, &[]).await.unwrap();
    });
}

/// Sends all frame kinds both ways on one interface and expects them unchanged.
fn golden_vectors_cross(speed: Speed, way: fn(&host::Found) -> Interface) {
    let frames = golden_frames();
    assert_eq!(frames.len(), golden::COMMITTED.len());
    run(speed, &frames, async |host, seen| {
        let found = host.enumerate().await;
        let way = way(&found);
        let packet = speed.bulk_packet();
        for frame in &frames {
            for part in frame.chunks(usize::from(packet)) {
                host.put(way.out, part).await.unwrap();
            }
        }
        for ((name, committed), frame) in golden::COMMITTED.iter().zip(&frames) {
            assert_eq!(committed, frame, "{name}");
            assert_eq!(host.transfer(way.into, packet).await, *committed, "{name}");
        }
        settle().await;
        let heard = seen.bytes();
        assert_eq!(heard, frames.concat());
        let (mut reader, mut rest, mut whole) = (Reader::new(), &heard[..], 0);
        while !rest.is_empty() {
            let (used, frame) = reader.feed(rest);
            whole += usize::from(matches!(frame, Some(Ok(_))));
            rest = &rest[used..];
        }
        assert_eq!(whole, frames.len());
    });
}

#[test]
fn golden_vectors_cross_at_both_speeds_on_both_ways() {
    for speed in [Speed::High, Speed::Full] {
        golden_vectors_cross(speed, host::Found::vendor);
        golden_vectors_cross(speed, host::Found::serial_port);
    }
}

#[test]
fn at_high_speed_a_frame_is_one_short_packet() {
    run(Speed::High, &numbered(3), async |host, _| {
        let way = host.enumerate().await.vendor();
        host.put(way.out, b"hello").await.unwrap();
        for frame in numbered(3) {
            assert_eq!(host.take(way.into).await.unwrap(), frame);
        }
    });
}

#[test]
fn at_full_speed_a_frame_that_fills_its_last_packet_is_ended_by_an_empty_one() {
    let frames = [vec![1; 128], vec![2; 65]];
    run(Speed::Full, &frames, async |host, _| {
        let way = host.enumerate().await.vendor();
        host.put(way.out, b"hello").await.unwrap();
        for expected in [64, 64, 0, 64, 1] {
            assert_eq!(host.take(way.into).await.unwrap().len(), expected);
        }
    });
}

#[test]
fn nothing_is_sent_before_the_host_has_spoken() {
    run(Speed::High, &numbered(1), async |host, seen| {
        let found = host.enumerate().await;
        settle().await;
        assert_eq!(seen.written.get(), 0);
        host.put(found.serial_port().out, b"hello").await.unwrap();
        assert_eq!(host.take(found.serial_port().into).await.unwrap(), numbered(1)[0]);
    });
}

#[test]
fn a_stalled_reader_makes_the_sink_wait_and_loses_nothing() {
    run(Speed::High, &numbered(40), async |host, seen| {
        let way = host.enumerate().await.vendor();
        host.put(way.out, b"hello").await.unwrap();
        for (i, frame) in numbered(40).into_iter().enumerate() {
            settle().await;
            // at most one packet, in the FIFO, is ahead of the host
            let ahead = seen.written.get() - i;
            assert!(ahead <= 1, "{ahead} frames ahead");
            // requests are still received meanwhile
            host.put(way.out, b"!").await.unwrap();
            assert_eq!(host.take(way.into).await.unwrap(), frame);
        }
        settle().await;
        assert_eq!(seen.bytes(), [&b"hello"[..], &[b'!'; 40]].concat());
    });
}

#[test]
fn a_bus_reset_in_mid_stream_costs_at_most_the_frame_on_its_way() {
    for speed in [Speed::High, Speed::Full] {
        run(speed, &numbered(20), async move |host, seen| {
            let found = host.enumerate().await;
            let way = found.vendor();
            host.put(way.out, b"half a fra").await.unwrap();
            for frame in &numbered(20)[..5] {
                assert_eq!(host.transfer(way.into, speed.bulk_packet()).await, *frame);
            }
            settle().await;
            assert_eq!(host.enumerate().await, found, "the same device as before");
            settle().await;
            assert_eq!(seen.cuts(), 1, "what was gathered of a frame is dropped");
            host.put(way.out, b"hello").await.unwrap();
            let next = host.transfer(way.into, speed.bulk_packet()).await;
            let at = numbered(20).iter().position(|frame| *frame == next).unwrap();
            assert!((6..=7).contains(&at), "a whole frame, one or two later: {at}");
            for frame in &numbered(20)[at + 1..] {
                assert_eq!(host.transfer(way.into, speed.bulk_packet()).await, *frame);
            }
        });
    }
}

#[test]
fn an_unplugged_cable_is_survived_as_often_as_it_happens() {
    run(Speed::High, &numbered(20), async |host, seen| {
        for round in 1..=4 {
            let way = host.enumerate().await.vendor();
            settle().await;
            host.put(way.out, b"hello").await.unwrap();
            host.take(way.into).await.unwrap();
            host.unplug().await;
            settle().await;
            assert_eq!(seen.cuts(), round);
        }
        assert!(seen.written.get() < 20, "nothing is poured into a cable that is not there");
    });
}

#[test]
fn a_halted_endpoint_goes_on_when_the_host_clears_it() {
    run(Speed::High, &numbered(4), async |host, _| {
        let way = host.enumerate().await.vendor();
        host.put(way.out, b"hello").await.unwrap();
        assert_eq!(host.take(way.into).await.unwrap(), numbered(4)[0]);
        host.tell(0x02, 3, 0, u16::from(way.into), &[]).await.unwrap();
        assert_eq!(host.take(way.into).await, Err(Stall));
        host.tell(0x02, 1, 0, u16::from(way.into), &[]).await.unwrap();
        let next = host.take(way.into).await.unwrap();
        assert!(numbered(4)[1..].contains(&next));
    });
}

#[test]
fn a_host_that_changes_over_is_followed() {
    run(Speed::High, &numbered(8), async |host, seen| {
        let found = host.enumerate().await;
        let (vendor, serial_port) = (found.vendor(), found.serial_port());
        host.put(vendor.out, b"half").await.unwrap();
        host.take(vendor.into).await.unwrap();
        settle().await;
        // the vendor's FIFO is full again and will never be emptied
        host.put(serial_port.out, b"hello").await.unwrap();
        let next = host.take(serial_port.into).await.unwrap();
        assert!(numbered(8)[2..].contains(&next));
        settle().await;
        assert_eq!(*seen.heard.borrow(), [Some(b"half".to_vec()), None, Some(b"hello".to_vec())]);
    });
}

#[test]
fn empty_packets_are_no_cut() {
    run(Speed::High, &[], async |host, seen| {
        let way = host.enumerate().await.vendor();
        for packet in [&b"a"[..], b"", b"b"] {
            host.put(way.out, packet).await.unwrap();
            settle().await;
        }
        assert_eq!(*seen.heard.borrow(), [Some(b"a".to_vec()), Some(b"b".to_vec())]);
    });
}

#[test]
fn a_small_buffer_gets_a_packet_in_parts() {
    let bus = Bus::default();
    let mut buffers = Buffers::new();
    let mut usb = build(Device(bus.clone()), &mut buffers, "0042", Speed::High);
    let host = Host(bus);
    let mut got = Vec::new();
    let test = async {
        let sending = async {
            let way = host.enumerate().await.vendor();
            host.put(way.out, b"0123456789").await.unwrap();
        };
        let reading = async {
            let mut bytes = [0; 4];
            while got.len() < 10 {
                let length = usb.source.read(&mut bytes).await;
                got.extend_from_slice(&bytes[..length]);
            }
        };
        // as on a board, the device starts reading before a host can have sent
        join(reading, sending).await;
    };
    block_on(select(usb.device.run(), pin!(test)));
    assert_eq!(got, b"0123456789");
}

#[test]
fn a_suspended_bus_is_a_cut_link() {
    run(Speed::High, &[], async |host, seen| {
        let vendor = host.enumerate().await.vendor();
        // before the first transfer there is no link to cut
        host.suspend().await;
        host.resume().await;
        host.put(vendor.out, &[1, 2, 3]).await.unwrap();
        settle().await;
        assert_eq!((seen.bytes(), seen.cuts()), (vec![1, 2, 3], 0));
        host.suspend().await;
        settle().await;
        assert_eq!(seen.cuts(), 1);
        host.resume().await;
        host.put(vendor.out, &[4]).await.unwrap();
        settle().await;
        assert_eq!((seen.bytes(), seen.cuts()), (vec![1, 2, 3, 4], 1));
    });
}

#[test]
fn a_packet_from_before_a_reset_is_no_order_after_it() {
    run(Speed::High, &[], async |host, seen| {
        let way = host.enumerate().await.vendor();
        host.put(way.out, b"first").await.unwrap();
        settle().await;
        // it arrives together with the reset, and waits in the driver until the endpoint is enabled
        // again
        host.put(way.out, b"stale").await.unwrap();
        host.reset().await;
        let way = host.enumerate().await.vendor();
        settle().await;
        host.put(way.out, b"fresh").await.unwrap();
        settle().await;
        assert_eq!(*seen.heard.borrow(), [Some(b"first".to_vec()), None, Some(b"fresh".to_vec())]);
    });
}

#[test]
fn toggles_begin_anew_and_an_old_suspend_is_forgotten() {
    run(Speed::High, &[], async |host, seen| {
        let way = host.enumerate().await.vendor();
        let ends = [way.out, way.into].map(EndpointAddress::from);
        let mends = |host: &Host| host.0.with(|wires| std::mem::take(&mut wires.mends));
        let told = mends(&host);
        assert_eq!(
            told.first(),
            Some(&Mend::SuspendForgotten),
            "with the reset that enumeration begins with"
        );
        assert!(ends.iter().all(|end| told.contains(&Mend::Data0(*end))), "{told:?}");
        // a halt that is cleared
        host.tell(0x02, 3, 0, u16::from(way.into), &[]).await.unwrap();
        assert_eq!(mends(&host), [], "a halt alone");
        host.tell(0x02, 1, 0, u16::from(way.into), &[]).await.unwrap();
        assert_eq!(mends(&host), [Mend::Data0(ends[1])]);
        // a suspend latched before a reset and reported with it: the link continues
        host.put(way.out, b"a").await.unwrap();
        settle().await;
        host.0.with(|wires| wires.events.extend([Event::Reset, Event::Suspend]));
        settle().await;
        let way = host.enumerate().await.vendor();
        host.put(way.out, b"b").await.unwrap();
        settle().await;
        assert_eq!(*seen.heard.borrow(), [Some(b"a".to_vec()), None, Some(b"b".to_vec())]);
        assert!(mends(&host).contains(&Mend::SuspendForgotten));
    });
}
