//! What is stored beside the channels: the state and the estimates worth keeping, each with its uncertainty.
//!
//! Filtered power and load loss follow from these and the channels, and are not stored.

use crate::history::{ExtraSeries, ExtraValue, STATE_SERIES};
use rules::estimators::{Estimated, Estimates};

/// How many series there are.
const COUNT: usize = 6;

/// The series, in the order of [`values`].
#[must_use]
pub fn series() -> Vec<ExtraSeries> {
    let watts = |name, en, zh| ExtraSeries::number(name, "W", en, zh);
    vec![
        ExtraSeries::text(STATE_SERIES, "Machine state", "机床状态"),
        watts("no_load_power_w", "No-load power at this speed", "空载功率"),
        watts("no_load_power_sd_w", "Standard deviation of the no-load power", "空载功率标准差"),
        watts("cutting_power_w", "Cutting power", "切削功率"),
        watts("cutting_power_sd_w", "Standard deviation of the cutting power", "切削功率标准差"),
        watts("visible_cutting_power_w", "Least visible cutting power", "最小可见切削功率"),
    ]
}

/// The values of one tick.
#[must_use]
pub fn values(estimates: &Estimates) -> [ExtraValue<'static>; COUNT] {
    let value = |estimated: Estimated| match estimated {
        Ok(estimate) => ExtraValue::Number(estimate.value),
        Err(reason) => ExtraValue::Missing(reason.word()),
    };
    let sd = |estimated: Estimated| match estimated {
        Ok(estimate) => ExtraValue::Number(estimate.sd),
        Err(reason) => ExtraValue::Missing(reason.word()),
    };
    [
        ExtraValue::Text(estimates.state.word()),
        value(estimates.no_load_power_w),
        sd(estimates.no_load_power_w),
        value(estimates.cutting_power_w),
        sd(estimates.cutting_power_w),
        value(estimates.visible_cutting_power_w),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_series_has_its_value() {
        assert_eq!(series().len(), values(&Estimates::none(0)).len());
    }
}
