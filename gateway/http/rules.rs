//! `GET /api/v1/rules`: the scripts as they are on disk, and the words that they may use.

use super::Shared;
use super::problem::ApiProblem;
use crate::reload::{digest, read_directory};
use axum::Json;
use axum::extract::State;
use rules::script;
use serde_json::{Value, json};

/// `GET /api/v1/rules`
pub(super) async fn rules(State(shared): State<Shared>) -> Result<Json<Value>, ApiProblem> {
    let directory = shared.scripts.clone();
    let read = tokio::task::spawn_blocking(move || read_directory(&directory)).await;
    let unreadable = |what: String| ApiProblem::unavailable(what, "look at [scripts] directory in the configuration");
    let files = read.map_err(|_| unreadable("the scripts cannot be read".to_owned()))?;
    let files = files
        .map_err(|problems| unreadable(problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")))?;
    let rows: Vec<Value> = files
        .iter()
        .map(|file| {
            let digest = format!("{:016x}", digest(file.text.as_bytes()));
            json!({ "file": file.name, "digest": digest, "text": file.text })
        })
        .collect();
    Ok(Json(json!({ "schema": "rules/1", "directory": shared.scripts.display().to_string(), "scripts": rows })))
}

/// `GET /api/v1/rules/words`: what `rules api --json` prints.
pub(super) async fn words() -> Json<Value> {
    Json(script::api_json())
}
