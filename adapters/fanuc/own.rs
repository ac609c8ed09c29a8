//! The user's own channels: a custom macro variable, a parameter, a diagnosis number, PMC memory or an offset, with a name,
//! a unit and a scale. Written in the configuration as
//!
//! ```text
//! read = "macro 500"                 read = "pmc R100.3"
//! read = "parameter 6711"            read = "pmc D20 word"
//! read = "parameter 1420 axis 2"     read = "tool_offset 1 type 3"
//! read = "diagnosis 301 axis 1"      read = "work_offset 1 axis 3"
//! ```

use super::answer::FocasAnswer;
use super::item::{Area, FocasItem, PmcWidth, Stretch};
use super::states::OrAbsence;
use crate::channel::NewChannel;
use crate::reading::Absence;

/// With which group a channel is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadWith {
    /// With motion and states.
    Fast,
    /// With parts and times.
    Slow,
}

/// What is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OwnItem {
    /// The item.
    pub item: FocasItem,
    /// A single bit of a byte of PMC memory.
    pub bit: Option<u8>,
}

/// One of the user's own channels.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnChannel {
    /// Name, unit and range.
    pub new: NewChannel,
    /// What is read.
    pub item: FocasItem,
    /// A single bit of it.
    pub bit: Option<u8>,
    /// Factor by which what is read becomes the unit.
    pub scale: f64,
    /// Added after the factor, in the unit.
    pub offset: f64,
    /// With which group.
    pub pace: ReadWith,
    /// Path from 1; `None` is the one that is written to.
    pub path: Option<u8>,
}

impl OwnItem {
    /// Reads the text of a configuration.
    ///
    /// # Errors
    /// What is wrong with it, and an example.
    pub fn read(text: &str) -> Result<Self, String> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let found = match words.as_slice() {
            ["macro", number] => whole(number, 1, 65_535).map(FocasItem::Macro).map(Self::plain),
            ["parameter", number] => {
                whole(number, 0, 32_767).map(|number| FocasItem::Parameter(number, 0)).map(Self::plain)
            }
            ["parameter", number, "axis", axis] => {
                numbered(number, axis).map(|(number, axis)| FocasItem::Parameter(number, axis)).map(Self::plain)
            }
            ["diagnosis", number] => {
                whole(number, 0, 32_767).map(|number| FocasItem::Diagnosis(number, 0)).map(Self::plain)
            }
            ["diagnosis", number, "axis", axis] => {
                numbered(number, axis).map(|(number, axis)| FocasItem::Diagnosis(number, axis)).map(Self::plain)
            }
            ["pmc", place] => pmc(place, PmcWidth::Byte),
            ["pmc", place, "byte"] => pmc(place, PmcWidth::Byte),
            ["pmc", place, "word"] => pmc(place, PmcWidth::Word),
            ["pmc", place, "long"] => pmc(place, PmcWidth::Long),
            ["tool_offset", number, "type", kind] => whole(number, 1, 9999)
                .zip(whole(kind, 0, 15))
                .map(|(number, kind)| FocasItem::ToolOffset(number, kind))
                .map(Self::plain),
            ["work_offset", number, "axis", axis] => {
                numbered(number, axis).map(|(number, axis)| FocasItem::WorkOffset(number, axis)).map(Self::plain)
            }
            _ => None,
        };
        found.ok_or_else(|| {
            format!(
                "`{text}` is nothing that can be read; write `macro 500`, `parameter 6711`, `parameter 1420 axis 2`, \
                 `diagnosis 301 axis 1`, `pmc R100`, `pmc R100.3`, `pmc D20 word`, `tool_offset 1 type 3` or \
                 `work_offset 1 axis 3`"
            )
        })
    }

    fn plain(item: FocasItem) -> Self {
        Self { item, bit: None }
    }
}

fn whole(text: &str, least: u16, greatest: u16) -> Option<u16> {
    text.parse().ok().filter(|number| (least..=greatest).contains(number))
}

/// A number and an axis from 1.
fn numbered(number: &str, axis: &str) -> Option<(u16, i16)> {
    let axis = whole(axis, 1, 32).and_then(|axis| i16::try_from(axis).ok());
    whole(number, 0, 32_767).zip(axis)
}

/// `R100` or `R100.3`.
fn pmc(place: &str, width: PmcWidth) -> Option<OwnItem> {
    let (byte, bit) = place.split_once('.').map_or((place, None), |(byte, bit)| (byte, Some(bit)));
    let mut letters = byte.chars();
    let area = Area::of_letter(letters.next()?)?;
    let from = whole(letters.as_str(), 0, 60_000)?;
    let bit = match bit {
        None => None,
        Some(bit) if width == PmcWidth::Byte => Some(bit.parse::<u8>().ok().filter(|bit| *bit < 8)?),
        Some(_) => return None,
    };
    Some(OwnItem { item: FocasItem::Pmc(Stretch { area, from, to: from + width.bytes() - 1, width }), bit })
}

impl OwnChannel {
    /// The value in its unit.
    ///
    /// # Errors
    /// The answer holds no number: a vacant variable, or another kind of answer.
    pub fn value(&self, answer: &FocasAnswer) -> OrAbsence<f64> {
        let raw = match (answer, self.bit) {
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
        Ok(raw * self.scale + self.offset)
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
        assert_eq!((bit.item, bit.bit), (FocasItem::Pmc(Stretch::bytes(Area::R, 100, 1)), Some(3)));
        for wrong in [
            "",
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
            assert!(OwnItem::read(wrong).is_err_and(|error| error.contains("macro 500")), "{wrong}");
        }
    }
}
