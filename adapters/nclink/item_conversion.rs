//! What the number of an item is in the unit of a channel. What is asked for and what the device samples by itself go the same
//! way, so that an item means the same on both.
//!
//! The unit is the one that the device's model tells of the item. A text may bring its own (`85%`, `200 mA`), which then counts for
//! that number. A model without a unit means that of the channel.

use super::lenient_json::parse_number;
use adapter_core::conversion::{self, Conversion};
use adapter_core::reading::Absence;
use serde_json::Value;
use thiserror::Error;

/// Why numbers in one unit cannot be numbers of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum UnitProblem {
    /// Nobody knows the unit.
    #[error("which is no unit that is known")]
    Unknown,
    /// It is the unit of something else.
    #[error("which measures something else")]
    OfSomethingElse,
}

/// From the numbers of an item to those in a wanted unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ItemConversion<'a> {
    wanted_unit: &'a str,
    conversion: Result<Conversion, UnitProblem>,
}

impl<'a> ItemConversion<'a> {
    /// `unit` is that of the item's numbers, where the model tells it; `wanted` is that of the channel.
    #[must_use]
    pub fn new(unit: Option<&str>, wanted: &'a str) -> Self {
        Self { wanted_unit: wanted, conversion: unit.map_or(Ok(Conversion::NONE), |unit| find_between(unit, wanted)) }
    }

    /// Why there is none.
    #[must_use]
    pub fn problem(&self) -> Option<UnitProblem> {
        self.conversion.err()
    }

    /// A number that was told without a unit of its own.
    ///
    /// # Errors
    /// [`Absence::UnknownUnit`].
    pub fn convert_number(&self, number: f64) -> Result<f64, Absence> {
        self.conversion.map(|conversion| conversion.convert_number(number)).map_err(|_| Absence::UnknownUnit)
    }

    /// What the device said, as a number in the wanted unit.
    ///
    /// # Errors
    /// It is no number, or one in a unit that does not fit.
    pub fn convert_value(&self, value: &Value) -> Result<f64, Absence> {
        if value.is_null() {
            return Err(Absence::NotYetRead);
        }
        if let Some(number) = parse_number(value) {
            return self.convert_number(number);
        }
        let (number, unit) = value.as_str().and_then(split_unit).ok_or(Absence::OutOfRange)?;
        // Where the model is at odds with the channel, nobody knows which of the three is meant.
        self.conversion.map_err(|_| Absence::UnknownUnit)?;
        find_between(unit, self.wanted_unit)
            .map(|conversion| conversion.convert_number(number))
            .map_err(|_| Absence::UnknownUnit)
    }
}

fn find_between(unit: &str, wanted: &str) -> Result<Conversion, UnitProblem> {
    let none = || if conversion::is_known(unit) { UnitProblem::OfSomethingElse } else { UnitProblem::Unknown };
    conversion::find_conversion(unit, wanted).ok_or_else(none)
}

/// `85%` and `200 mA`: the number, and the unit behind it.
pub(super) fn split_unit(text: &str) -> Option<(f64, &str)> {
    let text = text.trim();
    let end = text.find(|c: char| !(c.is_ascii_digit() || matches!(c, '+' | '-' | '.')))?;
    let (number, unit) = text.split_at(end);
    Some((number.parse().ok().filter(|number: &f64| number.is_finite())?, unit.trim()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_number_is_in_the_unit_of_the_model_or_in_its_own() {
        let of =
            |unit: Option<&str>, wanted: &str, value: Value| ItemConversion::new(unit, wanted).convert_value(&value);
        assert_eq!(of(Some("mA"), "A", json!(200)), Ok(0.2));
        assert_eq!(of(None, "A", json!("200 mA")), Ok(0.2));
        assert_eq!(of(Some("A"), "A", json!("200mA")), Ok(0.2), "what stands beside the number counts");
        assert_eq!(of(None, "%", json!("85%")), Ok(85.0));
        assert_eq!(of(None, "%", json!(" 85 % ")), Ok(85.0));
        assert_eq!(of(Some("kgf"), "N", json!(2)).map(|newton| (newton * 1e5).round() / 1e5), Ok(19.6133));
        assert_eq!(of(Some("bar"), "A", json!(1)), Err(Absence::UnknownUnit));
        assert_eq!(of(Some("bar"), "A", json!("1 A")), Err(Absence::UnknownUnit));
        assert_eq!(of(Some("furlong"), "mm", json!(1)), Err(Absence::UnknownUnit));
        assert_eq!(of(None, "A", json!("85%")), Err(Absence::UnknownUnit));
        assert_eq!(of(None, "A", json!(null)), Err(Absence::NotYetRead));
        for nonsense in [json!("A"), json!("- A"), json!("1.2.3 A"), json!({}), json!([1, 2])] {
            assert_eq!(of(None, "A", nonsense.clone()), Err(Absence::OutOfRange), "{nonsense}");
        }
    }
}
