//! What the user can have read through the vendor's library of a Huazhong control, by the numbers of its headers. Written in
//! the configuration as
//!
//! ```text
//! read = "register D120"        read = "channel 7 real"        read = "system 24 text"
//! read = "register G2560.3"     read = "axis 5 29 real"
//! ```

use super::answer::{HncAnswer, HncItemResult};
use super::item::{HncItem, HncWidth, define_register};
use adapter_core::own::OwnRead;
use adapter_core::reading::{Absence, Value};
use nclink::mailbox::ControllerRegister;
use std::sync::Arc;

/// A value of the library.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OwnValue {
    /// The item that the library is asked for.
    pub item: HncItem,
    /// A single bit of a register.
    pub bit: Option<u8>,
}

impl OwnRead for OwnValue {
    const EXAMPLES: &'static str = "`register D120`, `register G2560.3`, `channel 7 real`, \
     `axis 5 29 real` or `system 24 text`";

    fn parse(text: &str) -> Option<Self> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let plain = |item| Some(Self { item, bit: None });
        match words.as_slice() {
            ["register", place] => parse_register(place),
            ["channel", kind, rest @ ..] => parse_number(kind)
                .zip(parse_width(rest))
                .and_then(|(kind, width)| plain(HncItem::Channel(kind, 0, width))),
            ["axis", axis, kind, rest @ ..] => parse_number(axis)
                .zip(parse_number(kind))
                .zip(parse_width(rest))
                .and_then(|((axis, kind), width)| plain(HncItem::Axis(kind, axis, width))),
            ["system", kind, rest @ ..] => {
                parse_number(kind).zip(parse_width(rest)).and_then(|(kind, width)| plain(HncItem::System(kind, width)))
            }
            _ => None,
        }
    }

    fn is_text(&self) -> Option<bool> {
        let width = match self.item {
            HncItem::System(_, width) | HncItem::Channel(_, _, width) | HncItem::Axis(_, _, width) => width,
            _ => HncWidth::Whole,
        };
        Some(width == HncWidth::Text)
    }
}

fn parse_number(text: &str) -> Option<i32> {
    text.parse().ok().filter(|number| (0..10_000).contains(number))
}

fn parse_width(words: &[&str]) -> Option<HncWidth> {
    match words {
        [] | ["whole"] => Some(HncWidth::Whole),
        ["real"] => Some(HncWidth::Real),
        ["text"] => Some(HncWidth::Text),
        _ => None,
    }
}

fn parse_register(place: &str) -> Option<OwnValue> {
    let (name, bit) = place.split_once('.').map_or((place, None), |(name, bit)| (name, Some(bit)));
    let at: ControllerRegister = name.parse().ok()?;
    let bit = match bit {
        None => None,
        Some(bit) => Some(bit.parse::<u8>().ok().filter(|bit| *bit < 32)?),
    };
    Some(OwnValue { item: define_register(at)?, bit })
}

impl OwnValue {
    /// What was answered, before the scale.
    ///
    /// # Errors
    /// There is no value of the kind that the channel has.
    pub(super) fn extract_value(&self, result: &HncItemResult) -> Result<Value, Absence> {
        match (result, self.bit) {
            (Ok(HncAnswer::Whole(whole)), Some(bit)) => Value::from_number(f64::from(whole >> bit & 1)),
            (Ok(HncAnswer::Whole(whole)), None) => Value::from_number(f64::from(*whole)),
            (Ok(HncAnswer::Real(real)), _) => Value::from_number(*real),
            (Ok(HncAnswer::Text(text)), _) => Ok(Value::Text(Arc::from(text.as_str()))),
            (Ok(HncAnswer::Alarms(_)), _) => Err(Absence::OutOfRange),
            (Err(error), _) => Err(error.to_absence()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_be_read() {
        let of = |text: &str| OwnValue::read(text).map(|value| (value.item, value.bit));
        assert_eq!(of("register D120"), Ok((HncItem::Register(6, 120), None)));
        assert_eq!(of("register G2560.3"), Ok((HncItem::Register(3, 2560), Some(3))));
        assert_eq!(of("channel 7 real"), Ok((HncItem::Channel(7, 0, HncWidth::Real), None)));
        assert_eq!(of("axis 5 29 real"), Ok((HncItem::Axis(29, 5, HncWidth::Real), None)));
        assert_eq!(OwnValue::read("system 24 text").map(|value| value.is_text()), Ok(Some(true)));
        for wrong in ["", "register", "register Q1", "register D1.40", "channel x", "axis 5", "channel 7 float"] {
            assert!(of(wrong).is_err_and(|why| why.to_string().contains("register D120")), "{wrong}");
        }
    }
}
