//! What is shown and stored.

use gateway_history::ExtraSeries;
use serde::Serialize;

/// How many series there are: lag, its standard deviation and what is applied, for either power.
pub const SERIES: usize = 6;

/// The lag between the controller and a meter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AlignmentStatus {
    /// The source of the spindle speed.
    pub controller: String,
    /// The source of the power.
    pub meter: String,
    /// The channel of the power.
    pub power: &'static str,
    /// `show`, or `merge`: the meter's readings are put back by what is applied.
    #[serde(rename = "use")]
    pub purpose: &'static str,
    /// How much later the meter is, s.
    pub lag_s: Option<f64>,
    /// Half its 95 % interval, s.
    pub uncertainty_s: Option<f64>,
    /// How long the meter averages, s.
    pub window_s: Option<f64>,
    /// How the lag changes, ppm, where the changes of speed lie far enough apart to tell.
    pub drift_ppm: Option<f64>,
    /// Half its 95 % interval, ppm.
    pub drift_uncertainty_ppm: Option<f64>,
    /// From so many changes of speed.
    pub transients: Option<usize>,
    /// What the merge takes it to be at the moment, s; 0 where it is only shown.
    pub applied_s: f64,
    /// Why it is not known, as a word.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missing: Option<&'static str>,
    /// The same in plain words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

/// What is stored beside the channels.
#[must_use]
pub fn list_series() -> Vec<ExtraSeries> {
    let seconds = |name: &str, en, zh| ExtraSeries::new_number(name, "s", en, zh);
    vec![
        seconds("spindle_power_lag_s", "Lag of the spindle's meter", "主轴功率计滞后"),
        seconds(
            "spindle_power_lag_sd_s",
            "Standard deviation of the lag of the spindle's meter",
            "主轴功率计滞后标准差",
        ),
        seconds("spindle_power_lag_applied_s", "Lag taken off the spindle's meter", "主轴功率计已校正滞后"),
        seconds("total_power_lag_s", "Lag of the machine's meter", "整机功率计滞后"),
        seconds("total_power_lag_sd_s", "Standard deviation of the lag of the machine's meter", "整机功率计滞后标准差"),
        seconds("total_power_lag_applied_s", "Lag taken off the machine's meter", "整机功率计已校正滞后"),
    ]
}
