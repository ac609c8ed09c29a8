//! The thread that reads: it fills the inbox, acknowledges, and keeps the connection alive.

use super::inbox::Inbox;
use super::incoming::{Frames, Incoming};
use super::packet::{PING, encode_puback};
use super::{MqttError, MqttMessage, words};
use adapter_core::stream::is_silence;
use adapter_core::threads::reach_fault_point;
use device_line::tls::TcpConnection;
use std::io::ErrorKind;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A read waits this long, then the clock is looked at.
pub(super) const READ_PAUSE: Duration = Duration::from_millis(200);

/// The writing half of the connection; one packet at a time.
#[derive(Debug)]
pub(super) struct PacketWriter {
    connection: Arc<TcpConnection>,
    /// When something was sent last. Held while it is sent: one packet at a time.
    sent: Mutex<Sent>,
}

#[derive(Debug)]
struct Sent {
    at: Instant,
    /// Requests for a sign of life so far.
    pings: u64,
}

impl PacketWriter {
    pub(super) fn new(line: Arc<TcpConnection>) -> Self {
        Self { connection: line, sent: Mutex::new(Sent { at: Instant::now(), pings: 0 }) }
    }

    pub(super) fn write(&self, packet: &[u8]) -> std::io::Result<()> {
        let mut sent = self.sent.lock().unwrap_or_else(PoisonError::into_inner);
        sent.at = Instant::now();
        self.connection.write_all(packet)
    }

    /// Asks for a sign of life; how many have been asked for with this one.
    pub(super) fn send_ping(&self) -> std::io::Result<u64> {
        let mut sent = self.sent.lock().unwrap_or_else(PoisonError::into_inner);
        (sent.at, sent.pings) = (Instant::now(), sent.pings + 1);
        self.connection.write_all(&PING).map(|()| sent.pings)
    }

    /// Ends the connection in both directions; the reading thread ends by it.
    pub(super) fn shut_connection(&self) {
        self.connection.shut_connection();
    }

    fn idle_time(&self, now: Instant) -> Duration {
        now.saturating_duration_since(self.sent.lock().unwrap_or_else(PoisonError::into_inner).at)
    }
}

pub(super) struct Reader {
    pub(super) frames: Frames,
    pub(super) writer: Arc<PacketWriter>,
    pub(super) inbox: Arc<Inbox>,
    pub(super) keep_alive: Duration,
}

/// Whoever waits for messages learns that none will come, also when reading broke off.
impl Drop for Reader {
    fn drop(&mut self) {
        self.inbox.close(MqttError::Closed("reading has ended".to_owned()));
        self.writer.shut_connection();
    }
}

impl Reader {
    /// Reads until the connection ends, and says why it did.
    pub(super) fn run(mut self) {
        let why = self.read().err().unwrap_or_else(|| "closed by the broker".to_owned());
        self.inbox.close(MqttError::Closed(why));
    }

    fn read(&mut self) -> Result<(), String> {
        let mut buffer = vec![0; 64 * 1024];
        let mut heard = Instant::now();
        self.dispatch_packets()?;
        loop {
            reach_fault_point("mqtt");
            match self.writer.connection.read(&mut buffer) {
                Ok(0) => return Ok(()),
                Ok(count) => {
                    heard = Instant::now();
                    self.frames.push(&buffer[..count]);
                    self.dispatch_packets()?;
                }
                Err(error) if is_silence(&error) => {}
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error.to_string()),
            }
            self.keep_alive(heard)?;
        }
    }

    fn dispatch_packets(&mut self) -> Result<(), String> {
        while let Some(packet) = self.frames.next()? {
            match packet {
                Incoming::Publish { topic, payload, acknowledge: id, retained } => {
                    self.inbox.push_message(MqttMessage { topic, payload, arrived: Instant::now(), retained });
                    if let Some(id) = id {
                        self.writer.write(&encode_puback(id)).map_err(|error| error.to_string())?;
                    }
                }
                Incoming::PubAck(id, code) => self.inbox.record_acknowledgement(id, vec![code]),
                Incoming::SubAck { id, codes } => self.inbox.record_acknowledgement(id, codes),
                Incoming::Disconnect(code) => {
                    return Err(format!("the broker ends it: {}", words::describe_reason(code)));
                }
                Incoming::PingResp => self.inbox.record_life_sign(),
                Incoming::ConnAck { .. } => {}
            }
        }
        Ok(())
    }

    /// Half of the keep-alive without a packet from us: a sign of life is sent. One and a half without one from the
    /// broker: it is gone (section 3.1.2.10 gives the other side the same measure).
    fn keep_alive(&self, heard: Instant) -> Result<(), String> {
        let now = Instant::now();
        let silent = now.saturating_duration_since(heard);
        if silent > self.keep_alive.mul_f64(1.5) {
            return Err(format!("the broker has been silent for {} s", silent.as_secs()));
        }
        if self.writer.idle_time(now) >= self.keep_alive / 2 {
            self.writer.send_ping().map_err(|error| error.to_string())?;
        }
        Ok(())
    }
}
