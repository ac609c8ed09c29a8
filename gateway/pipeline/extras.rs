//! What is stored beside the channels: the state and the estimates worth keeping, each with its uncertainty.
//!
//! Filtered power and load loss follow from these and the channels, and are not stored.

use crate::history::{ExtraSeries, ExtraValue, STATE_SERIES};
use rules::estimators::{Estimated, Estimates};
use rules::script::Host;

/// How many series there are.
const COUNT: usize = 13;

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
        watts("wear_limit_w", "Limit of the cutting power for a worn edge", "磨损阈值功率"),
        ExtraSeries::number("tool_wear_mm", "mm", "Flank wear of the edge", "后刀面磨损量"),
        ExtraSeries::number("tool_wear_sd_mm", "mm", "Standard deviation of the flank wear", "磨损量标准差"),
        ExtraSeries::number("tool_growth_pct", "%", "Rise of the cutting power by wear", "磨损引起的功率增量"),
        ExtraSeries::number(
            "tool_worn_probability",
            "1",
            "Probability that the edge is worn after the next part",
            "磨损概率",
        ),
        ExtraSeries::number("tool_parts_left", "1", "Parts until the edge is worn", "剩余可加工件数"),
        ExtraSeries::number("tool_parts_left_sd", "1", "Standard deviation of the parts left", "剩余件数标准差"),
    ]
}

/// The channels of the scripts' own that are stored: those of the scripts in charge when the box started.
#[must_use]
pub(super) fn own(scripts: &Host) -> Vec<ExtraSeries> {
    let taken = series();
    let fresh = scripts.published().filter(|it| !taken.iter().any(|known| known.name == it.name));
    fresh.map(|it| ExtraSeries::number(it.name, it.unit, &format!("Published by {}", it.script), "脚本发布")).collect()
}

/// The newest value of an own channel.
#[must_use]
pub(super) fn own_value(scripts: &Host, name: &str) -> ExtraValue<'static> {
    let value = scripts.published().find(|it| it.name == name).and_then(|it| it.value);
    value.map_or(ExtraValue::Missing("not_published"), ExtraValue::Number)
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
        value(estimates.wear_limit_w),
        value(estimates.tool_wear_mm),
        sd(estimates.tool_wear_mm),
        value(estimates.tool_growth_pct),
        value(estimates.tool_worn_probability),
        value(estimates.tool_parts_left),
        sd(estimates.tool_parts_left),
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
