//! `nats://HOST:4222,HOST:4222/PREFIX` and `natss://`: every item as one message in a JetStream stream.
//!
//! Subjects: `PREFIX.BOX.KIND`, where the prefix is `cnc` if none is written, with the path of the machine before the box where there is one:
//! `PREFIX.PATH.BOX.KIND`. The document is that of `mqtt://`. The header
//! `Nats-Msg-Id` is `<box>-<epoch>-<sequence>`: what a box sends twice within the stream's window is stored once. A message counts as
//! delivered when the stream has acknowledged it, with replicas when most of them have it. Where the stream says that it has an item
//! already which this run has made and never sent, the item is refused and told: something else sends under the name of this box.

use super::mqtt::build_document;
use super::sent_numbers::SentNumbers;
use super::target_error::TargetError;
use super::{Batch, Pending, Sink, SinkError};
use adapter_core::address::Keys;
use gateway_history::{Item, Outbox};
use gateway_nats::{Connection, JetStreamFailure, NatsError, NatsTarget, Outgoing};

/// Where to, and under which subjects.
#[derive(Debug, Clone, PartialEq)]
pub struct NatsSinkTarget {
    /// Servers, TLS files and login of the cluster.
    pub target: NatsTarget,
    /// What every subject begins with.
    pub prefix: String,
}

impl NatsSinkTarget {
    pub(super) fn parse(body: &str, keys: &mut Keys, secured: bool) -> Result<Self, TargetError> {
        let (servers, prefix) = NatsTarget::parse(body, keys, secured)?;
        let prefix = if prefix.is_empty() { "cnc" } else { prefix };
        let bad = |part: &str| part.is_empty() || part.starts_with('$') || part.contains(['*', '>', ' ', '/']);
        if prefix.split('.').any(bad) {
            return Err(TargetError::Subject { prefix: prefix.to_owned() });
        }
        Ok(Self { target: servers, prefix: prefix.to_owned() })
    }
}

pub(super) struct NatsSink {
    target: NatsSinkTarget,
    name: String,
    outbox: Outbox,
    connection: Option<Connection>,
    /// With which server the next connection is tried first.
    server: usize,
    /// Items of this life that were sent, in which epoch.
    sent_numbers: (u64, SentNumbers),
}

impl NatsSink {
    pub(super) fn new(target: NatsSinkTarget, name: &str, outbox: &Outbox) -> Self {
        Self {
            target,
            name: name.to_owned(),
            outbox: outbox.clone(),
            connection: None,
            server: 0,
            sent_numbers: Default::default(),
        }
    }

    fn format_subject(&self, kind: &str) -> String {
        let id = self.outbox.box_id();
        // `doctor` asks before there is a box.
        let id = if id.is_empty() { "doctor" } else { &id };
        let place = self.outbox.path().map(|path| format!("{}.", path.format_dotted())).unwrap_or_default();
        format!("{}.{place}{id}.{kind}", self.target.prefix)
    }

    fn build_message(&self, item: &Item, historical: bool) -> Outgoing {
        Outgoing {
            subject: self.format_subject(item.kind()),
            id: format_message_id(&self.outbox.box_id(), item),
            payload: build_document(&self.outbox, item, historical).to_string().into_bytes(),
        }
    }

    /// Notes that these are sent now; gives which of them were made since the history was opened and never sent.
    fn note_sending(&mut self, items: &[Item]) -> Vec<bool> {
        let epoch = self.outbox.epoch();
        if self.sent_numbers.0 != epoch {
            self.sent_numbers = (epoch, SentNumbers::default());
        }
        let numbers = &mut self.sent_numbers.1;
        let note = |item: &Item| {
            let fresh = item.epoch == epoch && !numbers.contains(item.sequence);
            if item.epoch == epoch {
                numbers.insert(item.sequence);
            }
            fresh
        };
        items.iter().map(note).collect()
    }

    async fn open_connection(&mut self) -> Result<(), SinkError> {
        self.connection = None;
        let name = format!("{} ({})", self.outbox.box_id(), self.name);
        let first = self.server;
        self.server = self.server.wrapping_add(1);
        let mut connection = Connection::open(&self.target.target, first, &name).await?;
        connection.stream_of(&self.format_subject("sample")).await?;
        self.connection = Some(connection);
        Ok(())
    }
}

/// What the stream knows an item by. Items from before there were epochs keep the name that they were sent under.
pub(crate) fn format_message_id(box_id: &str, item: &Item) -> String {
    match item.epoch {
        0 => format!("{box_id}-{}", item.sequence),
        epoch => format!("{box_id}-{epoch:x}-{}", item.sequence),
    }
}

/// The stream has these already, although nobody can have sent those that are fresh: the first of them is not delivered.
fn refuse_foreign(items: &[Item], fresh: &[bool], duplicates: &[usize]) -> Result<(), SinkError> {
    let foreign = duplicates.iter().find(|index| fresh.get(**index) == Some(&true));
    match foreign.and_then(|index| items.get(*index)) {
        None => Ok(()),
        Some(item) => Err(SinkError::Item {
            sequence: item.sequence,
            what: "the stream has a message of its name already, and this run has never sent it".to_owned(),
            next: "look which other computer sends under the name of this box, and stop it; the history still has the values"
                .to_owned(),
        }),
    }
}

impl From<NatsError> for SinkError {
    fn from(error: NatsError) -> Self {
        Self::Line { what: error.what, next: error.next }
    }
}

fn not_connected() -> SinkError {
    SinkError::failed_line("not connected to a NATS server", "")
}

impl Sink for NatsSink {
    fn connect(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(self.open_connection())
    }

    fn send_batch<'a>(&'a mut self, batch: Batch<'a>) -> Pending<'a, Result<(), SinkError>> {
        Box::pin(async move {
            let messages: Vec<Outgoing> =
                batch.items.iter().map(|item| self.build_message(item, batch.historical)).collect();
            let fresh = self.note_sending(batch.items);
            let connection = self.connection.as_mut().ok_or_else(not_connected)?;
            match connection.publish_all(&messages).await {
                Ok(duplicates) => refuse_foreign(batch.items, &fresh, &duplicates),
                Err((_, JetStreamFailure::Line(error))) => Err(error.into()),
                Err((index, JetStreamFailure::Message(NatsError { what, next }))) => {
                    let sequence = batch.items.get(index).map_or(0, |item| item.sequence);
                    Err(SinkError::Item { sequence, what, next })
                }
            }
        })
    }

    fn wait_for_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(async move {
            // What comes here is nothing that was asked for: late acknowledgements.
            let connection = self.connection.as_mut().ok_or_else(not_connected)?;
            connection.next().await.map(drop).map_err(SinkError::from)
        })
    }
}
