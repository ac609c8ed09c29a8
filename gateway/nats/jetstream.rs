//! JetStream: publishing with acknowledgement, streams, durable consumers.
//!
//! The server's interface is requests with JSON on subjects that begin with `$JS.API`
//! (<https://docs.nats.io/reference/reference-protocols/nats_api_reference>).

use super::connection::{Connection, DEADLINE, Message};
use super::{NatsError, words};
use gateway_base::convert::duration_to_unsigned_ns;
use serde_json::{Value as Json, json};
use std::time::Duration;
use tokio::time::{Instant, timeout_at};

/// Nobody listens on this subject.
const NO_RESPONDERS: u16 = 503;
/// The error number of a message that is larger than the stream allows.
const TOO_LARGE: u64 = 10054;
/// The error number of a message that could not be stored, for whatever reason; with these words it never will be: the files of a
/// stream take at most 32 MB.
const NOT_STORED: (u64, &str) = (10077, "message too large");
/// A message that is not acknowledged within this time is given out again: ten times what a batch takes on a slow computer. Too
/// short, and work is done twice; too long, and rows of a reader that died come late.
const ACKNOWLEDGE_WITHIN: Duration = Duration::from_secs(10);
/// Messages that may be under way to all readers of one consumer together: two batches of each of five readers.
const UNDER_WAY_MAX: u64 = 100_000;
/// Subject, reply and header of a message, bytes at most.
const ENVELOPE: usize = 65_536;

/// A message to be stored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outgoing {
    /// The subject that it is published under.
    pub subject: String,
    /// What makes a second copy recognisable within the stream's window.
    pub id: String,
    /// The bytes as they are stored.
    pub payload: Vec<u8>,
}

/// Why a message was not stored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum JetStreamFailure {
    /// The connection, or the cluster for the time being.
    Line(NatsError),
    /// This message will never be stored.
    Message(NatsError),
}

/// What JetStream answers where a stream is larger than its storage: of the server, of the account.
const NO_ROOM: [u64; 2] = [10047, 10028];
/// A stream that takes less is of no use: some hours of one machine.
const STREAM_BYTES_MIN: u64 = 100_000_000;

/// How a stream is created.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StreamSettings {
    /// The name that the cluster knows the stream by.
    pub name: String,
    /// What it takes, such as `cnc.>`.
    pub subjects: String,
    /// On how many servers it lies: 1, 3 or 5.
    pub replicas: u32,
    /// How long a message is kept.
    pub max_age: Duration,
    /// Greatest size, bytes. Beyond it new messages are refused, and the boxes keep them.
    pub max_bytes: u64,
    /// Where the servers have no room for that much: half of it, as often as it takes. Otherwise it is an error.
    pub may_shrink: bool,
    /// A second message with the same id within this time is not stored.
    pub duplicate_window: Duration,
}

/// How much is fetched at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FetchLimits {
    /// Greatest number of messages of one fetch.
    pub messages: usize,
    /// Bytes; a single message may be larger.
    pub bytes: usize,
    /// How long messages are waited for.
    pub patience: Duration,
}

/// How far the readers of a consumer are behind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Backlog {
    /// Messages that nobody has been given.
    pub pending: u64,
    /// Messages that are given out and not acknowledged.
    pub under_way: u64,
    /// Every message up to this number of the stream is acknowledged.
    pub acknowledged_to: u64,
}

/// The error of an answer, with its number.
fn find_refusal(answer: &Json) -> Option<(u64, String)> {
    let error = answer.get("error")?;
    let code = error["err_code"].as_u64().or(error["code"].as_u64()).unwrap_or(0);
    Some((code, error["description"].as_str().unwrap_or("no description").to_owned()))
}

impl Connection {
    /// Stores the messages in this order and waits until all are acknowledged; the indices of those that were there already, in order.
    ///
    /// # Errors
    /// The index of the first that is not stored, and why.
    pub async fn publish_all(&mut self, messages: &[Outgoing]) -> Result<Vec<usize>, (usize, JetStreamFailure)> {
        let oversize = |message: &Outgoing| message.payload.len() + message.id.len() + 40 > self.max_payload();
        let sendable = messages.iter().position(oversize).unwrap_or(messages.len());
        let mut first_token = None;
        for message in &messages[..sendable] {
            let (reply, token) = self.answer_subject();
            first_token.get_or_insert(token);
            self.queue_message(&message.subject, Some(&reply), Some(&message.id), &message.payload);
        }
        let first_token = first_token.unwrap_or(0);
        let mut open: Vec<bool> = vec![true; sendable];
        let (mut left, mut duplicates) = (sendable, Vec::new());
        let mut failed: Option<(usize, JetStreamFailure)> = None;
        let until = Instant::now() + DEADLINE;
        while left > 0 {
            let first_open = open.iter().position(|open| *open).unwrap_or(0);
            let line = |error| (first_open, JetStreamFailure::Line(error));
            let waited = timeout_at(until, self.next()).await;
            let late = |_| line(words::no_answer(self.current_endpoint(), "a message is not acknowledged"));
            let came = waited.map_err(late)?.map_err(line)?;
            let index = self.token_of(&came).and_then(|token| token.checked_sub(first_token));
            let index =
                index.and_then(|index| usize::try_from(index).ok()).filter(|index| open.get(*index) == Some(&true));
            let Some(index) = index else { continue };
            (open[index], left) = (false, left - 1);
            match parse_acknowledgement(&came, &messages[index].subject) {
                Ok(true) => duplicates.push(index),
                Ok(false) => {}
                Err(failure) if failed.as_ref().is_none_or(|(first, _)| index < *first) => {
                    failed = Some((index, failure))
                }
                Err(_) => {}
            }
        }
        match failed {
            Some(failed) => Err(failed),
            None if sendable < messages.len() => {
                let (length, most) = (messages[sendable].payload.len(), self.max_payload());
                let what = format!("its {length} bytes are more than the {most} that the server takes");
                Err((sendable, JetStreamFailure::Message(NatsError::new(what, "raise max_payload of the server"))))
            }
            None => {
                duplicates.sort_unstable();
                Ok(duplicates)
            }
        }
    }

    async fn call_api(&mut self, what: &str, request: &Json) -> Result<Result<Json, (u64, String)>, NatsError> {
        let subject = format!("$JS.API.{what}");
        let answer = self.request_reply(&subject, request.to_string().as_bytes()).await?;
        if answer.status.as_ref().is_some_and(|(code, _)| *code == NO_RESPONDERS) {
            return Err(words::no_jetstream(self.current_endpoint()));
        }
        let document: Json = serde_json::from_slice(&answer.payload).map_err(|error| {
            words::no_nats(self.current_endpoint(), &format!("an answer of JetStream that is no JSON ({error})"))
        })?;
        Ok(find_refusal(&document).map_or(Ok(document), Err))
    }

    async fn call_api_or_fail(&mut self, what: &str, request: &Json) -> Result<Json, NatsError> {
        self.call_api(what, request).await?.map_err(|(code, said)| words::of_jetstream(code, &said))
    }

    /// The stream that takes this subject.
    ///
    /// # Errors
    /// There is none, JetStream is not there, or the connection is over.
    pub async fn stream_of(&mut self, subject: &str) -> Result<String, NatsError> {
        let answer = self.call_api_or_fail("STREAM.NAMES", &json!({"subject": subject})).await?;
        let name = answer["streams"].as_array().and_then(|names| names.first()?.as_str());
        name.map(str::to_owned).ok_or_else(|| words::no_stream(subject))
    }

    /// Creates the stream unless it exists; true when it was created.
    ///
    /// # Errors
    /// What JetStream says.
    pub async fn create_stream(&mut self, settings: &StreamSettings) -> Result<Option<u64>, NatsError> {
        let name = &settings.name;
        match self.call_api(&format!("STREAM.INFO.{name}"), &json!({})).await? {
            Ok(_exists) => return Ok(None),
            Err((10059, _not_found)) => {}
            Err((code, said)) => return Err(words::of_jetstream(code, &said)),
        }
        let mut request = json!({
            "name": name, "subjects": [settings.subjects], "retention": "limits", "storage": "file", "discard": "new",
            "num_replicas": settings.replicas, "max_age": duration_to_unsigned_ns(settings.max_age), "max_bytes": settings.max_bytes,
            "duplicate_window": duration_to_unsigned_ns(settings.duplicate_window.min(settings.max_age)),
            "max_msgs": -1, "max_consumers": -1, "max_msg_size": -1,
        });
        let mut max_bytes = settings.max_bytes;
        loop {
            match self.call_api(&format!("STREAM.CREATE.{name}"), &request).await? {
                Ok(_created) => return Ok(Some(max_bytes)),
                Err((code, _))
                    if NO_ROOM.contains(&code) && settings.may_shrink && max_bytes >= 2 * STREAM_BYTES_MIN =>
                {
                    max_bytes /= 2;
                    request["max_bytes"] = json!(max_bytes);
                }
                Err((code, said)) => return Err(words::of_jetstream(code, &said)),
            }
        }
    }

    /// Messages and bytes in a stream.
    ///
    /// # Errors
    /// What JetStream says.
    pub async fn stream_size(&mut self, name: &str) -> Result<(u64, u64), NatsError> {
        let answer = self.call_api_or_fail(&format!("STREAM.INFO.{name}"), &json!({})).await?;
        let number = |key: &str| answer["state"][key].as_u64().unwrap_or(0);
        Ok((number("messages"), number("bytes")))
    }

    /// The number of the newest message of a stream.
    ///
    /// # Errors
    /// What JetStream says.
    pub async fn read_last_number(&mut self, name: &str) -> Result<u64, NatsError> {
        let answer = self.call_api_or_fail(&format!("STREAM.INFO.{name}"), &json!({})).await?;
        Ok(answer["state"]["last_seq"].as_u64().unwrap_or(0))
    }

    /// Creates the durable consumer unless it exists. Several readers share it: each message is given to one of them, and
    /// again when it is not acknowledged.
    ///
    /// # Errors
    /// What JetStream says.
    pub async fn create_consumer(&mut self, stream: &str, name: &str) -> Result<(), NatsError> {
        let request = json!({"stream_name": stream, "config": {
            "durable_name": name, "ack_policy": "explicit", "deliver_policy": "all", "replay_policy": "instant",
            "ack_wait": duration_to_unsigned_ns(ACKNOWLEDGE_WITHIN), "max_deliver": -1, "max_ack_pending": UNDER_WAY_MAX,
        }});
        self.call_api_or_fail(&format!("CONSUMER.DURABLE.CREATE.{stream}.{name}"), &request).await.map(drop)
    }

    /// How far the readers of a consumer are behind.
    ///
    /// # Errors
    /// What JetStream says.
    pub async fn read_backlog(&mut self, stream: &str, consumer: &str) -> Result<Backlog, NatsError> {
        let answer = self.call_api_or_fail(&format!("CONSUMER.INFO.{stream}.{consumer}"), &json!({})).await?;
        let number = |key: &str| answer[key].as_u64().unwrap_or(0);
        let acknowledged_to = answer["ack_floor"]["stream_seq"].as_u64().unwrap_or(0);
        Ok(Backlog { pending: number("num_pending"), under_way: number("num_ack_pending"), acknowledged_to })
    }

    /// Messages of a consumer within these limits; fewer, or none, when the patience is over.
    ///
    /// # Errors
    /// The connection is over, the consumer is gone, or the server does not answer.
    pub async fn fetch_messages(
        &mut self,
        stream: &str,
        consumer: &str,
        limits: FetchLimits,
    ) -> Result<Vec<Message>, NatsError> {
        let FetchLimits { messages: most, bytes, patience } = limits;
        let inbox = format!("_INBOX.{}", adapter_core::unique_id::generate_unique_id());
        let number = self.subscribe(&inbox);
        // A single message that is larger would never be given out.
        let bytes = bytes.max(self.max_payload() + ENVELOPE);
        let request =
            json!({"batch": most, "expires": duration_to_unsigned_ns(patience), "max_bytes": bytes}).to_string();
        self.queue_message(
            &format!("$JS.API.CONSUMER.MSG.NEXT.{stream}.{consumer}"),
            Some(&inbox),
            None,
            request.as_bytes(),
        );
        let until = Instant::now() + patience + DEADLINE;
        let mut messages = Vec::new();
        while messages.len() < most {
            let waited = timeout_at(until, self.next()).await;
            let came = waited.map_err(|_| words::no_answer(self.current_endpoint(), "messages were asked for"))??;
            if came.subscription != number {
                continue;
            }
            match came.status.as_ref().map(|(code, said)| PullStatus::from_protocol(*code, said)) {
                None => messages.push(came),
                Some(PullStatus::Over) => break,
                Some(PullStatus::Deleted) => {
                    let what = format!("the consumer {consumer} of stream {stream} was deleted");
                    return Err(NatsError::new(what, "it is created again with the next connection"));
                }
                Some(PullStatus::Unanswered) => {
                    let what = format!("nobody answers for consumer {consumer} of stream {stream}");
                    return Err(NatsError::new(what, "while a cluster chooses a new leader this passes by itself"));
                }
                Some(PullStatus::Other) => {}
            }
        }
        self.unsubscribe(number);
        Ok(messages)
    }

    fn unsubscribe(&mut self, number: u64) {
        self.put_line(&format!("UNSUB {number}"));
    }

    /// These messages are done; sent with the next [`Connection::flush`]. One that does not arrive is given out again.
    pub fn acknowledge_messages<'a>(&mut self, messages: impl IntoIterator<Item = &'a Message>) {
        for reply in messages.into_iter().filter_map(|message| message.reply.clone()) {
            self.queue_message(&reply, None, None, b"+ACK");
        }
    }
}

/// What a status message in answer to a request for messages means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PullStatus {
    /// Nothing more comes: there is nothing, the time is over, or the request was cut short (limits, a new leader).
    Over,
    /// The consumer is gone.
    Deleted,
    /// Nobody listens to the request.
    Unanswered,
    Other,
}

impl PullStatus {
    /// The protocol has one number for everything that cuts a request short, and tells only by its words (`Consumer Deleted`) that
    /// the consumer is gone.
    fn from_protocol(code: u16, said: &str) -> Self {
        match code {
            409 if said.to_ascii_lowercase().contains("deleted") => Self::Deleted,
            404 | 408 | 409 => Self::Over,
            NO_RESPONDERS => Self::Unanswered,
            _ => Self::Other,
        }
    }
}

/// Was the message there already?
fn parse_acknowledgement(came: &Message, subject: &str) -> Result<bool, JetStreamFailure> {
    if came.status.as_ref().is_some_and(|(code, _)| *code == NO_RESPONDERS) {
        return Err(JetStreamFailure::Line(words::no_stream(subject)));
    }
    let answer: Json = serde_json::from_slice(&came.payload).unwrap_or(Json::Null);
    match find_refusal(&answer) {
        Some((code, said)) if code == TOO_LARGE || (code, said.as_str()) == NOT_STORED => {
            Err(JetStreamFailure::Message(NatsError::new(
                format!("JetStream says {said:?}"),
                "raise max_msg_size of the stream",
            )))
        }
        Some((code, said)) => Err(JetStreamFailure::Line(words::of_jetstream(code, &said))),
        None => Ok(answer["duplicate"].as_bool().unwrap_or(false)),
    }
}
