//! What every sink that sends through an MQTT broker has in common: address keys, connection, words.

use super::SinkError;
use super::target_error::TargetError;
use adapter_core::address::{Endpoint, Keys, Login, parse_endpoint};
use device_line::tls::TlsFiles;
use mqtt::{MqttClient, MqttError, MqttMessage, Options, Outgoing, Qos, Version, Will};
use std::sync::Arc;
use std::time::Duration;

/// A connection and each acknowledgement may take this long: a slow line over a mobile network.
const DEADLINE: Duration = Duration::from_secs(10);
/// An idle connection is looked at this often.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// A broker as an address names it.
#[derive(Debug, Clone, PartialEq)]
pub struct BrokerTarget {
    /// Host and port of the broker.
    pub at: Endpoint,
    /// The files of TLS, where the line is secured.
    pub tls: Option<TlsFiles>,
    /// User and password file; both empty where the broker wants none.
    pub login: Login,
    /// The version that is spoken.
    pub version: Version,
    /// Name of the client; `None`: one that is made of the names of box and sink.
    pub client_id: Option<String>,
    /// Keep-alive time of MQTT; 20 s by default.
    pub keep_alive: Duration,
}

impl BrokerTarget {
    /// Takes the keys of a broker from an address `//HOST:PORT/REST`, and gives the rest.
    ///
    /// # Errors
    /// The host is none, in words.
    pub(super) fn parse<'a>(body: &'a str, keys: &mut Keys, secured: bool) -> Result<(Self, &'a str), TargetError> {
        let tls = TlsFiles::from_keys(keys, secured);
        let login = Login::from_keys(keys);
        let version = keys.take_choice("protocol", &[("3.1.1", Version::V3), ("5", Version::V5)]);
        let client_id = keys.take_text("client_id");
        let keep_alive = Duration::from_secs(keys.take_number("keep_alive_s", 20, 2, 3600));
        let body = body.strip_prefix("//").unwrap_or(body);
        let (host, rest) = body.split_once('/').unwrap_or((body, ""));
        let at = parse_endpoint(host, Some(if secured { 8883 } else { 1883 })).map_err(TargetError::Host)?;
        Ok((Self { at, tls, login, version, client_id, keep_alive }, rest.trim_end_matches('/')))
    }

    /// What is wrong with the files that the address names, each with what to do.
    #[must_use]
    pub fn find_file_problems(&self) -> Vec<(String, String)> {
        broker_files(self.tls.as_ref(), &self.login)
    }

    fn build_options(&self, name: &str, will: Option<Will>) -> Result<Options, SinkError> {
        let login = self.login.read().map_err(|(file, error)| {
            let what = format!("the password file {} cannot be read: {error}", file.display());
            SinkError::failed_line(what, READABLE)
        })?;
        let client_id = self.client_id.clone().unwrap_or_else(|| format!("cnc-gateway-{name}"));
        Ok(Options {
            client_id,
            login,
            version: self.version,
            tls: self.tls.clone(),
            will,
            keep_alive: self.keep_alive,
            deadline: DEADLINE,
            ..Options::new(&self.at.host, self.at.port, "")
        })
    }
}

const READABLE: &str = "make it readable for the gateway's user, or write another path";

/// The name of a client that is the same at every start: of the box, and of the sink, which may be a long address.
pub(super) fn client_name(box_id: &str, sink: &str) -> String {
    // FNV-1a, which tells the few sinks of a box apart.
    let digits = sink.bytes().fold(0x811c_9dc5_u32, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193));
    format!("{box_id}-{digits:08x}")
}

/// What is wrong with the files of TLS and of the password, each with what to do.
#[must_use]
pub fn broker_files(tls: Option<&TlsFiles>, login: &Login) -> Vec<(String, String)> {
    let mut problems = Vec::new();
    if let Some(Err(error)) = tls.map(TlsFiles::build_config) {
        problems.push((error.what, error.next));
    }
    if let Err((file, error)) = login.read() {
        problems.push((format!("the password file {} cannot be read: {error}", file.display()), READABLE.to_owned()));
    }
    problems
}

/// A connection to a broker, waited for asynchronously. Without one, nothing can be sent.
#[derive(Debug, Default)]
pub(super) struct Link {
    client: Option<Arc<MqttClient>>,
}

impl Link {
    /// Connects anew; an older connection is left.
    pub(super) async fn connect(
        &mut self,
        broker: &BrokerTarget,
        name: &str,
        will: Option<Will>,
    ) -> Result<(), SinkError> {
        self.disconnect_client().await;
        let options = broker.build_options(name, will)?;
        let place = format_place(broker);
        let connected = run_blocking(move || MqttClient::connect(&options)).await?;
        self.client = Some(Arc::new(connected.map_err(|error| to_line_error(&place, error))?));
        Ok(())
    }

    /// Connects and leaves, under a name that no running box has.
    pub(super) async fn probe_broker(&mut self, broker: &BrokerTarget) -> Result<(), SinkError> {
        let own = BrokerTarget { client_id: None, ..broker.clone() };
        self.connect(&own, &format!("doctor-{}", adapter_core::unique_id::generate_unique_id()), None).await?;
        self.disconnect_client().await;
        Ok(())
    }

    /// Says goodbye: the broker does not publish the will.
    pub(super) async fn disconnect_client(&mut self) {
        if let Some(client) = self.client.take() {
            // Ending the reading thread takes a moment.
            let _ended = run_blocking(move || drop(client)).await;
        }
    }

    /// Sends messages in this order; on failure the index of the first that is not known to have arrived.
    pub(super) async fn publish_messages(
        &self,
        messages: Vec<Outgoing>,
        qos: Qos,
        broker: &BrokerTarget,
    ) -> Result<(), (usize, BrokerFailure)> {
        let place = format_place(broker);
        let failed = |error| (0, BrokerFailure::Line(error));
        let client = self.client.clone().ok_or_else(|| failed(not_connected(&place)))?;
        let sent = run_blocking(move || client.publish_all(&messages, qos)).await.map_err(failed)?;
        sent.map_err(|(index, error)| match error {
            MqttError::Unsendable(what) => (index, BrokerFailure::Message(what)),
            other => (index, BrokerFailure::Line(to_line_error(&place, other))),
        })
    }

    pub(super) async fn subscribe_to(
        &self,
        filters: Vec<String>,
        qos: Qos,
        broker: &BrokerTarget,
    ) -> Result<(), SinkError> {
        let place = format_place(broker);
        let client = self.client.clone().ok_or_else(|| not_connected(&place))?;
        run_blocking(move || client.subscribe_filters(&filters, qos))
            .await?
            .map_err(|error| to_line_error(&place, error))
    }

    /// The next message of a subscription; an error when the connection is over. May be dropped while it waits.
    pub(super) async fn next(&self, broker: &BrokerTarget) -> Result<MqttMessage, SinkError> {
        loop {
            let Some(client) = &self.client else { return Err(not_connected(&format_place(broker))) };
            match client.receive_message(Duration::ZERO) {
                Ok(Some(message)) => return Ok(message),
                Ok(None) => tokio::time::sleep(LOOK_EVERY).await,
                Err(error) => return Err(to_line_error(&format_place(broker), error)),
            }
        }
    }
}

/// Why a message did not arrive.
#[derive(Debug)]
pub(super) enum BrokerFailure {
    /// The connection is of no use any more, or nothing goes through it now.
    Line(SinkError),
    /// This message will never be taken.
    Message(String),
}

impl BrokerFailure {
    /// The same for an item; `None` for a message that the receiver needs and that is no item.
    pub(super) fn of_item(self, sequence: Option<u64>) -> SinkError {
        let next = "shorten the topic, or raise the size that the broker takes";
        match (self, sequence) {
            (Self::Line(error), _) => error,
            (Self::Message(what), Some(sequence)) => SinkError::Item { sequence, what, next: next.to_owned() },
            (Self::Message(what), None) => SinkError::failed_line(what, next),
        }
    }
}

fn format_place(broker: &BrokerTarget) -> String {
    format!("{}:{}", broker.at.host, broker.at.port)
}

fn not_connected(place: &str) -> SinkError {
    SinkError::failed_line(format!("not connected to {place}"), "")
}

fn to_line_error(place: &str, error: MqttError) -> SinkError {
    let next = error.next().trim_end_matches('.').to_owned();
    match error {
        MqttError::Tls(error) => SinkError::failed_line(error.what, error.next),
        MqttError::Unreachable { .. } => SinkError::failed_line(error.to_string(), next),
        other => SinkError::failed_line(format!("{place}: {other}"), next),
    }
}

async fn run_blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, SinkError> {
    let ended = tokio::task::spawn_blocking(work).await;
    ended.map_err(|error| {
        SinkError::failed_line(format!("the task of the connection ended: {error}"), "restart the gateway")
    })
}
