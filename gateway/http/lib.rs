//! The box on the network: the page, the API, the metrics.
//!
//! Requests are answered from the latest [`Status`] or from the history through connections of their own; nothing a
//! client does makes the tick wait. Whatever a query says, the answer is a document or a problem with a hint.
//!
//! A request comes through three doors before a handler sees it: `connection` (how many connections, how slow a head may
//! come, TLS), `host` (is this box meant at all) and `guard` (who asks, from where, how long the body is). What the guard
//! demands stands in the row of the table of routes, see [`Route`].

mod backtests;
mod blocking;
mod body;
mod check_child;
mod configuration_file;
mod connection;
mod description;
mod diagnoses;
mod facts;
mod files;
pub mod gallery;
mod guard;
mod handbook;
mod headers;
mod history;
mod host;
mod identification;
mod live;
mod maintenance;
mod metrics;
mod operations;
mod orders;
mod page;
mod peer;
mod person;
mod plain;
mod problem;
mod query;
pub mod records;
mod route;
mod rules;
pub mod samples;
mod series;
mod server;
mod settings;
mod sign_in;
mod streams;
mod twin;
mod uploaded_files;
mod utilisation;
mod vocabulary;
mod wear;

pub use connection::{Certificate, CertificateError};
pub use description::{description, list_operations};
pub use maintenance::Configured;
pub use metrics::render_metrics;
pub use problem::ApiProblem;
pub use route::{Needs, Route, Verb};
pub use server::{Server, bind_port, port_trouble};
pub use vocabulary::{ESTIMATES, build_vocabulary as vocabulary, name_state as state_text};

use ::rules::physics::explain::Language;
use axum::Router;
use axum::http::{StatusCode, Uri, header};
use axum::middleware::{from_fn, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use backtests::Backtests;
use gateway_access::Access;
use gateway_control::OrderSender;
use gateway_diagnosis::files::FileDiagnoses;
use gateway_diagnosis::handle::DiagnosisHandle;
use gateway_status::{Published, Status};
use guard::{Guarded, guard_route};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use streams::Streams;
use tokio::sync::{Semaphore, watch};
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;

/// A status older than this means that the tick stands still.
const ALIVE_WITHIN: Duration = Duration::from_secs(5);

/// What the server is made from.
#[derive(Debug)]
pub struct ServerParts {
    /// What the tick publishes.
    pub live: watch::Receiver<Option<Published>>,
    /// Where the history is.
    pub history: PathBuf,
    /// Where the scripts are.
    pub scripts: PathBuf,
    /// Where everything else is that the box keeps.
    pub data_dir: PathBuf,
    /// The language in which the page opens, if not the browser's.
    pub language: Option<Language>,
    /// Who may do what.
    pub access: Arc<Access>,
    /// The way of orders to the tick.
    pub orders: OrderSender,
    /// Names by which browsers reach the box, besides its own addresses, in lower case.
    pub hosts: Vec<String>,
    /// Where diagnoses are asked for; `None` where no simulation runs beside the machine.
    pub diagnoses: Option<DiagnosisHandle>,
    /// The configuration in force, and the file it came from.
    pub configured: Configured,
}

/// What every request can see.
#[derive(Clone)]
pub struct ServerState {
    live: watch::Receiver<Option<Published>>,
    streams: Streams,
    readers: Arc<Semaphore>,
    history: PathBuf,
    scripts: PathBuf,
    data_dir: PathBuf,
    backtests: Backtests,
    language: Option<Language>,
    access: Arc<Access>,
    orders: OrderSender,
    hosts: Arc<[String]>,
    diagnoses: Option<DiagnosisHandle>,
    files: Option<FileDiagnoses>,
    configured: Configured,
    doctor: Arc<Semaphore>,
}

impl ServerState {
    /// What the routes share, made from these parts.
    #[must_use]
    pub fn new(parts: ServerParts) -> Self {
        let ServerParts {
            live,
            history,
            scripts,
            data_dir,
            language,
            access,
            orders: post,
            hosts,
            diagnoses,
            configured,
        } = parts;
        let readers = Arc::new(Semaphore::new(history::READERS_MAX));
        let files = FileDiagnoses::from_data_dir(&data_dir).ok();
        Self {
            live,
            streams: Streams::default(),
            readers,
            history,
            scripts,
            data_dir,
            backtests: Backtests::default(),
            language,
            access,
            orders: post,
            hosts: hosts.into(),
            diagnoses,
            files,
            configured,
            doctor: Arc::new(Semaphore::new(1)),
        }
    }

    fn require_status(&self) -> Result<Arc<Status>, ApiProblem> {
        let published = self.live.borrow();
        let starting = || ApiProblem::unavailable("the box is starting", "ask again in a second");
        published.as_ref().map(|published| published.status.clone()).ok_or_else(starting)
    }
}

/// What stands in this file.
const OWN: &[Route] = &[
    Route::for_file("/healthz", || get(serve_health)),
    Route::for_file("/openapi.json", || get(serve_description)),
    Route::read("/api/v1/status", || get(serve_status)),
];

/// The rows of every module.
const GROUPS: &[&[Route]] = &[
    OWN,
    page::ROUTES,
    plain::ROUTES,
    metrics::ROUTES,
    live::ROUTES,
    vocabulary::ROUTES,
    history::ROUTES,
    twin::ROUTES,
    diagnoses::ROUTES,
    uploaded_files::ROUTES,
    maintenance::ROUTES,
    configuration_file::ROUTES,
    identification::ROUTES,
    operations::ROUTES,
    series::ROUTES,
    utilisation::ROUTES,
    wear::ROUTES,
    handbook::ROUTES,
    rules::ROUTES,
    settings::ROUTES,
    backtests::ROUTES,
    sign_in::ROUTES,
    orders::ROUTES,
    facts::ROUTES,
];

/// Everything that is served.
pub fn list_routes() -> impl Iterator<Item = &'static Route> {
    GROUPS.iter().flat_map(|group| group.iter())
}

/// All routes with what they see, each behind its guard.
pub fn build_router(shared: ServerState) -> Router {
    let routes = list_routes().fold(Router::new(), |router, route| {
        let guarded = Guarded { shared: shared.clone(), route: *route };
        router.route(route.path(), route.method_router().route_layer(from_fn_with_state(guarded, guard_route)))
    });
    let routes = routes
        // How long a body may be stands in the row of its route, and the guard has read it by then: the library's own limit of 2 MB
        // would be another one.
        .layer(axum::extract::DefaultBodyLimit::disable())
        .fallback(|uri: Uri| async move { ApiProblem::not_found(uri.path()) })
        .layer(from_fn(in_our_words))
        .layer(CompressionLayer::new())
        .layer(CatchPanicLayer::custom(|_| ApiProblem::internal_error().into_response()))
        .layer(from_fn_with_state(shared.clone(), host::guard_host));
    headers::add_headers(routes).with_state(shared)
}

/// What the library refuses by itself is told as everything else is: a wrong method, a query that cannot be read.
async fn in_our_words(request: axum::extract::Request, next: axum::middleware::Next) -> Response {
    let answer = next.run(request).await;
    let plain = |kind: &header::HeaderValue| kind.to_str().is_ok_and(|kind| kind.starts_with("text/plain"));
    let own = answer.headers().get(header::CONTENT_TYPE).is_some_and(|kind| !plain(kind));
    match answer.status() {
        StatusCode::METHOD_NOT_ALLOWED if !own => {
            let allow = answer.headers().get(header::ALLOW).cloned();
            let takes = allow.as_ref().and_then(|value| value.to_str().ok()).unwrap_or("other methods").to_owned();
            let mut told = ApiProblem::method_not_allowed(&takes).into_response();
            allow.map(|value| told.headers_mut().insert(header::ALLOW, value));
            told
        }
        StatusCode::BAD_REQUEST if !own => {
            let hint = "GET /openapi.json describes every address";
            ApiProblem::bad_request("the address or its query cannot be read", hint).into_response()
        }
        _ => answer,
    }
}

async fn serve_status(axum::extract::State(shared): axum::extract::State<ServerState>) -> Response {
    shared.require_status().map(|status| axum::Json(&*status).into_response()).into_response()
}

async fn serve_description() -> Response {
    ([(header::CONTENT_TYPE, "application/json")], description()).into_response()
}

/// `GET /healthz`: 200 while the tick goes on, 503 with the reason otherwise.
async fn serve_health(axum::extract::State(shared): axum::extract::State<ServerState>) -> Response {
    adapters::threads::reach_fault_point("serve");
    let Some(age) = shared.live.borrow().as_ref().map(|published| published.at.elapsed()) else {
        return ApiProblem::unavailable("the box is starting", "ask again in a second").into_response();
    };
    if age < ALIVE_WITHIN {
        return (StatusCode::OK, "ok\n").into_response();
    }
    let title = format!("the tick has stood still for {} s", age.as_secs());
    ApiProblem::unavailable(title, "look at the log; restart the gateway if it does not recover").into_response()
}
