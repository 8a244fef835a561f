//! The four tasks of the firmware over a board's parts, and running them by the clock.

use std::pin::Pin;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use jointrig_firmware::Core;
use jointrig_firmware::board::{ByteSink, ByteSource, Coil, Drive, Inputs, Scans, Stage};

use crate::executor::{Poller, Woken, advance_to, next_alarm_us};
use crate::link::DeviceEnd;

/// The firmware's state on a PC: all tasks run in one thread, so nothing is locked.
pub type NativeCore = Core<'static, NoopRawMutex>;

/// An endless task of a device.
pub type Task = Pin<Box<dyn Future<Output = ()>>>;

/// The parts of a board on a PC, each of which one task uses.
pub struct Parts<S, C, D, I, P> {
    /// The converters.
    pub scans: S,
    /// The hammer's coil.
    pub coil: C,
    /// The shaker's drive.
    pub drive: D,
    /// Interlock and emergency stop.
    pub inputs: I,
    /// Positions hammer and laser.
    pub stage: P,
}

impl<S, C, D, I, P> Parts<S, C, D, I, P>
where
    S: Scans + 'static,
    C: Coil + 'static,
    D: Drive + 'static,
    I: Inputs + 'static,
    P: Stage + 'static,
{
    /// The four tasks over these parts and `link`.
    pub fn tasks(self, core: &Rc<NativeCore>, link: &DeviceEnd) -> Vec<Task> {
        let Self { mut scans, mut coil, mut drive, mut inputs, mut stage } = self;
        let (mut source, mut sink) = (link.clone(), link.clone());
        let [a, b, c, d] = [core, core, core, core].map(Rc::clone);
        vec![
            Box::pin(async move {
                jointrig_firmware::acquire::acquire(&a, &mut scans, &mut coil, &mut drive, &mut inputs).await;
            }),
            Box::pin(async move { receive(&b, &mut source, &mut stage).await }),
            Box::pin(async move { transmit(&c, &mut sink).await }),
            Box::pin(async move {
                jointrig_firmware::watch::watch(&d).await;
            }),
        ]
    }
}

async fn receive(core: &NativeCore, source: &mut impl ByteSource, stage: &mut impl Stage) {
    jointrig_firmware::receive::receive(core, source, stage).await;
}

async fn transmit(core: &NativeCore, sink: &mut impl ByteSink) {
    jointrig_firmware::transmit::transmit(core, sink).await;
}

/// Runs the tasks of a device by the clock until its link is closed: an alarm is due when its time
/// has come, and the thread sleeps in between.
///
/// Whatever wakes a task from another thread must call [`DeviceEnd::nudge`] afterwards.
pub fn run_by_the_clock(poller: &mut Poller, woken: &Arc<Woken>, link: &DeviceEnd) {
    let begun = Instant::now();
    while !link.is_closed() {
        while woken.take() {
            poller.poll();
        }
        let now_us = begun.elapsed().as_micros() as u64;
        advance_to(now_us);
        // Without an alarm the device sleeps until it is woken; the watchdog's task always has one.
        let due_us = next_alarm_us().unwrap_or(u64::MAX).saturating_sub(now_us);
        link.sleep_for(woken, Duration::from_micros(due_us.min(1_000_000)));
    }
}
