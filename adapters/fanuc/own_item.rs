//! What the user can have read of a FANUC control: a custom macro variable, a parameter, a diagnosis number, PMC memory or an
//! offset. Written in the configuration as
//!
//! ```text
//! read = "macro 500"                 read = "pmc R100.3"
//! read = "parameter 6711"            read = "pmc D20 word"
//! read = "parameter 1420 axis 2"     read = "tool_offset 1 type 3"
//! read = "diagnosis 301 axis 1"      read = "work_offset 1 axis 3"
//! read = "pmc D100 text 20"
//! ```

use super::answer::FocasAnswer;
use super::item::{Area, FocasItem, PmcWidth, Stretch};
use super::states::OrAbsence;
use adapter_core::own::{OwnChannel, OwnRead};
use adapter_core::reading::{Absence, Value};
use adapter_core::text::TextEncoding;
use std::sync::Arc;

/// What a channel of the user's reads from the control.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OwnItem {
    /// The item that the control is asked for.
    pub item: FocasItem,
    /// A single bit of a byte of PMC memory.
    pub bit: Option<u8>,
    /// Bytes of PMC memory that are a text.
    pub text: bool,
}

impl OwnRead for OwnItem {
    const EXAMPLES: &'static str = "`macro 500`, `parameter 6711`, `parameter 1420 axis 2`, \
     `diagnosis 301 axis 1`, `pmc R100`, `pmc R100.3`, `pmc D20 word`, `pmc D100 text 20`, \
     `tool_offset 1 type 3` or `work_offset 1 axis 3`";

    fn parse(text: &str) -> Option<Self> {
        let words: Vec<&str> = text.split_whitespace().collect();
        match words.as_slice() {
            ["macro", number] => parse_whole(number, 1, 65_535).map(FocasItem::Macro).map(Self::from_item),
            ["parameter", number] => {
                parse_whole(number, 0, 32_767).map(|number| FocasItem::Parameter(number, 0)).map(Self::from_item)
            }
            ["parameter", number, "axis", axis] => parse_number_and_axis(number, axis)
                .map(|(number, axis)| FocasItem::Parameter(number, axis))
                .map(Self::from_item),
            ["diagnosis", number] => {
                parse_whole(number, 0, 32_767).map(|number| FocasItem::Diagnosis(number, 0)).map(Self::from_item)
            }
            ["diagnosis", number, "axis", axis] => parse_number_and_axis(number, axis)
                .map(|(number, axis)| FocasItem::Diagnosis(number, axis))
                .map(Self::from_item),
            ["pmc", place] => parse_pmc(place, PmcWidth::Byte),
            ["pmc", place, "byte"] => parse_pmc(place, PmcWidth::Byte),
            ["pmc", place, "word"] => parse_pmc(place, PmcWidth::Word),
            ["pmc", place, "long"] => parse_pmc(place, PmcWidth::Long),
            ["pmc", place, "text", bytes] => parse_whole(bytes, 1, TEXT_MAX).and_then(|bytes| pmc_text(place, bytes)),
            ["tool_offset", number, "type", kind] => parse_whole(number, 1, 9999)
                .zip(parse_whole(kind, 0, 15))
                .map(|(number, kind)| FocasItem::ToolOffset(number, kind))
                .map(Self::from_item),
            ["work_offset", number, "axis", axis] => parse_number_and_axis(number, axis)
                .map(|(number, axis)| FocasItem::WorkOffset(number, axis))
                .map(Self::from_item),
            _ => None,
        }
    }

    fn is_text(&self) -> Option<bool> {
        Some(self.text)
    }
}

impl OwnItem {
    fn from_item(item: FocasItem) -> Self {
        Self { item, bit: None, text: false }
    }
}

/// Longest text in PMC memory, bytes.
const TEXT_MAX: u16 = 128;

/// Bytes of PMC memory from this one on.
fn pmc_text(place: &str, bytes: u16) -> Option<OwnItem> {
    let OwnItem { item: FocasItem::Pmc(stretch), bit: None, .. } = parse_pmc(place, PmcWidth::Byte)? else {
        return None;
    };
    let item = FocasItem::Pmc(Stretch::from_byte_range(stretch.area, stretch.from, bytes));
    Some(OwnItem { item, bit: None, text: true })
}

fn parse_whole(text: &str, least: u16, greatest: u16) -> Option<u16> {
    text.parse().ok().filter(|number| (least..=greatest).contains(number))
}

/// A number and an axis from 1.
fn parse_number_and_axis(number: &str, axis: &str) -> Option<(u16, i16)> {
    let axis = parse_whole(axis, 1, 32).and_then(|axis| i16::try_from(axis).ok());
    parse_whole(number, 0, 32_767).zip(axis)
}

/// `R100` or `R100.3`.
fn parse_pmc(place: &str, width: PmcWidth) -> Option<OwnItem> {
    let (byte, bit) = place.split_once('.').map_or((place, None), |(byte, bit)| (byte, Some(bit)));
    let mut letters = byte.chars();
    let area = Area::of_letter(letters.next()?)?;
    let from = parse_whole(letters.as_str(), 0, 60_000)?;
    let bit = match bit {
        None => None,
        Some(bit) if width == PmcWidth::Byte => Some(bit.parse::<u8>().ok().filter(|bit| *bit < 8)?),
        Some(_) => return None,
    };
    Some(OwnItem {
        item: FocasItem::Pmc(Stretch { area, from, to: from + width.byte_count() - 1, width }),
        bit,
        text: false,
    })
}

impl OwnItem {
    /// What was answered for this channel, before the scale. `encoding` is the character set of the source.
    ///
    /// # Errors
    /// The answer holds no value: a vacant variable, or another kind of answer.
    pub fn extract_value(
        &self,
        channel: &OwnChannel,
        answer: &FocasAnswer,
        encoding: TextEncoding,
    ) -> OrAbsence<Value> {
        let number = match (answer, self.bit) {
            (FocasAnswer::Memory(elements), _) if self.text => {
                let bytes: Vec<u8> = elements.iter().filter_map(|byte| u8::try_from(*byte).ok()).collect();
                let text = channel.encoding.unwrap_or(encoding).decode_trimmed(&bytes);
                return Ok(Value::Text(Arc::from(text)));
            }
            (FocasAnswer::Memory(elements), Some(bit)) => {
                f64::from(elements.first().ok_or(Absence::OutOfRange)? >> bit & 1)
            }
            (FocasAnswer::Memory(elements), None) => f64::from(*elements.first().ok_or(Absence::OutOfRange)?),
            // A vacant variable has no value.
            (FocasAnswer::Number(value), _) => value.ok_or(Absence::NotSupported)?,
            (FocasAnswer::Data { values, .. }, _) => values.first().copied().flatten().ok_or(Absence::OutOfRange)?,
            (FocasAnswer::Whole(whole), _) => f64::from(*whole),
            _ => return Err(Absence::OutOfRange),
        };
        Value::from_number(number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn item(text: &str) -> FocasItem {
        OwnItem::read(text).expect("readable").item
    }

    #[test]
    fn what_can_be_read() {
        assert_eq!(item("macro 500"), FocasItem::Macro(500));
        assert_eq!(item("parameter 1420 axis 2"), FocasItem::Parameter(1420, 2));
        assert_eq!(item("diagnosis 403"), FocasItem::Diagnosis(403, 0));
        assert_eq!(
            item("pmc D20 word"),
            FocasItem::Pmc(Stretch { area: Area::D, from: 20, to: 21, width: PmcWidth::Word })
        );
        assert_eq!(item("tool_offset 1 type 3"), FocasItem::ToolOffset(1, 3));
        assert_eq!(item("work_offset 0 axis 1"), FocasItem::WorkOffset(0, 1));
        let bit = OwnItem::read("pmc r100.3").expect("readable");
        assert_eq!((bit.item, bit.bit), (FocasItem::Pmc(Stretch::from_byte_range(Area::R, 100, 1)), Some(3)));
        let text = OwnItem::read("pmc D100 text 20").expect("readable");
        assert_eq!(
            (text.item, text.is_text()),
            (FocasItem::Pmc(Stretch::from_byte_range(Area::D, 100, 20)), Some(true))
        );
        for wrong in [
            "",
            "pmc D100 text 0",
            "pmc D100.1 text 4",
            "macro",
            "macro 0",
            "macro x",
            "parameter 40000",
            "pmc Q1",
            "pmc R1.8",
            "pmc D1.1 word",
            "diagnosis 1 axis 0",
            "spindle 1",
        ] {
            assert!(OwnItem::read(wrong).is_err_and(|error| error.to_string().contains("macro 500")), "{wrong}");
        }
    }
}
