//! `smtp://HOST:25` and `smtps://HOST:465` (TLS; with `starttls=yes` on port 587): each alarm as one mail.
//!
//! The `Message-ID` is `<box-epoch-sequence@cnc-gateway>`: what arrives twice, because the answer of the server was lost or the box was
//! killed, has the same. An alarm counts as delivered when the server has taken the mail. Which alarms, and when:
//! [`alarms`](super::alarms). A connection is closed when it has been idle for some seconds.

mod connection;
mod message;

use super::alarms::{AlarmChoice, AlarmLine, AlarmMessage, AlarmSink, reuse_connection};
use super::target_error::TargetError;
use super::{Pending, SinkError};
use adapter_core::address::{Endpoint, Keys, Login, parse_endpoint};
use connection::{RefusedRecipients, SmtpConnection, describe_refused};
use device_line::tls::TlsFiles;
use gateway_base::clock;
use gateway_history::Outbox;
use lettre::message::Mailbox;
use std::time::Duration;

/// So many recipients; more belong into a list of the mail server. RFC 5321 (4.5.3.1.8) has every server take 100.
const RECIPIENTS_MAX: usize = 50;
/// A connection that has been idle for so long is closed.
const IDLE: Duration = Duration::from_secs(5);

/// How the line is secured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineSecurity {
    /// Not at all: a relay on this computer or its own network.
    Plain,
    /// TLS from the first byte on.
    Tls,
    /// TLS after the command STARTTLS; without it nothing is sent.
    StartTls,
}

/// Where mails go, and which alarms when.
#[derive(Debug, Clone, PartialEq)]
pub struct MailTarget {
    /// Host and port of the mail server.
    pub at: Endpoint,
    /// How the line is secured.
    pub security: LineSecurity,
    /// The files of TLS, where the line is secured.
    pub tls: Option<TlsFiles>,
    /// User and password at the mail server, where it asks for them.
    pub login: Login,
    /// The sender, whom the mail server lets send.
    pub from: Mailbox,
    /// The recipients of each mail, at least one.
    pub to: Vec<Mailbox>,
    /// Which alarms, and when.
    pub choice: AlarmChoice,
}

impl MailTarget {
    pub(super) fn parse(body: &str, keys: &mut Keys, secured: bool) -> Result<Self, TargetError> {
        let tls = TlsFiles::from_keys(keys, secured);
        let starttls = secured && keys.take_choice("starttls", &[("no", false), ("yes", true)]);
        let (security, port) = match (secured, starttls) {
            (false, _) => (LineSecurity::Plain, 25),
            (true, false) => (LineSecurity::Tls, 465),
            (true, true) => (LineSecurity::StartTls, 587),
        };
        let (login, choice) = (Login::from_keys(keys), AlarmChoice::from_keys(keys));
        let (from, to) = (keys.take_text("from"), keys.take_text("to"));
        let at = parse_endpoint(body, Some(port)).map_err(TargetError::Host)?;
        let from = parse_mailbox(&from.ok_or(TargetError::NoSender)?)?;
        let to: Vec<Mailbox> =
            to.ok_or(TargetError::NoRecipient)?.split(',').map(parse_mailbox).collect::<Result<_, _>>()?;
        if to.len() > RECIPIENTS_MAX {
            return Err(TargetError::TooManyRecipients { count: to.len(), most: RECIPIENTS_MAX });
        }
        Ok(Self { at, security, tls, login, from, to, choice })
    }

    /// What is wrong with the files that the address names, each with what to do.
    #[must_use]
    pub fn find_file_problems(&self) -> Vec<(String, String)> {
        let tls = self.tls.as_ref().and_then(|files| files.build_config().err());
        let login = self.read_login().err().map(|error| {
            let (what, next) = error.as_parts();
            (what.to_owned(), next.to_owned())
        });
        tls.map(|error| (error.what, error.next)).into_iter().chain(login).collect()
    }

    fn read_login(&self) -> Result<Option<(String, String)>, SinkError> {
        self.login.read().map_err(|(file, error)| {
            let next = "make it readable for the gateway's user, or write another path";
            SinkError::failed_line(format!("the password file {} cannot be read: {error}", file.display()), next)
        })
    }
}

fn parse_mailbox(text: &str) -> Result<Mailbox, TargetError> {
    let parsed: Result<Mailbox, _> = text.trim().parse();
    // What a text of ASCII letters holds is taken by every server.
    let ascii = parsed.ok().filter(|mailbox| mailbox.email.to_string().is_ascii());
    ascii.ok_or_else(|| TargetError::Mailbox { text: text.to_owned() })
}

/// The sink of an address.
pub(super) fn open_mail(target: MailTarget, outbox: &Outbox) -> AlarmSink<MailLine> {
    let choice = target.choice.clone();
    AlarmSink::new(
        choice,
        MailLine { target, outbox: outbox.clone(), connection: None, refused_recipients: RefusedRecipients::new() },
    )
}

pub(super) struct MailLine {
    target: MailTarget,
    outbox: Outbox,
    connection: Option<SmtpConnection>,
    /// Of the last mail.
    refused_recipients: RefusedRecipients,
}

impl MailLine {
    async fn open_connection(&mut self) -> Result<(), SinkError> {
        self.connection = None;
        self.connection = Some(SmtpConnection::open(&self.target).await?);
        Ok(())
    }

    async fn send_mail(&mut self, message: AlarmMessage<'_>) -> Result<(), SinkError> {
        let sequence = message.item.sequence;
        let mail = message::build_mail(&self.target, &self.outbox, message, clock::now_ns());
        let mail = mail.map_err(|error| SinkError::Item {
            sequence,
            what: format!("no mail can be made of it: {error}"),
            next: "read the alarm on the page".to_owned(),
        })?;
        let mut connection = match reuse_connection(self.connection.take()).await {
            Some(connection) => connection,
            None => SmtpConnection::open(&self.target).await?,
        };
        // A connection that failed is not used again: nobody knows what its server waits for.
        self.refused_recipients = connection.send(&self.target, sequence, &mail).await?;
        self.connection = Some(connection);
        Ok(())
    }

    async fn probe_server(&mut self) -> Result<(), SinkError> {
        let mut connection = SmtpConnection::open(&self.target).await?;
        connection.probe(&self.target).await?;
        connection.quit().await;
        Ok(())
    }

    async fn wait_until_idle(&self) {
        match &self.connection {
            Some(connection) => tokio::time::sleep_until((connection.last_use() + IDLE).into()).await,
            None => std::future::pending().await,
        }
    }

    async fn close_connection(&mut self) {
        if let Some(connection) = self.connection.take() {
            connection.quit().await;
        }
    }
}

impl AlarmLine for MailLine {
    fn open_line(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(self.open_connection())
    }

    fn send_alarm<'a>(&'a mut self, message: AlarmMessage<'a>) -> Pending<'a, Result<(), SinkError>> {
        Box::pin(self.send_mail(message))
    }

    fn wait_idle(&mut self) -> Pending<'_, ()> {
        Box::pin(self.wait_until_idle())
    }

    fn close_line(&mut self) -> Pending<'_, ()> {
        Box::pin(self.close_connection())
    }

    fn probe_line(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(self.probe_server())
    }

    fn find_fault(&self) -> Option<SinkError> {
        describe_refused(&self.refused_recipients)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SinkAddress, SinkTarget};

    #[test]
    fn the_address_says_how_the_line_is_secured() {
        for (address, security, port) in [
            ("smtp://relay?from=box@works.example&to=shop@works.example", LineSecurity::Plain, 25),
            ("smtps://mail.works?from=box@works.example&to=shop@works.example", LineSecurity::Tls, 465),
            ("smtps://mail.works?starttls=yes&from=b@works.example&to=s@works.example", LineSecurity::StartTls, 587),
            ("smtps://mail.works:2525?starttls=yes&from=b@a.example&to=s@a.example", LineSecurity::StartTls, 2525),
        ] {
            let parsed: SinkAddress = address.parse().expect(address);
            let SinkTarget::Mail(target) = parsed.target() else { panic!("a mail") };
            assert_eq!((target.security, target.at.port), (security, port), "{address}");
            assert_eq!((target.tls.is_some(), parsed.is_secured()), (port != 25, port != 25), "{address}");
        }
    }

    #[test]
    fn an_address_that_nobody_would_get_is_refused() {
        let many = vec!["a@b.example"; 51].join(",");
        for (address, says) in [
            ("smtp://relay?to=shop@works.example".to_owned(), "write from="),
            ("smtp://relay?from=box@works.example".to_owned(), "write to="),
            ("smtp://relay?from=box@works.example&to=shop".to_owned(), "\"shop\" is no mail address"),
            ("smtp://relay?from=box@works.example&to=a@b.example,".to_owned(), "\"\" is no mail address"),
            ("smtp://relay?from=box@works.example&to=a@b.example%0d%0aRCPT".to_owned(), "no mail address"),
            (format!("smtp://relay?from=box@works.example&to={many}"), "51 recipients"),
            ("smtp://relay?starttls=yes&from=a@b.example&to=a@b.example".to_owned(), "unknown key starttls"),
            ("smtp://me:secret@relay?from=a@b.example&to=a@b.example".to_owned(), "password_file"),
            ("smtps://relay?password_file=/x&from=a@b.example&to=a@b.example".to_owned(), "user="),
        ] {
            let error = address.parse::<SinkAddress>().expect_err("refused").to_string();
            assert!(error.contains(says) && !error.contains("me:secret"), "{address}: {error}");
        }
    }
}
