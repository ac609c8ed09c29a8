//! The settings of the scripts over the API: every one that is declared, with what is in force; one changed by a setter.

use super::ServerState;
use super::blocking::run_blocking;
use super::guard::with_audit_note;
use super::history::{describe_history_error, read_history};
use super::person::{JsonBody, SignedIn};
use super::problem::ApiProblem;
use super::route::Route;
use super::rules::on_disk;
use axum::Json;
use axum::extract::State;
use axum::response::Response;
use axum::routing::{get, put};
use gateway_access::Role;
use gateway_history::RecordSpan;
use gateway_scripts::settings::{self, NewSetting, Refused};
use rules::script::{DeclarationPlace, ScriptProblem, SettingValue, list_declarations};
use serde::Deserialize;
use serde_json::Value;

pub(super) const ROUTES: &[Route] = &[
    Route::read("/api/v1/settings", || get(serve_settings)),
    Route::put(Role::Setter, "/api/v1/settings", 4096, || put(change_setting)),
];

/// A number, a text, or nothing: as elsewhere again.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
enum RequestedValue {
    Number(f64),
    Text(String),
}

/// One setting that is to have another value.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct SettingRequest {
    script: String,
    name: String,
    value: Option<RequestedValue>,
    #[serde(default)]
    tool: Option<String>,
    #[serde(default)]
    operation: Option<String>,
    #[serde(default)]
    began_from: Option<String>,
}

impl SettingRequest {
    fn into_new_setting(self) -> Result<NewSetting, ApiProblem> {
        let place = match (self.tool, self.operation) {
            (None, None) => DeclarationPlace::Machine,
            (Some(tool), None) => DeclarationPlace::Tool(tool),
            (None, Some(operation)) => DeclarationPlace::Operation(operation),
            (Some(_), Some(_)) => {
                return Err(ApiProblem::bad_request("a tool and an operation are both named", "name one of them"));
            }
        };
        let value = self.value.map(|value| match value {
            RequestedValue::Number(number) => SettingValue::Number(number),
            RequestedValue::Text(text) => SettingValue::Text(text),
        });
        let script = self.script.strip_suffix(".rhai").unwrap_or(&self.script).to_owned();
        Ok(NewSetting { script, name: self.name, place, value, began_from: self.began_from })
    }
}

fn settings_problem(problems: &[ScriptProblem]) -> ApiProblem {
    let what: Vec<&str> = problems.iter().map(|problem| problem.what.as_str()).collect();
    let next = problems.iter().map(|problem| problem.next.as_str()).find(|next| !next.is_empty());
    ApiProblem::bad_request(what.join("; "), next.unwrap_or("GET /api/v1/settings lists every setting with its range"))
}

fn not_set(why: Refused) -> ApiProblem {
    match why {
        Refused::Problems(problems) => settings_problem(&problems),
        Refused::Meanwhile { path, now, by } => {
            let now = if now.is_empty() { "not chosen".to_owned() } else { now };
            let title = format!("{path} was changed meanwhile by {by}: it is {now} now");
            ApiProblem::conflict(
                title,
                "nothing is lost; look at the value of now, and set yours again if it still holds",
            )
        }
    }
}

/// Who has changed settings, as far as the history can be read: without it the settings are shown all the same.
async fn read_changes(shared: &ServerState) -> Vec<Value> {
    let read = read_history(shared.clone(), |reader, _| {
        let events = reader.events_of(settings::KIND, RecordSpan::newest(settings::EVENTS_MAX));
        events
            .map(|events| Value::Array(settings::told_changes(&events)))
            .map_err(|error| describe_history_error(&error))
    });
    match read.await {
        Ok(Json(Value::Array(changes))) => changes,
        _ => Vec::new(),
    }
}

/// `GET /api/v1/settings`: the settings that the scripts declare, with their values.
async fn serve_settings(State(shared): State<ServerState>) -> Result<Json<Value>, ApiProblem> {
    let changes = read_changes(&shared).await;
    run_blocking(move || {
        let declared = list_declarations(&on_disk(&shared)?).map_err(|problems| settings_problem(&problems))?;
        Ok(Json(settings::build_document(declared.iter(), &super::rules::read_values(&shared), &changes)))
    })
    .await
}

/// `PUT /api/v1/settings`: tried with every script first; in force within a second.
async fn change_setting(
    State(shared): State<ServerState>,
    SignedIn(person): SignedIn,
    JsonBody(asked): JsonBody<SettingRequest>,
) -> Result<Response, ApiProblem> {
    let wanted = asked.into_new_setting()?;
    let changes = read_changes(&shared).await;
    run_blocking(move || {
        let files = on_disk(&shared)?;
        let words = settings::change_setting(&shared.data_dir, &files, &wanted, &person.name).map_err(not_set)?;
        let declared = list_declarations(&files).map_err(|problems| settings_problem(&problems))?;
        let answer = settings::build_document(declared.iter(), &super::rules::read_values(&shared), &changes);
        Ok(with_audit_note(Json(answer), words))
    })
    .await
}
