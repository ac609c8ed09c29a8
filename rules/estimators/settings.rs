//! Every tolerance and length the estimators use: one table that scripts, configuration and documentation read.

use super::loads::LoadCurves;
use super::no_load::NoLoadPoint;
use super::place_settings::PlaceValues;
use super::stage_settings::{OF_STAGE, find_place_of_stage, split_stage_suffix};
use adapter_core::channel::find_nearest_name;
use adapter_core::channel::quantity::space_unit;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use thiserror::Error;

/// Gear stages are numbered 0 to 7; a machine without a gear box runs in stage 0.
pub const STAGES: usize = 8;

/// At most this many no-load speeds are kept per gear stage.
pub const SPEEDS_PER_STAGE: usize = 16;

/// One row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Setting {
    /// Name in scripts and configuration.
    pub name: &'static str,
    /// Unit symbol; `1` for pure numbers.
    pub unit: &'static str,
    /// Least and greatest value accepted.
    pub range: (f64, f64),
    /// Value when nobody sets one.
    pub default: f64,
    /// Is it a count?
    pub whole: bool,
    /// What it does, in English.
    pub en: &'static str,
    pub(super) get: fn(&Settings) -> f64,
    pub(super) set: fn(&mut Settings, f64),
}

/// Why a setting was not accepted. The text is what the integrator reads.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SettingError {
    /// There is no setting of this name.
    #[error("there is no estimator setting {name:?}{}", .nearest.map(|near| format!("; did you mean {near}?")).unwrap_or_default())]
    Unknown {
        /// What was asked for.
        name: String,
        /// The nearest existing name.
        nearest: Option<&'static str>,
    },
    /// Outside the range, or not a whole number where one is needed.
    #[error("{name} = {value}{0} is outside {least} to {greatest}{0}{1}", space_unit(.unit), if *.whole { " or not a whole number" } else { "" })]
    Range {
        /// Name of the setting, as given.
        name: String,
        /// The number that was refused.
        value: f64,
        /// Unit of the value and the range.
        unit: &'static str,
        /// Least value accepted, itself included.
        least: f64,
        /// Greatest value accepted, itself included.
        greatest: f64,
        /// Whether only whole numbers are accepted.
        whole: bool,
    },
    /// Two settings contradict each other, or a table is unusable.
    #[error("{0}")]
    Contradiction(String),
}

macro_rules! settings {
    ($($name:ident $unit:literal $least:literal $greatest:literal $default:literal $whole:literal $en:literal)*) => {
        /// Every tolerance and length, checked against its range when set. See [`SETTINGS`].
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct Settings {
            $(#[doc = $en] pub(super) $name: f64,)*
            pub(super) of_stage: [[Option<f64>; STAGES]; OF_STAGE.len()],
            pub(super) no_load_table: Vec<NoLoadPoint>,
            #[serde(skip)]
            pub(super) load_curves: Option<Arc<LoadCurves>>,
            #[serde(skip)]
            pub(super) places: Vec<PlaceValues>,
        }

        impl Default for Settings {
            fn default() -> Self {
                Self {
                    $($name: $default,)*
                    of_stage: [[None; STAGES]; OF_STAGE.len()],
                    no_load_table: Vec::new(),
                    load_curves: None,
                    places: Vec::new(),
                }
            }
        }

        /// The table of settings.
        pub static SETTINGS: &[Setting] = &[$(Setting {
            name: stringify!($name),
            unit: $unit,
            range: ($least, $greatest),
            default: $default,
            whole: $whole,
            en: $en,
            get: |settings| settings.$name,
            set: |settings, value| settings.$name = value,
        },)*];
    };
}

settings! {
    c1 "1" 0.02 0.5 0.15 false
    "Stationarity: how far the filtered spindle power in a window may spread, relative to its mean (source: 0.15 to 0.25)"
    stationarity_reading "1" 1.0 2.0 1.0 true
    "How c1 is read: 1 = greatest minus least value over the mean, 2 = greatest deviation from the mean over the mean"
    c2_on "1" 0.005 0.5 0.03 false
    "Cutting begins when the spindle power stays above no-load power by this share of it (source: 0.05 to 0.10; noise raises it by itself)"
    c2_off "1" 0.002 0.5 0.02 false
    "Cutting ends when the spindle power stays below no-load power plus this share of it; below c2_on"
    cutting_evidence "1" 2.0 50.0 5.0 false
    "Sum of excesses, in standard deviations of the noise, that begins or ends cutting; one sample counts for a third of it at most"
    window_samples "samples" 5.0 100.0 10.0 true
    "Length of each of the two windows that must agree before the spindle counts as settled"
    filter_samples "samples" 3.0 50.0 5.0 true
    "Length N of the anti-pulse moving average: mean of N samples without the greatest and the least"
    dwell_s "s" 0.0 10.0 0.3 false
    "Least time in idle or cutting before the other may follow"
    spindle_min_rpm "rpm" 0.1 200.0 10.0 false
    "Below this the spindle counts as standing still"
    speed_tolerance "1" 0.002 0.2 0.02 false
    "Speeds closer than this share are the same speed to the no-load table"
    speed_rate_per_s "1/s" 0.01 2.0 0.05 false
    "Relative change of speed per second above which the spindle counts as changing speed"
    feed_min_mm_min "mm/min" 0.0 100.0 0.5 false
    "Above this the feed counts as on"
    feed_debounce_s "s" 0.0 10.0 0.3 false
    "How long the feed must be at rest before it counts as off"
    rapid_feed_mm_min "mm/min" 0.0 200000.0 0.0 false
    "Feed above this counts as rapid traverse even without the rapid flag; 0 = only the flag counts"
    off_power_w "W" 0.1 5000.0 20.0 false
    "Total power below this means the machine is off; meters never read exactly 0"
    reversal_s "s" 0.0 10.0 0.0 false
    "How long a spindle that passes zero speed while the feed is on (tapping) is not yet standing still; delays the end of a spindle run by as much"
    dropout_hold_s "s" 0.0 5.0 0.2 false
    "How long a missing input may last before the state becomes unknown"
    gap_s "s" 0.1 600.0 2.0 false
    "A longer pause between samples, or time running backwards, makes the detector begin anew; what it has learned stays"
    learn_guard_s "s" 0.0 30.0 0.3 false
    "How long the feed must have been off before, and stay off after, power that is learned as no-load power"
    relearn_up_s "s" 0.0 3600.0 10.0 false
    "How long power above the known no-load power must last with the feed off before it replaces it"
    no_load_drift "1" 0.0 0.5 0.04 false
    "How far no-load power drifts as the machine warms up or cools down, one standard deviation, relative; ages what was learned"
    no_load_drift_time_s "s" 10.0 100000.0 600.0 false
    "How long that drift takes, time constant"
    noise_gain_limit "1" 1.0 50.0 3.0 false
    "Extrapolation of the no-load table that amplifies noise more than this is refused"
    power_noise "1" 0.001 0.5 0.02 false
    "Noise of the spindle power, standard deviation relative to no-load power, until it has been measured"
    load_loss_linear "1" -0.5 2.0 0.18 false
    "a0: load loss per watt of cutting power, for gear stages without a value of their own"
    load_loss_quadratic_per_w "1/W" -0.001 0.01 0.0 false
    "a1: growth of the load loss coefficient per watt of cutting power, for gear stages without a value of their own"
    load_loss_speed_rpm "rpm" 0.0 100000.0 0.0 false
    "Spindle speed at which a1 is as given, and goes with 1/n^2 elsewhere (copper losses); 0 = a1 is the same at every speed; for gear stages without a value of their own"
    load_loss_sd "1" 0.0 0.5 0.0 false
    "How well the load loss over cutting power is known at load_loss_sd_at_w, one standard deviation, from commissioning; 0 = not commissioned, then that of drives of this kind (0.12)"
    load_loss_sd_at_w "W" 0.0 100000.0 0.0 false
    "Cutting power at which load_loss_sd holds: there the share that is lost does not depend on a1"
    load_loss_quadratic_sd_per_w "1/W" 0.0 0.01 0.0 false
    "How well a1 is known, one standard deviation, from commissioning"
    load_loss_only_speed_rpm "rpm" 0.0 100000.0 0.0 false
    "Spindle speed of the cuts where all were made at one: at other speeds a1 is doubted; 0 = cuts at several speeds"
    constant_load_target_w "W" 0.0 50000.0 0.0 false
    "Constant load: power to aim at, cutting power or with curves the power they are of; 0 = the spindle load is aimed at"
    constant_load_target_a "A" 0.0 500.0 0.0 false
    "Constant load: spindle current to aim at, with curves of the current"
    constant_load_target_pct "%" 0.0 150.0 0.0 false
    "Constant load: spindle load to aim at, as the controller shows it; 0 = nothing is aimed at"
    constant_load_exponent "1" 0.3 1.5 0.75 false
    "Constant load: power of the feed with which the load grows (0.75 for steel); smaller answers more strongly"
    constant_load_min_pct "%" 1.0 100.0 60.0 false
    "Constant load: least feed override that is asked for"
    constant_load_max_pct "%" 100.0 254.0 100.0 false
    "Constant load: greatest feed override that is asked for; 100 = the feed is never raised"
    constant_load_dead_band_pct "%" 0.0 20.0 2.0 false
    "Constant load and learned load: a correction smaller than this changes nothing"
    constant_load_entry_s "s" 0.0 10.0 0.5 false
    "Constant load: at entry the load is not yet that of the cut; for so long nothing is asked for"
    constant_load_steady_s "s" 0.5 20.0 1.5 false
    "Constant load and learned load: the feed rises only after the load has been steady for so long"
    constant_load_air_share "1" 0.01 0.9 0.1 false
    "Constant load: less than this share of the target is air or a bare touch, and no reason to raise the feed"
    learned_parts "1" 1.0 1000.0 3.0 true
    "Learned load: parts from which the power of each place of a program is learned"
    learned_entry_s "s" 0.0 10.0 0.5 false
    "Learned load: at entry the power is not yet that of the cut; for so long nothing is learned or asked for"
    learned_exponent "1" 0.3 1.5 0.75 false
    "Learned load: power of the feed with which the cutting power grows"
    learned_low_share "1" 0.0 1.0 0.0 false
    "Learned load: below this share of what was learned the feed may rise; 0 = never"
    learned_high_share "1" 1.0 10.0 2.0 false
    "Learned load: above this share of what was learned the feed is lowered"
    learned_min_pct "%" 1.0 100.0 60.0 false
    "Learned load: least feed override that is asked for"
    learned_max_pct "%" 100.0 254.0 100.0 false
    "Learned load: greatest feed override that is asked for"
}

impl Settings {
    /// The value of a setting, also `load_loss_linear_stage_3` and the like.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<f64> {
        match split_stage_suffix(name) {
            Some((base, stage)) => find_place_of_stage(base).and_then(|row| self.value_of_stage(row, stage)),
            None => find_setting(name).map(|setting| (setting.get)(self)),
        }
    }

    /// Sets a value by name. The names of [`SETTINGS`], and those of the load loss with `_stage_N` for one gear stage, as
    /// `load_loss_linear_stage_2`.
    ///
    /// # Errors
    /// An unknown name or a value outside the range; the settings are unchanged then.
    pub fn set_value(&mut self, name: &str, value: f64) -> Result<(), SettingError> {
        let stage = split_stage_suffix(name);
        let base = stage.map_or(name, |(base, _)| base);
        let setting = find_setting(base).ok_or_else(|| report_unknown_setting(name))?;
        setting.check_value(name, value)?;
        match stage {
            Some((base, stage)) => {
                let row = find_place_of_stage(base).ok_or_else(|| report_unknown_setting(name))?;
                self.of_stage[row][stage] = Some(value);
            }
            None => (setting.set)(self, value),
        }
        Ok(())
    }

    /// No-load powers known beforehand for a gear stage, as pairs of speed in rpm and power in W; they replace those
    /// given before for this stage.
    ///
    /// # Errors
    /// A stage above 7, too many points, a speed or power that is not positive and finite.
    pub fn set_no_load_table(&mut self, stage: usize, rpm_and_w: &[(f64, f64)]) -> Result<(), SettingError> {
        let refuse = |text: String| Err(SettingError::Contradiction(text));
        if stage >= STAGES {
            return refuse(format!("gear stage {stage} does not exist; stages are 0 to {}", STAGES - 1));
        }
        if rpm_and_w.len() > SPEEDS_PER_STAGE {
            return refuse(format!("{} no-load speeds; at most {SPEEDS_PER_STAGE} fit", rpm_and_w.len()));
        }
        if let Some((rpm, w)) =
            rpm_and_w.iter().find(|(rpm, w)| !(*rpm > 0.0 && *w > 0.0 && rpm.is_finite() && w.is_finite()))
        {
            return refuse(format!("a no-load power of {w} W at {rpm} rpm: both must be positive"));
        }
        self.no_load_table.retain(|point| point.stage != stage);
        self.no_load_table.extend(rpm_and_w.iter().map(|(rpm, w)| NoLoadPoint { stage, speed_rpm: *rpm, power_w: *w }));
        Ok(())
    }

    /// The curves that constant load follows.
    pub fn set_load_curves(&mut self, curves: LoadCurves) {
        self.load_curves = Some(Arc::new(curves));
    }

    /// Everything that contradicts something else; empty when the settings can be used as they are.
    #[must_use]
    pub fn find_contradictions(&self) -> Vec<SettingError> {
        let mut found = Vec::new();
        if self.c2_off >= self.c2_on {
            let (off, on) = (self.c2_off, self.c2_on);
            found.push(SettingError::Contradiction(format!(
                "c2_off = {off} must be less than c2_on = {on}, or the state chatters between idle and cutting"
            )));
        }
        found
    }
}

impl Setting {
    pub(super) fn check_value(&self, name: &str, value: f64) -> Result<(), SettingError> {
        let (least, greatest) = self.range;
        if value >= least && value <= greatest && !(self.whole && value.fract() != 0.0) {
            return Ok(());
        }
        Err(SettingError::Range { name: name.to_owned(), value, unit: self.unit, least, greatest, whole: self.whole })
    }
}

pub(super) fn find_setting(name: &str) -> Option<&'static Setting> {
    SETTINGS.iter().find(|setting| setting.name == name)
}

pub(super) fn report_unknown_setting(name: &str) -> SettingError {
    let nearest = find_nearest_name(name, SETTINGS.iter().map(|setting| setting.name));
    SettingError::Unknown { name: name.to_owned(), nearest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_default_lies_in_its_range_and_can_be_set_by_name() {
        let mut settings = Settings::default();
        for setting in SETTINGS {
            assert_eq!(settings.set_value(setting.name, setting.default), Ok(()));
            assert_eq!(settings.get(setting.name), Some(setting.default));
            assert!(!setting.en.is_empty() && !setting.unit.is_empty());
        }
        assert_eq!(settings, Settings::default());
        assert!(settings.find_contradictions().is_empty());
    }

    #[test]
    fn a_bad_name_or_value_says_what_was_meant() {
        let mut settings = Settings::default();
        let unknown = settings.set_value("c2_onn", 0.1).expect_err("no such name").to_string();
        assert!(unknown.contains("did you mean c2_on?"), "{unknown}");
        let range = settings.set_value("window_samples", 10.5).expect_err("not whole").to_string();
        assert!(range.contains("5 to 100 samples or not a whole number"), "{range}");
        assert!(settings.set_value("c1", f64::NAN).is_err());
        assert!(settings.set_value("c1_stage_2", 0.1).is_err());
        assert_eq!(settings, Settings::default());
    }

    #[test]
    fn hysteresis_the_wrong_way_round_is_a_contradiction() {
        let mut settings = Settings::default();
        settings.set_value("c2_off", 0.05).expect("in range");
        assert_eq!(settings.find_contradictions().len(), 1);
    }
}
