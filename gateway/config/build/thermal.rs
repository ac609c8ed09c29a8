//! `[thermal]`.

use super::{flag, number, text};
use crate::config::ThermalConfig;
use crate::config::read::ConfigInput;
use adapters::Axis;
use rules::estimators::thermal::CompensationSettings;
use std::path::Path;

pub(super) fn thermal(reading: &ConfigInput<'_>, base: &Path) -> Option<ThermalConfig> {
    const SECTION: &str = "thermal";
    let number = |key| number(reading, SECTION, key);
    Some(ThermalConfig {
        model: text(reading, SECTION, "model").map(|path| base.join(path)),
        axis: Axis::of(&text(reading, SECTION, "axis")?)?,
        propose: flag(reading, SECTION, "propose")?,
        learn: flag(reading, SECTION, "learn")?,
        step_um: number("step_um")?,
        total_um: number("total_um")?,
        compensation: CompensationSettings {
            pulse_um: number("pulse_um")?,
            limit_um: number("limit_um")?,
            slew_um_per_s: number("slew_um_per_s")?,
            dead_band_um: number("dead_band_um")?,
            hold_s: number("hold_s")?,
            positive_moves_along_error: true,
        },
    })
}
