//! What an integrator needs of the box itself: the configuration in force, a doctor for each source, a backup and its way back, an
//! archive for whoever helps from afar. None of it holds a token, a key or a password.

use super::ServerState;
use super::blocking::run_blocking;
use super::diagnoses::respond_with_download;
use super::guard::with_audit_note;
use super::history::{HistoryQuery, describe_history_error};
use super::person::{JsonBody, SignedIn};
use super::problem::ApiProblem;
use super::query::QueryKeys;
use super::route::Route;
use axum::Json;
use axum::body::Bytes;
use axum::extract::{Query as Pairs, State};
use axum::response::Response;
use axum::routing::{get, post};
use gateway_access::Role;
use gateway_backup::archive::{ArchivedFile, pack, unpack};
use gateway_backup::{self as backup, BackupError, BackupPaths, RestoreError, RestoreRequest, archive_name};
use gateway_base::convert::seconds_to_instant;
use gateway_config::{Config, GateMode};
use gateway_history::{Reader, RecordSpan, audit_document};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::Arc;

/// The name of a source.
const NAME_MAX: usize = 4096;
/// A backup is some hundred kilobytes.
const BACKUP_MAX: usize = 16 << 20;
/// Rows of each kind in the archive for whoever helps.
const ROWS: u32 = 2000;

pub(super) const ROUTES: &[Route] = &[
    Route::read("/api/v1/configuration", || get(serve_configuration)),
    Route::post(Role::Setter, "/api/v1/doctor", NAME_MAX, || post(examine_source)),
    Route::read_by(Role::Admin, "/api/v1/backup", || get(download_backup)),
    Route::post(Role::Admin, "/api/v1/restore", BACKUP_MAX, || post(restore_backup)),
    Route::read_by(Role::Setter, "/api/v1/support", || get(download_support_bundle)),
];

/// What the page knows of the configuration.
#[derive(Debug, Clone)]
pub struct Configured {
    /// As it is in force.
    pub config: Arc<Config>,
    /// The file; `None`: the built-in one.
    pub file: Option<std::path::PathBuf>,
}

impl Configured {
    fn to_json(&self) -> Value {
        json!({
            "schema": "configuration/1",
            "file": self.file.as_ref().map(|file| file.display().to_string()),
            "keys": self.config.in_force,
            "shifts": self.config.http.shifts.iter().map(|at| format!("{}:{:02}", at / 60, at % 60)).collect::<Vec<_>>(),
            "sources": self.config.sources.iter().map(|source| &source.name).collect::<Vec<_>>(),
            "operations": self.config.operations.path.is_some(),
            "armed": self.config.gate.greatest_mode() == GateMode::Armed,
        })
    }

    pub(super) fn backup_paths(&self) -> BackupPaths {
        BackupPaths::from_config(&self.config, self.file.as_deref())
    }
}

/// `GET /api/v1/configuration`: every key with its value and where that was written.
async fn serve_configuration(State(shared): State<ServerState>) -> Json<Value> {
    Json(shared.configured.to_json())
}

/// Which source is looked at.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SourceQuery {
    source: String,
}

/// `POST /api/v1/doctor`: what `doctor --config FILE NAME` finds, with a second connection beside the one that polls.
async fn examine_source(
    State(shared): State<ServerState>,
    JsonBody(asked): JsonBody<SourceQuery>,
) -> Result<Response, ApiProblem> {
    let found = shared.configured.config.sources.iter().find(|it| it.name == asked.source);
    let names = || shared.configured.config.sources.iter().map(|it| it.name.as_str()).collect::<Vec<_>>().join(", ");
    let none = || {
        ApiProblem::bad_request(
            format!("there is no source {:?}", asked.source),
            format!("its sources are {}", names()),
        )
    };
    let address = found.ok_or_else(none)?.address.clone();
    if address.text().contains("/dev/") {
        let hint = "stop the gateway and run `cnc-gateway doctor` at the box: a serial line has one master at a time";
        return Err(ApiProblem::conflict("the gateway itself reads from this serial line", hint));
    }
    let busy = || ApiProblem::conflict("a source is being looked at already", "wait a few seconds");
    let place = shared.doctor.clone().try_acquire_owned().map_err(|_| busy())?;
    let report = run_blocking(move || {
        let _place = place;
        gateway_sources::doctor::examine_address(&address)
            .map_err(|error| ApiProblem::conflict(error.to_string(), "look at the address"))
    });
    let report = report.await?;
    let mut document = report.to_json();
    document["schema"] = json!("doctor/1");
    document["address"] = json!(adapters::address::mask_secrets(&report.address));
    Ok(with_audit_note(Json(document), format!("looked at source {}", asked.source)))
}

fn now_s(shared: &ServerState) -> Result<u64, ApiProblem> {
    Ok(shared.require_status()?.at_ms.div_euclid(1000).unsigned_abs())
}

fn pack_archive(files: &[ArchivedFile], at_s: u64) -> Result<Vec<u8>, ApiProblem> {
    pack(files, at_s)
        .map_err(|error| ApiProblem::unavailable(format!("no archive could be made: {error}"), "look at the disk"))
}

fn collect_files(places: &BackupPaths) -> Result<Vec<ArchivedFile>, ApiProblem> {
    backup::collect_files(places).map_err(|error| match &error {
        BackupError::History(error) => describe_history_error(error),
        error => ApiProblem::unavailable(error.to_string(), "look at the data directory"),
    })
}

/// `GET /api/v1/backup`: a new backup as a download, without the rows of the history.
async fn download_backup(State(shared): State<ServerState>) -> Result<Response, ApiProblem> {
    let at_s = now_s(&shared)?;
    let bytes = run_blocking(move || pack_archive(&collect_files(&shared.configured.backup_paths())?, at_s)).await?;
    Ok(respond_with_download("application/gzip", &archive_name("backup", at_s), bytes))
}

/// The archive may be of another box: whoever restores has said so.
fn is_from_another_box(pairs: Vec<(String, String)>) -> Result<bool, ApiProblem> {
    const KEY: &str = "from_another_box";
    match QueryKeys::from_pairs(pairs, &[KEY])?.find_text(KEY) {
        None | Some("false") => Ok(false),
        Some("true") => Ok(true),
        Some(other) => Err(ApiProblem::bad_request(format!("{KEY}={other} is not usable"), "give true or false")),
    }
}

/// `POST /api/v1/restore`: what a backup holds takes the place of what is in force; what was learned, at the next start.
async fn restore_backup(
    State(shared): State<ServerState>,
    SignedIn(person): SignedIn,
    Pairs(pairs): HistoryQuery,
    body: Bytes,
) -> Result<Response, ApiProblem> {
    let (at_s, from_another_box) = (now_s(&shared)?, is_from_another_box(pairs)?);
    let done = run_blocking(move || {
        let files = unpack(&body).map_err(|error| {
            ApiProblem::bad_request(
                format!("this is no backup: {error}"),
                "give the file that `Take a backup` has made",
            )
        })?;
        let places = shared.configured.backup_paths();
        let before = pack_archive(&collect_files(&places)?, at_s)?;
        let cannot = |error: RestoreError| match &error {
            RestoreError::OtherBox { .. } => ApiProblem::conflict(
                error.to_string(),
                "nothing was changed; where that is meant, send it with ?from_another_box=true",
            ),
            RestoreError::BrokeOff { .. } => ApiProblem::unavailable(error.to_string(), "look at the disk"),
            error => ApiProblem::bad_request(error.to_string(), error.describe_state()),
        };
        let at_ns = seconds_to_instant(at_s);
        let ask = RestoreRequest {
            by: &person.name,
            at_ns,
            before: (&before, &archive_name("before-restore", at_s)),
            from_another_box,
        };
        backup::restore_backup(&places, &files, ask).map_err(cannot)
    });
    let done = done.await?;
    Ok(with_audit_note(Json(json!({ "schema": "order/1", "done": true, "text": done })), done))
}

/// `GET /api/v1/support`: an archive for support, without secrets.
async fn download_support_bundle(State(shared): State<ServerState>) -> Result<Response, ApiProblem> {
    let (at_s, status) = (now_s(&shared)?, shared.require_status()?);
    let bytes = run_blocking(move || {
        let text = |value: &Value| format!("{value:#}\n").into_bytes();
        let mut files: Vec<ArchivedFile> = vec![("configuration.json".to_owned(), text(&shared.configured.to_json()))];
        let status = serde_json::to_value(&*status).unwrap_or(Value::Null);
        files.push(("status.json".to_owned(), text(&without_secrets(status))));
        let reader = Reader::open(&shared.history).map_err(|error| describe_history_error(&error))?;
        for (name, found) in history_of(&reader) {
            files.push((name.to_owned(), text(&found)));
        }
        files.push(("about.txt".to_owned(), describe_bundle().into_bytes()));
        pack_archive(&files, at_s)
    });
    Ok(respond_with_download("application/gzip", &archive_name("support", at_s), bytes.await?))
}

/// Addresses in the status, masked as in the configuration.
fn without_secrets(mut status: Value) -> Value {
    for list in ["sources", "sinks"] {
        for one in status[list].as_array_mut().into_iter().flatten() {
            for key in ["name", "address"] {
                if let Some(text) = one[key].as_str().map(adapters::address::mask_secrets) {
                    one[key] = json!(text);
                }
            }
        }
    }
    status
}

/// The newest of everything that is told in words; what cannot be read says so in its place.
fn history_of(reader: &Reader) -> [(&'static str, Value); 5] {
    fn to_json_or_error<T: serde::Serialize, E: std::fmt::Display>(found: Result<T, E>) -> Value {
        found.map_or_else(
            |error| json!({ "error": error.to_string() }),
            |it| serde_json::to_value(it).unwrap_or(Value::Null),
        )
    }
    let newest = || RecordSpan::newest(ROWS);
    [
        ("history.json", to_json_or_error(reader.read_info())),
        ("events.json", to_json_or_error(reader.read_events(newest()))),
        ("alarms.json", to_json_or_error(reader.read_alarms(newest()))),
        ("diagnoses.json", to_json_or_error(reader.read_diagnoses(RecordSpan::newest(5)))),
        ("audit.json", to_json_or_error(reader.read_audit(0, i64::MAX, ROWS).map(|rows| audit_document(&rows)))),
    ]
}

fn describe_bundle() -> String {
    format!(
        "cnc-gateway {}\n\nWhat a helper needs: the configuration in force (secrets masked), the status, the newest events, alarms, diagnoses\nand rows of the audit. No token, key, password, script or sample is in it. Names of persons, programs and tools are.\n",
        env!("CARGO_PKG_VERSION")
    )
}
