//! Calls of the library whose answers are texts and records: the block that runs, messages, G codes, remembered alarms and
//! tool life.

use super::child::FocasSession;
use super::structure::{Bytes, check_code, fill_structure};
use crate::answer::{Alarm, FocasAnswer, FocasItemError, FocasItemResult, OperatorMessage, PastAlarm};
use crate::item::FocasItem;
use adapter_core::integer::{clamp_count, convert_bounded};
use adapter_core::text::TextEncoding;

/// `ODBGCD`: group, flag, text of eight bytes.
const G_CODE_LEN: usize = 12;
/// Most groups of G codes.
const G_CODES_MAX: i16 = 40;
/// `OPMSG3`: number, type, length, text of 256 bytes.
const MESSAGE_LEN: usize = 262;
/// Head and record of `ODBAHIS`, as the library fills it in.
const HISTORY_HEAD_LEN: usize = 8;
const HISTORY_LEN: usize = 48;
/// At most so many remembered alarms at a time.
const HISTORY_MAX: u16 = 10;

impl FocasSession {
    pub(super) fn read_text(&self, item: FocasItem) -> FocasItemResult {
        let (f, h) = (&self.functions, self.handle);
        match item {
            FocasItem::ExecutedText(most) => {
                let (mut length, mut block) = (most.clamp(1, 1000), 0);
                let bytes = fill_structure(1024, |out| f.cnc_rdexecprog(h, &mut length, &mut block, out))?;
                Ok(FocasAnswer::Named {
                    number: i32::from(block),
                    name: bytes.text_in(0, usize::from(length), self.encoding),
                })
            }
            FocasItem::Messages(most) => {
                let mut found = convert_bounded(most.clamp(1, 5), i16::MAX);
                let bytes = fill_structure(MESSAGE_LEN * 5, |out| f.cnc_rdopmsg3(h, -1, &mut found, out))?;
                let count = clamp_count(found, 5);
                Ok(FocasAnswer::Messages(
                    (0..count).map(|at| decode_message(&bytes, at * MESSAGE_LEN, self.encoding)).collect(),
                ))
            }
            FocasItem::GCodes => {
                let mut found = G_CODES_MAX;
                let room = G_CODE_LEN * usize::from(G_CODES_MAX.unsigned_abs());
                let bytes = fill_structure(room, |out| f.cnc_rdgcode(h, -1, 0, &mut found, out))?;
                let count = clamp_count(found.min(G_CODES_MAX), usize::MAX);
                Ok(FocasAnswer::Names((0..count).map(|at| bytes.read_text(at * G_CODE_LEN + 4, 8)).collect()))
            }
            _ => Err(FocasItemError::NotOffered),
        }
    }

    pub(super) fn read_history(&self, item: FocasItem) -> FocasItemResult {
        let (f, h) = (&self.functions, self.handle);
        match item {
            FocasItem::HistoryCount => {
                let mut count = 0;
                check_code(f.cnc_rdalmhisno(h, &mut count)).map(|()| FocasAnswer::Whole(i32::from(count)))
            }
            FocasItem::AlarmHistory(first, last) => {
                let last = last.min(first.saturating_add(HISTORY_MAX - 1));
                let count = usize::from(last.saturating_sub(first)) + 1;
                let length = HISTORY_HEAD_LEN + HISTORY_LEN * count;
                let asked = convert_bounded(length, u16::MAX);
                let bytes = fill_structure(length, |out| f.cnc_rdalmhistry(h, first, last, asked, out))?;
                let record = |at: usize| past_alarm(&bytes, HISTORY_HEAD_LEN + at * HISTORY_LEN, self.encoding);
                Ok(FocasAnswer::History((0..count).map(record).collect()))
            }
            _ => Err(FocasItemError::NotOffered),
        }
    }

    pub(super) fn tool_life(&self, item: FocasItem) -> FocasItemResult {
        let (f, h) = (&self.functions, self.handle);
        match item {
            FocasItem::ToolGroup => {
                fill_structure(24, |out| f.cnc_rdtlusegrp(h, out)).map(|bytes| FocasAnswer::Whole(bytes.read_i32(4)))
            }
            FocasItem::ToolLife(group) => {
                let group = i16::try_from(group).map_err(|_| FocasItemError::NotOffered)?;
                let life = fill_structure(8, |out| f.cnc_rdlife(h, group, out))?.read_i32(4);
                let count = fill_structure(8, |out| f.cnc_rdcount(h, group, out))?.read_i32(4);
                let tools = fill_structure(8, |out| f.cnc_rdntool(h, group, out))?.read_i32(4);
                Ok(FocasAnswer::Life { tools, life, count })
            }
            _ => Err(FocasItemError::NotOffered),
        }
    }
}

fn decode_message(bytes: &Bytes, at: usize, encoding: TextEncoding) -> OperatorMessage {
    let length = clamp_count(bytes.read_i16(at + 4), 256);
    let (number, kind) = (i32::from(bytes.read_i16(at)), i32::from(bytes.read_i16(at + 2)));
    OperatorMessage { number, kind, text: bytes.text_in(at + 6, length, encoding) }
}

fn past_alarm(bytes: &Bytes, at: usize, encoding: TextEncoding) -> PastAlarm {
    let byte = |offset: usize| i16::from(bytes.read_array::<1>(at + offset)[0]);
    let length = clamp_count(bytes.read_i16(at + 12), 32);
    let (kind, number) = (i32::from(bytes.read_i16(at)), i32::from(bytes.read_i16(at + 2)));
    let alarm = Alarm { number, kind, axis: i32::from(byte(4)), text: bytes.text_in(at + 14, length, encoding) };
    PastAlarm { alarm, at: [byte(5), byte(6), byte(7), byte(8), byte(9), byte(10)] }
}
