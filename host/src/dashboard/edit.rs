//! Changes that a page may request: notes and verdicts, through the only writer of the campaign
//! file; the end of the measurement after the current shot; and, with `--allow-control`, answers to
//! the prompts to move hammer and laser. No page arms the hammer or moves the shaker.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::extract::State;
use axum::extract::rejection::JsonRejection;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use axum::routing::post;
use axum::{Json, Router};
use serde::Deserialize;
use serde_json::json;
use tokio::sync::oneshot;

use super::Problem;
use super::Shared;
use crate::campaign::run::answers::{Answerer, Key, Question};
use crate::campaign::run::answers::{Edit, EditQueue, NotTaken};
use crate::campaign::verdict::Verdict;
use crate::live::message::Message;
use crate::live::now::{Control, Doing};

/// A page keeps the right to answer for this long after its last message.
const LEASE: Duration = Duration::from_secs(10);
/// An edit that takes longer is completed later, because levels of the shaker take long.
const PATIENCE: Duration = Duration::from_secs(5);
/// Longest note or reason, characters.
const LONGEST: usize = 2_000;
/// Longest name of a page, characters.
const NAME: usize = 64;

/// What the measuring process lets pages do.
pub struct Controls {
    /// Receives edits.
    pub edit_queue: Option<EditQueue>,
    /// Receives answers to the prompts to move hammer and laser.
    pub answerer: Option<Answerer>,
    /// Ends the measurement after the current shot.
    pub stop: Arc<AtomicBool>,
    /// The page that may answer, and the time of its last message.
    pub lease: Mutex<Option<(String, Instant)>>,
}

/// Routes for changes.
pub fn routes() -> Router<Arc<Shared>> {
    Router::new()
        .route("/api/notes", post(note))
        .route("/api/keep", post(keep))
        .route("/api/drop", post(leave_out))
        .route("/api/undo", post(undo))
        .route("/api/stop", post(stop))
        .route("/api/control", post(control))
        .route("/api/stage", post(stage))
}

type EditRequest<T> = Result<Json<T>, JsonRejection>;

/// The request's content, or why it cannot be read.
fn read<T>(asked: EditRequest<T>) -> Result<T, Problem> {
    match asked {
        Ok(Json(asked)) => Ok(asked),
        Err(wrong) => Err(Problem::new(wrong.status(), wrong.body_text(), "send what docs/live.md says")),
    }
}

impl Shared {
    fn controls(&self) -> Result<&Controls, Problem> {
        self.controls.as_ref().ok_or_else(|| {
            let what = "this server is read-only: nothing is measured in its process";
            Problem::new(StatusCode::FORBIDDEN, what, "use `jointrig campaign keep` and `campaign drop`")
        })
    }

    /// Ends a page's right to answer when it has been silent for too long.
    pub fn end_lease(&self) {
        let Some(controls) = &self.controls else { return };
        let mut lease = controls.lease.lock().unwrap_or_else(PoisonError::into_inner);
        if lease.take_if(|(_, last_contact)| last_contact.elapsed() > LEASE).is_some() {
            self.bus.say(Message::Control(Control { page: None }));
        }
    }
}

/// Submits an edit and waits briefly for its result.
async fn handed_in(shared: &Shared, edit: Edit) -> Result<Response, Problem> {
    let controls = shared.controls()?;
    let edit_queue =
        controls.edit_queue.as_ref().ok_or_else(|| Problem::missing("no campaign is measured here"))?;
    let (to, told) = oneshot::channel();
    let taken = edit_queue.hand_in(edit, move |what| {
        // the page may have disconnected
        let _ = to.send(what);
    });
    match taken {
        Ok(()) => {}
        Err(NotTaken::Busy) => {
            let what = "too many changes are waiting already";
            return Err(Problem::new(StatusCode::TOO_MANY_REQUESTS, what, "try again in a moment"));
        }
        Err(NotTaken::Over) => return Err(over()),
    }
    match tokio::time::timeout(PATIENCE, told).await {
        Ok(Ok(Ok(done))) => Ok(Json(json!({ "done": done })).into_response()),
        Ok(Ok(Err(wrong))) => Err(Problem::new(StatusCode::CONFLICT, wrong, "look at the log")),
        Ok(Err(_)) => Err(over()),
        Err(_) => {
            let later = json!({ "later": "it will be written as soon as the measuring process can do so" });
            Ok((StatusCode::ACCEPTED, Json(later)).into_response())
        }
    }
}

fn over() -> Problem {
    let what = "nothing is measured any more";
    Problem::new(StatusCode::CONFLICT, what, "use `jointrig campaign keep` and `campaign drop`")
}

/// Joins a text into one line; refuses an empty or too long one.
fn text(given: &str) -> Result<String, Problem> {
    let text = given.split_whitespace().collect::<Vec<_>>().join(" ");
    if text.is_empty() || text.chars().count() > LONGEST {
        let what = format!("a text must have 1 to {LONGEST} characters");
        return Err(Problem::new(StatusCode::UNPROCESSABLE_ENTITY, what, "write another one"));
    }
    Ok(text)
}

#[derive(Deserialize)]
struct Note {
    text: String,
}

async fn note(State(shared): State<Arc<Shared>>, asked: EditRequest<Note>) -> Result<Response, Problem> {
    let note = text(&read(asked)?.text)?;
    handed_in(&shared, Edit::Note(note)).await
}

#[derive(Deserialize)]
struct OverruleRequest {
    record: i64,
    reason: Option<String>,
}

async fn overrule(
    shared: &Shared,
    asked: EditRequest<OverruleRequest>,
    verdict: Verdict,
    otherwise: &str,
) -> Result<Response, Problem> {
    let OverruleRequest { record, reason } = read(asked)?;
    let reason = reason.as_deref().map_or_else(|| Ok(otherwise.to_owned()), text)?;
    handed_in(shared, Edit::Overrule { record, verdict, reason }).await
}

async fn keep(
    State(shared): State<Arc<Shared>>,
    asked: EditRequest<OverruleRequest>,
) -> Result<Response, Problem> {
    overrule(&shared, asked, Verdict::Good, "a person kept it on the live page").await
}

async fn leave_out(
    State(shared): State<Arc<Shared>>,
    asked: EditRequest<OverruleRequest>,
) -> Result<Response, Problem> {
    overrule(&shared, asked, Verdict::Dropped, "a person dropped it on the live page").await
}

async fn undo(
    State(shared): State<Arc<Shared>>,
    asked: EditRequest<OverruleRequest>,
) -> Result<Response, Problem> {
    let OverruleRequest { record, .. } = read(asked)?;
    handed_in(&shared, Edit::Undo { record }).await
}

async fn stop(State(shared): State<Arc<Shared>>) -> Result<Response, Problem> {
    shared.controls()?.stop.store(true, Ordering::Relaxed);
    let done = "measuring ends after the current shot; this is not an emergency stop";
    Ok(Json(json!({ "done": done })).into_response())
}

#[derive(Deserialize)]
struct Hold {
    page: String,
    hold: bool,
}

async fn control(State(shared): State<Arc<Shared>>, asked: EditRequest<Hold>) -> Result<Response, Problem> {
    let Hold { page, hold } = read(asked)?;
    let controls = shared.controls()?;
    allowed(controls)?;
    if page.is_empty() || page.chars().count() > NAME {
        let what = format!("a page's name must have 1 to {NAME} characters");
        return Err(Problem::new(StatusCode::UNPROCESSABLE_ENTITY, what, "choose another one"));
    }
    let mut lease = controls.lease.lock().unwrap_or_else(PoisonError::into_inner);
    let other = lease
        .as_ref()
        .is_some_and(|(holder, last_contact)| *holder != page && last_contact.elapsed() <= LEASE);
    if other {
        return Err(elsewhere());
    }
    let now = hold.then(|| (page, Instant::now()));
    let changed = now.as_ref().map(|(page, _)| page) != lease.as_ref().map(|(page, _)| page);
    *lease = now;
    if changed {
        let page = lease.as_ref().map(|(page, _)| page.clone());
        shared.bus.say(Message::Control(Control { page }));
    }
    Ok(Json(json!({ "done": if hold { "this page answers" } else { "no page answers" } })).into_response())
}

fn allowed(controls: &Controls) -> Result<&Answerer, Problem> {
    controls.answerer.as_ref().ok_or_else(|| {
        let what = "no page may answer for hammer and laser";
        Problem::new(StatusCode::FORBIDDEN, what, "answer at the terminal, or measure with --allow-control")
    })
}

fn elsewhere() -> Problem {
    Problem::new(StatusCode::CONFLICT, "another page answers", "press “let go” there, or wait ten seconds")
}

#[derive(Deserialize)]
struct StageAnswer {
    page: String,
    cell: i64,
    attempt: u32,
    answer: String,
}

async fn stage(
    State(shared): State<Arc<Shared>>,
    asked: EditRequest<StageAnswer>,
) -> Result<Response, Problem> {
    let StageAnswer { page, cell, attempt, answer } = read(asked)?;
    let controls = shared.controls()?;
    let answerer = allowed(controls)?;
    let key = match answer.as_str() {
        "in place" => Key::Accept,
        "redo" => Key::Redo,
        "skip" => Key::Skip,
        "back" => Key::Back,
        _ => {
            let what = format!("`{answer}` is not an answer");
            let todo = "send `in place`, `redo`, `skip` or `back`";
            return Err(Problem::new(StatusCode::UNPROCESSABLE_ENTITY, what, todo));
        }
    };
    {
        let lease = controls.lease.lock().unwrap_or_else(PoisonError::into_inner);
        if !lease
            .as_ref()
            .is_some_and(|(holder, last_contact)| *holder == page && last_contact.elapsed() <= LEASE)
        {
            return Err(elsewhere());
        }
    }
    let asks = shared.bus.state().filter(|state| state.what == Doing::MoveByHand);
    let current = asks.is_some_and(|state| state.cell == Some(cell) && state.attempt == attempt);
    if !(current && answerer.give(Question { cell, attempt }, key)) {
        let what = "this answers another question than the current one";
        return Err(Problem::new(StatusCode::CONFLICT, what, "read what the page asks, and answer that"));
    }
    Ok(Json(json!({ "done": answer })).into_response())
}
