//! One connection to a broker.

use super::inbox::Inbox;
use super::packet::{self, Frames, Incoming, Qos};
use super::reader::{READ_PAUSE, Reader, Writer};
use super::{Message, MqttError, Options};
use crate::address::Endpoint;
use crate::stream;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicU16, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A connection to a broker. Dropping it says goodbye.
#[derive(Debug)]
pub struct Client {
    writer: Arc<Writer>,
    inbox: Arc<Inbox>,
    next_id: AtomicU16,
    deadline: Duration,
    thread: Option<JoinHandle<()>>,
}

impl Client {
    /// Connects, with a clean session. Takes at most the deadline of the options.
    ///
    /// # Errors
    /// [`MqttError::Unreachable`], [`MqttError::Refused`] in the broker's words, or [`MqttError::Closed`].
    pub fn connect(options: &Options) -> Result<Self, MqttError> {
        let at = Endpoint { host: options.host.clone(), port: options.port };
        let broker = || format!("{}:{}", options.host, options.port);
        let io = |error: std::io::Error| MqttError::Unreachable { broker: broker(), what: error.to_string() };
        let mut stream = stream::connect(&at, Instant::now() + options.deadline).map_err(io)?;
        stream.set_write_timeout(Some(options.deadline)).map_err(io)?;
        stream.set_read_timeout(Some(READ_PAUSE.min(options.deadline))).map_err(io)?;
        stream.write_all(&packet::connect(options)?).map_err(io)?;
        let frames = greeted(&mut stream, options.deadline)?;
        let writer = Arc::new(Writer::new(stream.try_clone().map_err(io)?));
        let inbox = Arc::new(Inbox::default());
        let keep_alive = options.keep_alive.max(Duration::from_secs(1));
        let reader = Reader { stream, frames, writer: writer.clone(), inbox: inbox.clone(), keep_alive };
        let thread = std::thread::Builder::new().name("mqtt".to_owned()).spawn(move || reader.run()).map_err(io)?;
        Ok(Self { writer, inbox, next_id: AtomicU16::new(1), deadline: options.deadline, thread: Some(thread) })
    }

    /// Subscribes and waits for the broker's consent.
    ///
    /// # Errors
    /// [`MqttError::Refused`] names the filters that the broker does not grant.
    pub fn subscribe(&self, filters: &[String], qos: Qos) -> Result<(), MqttError> {
        let id = self.id();
        self.send(&packet::subscribe(id, filters, qos)?)?;
        let codes = self.acknowledged(id, "a subscription")?;
        let refused: Vec<&str> =
            filters.iter().zip(&codes).filter(|(_, code)| **code == 0x80).map(|(filter, _)| filter.as_str()).collect();
        if refused.is_empty() {
            Ok(())
        } else {
            Err(MqttError::Refused(format!("to subscribe {}", refused.join(", "))))
        }
    }

    /// Sends a message; with [`Qos::AtLeastOnce`] it waits for the broker's acknowledgement.
    ///
    /// # Errors
    /// See [`MqttError`].
    pub fn publish(&self, topic: &str, payload: &[u8], qos: Qos) -> Result<(), MqttError> {
        match qos {
            Qos::AtMostOnce => self.send(&packet::publish(topic, payload, None)?),
            Qos::AtLeastOnce => {
                let id = self.id();
                self.send(&packet::publish(topic, payload, Some(id))?)?;
                self.acknowledged(id, "a message").map(|_| ())
            }
        }
    }

    /// The next message, waiting for one at most `wait`.
    ///
    /// # Errors
    /// [`MqttError::Closed`] when the connection is over and everything that had arrived is taken.
    pub fn receive(&self, wait: Duration) -> Result<Option<Message>, MqttError> {
        self.inbox.take(Instant::now() + wait)
    }

    /// Why the connection is over; `None` while it stands.
    #[must_use]
    pub fn closed(&self) -> Option<MqttError> {
        self.inbox.closed()
    }

    /// Messages that nobody took in time.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.inbox.dropped()
    }

    fn send(&self, packet: &[u8]) -> Result<(), MqttError> {
        self.writer.write(packet).map_err(|error| {
            // Half a packet may be on the line: nothing can follow it.
            let why = MqttError::Closed(error.to_string());
            self.inbox.close(why.clone());
            self.writer.shut();
            why
        })
    }

    fn acknowledged(&self, id: u16, what: &'static str) -> Result<Vec<u8>, MqttError> {
        let found = self.inbox.take_acknowledgement(id, Instant::now() + self.deadline)?;
        found.ok_or(MqttError::Unacknowledged { what, deadline_ms: self.deadline.as_millis() })
    }

    /// 1 to 65535, around and around.
    fn id(&self) -> u16 {
        self.next_id
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |id| Some(id.checked_add(1).unwrap_or(1)))
            .unwrap_or(1)
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        let _broker_is_gone = self.writer.write(&packet::DISCONNECT);
        self.writer.shut();
        if let Some(thread) = self.thread.take() {
            // The reading thread cannot panic; if it did, there is nobody to tell.
            let _ended = thread.join();
        }
    }
}

/// Waits for `CONNACK` (section 3.2); what came after it stays in the frames.
fn greeted(stream: &mut TcpStream, deadline: Duration) -> Result<Frames, MqttError> {
    let until = Instant::now() + deadline;
    let (mut frames, mut buffer) = (Frames::default(), [0; 1024]);
    while Instant::now() < until {
        match stream.read(&mut buffer) {
            Ok(0) => return Err(MqttError::Closed("the broker hung up at once".to_owned())),
            Ok(count) => frames.push(&buffer[..count]),
            Err(error) if stream::is_silence(&error) => continue,
            Err(error) => return Err(MqttError::Closed(error.to_string())),
        }
        match frames.next().map_err(MqttError::Closed)? {
            Some(Incoming::ConnAck { code: 0 }) => return Ok(frames),
            Some(Incoming::ConnAck { code }) => return Err(MqttError::Refused(refusal(code))),
            Some(_) => return Err(MqttError::Closed("something else than a greeting came first".to_owned())),
            None => {}
        }
    }
    Err(MqttError::Unacknowledged { what: "the connection", deadline_ms: deadline.as_millis() })
}

/// Table 3.1 of the standard.
fn refusal(code: u8) -> String {
    match code {
        1 => "it does not speak MQTT 3.1.1".to_owned(),
        2 => "the name of this client".to_owned(),
        3 => "it is not available now".to_owned(),
        4 => "user or password are wrong".to_owned(),
        5 => "this user may not connect".to_owned(),
        other => format!("code {other}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    fn options(port: u16) -> Options {
        Options { deadline: Duration::from_millis(300), ..Options::new("127.0.0.1", port, "test") }
    }

    /// A broker that says these bytes to whoever comes, and then nothing.
    fn saying(bytes: &'static [u8]) -> (u16, JoinHandle<()>) {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let port = listener.local_addr().expect("bound").port();
        let thread = std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().expect("a client");
            stream.write_all(bytes).expect("writable");
            let mut rest = Vec::new();
            let _until_it_leaves = stream.read_to_end(&mut rest);
        });
        (port, thread)
    }

    #[test]
    fn refusals_and_silence_are_told_apart() {
        let outcome = |bytes| {
            let (port, thread) = saying(bytes);
            let outcome = Client::connect(&options(port)).map(|_| ());
            thread.join().expect("no panic");
            outcome
        };
        assert_eq!(outcome(b"\x20\x02\x00\x00"), Ok(()));
        let refused = outcome(b"\x20\x02\x00\x04");
        assert!(refused.is_err_and(|error| error.to_string().contains("password")));
        assert!(matches!(outcome(b""), Err(MqttError::Unacknowledged { .. })));
        assert!(matches!(outcome(b"\x50\x00"), Err(MqttError::Closed(_))));
    }

    #[test]
    fn nobody_there_is_unreachable() {
        let port = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a port").port();
        assert!(matches!(Client::connect(&options(port)), Err(MqttError::Unreachable { .. })));
    }

    #[test]
    fn a_subscription_that_is_not_granted_is_named() {
        let (port, thread) = saying(b"\x20\x02\x00\x00\x90\x04\x00\x01\x00\x80");
        let client = Client::connect(&options(port)).expect("greeted");
        let said = client.subscribe(&["a".to_owned(), "b".to_owned()], Qos::AtMostOnce).expect_err("b is refused");
        assert!(said.to_string().contains("to subscribe b"), "{said}");
        assert!(matches!(
            client.publish("t", b"", Qos::AtLeastOnce),
            Err(MqttError::Unacknowledged { what: "a message", .. })
        ));
        drop(client);
        thread.join().expect("no panic");
    }
}
