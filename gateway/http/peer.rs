//! Who is at the other end of a connection.

use std::net::{IpAddr, SocketAddr};

/// Stands in the extensions of every request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Peer {
    /// Address of the client.
    pub(super) from: IpAddr,
    /// Address and port of this box that the client has connected to.
    pub(super) to: SocketAddr,
    /// Is the connection encrypted?
    pub(super) tls: bool,
}

impl Peer {
    /// An address of version 4 that came in the form of version 6 is the same address.
    pub(super) fn new(from: SocketAddr, to: SocketAddr, tls: bool) -> Self {
        Self { from: from.ip().to_canonical(), to: SocketAddr::new(to.ip().to_canonical(), to.port()), tls }
    }

    pub(super) fn scheme(&self) -> &'static str {
        if self.tls { "https" } else { "http" }
    }
}
