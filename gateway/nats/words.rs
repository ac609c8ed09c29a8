//! What is wrong with a NATS server, and what to do next.

use super::NatsError;
use adapter_core::address::Endpoint;
use device_line::tls::TlsError;
use std::io::{self, ErrorKind};

/// The connection could not be made or broke.
pub(super) fn of_io(at: &Endpoint, error: &io::Error) -> NatsError {
    if let Some(error) = TlsError::from_io_error(error, &at.host) {
        return NatsError::new(error.what, error.next);
    }
    let place = format!("{}:{}", at.host, at.port);
    let (what, next) = match error.kind() {
        ErrorKind::ConnectionRefused => (
            format!("{place} refuses the connection"),
            "look whether the NATS server runs there and listens on this port (4222 is usual)",
        ),
        ErrorKind::TimedOut => (
            format!("{place} does not answer"),
            "look whether the server is on, the address is right, and no firewall stands between",
        ),
        ErrorKind::UnexpectedEof | ErrorKind::ConnectionReset | ErrorKind::BrokenPipe => {
            (format!("{place} closed the connection"), "look at the log of the NATS server")
        }
        _ => (format!("{place} cannot be reached: {error}"), "look at the name of the server and at the network"),
    };
    NatsError::new(what, next)
}

/// Something else than NATS answers there.
pub(super) fn no_nats(at: &Endpoint, came: &str) -> NatsError {
    let what = format!("{}:{} does not speak NATS: {came}", at.host, at.port);
    NatsError::new(what, "use the port of NATS clients, usually 4222, not that of MQTT, WebSocket or monitoring")
}

/// The server wants TLS and the address has none, or the other way round.
pub(super) fn tls_differs(at: &Endpoint, wanted: bool) -> NatsError {
    let place = format!("{}:{}", at.host, at.port);
    match wanted {
        true => {
            NatsError::new(format!("{place} asks for TLS"), "write the address with natss://, and ca= where needed")
        }
        false => NatsError::new(
            format!("{place} does not speak TLS"),
            "switch TLS on in its configuration, or write nats://",
        ),
    }
}

/// What a server complains about with `-ERR`. The protocol gives words and no number, and the words are part of it: the list of
/// *NATS protocol, +OK/-ERR*. This is the only place that reads them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ServerComplaint {
    SignIn,
    Permissions,
    Connections,
    Payload,
    Slowness,
    Other,
}

impl ServerComplaint {
    /// Words of the protocol, and what each is about. Some end with the subject or the user that is meant.
    const WORDS: [(&str, Self); 7] = [
        ("authorization", Self::SignIn),
        ("authentication", Self::SignIn),
        ("permissions violation", Self::Permissions),
        ("maximum connections", Self::Connections),
        ("payload", Self::Payload),
        ("slow consumer", Self::Slowness),
        ("stale connection", Self::Slowness),
    ];

    fn from_protocol(said: &str) -> Self {
        let low = said.to_ascii_lowercase();
        Self::WORDS.iter().find(|(words, _)| low.contains(words)).map_or(Self::Other, |(_, about)| *about)
    }

    fn next_step(self) -> &'static str {
        match self {
            Self::SignIn => {
                "compare user=, password_file=, token_file= or the client certificate with the server's users"
            }
            Self::Permissions => {
                "allow this user to publish and subscribe to the subjects that the handbook lists under NATS (chapter outputs)"
            }
            Self::Connections => "raise max_connections of the server, or look who holds so many",
            Self::Payload => "raise max_payload of the server",
            Self::Slowness => "look whether the network or this computer is overloaded",
            Self::Other => "look at the log of the NATS server",
        }
    }
}

/// `-ERR`: what the server says.
pub(super) fn of_server(at: &Endpoint, said: &str) -> NatsError {
    let next = ServerComplaint::from_protocol(said).next_step();
    NatsError::new(format!("{}:{} says {said:?}", at.host, at.port), next)
}

/// Nobody answers a request.
pub(super) fn no_answer(at: &Endpoint, what: &str) -> NatsError {
    let what = format!("{}:{} did not answer in time: {what}", at.host, at.port);
    NatsError::new(
        what,
        "JetStream has no leader while fewer than half of its servers run: look at `nats-server` on each",
    )
}

/// JetStream is not there.
pub(super) fn no_jetstream(at: &Endpoint) -> NatsError {
    let what = format!("{}:{} has no JetStream", at.host, at.port);
    NatsError::new(what, "add `jetstream { store_dir: ... }` to its configuration; a leaf node needs `domain` too")
}

/// No stream takes this subject.
pub(super) fn no_stream(subject: &str) -> NatsError {
    let next = "create one with `cnc-gateway fleet stream nats://...`; while a cluster chooses a new leader this passes by itself";
    NatsError::new(format!("no stream takes the subject {subject}"), next)
}

/// An error of the JetStream interface: number and description as the server gives them.
pub(super) fn of_jetstream(code: u64, said: &str) -> NatsError {
    let next = match code {
        10023 | 10047 | 10077 | 10122 | 10028 => {
            "the stream or its disk is full: raise its limits, or look whether `fleet ingest` runs; the box keeps what waits"
        }
        10005 | 10074 => {
            "fewer servers run than the stream has replicas: start the others, or create it with fewer replicas"
        }
        10039 | 10076 => "switch JetStream on for this account",
        10058 | 10065 => {
            "a stream with this name or these subjects exists with other settings: use it, or choose another name"
        }
        10008 | 10009 => "the cluster chooses a new leader: this passes by itself",
        _ => "look up the number in the documentation of JetStream",
    };
    NatsError::new(format!("JetStream says {said:?} (error {code})"), next)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_of_the_protocol_are_known() {
        for (said, about) in [
            ("Authorization Violation", ServerComplaint::SignIn),
            ("User Authentication Expired", ServerComplaint::SignIn),
            ("Permissions Violation for Publish to \"payload.1\"", ServerComplaint::Permissions),
            ("Maximum Connections Exceeded", ServerComplaint::Connections),
            ("Maximum Payload Violation", ServerComplaint::Payload),
            ("Slow Consumer", ServerComplaint::Slowness),
            ("Stale Connection", ServerComplaint::Slowness),
            ("Unknown Protocol Operation", ServerComplaint::Other),
        ] {
            assert_eq!(ServerComplaint::from_protocol(said), about, "{said}");
        }
    }
}
