//! Items of the history once more, through a connection of their own beside that of the running box.

use super::mqtt::MqttSink;
use super::nats::NatsSink;
use super::{Batch, Requests, Sink, SinkAddress, SinkError, SinkTarget};
use gateway_history::{Item, Outbox};
use std::time::Duration;
use tokio::time::{Instant, sleep, sleep_until, timeout};

/// Items of one batch.
const BATCH: usize = 256;
/// A receiver that takes longer than this for a batch has failed.
const DEADLINE: Duration = Duration::from_secs(60);
/// Pauses after a failure, and how often it is tried before the command gives up.
const PAUSE: Duration = Duration::from_secs(2);
const TRIES_MAX: u32 = 30;

/// Sends items that were made from the history, no faster than is allowed.
pub struct Resender {
    sink: Box<dyn Sink>,
    has_connection: bool,
    /// From one item to the next, s.
    pace_s: f64,
    next: Option<Instant>,
    /// Items that the receiver has taken.
    pub sent_count: u64,
    /// Items that the receiver will never take.
    pub refused_count: u64,
}

impl Resender {
    /// To the receiver of this address, at most so many items a second; `None` for a receiver that cannot take old data beside new.
    #[must_use]
    pub fn new(address: &SinkAddress, name: &str, outbox: &Outbox, rate_per_s: f64) -> Option<Self> {
        let name = format!("{name}-resend");
        let sink: Box<dyn Sink> = match address.target() {
            SinkTarget::Nats(target) => Box::new(NatsSink::new(target.clone(), &name, outbox)),
            SinkTarget::Mqtt(target) => Box::new(
                MqttSink::new(target.clone(), (name.as_str(), Requests::without_gate()), outbox).with_items_only(),
            ),
            _ => return None,
        };
        Some(Self {
            sink,
            has_connection: false,
            pace_s: 1.0 / rate_per_s,
            next: None,
            sent_count: 0,
            refused_count: 0,
        })
    }

    /// Sends these and returns when the receiver has all that it takes. After a failure it is tried again.
    ///
    /// # Errors
    /// The last failure, when too many tries have failed one after the other.
    pub async fn send_items(&mut self, items: &[Item]) -> Result<(), SinkError> {
        for batch in items.chunks(BATCH) {
            self.wait_for_turn(batch.len()).await;
            self.send_batch(batch).await?;
        }
        Ok(())
    }

    async fn wait_for_turn(&mut self, items: usize) {
        let due = self.next.unwrap_or_else(Instant::now);
        sleep_until(due).await;
        #[expect(clippy::cast_precision_loss, reason = "a batch is small")]
        let lasts = Duration::from_secs_f64(self.pace_s * items as f64);
        self.next = Some(due.max(Instant::now()) + lasts);
    }

    async fn send_batch(&mut self, batch: &[Item]) -> Result<(), SinkError> {
        let mut rest = batch;
        let mut tries = 0;
        while !rest.is_empty() {
            match self.try_sending(rest).await {
                Ok(()) => {
                    self.sent_count += rest.len() as u64;
                    return Ok(());
                }
                Err(SinkError::Item { sequence, .. }) => {
                    let index = rest.iter().position(|item| item.sequence == sequence).unwrap_or(0);
                    self.sent_count += index as u64;
                    self.refused_count += 1;
                    rest = &rest[index + 1..];
                }
                Err(error) => {
                    self.has_connection = false;
                    tries += 1;
                    if tries >= TRIES_MAX {
                        return Err(error);
                    }
                    sleep(PAUSE).await;
                }
            }
        }
        Ok(())
    }

    async fn try_sending(&mut self, items: &[Item]) -> Result<(), SinkError> {
        let late = |_| SinkError::failed_line("the receiver does not answer in time", "look whether it is overloaded");
        if !self.has_connection {
            timeout(DEADLINE, self.sink.connect()).await.map_err(late)??;
            self.has_connection = true;
        }
        timeout(DEADLINE, self.sink.send_batch(Batch { items, historical: true })).await.map_err(late)?
    }

    /// Takes leave of the receiver, which then does not wait for more; at most two seconds.
    pub async fn close(&mut self) {
        // The receiver finds out by itself where the farewell does not reach it.
        let _late = timeout(Duration::from_secs(2), self.sink.close()).await;
    }
}
