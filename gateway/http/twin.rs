//! `GET /api/v1/twin`: the simulation beside the machine, and the diagnoses of the history.

use super::ServerState;
use super::diagnoses::describe_live_refusal;
use super::history::{Answer, HistoryQuery, describe_history_error, read_history};
use super::query::QueryKeys;
use super::route::Route;
use adapters::clock::TimeNs;
use axum::extract::{Query as Pairs, State};
use axum::routing::get;
use gateway_diagnosis::beside::BesideModel;
use gateway_diagnosis::handle::DiagnosisHandle;
use gateway_diagnosis::store::{self, DiagnosisFile};
use gateway_history::{Diagnosis, RecordSpan};
use serde_json::{Value, json};

/// Diagnoses told when nobody says otherwise.
const DIAGNOSES_DEFAULT: u32 = 5;

pub(super) const ROUTES: &[Route] = &[Route::read("/api/v1/twin", || get(serve_twin))];

/// `GET /api/v1/twin`: the simulation beside the machine, and its newest diagnoses.
pub(super) async fn serve_twin(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    let keys = QueryKeys::from_pairs(pairs, &["limit"])?;
    let limit = keys.parse_number("limit", 1, 100)?.unwrap_or(DIAGNOSES_DEFAULT);
    let status = shared.require_status()?;
    let live = shared.diagnoses.clone();
    read_history(shared, move |reader, _| {
        let found = reader.read_diagnoses(RecordSpan::newest(limit)).map_err(|error| describe_history_error(&error))?;
        let diagnoses: Vec<Value> = found.iter().rev().map(|row| diagnosis_to_json(row, live.as_ref())).collect();
        let before = live.as_ref().and_then(DiagnosisHandle::model_before);
        Ok(json!({
            "schema": "twin/1", "at_ms": status.at_ms, "twin": status.twin, "model_before": before, "diagnoses": diagnoses
        }))
    })
    .await
}

/// Newest first; the whole diagnosis stands under `diagnosis` (`diagnosis/1`). What was kept of it - the report page, the model, the
/// steps of the experiment - is told where it is still there.
fn diagnosis_to_json(found: &Diagnosis, live: Option<&DiagnosisHandle>) -> Value {
    let ms = |at_ns: TimeNs| at_ns.div_euclid(1_000_000);
    let key = store::diagnosis_key(found);
    let kept = live.map(DiagnosisHandle::diagnosis_store);
    let words = kept.and_then(|kept| kept.read_texts(&key));
    let model = kept.is_some_and(|kept| kept.file_path(&key, DiagnosisFile::Model).exists());
    json!({
        "at_ms": ms(found.at_ns),
        "from_ms": ms(found.from_ns),
        "to_ms": ms(found.to_ns),
        "verdict": found.verdict,
        "summary": found.summary,
        "summary_zh": words.as_ref().map(|words| &words.summary_zh),
        "page": words.is_some().then(|| format!("/api/v1/diagnoses/{key}/page")),
        "model": model,
        "refused": kept.map_or(Value::Null, |kept| describe_live_refusal(live, kept, &key)),
        "key": key,
        "steps": words.as_ref().map(|words| &words.steps),
        "beside": words.as_ref().map(|words| words.beside.iter().map(model_to_json).collect::<Vec<Value>>()),
        "minutes": words.as_ref().and_then(|words| words.minutes),
        "effects": words.as_ref().map(|words| &words.effects),
        "diagnosis": serde_json::from_str::<Value>(&found.json).unwrap_or(Value::Null),
    })
}

/// The diagnosis beside the watch: figures in the unit of the output that add up to the difference.
fn model_to_json(one: &BesideModel) -> Value {
    json!({
        "regime": one.regime.as_word(),
        "from_ms": one.from_ns.div_euclid(1_000_000),
        "seconds": one.seconds,
        "expected": one.expected,
        "difference": one.difference,
        "by_parameters": one.by_parameters,
        "by_effects": one.by_effects.iter().map(|(effect, share)| json!({ "effect": effect, "difference": share })).collect::<Vec<_>>(),
        "left": one.left,
        "differs": one.has_difference(),
        "of_parameters": one.is_of_parameters(),
        "text": one.en,
        "zh": one.zh,
    })
}
