//! One connection to one server. Every wait of [`Connection::next`] may be dropped and begun again.

use super::wire::{ReceivedBytes, ServerInfo, ServerOperation};
use super::{NatsError, NatsTarget, words};
use adapter_core::address::Endpoint;
use serde_json::json;
use std::time::Duration;
use std::{fmt, io};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::{Instant, timeout_at};
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::pki_types::ServerName;

pub use super::wire::Message;

/// Connecting and each request may take this long: a slow line over a mobile network.
pub(super) const DEADLINE: Duration = Duration::from_secs(10);
/// The subscription that answers come through.
const ANSWERS: u64 = 1;
/// Bytes read at a time.
const CHUNK: usize = 64 * 1024;

trait Duplex: AsyncRead + AsyncWrite + Send + Unpin {}
impl<T: AsyncRead + AsyncWrite + Send + Unpin> Duplex for T {}

/// A connection that has signed in.
pub struct Connection {
    stream: Box<dyn Duplex>,
    at: Endpoint,
    received: ReceivedBytes,
    waiting_out: Vec<u8>,
    info: ServerInfo,
    answers: String,
    next_token: u64,
    next_subscription: u64,
}

impl fmt::Debug for Connection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Connection").field("at", &self.at).field("info", &self.info).finish_non_exhaustive()
    }
}

impl Connection {
    /// Connects to the first server of the target that takes us, beginning with number `first`. `name` is shown in the
    /// server's list of connections.
    ///
    /// # Errors
    /// Why the last one did not.
    pub async fn open(target: &NatsTarget, first: usize, name: &str) -> Result<Self, NatsError> {
        let count = target.servers.len();
        let mut last = NatsError::new("the address names no server", "");
        for index in 0..count {
            let at = &target.servers[(first + index) % count];
            let until = Instant::now() + DEADLINE;
            let late = || words::of_io(at, &io::Error::from(io::ErrorKind::TimedOut));
            match timeout_at(until, Self::open_one(target, at, name)).await.unwrap_or_else(|_| Err(late())) {
                Ok(connection) => return Ok(connection),
                Err(error) => last = error,
            }
        }
        Err(last)
    }

    async fn open_one(target: &NatsTarget, at: &Endpoint, name: &str) -> Result<Self, NatsError> {
        let secrets = target.read_secrets()?;
        let broken = |error: io::Error| words::of_io(at, &error);
        let config = target.tls.as_ref().map(device_line::tls::TlsFiles::build_config).transpose();
        let config = config.map_err(|error| NatsError::new(error.what, error.next))?;
        let stream = TcpStream::connect((at.host.as_str(), at.port)).await.map_err(broken)?;
        stream.set_nodelay(true).map_err(broken)?;
        let mut connection = Self {
            stream: Box::new(stream),
            at: at.clone(),
            received: ReceivedBytes::default(),
            waiting_out: Vec::new(),
            info: ServerInfo::default(),
            answers: format!("_INBOX.{}", adapter_core::unique_id::generate_unique_id()),
            next_token: 0,
            next_subscription: ANSWERS + 1,
        };
        connection.info = match connection.receive_operation().await? {
            ServerOperation::Info(info) => info,
            other => return Err(words::no_nats(at, &format!("{other:?}"))),
        };
        let offers = connection.info.tls_required || connection.info.tls_available;
        match config {
            None if connection.info.tls_required => return Err(words::tls_differs(at, true)),
            Some(_) if !offers => return Err(words::tls_differs(at, false)),
            None => {}
            Some(config) => {
                let host = ServerName::try_from(at.host.clone()).map_err(|error| broken(io::Error::other(error)))?;
                let plain = std::mem::replace(&mut connection.stream, Box::new(tokio::io::empty()));
                connection.stream = Box::new(TlsConnector::from(config).connect(host, plain).await.map_err(broken)?);
            }
        }
        connection.sign_in(&secrets, target.tls.is_some(), name).await?;
        Ok(connection)
    }

    async fn sign_in(&mut self, secrets: &super::target::Secrets, secured: bool, name: &str) -> Result<(), NatsError> {
        let mut says = json!({
            "verbose": false, "pedantic": false, "tls_required": secured, "name": name, "lang": "cnc-gateway",
            "version": env!("CARGO_PKG_VERSION"), "protocol": 1, "echo": false, "headers": true, "no_responders": true,
        });
        if let Some((user, password)) = &secrets.login {
            (says["user"], says["pass"]) = (json!(user), json!(password));
        }
        if let Some(token) = &secrets.token {
            says["auth_token"] = json!(token);
        }
        let text = format!("CONNECT {says}\r\nPING\r\nSUB {}.* {ANSWERS}\r\n", self.answers);
        self.waiting_out.extend(text.as_bytes());
        loop {
            match self.receive_operation().await? {
                ServerOperation::Pong => return Ok(()),
                ServerOperation::Error(said) => return Err(words::of_server(&self.at, &said)),
                _ => {}
            }
        }
    }

    /// The greatest payload that the server takes, bytes.
    #[must_use]
    pub fn max_payload(&self) -> usize {
        self.info.max_payload
    }

    pub(super) fn current_endpoint(&self) -> &Endpoint {
        &self.at
    }

    /// A new subject for an answer, and the word at its end.
    pub(super) fn answer_subject(&mut self) -> (String, u64) {
        self.next_token += 1;
        (format!("{}.{}", self.answers, self.next_token), self.next_token)
    }

    /// The word at the end of the subject of an answer.
    pub(super) fn token_of(&self, message: &Message) -> Option<u64> {
        message.subject.strip_prefix(&self.answers)?.strip_prefix('.')?.parse().ok()
    }

    /// Subscribes; the number comes with each message.
    pub(super) fn subscribe(&mut self, subject: &str) -> u64 {
        let number = self.next_subscription;
        self.next_subscription += 1;
        self.put_line(&format!("SUB {subject} {number}"));
        number
    }

    /// Puts a line into what is sent next.
    pub(super) fn put_line(&mut self, line: &str) {
        self.waiting_out.extend(line.as_bytes());
        self.waiting_out.extend(b"\r\n");
    }

    /// Puts a message into what is sent next.
    pub(super) fn queue_message(&mut self, subject: &str, reply: Option<&str>, id: Option<&str>, payload: &[u8]) {
        let reply = reply.map_or(String::new(), |reply| format!("{reply} "));
        let header = id.map_or(String::new(), |id| format!("NATS/1.0\r\nNats-Msg-Id: {id}\r\n\r\n"));
        let line = match header.len() {
            0 => format!("PUB {subject} {reply}{}\r\n", payload.len()),
            length => format!("HPUB {subject} {reply}{length} {}\r\n", length + payload.len()),
        };
        self.waiting_out.extend(line.as_bytes());
        self.waiting_out.extend(header.as_bytes());
        self.waiting_out.extend(payload);
        self.waiting_out.extend(b"\r\n");
    }

    /// Sends what waits.
    ///
    /// # Errors
    /// The connection is over.
    pub async fn flush(&mut self) -> Result<(), NatsError> {
        while !self.waiting_out.is_empty() {
            let count = self.stream.write(&self.waiting_out).await.map_err(|error| words::of_io(&self.at, &error))?;
            if count == 0 {
                return Err(words::of_io(&self.at, &io::ErrorKind::BrokenPipe.into()));
            }
            self.waiting_out.drain(..count);
        }
        self.stream.flush().await.map_err(|error| words::of_io(&self.at, &error))
    }

    /// The next message. Answers the server's signs of life meanwhile.
    ///
    /// # Errors
    /// The connection is over, or the server refuses what was asked.
    pub async fn next(&mut self) -> Result<Message, NatsError> {
        loop {
            match self.receive_operation().await? {
                ServerOperation::Message(message) => return Ok(message),
                ServerOperation::Error(said) => return Err(words::of_server(&self.at, &said)),
                ServerOperation::Info(info) if info.ldm => {
                    let what = format!("{}:{} is about to stop", self.at.host, self.at.port);
                    return Err(NatsError::new(what, "the next server is used, where the address names one"));
                }
                ServerOperation::Info(info) => self.info = info,
                _ => {}
            }
        }
    }

    async fn receive_operation(&mut self) -> Result<ServerOperation, NatsError> {
        loop {
            match self.received.next_operation().map_err(|came| words::no_nats(&self.at, &came.to_string()))? {
                Some(ServerOperation::Ping) => self.waiting_out.extend(b"PONG\r\n"),
                Some(operation) => return Ok(operation),
                None => {
                    self.flush().await?;
                    self.received.bytes.reserve(CHUNK);
                    let read = self.stream.read_buf(&mut self.received.bytes).await;
                    if read.map_err(|error| words::of_io(&self.at, &error))? == 0 {
                        return Err(words::of_io(&self.at, &io::ErrorKind::UnexpectedEof.into()));
                    }
                }
            }
        }
    }

    /// Asks and waits for the answer; other messages that come meanwhile are left out.
    ///
    /// # Errors
    /// No answer in time, nobody who could answer, or the connection is over.
    pub(super) async fn request_reply(&mut self, subject: &str, payload: &[u8]) -> Result<Message, NatsError> {
        let (reply, token) = self.answer_subject();
        self.queue_message(subject, Some(&reply), None, payload);
        let until = Instant::now() + DEADLINE;
        loop {
            let came = timeout_at(until, self.next()).await.map_err(|_| words::no_answer(&self.at, subject))??;
            if self.token_of(&came) == Some(token) {
                return Ok(came);
            }
        }
    }
}
