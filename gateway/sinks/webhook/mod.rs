//! `webhook://HOST:PORT/PATH` and `webhooks://` (TLS): each alarm as one POST of its document.
//!
//! The header `Idempotency-Key` is `<box>-<epoch>-<sequence>`: what a receiver gets twice, because its answer was lost or the box was
//! killed, has the same key. `X-Signature-256` is `sha256=` and the HMAC-SHA256 (RFC 2104) of the body under the secret of
//! `secret_file`, as hexadecimal digits. An alarm counts as delivered when the receiver answers 200 to 299. In the quiet hours nothing is
//! sent; alarms wait in the outbox and follow when they are over.

mod client;
mod quiet;

pub use quiet::QuietHours;

use super::address::TargetError;
use super::mqtt::build_document;
use super::nats::format_message_id;
use super::{Batch, Pending, Sink, SinkError};
use adapter_core::address::{Endpoint, Keys, parse_endpoint, tls_files};
use adapter_core::clock::TimeNs;
use adapter_core::tls::TlsFiles;
use client::{HttpConnection, Post, format_place};
use gateway_history::{Content, Item, Outbox, Record};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Duration;

/// A shorter secret is guessed from one message and its signature.
const SECRET_BYTES_MIN: usize = 16;
/// After a failure of a receiver that can be reached: the first pause, and the longest.
const PAUSE_FIRST: Duration = Duration::from_millis(500);
const PAUSE_MAX: Duration = Duration::from_secs(30);
/// Alarms of a batch that has failed which are known to have arrived: they are not sent again with it.
const CONFIRMED_MAX: usize = 4096;

/// How grave an alarm is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum AlarmSeverity {
    /// It is worth knowing.
    Info,
    /// Somebody has to look.
    Warning,
    /// Somebody has to act.
    Critical,
}

impl AlarmSeverity {
    const WORDS: [(&'static str, Self); 3] =
        [("info", Self::Info), ("warning", Self::Warning), ("critical", Self::Critical)];

    /// A word that is none of the three is told: an alarm more is better than one too few.
    fn from_word(word: &str) -> Self {
        Self::WORDS.iter().find(|(known, _)| *known == word).map_or(Self::Critical, |(_, severity)| *severity)
    }
}

/// Where to, and which alarms when.
#[derive(Debug, Clone, PartialEq)]
pub struct WebhookTarget {
    /// Host and port of the receiver.
    pub at: Endpoint,
    /// What is posted to, with the slash at its beginning.
    pub path: String,
    /// The files of TLS, where the line is secured.
    pub tls: Option<TlsFiles>,
    /// The file whose first line is the secret that bodies are signed with.
    pub secret_file: PathBuf,
    /// Lesser alarms are not sent.
    pub severity: AlarmSeverity,
    /// When nothing is sent.
    pub quiet: Option<QuietHours>,
}

impl WebhookTarget {
    pub(super) fn parse(body: &str, keys: &mut Keys, secured: bool) -> Result<Self, TargetError> {
        let tls = tls_files(keys, secured);
        let severity = keys.take_choice("severity", &AlarmSeverity::WORDS);
        let quiet = QuietHours::from_keys(keys);
        let secret_file = keys.take_text("secret_file").map(PathBuf::from);
        let body = body.strip_prefix("//").unwrap_or(body);
        let (host, path) = body.split_once('/').unwrap_or((body, ""));
        let at = parse_endpoint(host, Some(if secured { 443 } else { 80 })).map_err(TargetError::Host)?;
        let path = format!("/{path}");
        if path.parse::<hyper::Uri>().is_err() {
            return Err(TargetError::Path { path });
        }
        let secret_file = secret_file.ok_or(TargetError::NoSecret)?;
        Ok(Self { at, path, tls, secret_file, severity, quiet })
    }

    /// What is wrong with the files that the address names, each with what to do.
    #[must_use]
    pub fn find_file_problems(&self) -> Vec<(String, String)> {
        let tls = self.tls.as_ref().and_then(|files| files.build_config().err());
        let secret = self.read_secret().err();
        let secret = secret.map(|error| (error.as_parts().0.to_owned(), error.as_parts().1.to_owned()));
        tls.map(|error| (error.what, error.next)).into_iter().chain(secret).collect()
    }

    fn read_secret(&self) -> Result<Vec<u8>, SinkError> {
        let file = self.secret_file.display();
        let text = std::fs::read_to_string(&self.secret_file).map_err(|error| {
            let next = "make it readable for the gateway's user, or write another path";
            SinkError::failed_line(format!("the secret file {file} cannot be read: {error}"), next)
        })?;
        let secret = text.lines().next().unwrap_or_default().trim();
        if secret.len() < SECRET_BYTES_MIN {
            let what =
                format!("the secret in {file} has {} bytes; at least {SECRET_BYTES_MIN} are needed", secret.len());
            return Err(SinkError::failed_line(what, "write a longer one, for example with `openssl rand -hex 32`"));
        }
        Ok(secret.as_bytes().to_vec())
    }

    fn is_wanted(&self, item: &Item) -> bool {
        let Content::Record(record) = &item.content else { return false };
        matches!(&**record, Record::Alarm(alarm) if AlarmSeverity::from_word(&alarm.severity) >= self.severity)
    }
}

pub(super) struct WebhookSink {
    target: WebhookTarget,
    outbox: Outbox,
    secret: Vec<u8>,
    connection: Option<HttpConnection>,
    /// Failures since the last alarm that arrived.
    failures: u32,
    /// Numbers of alarms that have arrived although their batch has not.
    confirmed: BTreeSet<u64>,
}

impl WebhookSink {
    pub(super) fn new(target: WebhookTarget, outbox: &Outbox) -> Self {
        let (connection, secret, confirmed) = (None, Vec::new(), BTreeSet::new());
        Self { target, outbox: outbox.clone(), secret, connection, failures: 0, confirmed }
    }

    async fn open_connection(&mut self) -> Result<(), SinkError> {
        self.connection = None;
        // A receiver that can be reached and takes nothing is left alone for a while.
        let pause = match self.failures {
            0 => Duration::ZERO,
            failures => PAUSE_FIRST.saturating_mul(1 << failures.min(10)).min(PAUSE_MAX),
        };
        tokio::time::sleep(pause).await;
        self.secret = self.target.read_secret()?;
        self.connection = Some(HttpConnection::open_connection(&self.target.at, self.target.tls.as_ref()).await?);
        Ok(())
    }

    async fn send_alarms(&mut self, batch: Batch<'_>) -> Result<(), SinkError> {
        for item in batch.items {
            if !self.target.is_wanted(item) || self.confirmed.contains(&item.sequence) {
                continue;
            }
            let sent = self.send_alarm(item, batch.historical).await;
            self.failures = if sent.is_ok() { 0 } else { self.failures.saturating_add(1) };
            sent?;
            self.confirmed.insert(item.sequence);
            while self.confirmed.len() > CONFIRMED_MAX {
                self.confirmed.pop_first();
            }
        }
        if let (Some(first), Some(last)) = (batch.items.first(), batch.items.last()) {
            self.confirmed.retain(|sequence| !(first.sequence..=last.sequence).contains(sequence));
        }
        Ok(())
    }

    /// An idle connection may have been closed by the receiver meanwhile: then a new one is opened.
    async fn send_alarm(&mut self, item: &Item, historical: bool) -> Result<(), SinkError> {
        let body = build_document(&self.outbox, item, historical).to_string().into_bytes();
        let key = format_message_id(&self.outbox.box_id(), item);
        let post = Post::new(&self.target.path, &self.target.at, body, &key, &self.secret);
        let mut idle = self.connection.take();
        let stands = match &mut idle {
            Some(connection) => connection.is_ready().await,
            None => false,
        };
        let mut connection = match idle.filter(|_| stands) {
            Some(connection) => connection,
            None => HttpConnection::open_connection(&self.target.at, self.target.tls.as_ref()).await?,
        };
        let status = connection.send_post(post, &self.target.at).await?;
        self.connection = Some(connection);
        judge_status(status, item.sequence, &self.target)
    }
}

/// What the receiver's answer means for the alarm.
fn judge_status(status: u16, sequence: u64, target: &WebhookTarget) -> Result<(), SinkError> {
    let (at, path) = (format_place(&target.at), &target.path);
    match status {
        200..=299 => Ok(()),
        // It has read the alarm and will never take it; anything else may be put right at the receiver.
        400 | 413 | 415 | 422 => Err(SinkError::Item {
            sequence,
            what: format!("{at}{path} answers {status} to it"),
            next: "look at the log of the receiver: it does not understand the document, or takes none of its size"
                .to_owned(),
        }),
        401 | 403 => Err(SinkError::failed_line(
            format!("{at}{path} answers {status}"),
            "compare the secret of secret_file with that of the receiver",
        )),
        404 | 405 | 410 => Err(SinkError::failed_line(
            format!("{at}{path} answers {status}"),
            "compare the path of the address with that of the receiver",
        )),
        _ => Err(SinkError::failed_line(format!("{at}{path} answers {status}"), "look at the log of the receiver")),
    }
}

impl Sink for WebhookSink {
    fn connect(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(self.open_connection())
    }

    fn send_batch<'a>(&'a mut self, batch: Batch<'a>) -> Pending<'a, Result<(), SinkError>> {
        Box::pin(self.send_alarms(batch))
    }

    fn held_until(&self, now_ns: TimeNs) -> Option<TimeNs> {
        self.target.quiet.as_ref()?.end_after(now_ns)
    }

    /// An answer says what becomes of an alarm, and most items are none.
    fn tells_refusals(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SinkAddress;

    #[test]
    fn only_what_the_receiver_has_read_and_refuses_is_left_out() {
        let address: SinkAddress = "webhook://hooks.works:8088/cnc/alarms?secret_file=/etc/hook".parse().expect("one");
        let crate::SinkTarget::Webhook(target) = address.target() else { panic!("a webhook") };
        assert_eq!((target.path.as_str(), target.at.port, target.severity), ("/cnc/alarms", 8088, AlarmSeverity::Info));
        let kind = |status| match judge_status(status, 7, target) {
            Ok(()) => "taken",
            Err(SinkError::Item { sequence, .. }) => {
                assert_eq!(sequence, 7);
                "left out"
            }
            Err(SinkError::Line { .. }) => "again",
        };
        let all = [200, 204, 400, 401, 403, 404, 408, 409, 413, 422, 425, 429, 500, 502, 503, 504, 302];
        let taken: Vec<u16> = all.into_iter().filter(|status| kind(*status) == "taken").collect();
        let left_out: Vec<u16> = all.into_iter().filter(|status| kind(*status) == "left out").collect();
        assert_eq!((taken, left_out), (vec![200, 204], vec![400, 413, 422]));
    }

    #[test]
    fn an_address_without_a_secret_is_refused() {
        for (address, says) in [
            ("webhook://hooks.works/alarms", "secret_file"),
            ("webhook://hooks.works/alarms?secret_file=/etc/s&severity=high", "critical"),
            ("webhook://hooks.works/alarms?secret_file=/etc/s&quiet=22-6", "22:00-06:00"),
            ("webhook://hooks.works/a b?secret_file=/etc/s", "no path"),
            ("webhook://hooks.works/alarms?secret_file=/etc/s&ca=/etc/ca.pem", "unknown key ca"),
        ] {
            let error = address.parse::<SinkAddress>().expect_err("refused").to_string();
            assert!(error.contains(says), "{address}: {error}");
        }
    }
}
