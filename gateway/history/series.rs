//! What is stored per tick: every channel of the table, then the estimates registered at opening.

use super::error::HistoryError;
use super::rounding::{PLACES_MAX, round_to_decimals};
use super::series_kind::{ExtraSeries, Fidelity, SeriesKind};
use adapter_core::ChannelId;
use adapter_core::channel::{Channel, Kind};
use std::sync::Arc;

/// A series as the history stores it: name, unit, kind and texts.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Number in the table `series` of the database; stable for the life of the file.
    pub id: i64,
    /// Name, ending in its unit for quantities.
    pub name: Arc<str>,
    /// Unit symbol; `1` for pure numbers, empty for text.
    pub unit: Arc<str>,
    /// Whether the values are numbers or words.
    pub kind: SeriesKind,
    /// Decimal places kept of long fractions; `None` keeps every bit.
    pub decimals: Option<u8>,
    /// What it is, in English.
    pub en: Arc<str>,
    /// What it is, in Chinese.
    pub zh: Arc<str>,
    /// Inferred by the gateway rather than read from a source.
    pub estimated: bool,
}

impl Series {
    fn of_channel(channel: &Channel, fidelity: Fidelity) -> Self {
        let kind = if channel.kind == Kind::Text { SeriesKind::Text } else { SeriesKind::Number };
        Self {
            id: 0,
            name: channel.name.into(),
            unit: channel.unit.into(),
            kind,
            decimals: choose_decimals(None, channel.unit, fidelity),
            en: channel.en.into(),
            zh: channel.zh.into(),
            estimated: false,
        }
    }

    fn of_extra(extra: &ExtraSeries, fidelity: Fidelity) -> Self {
        Self {
            id: 0,
            name: extra.name.as_str().into(),
            unit: extra.unit.as_str().into(),
            kind: extra.kind,
            decimals: choose_decimals(extra.decimals, &extra.unit, fidelity),
            en: extra.en.as_str().into(),
            zh: extra.zh.as_str().into(),
            estimated: true,
        }
    }
}

fn choose_decimals(decimals: Option<u8>, unit: &str, fidelity: Fidelity) -> Option<u8> {
    let decimals = decimals.unwrap_or_else(|| decimals_of_unit(unit)).min(PLACES_MAX);
    (fidelity == Fidelity::Resolution).then_some(decimals)
}

/// Decimal places kept of interpolated and estimated values in `unit`: a tenth or less of what the meters and
/// controllers of this trade resolve.
#[must_use]
pub fn decimals_of_unit(unit: &str) -> u8 {
    match unit {
        "W" | "rpm" | "mm/min" | "N" | "J" => 1,
        "%" | "°C" | "um" | "V" | "s" => 2,
        "A" | "1" | "cm3/min" | "N m" => 3,
        "mm/rev" => 5,
        _ => 4,
    }
}

/// The number that the history keeps of `number` on `channel`. Publish this one, and the page, the API and `history
/// query` show the same digits.
#[must_use]
pub fn as_stored(channel: ChannelId, number: f64) -> f64 {
    round_to_decimals(number, decimals_of_unit(channel.channel().unit))
}

/// Every series a writer stores, channels first. The `id` is still 0.
pub(crate) fn stored_series(fidelity: Fidelity, extras: &[ExtraSeries]) -> Result<Vec<Series>, HistoryError> {
    let mut series: Vec<Series> = ChannelId::list_all().map(|id| Series::of_channel(id.channel(), fidelity)).collect();
    for extra in extras {
        if extra.name.is_empty() || series.iter().any(|known| *known.name == *extra.name) {
            let name = &extra.name;
            return Err(HistoryError::Question(format!(
                "the stored series {name:?} has no name or the name of another one; give every estimate its own name"
            )));
        }
        series.push(Series::of_extra(extra, fidelity));
    }
    Ok(series)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_estimate_may_not_take_the_name_of_a_channel() {
        let extras = vec![ExtraSeries::new_number("spindle_power_w", "W", "", "")];
        let error = stored_series(Fidelity::Resolution, &extras).expect_err("refused").to_string();
        assert!(error.contains("spindle_power_w"), "{error}");
    }

    #[test]
    fn channels_keep_their_place() {
        let series = stored_series(Fidelity::Resolution, &[]).expect("fine");
        assert_eq!(series.len(), ChannelId::count_channels());
        assert!(series.iter().zip(ChannelId::list_all()).all(|(series, channel)| *series.name == *channel.name()));
    }
}
