//! `sparkplug://BROKER:1883/GROUP/NODE/DEVICE` and `sparkplugs://`: Sparkplug B, as an edge node with one device.
//!
//! - Birth: every series with name, alias, type, unit, physical range and last value; again whenever a series gets its
//!   first value, and when a host asks for it with `Node Control/Rebirth`.
//! - Data: one message per item, values by alias, with the time of the tick. What an outage left follows after the
//!   birth, flagged `is_historical`.
//! - Death: the will of the connection; its `bdSeq` is that of the birth.
//! - The specification wants data at quality of service 0, which nobody acknowledges. After each batch the broker is asked
//!   for a sign of life on the same connection: its answer says that it has read everything before. Only then is the
//!   batch delivered.
//! - Death of the device: while no source of the machine delivers a value. What happens in this time begins with its birth.
//! - Primary host: with `host=ID` nothing is sent before that host says `online` on `spBv1.0/STATE/ID`, and when it says
//!   that it goes the death of the node is sent and the connection ends; meanwhile everything waits in the outbox. Without it, data that the broker has
//!   read while nobody listened is gone: at quality of service 0 a broker keeps nothing.
//! - Commands: `Node Control/Rebirth` is obeyed. With `allow_requests` the metrics `request/...` are handed to the gate
//!   ([`Requests`]), otherwise they are refused; both are told in `request/answer`, later in
//!   `request/outcome`. Nothing else that comes from the network
//!   reaches anything.
//!
//! Without a DEVICE the metrics are those of the node itself. Without GROUP and NODE they are those of the machine's path: the levels before
//! the machine, with points, and the machine.
//!
//! Source: Eclipse Sparkplug Specification 3.0.0; operational behaviour in chapter 5, topics in chapter 4.

mod births;
mod commands;
mod host;
mod payload;
mod place;

pub use place::{SparkplugPlace, SparkplugTarget};

use super::broker::{BrokerFailure, Link, client_name};
use super::{Batch, Pending, Requests, Sink, SinkError};
use commands::AskedChange;
use gateway_base::clock;
use gateway_history::{Cell, Outbox};
use host::PrimaryHost;
use mqtt::{Outgoing, Qos, Will};
use payload::Payload;
use prost::Message;
use std::collections::BTreeSet;
use std::time::Duration;

/// A birth waits at most this long for the first values.
const FIRST_VALUES: Duration = Duration::from_secs(3);

/// The number of a connection is durable within this time, or it is used all the same.
const NOTED_WITHIN: Duration = Duration::from_secs(3);

/// A primary host that is not there within this is waited for with the usual pauses between two connections.
const HOST_WITHIN: Duration = Duration::from_secs(10);

pub(super) struct SparkplugSink {
    target: SparkplugTarget,
    place: SparkplugPlace,
    name: String,
    outbox: Outbox,
    link: Link,
    /// Number of this connection, 0 to 255; in birth and death.
    number: u8,
    /// Number of the next message, 0 to 255.
    next: u8,
    /// Series that a birth has named.
    known: BTreeSet<i64>,
    rebirth: bool,
    /// The death of the device has been sent.
    dead: bool,
    host: PrimaryHost,
    requests: Requests,
    /// What the network has asked for and is not answered yet.
    requested_changes: Vec<AskedChange>,
}

impl SparkplugSink {
    pub(super) fn new(target: SparkplugTarget, (name, requests): (&str, Requests), outbox: &Outbox) -> Self {
        let of_machine = || outbox.path().map_or_else(SparkplugPlace::of_nobody, SparkplugPlace::of_path);
        Self {
            place: target.place.clone().unwrap_or_else(of_machine),
            target,
            name: name.to_owned(),
            outbox: outbox.clone(),
            link: Link::default(),
            number: 0,
            next: 0,
            known: BTreeSet::new(),
            rebirth: false,
            dead: false,
            host: PrimaryHost::default(),
            requests,
            requested_changes: Vec::new(),
        }
    }

    /// Takes what a message of the network asks for; true when there is something to attend to.
    fn accept_message(&mut self, message: &mqtt::MqttMessage) -> bool {
        let of_node = message.topic == self.place.format_topic("NCMD");
        if !of_node && message.topic != self.place.format_topic("DCMD") {
            return false;
        }
        let payload = match Payload::decode(&message.payload[..]) {
            Ok(payload) => payload,
            Err(error) => {
                self.requested_changes = vec![commands::refuse_unreadable(&error.to_string())];
                return true;
            }
        };
        self.rebirth |= of_node && births::asks_rebirth(&payload);
        self.requested_changes = commands::parse_changes(&payload, message.retained);
        self.rebirth || !self.requested_changes.is_empty()
    }

    /// Hands to the gate what was asked for, and tells what became of it.
    async fn answer_requests(&mut self) -> Result<(), SinkError> {
        for AskedChange { origin, change } in std::mem::take(&mut self.requested_changes) {
            let id = origin.id.clone();
            let Some(reply) = self.requests.submit_change(origin, change).await else { continue };
            self.tell_metric(commands::build_answer_metric(&reply, id.as_deref(), now_ms())).await?;
        }
        while let Some(outcome) = self.requests.next_outcome() {
            let told = commands::build_outcome_metric(outcome, now_ms());
            self.tell_metric(told).await?;
            self.requests.forget_outcome();
        }
        Ok(())
    }

    async fn tell_metric(&mut self, metric: payload::Metric) -> Result<(), SinkError> {
        let told = self.build_message(self.data_kind(), vec![metric], now_ms());
        self.publish_messages(vec![told]).await.map_err(|(_, failure)| failure.of_item(None))
    }

    fn data_kind(&self) -> &'static str {
        if self.place.device.is_some() { "DDATA" } else { "NDATA" }
    }

    /// The next message of the node, with its number.
    fn build_message(&mut self, kind: &str, metrics: Vec<payload::Metric>, at_ms: u64) -> Outgoing {
        let payload = Payload { timestamp: Some(at_ms), metrics, seq: Some(self.next.into()) };
        self.next = self.next.wrapping_add(1);
        Outgoing { topic: self.place.format_topic(kind), payload: payload.encode_to_vec(), retain: false }
    }

    async fn publish_birth(&mut self) -> Result<(), SinkError> {
        (self.next, self.rebirth, self.dead) = (0, false, false);
        let at_ms = now_ms();
        let latest = self.outbox.latest_readings();
        let mut machine = births::build_machine_metrics(&latest, &mut self.known, at_ms);
        machine.extend(commands::build_request_metrics(self.requests.is_allowed(), at_ms));
        let node = births::build_node_metrics(self.number, at_ms);
        let messages = if self.place.device.is_some() {
            vec![self.build_message("NBIRTH", node, at_ms), self.build_message("DBIRTH", machine, at_ms)]
        } else {
            vec![self.build_message("NBIRTH", [node, machine].concat(), at_ms)]
        };
        self.publish_messages(messages).await.map_err(|(_, failure)| failure.of_item(None))
    }

    async fn publish_messages(&self, messages: Vec<Outgoing>) -> Result<(), (usize, BrokerFailure)> {
        self.link.publish_messages(messages, Qos::AtMostOnce, &self.target.broker).await
    }

    async fn first_values(&self) {
        let has_some =
            || self.outbox.latest_readings().iter().any(|reading| !matches!(reading.value, Cell::Missing(_)));
        let mut head = self.outbox.watch_head();
        let waiting = async { while !has_some() && head.changed().await.is_ok() {} };
        // A machine that is off gets a birth of missing values.
        let _late = tokio::time::timeout(FIRST_VALUES, waiting).await;
    }

    fn state_topic(&self) -> Option<String> {
        self.target.host.as_ref().map(|host| format!("spBv1.0/STATE/{host}"))
    }

    /// Waits until the primary host is there.
    async fn wait_for_host(&mut self) -> Result<(), SinkError> {
        let Some(topic) = self.state_topic() else { return Ok(()) };
        // The broker tells again what it has kept.
        let mut host = self.host.asked_again();
        let waiting = async {
            loop {
                let message = self.link.next(&self.target.broker).await?;
                if message.topic == topic {
                    host.accept_message(&message.payload);
                }
                if host.online {
                    return Ok(());
                }
            }
        };
        let waited = tokio::time::timeout(HOST_WITHIN, waiting).await;
        self.host = host;
        waited.unwrap_or_else(|_| Err(self.no_host()))
    }

    /// The host says that it goes: the node dies as the specification wants it, and the connection ends.
    async fn lose_host(&mut self) -> SinkError {
        self.say_death().await;
        self.no_host()
    }

    async fn say_death(&mut self) {
        let payload = births::build_death(self.number, now_ms()).encode_to_vec();
        let death = Outgoing { topic: self.place.format_topic("NDEATH"), payload, retain: false };
        // Where this does not go through, the will says the same.
        let _gone = self.link.publish_messages(vec![death], Qos::AtLeastOnce, &self.target.broker).await;
        self.link.disconnect_client().await;
    }

    /// The device dies when no source delivers anything, and lives as soon as one does.
    async fn say_device_death(&mut self) -> Result<(), SinkError> {
        let lives = self.outbox.latest_readings().iter().any(births::is_read);
        if self.place.device.is_none() || self.dead || lives {
            return Ok(());
        }
        self.dead = true;
        let death = self.build_message("DDEATH", Vec::new(), now_ms());
        self.publish_messages(vec![death]).await.map_err(|(_, failure)| failure.of_item(None))
    }

    fn no_host(&self) -> SinkError {
        let host = self.target.host.as_deref().unwrap_or_default();
        let next = "start it, or leave host= out of the address; everything is kept meanwhile";
        SinkError::failed_line(format!("the primary host {host} is not online"), next)
    }

    async fn open_connection(&mut self) -> Result<(), SinkError> {
        self.first_values().await;
        // From 0 to 255, then from 0 again, kept over restarts (specification, 6.4.19): the death of a connection before must not match this birth.
        let number = self.outbox.begin_connection(&self.name, NOTED_WITHIN).await;
        self.number = number.to_le_bytes()[0];
        let payload = births::build_death(self.number, now_ms()).encode_to_vec();
        let will = Will {
            topic: self.place.format_topic("NDEATH"),
            payload,
            qos: Qos::AtLeastOnce,
            retain: false,
            at_leave: true,
        };
        let name = client_name(&self.outbox.box_id(), &self.name);
        self.link.connect(&self.target.broker, &name, Some(will)).await?;
        let mut commands = vec![self.place.format_topic("NCMD")];
        commands.extend(self.place.device.as_ref().map(|_| self.place.format_topic("DCMD")));
        commands.extend(self.state_topic());
        self.link.subscribe_to(commands, Qos::AtLeastOnce, &self.target.broker).await?;
        self.wait_for_host().await?;
        self.publish_birth().await
    }

    async fn deliver_batch(&mut self, batch: Batch<'_>) -> Result<(), SinkError> {
        if self.dead && !batch.items.iter().any(births::is_of_living) {
            return Ok(());
        }
        if self.rebirth || self.dead || batch.items.iter().any(|item| births::is_unknown(item, &self.known)) {
            let told = |item| births::is_unknown(item, &self.known);
            let unknown: Vec<_> = batch.items.iter().filter(|item| told(item)).flat_map(series_of).collect();
            self.known.extend(unknown);
            self.publish_birth().await?;
        }
        let first = self.next;
        let kind = self.data_kind();
        let now = now_ms();
        let messages: Vec<Outgoing> = batch
            .items
            .iter()
            .map(|item| self.build_message(kind, births::build_item_metrics(item, batch.historical), now))
            .collect();
        let sent = self.publish_messages(messages).await;
        sent.map_err(|(index, failure)| {
            // Those after it did not go out; their numbers are used again.
            self.next = first.wrapping_add(index.to_le_bytes()[0]);
            failure.of_item(batch.items.get(index).map(|item| item.sequence))
        })?;
        // Old data says nothing of now.
        if batch.historical { Ok(()) } else { self.say_device_death().await }
    }
}

fn series_of(item: &gateway_history::Item) -> Vec<i64> {
    match &item.content {
        gateway_history::Content::Sample(readings) => readings.iter().map(|reading| reading.series.id).collect(),
        _ => Vec::new(),
    }
}

fn now_ms() -> u64 {
    births::to_milliseconds(clock::now_ns())
}

impl Sink for SparkplugSink {
    fn connect(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(self.open_connection())
    }

    fn send_batch<'a>(&'a mut self, batch: Batch<'a>) -> Pending<'a, Result<(), SinkError>> {
        Box::pin(self.deliver_batch(batch))
    }

    fn wait_for_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(async move {
            loop {
                let message = tokio::select! {
                    message = self.link.next(&self.target.broker) => message?,
                    () = self.requests.wait_for_outcome() => return Ok(()),
                };
                if self.accept_message(&message) {
                    return Ok(());
                }
                if self.state_topic().is_some_and(|topic| topic == message.topic) {
                    self.host.accept_message(&message.payload);
                    if !self.host.online {
                        return Ok(());
                    }
                }
                // Everything else that the network says is heard by nobody.
            }
        })
    }

    fn serve_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(async move {
            if self.target.host.is_some() && !self.host.online {
                return Err(self.lose_host().await);
            }
            if self.rebirth {
                self.publish_birth().await?;
            }
            self.answer_requests().await
        })
    }

    fn probe_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(self.link.probe_broker(&self.target.broker))
    }

    fn close(&mut self) -> Pending<'_, ()> {
        Box::pin(async move {
            if self.place.device.is_some() && !self.dead {
                let death = self.build_message("DDEATH", Vec::new(), now_ms());
                let _gone = self.publish_messages(vec![death]).await;
            }
            self.say_death().await;
        })
    }

    /// With fewer than 256 messages between two signs of life no number is on its way twice.
    fn items_max(&self) -> usize {
        200
    }
}
