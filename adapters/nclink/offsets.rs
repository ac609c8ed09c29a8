//! The registers of a device behind a broker, for shifts of axes.

use super::connection::Link;
use super::decode::{ChannelWord, status_word};
use super::lenient_json::parse_integer;
use super::mailbox::ControllerRegister;
use super::message::{NcLinkAnswer, RequestedItem};
use super::offset_mailbox::RegisterAccess;
use super::registers::{RegisterLine, build_register_path};
use adapter_core::driver::SourceError;
use adapter_core::words::execution;

/// Where it is said whether a program runs.
const CHANNEL_WORDS: &str = "CONTROLLER/VARIABLE@REG_F";
const STATUS: &str = "STATUS";

pub(super) struct NcLinkRegisters {
    line: RegisterLine,
    /// Index of the channel's first F word.
    f_channel: u32,
}

impl NcLinkRegisters {
    pub(super) fn new(link: Link, f_channel: u32) -> Self {
        Self { line: RegisterLine::new(link), f_channel }
    }
}

impl RegisterAccess for NcLinkRegisters {
    fn name(&self) -> &str {
        self.line.name()
    }

    fn read_registers(
        &mut self,
        first: ControllerRegister,
        count: u32,
    ) -> Result<(Vec<i64>, Option<bool>), SourceError> {
        let indexes: Vec<u32> = (first.index..first.index + count).collect();
        let state = match self.line.check_item(CHANNEL_WORDS) {
            Ok(()) => RequestedItem::with_elements(CHANNEL_WORDS, &[self.f_channel]),
            Err(SourceError::Refused { .. }) => RequestedItem::from_id(STATUS),
            Err(error) => return Err(error),
        };
        let by_word = state.id == CHANNEL_WORDS;
        let answers =
            self.line.read(vec![RequestedItem::with_elements(&build_register_path(first), &indexes), state])?;
        let numbers = match answers.first() {
            Some(Some(Ok(values))) => values.iter().filter_map(parse_integer).collect(),
            _ => Vec::new(),
        };
        Ok((numbers, answers.get(1).and_then(|answer| at_rest(answer.as_ref(), by_word))))
    }

    fn write(&mut self, words: &[(ControllerRegister, i64)]) -> Result<(), SourceError> {
        self.line.write(words)
    }
}

fn at_rest(answer: Option<&NcLinkAnswer>, by_word: bool) -> Option<bool> {
    let value = answer?.as_ref().ok()?.first()?;
    if by_word {
        return parse_integer(value).map(|word| ChannelWord(word).at_rest());
    }
    status_word(value).map(|word| word == execution::READY)
}
