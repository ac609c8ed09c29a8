//! What a broker sends, cut out of the bytes as they come. Pure.

use super::{PACKET_MAX, Version};

/// What a broker sends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Incoming {
    ConnAck {
        code: u8,
        allows: Allows,
    },
    Publish {
        topic: String,
        payload: Vec<u8>,
        acknowledge: Option<u16>,
        retained: bool,
    },
    /// Identifier, and from version 5 on a code that may say no.
    PubAck(u16, u8),
    SubAck {
        id: u16,
        codes: Vec<u8>,
    },
    PingResp,
    /// Version 5: why the broker ends the connection.
    Disconnect(u8),
}

/// What a broker allows (version 5; earlier ones do not say).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Allows {
    /// Messages on their way at once.
    pub(super) receive_maximum: Option<u16>,
    /// Bytes of a packet.
    pub(super) packet_max: Option<u32>,
    pub(super) keep_alive_s: Option<u16>,
}

/// Bytes as they come, cut into packets.
#[derive(Debug, Default)]
pub(super) struct Frames {
    version: Version,
    bytes: Vec<u8>,
    used: usize,
}

impl Frames {
    pub(super) fn with_version(version: Version) -> Self {
        Self { version, ..Self::default() }
    }

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
        let packet = decode_packet(self.version, waiting[0], body)?;
        self.used += header + length;
        Ok(Some(packet))
    }
}

/// Length of the body, and of the header before it.
fn remaining_length(bytes: &[u8]) -> Result<Option<(usize, usize)>, String> {
    let Some(after) = bytes.get(1..) else { return Ok(None) };
    let Some((length, used)) = decode_variable_int(after)? else { return Ok(None) };
    match length <= PACKET_MAX {
        true => Ok(Some((length, 1 + used))),
        false => Err(format!("a packet of {length} bytes; at most {PACKET_MAX} are taken")),
    }
}

/// A number of seven bits per byte, and how many bytes it took (section 2.2.3).
fn decode_variable_int(bytes: &[u8]) -> Result<Option<(usize, usize)>, String> {
    let mut number = 0;
    for index in 0..4 {
        let Some(byte) = bytes.get(index) else { return Ok(None) };
        number |= usize::from(byte & 0x7f) << (7 * index);
        if byte & 0x80 == 0 {
            return Ok(Some((number, index + 1)));
        }
    }
    Err("a length of more than four bytes: this is not MQTT".to_owned())
}

fn decode_packet(version: Version, first: u8, body: &[u8]) -> Result<Incoming, String> {
    let short = || format!("a packet of type {} is too short", first >> 4);
    let five = version == Version::V5;
    match (first >> 4, body) {
        (2, [_, code, rest @ ..]) => {
            let allows =
                if five && *code == 0 { parse_broker_limits(rest).ok_or_else(short)? } else { Allows::default() };
            Ok(Incoming::ConnAck { code: *code, allows })
        }
        (3, _) => decode_publish(five, first, body).ok_or_else(short),
        (4, [high, low, rest @ ..]) => {
            Ok(Incoming::PubAck(u16::from_be_bytes([*high, *low]), rest.first().copied().unwrap_or(0)))
        }
        (9, [high, low, rest @ ..]) => {
            let codes = if five { split_properties(rest).ok_or_else(short)?.1 } else { rest };
            Ok(Incoming::SubAck { id: u16::from_be_bytes([*high, *low]), codes: codes.to_vec() })
        }
        (13, []) => Ok(Incoming::PingResp),
        (14, rest) if five => Ok(Incoming::Disconnect(rest.first().copied().unwrap_or(0))),
        (2 | 4 | 9 | 13, _) => Err(short()),
        (other, _) => Err(format!("a packet of type {other}, which a broker does not send here")),
    }
}

fn decode_publish(five: bool, first: u8, body: &[u8]) -> Option<Incoming> {
    let (length, rest) = body.split_first_chunk::<2>()?;
    let (topic, rest) = rest.split_at_checked(usize::from(u16::from_be_bytes(*length)))?;
    let topic = String::from_utf8(topic.to_vec()).ok()?;
    let (acknowledge, rest) = match (first >> 1) & 3 {
        0 => (None, rest),
        _ => rest.split_first_chunk::<2>().map(|(id, rest)| (Some(u16::from_be_bytes(*id)), rest))?,
    };
    let payload = if five { split_properties(rest)?.1 } else { rest };
    Some(Incoming::Publish { topic, payload: payload.to_vec(), acknowledge, retained: first & 1 == 1 })
}

/// The properties at the beginning, and what follows them (section 5-2.2.2).
fn split_properties(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, used) = decode_variable_int(bytes).ok()??;
    bytes.get(used..)?.split_at_checked(length)
}

/// What a greeting says in its properties; those that do not matter here are passed over (section 5-3.2.2.3).
fn parse_broker_limits(bytes: &[u8]) -> Option<Allows> {
    let (mut left, _) = split_properties(bytes)?;
    let mut allows = Allows::default();
    while let Some((kind, rest)) = left.split_first() {
        let length = match kind {
            0x24 | 0x25 | 0x28 | 0x29 | 0x2a => 1,
            0x13 | 0x21 | 0x22 => 2,
            0x11 | 0x27 => 4,
            0x12 | 0x15 | 0x16 | 0x1a | 0x1c | 0x1f => 2 + text_length(rest)?,
            0x26 => {
                let name = 2 + text_length(rest)?;
                name + 2 + text_length(rest.get(name..)?)?
            }
            _ => return None,
        };
        let (value, after) = rest.split_at_checked(length)?;
        match (kind, value) {
            (0x21, [high, low]) => allows.receive_maximum = Some(u16::from_be_bytes([*high, *low])),
            (0x13, [high, low]) => allows.keep_alive_s = Some(u16::from_be_bytes([*high, *low])),
            (0x27, [a, b, c, d]) => allows.packet_max = Some(u32::from_be_bytes([*a, *b, *c, *d])),
            _ => {}
        }
        left = after;
    }
    Some(allows)
}

fn text_length(bytes: &[u8]) -> Option<usize> {
    bytes.first_chunk::<2>().map(|length| usize::from(u16::from_be_bytes(*length)))
}

#[cfg(test)]
mod tests {
    use super::super::packet;
    use super::*;

    fn all(version: Version, line: &[u8], size: usize) -> Vec<Incoming> {
        let (mut frames, mut found) = (Frames::with_version(version), Vec::new());
        for part in line.chunks(size) {
            frames.push(part);
            while let Some(packet) = frames.next().expect("well formed") {
                found.push(packet);
            }
        }
        found
    }

    #[test]
    fn packets_survive_any_cut_of_the_line() {
        let mut line = b"\x20\x02\x00\x00\x90\x03\x00\x0a\x80\xd0\x00".to_vec();
        line.extend(packet::encode_publish(Version::V3, "t", &[7; 300], Some(9), false).expect("fits"));
        let publish =
            Incoming::Publish { topic: "t".to_owned(), payload: vec![7; 300], acknowledge: Some(9), retained: false };
        let greeting = Incoming::ConnAck { code: 0, allows: Allows::default() };
        let granted = Incoming::SubAck { id: 10, codes: vec![0x80] };
        let expected = [greeting, granted, Incoming::PingResp, publish];
        for size in [1, 2, 3, 5, 64, 1000] {
            assert_eq!(all(Version::V3, &line, size), expected, "{size} bytes at a time");
        }
    }

    #[test]
    fn version_five_says_what_it_allows_and_why_it_ends() {
        let mut line = b"\x20\x13\x00\x00\x10\x21\x00\x14\x27\x00\x00\x10\x00\x13\x00\x1e\x26\x00\x00\x00\x00".to_vec();
        line.extend(b"\x40\x03\x00\x07\x95\xe0\x01\x8e\x90\x04\x00\x01\x00\x87");
        line.extend(packet::encode_publish(Version::V5, "t", b"xy", None, true).expect("fits"));
        let allows = Allows { receive_maximum: Some(20), packet_max: Some(4096), keep_alive_s: Some(30) };
        let payload = b"xy".to_vec();
        let expected = [
            Incoming::ConnAck { code: 0, allows },
            Incoming::PubAck(7, 0x95),
            Incoming::Disconnect(0x8e),
            Incoming::SubAck { id: 1, codes: vec![0x87] },
            Incoming::Publish { topic: "t".to_owned(), payload, acknowledge: None, retained: true },
        ];
        for size in [1, 3, 1000] {
            assert_eq!(all(Version::V5, &line, size), expected, "{size} bytes at a time");
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
        fn no_bytes_make_it_panic(
            bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..64),
            five in proptest::prelude::any::<bool>(),
        ) {
            let mut frames = Frames::with_version(if five { Version::V5 } else { Version::V3 });
            frames.push(&bytes);
            while let Ok(Some(_)) = frames.next() {}
        }
    }
}
