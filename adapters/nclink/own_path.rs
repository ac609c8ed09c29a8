//! What the user can have read of an NC-Link device: any item of its model, by path or node number; of a list an element, and
//! of that a bit. Written in the configuration as
//!
//! ```text
//! read = "AXIS@5/MOTOR/TEMPERATURE"        read = "CONTROLLER/VARIABLE@REG_D 120"
//! read = "0103532105"                      read = "CONTROLLER/VARIABLE@REG_X 12.3"
//! ```

use super::item_conversion::ItemConversion;
use super::lenient_json::parse_integer;
use super::message::NcLinkAnswer;
use adapter_core::channel::Kind;
use adapter_core::own::{OwnChannel, OwnRead};
use adapter_core::reading::{Absence, Value};
use std::sync::Arc;

/// An item of a model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OwnPath {
    /// Path or node number.
    pub name: String,
    /// Element of a list.
    pub index: Option<u32>,
    /// Bit of the element, 0 to 31; `None` is the whole of it.
    pub bit: Option<u8>,
}

impl OwnRead for OwnPath {
    const EXAMPLES: &'static str = "the path of an item as `doctor --all` lists it, with the number of \
     an element where it is a list: `AXIS@5/MOTOR/TEMPERATURE`, `CONTROLLER/VARIABLE@REG_D 120` or \
     `CONTROLLER/VARIABLE@REG_X 12.3`";

    fn parse(text: &str) -> Option<Self> {
        let words: Vec<&str> = text.split_whitespace().collect();
        match words.as_slice() {
            [name] => Some(Self { name: (*name).to_owned(), index: None, bit: None }),
            [name, place] => {
                parse_element(place).map(|(index, bit)| Self { name: (*name).to_owned(), index: Some(index), bit })
            }
            _ => None,
        }
    }

    fn is_text(&self) -> Option<bool> {
        None
    }
}

/// `120` or `12.3`.
fn parse_element(place: &str) -> Option<(u32, Option<u8>)> {
    let (index, bit) = place.split_once('.').map_or((place, None), |(index, bit)| (index, Some(bit)));
    let bit = match bit {
        None => None,
        Some(bit) => Some(bit.parse::<u8>().ok().filter(|bit| *bit < 32)?),
    };
    Some((index.parse().ok()?, bit))
}

impl OwnPath {
    /// What was answered for this channel, before the scale.
    ///
    /// # Errors
    /// There is no value of the kind that the channel has.
    pub(super) fn extract_value(
        &self,
        channel: &OwnChannel,
        answer: Option<&NcLinkAnswer>,
        conversion: &ItemConversion<'_>,
    ) -> Result<Value, Absence> {
        let value = match answer {
            Some(Ok(values)) => values.first().filter(|value| !value.is_null()).ok_or(Absence::NotYetRead)?,
            Some(Err(_)) => return Err(Absence::Refused),
            None => return Err(Absence::NotSupported),
        };
        if channel.new.kind == Kind::Text {
            let text = value.as_str().map_or_else(|| value.to_string(), |text| text.trim().to_owned());
            return Ok(Value::Text(Arc::from(text)));
        }
        let Some(bit) = self.bit else { return conversion.convert_value(value).and_then(Value::from_number) };
        let whole = parse_integer(value).ok_or(Absence::OutOfRange)?;
        conversion.convert_number(f64::from(u8::from(whole >> bit & 1 == 1))).and_then(Value::from_number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_be_read() {
        let of = |text: &str| OwnPath::read(text).map(|path| (path.name, path.index, path.bit));
        assert_eq!(of("AXIS@5/MOTOR/TEMPERATURE"), Ok(("AXIS@5/MOTOR/TEMPERATURE".to_owned(), None, None)));
        assert_eq!(of("CONTROLLER/VARIABLE@REG_D 120"), Ok(("CONTROLLER/VARIABLE@REG_D".to_owned(), Some(120), None)));
        assert_eq!(of("REG_X 12.3"), Ok(("REG_X".to_owned(), Some(12), Some(3))));
        for wrong in ["", "A B C", "REG x", "REG 1.40", "REG -1"] {
            assert!(of(wrong).is_err_and(|why| why.to_string().contains("doctor --all")), "{wrong}");
        }
    }
}
