//! Execution of each request.

use embassy_sync::blocking_mutex::raw::RawMutex;
use jointrig_protocol::answer::{Answer, Refusal, Status};
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::request::{Request, Stage as Place};
use nalgebra::Matrix3;

use crate::Core;
use crate::board::Stage;
use crate::ring::{CHANNEL_MAP, Range};
use crate::sentence::out_of_bounds;

impl<M: RawMutex> Core<'_, M> {
    /// Carries out a request that has not been carried out before.
    pub(crate) fn carry_out(&self, request: &Request, stage: &mut impl Stage) -> Result<Answer, Refusal> {
        match request {
            Request::Info => Ok(Answer::Info(self.info())),
            Request::Channel { index } => {
                let channel = self.facts.channels.get(usize::from(*index)).ok_or(Refusal::NoSuchChannel)?;
                Ok(Answer::Channel(channel.clone()))
            }
            Request::Status => Ok(Answer::Status(self.status())),
            Request::Start => self.start(),
            Request::Stop => {
                self.with(|state| {
                    state.bring_to_rest(Reason::StreamEnded);
                    state.streaming = false;
                });
                Ok(Answer::Done)
            }
            Request::Resend { epoch, first_scan, scans } => self.resend(*epoch, *first_scan, *scans),
            Request::Trigger(trigger) => {
                self.with(|state| state.hammer.set_trigger(*trigger)).map(|()| Answer::Done)
            }
            Request::LoadCells { matrix } => self.calibrate(matrix),
            Request::Arm { valid_ms } => self.arm(*valid_ms),
            Request::Disarm => {
                self.with(|state| state.disarm(Reason::Asked));
                Ok(Answer::Done)
            }
            Request::Fire(order) => {
                self.with(|state| {
                    state.may_strike()?;
                    state.hammer.fire(order)
                })?;
                Ok(Answer::Scheduled { number: order.number })
            }
            Request::Stage(place) => self.go(place, stage),
            Request::EmergencyStop => {
                self.with(crate::state::State::stop_everything);
                Ok(Answer::Done)
            }
            Request::Shake(order) => self.with(|state| {
                state.may_shake()?;
                let runs = state.shaker.shake(state.next_scan, order)?;
                state.tell_of_shaker(runs);
                Ok(Answer::Done)
            }),
            Request::Rest => self.with(|state| {
                let stops = state.shaker.stop(Reason::Asked);
                state.tell_of_shaker(stops);
                Ok(Answer::Done)
            }),
            Request::Scales { units_per_volt } => self
                .with(|state| state.take_scales(self.facts.channels, units_per_volt))
                .map(|()| Answer::Done),
            Request::Clock(clock) => self.ask_for_clock(*clock),
            Request::Sync => Ok(Answer::Sync(self.with(|state| state.in_step.now))),
            Request::Mark => self.ask_for_mark(),
            Request::Slow => Ok(Answer::Slow(self.with(|state| state.slow.clone()))),
        }
    }

    fn status(&self) -> Status {
        let channels = self.facts.channels.len();
        self.with(|state| Status {
            epoch: state.epoch,
            streaming: state.streaming,
            next_scan: state.next_scan,
            oldest_scan: state.ring.oldest_scan().unwrap_or(state.next_scan),
            hammer: state.hammer.state(),
            armed_for_ms: state.hammer.armed_for_ms(state.next_scan),
            interlock_closed: state.interlock_closed,
            emergency_stop: state.emergency_stop,
            friction_n: state.friction_of_last_block(channels),
            shot: state.hammer.shot(),
            shaker: state.shaker.state(),
            drive_v: state.shaker.amplitude_v(),
            controlled: state.shaker.controlled(),
            counters: state.counters,
        })
    }

    /// Starts a new stream with a new epoch; the scan index continues.
    fn start(&self) -> Result<Answer, Refusal> {
        let answer = self.with(|state| {
            if let Some(fault) = state.in_step.now.fault {
                return Err(Refusal::Clock(fault));
            }
            state.bring_to_rest(Reason::StreamEnded);
            // each device start has 65536 epochs; after that they run into the next start's range
            // instead of repeating
            state.epoch = (self.facts.boot << 16).wrapping_add(state.streams);
            state.streams = state.streams.wrapping_add(1);
            state.ring.restart(state.epoch);
            state.resends.clear();
            state.counters.scans_produced = 0;
            state.counters.scans_sent = 0;
            state.counters.scans_resent = 0;
            state.counters.scans_dropped = 0;
            state.counters.scans_missed = 0;
            state.acknowledged = state.next_scan;
            state.streaming = true;
            Ok(Answer::Started { epoch: state.epoch, map: CHANNEL_MAP, first_scan: state.next_scan })
        })?;
        self.may_run.signal(());
        Ok(answer)
    }

    fn resend(&self, epoch: u32, first_scan: u64, scans: u32) -> Result<Answer, Refusal> {
        self.with(|state| {
            if epoch != state.epoch {
                return Err(Refusal::WrongEpoch { current: state.epoch });
            }
            let oldest = state.ring.oldest_scan().ok_or(Refusal::NotStreaming)?;
            let end = first_scan.saturating_add(u64::from(scans)).min(state.next_scan);
            if first_scan < oldest {
                return Err(Refusal::Gone { oldest });
            }
            if first_scan >= end {
                return Err(out_of_bounds("no such scans have been produced yet"));
            }
            let range = Range { first_scan, scans: end - first_scan };
            // a full queue is refused; the host asks again
            state.resends.push_back(range).map_err(|_| Refusal::Busy)?;
            Ok(Answer::Resending { first_scan, scans: (end - first_scan) as u32 })
        })
    }

    fn calibrate(&self, matrix: &[f32; 9]) -> Result<Answer, Refusal> {
        if !matrix.iter().all(|entry| entry.is_finite()) {
            return Err(out_of_bounds("the load cells' calibration matrix must be finite"));
        }
        self.with(|state| {
            let friction = state.friction.as_mut().ok_or(Refusal::Unsupported)?;
            friction.calibrate(&Matrix3::from_row_slice(matrix));
            Ok(Answer::Done)
        })
    }

    fn arm(&self, valid_ms: u32) -> Result<Answer, Refusal> {
        self.with(|state| {
            state.may_strike()?;
            state.hammer.arm(state.next_scan, valid_ms)?;
            state.say(Event::Armed);
            Ok(Answer::Done)
        })
    }

    fn go<P: Stage>(&self, place: &Place, stage: &mut P) -> Result<Answer, Refusal> {
        use jointrig_protocol::answer::Hammer;
        if !P::PRESENT {
            return Err(Refusal::Unsupported);
        }
        self.with(|state| match state.hammer.state() {
            Hammer::Waiting | Hammer::Firing | Hammer::Listening => Err(Refusal::Busy),
            _ if state.shaker.moves() => Err(Refusal::ShakerRuns),
            _ => Ok(()),
        })?;
        stage.go(place)?;
        Ok(Answer::Staged { at_scan: self.with(|state| state.next_scan) })
    }
}
