//! Files that a person brings to the page: how each is understood, its map, its diagnosis, and three examples whose truth is told afterwards.

use super::ServerState;
use super::blocking::run_blocking;
use super::body::describe_arrival_error;
use super::diagnoses::{describe_live_refusal, run_document};
use super::guard::with_audit_note;
use super::person::{JsonBody, SignedIn};
use super::problem::ApiProblem;
use super::query::QueryKeys;
use super::route::Route;
use crate::gallery;
use adapters::channel::CHANNELS;
use adapters::recording::TEXT_COLUMNS;
use axum::Json;
use axum::extract::{Extension, Path, Query as Pairs, State};
use axum::response::Response;
use axum::routing::{delete, get, post, put};
use gateway_access::Role;
use gateway_diagnosis::arriving::ArrivingFile;
use gateway_diagnosis::clicked_map::ClickedMap;
use gateway_diagnosis::files::{BroughtFile, FileDiagnoses, FileDiagnosis, MapRefusal};
use gateway_diagnosis::handle::DiagnosisHandle;
use gateway_diagnosis::model_new::{KINDS, MATERIALS, ModelKind, NewModel};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::Duration;

/// The longest file that is taken; a longer one is read on the command line.
const FILE_MAX: usize = 200 << 20;
/// So long a request waits until a file is read; afterwards it says that it is being read.
const READING_WAIT: Duration = Duration::from_secs(30);
/// A map, or the choice of a model.
const BODY_MAX: usize = 256 << 10;

pub(super) const ROUTES: &[Route] = &[
    Route::read("/api/v1/files", || get(serve_files)),
    Route::post(Role::Setter, "/api/v1/files", FILE_MAX, || post(upload_file)).with_body_in_file(),
    Route::read("/api/v1/files/{key}", || get(serve_file)),
    Route::put(Role::Setter, "/api/v1/files/{key}/map", BODY_MAX, || put(map)),
    Route::post(Role::Setter, "/api/v1/files/{key}/diagnosis", BODY_MAX, || post(begin_file_diagnosis)),
    Route::read("/api/v1/files-diagnosis", || get(serve_file_diagnosis)),
    Route::delete(Role::Setter, "/api/v1/files-diagnosis", 0, || delete(cancel_file_diagnosis)),
    Route::post(Role::Setter, "/api/v1/gallery/{name}", 1024, || post(diagnose_example)),
    Route::read("/api/v1/gallery/{name}/truth", || get(serve_truth)),
];

impl ServerState {
    pub(super) fn require_files(&self) -> Result<&FileDiagnoses, ApiProblem> {
        let none = || ApiProblem::unavailable("files cannot be taken", "look at the data directory and at the log");
        self.files.as_ref().ok_or_else(none)
    }
}

fn describe_io_error(error: std::io::Error) -> ApiProblem {
    describe_arrival_error(error.into())
}

/// `GET /api/v1/files`: what was brought, what was found, and what can be chosen.
async fn serve_files(State(shared): State<ServerState>) -> Result<Json<Value>, ApiProblem> {
    let files = shared.require_files()?.clone();
    let live = shared.diagnoses.clone();
    run_blocking(move || {
        let kinds: Vec<Value> =
            KINDS.iter().map(|(_, word, en, zh)| json!({ "kind": word, "en": en, "zh": zh })).collect();
        let materials: Vec<&str> = MATERIALS.iter().map(|(name, ..)| *name).collect();
        let columns: Vec<Value> = CHANNELS
            .iter()
            .map(|channel| json!({ "name": channel.name, "unit": channel.unit, "en": channel.en, "zh": channel.zh }))
            .collect();
        let results: Vec<Value> = files.list_results().iter().map(|result| result_document(&files, live.as_ref(), result)).collect();
        let examples: Vec<Value> =
            gallery::EXAMPLES.iter().map(|it| json!({ "name": it.name, "en": it.en, "zh": it.zh })).collect();
        Ok(Json(json!({
            "schema": "files/1", "files": files.list_files(), "diagnoses": results, "kinds": kinds, "materials": materials,
            "columns": columns, "text_columns": TEXT_COLUMNS, "examples": examples, "bytes_max": FILE_MAX,
            "bytes_free": files.find_free_bytes(),
        })))
    })
    .await
}

fn result_document(files: &FileDiagnoses, live: Option<&DiagnosisHandle>, result: &FileDiagnosis) -> Value {
    let kept = files.handle().diagnosis_store();
    let words = kept.read_texts(&result.key).unwrap_or_default();
    let has_model = kept.read_file(&result.key, gateway_diagnosis::store::DiagnosisFile::Model).is_some();
    json!({
        "key": result.key, "file": result.file, "by": result.by, "at_ms": result.at_ms, "from_ms": result.at_ms, "to_ms": result.at_ms,
        "verdict": result.verdict, "summary": result.summary, "summary_zh": words.summary_zh, "missing": result.missing,
        "diagnosis": result.diagnosis, "steps": words.steps, "minutes": words.minutes, "effects": words.effects,
        "page": format!("/api/v1/diagnoses/{}/page", result.key), "model": has_model,
        "refused": gallery::describe_refusal(&result.file).unwrap_or_else(|| describe_live_refusal(live, kept, &result.key)),
        "truth": gallery::of_file(&result.file),
    })
}

/// `POST /api/v1/files?name=week.xlsx`: the bytes of a file.
async fn upload_file(
    State(shared): State<ServerState>,
    SignedIn(_): SignedIn,
    Pairs(pairs): Pairs<Vec<(String, String)>>,
    Extension(arrived): Extension<Arc<ArrivingFile>>,
) -> Result<Response, ApiProblem> {
    let name = QueryKeys::from_pairs(pairs, &["name"])?.find_text("name").unwrap_or("recording").to_owned();
    if arrived.bytes() == 0 {
        return Err(ApiProblem::bad_request("the file is empty", "choose another one"));
    }
    let files = shared.require_files()?.clone();
    let at_ms = now_ms(&shared);
    let file: BroughtFile = run_blocking(move || files.keep(&arrived, &name, at_ms).map_err(describe_io_error)).await?;
    let words = format!("a file for a diagnosis: {} ({} bytes)", file.name, file.bytes);
    let document = describe_file(&shared, file.key).await?;
    Ok(with_audit_note(Json(document), words))
}

fn now_ms(shared: &ServerState) -> i64 {
    shared.require_status().map(|status| status.at_ms).unwrap_or_default()
}

/// `GET /api/v1/files/{key}`: how it is understood.
async fn serve_file(State(shared): State<ServerState>, Path(key): Path<String>) -> Result<Json<Value>, ApiProblem> {
    describe_file(&shared, key).await.map(Json)
}

/// How a file is understood. A long one takes its time: until it is read, or while others are, `reading` says so.
async fn describe_file(shared: &ServerState, key: String) -> Result<Value, ApiProblem> {
    let files = shared.require_files()?.clone();
    let gone = || ApiProblem::not_found(&format!("a file {key:?} (the newest 20 are kept)"));
    let listed = files.clone();
    let known = run_blocking(move || Ok(listed.list_files())).await?;
    let file = known.into_iter().find(|file| file.key == key).ok_or_else(gone)?;
    let mut document = json!({ "schema": "file/1", "key": key, "name": file.name, "bytes": file.bytes });
    // It goes on being read when this request is over, and is understood when it is asked for again.
    let read = run_blocking(move || Ok(files.describe_file(&file)));
    let understood = match tokio::time::timeout(READING_WAIT, read).await {
        Ok(Ok(Ok(understood))) => understood,
        Ok(Err(problem)) => return Err(problem),
        // Other files are being read, or this one still is.
        Ok(Ok(Err(_))) | Err(_) => json!({ "reading": true, "columns": [] }),
    };
    if let (Value::Object(document), Value::Object(understood)) = (&mut document, understood) {
        document.extend(understood);
    }
    Ok(document)
}

/// `PUT /api/v1/files/{key}/map`: keeps how the columns of a file are to be read.
async fn map(
    State(shared): State<ServerState>,
    Path(key): Path<String>,
    SignedIn(_): SignedIn,
    JsonBody(clicked): JsonBody<ClickedMap>,
) -> Result<Response, ApiProblem> {
    let files = shared.require_files()?.clone();
    let words = format!("file {key}: its map");
    let mapped = key.clone();
    run_blocking(move || {
        let refuse = |text: String| ApiProblem::bad_request(text, "change the choice that is named");
        let file = files.list_files().into_iter().find(|file| file.key == key);
        let file = file.ok_or_else(|| ApiProblem::not_found(&format!("a file {key:?}")))?;
        let path = files.find_path(&key).ok_or_else(|| ApiProblem::not_found(&format!("a file {key:?}")))?;
        let toml = files.propose_map(&file, &clicked).map_err(|refusal| match refusal {
            MapRefusal::Busy => ApiProblem::unavailable("other files are being read", "ask again in some seconds"),
            MapRefusal::Refused(why) => refuse(why),
        })?;
        files.set_map(&path, &toml).map_err(describe_io_error)
    })
    .await?;
    let document = describe_file(&shared, mapped).await?;
    Ok(with_audit_note(Json(document), words))
}

/// What a file is compared with.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FileDiagnosisRequest {
    /// A model of this kind,
    #[serde(default)]
    kind: Option<ModelKind>,
    #[serde(default)]
    material: Option<String>,
    #[serde(default)]
    axis: Option<String>,
    #[serde(default)]
    output: Option<String>,
    /// or a model as text (model/1),
    #[serde(default)]
    toml: Option<String>,
    /// or the one that runs beside the machine.
    #[serde(default)]
    active_model: bool,
    /// A series: the key of another file, or of this one, and its column.
    #[serde(default)]
    simulated: Option<SeriesChoice>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SeriesChoice {
    key: String,
    #[serde(default)]
    column: String,
}

/// `POST /api/v1/files/{key}/diagnosis`: begins a diagnosis of a file.
async fn begin_file_diagnosis(
    State(shared): State<ServerState>,
    Path(key): Path<String>,
    SignedIn(person): SignedIn,
    JsonBody(asked): JsonBody<FileDiagnosisRequest>,
) -> Result<Response, ApiProblem> {
    let files = shared.require_files()?.clone();
    let path = files.find_path(&key).ok_or_else(|| ApiProblem::not_found(&format!("a file {key:?}")))?;
    let toml = model_text(&shared, &asked)?;
    let simulated = match &asked.simulated {
        None => None,
        Some(choice) => {
            let path = files
                .find_path(&choice.key)
                .ok_or_else(|| ApiProblem::not_found(&format!("a file {:?}", choice.key)))?;
            Some(if choice.column.is_empty() {
                path.display().to_string()
            } else {
                format!("{}:{}", path.display(), choice.column)
            })
        }
    };
    if toml.is_empty() && simulated.is_none() {
        return Err(ApiProblem::bad_request(
            "nothing to compare the file with",
            "choose a kind of machine, a model or a simulated series",
        ));
    }
    let at_ns = now_ms(&shared).saturating_mul(1_000_000);
    files
        .request_diagnosis(person.name, toml, path, simulated, at_ns)
        .map_err(super::diagnoses::describe_diagnosis_refusal)?;
    Ok(with_audit_note(
        Json(json!({ "schema": "diagnosis-run/1", "state": "running" })),
        format!("a diagnosis of file {key}"),
    ))
}

fn model_text(shared: &ServerState, asked: &FileDiagnosisRequest) -> Result<String, ApiProblem> {
    if let Some(toml) = &asked.toml {
        let wrong = |problems: Vec<rules::twin::Problem>| {
            ApiProblem::bad_request(format!("the model: {}", problems[0]), "correct that line")
        };
        rules::twin::parse_model(toml).map_err(wrong)?;
        return Ok(toml.clone());
    }
    if asked.active_model {
        let none = || ApiProblem::conflict("no simulation runs beside this machine", "choose a kind of machine");
        let path = shared.diagnoses.as_ref().ok_or_else(none)?.model_path().to_owned();
        return gateway_base::files::read_text(&path, 4 << 20).map_err(describe_io_error);
    }
    let Some(kind) = asked.kind.filter(|kind| *kind != ModelKind::Series) else { return Ok(String::new()) };
    let filled = |text: &Option<String>| text.clone().filter(|text| !text.is_empty());
    let new = NewModel {
        kind,
        name: "the machine".to_owned(),
        output: filled(&asked.output),
        material: filled(&asked.material),
        axis: filled(&asked.axis).filter(|axis| ["x", "y", "z"].contains(&axis.as_str())),
    };
    Ok(new.to_toml())
}

/// `GET /api/v1/files-diagnosis`: how it goes.
async fn serve_file_diagnosis(State(shared): State<ServerState>) -> Json<Value> {
    let run = shared.files.as_ref().map(|files| files.handle().current_run()).unwrap_or_default();
    Json(run_document(run))
}

/// `DELETE /api/v1/files-diagnosis`: ends the diagnosis that is under way.
async fn cancel_file_diagnosis(
    State(shared): State<ServerState>,
    SignedIn(person): SignedIn,
) -> Result<Response, ApiProblem> {
    shared.require_files()?.handle().cancel(&person.name).map_err(super::diagnoses::describe_diagnosis_refusal)?;
    Ok(with_audit_note(Json(json!({ "schema": "diagnosis-run/1", "state": "cancelled" })), "the diagnosis is ended"))
}

/// `POST /api/v1/gallery/{name}`: an example is brought and diagnosed.
async fn diagnose_example(
    State(shared): State<ServerState>,
    Path(name): Path<String>,
    SignedIn(person): SignedIn,
) -> Result<Response, ApiProblem> {
    let it = gallery::find_example(&name).ok_or_else(|| ApiProblem::not_found(&format!("an example {name:?}")))?;
    let files = shared.require_files()?.clone();
    let at_ms = now_ms(&shared);
    let file = {
        let files = files.clone();
        run_blocking(move || files.add(it.file, it.recording, at_ms).map_err(describe_arrival_error)).await?
    };
    let path = files.find_path(&file.key).ok_or_else(|| ApiProblem::not_found("the example"))?;
    files
        .request_diagnosis(person.name, it.model.to_owned(), path, None, at_ms.saturating_mul(1_000_000))
        .map_err(super::diagnoses::describe_diagnosis_refusal)?;
    Ok(with_audit_note(
        Json(json!({ "schema": "diagnosis-run/1", "state": "running", "file": file })),
        format!("example {name}"),
    ))
}

/// `GET /api/v1/gallery/{name}/truth`: what is hidden in an example.
async fn serve_truth(Path(name): Path<String>) -> Result<Json<Value>, ApiProblem> {
    let it = gallery::find_example(&name).ok_or_else(|| ApiProblem::not_found(&format!("an example {name:?}")))?;
    Ok(Json(json!({ "schema": "truth/1", "name": it.name, "en": it.truth_en, "zh": it.truth_zh })))
}
