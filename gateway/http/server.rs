//! The listening socket: bound before anything else starts when the user asked for it, retried otherwise.

use super::{Certificate, CertificateError, ServerState, build_router, connection};
use gateway_base::log::{Notice, Severity};
use std::net::SocketAddr;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::watch;

/// Pause between two tries to get a port that another program holds.
const RETRY: Duration = Duration::from_secs(5);

/// Why nothing listens, in words for the operator.
#[must_use]
pub fn port_trouble(listen: SocketAddr, error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::AddrInUse => {
            format!("port {} on {} is in use by another program", listen.port(), listen.ip())
        }
        std::io::ErrorKind::PermissionDenied => format!("port {} may not be opened by this user", listen.port()),
        _ => format!("{listen} cannot be opened: {error}"),
    }
}

/// Opens the port.
///
/// # Errors
/// What the system said; see [`port_trouble`] for words.
pub async fn bind_port(listen: SocketAddr) -> std::io::Result<TcpListener> {
    TcpListener::bind(listen).await
}

/// The server and how to end it.
#[derive(Debug)]
pub struct Server {
    stop: watch::Sender<bool>,
    task: tokio::task::JoinHandle<()>,
}

impl Server {
    /// Serves on `listener`, or keeps trying to open `listen` when there is none; over TLS where `certificate` gives one, asked
    /// again and again while it cannot be read.
    /// `report` says why nothing listens while that is so.
    #[must_use]
    pub fn start(
        (listen, listener): (SocketAddr, Option<TcpListener>),
        certificate: impl Fn() -> Result<Option<Certificate>, CertificateError> + Send + Sync + 'static,
        shared: ServerState,
        report: watch::Sender<Option<String>>,
    ) -> Self {
        let (stop, stopped) = watch::channel(false);
        let task = tokio::spawn(serve_until_stopped((listen, listener), certificate, shared, stopped, report));
        Self { stop, task }
    }

    /// Answers what is being asked, then closes; gives up waiting after two seconds.
    pub async fn stop(self) {
        let _nobody_left = self.stop.send(true);
        let _gave_up = tokio::time::timeout(Duration::from_secs(2), self.task).await;
    }
}

async fn serve_until_stopped(
    (listen, listener): (SocketAddr, Option<TcpListener>),
    load_certificate: impl Fn() -> Result<Option<Certificate>, CertificateError> + Send + Sync,
    shared: ServerState,
    mut stopped: watch::Receiver<bool>,
    report: watch::Sender<Option<String>>,
) {
    let certificate = tokio::select! {
        loaded = keep_loading(&load_certificate, &report) => loaded,
        _ = stopped.wait_for(|stop| *stop) => return,
    };
    let listener = match listener {
        Some(listener) => listener,
        None => tokio::select! {
            opened = keep_trying(listen, &report) => opened,
            _ = stopped.wait_for(|stop| *stop) => return,
        },
    };
    report.send_replace(None);
    let address = listener.local_addr().unwrap_or(listen);
    let scheme = if certificate.is_some() { "https" } else { "http" };
    Notice::new(Severity::Info, "serving", format!("live page: {scheme}://{address}/")).write_to_logs();
    if let Some(certificate) = &certificate {
        let text = format!(
            "the certificate is {}; a browser that asks shows the SHA-256 fingerprint {}",
            certificate.file.display(),
            certificate.fingerprint
        );
        Notice::new(Severity::Info, "certificate", text).write_to_logs();
    }
    connection::serve_connections(listener, certificate.map(|it| it.acceptor()), build_router(shared), stopped).await;
}

async fn keep_trying(listen: SocketAddr, report: &watch::Sender<Option<String>>) -> TcpListener {
    loop {
        match bind_port(listen).await {
            Ok(listener) => return listener,
            Err(error) => say_once(report, listen, &error),
        }
        tokio::time::sleep(RETRY).await;
    }
}

/// A certificate that is missing today may be there tomorrow: somebody is renewing it, or its disk is not mounted yet.
async fn keep_loading(
    load_certificate: &(impl Fn() -> Result<Option<Certificate>, CertificateError> + Send + Sync),
    report: &watch::Sender<Option<String>>,
) -> Option<Certificate> {
    loop {
        match load_certificate() {
            Ok(certificate) => return certificate,
            Err(error) => say_trouble(report, error.to_string(), ("no_certificate", String::new())),
        }
        tokio::time::sleep(RETRY).await;
    }
}

fn say_once(report: &watch::Sender<Option<String>>, listen: SocketAddr, error: &std::io::Error) {
    say_trouble(report, port_trouble(listen, error), ("port_in_use", error.to_string()));
}

fn say_trouble(report: &watch::Sender<Option<String>>, trouble: String, (code, detail): (&'static str, String)) {
    let new = report.send_if_modified(|known| {
        let changed = known.as_ref() != Some(&trouble);
        *known = Some(trouble.clone());
        changed
    });
    if new {
        let text = format!("{trouble}: no page for now. Polling goes on; trying again every {} s", RETRY.as_secs());
        Notice::new(Severity::Warning, code, text).with_detail(detail).write_to_logs();
    }
}
