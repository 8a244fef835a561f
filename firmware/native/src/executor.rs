//! embassy's time driver and two executors, for devices that are threads of a PC program.
//!
//! embassy's time driver is one symbol of the whole program, so this one keeps its clock per
//! thread: one device is one thread, many devices are many threads, and their clocks are
//! independent. A simulated device's time is virtual: it does not advance while any task can run,
//! and jumps to the next wake-up when none can ([`jump`]). An empty queue then means that the
//! device waits for something that cannot happen; this is reported as an error. A device with real
//! converters follows the computer's clock ([`advance_to`]). Wake-ups at the same time happen in
//! the order in which they were requested.
//!
//! There are two ways of polling the same futures, because results must not depend on the order of
//! polling: [`Polling::Join`] polls all of them in order, [`Polling::Tasks`] runs each as a task of
//! embassy's own raw executor, as a board does.
#![allow(
    unsafe_code,
    reason = "the time driver, the pender and the raw executor's poll are unsafe symbols of embassy"
)]

use std::cell::{Cell, RefCell};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::task::{Context, Wake, Waker};

use embassy_executor::raw::{Executor, TaskStorage};

use crate::sync::AtomicBool;

/// A requested wake-up.
struct Alarm {
    at_us: u64,
    sequence: u64,
    waker: Waker,
}

impl PartialEq for Alarm {
    fn eq(&self, other: &Self) -> bool {
        (self.at_us, self.sequence) == (other.at_us, other.sequence)
    }
}

impl Eq for Alarm {}

impl PartialOrd for Alarm {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Alarm {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        (self.at_us, self.sequence).cmp(&(other.at_us, other.sequence))
    }
}

thread_local! {
    static NOW_US: Cell<u64> = const { Cell::new(0) };
    static ASKED: Cell<u64> = const { Cell::new(0) };
    static ALARMS: RefCell<BinaryHeap<Reverse<Alarm>>> = const { RefCell::new(BinaryHeap::new()) };
}

struct ThreadTime;

impl embassy_time_driver::Driver for ThreadTime {
    fn now(&self) -> u64 {
        NOW_US.get()
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        ALARMS.with_borrow_mut(|alarms| {
            // a future that is polled again requests the same wake-up again
            if alarms.iter().any(|Reverse(alarm)| alarm.at_us == at && alarm.waker.will_wake(waker)) {
                return;
            }
            ASKED.set(ASKED.get() + 1);
            alarms.push(Reverse(Alarm { at_us: at, sequence: ASKED.get(), waker: waker.clone() }));
        });
    }
}

embassy_time_driver::time_driver_impl!(static DRIVER: ThreadTime = ThreadTime);

/// Jumps to the next wake-up of this thread's clock. `false` when there is none.
pub fn jump() -> bool {
    ALARMS.with_borrow_mut(|alarms| {
        let Some(Reverse(next)) = alarms.pop() else { return false };
        NOW_US.set(NOW_US.get().max(next.at_us));
        next.waker.wake();
        wake_due(alarms);
        true
    })
}

/// Advances this thread's clock to `now_us`, and wakes what is due by then. The clock never goes
/// back.
pub fn advance_to(now_us: u64) {
    NOW_US.set(NOW_US.get().max(now_us));
    ALARMS.with_borrow_mut(wake_due);
}

/// Wakes everything whose time has come, in order.
fn wake_due(alarms: &mut BinaryHeap<Reverse<Alarm>>) {
    while alarms.peek().is_some_and(|Reverse(alarm)| alarm.at_us <= NOW_US.get()) {
        if let Some(Reverse(alarm)) = alarms.pop() {
            alarm.waker.wake();
        }
    }
}

/// Time of the next wake-up of this thread's clock, µs.
pub fn next_alarm_us() -> Option<u64> {
    ALARMS.with_borrow(|alarms| alarms.peek().map(|Reverse(alarm)| alarm.at_us))
}

/// This thread's time, µs.
pub fn now_us() -> u64 {
    NOW_US.get()
}

/// Set when a future can continue. Shared with the wakers, which other threads may use.
#[derive(Debug, Default)]
pub struct Woken(AtomicBool);

impl Woken {
    /// Whether something was woken since the last call.
    pub fn take(&self) -> bool {
        self.0.swap(false, Ordering::AcqRel)
    }

    /// Whether something was woken, without clearing the flag.
    pub fn peek(&self) -> bool {
        self.0.load(Ordering::Acquire)
    }

    fn set(&self) {
        self.0.store(true, Ordering::Release);
    }
}

impl Wake for Woken {
    fn wake(self: Arc<Self>) {
        self.set();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        self.set();
    }
}

/// embassy's executor calls this when one of its tasks was woken, from any thread.
#[unsafe(export_name = "__pender")]
fn pender(context: *mut ()) {
    // SAFETY: the only executors of this program are made by `Tasks::new`, which passes a pointer
    // to a `Woken` that is leaked and so never freed; `Woken` is atomic and may be used from any
    // thread.
    let woken = unsafe { &*context.cast::<Woken>() };
    woken.set();
}

/// The order in which a device's futures are polled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Polling {
    /// All of them in order, whenever any was woken.
    #[default]
    Join,
    /// Each as a task of embassy's raw executor, when it was woken itself.
    Tasks,
}

/// A set of endless futures of one device, and a way to poll them.
pub enum Poller {
    /// Polled in order.
    Join {
        /// The futures.
        futures: Vec<Pin<Box<dyn Future<Output = ()>>>>,
        /// Wakes all of them.
        waker: Waker,
    },
    /// Polled by embassy.
    Tasks(&'static Executor),
}

impl Poller {
    /// Takes the futures of one device. With [`Polling::Tasks`], executor and tasks are leaked:
    /// embassy requires `'static`, so the device's futures remain in memory until the program ends.
    ///
    /// # Panics
    /// Never: a newly created task storage is free.
    pub fn new(
        polling: Polling,
        futures: Vec<Pin<Box<dyn Future<Output = ()>>>>,
        woken: &Arc<Woken>,
    ) -> Self {
        woken.set();
        match polling {
            Polling::Join => Self::Join { futures, waker: Waker::from(Arc::clone(woken)) },
            Polling::Tasks => {
                let context = Arc::into_raw(Arc::clone(woken)).cast_mut().cast::<()>();
                let executor: &'static Executor = Box::leak(Box::new(Executor::new(context)));
                for future in futures {
                    let storage: &'static TaskStorage<_> = Box::leak(Box::new(TaskStorage::new()));
                    // a new storage holds no task yet
                    let token = storage.spawn(|| future).expect("a fresh task storage is free");
                    executor.spawner().spawn(token);
                }
                Self::Tasks(executor)
            }
        }
    }

    /// Polls once; the flag indicates whether to poll again.
    pub fn poll(&mut self) {
        match self {
            Self::Join { futures, waker } => {
                let mut context = Context::from_waker(waker);
                for future in futures {
                    // the futures never end
                    let _ = future.as_mut().poll(&mut context);
                }
            }
            // SAFETY: this executor is polled only here, by the thread that created it, and never
            // from within one of its own tasks.
            Self::Tasks(executor) => unsafe { executor.poll() },
        }
    }
}
