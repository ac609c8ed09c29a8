//! The server's side of the text protocol: bytes to operations. Pure; refuses what it does not know, never panics.

use serde::Deserialize;
use thiserror::Error;

/// A control line beyond this is no NATS: the servers' own limit is 4 KiB for clients, an `INFO` of a large cluster is longer.
const LINE_MAX: usize = 1 << 20;
/// The greatest message that a NATS server can be configured to pass on.
const MESSAGE_MAX: usize = 64 << 20;
/// Taken bytes are removed from the front when they are so many.
const COMPACT_AT: usize = 1 << 16;

/// What a server tells about itself.
#[derive(Debug, Clone, PartialEq, Eq, Default, Deserialize)]
#[serde(default)]
pub(super) struct ServerInfo {
    /// Greatest payload it takes, bytes.
    pub(super) max_payload: usize,
    pub(super) tls_required: bool,
    /// It can do TLS.
    pub(super) tls_available: bool,
    /// It is about to stop, and asks its clients to leave.
    pub(super) ldm: bool,
}

/// A message as it came.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// The subject that it was published under.
    pub subject: String,
    /// The number of the subscription it came through.
    pub(super) subscription: u64,
    /// Where an answer is expected.
    pub reply: Option<String>,
    /// The status line of its header: 503 nobody listens, 404 and 408 nothing there, ...
    pub(super) status: Option<(u16, String)>,
    /// The bytes after the header.
    pub payload: Vec<u8>,
}

impl Message {
    /// The words of the subject on which a message of JetStream is acknowledged: `$JS.ACK.` and, from newer servers, domain and
    /// account; then stream, consumer, how often it was given out, its number in the stream, ...
    fn parse_ack_number(&self, index: usize) -> Option<i64> {
        let words: Vec<&str> = self.reply.as_deref()?.strip_prefix("$JS.ACK.")?.split('.').collect();
        let further = if words.len() >= 9 { 2 } else { 0 };
        words.get(index + further)?.parse().ok()
    }

    /// Its number in the stream.
    #[must_use]
    pub fn stream_sequence(&self) -> Option<i64> {
        self.parse_ack_number(3)
    }

    /// When the stream stored it, microseconds since 1970.
    #[must_use]
    pub fn stored_us(&self) -> Option<i64> {
        self.parse_ack_number(5).map(|at_ns| at_ns.div_euclid(1000))
    }
}

/// What a server says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum ServerOperation {
    Info(ServerInfo),
    Message(Message),
    Ping,
    Pong,
    Fine,
    Error(String),
}

/// What came instead of an operation of NATS.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub(super) enum NotNats {
    /// A line that is longer than any of NATS.
    #[error("a line without an end")]
    EndlessLine,
    /// A line that is not UTF-8.
    #[error("a line that is no text")]
    NoText,
    /// The server says of itself what cannot be read.
    #[error("an unreadable INFO: {0}")]
    Info(String),
    /// The line of a message has other words than it must have.
    #[error("an unreadable message line {0:?}")]
    MessageLine(String),
    /// A line of something else; its beginning.
    #[error("{0:?}")]
    OtherLine(String),
}

/// Bytes that have come and are not taken yet.
#[derive(Debug, Default)]
pub(super) struct ReceivedBytes {
    pub(super) bytes: Vec<u8>,
    start: usize,
}

impl ReceivedBytes {
    /// The next operation, `None` until enough has come.
    ///
    /// # Errors
    /// What came is no NATS, in words.
    pub(super) fn next_operation(&mut self) -> Result<Option<ServerOperation>, NotNats> {
        let waiting = &self.bytes[self.start..];
        let found = parse(waiting)?;
        let taken = found.map(|(operation, length)| {
            self.start += length;
            operation
        });
        if self.start >= COMPACT_AT || self.start == self.bytes.len() {
            self.bytes.drain(..self.start);
            self.start = 0;
        }
        Ok(taken)
    }
}

/// The first operation and its length.
fn parse(bytes: &[u8]) -> Result<Option<(ServerOperation, usize)>, NotNats> {
    let Some(end) = bytes.windows(2).take(LINE_MAX).position(|pair| pair == b"\r\n") else {
        let endless = bytes.len() > LINE_MAX;
        return if endless { Err(NotNats::EndlessLine) } else { Ok(None) };
    };
    let line = std::str::from_utf8(&bytes[..end]).map_err(|_| NotNats::NoText)?;
    let (verb, rest) = line.split_once([' ', '\t']).unwrap_or((line, ""));
    let after = end + 2;
    let operation = match verb.to_ascii_uppercase().as_str() {
        "MSG" => return parse_message(&bytes[after..], rest, false).map(|found| found.map(|(m, n)| (m, after + n))),
        "HMSG" => return parse_message(&bytes[after..], rest, true).map(|found| found.map(|(m, n)| (m, after + n))),
        "PING" => ServerOperation::Ping,
        "PONG" => ServerOperation::Pong,
        "+OK" => ServerOperation::Fine,
        "-ERR" => ServerOperation::Error(rest.trim().trim_matches('\'').to_owned()),
        "INFO" => ServerOperation::Info(serde_json::from_str(rest).map_err(|error| NotNats::Info(error.to_string()))?),
        _ => return Err(NotNats::OtherLine(line.chars().take(40).collect())),
    };
    Ok(Some((operation, after)))
}

/// `subject sid [reply] [header bytes] bytes`, then the content.
fn parse_message(content: &[u8], line: &str, headed: bool) -> Result<Option<(ServerOperation, usize)>, NotNats> {
    let unreadable = || NotNats::MessageLine(line.to_owned());
    let words: Vec<&str> = line.split_ascii_whitespace().collect();
    let lengths = if headed { 2 } else { 1 };
    let (subject, subscription, reply) = match words.len().checked_sub(lengths) {
        Some(2) => (words[0], words[1], None),
        Some(3) => (words[0], words[1], Some(words[2].to_owned())),
        _ => return Err(unreadable()),
    };
    let number = |word: &str| word.parse::<usize>().ok().filter(|length| *length <= MESSAGE_MAX);
    let total = number(words[words.len() - 1]).ok_or_else(unreadable)?;
    let header = if headed { number(words[words.len() - 2]).ok_or_else(unreadable)? } else { 0 };
    let subscription = subscription.parse().map_err(|_| unreadable())?;
    if header > total {
        return Err(unreadable());
    }
    if content.len() < total + 2 {
        return Ok(None);
    }
    let status = parse_status(&content[..header]);
    let payload = content[header..total].to_vec();
    let message = Message { subject: subject.to_owned(), subscription, reply, status, payload };
    Ok(Some((ServerOperation::Message(message), total + 2)))
}

/// `NATS/1.0 503 No Responders`: code and words, where the first line of the header has them.
fn parse_status(header: &[u8]) -> Option<(u16, String)> {
    let text = std::str::from_utf8(header).ok()?;
    let rest = text.lines().next()?.strip_prefix("NATS/1.0")?.trim();
    let (code, words) = rest.split_once(' ').unwrap_or((rest, ""));
    Some((code.parse().ok()?, words.trim().to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn inbox(bytes: &[u8]) -> ReceivedBytes {
        ReceivedBytes { bytes: bytes.to_vec(), start: 0 }
    }

    #[test]
    fn messages_with_and_without_header_are_read() {
        let mut inbox = inbox(
            b"MSG a.b 1 5\r\nhello\r\nHMSG _INBOX.x.7 2 $JS.ACK.1 16 18\r\nNATS/1.0 503\r\n\r\nok\r\nPING\r\n+OK\r\n-ERR 'Authorization Violation'\r\n",
        );
        let Ok(Some(ServerOperation::Message(first))) = inbox.next_operation() else { panic!("a message") };
        assert_eq!((first.subject.as_str(), first.subscription, first.payload.as_slice()), ("a.b", 1, &b"hello"[..]));
        let Ok(Some(ServerOperation::Message(second))) = inbox.next_operation() else { panic!("a message") };
        assert_eq!(second.status, Some((503, String::new())));
        assert_eq!((second.reply.as_deref(), second.payload.as_slice()), (Some("$JS.ACK.1"), &b"ok"[..]));
        assert_eq!(inbox.next_operation(), Ok(Some(ServerOperation::Ping)));
        assert_eq!(inbox.next_operation(), Ok(Some(ServerOperation::Fine)));
        assert_eq!(inbox.next_operation(), Ok(Some(ServerOperation::Error("Authorization Violation".to_owned()))));
        assert_eq!(inbox.next_operation(), Ok(None));
        assert!(inbox.bytes.is_empty());
    }

    #[test]
    fn the_place_in_the_stream_stands_in_the_reply_of_old_and_new_servers() {
        let message = |reply: &str| Message {
            subject: "a".to_owned(),
            subscription: 1,
            reply: Some(reply.to_owned()),
            status: None,
            payload: Vec::new(),
        };
        for reply in
            ["$JS.ACK.CNC.fleet.1.42.7.1769847300100000999.3", "$JS.ACK._.acc.CNC.fleet.1.42.7.1769847300100000999.3.x"]
        {
            assert_eq!(message(reply).stream_sequence(), Some(42), "{reply}");
            assert_eq!(message(reply).stored_us(), Some(1_769_847_300_100_000), "{reply}");
        }
        assert_eq!(message("_INBOX.x").stream_sequence(), None);
    }

    #[test]
    fn another_protocol_is_refused() {
        assert!(inbox(b"HTTP/1.1 400 Bad Request\r\n\r\n").next_operation().is_err());
        assert!(inbox(b"MSG a 1 99999999999\r\n").next_operation().is_err());
        assert!(inbox(b"HMSG a 1 20 10\r\n").next_operation().is_err());
    }

    proptest! {
        #[test]
        fn any_bytes_in_any_pieces_end(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let mut inbox = inbox(&bytes);
            for _ in 0..=bytes.len() {
                if !matches!(inbox.next_operation(), Ok(Some(_))) { break; }
            }
        }

        #[test]
        fn a_message_is_the_same_in_any_pieces(payload in proptest::collection::vec(any::<u8>(), 0..200), cut in 0usize..240) {
            let mut whole = format!("MSG s 3 r {}\r\n", payload.len()).into_bytes();
            whole.extend(&payload);
            whole.extend(b"\r\n");
            let cut = cut.min(whole.len());
            let mut inbox = inbox(&whole[..cut]);
            let early = inbox.next_operation().expect("legal");
            prop_assert_eq!(early.is_some(), cut == whole.len());
            if early.is_none() {
                inbox.bytes.extend(&whole[cut..]);
                let Ok(Some(ServerOperation::Message(message))) = inbox.next_operation() else { panic!("whole") };
                prop_assert_eq!(message.payload, payload);
            }
        }
    }
}
