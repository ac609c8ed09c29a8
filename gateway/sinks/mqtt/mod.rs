//! `mqtt://HOST:PORT/PREFIX` and `mqtts://`: every item on topics under a prefix, in one of four [layouts](Layout).
//!
//! The prefix is the path of the machine where none is written, and the box's name where there is no path either. `PREFIX/online` is retained and says `{"online":true}`, or by the will of the
//! connection `{"online":false}`. `PREFIX/latest` is retained and holds everything that is known now; it is written at most every
//! `latest_s`.
//!
//! With `allow_requests` the box subscribes `PREFIX/request` and hands what comes to the gate ([`Requests`]); the answer goes to
//! `PREFIX/request/answer`, and what became of it in the end to `PREFIX/request/outcome`. With `allow_facts` it subscribes `PREFIX/fact/add`, and
//! answers on `PREFIX/fact/answer`. Without them nothing is subscribed: a network cannot ask the box for anything this way.

mod discovery;
mod layout;
mod request;

pub use layout::Layout;

pub(super) use layout::build_document;

use super::broker::{BrokerFailure, BrokerTarget, Link, client_name};
use super::requests::format_outcome;
use super::{Batch, Pending, Requests, Sink, SinkError};
use crate::target_error::TargetError;
use adapter_core::address::Keys;
use gateway_base::log::{Notice, Severity};
use gateway_base::machine_path::MachinePath;
use gateway_control::{Reply, RequestRefusal};
use gateway_history::{Content, Item, Outbox, Record};
use mqtt::{MqttMessage, Outgoing, Qos, Will};
use request::RequestDocument;
use serde_json::{Value as Json, json};
use std::collections::BTreeSet;
use std::time::Duration;
use tokio::time::Instant;

/// Where the network tells facts. The items of facts that are taken stand on `PREFIX/fact`.
const FACTS: &str = "fact/add";

/// Where to, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct MqttTarget {
    /// Address, TLS files and login of the broker.
    pub broker: BrokerTarget,
    /// What every topic begins with; empty: the path of the machine, or else the name of the box.
    pub prefix: String,
    /// How hard a message is delivered.
    pub qos: Qos,
    /// Which topics the items get, and in which form.
    pub layout: Layout,
    /// How often everything that is known is written; zero: never.
    pub latest: Duration,
    /// Is every sensor described for Home Assistant?
    pub discovery: bool,
}

impl MqttTarget {
    pub(super) fn parse(body: &str, keys: &mut Keys, secured: bool) -> Result<Self, TargetError> {
        let qos = keys.take_choice("qos", &[("1", Qos::AtLeastOnce), ("0", Qos::AtMostOnce)]);
        let layouts =
            [("items", Layout::Items), ("flat", Layout::Flat), ("topics", Layout::Topics), ("uns", Layout::Uns)];
        let layout = keys.take_choice("layout", &layouts);
        let latest = Duration::from_secs_f64(keys.take_number("latest_s", 2.0, 0.0, 3600.0));
        let discovery = keys.take_choice("discovery", &[("none", false), ("homeassistant", true)]);
        if discovery && !layout.divides_values() {
            keys.add_problem("discovery=homeassistant needs layout=topics or layout=uns beside it".to_owned());
        }
        let (broker, prefix) = BrokerTarget::parse(body, keys, secured)?;
        if prefix.contains(['+', '#']) || prefix.starts_with('$') {
            return Err(TargetError::Topic { prefix: prefix.to_owned() });
        }
        Ok(Self { broker, prefix: prefix.to_owned(), qos, layout, latest, discovery })
    }
}

pub(super) struct MqttSink {
    target: MqttTarget,
    name: String,
    outbox: Outbox,
    link: Link,
    requests: Requests,
    /// A message that has come and is not answered yet.
    request: Option<MqttMessage>,
    /// When everything that is known was written last, and whether something has changed since.
    last_written: Option<Instant>,
    changed: bool,
    /// Codes of the alarms that stand.
    alarms: BTreeSet<String>,
    /// Series that are described.
    described: BTreeSet<i64>,
    /// A message that is no item was left out, which was told.
    left_out: bool,
    /// Nothing is told but items: another connection tells whether the box is there.
    items_only: bool,
}

impl MqttSink {
    pub(super) fn new(target: MqttTarget, (name, requests): (&str, Requests), outbox: &Outbox) -> Self {
        Self {
            target,
            name: name.to_owned(),
            outbox: outbox.clone(),
            link: Link::default(),
            requests,
            request: None,
            last_written: None,
            changed: false,
            alarms: BTreeSet::new(),
            described: BTreeSet::new(),
            left_out: false,
            items_only: false,
        }
    }

    /// The same, which tells nothing but items.
    pub(super) fn with_items_only(self) -> Self {
        Self { items_only: true, ..self }
    }

    /// Hands a message to the gate and publishes what became of it.
    async fn answer_request(&mut self, message: MqttMessage) -> Result<(), SinkError> {
        let document = match message.retained {
            true => Err(RequestRefusal::RetainedMessage),
            false => request::document_of(&message.payload),
        };
        let origin = request::origin_of(&message.payload);
        let id = origin.id.clone().map_or(Json::Null, Json::from);
        let change = document.and_then(RequestDocument::into_change);
        let Some(Reply { done, text }) = self.requests.submit_change(origin, change).await else { return Ok(()) };
        let says = json!({"done": done, "text": text, "id": id});
        let topic = self.format_topic("request/answer");
        let answer = Outgoing { topic, payload: says.to_string().into_bytes(), retain: false };
        self.publish_messages(vec![answer], Qos::AtMostOnce).await
    }

    /// Hands facts to the box and publishes what became of them.
    async fn answer_facts(&mut self, message: &MqttMessage) -> Result<(), SinkError> {
        let Some(Reply { done, text }) = self.requests.submit_facts(&message.payload, message.retained).await else {
            return Ok(());
        };
        let says = json!({"done": done, "text": text});
        let topic = self.format_topic("fact/answer");
        let answer = Outgoing { topic, payload: says.to_string().into_bytes(), retain: false };
        self.publish_messages(vec![answer], Qos::AtMostOnce).await
    }

    /// Publishes which requests the machine has followed, and which it has not.
    async fn tell_outcomes(&mut self) -> Result<(), SinkError> {
        while let Some(outcome) = self.requests.next_outcome().map(format_outcome) {
            let topic = self.format_topic("request/outcome");
            let told = Outgoing { topic, payload: outcome.to_string().into_bytes(), retain: false };
            self.publish_messages(vec![told], Qos::AtLeastOnce).await?;
            self.requests.forget_outcome();
        }
        Ok(())
    }

    fn topic_prefix(&self) -> String {
        let place = self.outbox.path().map(MachinePath::format_topic);
        match (self.target.prefix.as_str(), self.target.layout) {
            ("", _) => place.unwrap_or_else(|| self.outbox.box_id()),
            (prefix, Layout::Uns) => place.map_or_else(|| prefix.to_owned(), |place| format!("{prefix}/{place}")),
            (prefix, _) => prefix.to_owned(),
        }
    }

    fn format_topic(&self, kind: &str) -> String {
        format!("{}/{kind}", self.topic_prefix())
    }

    fn build_online_message(&self, online: bool) -> Outgoing {
        let mut says = json!({"machine": self.outbox.machine(), "box": self.outbox.box_id(), "online": online});
        if let Some(path) = self.outbox.path() {
            says["path"] = Json::from(path.format_topic());
        }
        Outgoing { topic: self.format_topic("online"), payload: says.to_string().into_bytes(), retain: true }
    }

    /// Messages of the box itself, which are no items. One that the broker will never take is left out, which is told once.
    async fn publish_messages(&mut self, mut messages: Vec<Outgoing>, qos: Qos) -> Result<(), SinkError> {
        while !messages.is_empty() {
            let sent = self.link.publish_messages(messages.clone(), qos, &self.target.broker).await;
            let Err((index, failure)) = sent else { return Ok(()) };
            let BrokerFailure::Message(what) = failure else { return Err(failure.of_item(None)) };
            if !std::mem::replace(&mut self.left_out, true) {
                let text = format!("sink {}: a message beside the items is left out: {what}", self.name);
                Notice::new(Severity::Warning, "sink_refused", text).write_to_logs();
            }
            messages.drain(..=index);
        }
        Ok(())
    }

    /// When everything that is known is to be written again; `None` while nothing has changed, and before the first item: there is no
    /// time of which it would be.
    fn latest_due_time(&self) -> Option<Instant> {
        let next = || self.last_written.map_or_else(Instant::now, |told| told + self.target.latest);
        let known = self.outbox.watch_head().borrow().newest_ns.is_some();
        (known && self.changed && !self.target.latest.is_zero()).then(next)
    }

    /// Writes everything that is known, if it is time.
    async fn tell_latest(&mut self) -> Result<(), SinkError> {
        if self.latest_due_time().is_none_or(|due| Instant::now() < due) {
            return Ok(());
        }
        (self.last_written, self.changed) = (Some(Instant::now()), false);
        let message = layout::build_latest_message(&self.outbox, &self.topic_prefix(), self.alarms.iter());
        self.publish_messages(vec![message], Qos::AtLeastOnce).await
    }

    /// What a subscriber that was there before this connection does not know.
    async fn publish_initial_state(&mut self) -> Result<(), SinkError> {
        let prefix = self.topic_prefix();
        let mut messages = vec![self.build_online_message(true)];
        if self.target.layout.divides_values() {
            let latest = self.outbox.latest_readings();
            let provided = latest.iter().filter(|reading| !layout::is_unprovided(reading));
            messages.extend(provided.map(|reading| layout::build_value_message(&prefix, reading)));
        }
        (self.last_written, self.changed) = (None, true);
        self.publish_messages(messages, Qos::AtLeastOnce).await?;
        self.publish_discovery().await?;
        self.tell_latest().await
    }

    /// Describes what is not described yet.
    async fn publish_discovery(&mut self) -> Result<(), SinkError> {
        if !self.target.discovery {
            return Ok(());
        }
        let (latest, prefix) = (self.outbox.latest_readings(), self.topic_prefix());
        let fresh: Vec<_> = latest
            .iter()
            .filter(|reading| !layout::is_unprovided(reading) && !self.described.contains(&reading.series.id))
            .collect();
        let messages = discovery::build_sensor_documents(&self.outbox, &prefix, &fresh);
        if messages.is_empty() {
            return Ok(());
        }
        self.publish_messages(messages, Qos::AtLeastOnce).await?;
        self.described.extend(fresh.iter().map(|reading| reading.series.id));
        Ok(())
    }

    fn track_alarms(&mut self, item: &Item) {
        let Content::Record(record) = &item.content else { return };
        match &**record {
            Record::Alarm(alarm) => drop(self.alarms.insert(alarm.code.clone())),
            Record::AlarmClear(clear) => drop(self.alarms.remove(&clear.code)),
            _ => {}
        }
    }

    async fn deliver_batch(&mut self, batch: Batch<'_>) -> Result<(), SinkError> {
        let prefix = self.topic_prefix();
        let (mut messages, mut owners) = (Vec::new(), Vec::new());
        for item in batch.items {
            self.track_alarms(item);
            let of_item = layout::build_messages(self.target.layout, &self.outbox, &prefix, item, batch.historical);
            owners.extend(of_item.iter().map(|_| item.sequence));
            messages.extend(of_item);
        }
        let sent = self.link.publish_messages(messages, self.target.qos, &self.target.broker).await;
        sent.map_err(|(index, failure)| failure.of_item(owners.get(index).copied()))?;
        if batch.historical {
            return Ok(());
        }
        self.changed = true;
        self.publish_discovery().await?;
        self.tell_latest().await
    }
}

impl Sink for MqttSink {
    fn connect(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(async move {
            let Outgoing { topic, payload, retain } = self.build_online_message(false);
            let will = Will { topic, payload, qos: Qos::AtLeastOnce, retain, at_leave: false };
            let name = client_name(&self.outbox.box_id(), &self.name);
            if self.items_only {
                return self.link.connect(&self.target.broker, &name, None).await;
            }
            self.link.connect(&self.target.broker, &name, Some(will)).await?;
            self.request = None;
            self.described.clear();
            let heard = [(self.requests.is_allowed(), "request"), (self.requests.takes_facts(), FACTS)];
            let filters: Vec<String> =
                heard.iter().filter(|(is_heard, _)| *is_heard).map(|(_, kind)| self.format_topic(kind)).collect();
            if !filters.is_empty() {
                self.link.subscribe_to(filters, Qos::AtLeastOnce, &self.target.broker).await?;
            }
            self.publish_initial_state().await
        })
    }

    fn send_batch<'a>(&'a mut self, batch: Batch<'a>) -> Pending<'a, Result<(), SinkError>> {
        Box::pin(self.deliver_batch(batch))
    }

    fn wait_for_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        // Without `allow_requests` nothing is subscribed.
        Box::pin(async move {
            let due = self.latest_due_time();
            let until_due = async {
                match due {
                    Some(due) => tokio::time::sleep_until(due).await,
                    None => std::future::pending().await,
                }
            };
            tokio::select! {
                message = self.link.next(&self.target.broker) => self.request = Some(message?),
                () = until_due => {}
                () = self.requests.wait_for_outcome() => {}
            }
            Ok(())
        })
    }

    fn serve_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(async move {
            self.tell_latest().await?;
            match self.request.take() {
                Some(message) if message.topic == self.format_topic("request") => self.answer_request(message).await?,
                Some(message) if message.topic == self.format_topic(FACTS) => self.answer_facts(&message).await?,
                _ => {}
            }
            self.tell_outcomes().await
        })
    }

    fn probe_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(self.link.probe_broker(&self.target.broker))
    }

    fn close(&mut self) -> Pending<'_, ()> {
        Box::pin(async move {
            // Where this does not go through, the will says the same.
            let gone = if self.items_only { Vec::new() } else { vec![self.build_online_message(false)] };
            let _told = self.publish_messages(gone, Qos::AtLeastOnce).await;
            self.link.disconnect_client().await;
        })
    }
}
