//! One SMTP connection (RFC 5321), by `lettre`.

use super::{LineSecurity, MailTarget};
use crate::SinkError;
use crate::alarms::KeptConnection;
use crate::webhook::format_place;
use device_line::tls::{TlsError, TlsFiles};
use lettre::Address;
use lettre::transport::smtp::Error;
use lettre::transport::smtp::authentication::{Credentials, DEFAULT_MECHANISMS};
use lettre::transport::smtp::client::{
    AsyncSmtpConnection, Certificate, CertificateStore, Identity, TlsParameters, TlsParametersBuilder,
};
use lettre::transport::smtp::commands::{Data, Mail, Rcpt, Rset};
use lettre::transport::smtp::extension::ClientId;
use std::time::{Duration, Instant};
use tokio::time::timeout;

/// Connecting and signing in may take this long, and so may each mail: a server that looks for junk takes its time.
const DEADLINE: Duration = Duration::from_secs(25);
/// A connection that has been idle for longer than this is asked whether it still stands.
const FRESH: Duration = Duration::from_secs(1);

/// A connection that stands.
pub(super) struct SmtpConnection {
    line: AsyncSmtpConnection,
    last_use: Instant,
}

/// Recipients that the server did not take, each with what it said.
pub(super) type RefusedRecipients = Vec<String>;

impl KeptConnection for SmtpConnection {
    /// A server closes a connection that is idle for minutes.
    async fn is_ready(&mut self) -> bool {
        self.last_use.elapsed() < FRESH || matches!(timeout(DEADLINE, self.line.test_connected()).await, Ok(true))
    }
}

impl SmtpConnection {
    pub(super) async fn open(target: &MailTarget) -> Result<Self, SinkError> {
        let opened = timeout(DEADLINE, Self::open_now(target)).await;
        opened.unwrap_or_else(|_| Err(broken(target, &format!("no greeting within {} s", DEADLINE.as_secs()))))
    }

    async fn open_now(target: &MailTarget) -> Result<Self, SinkError> {
        let parameters = target.tls.as_ref().map(|files| build_parameters(target, files)).transpose()?;
        let (implicit, starttls) = match target.security {
            LineSecurity::StartTls => (None, parameters),
            LineSecurity::Plain | LineSecurity::Tls => (parameters, None),
        };
        let (at, name) = ((target.at.host.as_str(), target.at.port), ClientId::default());
        let line = AsyncSmtpConnection::connect_tokio1(at, Some(DEADLINE), &name, implicit, None).await;
        let mut line = line.map_err(|error| explain(target, &error))?;
        if let Some(parameters) = starttls {
            if !line.can_starttls() {
                let next = "write the port of its TLS listener and leave out starttls=yes, or switch STARTTLS on there";
                return Err(SinkError::failed_line(format!("{} does not offer STARTTLS", place(target)), next));
            }
            line.starttls(parameters, &name).await.map_err(|error| explain(target, &error))?;
        }
        let mut connection = Self { line, last_use: Instant::now() };
        connection.sign_in(target).await?;
        Ok(connection)
    }

    async fn sign_in(&mut self, target: &MailTarget) -> Result<(), SinkError> {
        let Some((user, password)) = target.read_login()? else { return Ok(()) };
        let signed = self.line.auth(DEFAULT_MECHANISMS, &Credentials::new(user, password)).await;
        signed.map(drop).map_err(|error| {
            let next = "compare user= and password_file= with the mail server's, and what it lets this user do";
            SinkError::failed_line(format!("{} does not let the box in: {error}", place(target)), next)
        })
    }

    /// When it was used last.
    pub(super) fn last_use(&self) -> Instant {
        self.last_use
    }

    /// Sends the mail to every recipient that the server takes. It has the mail when this returns.
    pub(super) async fn send(
        &mut self,
        target: &MailTarget,
        sequence: u64,
        mail: &[u8],
    ) -> Result<RefusedRecipients, SinkError> {
        let exchange = async {
            let refused = self.name_recipients(target).await?;
            self.line.command(Data).await.map_err(|error| explain(target, &error))?;
            self.line.command(frame_mail(mail)).await.map_err(|error| judge_refusal(target, sequence, &error))?;
            Ok(refused)
        };
        let sent = timeout(DEADLINE, exchange).await;
        self.last_use = Instant::now();
        sent.unwrap_or_else(|_| Err(broken(target, &format!("no answer within {} s", DEADLINE.as_secs()))))
    }

    /// Asks whether the server would take a mail, and takes the question back.
    pub(super) async fn probe(&mut self, target: &MailTarget) -> Result<(), SinkError> {
        let refused = self.name_recipients(target).await?;
        self.line.command(Rset).await.map_err(|error| explain(target, &error))?;
        describe_refused(&refused).map_or(Ok(()), Err)
    }

    async fn name_recipients(&mut self, target: &MailTarget) -> Result<RefusedRecipients, SinkError> {
        let from: Address = target.from.email.clone();
        self.line.command(Mail::new(Some(from), Vec::new())).await.map_err(|error| explain(target, &error))?;
        let mut refused = RefusedRecipients::new();
        for to in &target.to {
            match self.line.command(Rcpt::new(to.email.clone(), Vec::new())).await {
                Ok(_taken) => {}
                Err(error) if error.is_permanent() => refused.push(format!("{}: {error}", to.email)),
                Err(error) => return Err(explain(target, &error)),
            }
        }
        match refused.len() == target.to.len() {
            true => Err(describe_refused(&refused).unwrap_or_else(|| broken(target, "it takes no recipient"))),
            false => Ok(refused),
        }
    }

    /// Ends the dialogue; a server that does not answer is left.
    pub(super) async fn quit(mut self) {
        let _gone = timeout(Duration::from_secs(1), self.line.quit()).await;
    }
}

/// A mail with the mark of its end (RFC 5321, 4.5.2), as one piece: of two, the second one waits until the server has confirmed the first,
/// which it does after 40 ms.
fn frame_mail(mail: &[u8]) -> String {
    let text = String::from_utf8_lossy(mail);
    let text = text.strip_suffix("\r\n").unwrap_or(&text);
    let dot = if text.starts_with('.') { "." } else { "" };
    format!("{dot}{}\r\n.\r\n", text.replace("\r\n.", "\r\n.."))
}

/// What to tell of recipients that the server does not take.
pub(super) fn describe_refused(refused: &[String]) -> Option<SinkError> {
    let what = format!("the mail server does not take {}", refused.join("; "));
    (!refused.is_empty()).then(|| SinkError::failed_line(what, "put the address right in to=, or at the mail server"))
}

/// Trusted is what every other sink trusts.
fn build_parameters(target: &MailTarget, files: &TlsFiles) -> Result<TlsParameters, SinkError> {
    let told = |error: TlsError| SinkError::failed_line(error.what, error.next);
    files.build_config().map_err(told)?;
    let mut builder = TlsParametersBuilder::new(target.at.host.clone()).certificate_store(CertificateStore::None);
    for root in files.load_trusted().map_err(told)? {
        let root = Certificate::from_der(root.to_vec()).map_err(|error| explain(target, &error))?;
        builder = builder.add_root_certificate(root);
    }
    if let (Some(certificate), Some(key)) = (&files.certificate, &files.key) {
        let read = |file| std::fs::read(file).map_err(|error| broken(target, &error.to_string()));
        let identity = Identity::from_pem(&read(certificate)?, &read(key)?).map_err(|error| explain(target, &error))?;
        builder = builder.identify_with(identity);
    }
    builder.build().map_err(|error| explain(target, &error))
}

/// A server that has read the mail and will never take it: too large (552, or 5.3.4), or not to be read (5.6.x). Everything else may be put
/// right at the server, and the alarm waits.
fn judge_refusal(target: &MailTarget, sequence: u64, error: &Error) -> SinkError {
    let text = error.to_string();
    let of_the_mail = error.status().is_some_and(|code| code.to_string() == "552")
        || ["5.3.4", "5.6."].iter().any(|code| text.contains(code));
    if !(error.is_permanent() && of_the_mail) {
        return explain(target, error);
    }
    SinkError::Item {
        sequence,
        what: format!("{} does not take its mail: {error}", place(target)),
        next: "look at the log of the mail server".to_owned(),
    }
}

fn explain(target: &MailTarget, error: &Error) -> SinkError {
    let mut cause = std::error::Error::source(error);
    while let Some(inner) = cause {
        let tls = inner.downcast_ref::<std::io::Error>().and_then(|io| TlsError::from_io_error(io, &target.at.host));
        if let Some(TlsError { what, next }) = tls {
            return SinkError::failed_line(what, next);
        }
        cause = inner.source();
    }
    broken(target, &error.to_string())
}

fn broken(target: &MailTarget, what: &str) -> SinkError {
    let next = "look whether the mail server runs, can be reached from here, and takes mail of this sender";
    SinkError::failed_line(format!("{}: {what}", place(target)), next)
}

fn place(target: &MailTarget) -> String {
    format!("mail server {}", format_place(&target.at))
}

#[cfg(test)]
mod tests {
    use super::frame_mail;
    use proptest::prelude::*;

    /// What a server makes of it: lines up to the single dot, without the dot that was added (RFC 5321, 4.5.2).
    fn read_framed(framed: &str) -> Option<String> {
        let (text, rest) = framed.split_once("\r\n.\r\n")?;
        assert_eq!(rest, "", "nothing comes after the end");
        Some(text.split("\r\n").map(|line| line.strip_prefix('.').unwrap_or(line)).collect::<Vec<_>>().join("\r\n"))
    }

    proptest! {
        #[test]
        fn a_server_reads_the_mail_as_it_was_written(lines in proptest::collection::vec("[.a]{0,4}|[ -~]{0,20}", 1..8)) {
            let mail = lines.join("\r\n");
            prop_assert_eq!(read_framed(&frame_mail(format!("{mail}\r\n").as_bytes())), Some(mail));
        }
    }
}
