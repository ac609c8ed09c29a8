//! The scripts over the API: as they are on disk, as drafts, their trials, edited ones over the history, put in charge, earlier
//! versions.

use super::ServerState;
use super::blocking::run_blocking;
use super::guard::with_audit_note;
use super::person::{JsonBody, SignedIn};
use super::problem::ApiProblem;
use super::route::Route;
use axum::Json;
use axum::extract::{Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{delete, get, post, put};
use gateway_access::Role;
use gateway_base::files::replace_file;
use gateway_scripts::drafts::{Draft, Drafts, Version, digest_of, is_name};
use gateway_scripts::reload::read_directory;
use gateway_scripts::settings;
use rules::script::{self, ScriptFile, ScriptProblem, SettingValues, TEXT_MAX, TrialResult};
use serde::Deserialize;
use serde_json::{Value, json};

/// A text, and a little around it.
const BODY_MAX: usize = 2 * TEXT_MAX + 4096;

pub(super) const ROUTES: &[Route] = &[
    Route::read("/api/v1/rules", || get(serve_rules)),
    Route::read("/api/v1/rules/words", || get(serve_rule_words)),
    Route::read("/api/v1/rules/{file}/versions/{digest}", || get(serve_version)),
    Route::post(Role::Setter, "/api/v1/rules/{file}/check", BODY_MAX, || post(check_rule)),
    Route::post(Role::Setter, "/api/v1/rules/{file}/trials", BODY_MAX, || post(run_script_trials)),
    Route::put(Role::Setter, "/api/v1/rules/{file}/draft", BODY_MAX, || put(save_draft)),
    Route::delete(Role::Setter, "/api/v1/rules/{file}/draft", 1024, || delete(discard_draft)),
    Route::post(Role::Setter, "/api/v1/rules/{file}/activate", BODY_MAX, || post(activate_rule)),
    Route::delete(Role::Setter, "/api/v1/rules/{file}", 1024, || delete(remove_rule)),
];

/// A text that somebody has typed, and the digest of the text that he began from.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EditedScript {
    pub(super) text: String,
    #[serde(default)]
    pub(super) digest: String,
}

fn describe_store_error(what: impl std::fmt::Display) -> ApiProblem {
    ApiProblem::unavailable(what.to_string(), "look at the data directory and at [scripts] directory")
}

pub(super) fn check_name(name: &str) -> Result<(), ApiProblem> {
    let bad = || ApiProblem::bad_request(format!("{name:?} is no name of a script"), "write it as my_rule.rhai");
    if is_name(name) { Ok(()) } else { Err(bad()) }
}

pub(super) fn on_disk(shared: &ServerState) -> Result<Vec<ScriptFile>, ApiProblem> {
    let problems = |found: Vec<ScriptProblem>| {
        describe_store_error(found.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))
    };
    read_directory(&shared.scripts).map_err(problems)
}

/// The values of the settings in force; the defaults where the file cannot be used, which the status says.
pub(super) fn read_values(shared: &ServerState) -> SettingValues {
    settings::read(&settings::values_path(&shared.data_dir)).unwrap_or_default()
}

/// The scripts of the directory with this text in the place of one of them.
pub(super) fn with(files: Vec<ScriptFile>, name: &str, text: &str) -> Vec<ScriptFile> {
    let mut files: Vec<ScriptFile> = files.into_iter().filter(|file| file.name != name).collect();
    files.push(ScriptFile { name: name.to_owned(), text: text.to_owned() });
    files.sort_by(|a, b| a.name.cmp(&b.name));
    files
}

/// `GET /api/v1/rules`: every script and draft, and which of them are in charge.
async fn serve_rules(State(shared): State<ServerState>) -> Result<Json<Value>, ApiProblem> {
    run_blocking(move || {
        let drafts = Drafts::from_data_dir(&shared.data_dir);
        let mut files = on_disk(&shared)?;
        // Drafts of rules that are not in charge yet.
        let fresh = drafts
            .list_names()
            .into_iter()
            .filter(|name| files.iter().all(|file| file.name != *name))
            .collect::<Vec<_>>();
        files.extend(fresh.into_iter().map(|name| ScriptFile { name, text: String::new() }));
        let rows: Vec<Value> = files.iter().map(|file| script_to_json(&drafts, file)).collect();
        let directory = shared.scripts.display().to_string();
        Ok(Json(json!({ "schema": "rules/1", "directory": directory, "scripts": rows })))
    })
    .await
}

fn script_to_json(drafts: &Drafts, file: &ScriptFile) -> Value {
    let draft = drafts
        .read_draft(&file.name)
        .map(|it| json!({ "text": it.text, "digest": digest_of(&it.text), "by": it.by, "at_ms": it.at_ms }));
    let versions: Vec<Value> = drafts
        .read_versions(&file.name)
        .iter()
        .map(|it| json!({ "digest": digest_of(&it.text), "by": it.by, "at_ms": it.at_ms }))
        .collect();
    let digest = if file.text.is_empty() { String::new() } else { digest_of(&file.text) };
    json!({ "file": file.name, "digest": digest, "text": file.text, "draft": draft, "versions": versions })
}

/// `GET /api/v1/rules/words`: what `rules api --json` prints.
async fn serve_rule_words() -> Json<Value> {
    Json(script::api_json())
}

/// `GET /api/v1/rules/{file}/versions/{digest}`: a text that was in charge.
async fn serve_version(
    State(shared): State<ServerState>,
    Path((name, digest)): Path<(String, String)>,
) -> Result<Json<Value>, ApiProblem> {
    check_name(&name)?;
    run_blocking(move || {
        let versions = Drafts::from_data_dir(&shared.data_dir).read_versions(&name);
        let found = versions.into_iter().find(|it| digest_of(&it.text) == digest);
        let found = found.ok_or_else(|| ApiProblem::not_found(&format!("version {digest} of {name}")))?;
        Ok(Json(json!({ "schema": "rule-version/1", "file": name, "digest": digest, "text": found.text,
            "by": found.by, "at_ms": found.at_ms })))
    })
    .await
}

/// `POST /api/v1/rules/{file}/check`: does it compile, beside the others?
async fn check_rule(
    State(shared): State<ServerState>,
    Path(name): Path<String>,
    JsonBody(edited): JsonBody<EditedScript>,
) -> Result<Json<Value>, ApiProblem> {
    check_name(&name)?;
    run_blocking(move || {
        let files = with(on_disk(&shared)?, &name, &edited.text);
        let found = script::compile_with(&files, &read_values(&shared)).err().unwrap_or_default();
        Ok(Json(json!({ "schema": "check/1", "fine": found.is_empty(), "problems": problems_to_json(&found, &name) })))
    })
    .await
}

/// `POST /api/v1/rules/{file}/trials`: the trials of an edited script, which is not saved.
async fn run_script_trials(
    State(shared): State<ServerState>,
    Path(name): Path<String>,
    JsonBody(edited): JsonBody<EditedScript>,
) -> Result<Json<Value>, ApiProblem> {
    check_name(&name)?;
    run_blocking(move || Ok(Json(trials_to_json(&shared, &name, &edited.text)))).await
}

/// The trials of one text, as `rules test --json` tells them.
fn trials_to_json(shared: &ServerState, name: &str, text: &str) -> Value {
    let file = ScriptFile { name: name.to_owned(), text: text.to_owned() };
    let files = with(on_disk(shared).unwrap_or_default(), name, text);
    let (results, found) = match script::compile_one(&file, &files, &read_values(shared)) {
        Ok(set) => (script::run_trials(&set), Vec::new()),
        Err(found) => (Vec::new(), found),
    };
    let fine = found.is_empty() && results.iter().all(|result| result.problem.is_none());
    let rows: Vec<Value> = results.iter().map(trial_to_json).collect();
    json!({ "schema": "trials/1", "fine": fine, "trials": rows, "problems": problems_to_json(&found, name) })
}

fn trial_to_json(result: &TrialResult) -> Value {
    json!({
        "name": result.name, "line": result.line, "passed": result.problem.is_none(), "met": result.met,
        "seconds": result.passed_s, "problem": result.problem.as_ref().map(problem_to_json),
    })
}

/// Those of this file; problems of others are told without a place in it.
fn problems_to_json(found: &[ScriptProblem], name: &str) -> Vec<Value> {
    let place = |it: &ScriptProblem| if it.file == name { problem_to_json(it) } else { foreign_problem_to_json(it) };
    found.iter().map(place).collect()
}

fn problem_to_json(it: &ScriptProblem) -> Value {
    json!({ "file": it.file, "line": it.line, "column": it.column, "what": it.what, "next": it.next })
}

fn foreign_problem_to_json(it: &ScriptProblem) -> Value {
    json!({ "file": it.file, "line": 0, "column": 0, "what": it.to_string(), "next": it.next })
}

/// Is the text that somebody began from still the newest? Otherwise whoever was quicker would lose what he wrote.
fn still_newest(drafts: &Drafts, files: &[ScriptFile], name: &str, began_from: &str) -> Result<(), ApiProblem> {
    let draft = drafts.read_draft(name);
    let newest = match (&draft, files.iter().find(|file| file.name == name)) {
        (Some(draft), _) => digest_of(&draft.text),
        (None, Some(file)) => digest_of(&file.text),
        (None, None) => String::new(),
    };
    if newest == began_from {
        return Ok(());
    }
    let who = draft.map_or("on the disk of the box".to_owned(), |draft| format!("by {}", draft.by));
    let hint = "copy what you wrote, open the script again, and put it in there; nothing is lost";
    Err(ApiProblem::conflict(format!("{name} was changed meanwhile {who}"), hint))
}

fn now_ms(shared: &ServerState) -> i64 {
    shared.require_status().map(|status| status.at_ms).unwrap_or_default()
}

/// `PUT /api/v1/rules/{file}/draft`: keeps an edited script without putting it in charge.
async fn save_draft(
    State(shared): State<ServerState>,
    Path(name): Path<String>,
    SignedIn(person): SignedIn,
    JsonBody(edited): JsonBody<EditedScript>,
) -> Result<Response, ApiProblem> {
    check_name(&name)?;
    let (words, answer) = run_blocking(move || {
        let drafts = Drafts::from_data_dir(&shared.data_dir);
        let files = on_disk(&shared)?;
        let own = drafts.read_draft(&name).is_some_and(|draft| draft.text == edited.text);
        if !own {
            still_newest(&drafts, &files, &name, &edited.digest)?;
        }
        let digest = digest_of(&edited.text);
        let draft = Draft { text: edited.text, by: person.name, at_ms: now_ms(&shared) };
        drafts.save_draft(&name, &draft).map_err(describe_store_error)?;
        Ok((format!("{name}: a draft, {digest}"), json!({ "schema": "draft/1", "file": name, "digest": digest })))
    })
    .await?;
    Ok(with_audit_note(Json(answer), words))
}

/// `DELETE /api/v1/rules/{file}/draft`: discards what was edited.
async fn discard_draft(State(shared): State<ServerState>, Path(name): Path<String>) -> Result<Response, ApiProblem> {
    check_name(&name)?;
    let words = format!("{name}: its draft is discarded");
    run_blocking(move || Drafts::from_data_dir(&shared.data_dir).remove_draft(&name).map_err(describe_store_error))
        .await?;
    Ok(with_audit_note(Json(json!({ "done": true })), words))
}

/// `POST /api/v1/rules/{file}/activate`: comes into charge when every script compiles and every trial passes; otherwise it stays
/// a draft, and the answer (422) says why.
async fn activate_rule(
    State(shared): State<ServerState>,
    Path(name): Path<String>,
    SignedIn(person): SignedIn,
    JsonBody(edited): JsonBody<EditedScript>,
) -> Result<Response, ApiProblem> {
    check_name(&name)?;
    run_blocking(move || {
        let drafts = Drafts::from_data_dir(&shared.data_dir);
        let files = on_disk(&shared)?;
        still_newest(&drafts, &files, &name, &edited.digest)?;
        let before = files.iter().find(|file| file.name == name).map(|file| file.text.clone());
        if let Err(found) = script::prepare_with(&with(files, &name, &edited.text), &read_values(&shared)) {
            return Ok(build_refusal(&shared, &name, &edited.text, &found));
        }
        let (at_ms, by) = (now_ms(&shared), person.name);
        if let Some(text) = before.clone().filter(|_| drafts.read_versions(&name).is_empty()) {
            drafts.keep_version(&name, Version { text, by: String::new(), at_ms }).map_err(describe_store_error)?;
        }
        replace_file(&shared.scripts.join(&name), &edited.text).map_err(describe_store_error)?;
        let digest = digest_of(&edited.text);
        drafts.keep_version(&name, Version { text: edited.text, by, at_ms }).map_err(describe_store_error)?;
        drafts.remove_draft(&name).map_err(describe_store_error)?;
        let was = before.map_or("nothing".to_owned(), |text| digest_of(&text));
        let words = format!("{name}: version {digest} in the place of {was}");
        Ok(with_audit_note(Json(json!({ "done": true, "version": digest })), words))
    })
    .await
}

/// `DELETE /api/v1/rules/{file}`: takes a script out of charge. Its text stays as a draft, so that it can be put back or discarded. Where
/// the others do not pass their trials without it, it stays in charge, and the answer (409) says why.
async fn remove_rule(
    State(shared): State<ServerState>,
    Path(name): Path<String>,
    SignedIn(person): SignedIn,
) -> Result<Response, ApiProblem> {
    check_name(&name)?;
    run_blocking(move || {
        let drafts = Drafts::from_data_dir(&shared.data_dir);
        let files = on_disk(&shared)?;
        let Some(before) = files.iter().find(|file| file.name == name).cloned() else {
            return Err(ApiProblem::not_found(&format!("a script {name} in charge")));
        };
        let others: Vec<ScriptFile> = files.into_iter().filter(|file| file.name != name).collect();
        if let Err(found) = script::prepare_with(&others, &read_values(&shared)) {
            let what = found.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
            let hint = "the others need it: change them first";
            return Err(ApiProblem::conflict(format!("{name} stays in charge: {what}"), hint));
        }
        let (at_ms, by) = (now_ms(&shared), person.name);
        if drafts.read_draft(&name).is_none() {
            let draft = Draft { text: before.text.clone(), by: by.clone(), at_ms };
            drafts.save_draft(&name, &draft).map_err(describe_store_error)?;
        }
        let digest = digest_of(&before.text);
        drafts.keep_version(&name, Version { text: before.text, by, at_ms }).map_err(describe_store_error)?;
        std::fs::remove_file(shared.scripts.join(&name)).map_err(describe_store_error)?;
        let words = format!("{name}: version {digest} is out of charge");
        Ok(with_audit_note(Json(json!({ "done": true, "version": digest })), words))
    })
    .await
}

fn build_refusal(shared: &ServerState, name: &str, text: &str, found: &[ScriptProblem]) -> Response {
    let mut document = trials_to_json(shared, name, text);
    document["status"] = json!(422);
    document["title"] = json!("it does not come into charge: not every trial passes");
    document["hint"] = json!("it stays a draft; the version in charge goes on");
    document["problems"] = json!(problems_to_json(found, name));
    let problem = [(header::CONTENT_TYPE, "application/problem+json")];
    let response = (StatusCode::UNPROCESSABLE_ENTITY, problem, document.to_string()).into_response();
    with_audit_note(response, format!("{name}: its trials do not pass"))
}
