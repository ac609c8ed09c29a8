//! A cell of an item as its document has it. Pure.

use serde::de::Visitor;
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;

#[derive(Deserialize)]
pub(super) struct FieldValue<'a> {
    #[serde(borrow)]
    pub(super) name: Cow<'a, str>,
    #[serde(default, borrow)]
    pub(super) value: ValueInItem<'a>,
    #[serde(default, borrow)]
    pub(super) unit: Cow<'a, str>,
    #[serde(default, borrow)]
    pub(super) missing: Option<Cow<'a, str>>,
    #[serde(default)]
    pub(super) mean: Option<f64>,
    #[serde(default)]
    pub(super) least: Option<f64>,
    #[serde(default)]
    pub(super) greatest: Option<f64>,
    #[serde(default)]
    pub(super) seconds: Option<f64>,
}

#[derive(Default)]
pub(super) enum ValueInItem<'a> {
    Number(f64),
    Text(Cow<'a, str>),
    #[default]
    Missing,
}

/// By hand: the derived form of such an enum keeps a copy of each value first.
impl<'de: 'a, 'a> Deserialize<'de> for ValueInItem<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ValueVisitor)
    }
}

struct ValueVisitor;

impl<'de> Visitor<'de> for ValueVisitor {
    type Value = ValueInItem<'de>;

    fn expecting(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.write_str("a number, a text or null")
    }

    fn visit_f64<E>(self, number: f64) -> Result<Self::Value, E> {
        Ok(ValueInItem::Number(number))
    }

    #[expect(clippy::cast_precision_loss, reason = "numbers of items are of double precision")]
    fn visit_u64<E>(self, number: u64) -> Result<Self::Value, E> {
        Ok(ValueInItem::Number(number as f64))
    }

    #[expect(clippy::cast_precision_loss, reason = "numbers of items are of double precision")]
    fn visit_i64<E>(self, number: i64) -> Result<Self::Value, E> {
        Ok(ValueInItem::Number(number as f64))
    }

    fn visit_borrowed_str<E>(self, text: &'de str) -> Result<Self::Value, E> {
        Ok(ValueInItem::Text(text.into()))
    }

    fn visit_str<E>(self, text: &str) -> Result<Self::Value, E> {
        Ok(ValueInItem::Text(text.to_owned().into()))
    }

    fn visit_unit<E>(self) -> Result<Self::Value, E> {
        Ok(ValueInItem::Missing)
    }
}
