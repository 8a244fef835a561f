//! Time as set by the simulator: embassy's time driver without a timer.

use core::cell::{Cell, RefCell};
use core::task::Waker;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time_driver::{Driver, time_driver_impl};
use embassy_time_queue_utils::Queue;

struct ToldTime {
    now_us: Mutex<CriticalSectionRawMutex, Cell<u64>>,
    alarms: Mutex<CriticalSectionRawMutex, RefCell<Queue>>,
}

impl Driver for ToldTime {
    fn now(&self) -> u64 {
        self.now_us.lock(Cell::get)
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        // the next alarm is queried whenever all tasks wait
        self.alarms.lock(|alarms| alarms.borrow_mut().schedule_wake(at, waker));
    }
}

time_driver_impl!(static DRIVER: ToldTime = ToldTime {
    now_us: Mutex::new(Cell::new(0)),
    alarms: Mutex::new(RefCell::new(Queue::new())),
});

/// Sets the time; it never goes backwards.
pub fn set(now_us: u64) {
    DRIVER.now_us.lock(|now| now.set(now.get().max(now_us)));
}

/// Wakes the tasks whose alarms are due and returns the instant of the next one.
pub fn next_alarm() -> u64 {
    let now = DRIVER.now();
    DRIVER.alarms.lock(|alarms| alarms.borrow_mut().next_expiration(now))
}
