//! Receiving: finds frames in the incoming bytes and carries out their requests.

use crate::Core;
use crate::board::{ByteSource, Stage};
use crate::fmt::{info, warning};
use crate::sentence::out_of_bounds;
use crate::state::{Seen, State};
use embassy_sync::blocking_mutex::raw::RawMutex;
use jointrig_protocol::acknowledge::Acknowledge;
use jointrig_protocol::answer::{Answer, Numbered, Refusal};
use jointrig_protocol::event::Reason;
use jointrig_protocol::frame::{Accumulator, Frame, Kind};
use jointrig_protocol::hello::{Hello, Role};
use jointrig_protocol::request;
use jointrig_protocol::request::{Request, Stage as Place};

/// Runs forever.
pub async fn receive<M: RawMutex, S: ByteSource, P: Stage>(
    core: &Core<'_, M>,
    source: &mut S,
    stage: &mut P,
) -> ! {
    let mut accumulator = Accumulator::new();
    let mut bytes = [0; 512];
    loop {
        let read = source.read(&mut bytes).await;
        if read == 0 {
            accumulator = Accumulator::new();
            core.link_is_cut();
            continue;
        }
        let mut rest = &bytes[..read];
        while !rest.is_empty() {
            let (used, found) = accumulator.feed(rest);
            match found {
                Some(Ok(frame)) => core.hear(&frame, stage),
                Some(Err(_)) => core.with(State::count_bad_frame),
                None => {}
            }
            rest = &rest[used..];
        }
    }
}

impl<M: RawMutex> Core<'_, M> {
    /// Call when the link is cut: its host can no longer cancel its requests, so everything that
    /// moves comes to rest. For a board that detects this by means other than its byte source.
    pub fn link_is_cut(&self) {
        self.with(|state| state.safety().bring_to_rest(Reason::LinkLost));
        self.to_send.signal(());
    }

    /// Processes one valid frame from the host.
    fn hear(&self, frame: &Frame<'_>, stage: &mut impl Stage) {
        self.with(State::hear_frame);
        match frame.kind {
            Kind::Hello => self.greet(frame.payload),
            Kind::Request => self.hear_request(frame.payload, stage),
            Kind::Acknowledge => self.hear_acknowledge(frame.payload),
            // kinds that only a device sends, from a faulty host
            Kind::Answer | Kind::Event | Kind::Samples | Kind::Log => {
                self.with(State::count_bad_frame);
            }
        }
    }

    /// Replies to any Hello of a host, so that even an incompatible host can report both versions;
    /// establishes a session only when they match. A new session discards the requests of the old
    /// one and stops its actions.
    pub(crate) fn greet(&self, payload: &[u8]) {
        let Ok(theirs) = Hello::from_bytes(payload) else {
            self.with(State::count_bad_frame);
            return;
        };
        let ours = Hello::device(theirs.session, self.facts.boot, 0);
        let agreed = theirs.role == Role::Host && ours.check(&theirs).is_ok();
        self.with(|state| {
            state.owe_hello(theirs.session);
            if agreed && state.session() == Some(theirs.session) {
                return;
            }
            let session = agreed.then_some(theirs.session);
            state.begin_session(session, agreed && theirs.packets, self.facts.channels);
            if agreed {
                info!("session {}", theirs.session);
            } else {
                warning!("a host of another version was refused");
            }
        });
        self.to_send.signal(());
    }

    fn hear_acknowledge(&self, payload: &[u8]) {
        let Some(acknowledge) = Acknowledge::from_bytes(payload) else {
            self.with(State::count_bad_frame);
            return;
        };
        self.with(|state| state.acknowledge(&acknowledge));
        self.may_run.signal(());
    }

    fn hear_request(&self, payload: &[u8], stage: &mut impl Stage) {
        if self.with(|state| state.session().is_none()) {
            // before the handshake, requests are ignored
            return;
        }
        let request = match request::Numbered::read(payload) {
            Ok(request) => request,
            Err(unreadable) => {
                if let Some(number) = unreadable.0 {
                    self.answer(Numbered { number, outcome: Err(Refusal::Unreadable) });
                }
                return;
            }
        };
        let answer = match self.with(|state| state.recall(request.number)) {
            Seen::Before(answer) => answer,
            Seen::Stale => Numbered { number: request.number, outcome: Err(Refusal::Stale) },
            Seen::New => {
                let answer =
                    Numbered { number: request.number, outcome: self.carry_out(&request.request, stage) };
                self.with(|state| state.remember(&answer));
                answer
            }
        };
        self.answer(answer);
    }

    fn answer(&self, answer: Numbered) {
        self.with(|state| state.queue_answer(answer));
        self.to_send.signal(());
    }
}

impl<M: RawMutex> Core<'_, M> {
    /// Carries out a request that has not been carried out before.
    pub(crate) fn carry_out(&self, request: &Request, stage: &mut impl Stage) -> Result<Answer, Refusal> {
        match request {
            Request::Info => Ok(Answer::Info(self.info())),
            Request::Channel { index } => {
                let channel = self.facts.channels.get(usize::from(*index)).ok_or(Refusal::NoSuchChannel)?;
                Ok(Answer::Channel(channel.clone()))
            }
            Request::Status => Ok(Answer::Status(self.with(|state| state.status(self.words)))),
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
