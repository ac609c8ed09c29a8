//! The settings of the laws, for the tool and the operation of the moment.

use super::curves::LoadCurves;
use super::follower::OverrideRange;
use super::last_multiples::count_sure_samples;
use super::load_inputs::LoadChannels;
use crate::settings::Settings;
use crate::signals::to_window_length;
use adapter_core::{Sample, is_same_text};
use std::sync::Arc;

/// Work that takes more than was learned is no emergency; a disturbed reading of a meter with 5 Hz stands for 0.4 s in the filtered
/// power.
const LEARNED_SURE_S: f64 = 0.6;

/// Settings of constant load.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ConstantLimits {
    /// Target of the cutting power, or of the power that the curves are of, W; 0: the spindle load is aimed at.
    pub(super) target_w: f64,
    pub(super) target_a: f64,
    pub(super) target_pct: f64,
    pub(super) exponent: f64,
    pub(super) range: OverrideRange,
    pub(super) entry_s: f64,
    pub(super) air_share: f64,
    pub(super) curves: Option<Arc<LoadCurves>>,
}

/// Settings of the learned load.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LearnedLimits {
    pub(super) parts: f64,
    pub(super) entry_s: f64,
    pub(super) exponent: f64,
    pub(super) low_share: f64,
    pub(super) high_share: f64,
    pub(super) range: OverrideRange,
    /// A multiple of the learned power must last for so many samples.
    pub(super) sure_samples: usize,
}

/// All of them, and what they are of.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LoadSettings {
    tool: Option<Arc<str>>,
    operation: Option<Arc<str>>,
    pub(super) constant: ConstantLimits,
    pub(super) learned: LearnedLimits,
}

impl LoadSettings {
    pub(super) fn from_settings(settings: &Settings, sample: &Sample, channels: &LoadChannels) -> Self {
        let (tool, operation) = (sample.shared_text(channels.tool), sample.shared_text(channels.operation));
        let own;
        let settings = if settings.has_places() {
            own = settings.resolve_for_place(tool.map_or("", |tool| tool), operation.map_or("", |operation| operation));
            &own
        } else {
            settings
        };
        let constant = ConstantLimits {
            target_w: settings.constant_load_target_w,
            target_a: settings.constant_load_target_a,
            target_pct: settings.constant_load_target_pct,
            exponent: settings.constant_load_exponent,
            range: OverrideRange {
                min_pct: settings.constant_load_min_pct,
                max_pct: settings.constant_load_max_pct,
                dead_band_pct: settings.constant_load_dead_band_pct,
                steady_s: settings.constant_load_steady_s,
                sure_s: 0.0,
            },
            entry_s: settings.constant_load_entry_s,
            air_share: settings.constant_load_air_share,
            curves: settings.load_curves.clone(),
        };
        let learned = LearnedLimits {
            parts: settings.learned_parts,
            entry_s: settings.learned_entry_s,
            exponent: settings.learned_exponent,
            low_share: settings.learned_low_share,
            high_share: settings.learned_high_share,
            range: OverrideRange {
                min_pct: settings.learned_min_pct,
                max_pct: settings.learned_max_pct,
                dead_band_pct: settings.constant_load_dead_band_pct,
                steady_s: settings.constant_load_steady_s,
                sure_s: LEARNED_SURE_S,
            },
            sure_samples: count_sure_samples(to_window_length(settings.filter_samples)),
        };
        Self { tool: tool.cloned(), operation: operation.cloned(), constant, learned }
    }

    /// Do they hold for this sample?
    pub(super) fn applies_to_sample(&self, sample: &Sample, channels: &LoadChannels) -> bool {
        is_same_text(self.tool.as_ref(), sample.shared_text(channels.tool))
            && is_same_text(self.operation.as_ref(), sample.shared_text(channels.operation))
    }
}
