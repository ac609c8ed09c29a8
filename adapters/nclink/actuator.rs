//! The feed override through four registers that the ladder reads, and the override in force read back.
//!
//! It has a connection of its own: the source may be waiting for an answer while the gate has something to write.

use super::connection::{Connection, Link};
use super::mailbox::{Letter, Mailbox, Register, in_force};
use super::message::{Ask, first_number};
use super::model::Model;
use crate::clock::Clock;
use crate::driver::{Actuator, LadderRequest, SourceError};
use crate::reading::Absence;
use crate::units::OverridePct;

/// Posts letters for the ladder; see [`mailbox`](super::mailbox).
pub struct NcLinkActuator {
    link: Link,
    first: Register,
    mailbox: Mailbox,
    last: Letter,
    session: Option<Session>,
}

struct Session {
    connection: Connection,
    /// How the device calls the list of registers, and the override in force.
    registers: String,
    override_pct: String,
}

impl NcLinkActuator {
    /// A mailbox that begins at this register.
    #[must_use]
    pub fn new(link: Link, first: Register) -> Self {
        Self { link, first, mailbox: Mailbox::new(first), last: Letter::Release, session: None }
    }

    /// Does something with a connection; a broken one is made anew the next time.
    fn with<T>(&mut self, work: impl FnOnce(&mut Session, &Link) -> Result<T, SourceError>) -> Result<T, SourceError> {
        let mut session = match self.session.take() {
            Some(session) => session,
            None => self.connect()?,
        };
        let outcome = work(&mut session, &self.link);
        self.session = (!matches!(outcome, Err(SourceError::Line { .. }))).then_some(session);
        outcome
    }

    fn connect(&self) -> Result<Session, SourceError> {
        let mut connection = Connection::open(&self.link, false)?;
        let model = connection.probe()?;
        let registers = self.named(&model, &format!("CONTROLLER/VARIABLE@REG_{}", self.first.kind), true)?;
        let override_pct = self.named(&model, "FEED_OVERRIDE", false)?;
        Ok(Session { connection, registers, override_pct })
    }

    /// The last letter once more, with or without a request.
    fn post(&mut self, request: Option<LadderRequest>) -> Result<(), SourceError> {
        let words = self.mailbox.post(self.last, request);
        self.with(|session, link| {
            let asks = words.map(|(at, value)| Ask::write(&session.registers, at.index, value));
            let answers = session.connection.set(&asks)?;
            for ((at, _), answer) in words.iter().zip(answers) {
                let no = match answer {
                    Some(Ok(_)) => continue,
                    Some(Err(reason)) => reason,
                    None => "it said nothing of it".to_owned(),
                };
                return Err(refused(link, &format!("writing {at}"), no));
            }
            Ok(())
        })
    }

    /// The name by which the device knows an item.
    fn named(&self, model: &Model, path: &str, written: bool) -> Result<String, SourceError> {
        let item = model.find(path);
        let item = item.ok_or_else(|| refused(&self.link, path, "the device does not have it".to_owned()))?;
        if written && !item.settable {
            return Err(refused(&self.link, path, "its model says that it may not be written".to_owned()));
        }
        Ok(if model.names_by_path() { format!("/{}", item.path) } else { item.id.clone() })
    }
}

fn refused(link: &Link, request: &str, what: String) -> SourceError {
    SourceError::Refused {
        source_name: link.name.clone(),
        request: request.to_owned(),
        what,
        next: "Name another register with mailbox= in the address, or let the adapter of the device allow it."
            .to_owned(),
    }
}

impl Actuator for NcLinkActuator {
    fn name(&self) -> &str {
        &self.link.name
    }

    fn write_feed_override(&mut self, _: &dyn Clock, wanted: OverridePct) -> Result<(), SourceError> {
        self.last = Letter::Override(wanted);
        self.post(None)
    }

    fn release(&mut self, _: &dyn Clock) -> Result<(), SourceError> {
        self.last = Letter::Release;
        self.post(None)
    }

    fn ask(&mut self, _: &dyn Clock, request: LadderRequest) -> Result<(), SourceError> {
        self.post(Some(request))
    }

    fn read_feed_override(&mut self, _: &dyn Clock) -> Result<OverridePct, SourceError> {
        self.with(|session, link| {
            let answers = session.connection.query(&[Ask::value(&session.override_pct)])?;
            let found = match answers.first() {
                Some(Some(Ok(values))) => first_number(values).ok_or(Absence::OutOfRange),
                _ => Err(Absence::Refused),
            };
            in_force(&link.name, found)
        })
    }
}
