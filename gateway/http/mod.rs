//! The box on the network: the live page, the API, the metrics. Everything here only reads.
//!
//! Requests are answered from the latest [`Status`] or from the history through connections of their own; nothing a
//! client does makes the tick wait. Whatever a query says, the answer is a document or a problem with a hint.

mod files;
mod handbook;
mod history;
mod live;
mod metrics;
mod page;
mod problem;
mod query;
mod rules;
mod series;
mod server;
mod twin;
mod utilisation;
mod vocabulary;
mod wear;

pub use metrics::render as render_metrics;
pub use problem::ApiProblem;
pub use server::{Server, bind, port_trouble};
pub use vocabulary::{ESTIMATES, document as vocabulary, state as state_text};

use crate::config::Config;
use crate::status::Status;
use ::rules::physics::explain::Language;
use axum::Router;
use axum::http::{StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{MethodRouter, get};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::{Semaphore, watch};

/// The description of the API (OpenAPI 3.1), written by hand and held against [`ROUTES`] by a test.
pub const OPENAPI: &str = include_str!("openapi.json");

/// A status older than this means that the tick stands still.
const ALIVE_WITHIN: Duration = Duration::from_secs(5);

/// The latest status and when it came.
#[derive(Debug, Clone)]
pub struct Published {
    /// The document.
    pub status: Arc<Status>,
    /// When it was published, on the monotonic clock of this process.
    pub at: Instant,
}

/// What every request can see.
#[derive(Clone)]
pub struct Shared {
    live: watch::Receiver<Option<Published>>,
    listeners: Arc<Semaphore>,
    history: PathBuf,
    scripts: PathBuf,
    language: Option<Language>,
}

impl Shared {
    /// What the tick publishes, where history and scripts are, and the language in which the page opens if not the browser's.
    #[must_use]
    pub fn new(live: watch::Receiver<Option<Published>>, config: &Config) -> Self {
        Self {
            live,
            listeners: Arc::new(Semaphore::new(live::LISTENERS_MAX)),
            history: config.history.path.clone(),
            scripts: config.scripts.directory.clone(),
            language: config.gateway.language,
        }
    }

    fn status(&self) -> Result<Arc<Status>, ApiProblem> {
        let published = self.live.borrow();
        let starting = || ApiProblem::unavailable("the box is starting", "ask again in a second");
        published.as_ref().map(|published| published.status.clone()).ok_or_else(starting)
    }
}

/// A path and what answers there.
type Route = (&'static str, fn() -> MethodRouter<Shared>);

/// Everything that is served.
pub const ROUTES: [Route; 31] = [
    ("/", || get(page::page)),
    ("/now", || get(page::page)),
    ("/history", || get(page::page)),
    ("/wear", || get(page::page)),
    ("/thermal", || get(page::page)),
    ("/twin", || get(page::page)),
    ("/rules", || get(page::page)),
    ("/audit", || get(page::page)),
    ("/help", || get(page::page)),
    ("/web/{file}", || get(page::web)),
    ("/healthz", || get(healthz)),
    ("/metrics", || get(metrics::metrics)),
    ("/openapi.json", || get(openapi)),
    ("/api/v1/status", || get(status)),
    ("/api/v1/live", || get(live::live)),
    ("/api/v1/channels", || get(vocabulary::channels)),
    ("/api/v1/samples", || get(history::sample_series)),
    ("/api/v1/states", || get(history::states)),
    ("/api/v1/alarms", || get(history::alarms)),
    ("/api/v1/decisions", || get(history::decisions)),
    ("/api/v1/events", || get(history::events)),
    ("/api/v1/parts", || get(history::parts)),
    ("/api/v1/audit", || get(history::audit)),
    ("/api/v1/audit/verify", || get(history::verify)),
    ("/api/v1/twin", || get(twin::twin)),
    ("/api/v1/utilisation", || get(utilisation::utilisation)),
    ("/api/v1/series", || get(series::series)),
    ("/api/v1/wear", || get(wear::wear)),
    ("/api/v1/rules", || get(rules::rules)),
    ("/api/v1/rules/words", || get(rules::words)),
    ("/api/v1/handbook/{chapter}", || get(handbook::chapter)),
];

/// All routes with what they see.
pub fn router(shared: Shared) -> Router {
    ROUTES
        .iter()
        .fold(Router::new(), |router, (path, method)| router.route(path, method()))
        .fallback(|uri: Uri| async move { ApiProblem::not_found(uri.path()) })
        .with_state(shared)
}

async fn status(axum::extract::State(shared): axum::extract::State<Shared>) -> Response {
    shared.status().map(|status| axum::Json(&*status).into_response()).into_response()
}

async fn openapi() -> Response {
    ([(header::CONTENT_TYPE, "application/json")], OPENAPI).into_response()
}

/// `GET /healthz`: 200 while the tick goes on, 503 with the reason otherwise.
async fn healthz(axum::extract::State(shared): axum::extract::State<Shared>) -> Response {
    let Some(age) = shared.live.borrow().as_ref().map(|published| published.at.elapsed()) else {
        return ApiProblem::unavailable("the box is starting", "ask again in a second").into_response();
    };
    if age < ALIVE_WITHIN {
        return (StatusCode::OK, "ok\n").into_response();
    }
    let title = format!("the tick has stood still for {} s", age.as_secs());
    ApiProblem::unavailable(title, "look at the log; restart the gateway if it does not recover").into_response()
}
