//! The load of a cut beside what it should be: a target (constant load), or what this place of the program took in the first
//! parts (learned load); and the feed override that would bring the one to the other.
//!
//! What counts is what is in force at the machine. A load is compared at the feed that the axes have, and "at the least feed" means
//! that the machine goes at the least feed, not that somebody has asked for it.
//!
//! | file | what |
//! |---|---|
//! | `load_inputs` | the channels, and the feed override in force |
//! | `follower` | from a load to an override: down at once, up only from a steady load |
//! | `limits` | the settings of a law |
//! | `curves` | learned curves of the load over the feed, and what they are of |
//! | `constant_load` | constant load |
//! | `place`, `learned_load` | the load of each place of a program, learned from the first parts |
//! | `part_at_place` | what one part does at a place: path in the cut and through the air, coolant |
//! | `tool_fall`, `fall_chain` | a tool that suddenly takes less than it did: an insert that is missing |

mod constant_load;
mod curves;
mod fall_chain;
mod follower;
mod last_multiples;
mod learned_load;
mod limits;
mod load_inputs;
mod part_at_place;
mod place;
mod tool_fall;

#[cfg(test)]
mod tests;

pub use curves::{LoadCurves, LoadCurvesError};
pub use tool_fall::PLACES_MAX;

use super::estimate::{Estimates, NoEstimate};
use super::settings::Settings;
use adapter_core::Sample;
use adapter_core::clock::TimeNs;
use constant_load::ConstantLoad;
use learned_load::LearnedLoad;
use limits::LoadSettings;
use load_inputs::LoadChannels;
use serde::{Deserialize, Serialize};

/// A number, or why there is none.
pub type Figure = Result<f64, NoEstimate>;

/// What is known of the load at one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loads {
    /// Feed override in force at the machine, percent of the programmed feed.
    pub feed_in_force_pct: Figure,
    /// Load over the target of constant load, as it is.
    pub load_share: Figure,
    /// Feed override that brings the load to the target; only in a cut, and only where it is another one than 100 %.
    pub load_override_pct: Figure,
    /// Why constant load does not raise the feed; empty where nothing is in the way.
    pub load_held: &'static str,
    /// Cutting power that this place of the program took in the first parts, at the feed in force, W.
    pub learned_power_w: Figure,
    /// Half width of the band in which unchanged parts vary about it, W.
    pub learned_band_w: Figure,
    /// Greatest cutting power of the first parts at this place, W.
    pub learned_peak_w: Figure,
    /// Cutting power beyond its doubt over the greatest of the first parts at this place; only in a cut that is under way there.
    pub learned_multiple: Figure,
    /// Path that this part has fed through the air at this place beyond what the first parts did, over what says that the cut is missing
    /// (half of the cut, and at most 5 s): from 1 on it is.
    pub learned_air_share: Figure,
    /// Share of the time in the cut at this place in which the coolant ran in the first parts.
    pub learned_coolant_share: Figure,
    /// By how much the tool in use has suddenly come to take less power, as a share; 0 where it has not.
    pub learned_fall_share: Figure,
    /// The least such fall that would be seen of the tool in use, as a share.
    pub learned_visible_fall_share: Figure,
    /// Feed override that brings the power back into the learned band; only in a cut, and only where it is outside.
    pub learned_override_pct: Figure,
}

impl Loads {
    /// Nothing is known, for this reason.
    #[must_use]
    pub fn none(reason: NoEstimate) -> Self {
        Self {
            feed_in_force_pct: Err(reason),
            load_share: Err(reason),
            load_override_pct: Err(reason),
            load_held: "",
            learned_power_w: Err(reason),
            learned_band_w: Err(reason),
            learned_peak_w: Err(reason),
            learned_multiple: Err(reason),
            learned_air_share: Err(reason),
            learned_coolant_share: Err(reason),
            learned_fall_share: Err(reason),
            learned_visible_fall_share: Err(reason),
            learned_override_pct: Err(reason),
        }
    }

    /// The figure of this name, to be set.
    pub fn figure_mut(&mut self, name: &str) -> Option<&mut Figure> {
        match name {
            "feed_in_force_pct" => Some(&mut self.feed_in_force_pct),
            "load_share" => Some(&mut self.load_share),
            "load_override_pct" => Some(&mut self.load_override_pct),
            "learned_power_w" => Some(&mut self.learned_power_w),
            "learned_band_w" => Some(&mut self.learned_band_w),
            "learned_peak_w" => Some(&mut self.learned_peak_w),
            "learned_multiple" => Some(&mut self.learned_multiple),
            "learned_air_share" => Some(&mut self.learned_air_share),
            "learned_coolant_share" => Some(&mut self.learned_coolant_share),
            "learned_fall_share" => Some(&mut self.learned_fall_share),
            "learned_visible_fall_share" => Some(&mut self.learned_visible_fall_share),
            "learned_override_pct" => Some(&mut self.learned_override_pct),
            _ => None,
        }
    }
}

/// Follows the load. What it has learned of the places outlives the process; everything else begins anew with the next cut.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LoadEstimator {
    learned: LearnedLoad,
    #[serde(skip)]
    constant: ConstantLoad,
    #[serde(skip)]
    channels: LoadChannels,
    #[serde(skip)]
    in_force: Option<LoadSettings>,
    #[serde(skip)]
    last_ns: Option<TimeNs>,
}

impl LoadEstimator {
    /// Other settings are in force.
    pub fn reconfigure(&mut self) {
        self.in_force = None;
    }

    /// Everything that was learned of this program is learned anew.
    pub fn learn_anew(&mut self, program: &str) {
        self.learned.forget_program(program);
    }

    /// Takes one tick: after state and cutting power are known, fills in what is known of the load.
    pub fn step(&mut self, sample: &Sample, estimates: &mut Estimates, settings: &Settings) {
        let moment = self.channels.read_moment(sample, estimates, self.last_ns.replace(sample.at_ns));
        let known = self.in_force.take().filter(|known| known.applies_to_sample(sample, &self.channels));
        let limits = known.unwrap_or_else(|| LoadSettings::from_settings(settings, sample, &self.channels));
        let mut loads = Loads::none(NoEstimate::NotCutting);
        loads.feed_in_force_pct = moment.in_force_pct.ok_or(NoEstimate::FeedUnknown);
        self.constant.update_loads(&moment, &limits.constant, &mut loads);
        self.learned.update_loads(&moment, sample, &self.channels, &limits.learned, &mut loads);
        self.in_force = Some(limits);
        estimates.loads = loads;
    }
}
