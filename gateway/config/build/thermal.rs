//! `[thermal]`.

use super::{find_flag, find_number, find_text};
use crate::ThermalConfig;
use crate::read::ConfigInput;
use adapters::Axis;
use rules::estimators::thermal::CompensationSettings;
use std::path::Path;

pub(super) fn build_thermal(reading: &ConfigInput<'_>, base: &Path) -> Option<ThermalConfig> {
    const SECTION: &str = "thermal";
    let number = |key| find_number(reading, SECTION, key);
    Some(ThermalConfig {
        model: find_text(reading, SECTION, "model").map(|path| base.join(path)),
        axis: Axis::from_word(&find_text(reading, SECTION, "axis")?)?,
        propose: find_flag(reading, SECTION, "propose")?,
        learn: find_flag(reading, SECTION, "learn")?,
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
