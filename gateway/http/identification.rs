//! `GET /api/v1/identified/{subject}`: what `identify tool-wear` and `identify thermal` have found, for the tables beside the figures.
//!
//! `identify` and `commission --write` keep these answers: see [`gateway_commission::identification`].

use super::ServerState;
use super::blocking::run_blocking;
use super::problem::ApiProblem;
use super::route::Route;
use axum::Json;
use axum::extract::{Path, State};
use axum::routing::get;
use gateway_base::files::read_text;
use gateway_commission::identification::{SUBJECTS, answer_path};
use serde_json::{Value, json};

/// Such a document is some ten kilobytes.
const BYTES_MAX: usize = 4 << 20;

pub(super) const ROUTES: &[Route] = &[Route::read("/api/v1/identified/{subject}", || get(serve_identified))];

async fn serve_identified(
    State(shared): State<ServerState>,
    Path(subject): Path<String>,
) -> Result<Json<Value>, ApiProblem> {
    if !SUBJECTS.contains(&subject.as_str()) {
        return Err(ApiProblem::not_found(&format!("/api/v1/identified/{subject}; known are {}", SUBJECTS.join(", "))));
    }
    run_blocking(move || {
        let path = answer_path(&shared.data_dir, &subject);
        let found = match read_text(&path, BYTES_MAX) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Value::Null,
            Err(error) => {
                return Err(ApiProblem::unavailable(format!("{}: {error}", path.display()), "look at the file"));
            }
            Ok(text) => serde_json::from_str(&text).map_err(|error| {
                let next = "write it anew with `cnc-gateway identify ... --data-dir DIR`";
                ApiProblem::unavailable(format!("{} is not JSON: {error}", path.display()), next)
            })?,
        };
        Ok(Json(json!({ "schema": "identified/1", "file": path.display().to_string(), "identified": found })))
    })
    .await
}
