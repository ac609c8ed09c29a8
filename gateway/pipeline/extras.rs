//! What is stored beside the channels: the state and the estimates worth keeping, each with its uncertainty, and no finer than
//! that uncertainty makes sense of.
//!
//! An estimate that is known to within watts has no tenths of a watt; a standard deviation is known to within a tenth of itself.
//! Digits beyond that are noise, which no compression takes away: they were a third of the bytes of a tick.

use gateway_history::{ExtraSeries, ExtraValue, STATE_SERIES, decimals_of_unit, round_to_decimals};
use rules::estimators::{Estimated, Estimates, NoEstimate};
use rules::script::Host;

/// How many series there are.
const COUNT: usize = 14;
/// A deviation or a least visible power is stored anew when it differs by this share from the one that was stored.
const DEVIATION_STEP: f64 = 0.1;
/// Numbers that are stored so.
const DEVIATIONS: usize = 5;

/// Estimates that are stored in whole watts.
const WHOLE_WATTS: [&str; 7] = [
    "no_load_power_w",
    "no_load_power_sd_w",
    "cutting_power_w",
    "cutting_power_sd_w",
    "visible_cutting_power_w",
    "load_loss_w",
    "wear_limit_w",
];

/// The series, in the order of `StoredEstimates::compute_values`.
#[must_use]
pub fn list_series() -> Vec<ExtraSeries> {
    let watts = |name, en, zh| ExtraSeries { decimals: Some(0), ..ExtraSeries::new_number(name, "W", en, zh) };
    vec![
        ExtraSeries::new_text(STATE_SERIES, "Machine state", "机床状态"),
        watts("no_load_power_w", "No-load power at this speed", "空载功率"),
        watts("no_load_power_sd_w", "Standard deviation of the no-load power", "空载功率标准差"),
        watts("cutting_power_w", "Cutting power", "切削功率"),
        watts("cutting_power_sd_w", "Standard deviation of the cutting power", "切削功率标准差"),
        watts("visible_cutting_power_w", "Least visible cutting power", "最小可见切削功率"),
        watts("load_loss_w", "Load loss", "负载损耗"),
        watts("wear_limit_w", "Limit of the cutting power for a worn edge", "磨损阈值功率"),
        ExtraSeries::new_number("tool_wear_mm", "mm", "Flank wear of the edge", "后刀面磨损量"),
        ExtraSeries::new_number("tool_wear_sd_mm", "mm", "Standard deviation of the flank wear", "磨损量标准差"),
        ExtraSeries::new_number("tool_growth_pct", "%", "Rise of the cutting power by wear", "磨损引起的功率增量"),
        ExtraSeries::new_number(
            "tool_worn_probability",
            "1",
            "Probability that the edge is worn after the next part",
            "磨损概率",
        ),
        ExtraSeries::new_number("tool_parts_left", "1", "Parts until the edge is worn", "剩余可加工件数"),
        ExtraSeries::new_number("tool_parts_left_sd", "1", "Standard deviation of the parts left", "剩余件数标准差"),
    ]
}

/// The number that the history keeps of an estimate of this name and unit. Publish this one, and every view shows the same digits.
#[must_use]
pub fn round_as_stored(name: &str, unit: &str, number: f64) -> f64 {
    let whole = WHOLE_WATTS.contains(&name).then_some(0);
    round_to_decimals(number, whole.unwrap_or_else(|| decimals_of_unit(unit)))
}

/// What the history was given last, where it is given anew only when it has changed by enough.
#[derive(Debug, Default)]
pub(super) struct StoredEstimates {
    deviations: [f64; DEVIATIONS],
}

impl StoredEstimates {
    /// The values of one tick.
    pub(super) fn compute_values(&mut self, estimates: &Estimates) -> [ExtraValue<'static>; COUNT] {
        let value = |estimated: Estimated| match estimated {
            Ok(estimate) => ExtraValue::Number(estimate.value),
            Err(reason) => ExtraValue::Missing(reason.as_word()),
        };
        let mut stored = self.deviations.iter_mut();
        let mut coarse = |number: Result<f64, NoEstimate>| match (number, stored.next()) {
            (Ok(number), Some(stored)) => ExtraValue::Number(update_deviation(stored, number)),
            (Ok(number), None) => ExtraValue::Number(number),
            (Err(reason), _) => ExtraValue::Missing(reason.as_word()),
        };
        let sd = |estimated: Estimated| estimated.map(|it| it.sd);
        [
            ExtraValue::Text(estimates.state.as_word()),
            value(estimates.no_load_power_w),
            coarse(sd(estimates.no_load_power_w)),
            value(estimates.cutting_power_w),
            coarse(sd(estimates.cutting_power_w)),
            coarse(estimates.visible_cutting_power_w.map(|it| it.value)),
            value(estimates.load_loss_w),
            value(estimates.wear_limit_w),
            value(estimates.tool_wear_mm),
            coarse(sd(estimates.tool_wear_mm)),
            value(estimates.tool_growth_pct),
            value(estimates.tool_worn_probability),
            value(estimates.tool_parts_left),
            coarse(sd(estimates.tool_parts_left)),
        ]
    }
}

/// The deviation that was stored, until the one in force differs from it by enough; then that one, in two digits.
fn update_deviation(stored: &mut f64, sd: f64) -> f64 {
    if (sd - *stored).abs() > DEVIATION_STEP * stored.abs() {
        let unit = 10_f64.powf(sd.abs().max(f64::MIN_POSITIVE).log10().floor() - 1.0);
        *stored = (sd / unit).round() * unit;
    }
    *stored
}

/// The channels of the scripts' own that are stored: those of the scripts in charge when the box started.
#[must_use]
pub(super) fn list_script_series(scripts: &Host) -> Vec<ExtraSeries> {
    let taken = list_series();
    let fresh = scripts.published_channels().filter(|it| !taken.iter().any(|known| known.name == it.name));
    fresh
        .map(|it| ExtraSeries::new_number(it.name, it.unit, &format!("Published by {}", it.script), "脚本发布"))
        .collect()
}

/// The newest value of an own channel.
#[must_use]
pub(super) fn own_value(scripts: &Host, name: &str) -> ExtraValue<'static> {
    let value = scripts.published_channels().find(|it| it.name == name).and_then(|it| it.value);
    value.map_or(ExtraValue::Missing("not_published"), ExtraValue::Number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_series_has_its_value() {
        assert_eq!(
            list_series().len(),
            StoredEstimates::default().compute_values(&Estimates::without_samples(0)).len()
        );
    }

    #[test]
    fn a_published_estimate_has_the_digits_of_the_history() {
        for series in list_series() {
            let decimals = series.decimals.unwrap_or_else(|| decimals_of_unit(&series.unit));
            let number = 1_234.567_891_234_567;
            let kept = round_to_decimals(number, decimals);
            assert_eq!(round_as_stored(&series.name, &series.unit, number), kept, "{}", series.name);
        }
    }

    #[test]
    fn a_deviation_is_stored_anew_when_it_has_changed_by_a_tenth() {
        let mut stored = 0.0;
        let seen = [13.37, 13.9, 14.2, 14.6, 14.4, 0.0, 0.0213].map(|sd| update_deviation(&mut stored, sd));
        for (seen, wanted) in seen.into_iter().zip([13.0, 13.0, 13.0, 15.0, 15.0, 0.0, 0.021]) {
            assert!((seen - wanted).abs() < 1e-12, "{seen} for {wanted}");
        }
    }
}
