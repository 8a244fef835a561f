//! Execution of each request.

use embassy_sync::blocking_mutex::raw::RawMutex;
use jointrig_protocol::answer::{Answer, Refusal};
use jointrig_protocol::event::Reason;
use jointrig_protocol::request::{Request, Stage as Place};

use crate::Core;
use crate::board::Stage;
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
            Request::Status => Ok(Answer::Status(self.with(|state| state.status(self.facts.channels.len())))),
            Request::Start => self.start(),
            Request::Stop => {
                self.with(|state| state.safety().end_stream(Reason::StreamEnded));
                Ok(Answer::Done)
            }
            Request::Resend { epoch, first_scan, scans } => {
                self.with(|state| state.resend(*epoch, *first_scan, *scans))
            }
            Request::Trigger(trigger) => {
                self.with(|state| state.safety().set_trigger(*trigger)).map(|()| Answer::Done)
            }
            Request::LoadCells { matrix } => self.calibrate(matrix),
            Request::Arm { valid_ms } => {
                self.with(|state| state.safety().arm(*valid_ms)).map(|()| Answer::Done)
            }
            Request::Disarm => {
                self.with(|state| state.safety().disarm(Reason::Asked));
                Ok(Answer::Done)
            }
            Request::Fire(order) => {
                self.with(|state| state.safety().fire(order))?;
                Ok(Answer::Scheduled { number: order.number })
            }
            Request::Stage(place) => self.go(place, stage),
            Request::EmergencyStop => {
                self.with(|state| state.safety().stop_everything());
                Ok(Answer::Done)
            }
            Request::Shake(order) => self.with(|state| state.safety().shake(order)).map(|()| Answer::Done),
            Request::Rest => {
                self.with(|state| state.safety().ramp_down(Reason::Asked));
                Ok(Answer::Done)
            }
            Request::Scales { units_per_volt } => self
                .with(|state| state.take_scales(self.facts.channels, units_per_volt))
                .map(|()| Answer::Done),
            Request::Clock(clock) => self.ask_for_clock(*clock),
            Request::Sync => Ok(Answer::Sync(self.with(|state| state.in_step().now()))),
            Request::Mark => self.ask_for_mark(),
            Request::Slow => Ok(Answer::Slow(self.with(|state| state.safety().slow().clone()))),
        }
    }

    fn start(&self) -> Result<Answer, Refusal> {
        let answer = self.with(|state| state.start_stream(self.facts.boot))?;
        self.may_run.signal(());
        Ok(answer)
    }

    fn calibrate(&self, matrix: &[f32; 9]) -> Result<Answer, Refusal> {
        if !matrix.iter().all(|entry| entry.is_finite()) {
            return Err(out_of_bounds("the load cells' calibration matrix must be finite"));
        }
        self.with(|state| state.calibrate(matrix)).map(|()| Answer::Done)
    }

    fn go<P: Stage>(&self, place: &Place, stage: &mut P) -> Result<Answer, Refusal> {
        if !P::PRESENT {
            return Err(Refusal::Unsupported);
        }
        self.with(|state| state.safety().may_be_positioned())?;
        stage.go(place)?;
        Ok(Answer::Staged { at_scan: self.with(|state| state.safety().next_scan()) })
    }
}
