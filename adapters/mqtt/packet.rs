//! Packets as bytes (MQTT 3.1.1, sections 2 and 3). Pure: bytes in, packets out.

use super::{MqttError, Options, PACKET_MAX};

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

/// What a broker sends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Incoming {
    ConnAck { code: u8 },
    Publish { topic: String, payload: Vec<u8>, acknowledge: Option<u16> },
    PubAck(u16),
    SubAck { id: u16, codes: Vec<u8> },
    PingResp,
}

/// `PINGREQ` (section 3.12).
pub(super) const PING: [u8; 2] = [0xc0, 0];
/// `DISCONNECT` (section 3.14).
pub(super) const DISCONNECT: [u8; 2] = [0xe0, 0];

/// `CONNECT` with a clean session (section 3.1).
pub(super) fn connect(options: &Options) -> Result<Vec<u8>, MqttError> {
    let mut body = Vec::new();
    text(&mut body, "MQTT")?;
    let login = if options.login.is_some() { 0xc0 } else { 0 };
    let keep_alive_s = u16::try_from(options.keep_alive.as_secs()).unwrap_or(u16::MAX);
    body.extend([4, 0x02 | login]);
    body.extend(keep_alive_s.to_be_bytes());
    text(&mut body, &options.client_id)?;
    if let Some((user, password)) = &options.login {
        text(&mut body, user)?;
        text(&mut body, password)?;
    }
    framed(0x10, &body)
}

/// `PUBLISH` (section 3.3); with an identifier the receiver acknowledges.
pub(super) fn publish(topic: &str, payload: &[u8], id: Option<u16>) -> Result<Vec<u8>, MqttError> {
    if topic.is_empty() || topic.contains(['+', '#', '\0']) {
        return Err(MqttError::Unsendable(format!("{topic:?} is no topic to publish to")));
    }
    let mut body = Vec::with_capacity(topic.len() + payload.len() + 4);
    text(&mut body, topic)?;
    body.extend(id.iter().flat_map(|id| id.to_be_bytes()));
    body.extend_from_slice(payload);
    framed(0x30 | if id.is_some() { 0x02 } else { 0 }, &body)
}

/// `PUBACK` (section 3.4).
pub(super) fn acknowledge(id: u16) -> [u8; 4] {
    let [high, low] = id.to_be_bytes();
    [0x40, 2, high, low]
}

/// `SUBSCRIBE` (section 3.8).
pub(super) fn subscribe(id: u16, filters: &[String], qos: Qos) -> Result<Vec<u8>, MqttError> {
    let mut body = id.to_be_bytes().to_vec();
    for filter in filters {
        text(&mut body, filter)?;
        body.push(qos.level());
    }
    framed(0x82, &body)
}

fn text(body: &mut Vec<u8>, text: &str) -> Result<(), MqttError> {
    let length = u16::try_from(text.len());
    let length = length.map_err(|_| MqttError::Unsendable(format!("a text of {} bytes", text.len())))?;
    body.extend(length.to_be_bytes());
    body.extend_from_slice(text.as_bytes());
    Ok(())
}

/// The fixed header with the remaining length in seven bits per byte (section 2.2.3), and the rest.
fn framed(first: u8, body: &[u8]) -> Result<Vec<u8>, MqttError> {
    if body.len() > PACKET_MAX {
        return Err(MqttError::Unsendable(format!("{} bytes; at most {PACKET_MAX} are sent", body.len())));
    }
    let mut packet = vec![first];
    let mut rest = body.len();
    loop {
        let seven = u8::try_from(rest & 0x7f).unwrap_or(0);
        rest >>= 7;
        packet.push(if rest > 0 { seven | 0x80 } else { seven });
        if rest == 0 {
            break;
        }
    }
    packet.extend_from_slice(body);
    Ok(packet)
}

/// Bytes as they come, cut into packets.
#[derive(Debug, Default)]
pub(super) struct Frames {
    bytes: Vec<u8>,
    used: usize,
}

impl Frames {
    pub(super) fn push(&mut self, bytes: &[u8]) {
        if self.used > 0 {
            self.bytes.drain(..self.used);
            self.used = 0;
        }
        self.bytes.extend_from_slice(bytes);
    }

    /// The next whole packet; `None` when more bytes are needed. After an error the line is of no use any more.
    pub(super) fn next(&mut self) -> Result<Option<Incoming>, String> {
        let waiting = &self.bytes[self.used..];
        let Some((length, header)) = remaining_length(waiting)? else { return Ok(None) };
        let Some(body) = waiting.get(header..header + length) else { return Ok(None) };
        let packet = decode(waiting[0], body)?;
        self.used += header + length;
        Ok(Some(packet))
    }
}

/// Length of the body, and of the header before it.
fn remaining_length(bytes: &[u8]) -> Result<Option<(usize, usize)>, String> {
    let mut length = 0;
    for index in 0..4 {
        let Some(byte) = bytes.get(1 + index) else { return Ok(None) };
        length |= usize::from(byte & 0x7f) << (7 * index);
        if byte & 0x80 == 0 {
            return match length <= PACKET_MAX {
                true => Ok(Some((length, 2 + index))),
                false => Err(format!("a packet of {length} bytes; at most {PACKET_MAX} are taken")),
            };
        }
    }
    Err("a length of more than four bytes: this is not MQTT".to_owned())
}

fn decode(first: u8, body: &[u8]) -> Result<Incoming, String> {
    let short = || format!("a packet of type {} is too short", first >> 4);
    match (first >> 4, body) {
        (2, [_, code]) => Ok(Incoming::ConnAck { code: *code }),
        (3, _) => decode_publish(first, body).ok_or_else(short),
        (4, [high, low]) => Ok(Incoming::PubAck(u16::from_be_bytes([*high, *low]))),
        (9, [high, low, codes @ ..]) => {
            Ok(Incoming::SubAck { id: u16::from_be_bytes([*high, *low]), codes: codes.to_vec() })
        }
        (13, []) => Ok(Incoming::PingResp),
        (2 | 4 | 9 | 13, _) => Err(short()),
        (other, _) => Err(format!("a packet of type {other}, which a broker does not send here")),
    }
}

fn decode_publish(first: u8, body: &[u8]) -> Option<Incoming> {
    let (length, rest) = body.split_first_chunk::<2>()?;
    let (topic, rest) = rest.split_at_checked(usize::from(u16::from_be_bytes(*length)))?;
    let topic = String::from_utf8(topic.to_vec()).ok()?;
    if (first >> 1) & 3 == 0 {
        return Some(Incoming::Publish { topic, payload: rest.to_vec(), acknowledge: None });
    }
    let (id, payload) = rest.split_first_chunk::<2>()?;
    Some(Incoming::Publish { topic, payload: payload.to_vec(), acknowledge: Some(u16::from_be_bytes(*id)) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_connection_is_asked_for_as_the_standard_writes_it() {
        let options = Options {
            host: String::new(),
            port: 1,
            client_id: "ab".to_owned(),
            login: Some(("u".to_owned(), "p".to_owned())),
            keep_alive: Duration::from_secs(20),
            deadline: Duration::ZERO,
        };
        let expected = b"\x10\x14\x00\x04MQTT\x04\xc2\x00\x14\x00\x02ab\x00\x01u\x00\x01p";
        assert_eq!(connect(&options).expect("short enough"), expected);
    }

    #[test]
    fn messages_and_subscriptions_have_their_identifiers() {
        assert_eq!(publish("a/b", b"xy", None).expect("fits"), b"\x30\x07\x00\x03a/bxy");
        assert_eq!(publish("a/b", b"xy", Some(258)).expect("fits"), b"\x32\x09\x00\x03a/b\x01\x02xy");
        let two = ["a/#".to_owned(), "b".to_owned()];
        assert_eq!(
            subscribe(10, &two, Qos::AtLeastOnce).expect("fits"),
            b"\x82\x0c\x00\x0a\x00\x03a/#\x01\x00\x01b\x01"
        );
        assert!(publish("a/#", b"", None).is_err() && publish(&"x".repeat(70_000), b"", None).is_err());
    }

    #[test]
    fn packets_survive_any_cut_of_the_line() {
        let mut line = b"\x20\x02\x00\x00\x90\x03\x00\x0a\x80\xd0\x00".to_vec();
        line.extend(publish("t", &[7; 300], Some(9)).expect("fits"));
        let expected = [
            Incoming::ConnAck { code: 0 },
            Incoming::SubAck { id: 10, codes: vec![0x80] },
            Incoming::PingResp,
            Incoming::Publish { topic: "t".to_owned(), payload: vec![7; 300], acknowledge: Some(9) },
        ];
        for size in [1, 2, 3, 5, 64, 1000] {
            let (mut frames, mut found) = (Frames::default(), Vec::new());
            for part in line.chunks(size) {
                frames.push(part);
                while let Some(packet) = frames.next().expect("well formed") {
                    found.push(packet);
                }
            }
            assert_eq!(found, expected, "{size} bytes at a time");
        }
    }

    #[test]
    fn what_is_not_mqtt_is_refused_in_words() {
        let said = |bytes: &[u8]| {
            let mut frames = Frames::default();
            frames.push(bytes);
            frames.next().expect_err("refused")
        };
        assert!(said(b"\x30\xff\xff\xff\xff\xff").contains("not MQTT"));
        assert!(said(b"\x30\xff\xff\xff\x7f").contains("bytes"));
        assert!(said(b"\x30\x01\x00").contains("too short"));
        assert!(said(b"\x50\x00").contains("type 5"));
    }

    proptest::proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..64)) {
            let mut frames = Frames::default();
            frames.push(&bytes);
            while let Ok(Some(_)) = frames.next() {}
        }
    }
}
