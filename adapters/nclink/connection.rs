//! One client of one device: a connection to the broker, and questions with their answers.

use super::message::{self, AnswersError, NcLinkAnswer, RequestedItem};
use super::model::Model;
use super::topic::Subject;
use crate::address::NcLinkTarget;
use adapter_core::driver::SourceError;
use adapter_core::integer::saturate_to_ms;
use adapter_core::text::TextEncoding;
use device_line::tls::TlsFiles;
use mqtt::{self, MqttClient, MqttError, MqttMessage, Qos};
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// A device that has not answered by then is not answering (the vendor's own client waits as long).
pub const DEADLINE: Duration = Duration::from_secs(2);
/// At most so many messages of sample channels and events wait while an answer is awaited.
const UNASKED_MAX: usize = 512;

/// What to connect to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Link {
    /// The address, as in the configuration.
    pub name: String,
    /// Host of the broker.
    pub host: String,
    /// TCP port of the broker.
    pub port: u16,
    /// Serial number of the device.
    pub serial: String,
    /// User and password at the broker.
    pub login: Option<(String, String)>,
    /// The files of TLS, where the line is secured.
    pub tls: Option<TlsFiles>,
    /// Longest wait for an answer.
    pub deadline: Duration,
    /// Character set of its messages.
    pub encoding: TextEncoding,
}

impl Link {
    /// What an address of this name says.
    #[must_use]
    pub fn from_target(name: &str, target: &NcLinkTarget, login: Option<(String, String)>) -> Self {
        Self {
            name: name.to_owned(),
            host: target.endpoint.host.clone(),
            port: target.endpoint.port,
            serial: target.serial.clone(),
            login,
            tls: target.tls.clone(),
            deadline: DEADLINE,
            encoding: target.encoding,
        }
    }
}

/// What a device sends by itself.
const UNASKED: [Subject; 4] = [Subject::Sample, Subject::Event, Subject::Register, Subject::Version];

/// A message that nobody asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Unasked {
    /// [`Subject::Sample`], [`Subject::Event`], [`Subject::Register`] or [`Subject::Version`].
    pub subject: Subject,
    /// What stood behind the serial number in its topic.
    pub tail: String,
    /// When it had arrived.
    pub arrived: Instant,
    /// The message as JSON, out of the character set of the link.
    pub message: Value,
}

/// A connection to a device through its broker. Broken, it stays broken: open another one.
pub struct Connection {
    link: Link,
    client: MqttClient,
    unasked: VecDeque<Unasked>,
    /// Unasked messages that waited too long or made no sense.
    lost: u64,
}

impl Connection {
    /// Connects and subscribes. With `samples` also to what the device sends by itself.
    ///
    /// # Errors
    /// [`SourceError::Line`] when the broker cannot be reached, [`SourceError::Refused`] when it refuses.
    pub fn open(link: &Link, samples: bool) -> Result<Self, SourceError> {
        let mut options = mqtt::Options::new(&link.host, link.port, "cnc-gateway");
        options.login.clone_from(&link.login);
        options.tls.clone_from(&link.tls);
        options.deadline = link.deadline;
        let fault = |error| broker_fault(link, error);
        let client = MqttClient::connect(&options).map_err(fault)?;
        let answers = [Subject::ProbeAnswer, Subject::QueryAnswer, Subject::SetAnswer];
        let more: &[Subject] = if samples { &UNASKED } else { &[] };
        let filters: Vec<String> =
            answers.iter().chain(more).map(|subject| subject.build_filter(&link.serial)).collect();
        client.subscribe_filters(&filters, Qos::AtMostOnce).map_err(fault)?;
        Ok(Self { link: link.clone(), client, unasked: VecDeque::new(), lost: 0 })
    }

    /// What the device has.
    ///
    /// # Errors
    /// See [`SourceError`].
    pub fn probe_model(&mut self) -> Result<Model, SourceError> {
        let what = "the probe of its model";
        let id = generate_identifier();
        let answer = self.exchange_messages(Subject::Probe, &id, json!({"@id": id}).to_string().as_bytes(), what)?;
        if let Some(reason) = message::find_refusal(&answer) {
            return Err(self.build_refusal(what, reason));
        }
        Model::parse(&answer).map_err(|why| self.build_decode_error(what, why.to_string()))
    }

    /// Asks for values; one answer per ask, `None` where the device said nothing of it.
    ///
    /// # Errors
    /// See [`SourceError`]; a refusal of single items is in the answers.
    pub fn query_values(&mut self, asks: &[RequestedItem]) -> Result<Vec<Option<NcLinkAnswer>>, SourceError> {
        self.request_answers(Subject::Query, asks, "the query of its values")
    }

    /// Writes values; one answer per ask.
    ///
    /// # Errors
    /// See [`SourceError`]; a refusal of single items is in the answers.
    pub fn set_values(&mut self, asks: &[RequestedItem]) -> Result<Vec<Option<NcLinkAnswer>>, SourceError> {
        self.request_answers(Subject::Set, asks, "the setting of registers")
    }

    /// Samples and events that have arrived, the oldest first.
    ///
    /// # Errors
    /// [`SourceError::Line`] when the connection is over and everything is taken.
    pub fn take_unasked(&mut self) -> Result<Vec<Unasked>, SourceError> {
        while let Some(message) =
            self.client.receive_message(Duration::ZERO).map_err(|error| broker_fault(&self.link, error))?
        {
            self.keep_unasked(&message);
        }
        Ok(self.unasked.drain(..).collect())
    }

    /// Messages of sample channels and events that were lost in this client: nobody took them, or they made no sense.
    #[must_use]
    pub fn count_lost(&self) -> u64 {
        self.lost + self.client.count_dropped()
    }

    fn request_answers(
        &mut self,
        subject: Subject,
        asks: &[RequestedItem],
        what: &str,
    ) -> Result<Vec<Option<NcLinkAnswer>>, SourceError> {
        let id = generate_identifier();
        let answer = self.exchange_messages(subject, &id, &message::encode_request(&id, asks), what)?;
        message::parse_answers(&answer, asks).map_err(|why| match why {
            AnswersError::Refused(reason) => self.build_refusal(what, reason),
            AnswersError::NoAnswers => self.build_decode_error(what, why.to_string()),
        })
    }

    /// Sends a request and waits for the answer with its identifier; what else arrives is kept.
    fn exchange_messages(
        &mut self,
        subject: Subject,
        id: &str,
        payload: &[u8],
        what: &str,
    ) -> Result<Value, SourceError> {
        let fault = |error| broker_fault(&self.link, error);
        self.client
            .publish_message(&subject.build_topic(&self.link.serial), payload, Qos::AtMostOnce)
            .map_err(fault)?;
        let until = Instant::now() + self.link.deadline;
        let mut nonsense = None;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let message = self.client.receive_message(left).map_err(|error| broker_fault(&self.link, error))?;
            let Some(message) = message else {
                return Err(
                    nonsense.map_or_else(|| self.build_timeout_error(what), |why| self.build_decode_error(what, why))
                );
            };
            match self.answer_to(subject, id, &message) {
                Some(Ok(answer)) => return Ok(answer),
                Some(Err(why)) => nonsense = Some(why),
                None => self.keep_unasked(&message),
            }
        }
    }

    /// The answer itself; why it cannot be read, where it may have been it; `None` for anything else, as the late answer
    /// to an earlier question.
    fn answer_to(&self, subject: Subject, id: &str, message: &MqttMessage) -> Option<Result<Value, String>> {
        let wanted = match subject {
            Subject::Probe => Subject::ProbeAnswer,
            Subject::Set => Subject::SetAnswer,
            _ => Subject::QueryAnswer,
        };
        Subject::from_topic(&message.topic, &self.link.serial).filter(|(subject, _)| *subject == wanted)?;
        match self.link.encoding.parse_json(&message.payload) {
            Ok(answer) => (message::find_identifier(&answer).as_deref() == Some(id)).then_some(Ok(answer)),
            Err(error) => Some(Err(format!("it is no JSON ({error})"))),
        }
    }

    fn keep_unasked(&mut self, message: &MqttMessage) {
        let Some((subject, tail)) = Subject::from_topic(&message.topic, &self.link.serial) else { return };
        if !UNASKED.contains(&subject) {
            return;
        }
        match self.link.encoding.parse_json(&message.payload) {
            Ok(said) if subject == Subject::Register && !message::names_device(&said, &self.link.serial) => {}
            Ok(said) => {
                let (tail, arrived) = (tail.to_owned(), message.arrived);
                self.unasked.push_back(Unasked { subject, tail, arrived, message: said });
            }
            Err(_) => self.lost += 1,
        }
        if self.unasked.len() > UNASKED_MAX {
            self.unasked.pop_front();
            self.lost += 1;
        }
    }

    fn build_timeout_error(&self, what: &str) -> SourceError {
        SourceError::Timeout {
            source_name: self.link.name.clone(),
            request: what.to_owned(),
            deadline_ms: saturate_to_ms(self.link.deadline),
            next: format!(
                "The broker answers, the device {} does not: check that the machine is on, that its NC-Link adapter \
                 is connected to this broker, and its serial number.",
                self.link.serial
            ),
        }
    }

    fn build_refusal(&self, request: &str, what: String) -> SourceError {
        SourceError::Refused {
            source_name: self.link.name.clone(),
            request: request.to_owned(),
            what,
            next: "Look into the device's model whether it has this, and may be written.".to_owned(),
        }
    }

    fn build_decode_error(&self, request: &str, what: String) -> SourceError {
        SourceError::Decode { source_name: self.link.name.clone(), request: request.to_owned(), what }
    }
}

fn broker_fault(link: &Link, error: MqttError) -> SourceError {
    let source_name = link.name.clone();
    match error {
        MqttError::Refused(what) => SourceError::Refused {
            source_name,
            request: "the connection".to_owned(),
            what: format!("the broker refuses: {what}"),
            next: "Check user and password_file in the address, and what the broker allows this user.".to_owned(),
        },
        MqttError::Tls(error) => SourceError::Line { source_name, what: error.what, next: error.next },
        other => SourceError::Line { source_name, next: other.next().to_owned(), what: other.to_string() },
    }
}

/// An identifier that no other request has, in the form of a UUID.
fn generate_identifier() -> String {
    let (a, b, c) = (
        adapter_core::unique_id::generate_unique_id(),
        adapter_core::unique_id::generate_unique_id(),
        adapter_core::unique_id::generate_unique_id(),
    );
    format!("{}-{}-4{}-8{}-{}", &a[..8], &a[8..], &b[..3], &b[3..6], c)
}
