//! One connection to a broker.

use super::inbox::Inbox;
use super::incoming::{Allows, Frames, Incoming};
use super::packet::{self, Qos};
use super::reader::{PacketWriter, READ_PAUSE, Reader};
use super::{MqttError, MqttMessage, Options, Version, words};
use adapter_core::address::Endpoint;
use adapter_core::stream;
use device_line::tls::{TcpConnection, TlsError, TlsFiles};
use std::sync::Arc;
use std::sync::atomic::{AtomicU16, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A connection to a broker. Dropping it says goodbye.
#[derive(Debug)]
pub struct MqttClient {
    writer: Arc<PacketWriter>,
    inbox: Arc<Inbox>,
    next_id: AtomicU16,
    deadline: Duration,
    version: Version,
    allows: Allows,
    will_at_leave: bool,
    thread: Option<JoinHandle<()>>,
}

impl MqttClient {
    /// Connects, with a clean session. Takes at most the deadline of the options.
    ///
    /// # Errors
    /// [`MqttError::Unreachable`], [`MqttError::Tls`], [`MqttError::Refused`] in the broker's words, or
    /// [`MqttError::Closed`].
    pub fn connect(options: &Options) -> Result<Self, MqttError> {
        let at = Endpoint { host: options.host.clone(), port: options.port };
        let broker = || format!("{}:{}", options.host, options.port);
        let io = |error: std::io::Error| MqttError::Unreachable { broker: broker(), what: error.to_string() };
        let until = Instant::now() + options.deadline;
        let lines = options.tls.as_ref().map(TlsFiles::build_config).transpose()?;
        let stream = stream::connect_host(&at, until).map_err(io)?;
        let pause = stream.try_clone().map_err(io)?;
        stream.set_write_timeout(Some(options.deadline)).map_err(io)?;
        stream.set_read_timeout(Some(options.deadline)).map_err(io)?;
        let broken = |error: std::io::Error| match TlsError::from_io_error(&error, &options.host) {
            Some(error) => MqttError::Tls(error),
            None => MqttError::Closed(error.to_string()),
        };
        let line = Arc::new(TcpConnection::from_tcp(stream, &options.host, &lines).map_err(broken)?);
        pause.set_read_timeout(Some(READ_PAUSE.min(options.deadline))).map_err(io)?;
        line.write_all(&packet::encode_connect(options)?).map_err(broken)?;
        let (frames, allows) = wait_for_connack(&line, options, until)?;
        let writer = Arc::new(PacketWriter::new(line));
        let inbox = Arc::new(Inbox::default());
        let asked = options.keep_alive.max(Duration::from_secs(1));
        let keep_alive = allows.keep_alive_s.map_or(asked, |seconds| asked.min(Duration::from_secs(seconds.into())));
        let reader = Reader { frames, writer: writer.clone(), inbox: inbox.clone(), keep_alive };
        let thread = std::thread::Builder::new().name("mqtt".to_owned()).spawn(move || reader.run()).map_err(io)?;
        Ok(Self {
            writer,
            inbox,
            next_id: AtomicU16::new(1),
            deadline: options.deadline,
            version: options.version,
            allows,
            will_at_leave: options.version == Version::V5 && options.will.as_ref().is_some_and(|will| will.at_leave),
            thread: Some(thread),
        })
    }

    /// What the broker has said it allows.
    pub(super) fn broker_limits(&self) -> Allows {
        self.allows
    }

    pub(super) fn version(&self) -> Version {
        self.version
    }

    /// Subscribes and waits for the broker's consent.
    ///
    /// # Errors
    /// [`MqttError::Refused`] names the filters that the broker does not grant.
    pub fn subscribe_filters(&self, filters: &[String], qos: Qos) -> Result<(), MqttError> {
        let id = self.allocate_packet_id();
        self.send_packet(&packet::encode_subscribe(self.version, id, filters, qos)?)?;
        let codes = self.wait_for_acknowledgement(id, "a subscription")?;
        let refused: Vec<&str> =
            filters.iter().zip(&codes).filter(|(_, code)| **code >= 0x80).map(|(filter, _)| filter.as_str()).collect();
        if refused.is_empty() {
            Ok(())
        } else {
            Err(MqttError::Refused(format!("to subscribe {}", refused.join(", "))))
        }
    }

    /// The next message, waiting for one at most `wait`.
    ///
    /// # Errors
    /// [`MqttError::Closed`] when the connection is over and everything that had arrived is taken.
    pub fn receive_message(&self, wait: Duration) -> Result<Option<MqttMessage>, MqttError> {
        self.inbox.take_message(Instant::now() + wait)
    }

    /// Why the connection is over; `None` while it stands.
    #[must_use]
    pub fn close_reason(&self) -> Option<MqttError> {
        self.inbox.close_reason()
    }

    /// Messages that nobody took in time.
    #[must_use]
    pub fn count_dropped(&self) -> u64 {
        self.inbox.count_dropped()
    }

    pub(super) fn send_packet(&self, packet: &[u8]) -> Result<(), MqttError> {
        self.writer.write(packet).map_err(|error| self.close_broken(&error))
    }

    /// Half a packet may be on the line: nothing can follow it.
    fn close_broken(&self, error: &std::io::Error) -> MqttError {
        let why = MqttError::Closed(error.to_string());
        self.inbox.close(why.clone());
        self.writer.shut_connection();
        why
    }

    pub(super) fn wait_for_acknowledgement(&self, id: u16, what: &'static str) -> Result<Vec<u8>, MqttError> {
        let found = self.inbox.take_acknowledgement(id, Instant::now() + self.deadline)?;
        found.ok_or(MqttError::Unacknowledged { what, deadline_ms: self.deadline.as_millis() })
    }

    /// Asks the broker for a sign of life and waits for it.
    pub(super) fn sign_of_life(&self) -> Result<(), MqttError> {
        let count = self.writer.send_ping().map_err(|error| self.close_broken(&error))?;
        match self.inbox.await_signs(count, Instant::now() + self.deadline)? {
            true => Ok(()),
            false => {
                let deadline_ms = self.deadline.as_millis();
                Err(MqttError::Unacknowledged { what: "a request for a sign of life", deadline_ms })
            }
        }
    }

    /// 1 to 65535, around and around.
    pub(super) fn allocate_packet_id(&self) -> u16 {
        self.next_id
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |id| Some(id.checked_add(1).unwrap_or(1)))
            .unwrap_or(1)
    }
}

impl Drop for MqttClient {
    fn drop(&mut self) {
        let farewell: &[u8] = if self.will_at_leave { &packet::DISCONNECT_WITH_WILL } else { &packet::DISCONNECT };
        let _broker_is_gone = self.writer.write(farewell);
        self.writer.shut_connection();
        if let Some(thread) = self.thread.take() {
            // The reading thread cannot panic; if it did, there is nobody to tell.
            let _ended = thread.join();
        }
    }
}

/// Waits for `CONNACK` (section 3.2); what came after it stays in the frames.
fn wait_for_connack(line: &TcpConnection, options: &Options, until: Instant) -> Result<(Frames, Allows), MqttError> {
    let (mut frames, mut buffer) = (Frames::with_version(options.version), [0; 1024]);
    while Instant::now() < until {
        match line.read(&mut buffer) {
            Ok(0) => return Err(hung_up(line)),
            Ok(count) => frames.push(&buffer[..count]),
            Err(error) if stream::is_silence(&error) => continue,
            Err(error) => {
                let within = TlsError::from_io_error(&error, &options.host);
                return Err(within.map_or_else(|| hung_up(line), MqttError::Tls));
            }
        }
        match frames.next().map_err(MqttError::Closed)? {
            Some(Incoming::ConnAck { code: 0, allows }) => return Ok((frames, allows)),
            Some(Incoming::ConnAck { code, .. }) => {
                return Err(MqttError::Refused(words::describe_connect_refusal(options.version, code)));
            }
            Some(_) => return Err(MqttError::Closed("something else than a greeting came first".to_owned())),
            None => {}
        }
    }
    Err(MqttError::Unacknowledged { what: "the connection", deadline_ms: options.deadline.as_millis() })
}

/// A broker that wants TLS, or another kind of it, says nothing and goes.
fn hung_up(line: &TcpConnection) -> MqttError {
    let hint = if line.is_secured() { "" } else { "; a port that wants TLS does so, usually 8883" };
    MqttError::Closed(format!("the broker hung up at once{hint}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
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
            let outcome = MqttClient::connect(&options(port)).map(|_| ());
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
        assert!(matches!(MqttClient::connect(&options(port)), Err(MqttError::Unreachable { .. })));
    }

    #[test]
    fn a_subscription_that_is_not_granted_is_named() {
        let (port, thread) = saying(b"\x20\x02\x00\x00\x90\x04\x00\x01\x00\x80");
        let client = MqttClient::connect(&options(port)).expect("greeted");
        let said =
            client.subscribe_filters(&["a".to_owned(), "b".to_owned()], Qos::AtMostOnce).expect_err("b is refused");
        assert!(said.to_string().contains("to subscribe b"), "{said}");
        assert!(matches!(
            client.publish_message("t", b"", Qos::AtLeastOnce),
            Err(MqttError::Unacknowledged { what: "a message", .. })
        ));
        drop(client);
        thread.join().expect("no panic");
    }
}
