//! `mqtt://HOST:PORT/PREFIX` and `mqtts://`: every item as one JSON document.
//!
//! Topics: `PREFIX/KIND`, where the kind is `sample`, `state`, `part`, `alarm`, `alarm_clear`, `decision`, `diagnosis` or
//! `event`; the document is [`Item::json`] with `machine`, `box` and `historical`. `PREFIX/online` is retained and says
//! `{"online":true}`, or by the will of the connection `{"online":false}`. The prefix is the box's name where none is
//! written.
//!
//! With `allow_requests` the box subscribes `PREFIX/request` and hands what comes to the gate ([`Requests`]); the answer goes to
//! `PREFIX/request/answer`. Without it nothing is subscribed: a network cannot ask the box for anything this way.

use super::broker::{BrokerTarget, Link, client_name};
use super::{Batch, Pending, Requests, Sink, SinkError};
use crate::control::{Reply, RequestedChange};
use crate::history::{Item, Outbox};
use adapters::address::Keys;
use adapters::mqtt::{MqttMessage, Outgoing, Qos, Will};
use serde::Deserialize;
use serde_json::{Value as Json, json};

/// Where to, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct MqttTarget {
    /// The broker.
    pub broker: BrokerTarget,
    /// What every topic begins with; empty: the name of the box.
    pub prefix: String,
    /// How hard a message is delivered.
    pub qos: Qos,
}

impl MqttTarget {
    pub(super) fn parse(body: &str, keys: &mut Keys, secured: bool) -> Result<Self, String> {
        let qos = keys.choice("qos", &[("1", Qos::AtLeastOnce), ("0", Qos::AtMostOnce)]);
        let (broker, prefix) = BrokerTarget::parse(body, keys, secured)?;
        if prefix.contains(['+', '#']) || prefix.starts_with('$') {
            return Err(format!("{prefix:?} is no beginning of a topic; leave out + and #, and $ at its beginning"));
        }
        Ok(Self { broker, prefix: prefix.to_owned(), qos })
    }
}

/// See the [module](self).
pub(super) struct MqttSink {
    target: MqttTarget,
    name: String,
    outbox: Outbox,
    link: Link,
    requests: Requests,
    /// A message that has come and is not answered yet.
    asked: Option<MqttMessage>,
}

impl MqttSink {
    pub(super) fn new(target: MqttTarget, (name, requests): (&str, Requests), outbox: &Outbox) -> Self {
        let (name, link) = (name.to_owned(), Link::default());
        Self { target, name, outbox: outbox.clone(), link, requests, asked: None }
    }

    /// Hands a message to the gate and publishes what became of it.
    async fn answer(&mut self, message: MqttMessage) -> Result<(), SinkError> {
        let document = if message.retained { Err(RETAINED.to_owned()) } else { document_of(&message.payload) };
        let id = document.as_ref().map_or(Json::Null, |document| document.id.clone().map_or(Json::Null, Json::from));
        let change = document.and_then(RequestDocument::change);
        let Some(Reply { done, text }) = self.requests.ask(change).await else { return Ok(()) };
        let says = json!({"done": done, "text": text, "id": id});
        let topic = self.topic("request/answer");
        let answer = Outgoing { topic, payload: says.to_string().into_bytes(), retain: false };
        let told = self.link.publish(vec![answer], Qos::AtMostOnce, &self.target.broker).await;
        told.map_err(|(_, failure)| failure.of_item(0))
    }

    fn topic(&self, kind: &str) -> String {
        match self.target.prefix.as_str() {
            "" => format!("{}/{kind}", self.outbox.box_id()),
            prefix => format!("{prefix}/{kind}"),
        }
    }

    fn online(&self, online: bool) -> Outgoing {
        let says = json!({"machine": self.outbox.machine(), "box": self.outbox.box_id(), "online": online});
        Outgoing { topic: self.topic("online"), payload: says.to_string().into_bytes(), retain: true }
    }

    fn message(&self, item: &Item, historical: bool) -> Outgoing {
        let document = document(&self.outbox, item, historical);
        Outgoing { topic: self.topic(item.kind()), payload: document.to_string().into_bytes(), retain: false }
    }
}

/// What the broker has kept would come again at every connection, long after whoever asked has gone.
const RETAINED: &str =
    "a retained message is no request: publish it without the retain flag, and remove the retained one";
/// A request is shorter than this.
const REQUEST_BYTES_MAX: usize = 2048;
/// Letters of the asker's own mark that are given back.
const ID_MAX: usize = 64;

/// `{"request":"feed_override","pct":80,"reason":"...","id":"..."}`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RequestDocument {
    request: String,
    pct: Option<f64>,
    reason: Option<String>,
    code: Option<String>,
    id: Option<String>,
}

fn document_of(payload: &[u8]) -> Result<RequestDocument, String> {
    if payload.len() > REQUEST_BYTES_MAX {
        return Err(format!("a message of {} bytes is no request: at most {REQUEST_BYTES_MAX}", payload.len()));
    }
    let mut document: RequestDocument =
        serde_json::from_slice(payload).map_err(|error| format!("this is no request: {error}; {FORMS}"))?;
    document.id = document.id.map(|id| id.chars().take(ID_MAX).collect());
    Ok(document)
}

const FORMS: &str = "write {\"request\":\"feed_override\",\"pct\":80}, {\"request\":\"withdraw\"} or \
                     {\"request\":\"acknowledge_alarm\",\"code\":\"...\"}";

impl RequestDocument {
    fn change(self) -> Result<RequestedChange, String> {
        match (self.request.as_str(), self.pct, self.code) {
            ("feed_override", Some(pct), None) => RequestedChange::feed_override(pct, &self.reason.unwrap_or_default()),
            ("withdraw", None, None) => Ok(RequestedChange::Withdraw),
            ("acknowledge_alarm", None, Some(code)) => Ok(RequestedChange::acknowledge_alarm(&code)),
            _ => Err(format!("this is no request; {FORMS}")),
        }
    }
}

/// The document of an item, with who made it and whether it comes late.
pub(super) fn document(outbox: &Outbox, item: &Item, historical: bool) -> Json {
    let mut document = item.json();
    document["machine"] = Json::from(outbox.machine());
    document["box"] = Json::from(outbox.box_id());
    document["historical"] = Json::from(historical);
    document
}

impl Sink for MqttSink {
    fn connect(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(async move {
            let Outgoing { topic, payload, retain } = self.online(false);
            let will = Will { topic, payload, qos: Qos::AtLeastOnce, retain };
            let name = client_name(&self.outbox.box_id(), &self.name);
            self.link.connect(&self.target.broker, &name, Some(will)).await?;
            self.asked = None;
            if self.requests.allowed() {
                let filter = vec![self.topic("request")];
                self.link.subscribe(filter, Qos::AtLeastOnce, &self.target.broker).await?;
            }
            let greeted = self.link.publish(vec![self.online(true)], Qos::AtLeastOnce, &self.target.broker).await;
            greeted.map_err(|(_, failure)| failure.of_item(0))
        })
    }

    fn send<'a>(&'a mut self, batch: Batch<'a>) -> Pending<'a, Result<(), SinkError>> {
        Box::pin(async move {
            let messages = batch.items.iter().map(|item| self.message(item, batch.historical)).collect();
            let sent = self.link.publish(messages, self.target.qos, &self.target.broker).await;
            sent.map_err(|(index, failure)| failure.of_item(batch.items.get(index).map_or(0, |item| item.sequence)))
        })
    }

    fn idle(&mut self) -> Pending<'_, Result<(), SinkError>> {
        // Without `allow_requests` nothing is subscribed.
        Box::pin(async move {
            self.asked = Some(self.link.next(&self.target.broker).await?);
            Ok(())
        })
    }

    fn attend(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(async move {
            match self.asked.take().filter(|message| message.topic == self.topic("request")) {
                Some(message) => self.answer(message).await,
                None => Ok(()),
            }
        })
    }

    fn probe(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(self.link.probe(&self.target.broker))
    }

    fn close(&mut self) -> Pending<'_, ()> {
        Box::pin(async move {
            // Where this does not go through, the will says the same.
            let _told = self.link.publish(vec![self.online(false)], Qos::AtLeastOnce, &self.target.broker).await;
            self.link.leave().await;
        })
    }
}
