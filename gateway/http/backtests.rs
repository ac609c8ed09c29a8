//! Edited scripts over the history: one run at a time, in the background, with its report kept until the next one.

use super::ServerState;
use super::guard::with_audit_note;
use super::person::{JsonBody, SignedIn};
use super::problem::ApiProblem;
use super::route::Route;
use super::rules::{check_name, on_disk, with};
use axum::Json;
use axum::extract::{Path, State};
use axum::response::Response;
use axum::routing::{get, post};
use gateway_access::Role;
use gateway_backtest::{BacktestPlan, run_backtest};
use gateway_base::moment;
use gateway_history::Reader;
use gateway_scripts::active_scripts;
use rules::script::{self, ScriptProblem, TEXT_MAX};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

pub(super) const ROUTES: &[Route] = &[
    Route::read("/api/v1/backtest", || get(serve_backtest)),
    Route::post(Role::Setter, "/api/v1/rules/{file}/backtest", 2 * TEXT_MAX + 4096, || post(begin_backtest)),
];

/// What is asked for.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Asked {
    text: String,
    #[serde(default)]
    #[expect(dead_code, reason = "sent with every text of the editor; a backtest changes nothing and needs it not")]
    digest: String,
    /// So long before the newest sample: `24h`.
    since: String,
}

/// The one run, and what came of it.
#[derive(Debug, Default)]
enum Run {
    #[default]
    None,
    Running {
        file: String,
        by: String,
        since: Instant,
    },
    Done(Value),
    Failed(String),
}

/// Shared by every request.
#[derive(Debug, Clone, Default)]
pub(super) struct Backtests(Arc<Mutex<Run>>);

impl Backtests {
    fn lock_run(&self) -> MutexGuard<'_, Run> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// `GET /api/v1/backtest`: the backtest under way, or the report of the last one.
async fn serve_backtest(State(shared): State<ServerState>) -> Json<Value> {
    Json(match &*shared.backtests.lock_run() {
        Run::None => json!({ "schema": "backtest-run/1", "state": "none" }),
        Run::Running { file, by, since } => {
            let seconds = since.elapsed().as_secs_f64();
            json!({ "schema": "backtest-run/1", "state": "running", "file": file, "by": by, "seconds": seconds })
        }
        Run::Done(report) => json!({ "schema": "backtest-run/1", "state": "done", "report": report }),
        Run::Failed(what) => json!({ "schema": "backtest-run/1", "state": "failed", "what": what }),
    })
}

/// `POST /api/v1/rules/{file}/backtest`: begins; `GET /api/v1/backtest` tells how it goes.
async fn begin_backtest(
    State(shared): State<ServerState>,
    Path(name): Path<String>,
    SignedIn(person): SignedIn,
    JsonBody(asked): JsonBody<Asked>,
) -> Result<Response, ApiProblem> {
    check_name(&name)?;
    let shown = shared.clone();
    let plan =
        super::blocking::run_blocking(move || plan_backtest(&shown, &name, &asked).map(|plan| (plan, name))).await;
    let (plan, name) = plan?;
    {
        let mut run = shared.backtests.lock_run();
        if let Run::Running { by, .. } = &*run {
            let title = format!("a backtest of {by} is under way");
            return Err(ApiProblem::conflict(title, "wait for it; there is one at a time"));
        }
        *run = Run::Running { file: name.clone(), by: person.name, since: Instant::now() };
    }
    let (backtests, free) = (shared.backtests.clone(), shared.backtests.clone());
    let work = move || {
        let done = match run_backtest(plan) {
            Ok(report) => Run::Done(report.to_json()),
            Err(error) => Run::Failed(error.to_string()),
        };
        *backtests.lock_run() = done;
    };
    let thread = std::thread::Builder::new().name("backtest".to_owned()).spawn(move || {
        // A run that breaks off leaves the place free.
        if std::panic::catch_unwind(std::panic::AssertUnwindSafe(work)).is_err() {
            *shared.backtests.lock_run() = Run::Failed("the run broke off; the log says more".to_owned());
        }
    });
    if let Err(error) = thread {
        *free.lock_run() = Run::None;
        return Err(ApiProblem::unavailable(format!("no thread for the run: {error}"), "try again"));
    }
    Ok(with_audit_note(Json(json!({ "schema": "backtest-run/1", "state": "running" })), format!("{name}: a backtest")))
}

fn plan_backtest(shared: &ServerState, name: &str, asked: &Asked) -> Result<BacktestPlan, ApiProblem> {
    let unusable = |found: Vec<ScriptProblem>| {
        let all: Vec<String> = found.iter().map(ToString::to_string).collect();
        ApiProblem::bad_request(all.join("\n"), "mend it; `Run trials` marks the line")
    };
    let newest = Reader::open(&shared.history).and_then(|reader| reader.read_present_span());
    let newest = newest.map_err(|error| ApiProblem::unavailable(error.to_string(), "look at the history"))?;
    let nothing = || ApiProblem::conflict("the history holds no samples yet", "let the box run for a while first");
    let (_, newest_ns) = newest.ok_or_else(nothing)?;
    let bad = |what: moment::MomentError| ApiProblem::bad_request(format!("since: {what}"), "write 24h, 7d or 90m");
    let from_ns = moment::parse(&format!("-{}", asked.since), newest_ns).map_err(bad)?;
    let files = on_disk(shared)?;
    let running = active_scripts::read_texts(&shared.data_dir).unwrap_or_else(|| files.clone());
    let values = super::rules::read_values(shared);
    Ok(BacktestPlan {
        history: shared.history.clone(),
        from_ns,
        to_ns: None,
        every_ns: 0,
        running: script::compile_with(&running, &values)
            .or_else(|_| script::compile_scripts(&running))
            .map_err(unusable)?,
        edited: script::compile_with(&with(files, name, &asked.text), &values).map_err(unusable)?,
    })
}
