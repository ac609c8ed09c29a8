//! What has arrived: messages, acknowledgements, and the end of the connection.

use super::{MqttError, MqttMessage, QUEUE_BYTES, QUEUE_MESSAGES};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Acknowledgements that nobody waits for any more are dropped beyond this many.
const ACKNOWLEDGEMENTS_MAX: usize = 1024;

#[derive(Debug, Default)]
struct Contents {
    messages: VecDeque<MqttMessage>,
    bytes: usize,
    dropped: u64,
    /// What the broker said to packets with an identifier: one code per subscription, none for a message.
    acknowledged: BTreeMap<u16, Vec<u8>>,
    /// Signs of life that the broker has given.
    signs: u64,
    closed: Option<MqttError>,
}

/// Filled by the reading thread, emptied by the caller.
#[derive(Debug, Default)]
pub(super) struct Inbox {
    contents: Mutex<Contents>,
    changed: Condvar,
}

impl Inbox {
    pub(super) fn push_message(&self, message: MqttMessage) {
        let mut contents = self.lock_contents();
        contents.bytes += message.payload.len();
        contents.messages.push_back(message);
        while contents.messages.len() > QUEUE_MESSAGES || contents.bytes > QUEUE_BYTES {
            let Some(oldest) = contents.messages.pop_front() else { break };
            contents.bytes -= oldest.payload.len();
            contents.dropped += 1;
        }
        self.changed.notify_all();
    }

    pub(super) fn record_acknowledgement(&self, id: u16, codes: Vec<u8>) {
        let mut contents = self.lock_contents();
        contents.acknowledged.insert(id, codes);
        if contents.acknowledged.len() > ACKNOWLEDGEMENTS_MAX {
            contents.acknowledged.pop_first();
        }
        self.changed.notify_all();
    }

    pub(super) fn record_life_sign(&self) {
        self.lock_contents().signs += 1;
        self.changed.notify_all();
    }

    /// Waits until the broker has given so many signs of life; false when it has not until then.
    pub(super) fn await_signs(&self, count: u64, until: Instant) -> Result<bool, MqttError> {
        self.wait_until_found(until, |contents| (contents.signs >= count).then_some(())).map(|found| found.is_some())
    }

    /// The connection is over; the first reason stays.
    pub(super) fn close(&self, why: MqttError) {
        self.lock_contents().closed.get_or_insert(why);
        self.changed.notify_all();
    }

    /// The oldest message, waiting for one until `until`. What arrived before the connection broke is still given.
    pub(super) fn take_message(&self, until: Instant) -> Result<Option<MqttMessage>, MqttError> {
        self.wait_until_found(until, |contents| {
            let message = contents.messages.pop_front()?;
            contents.bytes -= message.payload.len();
            Some(message)
        })
    }

    /// What the broker said to packet `id`, waiting for it until `until`.
    pub(super) fn take_acknowledgement(&self, id: u16, until: Instant) -> Result<Option<Vec<u8>>, MqttError> {
        self.wait_until_found(until, |contents| contents.acknowledged.remove(&id))
    }

    fn wait_until_found<T>(
        &self,
        until: Instant,
        mut take: impl FnMut(&mut Contents) -> Option<T>,
    ) -> Result<Option<T>, MqttError> {
        let mut contents = self.lock_contents();
        loop {
            if let Some(found) = take(&mut contents) {
                return Ok(Some(found));
            }
            if let Some(why) = &contents.closed {
                return Err(why.clone());
            }
            let left = until.saturating_duration_since(Instant::now());
            if left == Duration::ZERO {
                return Ok(None);
            }
            contents = self.changed.wait_timeout(contents, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    pub(super) fn close_reason(&self) -> Option<MqttError> {
        self.lock_contents().closed.clone()
    }

    pub(super) fn count_dropped(&self) -> u64 {
        self.lock_contents().dropped
    }

    fn lock_contents(&self) -> MutexGuard<'_, Contents> {
        self.contents.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(bytes: usize) -> MqttMessage {
        MqttMessage { topic: String::new(), payload: vec![0; bytes], arrived: Instant::now(), retained: false }
    }

    #[test]
    fn a_full_inbox_drops_the_oldest_and_counts() {
        let inbox = Inbox::default();
        (1..=QUEUE_MESSAGES + 3).for_each(|n| inbox.push_message(message(n)));
        assert_eq!(inbox.count_dropped(), 3);
        let oldest = inbox.take_message(Instant::now()).expect("open").expect("full");
        assert_eq!(oldest.payload.len(), 4, "messages 1 to 3 are gone");
        inbox.push_message(message(QUEUE_BYTES));
        assert_eq!(inbox.take_message(Instant::now()).expect("open").map(|m| m.payload.len()), Some(QUEUE_BYTES));
    }

    #[test]
    fn what_arrived_before_the_end_is_still_given() {
        let inbox = Inbox::default();
        inbox.push_message(message(1));
        inbox.close(MqttError::Closed("first".to_owned()));
        inbox.close(MqttError::Closed("second".to_owned()));
        assert!(inbox.take_message(Instant::now()).expect("waiting").is_some());
        assert_eq!(inbox.take_message(Instant::now()), Err(MqttError::Closed("first".to_owned())));
        assert_eq!(inbox.take_acknowledgement(1, Instant::now()), Err(MqttError::Closed("first".to_owned())));
    }
}
