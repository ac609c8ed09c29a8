//! What this client sends, as bytes (MQTT 3.1.1, sections 2 and 3). Pure.

use super::{MqttError, Options, PACKET_MAX, Version};
use adapter_core::integer::convert_bounded;

/// How hard a message is delivered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Qos {
    /// Once or never; nobody is told.
    AtMostOnce,
    /// At least once; the receiver acknowledges.
    AtLeastOnce,
}

impl Qos {
    pub(super) fn level(self) -> u8 {
        match self {
            Self::AtMostOnce => 0,
            Self::AtLeastOnce => 1,
        }
    }
}

/// `PINGREQ` (section 3.12).
pub(super) const PING: [u8; 2] = [0xc0, 0];
/// `DISCONNECT` (section 3.14): the will is not published.
pub(super) const DISCONNECT: [u8; 2] = [0xe0, 0];
/// `DISCONNECT` of version 5 with the reason "Disconnect with Will Message".
pub(super) const DISCONNECT_WITH_WILL: [u8; 3] = [0xe0, 1, 0x04];
/// No properties (section 5-2.2.2).
const NO_PROPERTIES: u8 = 0;

/// `CONNECT` with a clean session (section 3.1).
pub(super) fn encode_connect(options: &Options) -> Result<Vec<u8>, MqttError> {
    let five = options.version == Version::V5;
    let mut body = Vec::new();
    append_text(&mut body, "MQTT")?;
    let login = if options.login.is_some() { 0xc0 } else { 0 };
    let will = options.will.as_ref().map_or(0, |will| 0x04 | (will.qos.level() << 3) | (u8::from(will.retain) << 5));
    // Two bytes hold 18 hours; who wishes for more is content with them.
    let keep_alive_s = u16::try_from(options.keep_alive.as_secs()).unwrap_or(u16::MAX);
    body.extend([if five { 5 } else { 4 }, 0x02 | login | will]);
    body.extend(keep_alive_s.to_be_bytes());
    body.extend(five.then_some(NO_PROPERTIES));
    append_text(&mut body, &options.client_id)?;
    if let Some(will) = &options.will {
        body.extend(five.then_some(NO_PROPERTIES));
        append_text(&mut body, &will.topic)?;
        append_bytes(&mut body, &will.payload, "a will")?;
    }
    if let Some((user, password)) = &options.login {
        append_text(&mut body, user)?;
        append_text(&mut body, password)?;
    }
    frame_packet(0x10, &body)
}

/// `PUBLISH` (section 3.3); with an identifier the receiver acknowledges.
pub(super) fn encode_publish(
    version: Version,
    topic: &str,
    payload: &[u8],
    id: Option<u16>,
    retain: bool,
) -> Result<Vec<u8>, MqttError> {
    if topic.is_empty() || topic.contains(['+', '#', '\0']) {
        return Err(MqttError::Unsendable(format!("{topic:?} is no topic to publish to")));
    }
    let mut body = Vec::with_capacity(topic.len() + payload.len() + 5);
    append_text(&mut body, topic)?;
    body.extend(id.iter().flat_map(|id| id.to_be_bytes()));
    body.extend((version == Version::V5).then_some(NO_PROPERTIES));
    body.extend_from_slice(payload);
    frame_packet(0x30 | u8::from(retain) | if id.is_some() { 0x02 } else { 0 }, &body)
}

/// `PUBACK` (section 3.4).
pub(super) fn encode_puback(id: u16) -> [u8; 4] {
    let [high, low] = id.to_be_bytes();
    [0x40, 2, high, low]
}

/// `SUBSCRIBE` (section 3.8).
pub(super) fn encode_subscribe(version: Version, id: u16, filters: &[String], qos: Qos) -> Result<Vec<u8>, MqttError> {
    let mut body = id.to_be_bytes().to_vec();
    body.extend((version == Version::V5).then_some(NO_PROPERTIES));
    for filter in filters {
        append_text(&mut body, filter)?;
        body.push(qos.level());
    }
    frame_packet(0x82, &body)
}

fn append_text(body: &mut Vec<u8>, text: &str) -> Result<(), MqttError> {
    append_bytes(body, text.as_bytes(), "a text")
}

fn append_bytes(body: &mut Vec<u8>, bytes: &[u8], what: &str) -> Result<(), MqttError> {
    let length = u16::try_from(bytes.len());
    let length = length.map_err(|_| {
        MqttError::Unsendable(format!("{what} of {} bytes where at most {} fit", bytes.len(), u16::MAX))
    })?;
    body.extend(length.to_be_bytes());
    body.extend_from_slice(bytes);
    Ok(())
}

/// The fixed header with the remaining length in seven bits per byte (section 2.2.3), and the rest.
fn frame_packet(first: u8, body: &[u8]) -> Result<Vec<u8>, MqttError> {
    if body.len() > PACKET_MAX {
        return Err(MqttError::Unsendable(format!("{} bytes; at most {PACKET_MAX} are sent", body.len())));
    }
    let mut packet = vec![first];
    let mut rest = body.len();
    loop {
        let seven = convert_bounded(rest & 0x7f, 0x7f_u8);
        rest >>= 7;
        packet.push(if rest > 0 { seven | 0x80 } else { seven });
        if rest == 0 {
            break;
        }
    }
    packet.extend_from_slice(body);
    Ok(packet)
}

#[cfg(test)]
mod tests {
    use super::super::Will;
    use super::*;
    use std::time::Duration;

    fn options() -> Options {
        Options {
            client_id: "ab".to_owned(),
            login: Some(("u".to_owned(), "p".to_owned())),
            keep_alive: Duration::from_secs(20),
            ..Options::new("", 1, "")
        }
    }

    #[test]
    fn a_connection_is_asked_for_as_the_standard_writes_it() {
        let expected = b"\x10\x14\x00\x04MQTT\x04\xc2\x00\x14\x00\x02ab\x00\x01u\x00\x01p";
        assert_eq!(encode_connect(&options()).expect("short enough"), expected);
        let will = Will {
            topic: "t".to_owned(),
            payload: b"xyz".to_vec(),
            qos: Qos::AtLeastOnce,
            retain: true,
            at_leave: false,
        };
        let five = Options { version: Version::V5, will: Some(will), login: None, ..options() };
        let expected = b"\x10\x1a\x00\x04MQTT\x05\x2e\x00\x14\x00\x00\x02ab\x00\x00\x01t\x00\x03xyz";
        assert_eq!(encode_connect(&five).expect("short enough")[2..], expected[2..]);
    }

    #[test]
    fn messages_and_subscriptions_have_their_identifiers() {
        let publish = |topic: &str, payload, id| encode_publish(Version::V3, topic, payload, id, false);
        assert_eq!(publish("a/b", b"xy", None).expect("fits"), b"\x30\x07\x00\x03a/bxy");
        assert_eq!(publish("a/b", b"xy", Some(258)).expect("fits"), b"\x32\x09\x00\x03a/b\x01\x02xy");
        let two = ["a/#".to_owned(), "b".to_owned()];
        assert_eq!(
            encode_subscribe(Version::V3, 10, &two, Qos::AtLeastOnce).expect("fits"),
            b"\x82\x0c\x00\x0a\x00\x03a/#\x01\x00\x01b\x01"
        );
        assert!(publish("a/#", b"", None).is_err() && publish(&"x".repeat(70_000), b"", None).is_err());
    }
}
