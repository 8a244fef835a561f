//! The whole firmware with its USB device, and the host in the same process: effects of a host that
//! does not read, and of a bus reset. Time does not advance here; what depends on time is tested in
//! hil-sim.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

#[path = "it/usb/bus.rs"]
#[allow(dead_code, reason = "shared with the device's own tests, which use all of it")]
mod bus;
#[path = "it/usb/host.rs"]
#[allow(dead_code, reason = "shared with the device's own tests, which use all of it")]
mod host;

use std::cell::{Cell, RefCell};

use bus::{Bus, Device};
use embassy_futures::select::{Either, select, select4};
use embassy_futures::{block_on, yield_now};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use host::{Host, Interface};
use jointrig_firmware::board::{Coil, Delivered, Inputs, NoDrive, NoStage, Scans};
use jointrig_firmware::logs::Tap;
use jointrig_firmware::ring::Slot;
use jointrig_firmware::usb::{Buffers, Speed, build};
use jointrig_firmware::{Core, Facts, acquire, receive, transmit};

use jointrig_protocol::answer::{self, Answer, Reset};
use jointrig_protocol::block::{Block, RESENT};
use jointrig_protocol::channel::{Channel, Quantity, Role};
use jointrig_protocol::event::{self, Event};
use jointrig_protocol::frame::{Accumulator, Kind, Writer};
use jointrig_protocol::hello::Hello;
use jointrig_protocol::limits::BLOCK_SAMPLE_BYTES;
use jointrig_protocol::request::{self, Request};

/// Blocks of 15 scans per second at 51.2 kHz; the ring in these tests holds this many.
const SECOND: usize = 3_414;
const SCANS: u64 = 15;

/// Converters that deliver as many blocks as the test requests.
struct OnDemand<'a> {
    due: &'a Cell<usize>,
    block: u16,
}

impl Scans for OnDemand<'_> {
    async fn next(&mut self, block: &mut [u8; BLOCK_SAMPLE_BYTES]) -> Delivered {
        while self.due.get() == 0 {
            yield_now().await;
        }
        self.due.set(self.due.get() - 1);
        block.as_chunks_mut::<2>().0.fill(self.block.to_le_bytes());
        self.block = (self.block + 1) % 30_000;
        // one block at a time, as with the timer
        yield_now().await;
        Delivered { scans: SCANS as u8, missed: 0, loud: true }
    }
}

struct NoCoil;

impl Coil for NoCoil {
    fn cap_us(&self) -> u32 {
        8_000
    }

    fn pulse(&mut self, _: u32) {}

    fn off(&mut self) {}
}

struct AllWell;

impl Inputs for AllWell {
    fn interlock_closed(&mut self) -> bool {
        true
    }

    fn emergency_stop(&mut self) -> bool {
        false
    }

    fn local_reset(&mut self) -> bool {
        false
    }
}

fn run<F: Future<Output = ()>>(speed: Speed, scenario: impl FnOnce(Session) -> F) {
    let due: &'static Cell<usize> = Box::leak(Box::default());
    let logs: &'static Tap<NoopRawMutex> = Box::leak(Box::default());
    let bus = Bus::default();
    let device = async {
        let channels: Vec<Channel> = (0..16)
            .map(|i| Channel {
                name: format!("v{i}").parse().unwrap(),
                role: if i == 0 { Role::HammerForce } else { Role::Auxiliary },
                quantity: Quantity::Voltage,
                units_per_volt: 1.0,
                range_v: 10.0,
                delay_ns: 0,
                bits: 16,
            })
            .collect();
        let facts = Facts {
            board: "usb test".parse().unwrap(),
            serial: "0042".parse().unwrap(),
            target: "pc".parse().unwrap(),
            build: 0,
            scan_rate_hz: 51_200,
            channels: &channels,
            coil_cap_us: 8_000,
            stage: false,
            sync: false,
            drive_v: 0.0,
            reset: Reset::Power,
            boot: 1,
        };
        let mut slots = vec![Slot::EMPTY; SECOND];
        let core: Core<'_, NoopRawMutex> = Core::new(facts, &mut slots).with_logs(logs);
        let mut buffers = Buffers::new();
        let mut usb = build(Device(bus.clone()), &mut buffers, "0042", speed);
        let mut scans = OnDemand { due, block: 0 };
        select4(
            usb.device.run(),
            acquire::acquire(&core, &mut scans, &mut NoCoil, &mut NoDrive, &mut AllWell),
            receive::receive(&core, &mut usb.source, &mut NoStage),
            transmit::transmit(&core, &mut usb.sink),
        )
        .await;
    };
    let (host, number, waiting) = (Host(bus.clone()), Cell::new(1), RefCell::default());
    let session = Session { host, speed, due, logs, number, waiting };
    assert!(matches!(block_on(select(device, scenario(session))), Either::Second(())));
}

/// A minimal host: performs the handshake, sends requests, and sorts the received data.
struct Session {
    host: Host,
    speed: Speed,
    due: &'static Cell<usize>,
    logs: &'static Tap<NoopRawMutex>,
    number: Cell<u32>,
    waiting: RefCell<Vec<Heard>>,
}

/// Data received from the device.
#[derive(Debug, Clone)]
enum Heard {
    Hello,
    Answer(answer::Numbered),
    Event(Event),
    /// First scan, first code, whether it was retransmitted.
    Block(u64, i16, bool),
    /// Encoded log lines.
    Log(Vec<u8>),
}

impl Session {
    async fn plug(&self) -> Interface {
        let way = self.host.enumerate().await.vendor();
        let mut frame = Writer::new(Kind::Hello);
        let hello = Hello::host(77).to_bytes();
        frame.payload_mut()[..hello.len()].copy_from_slice(&hello);
        self.put(way, frame.seal(hello.len()).unwrap()).await;
        while !matches!(self.hear(way).await, Heard::Hello) {}
        way
    }

    async fn put(&self, way: Interface, frame: &[u8]) {
        for packet in frame.chunks(usize::from(self.speed.bulk_packet())) {
            self.host.put(way.out, packet).await.unwrap();
        }
    }

    async fn hear(&self, way: Interface) -> Heard {
        let wire = self.host.transfer(way.into, self.speed.bulk_packet()).await;
        let mut accumulator = Accumulator::new();
        let (used, frame) = accumulator.feed(&wire);
        assert_eq!(used, wire.len(), "one transfer is one frame");
        let frame = frame.unwrap().unwrap();
        match frame.kind {
            Kind::Hello => Heard::Hello,
            Kind::Answer => Heard::Answer(postcard::from_bytes(frame.payload).unwrap()),
            Kind::Event => {
                Heard::Event(postcard::from_bytes::<event::Numbered>(frame.payload).unwrap().event)
            }
            Kind::Samples => {
                let block = Block::from_payload(frame.payload).unwrap();
                let resent = block.header.flags & RESENT != 0;
                Heard::Block(block.header.first_scan, block.codes().next().unwrap(), resent)
            }
            Kind::Log => Heard::Log(frame.payload.to_vec()),
            other => panic!("a device says no {other:?}"),
        }
    }

    /// Sends a request; data received before the reply are kept for [`Self::next`].
    async fn ask(&self, way: Interface, request: Request) -> Answer {
        let number = self.number.replace(self.number.get() + 1);
        let mut frame = Writer::new(Kind::Request);
        self.put(way, frame.seal_value(&request::Numbered { number, request }).unwrap()).await;
        loop {
            match self.hear(way).await {
                Heard::Answer(answer) if answer.number == number => return answer.outcome.unwrap(),
                other => self.waiting.borrow_mut().push(other),
            }
        }
    }

    async fn next(&self, way: Interface) -> Heard {
        let kept = {
            let mut waiting = self.waiting.borrow_mut();
            if waiting.is_empty() { None } else { Some(waiting.remove(0)) }
        };
        match kept {
            Some(heard) => heard,
            None => self.hear(way).await,
        }
    }

    /// Lets the converters deliver this many blocks while the host does nothing.
    async fn produce(&self, blocks: usize) {
        self.due.set(blocks);
        while self.due.get() > 0 {
            yield_now().await;
        }
        for _ in 0..50 {
            yield_now().await;
        }
    }
}

/// Reads until `blocks` blocks are accounted for; returns the received blocks and the number of
/// scans reported lost.
async fn collect(session: &Session, way: Interface, blocks: usize) -> (Vec<(u64, i16)>, u64) {
    let (mut came, mut lost) = (Vec::new(), 0);
    while came.len() as u64 * SCANS + lost < blocks as u64 * SCANS {
        match session.next(way).await {
            Heard::Block(first, code, false) => came.push((first, code)),
            Heard::Event(Event::Lost { first_scan, scans, .. }) => {
                let expected = came.last().map_or(0, |(first, _)| first + SCANS);
                assert_eq!(first_scan, expected, "the range begins where the blocks end");
                lost += u64::from(scans);
            }
            Heard::Event(_) | Heard::Answer(_) => {}
            other => panic!("{other:?}"),
        }
    }
    (came, lost)
}

#[test]
fn a_host_that_does_not_read_for_half_a_second_loses_nothing() {
    for speed in [Speed::High, Speed::Full] {
        run(speed, async |session| {
            let way = session.plug().await;
            assert!(matches!(session.ask(way, Request::Start).await, Answer::Started { .. }));
            session.produce(SECOND / 2).await;
            let (came, lost) = collect(&session, way, SECOND / 2).await;
            assert_eq!(lost, 0);
            for (i, (first, code)) in came.iter().enumerate() {
                assert_eq!((*first, *code), (i as u64 * SCANS, i16::try_from(i).unwrap()));
            }
        });
    }
}

#[test]
fn after_five_seconds_the_loss_is_a_range_and_nothing_is_unexplained() {
    run(Speed::High, async |session| {
        let way = session.plug().await;
        session.ask(way, Request::Start).await;
        session.produce(5 * SECOND).await;
        let (came, lost) = collect(&session, way, 5 * SECOND).await;
        // one second of the ring, and the one or two blocks in transit
        assert!((SECOND..SECOND + 3).contains(&came.len()), "{}", came.len());
        assert_eq!(came.len() as u64 * SCANS + lost, 5 * SECOND as u64 * SCANS);
        assert_eq!(came.last().unwrap().0, (5 * SECOND as u64 - 1) * SCANS, "up to the newest");
        // and requests are answered as before
        assert!(matches!(session.ask(way, Request::Status).await, Answer::Status(_)));
    });
}

#[test]
fn log_lines_wait_for_every_block_and_are_dropped_first() {
    run(Speed::High, async |session| {
        let way = session.plug().await;
        session.ask(way, Request::Start).await;
        let mut line = [1; 50];
        line[49] = 0;
        for _ in 0..SECOND / 4 {
            session.produce(2).await;
            session.logs.push(&line);
        }
        let dropped = session.logs.dropped() as usize;
        assert!(dropped > SECOND / 8, "the host reads nothing, so lines are dropped ({dropped})");
        let (mut blocks, mut lines) = (0, 0);
        while lines + dropped < SECOND / 4 {
            match session.next(way).await {
                Heard::Block(first, ..) => {
                    assert_eq!((first, lines), (blocks as u64 * SCANS, 0), "no line before a block");
                    blocks += 1;
                }
                Heard::Log(bytes) => {
                    assert_eq!(bytes.len() % line.len(), 0, "whole lines");
                    assert!(bytes.chunks(line.len()).all(|one| one == line));
                    lines += bytes.len() / line.len();
                }
                _ => {}
            }
        }
        assert_eq!(blocks, SECOND / 4 * 2, "no block was lost");
        assert_eq!(session.logs.dropped() as usize, dropped);
    });
}

#[test]
fn what_was_said_before_a_host_came_is_told_to_the_first_one() {
    run(Speed::High, async |session| {
        session.logs.push(b"early\0");
        let way = session.plug().await;
        let heard = session.hear(way).await;
        assert!(matches!(&heard, Heard::Log(bytes) if bytes == b"early\0"), "{heard:?}");
    });
}

#[test]
fn requests_are_answered_while_nobody_reads_the_blocks() {
    run(Speed::High, async |session| {
        let way = session.plug().await;
        session.ask(way, Request::Start).await;
        session.produce(SECOND / 2).await;
        session.ask(way, Request::Info).await;
        // at most the block in the FIFO and the current block arrive before the reply
        assert!(session.waiting.borrow().len() <= 2, "{}", session.waiting.borrow().len());
    });
}

#[test]
fn what_a_bus_reset_swallowed_can_be_asked_for_again() {
    run(Speed::High, async |session| {
        let way = session.plug().await;
        let Answer::Started { epoch, .. } = session.ask(way, Request::Start).await else {
            panic!("no stream")
        };
        session.produce(10).await;
        let (before, _) = collect(&session, way, 4).await;
        assert_eq!(before.len(), 4);
        // the block in the FIFO is lost in the reset; the same session continues
        let way = session.plug().await;
        session.produce(10).await;
        let mut came: Vec<u64> = before.iter().map(|(first, _)| *first).collect();
        while came.last() != Some(&(19 * SCANS)) {
            if let Heard::Block(first, _, false) = session.next(way).await {
                came.push(first);
            }
        }
        let all = (0..20).map(|i| i * SCANS);
        let swallowed: Vec<u64> = all.filter(|first| !came.contains(first)).collect();
        assert!((1..=2).contains(&swallowed.len()), "{swallowed:?}");
        let scans = swallowed.len() as u32 * SCANS as u32;
        session.ask(way, Request::Resend { epoch, first_scan: swallowed[0], scans }).await;
        for due in swallowed {
            let heard = session.next(way).await;
            assert!(matches!(heard, Heard::Block(first, _, true) if first == due), "{heard:?}");
        }
    });
}

/// A clock that does not advance: nothing here waits for time.
#[allow(unsafe_code, reason = "embassy's time driver is an unmangled symbol")]
mod clock {
    struct Still;

    impl embassy_time_driver::Driver for Still {
        fn now(&self) -> u64 {
            0
        }

        fn schedule_wake(&self, _: u64, _: &std::task::Waker) {}
    }

    embassy_time_driver::time_driver_impl!(static CLOCK: Still = Still);
}
