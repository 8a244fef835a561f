//! The device: the firmware's core over the scans of the queue, in a thread.
//!
//! A bridge has no drive and no stage. It has a coil only if the program announces one
//! ([`crate::orders`]); otherwise the longest coil pulse is 0 µs, the guard counts as open, and
//! every order to move something is refused. With a coil the guard counts as closed: no input of
//! the bridge knows it, so guard and emergency stop must cut the coil's supply (docs/safety.md).

use std::cell::RefCell;
use std::io::{BufReader, Read, Write};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use heapless::String as Text;
use jointrig_firmware::board::{Inputs, NoDrive, NoStage};
use jointrig_firmware::ring::Slot;
use jointrig_firmware::{Core, Facts};
use jointrig_native::executor::{Poller, Polling, Woken};
use jointrig_native::link::{DeviceEnd, HostEnd, pair};
use jointrig_native::tasks::{NativeCore, Parts, run_by_the_clock};
use jointrig_protocol::answer::Reset;
use jointrig_protocol::channel::words_per_scan;
use jointrig_protocol::limits::scans_per_block;

use crate::header::{Header, HeaderError};
use crate::orders::{OrderedCoil, Orders, Output, tell};
use crate::queue::{Queue, QueuedScans, read_stream};

/// Duration of the scans that can be sent again, s. A person who strikes waits for half of it
/// after "in place".
const RING_S: f64 = 1.0;

/// Added to the pause between two pulses, ms: the state machine counts scans, which arrive in
/// blocks, and the program counts the time between two orders.
const PAUSE_MARGIN_MS: u32 = 200;

/// Bounds of the scans that a host accepts for it.
const RING_SCANS: (u64, u64) = (256, 1 << 20);

/// Why a stream did not become a device.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Its header is missing or refused.
    #[error(transparent)]
    Header(#[from] HeaderError),
    /// No header came.
    #[error("it wrote no header within {0} s")]
    Silent(u64),
    /// A thread could not be created.
    #[error("no thread could be started for it: {0}")]
    Thread(#[from] std::io::Error),
}

/// A running device. Dropping it stops it. The owner of the source closes that first, so that the
/// thread that reads it ends too.
pub struct Bridge {
    header: Header,
    queue: Arc<Queue>,
    orders: Arc<Orders>,
    link: DeviceEnd,
    thread: Option<JoinHandle<()>>,
}

impl Bridge {
    /// Reads the header of `source`, waiting for at most `patience`, and starts the device, which
    /// writes its orders for a hammer to `input`. That is the input of the program, and is dropped
    /// with the device or by [`Self::end_input`].
    ///
    /// # Errors
    /// [`OpenError`]. The thread that reads the source then ends when the source does.
    pub fn open(
        source: impl Read + Send + 'static,
        input: impl Write + Send + 'static,
        patience: Duration,
    ) -> Result<(Self, HostEnd), OpenError> {
        let (host, device) = pair();
        let (sender, opened) = sync_channel(1);
        std::thread::Builder::new().name("bridge reader".into()).spawn({
            let link = device.clone();
            move || {
                let mut source = BufReader::with_capacity(1 << 16, source);
                let header = match Header::read(&mut source) {
                    Ok(header) => header,
                    Err(error) => return drop(sender.send(Err(error))),
                };
                let queue = Arc::new(Queue::new(&header));
                if sender.send(Ok((header.clone(), Arc::clone(&queue)))).is_ok() {
                    read_stream(&header, source, &queue, &link);
                }
            }
        })?;
        let (header, queue) = match opened.recv_timeout(patience) {
            Ok(opened) => opened?,
            Err(RecvTimeoutError::Timeout) => return Err(OpenError::Silent(patience.as_secs())),
            Err(RecvTimeoutError::Disconnected) => return Err(HeaderError::Ended.into()),
        };
        let orders = Orders::start(input, &queue, &device)?;
        let thread = std::thread::Builder::new().name("bridge".into()).spawn({
            let (header, queue, link) = (header.clone(), Arc::clone(&queue), device.clone());
            let orders = Arc::clone(&orders);
            move || run(&header, &queue, &orders, &link)
        })?;
        Ok((Self { header, queue, orders, link: device, thread: Some(thread) }, host))
    }

    /// The recorder and its channels.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Why no more scans come, once they do not.
    pub fn ended(&self) -> Option<String> {
        self.queue.ended()
    }

    /// Sentences about the recorder since the last call: a wrong full scale, an overrun, a wrong
    /// rate.
    pub fn take_remarks(&self) -> Vec<String> {
        self.queue.take_remarks()
    }

    /// Ends the input of the program: its hammer is disarmed, and it should end.
    pub fn end_input(&self) {
        self.orders.close();
    }

    /// Scans of the longest block so far: a scan may have been sampled by so much before it
    /// arrives.
    pub fn longest_block(&self) -> u32 {
        self.queue.longest_block()
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.queue.close();
        self.link.close();
        if let Some(thread) = self.thread.take() {
            // the device's own thread has already printed a panic
            let _ = thread.join();
        }
        self.orders.close();
    }
}

/// The device's thread.
fn run(header: &Header, queue: &Arc<Queue>, orders: &Arc<Orders>, link: &DeviceEnd) {
    // leaked like the ring: a program opens few devices, and the firmware's tables are constant
    let channels: &'static [_] = Box::leak(header.channels.clone().into_boxed_slice());
    let per_block = scans_per_block(words_per_scan(channels)).unwrap_or(1) as u64;
    let ring = ((RING_S * header.rate_hz) as u64).clamp(RING_SCANS.0, RING_SCANS.1 - per_block);
    let slots = vec![Slot::EMPTY; ring.div_ceil(per_block) as usize].into_boxed_slice();
    let facts = Facts {
        board: header.board.clone(),
        serial: header.serial.clone(),
        target: text(jointrig_native::TARGET),
        build: 0,
        // the core counts scans; where it needs a time, the nearest integer is close enough
        scan_rate_hz: header.rate_hz.round() as u32,
        channels,
        coil_cap_us: header.hammer.map_or(0, |hammer| hammer.longest_us),
        stage: false,
        drive_v: 0.0,
        sync: false,
        reset: Reset::Unknown,
        boot: seconds_since_1970(),
    };
    let core = Core::new(facts, Box::leak(slots));
    let core: Rc<NativeCore> = Rc::new(match header.hammer {
        Some(hammer) => core.with_coil_pause(hammer.pause_ms + PAUSE_MARGIN_MS),
        None => core,
    });
    let output = header.hammer.map(|hammer| Rc::new(RefCell::new(Output::new(orders, hammer))));
    let parts = Parts {
        scans: QueuedScans::new(queue, link),
        coil: OrderedCoil(output.clone()),
        drive: NoDrive,
        inputs: UnknownGuard { closed: output.is_some() },
        stage: NoStage,
    };
    let woken = Arc::new(Woken::default());
    let mut tasks = parts.tasks(&core, link);
    if let Some(output) = &output {
        tasks.push(Box::pin(tell(Rc::clone(&core), Rc::clone(output))));
    }
    let mut poller = Poller::new(Polling::Join, tasks, &woken);
    run_by_the_clock(&mut poller, &woken, link);
    if let Some(output) = output {
        output.borrow_mut().disarm();
    }
}

/// A number that no earlier start had.
fn seconds_since_1970() -> u32 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs() as u32)
}

/// Truncates `value` to N characters.
fn text<const N: usize>(value: &str) -> Text<N> {
    value.chars().take(N).collect()
}

/// No input knows the guard.
struct UnknownGuard {
    closed: bool,
}

impl Inputs for UnknownGuard {
    fn interlock_closed(&mut self) -> bool {
        self.closed
    }

    fn emergency_stop(&mut self) -> bool {
        false
    }

    fn local_reset(&mut self) -> bool {
        false
    }
}
