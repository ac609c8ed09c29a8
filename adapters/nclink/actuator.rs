//! The feed override through four registers that the ladder reads, and the override in force read back.

use super::connection::Link;
use super::mailbox::{ControllerRegister, Mailbox, MailboxRequest, in_force};
use super::message::{RequestedItem, first_number};
use super::registers::RegisterLine;
use adapter_core::clock::Clock;
use adapter_core::driver::{Actuator, LadderRequest, SourceError};
use adapter_core::override_pct::OverridePct;
use adapter_core::reading::Absence;

/// The override in force.
const OVERRIDE: &str = "FEED_OVERRIDE";

/// Posts letters for the ladder; see [`mailbox`](super::mailbox).
pub struct NcLinkActuator {
    line: RegisterLine,
    mailbox: Mailbox,
    last_request: MailboxRequest,
}

impl NcLinkActuator {
    /// A mailbox that begins at this register.
    #[must_use]
    pub fn new(link: Link, first: ControllerRegister) -> Self {
        Self { line: RegisterLine::new(link), mailbox: Mailbox::new(first), last_request: MailboxRequest::Release }
    }

    /// The last letter once more, with or without a request. What could not be read back is not written.
    fn write_letter(&mut self, request: Option<LadderRequest>) -> Result<(), SourceError> {
        self.line.check_item(OVERRIDE)?;
        let words = self.mailbox.build_letter(self.last_request, request);
        self.line.write(&words)
    }
}

impl Actuator for NcLinkActuator {
    fn name(&self) -> &str {
        self.line.name()
    }

    fn write_feed_override(&mut self, _: &dyn Clock, wanted: OverridePct) -> Result<(), SourceError> {
        self.last_request = MailboxRequest::Override(wanted);
        self.write_letter(None)
    }

    fn release_override(&mut self, _: &dyn Clock) -> Result<(), SourceError> {
        self.last_request = MailboxRequest::Release;
        self.write_letter(None)
    }

    fn ask_ladder(&mut self, _: &dyn Clock, request: LadderRequest) -> Result<(), SourceError> {
        self.write_letter(Some(request))
    }

    fn read_feed_override(&mut self, _: &dyn Clock) -> Result<OverridePct, SourceError> {
        let answers = self.line.read(vec![RequestedItem::from_id(OVERRIDE)])?;
        let found = match answers.first() {
            Some(Some(Ok(values))) => first_number(values).ok_or(Absence::OutOfRange),
            _ => Err(Absence::Refused),
        };
        in_force(self.line.name(), found)
    }
}
