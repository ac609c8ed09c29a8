//! The operations recipe as a table to be edited: read with what tells it from another text, and put back whole when all of it is
//! right. The tick takes a changed file by itself.

use super::ServerState;
use super::blocking::run_blocking;
use super::guard::with_audit_note;
use super::person::JsonBody;
use super::problem::ApiProblem;
use super::route::Route;
use axum::Json;
use axum::extract::State;
use axum::response::Response;
use axum::routing::{get, put};
use gateway_access::Role;
use gateway_base::files::{advise_on_read_error, read_text, replace_durably};
use gateway_scripts::drafts::digest_of;
use rules::operations::{Operation, TEXT_MAX, parse};
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::PathBuf;

pub(super) const ROUTES: &[Route] = &[
    Route::read("/api/v1/operations", || get(serve_recipe)),
    Route::put(Role::Setter, "/api/v1/operations", 2 * TEXT_MAX + 4096, || put(replace_recipe)),
];

/// Another text, and the digest of the one that was edited.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct EditedRecipe {
    text: String,
    digest: String,
}

fn require_path(shared: &ServerState) -> Result<PathBuf, ApiProblem> {
    let none = || ApiProblem::conflict("no recipe is configured", "name a file under [operations] path");
    shared.configured.config.operations.path.clone().ok_or_else(none)
}

/// The file as it is; an empty text where it is not there yet.
fn on_disk(path: &std::path::Path) -> Result<String, ApiProblem> {
    match read_text(path, TEXT_MAX) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(String::new()),
        Err(error) => {
            Err(ApiProblem::unavailable(format!("{}: {error}", path.display()), advise_on_read_error(&error)))
        }
        Ok(text) => Ok(text),
    }
}

/// `GET /api/v1/operations`: text and rows of the recipe file, with what is wrong in it.
async fn serve_recipe(State(shared): State<ServerState>) -> Result<Json<Value>, ApiProblem> {
    run_blocking(move || {
        let path = require_path(&shared)?;
        let text = on_disk(&path)?;
        let parsed = parse(&path.display().to_string(), &text);
        let problems: Vec<String> = parsed.as_ref().err().into_iter().flatten().map(ToString::to_string).collect();
        let rows: Vec<Value> = parsed.iter().flat_map(|recipe| recipe.operations()).map(operation_to_json).collect();
        Ok(Json(json!({ "schema": "operations-file/1", "path": path.display().to_string(), "digest": digest_of(&text),
            "text": text, "rows": rows, "problems": problems })))
    })
    .await
}

fn operation_to_json(it: &Operation) -> Value {
    json!({
        "program": &*it.program,
        "blocks": it.blocks.as_ref().map(|blocks| [*blocks.start(), *blocks.end()]),
        "name": &*it.name,
        "depth_of_cut_mm": it.depth_of_cut_mm,
        "width_of_cut_mm": it.width_of_cut_mm,
        "diameter_mm": it.diameter_mm,
        "teeth": it.teeth,
        "tool": it.tool.as_deref(),
        "work_material": it.work_material.as_deref(),
    })
}

/// `PUT /api/v1/operations`: another text, if all of it is right and nobody has changed the file meanwhile.
async fn replace_recipe(
    State(shared): State<ServerState>,
    JsonBody(edited): JsonBody<EditedRecipe>,
) -> Result<Response, ApiProblem> {
    let done = run_blocking(move || {
        let path = require_path(&shared)?;
        let now = on_disk(&path)?;
        if digest_of(&now) != edited.digest {
            let hint = "nothing of yours was stored and nothing of theirs is lost: load the table again, then make your change";
            return Err(ApiProblem::conflict("somebody else has changed the recipe meanwhile", hint));
        }
        let recipe = parse("operations.toml", &edited.text).map_err(|problems| {
            let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
            ApiProblem::bad_request(lines.join("\n"), "mend it; the recipe in force stays")
        })?;
        replace_durably(&path, &edited.text).map_err(|error| {
            ApiProblem::unavailable(format!("{}: {error}", path.display()), advise_on_read_error(&error))
        })?;
        Ok(format!("{} operations, version {}", recipe.operations().len(), recipe.version()))
    });
    let done = done.await?;
    Ok(with_audit_note(Json(json!({ "schema": "order/1", "done": true, "text": done })), format!("the recipe: {done}")))
}
