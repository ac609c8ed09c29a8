//! Diagnoses that a person asks for: begin, watch, end, read the report, take the model over. The work is done in a process of its
//! own, see `diagnosis::child`; what is found is stored by the tick, as it is for diagnoses that the box begins by itself.

use super::ServerState;
use super::gallery;
use super::guard::with_audit_note;
use super::headers;
use super::history::parse_range;
use super::person::{JsonBody, SignedIn};
use super::problem::ApiProblem;
use super::query::QueryKeys;
use super::route::Route;
use adapters::clock::SECOND_NS;
use axum::Json;
use axum::extract::{Path, Query as Pairs, State};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use axum::routing::{delete, get, post};
use gateway_access::Role;
use gateway_diagnosis::handle::{DiagnosisHandle, DiagnosisRefusal, Run};
use gateway_diagnosis::store::{DiagnosisFile, DiagnosisStore, is_key};
use gateway_diagnosis::stretch::ENOUGH_S;
use rules::physics::explain::Language;
use serde::Deserialize;
use serde_json::{Value, json};

/// Two times, or a key.
const BYTES_MAX: usize = 1024;
/// A shorter stretch has too few rows for any claim.
const SPAN_MIN_NS: i64 = 120 * SECOND_NS;

pub(super) const ROUTES: &[Route] = &[
    Route::read("/api/v1/diagnosis", || get(serve_diagnosis)),
    Route::post(Role::Setter, "/api/v1/diagnosis", BYTES_MAX, || post(begin_diagnosis)),
    Route::delete(Role::Setter, "/api/v1/diagnosis", 0, || delete(cancel_diagnosis)),
    Route::read("/api/v1/diagnoses/{key}/page", || get(serve_report)),
    Route::read("/api/v1/diagnoses/{key}/plan", || get(serve_plan)),
    Route::read("/api/v1/diagnoses/{key}/model", || get(serve_model)),
    Route::post(Role::Setter, "/api/v1/twin/model", BYTES_MAX, || post(accept_model)),
    Route::delete(Role::Setter, "/api/v1/twin/model", 0, || delete(restore_model)),
];

/// The stretch to be diagnosed, as everywhere in the API: `2026-01-31T08:00:00Z`, or `-2h` before the newest sample.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct StretchRequest {
    from: String,
    to: String,
}

/// The diagnosis whose model is taken over.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Accepted {
    key: String,
}

impl ServerState {
    fn require_diagnoses(&self) -> Result<&DiagnosisHandle, ApiProblem> {
        let none = || ApiProblem::conflict("no simulation runs beside this machine", "name a model under [twin] model");
        self.diagnoses.as_ref().ok_or_else(none)
    }
}

pub(super) fn describe_diagnosis_refusal(refusal: DiagnosisRefusal) -> ApiProblem {
    ApiProblem::conflict(refusal.what, refusal.next)
}

/// `GET /api/v1/diagnosis`: the diagnosis under way, or how the last one ended; and how much history is enough for one.
async fn serve_diagnosis(State(shared): State<ServerState>) -> Json<Value> {
    let mut told = run_document(shared.diagnoses.as_ref().map(DiagnosisHandle::current_run).unwrap_or_default());
    told["enough_s"] = json!(ENOUGH_S);
    Json(told)
}

/// What is being done, and about how long it takes in all.
pub(super) fn run_document((run, about_s): (Run, Option<f64>)) -> Value {
    let (mut told, by) = match run {
        Run::None => (json!({ "state": "none" }), None),
        Run::Running(it) => {
            let told = json!({
                "state": "running",
                "stage": it.stage,
                "seconds": it.since.elapsed().as_secs_f64(),
                "about_s": about_s,
                "rows": it.rows,
                "from_ms": it.from_ns.div_euclid(1_000_000),
                "to_ms": it.to_ns.div_euclid(1_000_000),
            });
            (told, it.by)
        }
        Run::Done { by, key, seconds } => (json!({ "state": "done", "key": key, "seconds": seconds }), by),
        Run::Failed { by, what } => (json!({ "state": "failed", "what": what }), by),
        Run::Cancelled { by } => (json!({ "state": "cancelled" }), Some(by)),
    };
    told["schema"] = json!("diagnosis-run/1");
    told["by"] = json!(by);
    told
}

/// `POST /api/v1/diagnosis`: begins; `GET` tells how it goes.
async fn begin_diagnosis(
    State(shared): State<ServerState>,
    SignedIn(person): SignedIn,
    JsonBody(asked): JsonBody<StretchRequest>,
) -> Result<Response, ApiProblem> {
    let newest_ns = shared.require_status()?.at_ms.saturating_mul(1_000_000);
    let pairs = vec![("from".to_owned(), asked.from.clone()), ("to".to_owned(), asked.to.clone())];
    let (from_ns, to_ns) = parse_range(&QueryKeys::from_pairs(pairs, &["from", "to"])?, newest_ns)?;
    let to_ns = to_ns.min(newest_ns);
    if to_ns.saturating_sub(from_ns) < SPAN_MIN_NS {
        let what = "this is less than two minutes of history".to_owned();
        return Err(ApiProblem::bad_request(what, "choose a longer time, best one with cuts of several kinds"));
    }
    shared
        .require_diagnoses()?
        .request_diagnosis(Some(person.name), from_ns, to_ns)
        .map_err(describe_diagnosis_refusal)?;
    let words = format!(
        "a diagnosis of {} to {}",
        gateway_base::moment::format_utc(from_ns),
        gateway_base::moment::format_utc(to_ns)
    );
    Ok(with_audit_note(Json(json!({ "schema": "diagnosis-run/1", "state": "running" })), words))
}

/// `DELETE /api/v1/diagnosis`: ends the one under way.
async fn cancel_diagnosis(
    State(shared): State<ServerState>,
    SignedIn(person): SignedIn,
) -> Result<Response, ApiProblem> {
    shared.require_diagnoses()?.cancel(&person.name).map_err(describe_diagnosis_refusal)?;
    Ok(with_audit_note(Json(json!({ "schema": "diagnosis-run/1", "state": "cancelled" })), "the diagnosis is ended"))
}

type DiagnosisQuery = Pairs<Vec<(String, String)>>;

/// A file that was kept of a diagnosis.
async fn read_kept_file(shared: ServerState, key: String, part: DiagnosisFile) -> Result<String, ApiProblem> {
    let gone = || ApiProblem::not_found(&format!("the files of diagnosis {key:?} (the newest 40 are kept)"));
    if !is_key(&key) {
        return Err(gone());
    }
    let of_files = shared.files.as_ref().map(|files| files.handle().clone());
    let stores: Vec<_> = shared.diagnoses.iter().cloned().chain(of_files).collect();
    let wanted = key.clone();
    let text = super::blocking::run_blocking(move || {
        Ok(stores.iter().find_map(|store| store.diagnosis_store().read_file(&wanted, part)))
    })
    .await?;
    text.ok_or_else(gone)
}

fn parse_language(pairs: Vec<(String, String)>) -> Result<Language, ApiProblem> {
    match QueryKeys::from_pairs(pairs, &["lang"])?.find_text("lang") {
        None | Some("en") => Ok(Language::En),
        Some("zh") => Ok(Language::Zh),
        Some(other) => Err(ApiProblem::bad_request(format!("lang={other} is not known"), "write lang=en or lang=zh")),
    }
}

/// `GET /api/v1/diagnoses/{key}/page`: the report.
async fn serve_report(
    State(shared): State<ServerState>,
    Path(key): Path<String>,
    Pairs(pairs): DiagnosisQuery,
) -> Result<Response, ApiProblem> {
    let html = read_kept_file(shared, key, DiagnosisFile::Page(parse_language(pairs)?)).await?;
    Ok(headers::respond_with_report(&html))
}

/// `GET /api/v1/diagnoses/{key}/plan`: the experiment as a recording plan.
async fn serve_plan(
    State(shared): State<ServerState>,
    Path(key): Path<String>,
    Pairs(pairs): DiagnosisQuery,
) -> Result<Response, ApiProblem> {
    let csv = read_kept_file(shared, key, DiagnosisFile::Plan(parse_language(pairs)?)).await?;
    Ok(respond_with_download("text/csv; charset=utf-8", "experiment.csv", csv))
}

/// `GET /api/v1/diagnoses/{key}/model`: the model with what was missing.
async fn serve_model(State(shared): State<ServerState>, Path(key): Path<String>) -> Result<Response, ApiProblem> {
    let toml = read_kept_file(shared, key, DiagnosisFile::Model).await?;
    Ok(respond_with_download("application/toml", "model.toml", toml))
}

/// A file that a browser saves.
pub(super) fn respond_with_download(kind: &'static str, name: &str, content: impl IntoResponse) -> Response {
    let disposition = format!("attachment; filename=\"{name}\"");
    ([(header::CONTENT_TYPE, kind.to_owned()), (header::CONTENT_DISPOSITION, disposition)], content).into_response()
}

/// `POST /api/v1/twin/model`: the model of a diagnosis, of the history or of a file, takes the place of the one in charge.
async fn accept_model(
    State(shared): State<ServerState>,
    SignedIn(_): SignedIn,
    JsonBody(Accepted { key }): JsonBody<Accepted>,
) -> Result<Response, ApiProblem> {
    let diagnoses = shared.require_diagnoses()?.clone();
    let files = shared.files.clone();
    let text = read_kept_file(shared, key.clone(), DiagnosisFile::Model).await?;
    let accepted = move || {
        let results = files.map(|files| files.list_results()).unwrap_or_default();
        if results.iter().any(|result| result.key == key && gallery::of_file(&result.file).is_some()) {
            let hint = "bring a recording of this machine, or choose a time of its history";
            return Err(ApiProblem::conflict(gallery::REFUSED.0, hint));
        }
        diagnoses.accept_model(&key, &text).map_err(describe_diagnosis_refusal)
    };
    respond_with_order(super::blocking::run_blocking(accepted).await?)
}

/// `DELETE /api/v1/twin/model`: the model that was in charge before takes its place again.
async fn restore_model(State(shared): State<ServerState>, SignedIn(_): SignedIn) -> Result<Response, ApiProblem> {
    let diagnoses = shared.require_diagnoses()?.clone();
    let restored = move || diagnoses.restore_model().map_err(describe_diagnosis_refusal);
    respond_with_order(super::blocking::run_blocking(restored).await?)
}

fn respond_with_order(done: String) -> Result<Response, ApiProblem> {
    Ok(with_audit_note(Json(json!({ "schema": "order/1", "done": true, "text": done })), done))
}

/// Why the live comparison cannot have the model of a diagnosis, in both languages; null where it can, or where there is none.
pub(super) fn describe_live_refusal(live: Option<&DiagnosisHandle>, kept: &DiagnosisStore, key: &str) -> Value {
    let refusal = live.and_then(|live| live.find_live_refusal(&kept.read_file(key, DiagnosisFile::Model)?));
    refusal.map_or(Value::Null, |it| json!({ "en": it.en, "zh": it.zh }))
}
