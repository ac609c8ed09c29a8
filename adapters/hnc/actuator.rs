//! The feed override through four registers that the ladder reads, and the override in force read back.

use super::decode::extract_number;
use super::item::{channel, define_whole_item};
use super::line::HncLine;
use adapter_core::clock::Clock;
use adapter_core::driver::{Actuator, LadderRequest, SourceError};
use adapter_core::override_pct::OverridePct;
use nclink::mailbox::{ControllerRegister, Mailbox, MailboxRequest};

/// Posts letters for the ladder; see [`mailbox`](nclink::mailbox).
pub struct HncActuator {
    line: HncLine,
    mailbox: Mailbox,
    last_request: MailboxRequest,
}

impl HncActuator {
    /// A mailbox that begins at this register.
    #[must_use]
    pub fn new(line: HncLine, first: ControllerRegister) -> Self {
        Self { line, mailbox: Mailbox::new(first), last_request: MailboxRequest::Release }
    }
}

impl Actuator for HncActuator {
    fn name(&self) -> &str {
        self.line.name()
    }

    fn write_feed_override(&mut self, _: &dyn Clock, wanted: OverridePct) -> Result<(), SourceError> {
        self.last_request = MailboxRequest::Override(wanted);
        self.line.write(&self.mailbox.build_letter(self.last_request, None))
    }

    fn release_override(&mut self, _: &dyn Clock) -> Result<(), SourceError> {
        self.last_request = MailboxRequest::Release;
        self.line.write(&self.mailbox.build_letter(self.last_request, None))
    }

    fn ask_ladder(&mut self, _: &dyn Clock, request: LadderRequest) -> Result<(), SourceError> {
        self.line.write(&self.mailbox.build_letter(self.last_request, Some(request)))
    }

    fn read_feed_override(&mut self, _: &dyn Clock) -> Result<OverridePct, SourceError> {
        let found = extract_number(&self.line.read(define_whole_item(channel::FEED_OVERRIDE))?);
        nclink::mailbox::in_force(self.line.name(), found)
    }
}
