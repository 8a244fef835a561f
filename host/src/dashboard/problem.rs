//! Error responses: what is wrong, where, and what to do.

use super::guard::Refusal;
use crate::campaign::store::error::StoreError;
use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use serde_json::json;

/// Why a request could not be answered.
pub struct Problem {
    status: StatusCode,
    what: String,
    todo: &'static str,
}

impl Problem {
    /// A problem with this status.
    pub fn new(status: StatusCode, what: impl Into<String>, todo: &'static str) -> Self {
        Self { status, what: what.into(), todo }
    }

    /// A problem with status 404, not found.
    pub fn missing(what: &str) -> Self {
        Self::new(StatusCode::NOT_FOUND, what, "go back to the page")
    }
}

impl From<Refusal> for Problem {
    fn from(refusal: Refusal) -> Self {
        let [what, todo] = refusal.words();
        Self::new(refusal.status(), what, todo)
    }
}

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        Self::new(StatusCode::NOT_FOUND, error.to_string(), "look at the campaign file")
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let body =
            json!({ "error": { "what": self.what, "where": "the live page's server", "do": self.todo } });
        (self.status, Json(body)).into_response()
    }
}
