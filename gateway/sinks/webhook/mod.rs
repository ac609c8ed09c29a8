//! `webhook://HOST:PORT/PATH` and `webhooks://` (TLS): each alarm as one POST of its document.
//!
//! The header `Idempotency-Key` is `<box>-<epoch>-<sequence>`: what a receiver gets twice, because its answer was lost or the box was
//! killed, has the same key. `X-Signature-256` is `sha256=` and the HMAC-SHA256 (RFC 2104) of the body under the secret of
//! `secret_file`, as hexadecimal digits. An alarm counts as delivered when the receiver answers 200 to 299. Which alarms, and when:
//! [`alarms`](super::alarms).

mod client;

use super::alarms::{AlarmChoice, AlarmLine, AlarmMessage, AlarmSink, reuse_connection};
use super::mqtt::build_document;
use super::nats::format_message_id;
use super::target_error::TargetError;
use super::{Pending, SinkError};
use adapter_core::address::{Endpoint, Keys, parse_endpoint};
pub(crate) use client::format_place;
use client::{HttpConnection, Post};
use device_line::tls::TlsFiles;
use gateway_history::Outbox;
use std::path::PathBuf;

/// A shorter secret is guessed from one message and its signature.
const SECRET_BYTES_MIN: usize = 16;
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
    /// Which alarms, and when.
    pub choice: AlarmChoice,
}

impl WebhookTarget {
    pub(super) fn parse(body: &str, keys: &mut Keys, secured: bool) -> Result<Self, TargetError> {
        let tls = TlsFiles::from_keys(keys, secured);
        let choice = AlarmChoice::from_keys(keys);
        let secret_file = keys.take_text("secret_file").map(PathBuf::from);
        let body = body.strip_prefix("//").unwrap_or(body);
        let (host, path) = body.split_once('/').unwrap_or((body, ""));
        let at = parse_endpoint(host, Some(if secured { 443 } else { 80 })).map_err(TargetError::Host)?;
        let path = format!("/{path}");
        if path.parse::<hyper::Uri>().is_err() {
            return Err(TargetError::Path { path });
        }
        let secret_file = secret_file.ok_or(TargetError::NoSecret)?;
        Ok(Self { at, path, tls, secret_file, choice })
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
}

/// The sink of an address.
pub(super) fn open_webhook(target: WebhookTarget, outbox: &Outbox) -> AlarmSink<WebhookLine> {
    let choice = target.choice.clone();
    AlarmSink::new(choice, WebhookLine { target, outbox: outbox.clone(), secret: Vec::new(), connection: None })
}

pub(super) struct WebhookLine {
    target: WebhookTarget,
    outbox: Outbox,
    secret: Vec<u8>,
    connection: Option<HttpConnection>,
}

impl WebhookLine {
    async fn open_connection(&mut self) -> Result<(), SinkError> {
        self.connection = None;
        self.secret = self.target.read_secret()?;
        self.connection = Some(HttpConnection::open_connection(&self.target.at, self.target.tls.as_ref()).await?);
        Ok(())
    }

    /// An idle connection may have been closed by the receiver meanwhile: then a new one is opened.
    async fn post_alarm(&mut self, message: AlarmMessage<'_>) -> Result<(), SinkError> {
        let AlarmMessage { item, historical, .. } = message;
        let body = build_document(&self.outbox, item, historical).to_string().into_bytes();
        let key = format_message_id(&self.outbox.box_id(), item);
        let post = Post::new(&self.target.path, &self.target.at, body, &key, &self.secret);
        let mut connection = match reuse_connection(self.connection.take()).await {
            Some(connection) => connection,
            None => HttpConnection::open_connection(&self.target.at, self.target.tls.as_ref()).await?,
        };
        let status = connection.send_post(post, &self.target.at).await?;
        self.connection = Some(connection);
        judge_status(status, item.sequence, &self.target)
    }
}

impl AlarmLine for WebhookLine {
    fn open_line(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(self.open_connection())
    }

    fn send_alarm<'a>(&'a mut self, message: AlarmMessage<'a>) -> Pending<'a, Result<(), SinkError>> {
        Box::pin(self.post_alarm(message))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SinkAddress;
    use crate::alarms::AlarmSeverity;

    #[test]
    fn only_what_the_receiver_has_read_and_refuses_is_left_out() {
        let address: SinkAddress = "webhook://hooks.works:8088/cnc/alarms?secret_file=/etc/hook".parse().expect("one");
        let crate::SinkTarget::Webhook(target) = address.target() else { panic!("a webhook") };
        assert_eq!((target.path.as_str(), target.at.port), ("/cnc/alarms", 8088));
        assert_eq!(target.choice, AlarmChoice { severity: AlarmSeverity::Info, quiet: None, pass: None });
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
            ("webhook://hooks.works/alarms?secret_file=/etc/s&pass=critical", "only with quiet="),
            ("webhook://hooks.works/a b?secret_file=/etc/s", "no path"),
            ("webhook://hooks.works/alarms?secret_file=/etc/s&ca=/etc/ca.pem", "unknown key ca"),
        ] {
            let error = address.parse::<SinkAddress>().expect_err("refused").to_string();
            assert!(error.contains(says), "{address}: {error}");
        }
    }
}
