//! Messages on their way: many at once, each acknowledged.

use super::client::MqttClient;
use super::packet::{self, Qos};
use super::{MqttError, words};
use adapter_core::integer::widen_to_usize;
use std::collections::VecDeque;

/// A message to send.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outgoing {
    /// The topic under which it is published.
    pub topic: String,
    /// The bytes that are published.
    pub payload: Vec<u8>,
    /// Does the broker keep it for later subscribers?
    pub retain: bool,
}

/// Messages on their way at once; brokers take at least 20 of version 3.1.1 clients, and say what they take in version 5.
const ON_THEIR_WAY: usize = 20;
/// Codes of messages that are refused for what they are: name of the topic, size, form of the payload (section 5-2.4).
const NEVER: [u8; 3] = [0x90, 0x95, 0x99];
/// A code from here on says no (section 5-2.4).
const REFUSED: u8 = 0x80;

impl MqttClient {
    /// Sends a message; with [`Qos::AtLeastOnce`] it waits for the broker's acknowledgement.
    ///
    /// # Errors
    /// See [`MqttError`].
    pub fn publish_message(&self, topic: &str, payload: &[u8], qos: Qos) -> Result<(), MqttError> {
        let message = Outgoing { topic: topic.to_owned(), payload: payload.to_vec(), retain: false };
        let id = (qos == Qos::AtLeastOnce).then(|| self.allocate_packet_id());
        self.send_one(&message, id)?;
        id.map_or(Ok(()), |id| self.wait_for_puback(id))
    }

    /// Sends messages in this order and returns when the broker has read all of them: with [`Qos::AtLeastOnce`] several
    /// are on their way at once and each is acknowledged; with [`Qos::AtMostOnce`] the broker is asked for a sign of life
    /// after the last one, and a broker reads a connection in order.
    ///
    /// # Errors
    /// The index of the first message that is not known to have arrived, and why. After [`MqttError::Refused`] and
    /// [`MqttError::Unsendable`] the connection stands.
    pub fn publish_all(&self, messages: &[Outgoing], qos: Qos) -> Result<(), (usize, MqttError)> {
        let mut waiting: VecDeque<(usize, u16)> = VecDeque::new();
        for (index, message) in messages.iter().enumerate() {
            let id = (qos == Qos::AtLeastOnce).then(|| self.allocate_packet_id());
            if let Err(error) = self.send_one(message, id) {
                // What went out before it decides first.
                waiting
                    .drain(..)
                    .try_for_each(|(index, id)| self.wait_for_puback(id).map_err(|error| (index, error)))?;
                return Err((index, error));
            }
            waiting.extend(id.map(|id| (index, id)));
            if waiting.len() >= self.broker_limits().receive_maximum.map_or(ON_THEIR_WAY, usize::from).max(1)
                && let Some((index, id)) = waiting.pop_front()
            {
                self.wait_for_puback(id).map_err(|error| (index, error))?;
            }
        }
        if qos == Qos::AtMostOnce && !messages.is_empty() {
            return self.sign_of_life().map_err(|error| (0, error));
        }
        waiting.drain(..).try_for_each(|(index, id)| self.wait_for_puback(id).map_err(|error| (index, error)))
    }

    fn send_one(&self, message: &Outgoing, id: Option<u16>) -> Result<(), MqttError> {
        let Outgoing { topic, payload, retain } = message;
        let packet = packet::encode_publish(self.version(), topic, payload, id, *retain)?;
        let limit = self.broker_limits().packet_max.map_or(usize::MAX, widen_to_usize);
        if packet.len() > limit {
            let what = format!("{} bytes on {topic}; the broker takes at most {limit}", packet.len());
            return Err(MqttError::Unsendable(what));
        }
        self.send_packet(&packet)
    }

    fn wait_for_puback(&self, id: u16) -> Result<(), MqttError> {
        let code = self.wait_for_acknowledgement(id, "a message")?.first().copied().unwrap_or(0);
        if NEVER.contains(&code) {
            return Err(MqttError::Unsendable(format!(
                "the broker will not take it: {}",
                words::describe_reason(code)
            )));
        }
        if code >= REFUSED {
            return Err(MqttError::Refused(format!("a message: {}", words::describe_reason(code))));
        }
        Ok(())
    }
}
