//! What the state of the machine is inferred from, where spindle power is not measured.
//!
//! A controller without a power meter still knows the speed, the feed and, mostly, the load meter of the spindle drive. The load
//! meter follows power (or, below the base speed, torque) in whole percent of the rating. Each speed is compared with its own
//! no-load value, so that the unit does not matter to the state; the resolution does. What a percent is in watts is on the
//! nameplate and not in the control: quantities in watts have no value then.

use adapter_core::{Absence, ChannelId, Sample};
use std::fmt;

/// What stands for spindle power.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StateBasis {
    /// Spindle power, as a meter or the drive tells it.
    #[default]
    SpindlePower,
    /// Power of the whole machine above its standby power.
    TotalPower,
    /// The load meter of the spindle drive.
    SpindleLoad,
    /// Current of the spindle drive, A.
    SpindleCurrent,
    /// Speed and feed alone: cutting cannot be told from moving through the air.
    Motion,
}

/// Channels in the order in which they are preferred.
const CHANNELS: [(&str, StateBasis); 4] = [
    ("spindle_power_w", StateBasis::SpindlePower),
    ("total_power_w", StateBasis::TotalPower),
    ("spindle_load_pct", StateBasis::SpindleLoad),
    ("spindle_current_a", StateBasis::SpindleCurrent),
];

/// A stand-in counts in such parts: 100 of them are the rating of the drive or 100 A. The thresholds of the detector are relative,
/// so that only the order of magnitude matters.
const PARTS: f64 = 100.0;

/// What a load meter resolves, percent. Controls show whole percent.
const LOAD_RESOLUTION_PCT: f64 = 1.0;

impl StateBasis {
    /// Every basis, the best one first.
    pub const ALL: [Self; 5] =
        [Self::SpindlePower, Self::TotalPower, Self::SpindleLoad, Self::SpindleCurrent, Self::Motion];

    /// The best basis among these channels.
    #[must_use]
    pub fn of_channels(provided: impl Fn(ChannelId) -> bool) -> Self {
        let found = CHANNELS.into_iter().find(|(name, _)| ChannelId::from_name(name).is_some_and(&provided));
        found.map_or(Self::Motion, |(_, basis)| basis)
    }

    /// The best basis among the channels that a sample has; one whose source is silent at the moment is there all the same.
    #[must_use]
    pub fn from_sample(sample: &Sample) -> Self {
        Self::of_channels(|id| !matches!(sample.slot(id).value, Err(Absence::NotProvided | Absence::NotSupported)))
    }

    /// The word in JSON and on the page.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::SpindlePower => "spindle_power",
            Self::TotalPower => "total_power",
            Self::SpindleLoad => "spindle_load",
            Self::SpindleCurrent => "spindle_current",
            Self::Motion => "motion",
        }
    }

    /// The channel that stands for spindle power, and how many of the detector's units one of its own is.
    pub(super) fn stand_in(self) -> Option<(&'static str, f64)> {
        match self {
            Self::SpindleLoad => Some(("spindle_load_pct", PARTS)),
            Self::SpindleCurrent => Some(("spindle_current_a", PARTS)),
            Self::SpindlePower | Self::TotalPower | Self::Motion => None,
        }
    }

    /// Are the quantities in watts true?
    #[must_use]
    pub fn in_watts(self) -> bool {
        matches!(self, Self::SpindlePower | Self::TotalPower)
    }

    /// Smallest difference that the basis can show, in the units of [`Self::stand_in`]; 0 where noise is coarser.
    pub(super) fn resolution(self) -> f64 {
        if self == Self::SpindleLoad { LOAD_RESOLUTION_PCT * PARTS } else { 0.0 }
    }

    /// What it means for whoever relies on the state, in Chinese.
    #[must_use]
    pub fn describe_in_chinese(self) -> &'static str {
        match self {
            Self::SpindlePower => "机床状态由主轴功率推断",
            Self::TotalPower => "机床状态由总功率推断：其他用电设备会造成干扰",
            Self::SpindleLoad => "机床状态由主轴负载表推断：低于额定值约 2 % 的切削不可见，无切削功率与磨损",
            Self::SpindleCurrent => "机床状态由主轴电流推断：轻切削不可见，无切削功率与磨损",
            Self::Motion => "无任何负载测量：无法区分切削与空走，闸门不放行倍率",
        }
    }
}

impl fmt::Display for StateBasis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::SpindlePower => "the state follows from spindle power",
            Self::TotalPower => "the state follows from the power of the whole machine; other consumers disturb it",
            Self::SpindleLoad => {
                "the state follows from the load meter of the spindle: a cut of less than about 2 % of the rating is not seen, \
                 and there is no cutting power and no wear; a power meter, or power_diagnosis= in a fanuc:// address, gives them"
            }
            Self::SpindleCurrent => {
                "the state follows from the spindle current: a light cut is not seen, and there is no cutting power and no wear; a \
                 power meter gives them"
            }
            Self::Motion => {
                "nothing measures the load of the spindle: cutting cannot be told from moving through the air, and no override is \
                 let through; add a power meter"
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::{Slot, Value};

    #[test]
    fn the_best_channel_that_is_there_counts_and_a_silent_one_is_there() {
        let mut sample = Sample::new_empty(0);
        assert_eq!(StateBasis::from_sample(&sample), StateBasis::Motion);
        let mut add = |name: &str, value| {
            sample.set_slot(ChannelId::from_name(name).expect("in the table"), Slot { value, age_ns: 0 });
            StateBasis::from_sample(&sample)
        };
        assert_eq!(add("spindle_current_a", Ok(Value::Number(3.0))), StateBasis::SpindleCurrent);
        assert_eq!(add("spindle_load_pct", Ok(Value::Number(3.0))), StateBasis::SpindleLoad);
        assert_eq!(add("spindle_power_w", Err(Absence::NotSupported)), StateBasis::SpindleLoad);
        assert_eq!(add("spindle_power_w", Err(Absence::Timeout)), StateBasis::SpindlePower);
        for basis in StateBasis::ALL {
            assert!(
                !basis.to_string().is_empty() && !basis.describe_in_chinese().is_empty() && !basis.as_word().is_empty()
            );
        }
    }
}
