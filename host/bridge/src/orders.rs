//! Lines back to a program whose output may fire a hammer: on its standard input, or over the
//! socket.
//!
//! | line | meaning |
//! |---|---|
//! | `{"armed": true}` | one pulse is allowed |
//! | `{"alive": true}` | every 0.2 s while armed |
//! | `{"fire_us": 3500, "sequence": 7}` | one pulse of so many µs, now |
//! | `{"armed": false}` | no pulse is allowed, and a running one ends |
//!
//! The firmware's state machine decides, as on the controller. A line states the whole pulse, never
//! its beginning or its end: hardware behind the program times it, because no program on a PC can.
//! The program allows one pulse for each arming, none without a line for 1 s, and none after the
//! end of its input. A pulse that other lines have followed is late and must not be executed; the
//! next line therefore comes 0.2 s after the order, or says that nothing is armed.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::{self, Write};
use std::rc::Rc;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use embassy_time::{Duration, Instant, Timer};
use jointrig_firmware::board::Coil;
use jointrig_native::link::DeviceEnd;
use jointrig_native::tasks::NativeCore;
use jointrig_protocol::answer;

use crate::header::Hammer;
use crate::queue::Queue;

/// Interval of the lines while armed.
const ALIVE_EVERY: Duration = Duration::from_millis(200);

/// Interval at which the hammer's state is read.
const TELL_EVERY: Duration = Duration::from_millis(20);

/// Lines that a program may leave unread beyond what its pipe holds.
const UNREAD: usize = 16;

/// The lines on their way to the program.
pub struct Orders {
    state: Mutex<Waiting>,
    changed: Condvar,
    queue: Arc<Queue>,
    link: DeviceEnd,
}

#[derive(Debug, Default)]
struct Waiting {
    lines: VecDeque<String>,
    closed: bool,
}

impl Orders {
    /// Writes to `to` in a thread of its own, so that a program that does not read stops nothing
    /// else. `to` is dropped when the orders are closed, which the program sees as the end of its
    /// input. If a line cannot be written, the device of this queue and link ends.
    ///
    /// # Errors
    /// The thread could not be started.
    pub fn start(
        to: impl Write + Send + 'static,
        queue: &Arc<Queue>,
        link: &DeviceEnd,
    ) -> io::Result<Arc<Self>> {
        let orders = Arc::new(Self {
            state: Mutex::default(),
            changed: Condvar::new(),
            queue: Arc::clone(queue),
            link: link.clone(),
        });
        let own = Arc::clone(&orders);
        std::thread::Builder::new().name("bridge orders".into()).spawn(move || {
            if let Err(error) = own.write_all(to) {
                own.fail(&error.to_string());
            }
        })?;
        Ok(orders)
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        // every change of the state is complete before anything can panic
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn write_all(&self, mut to: impl Write) -> io::Result<()> {
        loop {
            let mut state = self.lock();
            while state.lines.is_empty() && !state.closed {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
            let Some(line) = state.lines.pop_front() else { return Ok(()) };
            drop(state);
            to.write_all(line.as_bytes())?;
            to.flush()?;
        }
    }

    /// Ends the program's input after the lines that wait.
    pub fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    /// Ends the program's input and the device.
    fn fail(&self, why: &str) {
        let mut state = self.lock();
        // an order that is read late must not be executed
        state.lines.clear();
        if !std::mem::replace(&mut state.closed, true) {
            drop(state);
            self.changed.notify_all();
            self.queue.end(format!("it does not read the orders for its hammer: {why}"));
            self.queue.wake();
            self.link.nudge();
        }
    }

    fn add(&self, line: String) {
        let mut state = self.lock();
        if state.lines.len() >= UNREAD {
            drop(state);
            self.fail("its input is full");
        } else if !state.closed {
            state.lines.push_back(line);
            self.changed.notify_all();
        }
    }
}

/// What the program was told last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Told {
    Disarmed,
    Armed,
    /// Armed, and the one pulse was ordered.
    Fired,
}

/// The hammer's output, as the device's thread uses it.
pub(crate) struct Output {
    orders: Arc<Orders>,
    longest_us: u32,
    told: Told,
    sequence: u32,
    last_line: Instant,
}

impl Output {
    pub fn new(orders: &Arc<Orders>, hammer: Hammer) -> Self {
        Self {
            orders: Arc::clone(orders),
            longest_us: hammer.longest_us,
            told: Told::Disarmed,
            sequence: 0,
            last_line: Instant::from_ticks(0),
        }
    }

    fn line(&mut self, line: String, told: Told) {
        self.orders.add(line + "\n");
        self.told = told;
        self.last_line = Instant::now();
    }

    fn arm(&mut self) {
        self.line(r#"{"armed": true}"#.into(), Told::Armed);
    }

    pub fn disarm(&mut self) {
        if self.told != Told::Disarmed {
            self.line(r#"{"armed": false}"#.into(), Told::Disarmed);
        }
    }

    /// One pulse; the state machine was armed for it, which the program may not know yet.
    fn fire(&mut self, width_us: u32) {
        if self.told == Told::Fired {
            self.disarm();
        }
        if self.told == Told::Disarmed {
            self.arm();
        }
        self.sequence += 1;
        let (width_us, sequence) = (width_us.min(self.longest_us), self.sequence);
        self.line(format!(r#"{{"fire_us": {width_us}, "sequence": {sequence}}}"#), Told::Fired);
    }

    /// Tells the program the state of the hammer.
    fn tell(&mut self, state: answer::Hammer) {
        match state {
            answer::Hammer::Armed | answer::Hammer::Waiting => {
                if self.told == Told::Fired {
                    self.disarm();
                }
                if self.told == Told::Disarmed {
                    self.arm();
                }
            }
            // the coil may have been switched off meanwhile: nothing is armed again
            answer::Hammer::Firing => {}
            answer::Hammer::Disarmed | answer::Hammer::Listening | answer::Hammer::HoldOff => self.disarm(),
        }
        if self.told != Told::Disarmed && self.last_line.elapsed() >= ALIVE_EVERY {
            self.line(r#"{"alive": true}"#.into(), self.told);
        }
    }
}

/// Tells the program the state of the hammer for ever. It runs in the device's thread: if that
/// hangs, the program hears nothing and disarms.
pub(crate) async fn tell(core: Rc<NativeCore>, output: Rc<RefCell<Output>>) {
    loop {
        Timer::after(TELL_EVERY).await;
        output.borrow_mut().tell(core.hammer());
    }
}

/// The coil behind the program's output, if it has one.
pub(crate) struct OrderedCoil(pub Option<Rc<RefCell<Output>>>);

impl Coil for OrderedCoil {
    fn cap_us(&self) -> u32 {
        self.0.as_ref().map_or(0, |output| output.borrow().longest_us)
    }

    fn pulse(&mut self, width_us: u32) {
        if let Some(output) = &self.0 {
            output.borrow_mut().fire(width_us);
        }
    }

    fn off(&mut self) {
        if let Some(output) = &self.0 {
            output.borrow_mut().disarm();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::header::Header;
    use answer::Hammer as Is;
    use jointrig_native::executor::advance_to;
    use jointrig_native::link::pair;
    use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

    const HAMMER: Hammer = Hammer { longest_us: 5000, pause_ms: 600 };
    const ARMED: &str = r#"{"armed": true}"#;
    const ALIVE: &str = r#"{"alive": true}"#;
    const DISARMED: &str = r#"{"armed": false}"#;

    /// The program: takes one line at a time.
    struct Program(SyncSender<String>);

    impl Write for Program {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let line = String::from_utf8_lossy(bytes).trim_end().to_owned();
            self.0.send(line).map_err(|_| io::ErrorKind::BrokenPipe)?;
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn started(reads: usize) -> (Output, Arc<Orders>, Arc<Queue>, Receiver<String>) {
        let header = r#"{"jointrig_bridge":1,"board":"b","serial":"s","rate_hz":1000,"sample":"f32","channels":[{"name":"a","unit":"N","full_scale":50}]}"#;
        let queue = Arc::new(Queue::new(&Header::parse(header.as_bytes()).expect("good")));
        let (to, read) = sync_channel(reads);
        let orders = Orders::start(Program(to), &queue, &pair().1).expect("a thread");
        (Output::new(&orders, HAMMER), orders, queue, read)
    }

    /// Everything that the program reads until its input ends.
    fn all(orders: &Orders, read: &Receiver<String>) -> Vec<String> {
        orders.close();
        read.iter().collect()
    }

    #[test]
    fn each_pulse_has_an_arming_of_its_own_and_a_bounded_length() {
        let (mut output, orders, _, read) = started(99);
        output.tell(Is::Disarmed);
        output.tell(Is::Armed);
        output.tell(Is::Waiting);
        output.fire(3500);
        output.tell(Is::Firing);
        output.tell(Is::Listening);
        output.tell(Is::HoldOff);
        // armed and ordered between two looks at the state, and again before the next look
        output.fire(u32::MAX);
        output.fire(1);
        output.disarm();
        // switched off within the flight of the bolt: not armed again
        output.tell(Is::Firing);
        let fire = |width_us, sequence| format!(r#"{{"fire_us": {width_us}, "sequence": {sequence}}}"#);
        let (first, second, third) = (fire(3500, 1), fire(5000, 2), fire(1, 3));
        let wanted = [ARMED, &first, DISARMED, ARMED, &second, DISARMED, ARMED, &third, DISARMED];
        assert_eq!(all(&orders, &read), wanted);
    }

    #[test]
    fn lines_follow_each_other_while_armed_and_none_soon_after_an_order() {
        let (mut output, orders, _, read) = started(99);
        let mut at = |ms: u64, state| {
            advance_to(1000 * ms);
            output.tell(state);
        };
        at(1000, Is::Armed);
        (1..=20).for_each(|step| at(1000 + 20 * step, Is::Waiting));
        output.fire(100);
        // 0.4 s after the arming, the order is the last line
        (21..=31).for_each(|step| {
            advance_to(1000 * (1000 + 20 * step));
            output.tell(if step < 31 { Is::Firing } else { Is::HoldOff });
        });
        (32..=60).for_each(|step| {
            advance_to(1000 * (1000 + 20 * step));
            output.tell(Is::Disarmed);
        });
        let fire = r#"{"fire_us": 100, "sequence": 1}"#;
        assert_eq!(all(&orders, &read), [ARMED, ALIVE, ALIVE, fire, ALIVE, DISARMED]);
    }

    #[test]
    fn a_program_that_does_not_read_ends_the_device() {
        let (mut output, orders, queue, read) = started(0);
        for _ in 0..UNREAD + 2 {
            output.arm();
        }
        assert_eq!(
            queue.ended().expect("ended"),
            "it does not read the orders for its hammer: its input is full"
        );
        // of the lines that waited, only the one in the writer's hand is left
        assert!(all(&orders, &read).len() <= 1);

        let (mut output, _, queue, read) = started(0);
        drop(read);
        output.arm();
        while queue.ended().is_none() {
            std::thread::yield_now();
        }
        assert!(queue.ended().expect("ended").contains("broken pipe"), "{:?}", queue.ended());
    }
}
