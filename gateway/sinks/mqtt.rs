//! `mqtt://HOST:PORT/PREFIX` and `mqtts://`: every item as one JSON document.
//!
//! Topics: `PREFIX/KIND`, where the kind is `sample`, `state`, `part`, `alarm`, `alarm_clear`, `decision`, `diagnosis` or
//! `event`; the document is [`Item::json`] with `machine`, `box` and `historical`. `PREFIX/online` is retained and says
//! `{"online":true}`, or by the will of the connection `{"online":false}`. The prefix is the box's name where none is
//! written.
//!
//! Nothing is subscribed: a network cannot ask the box for anything this way.

use super::broker::{BrokerTarget, Link, client_name};
use super::{Batch, Pending, Sink, SinkError};
use crate::history::{Item, Outbox};
use adapters::address::Keys;
use adapters::mqtt::{Outgoing, Qos, Will};
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
}

impl MqttSink {
    pub(super) fn new(target: MqttTarget, name: &str, outbox: &Outbox) -> Self {
        Self { target, name: name.to_owned(), outbox: outbox.clone(), link: Link::default() }
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
        // Nothing is subscribed: what comes is none of ours.
        Box::pin(async move { self.link.next(&self.target.broker).await.map(drop) })
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
