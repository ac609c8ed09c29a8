//! A port of the box, for sinks whose readers come to it.

use super::SinkError;
use adapter_core::address::Endpoint;
use tokio::net::TcpListener;

/// Opens the port.
///
/// # Errors
/// Another program has it, or the address is not one of this box.
pub(super) async fn listen_on(at: &Endpoint) -> Result<TcpListener, SinkError> {
    let Endpoint { host, port } = at;
    TcpListener::bind((host.as_str(), *port)).await.map_err(|error| {
        let next = "end the program that has the port, write another port, or an address of this box (0.0.0.0: all)";
        SinkError::failed_line(format!("the box cannot listen on {host}:{port}: {error}"), next)
    })
}
