//! What one tick yields: every quantity with its uncertainty, or the reason why there is none.

use super::basis::StateBasis;
use super::estimate_words::{LoadLossOrigin, NoLoadOrigin, Visibility};
use super::loads::{Figure, Loads};
use super::part::PartFigures;
use adapter_core::clock::TimeNs;
use adapter_core::state::State;
use adapter_core::{Absence, ChannelId};
use std::fmt;

/// A value and one standard deviation, both in the unit that the quantity's name ends in, both finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The expected value, in the unit of the quantity.
    pub value: f64,
    /// One standard deviation, not negative.
    pub sd: f64,
}

/// A value with its uncertainty, or why there is none.
pub type Estimated = Result<Estimate, NoEstimate>;

/// Why there is no estimate. The text is what an operator reads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoEstimate {
    /// No sample has been seen yet.
    NotYet,
    /// An input is missing.
    Input {
        /// The channel that the estimate needs.
        channel: ChannelId,
        /// Why that channel has no value.
        absence: Absence,
    },
    /// The machine is off.
    MachineOff,
    /// The spindle stands still.
    SpindleStopped,
    /// The spindle starts or changes speed; its power also accelerates masses.
    SpeedChanging,
    /// The inputs contradict each other: the meter sees no power while the controller sees the spindle turn.
    Contradiction,
    /// Too few samples since the last change or gap.
    NotSettled,
    /// No no-load power is known near this speed in this gear stage.
    NotLearned,
    /// The speed lies so far outside the learned ones that extrapolation would amplify noise too much.
    Extrapolated {
        /// By how much the noise of the known powers would be amplified; 1: not at all.
        noise_gain: f64,
    },
    /// The load-loss coefficients contradict the measured power (negative discriminant).
    Imbalance,
    /// Nothing measures the load of the spindle, so that cutting cannot be told from moving through the air.
    NoLoadMeasured,
    /// No wear model is known for the tool, the material and the operation of this cut.
    NoModel,
    /// Speed, feed, depth or diameter of the cut are not known.
    CutUnknown,
    /// The cut lies outside those that the model was fitted on.
    OutsideModel,
    /// The wear cannot be seen in the power of this cut.
    NotObservable,
    /// No part, or none of this edge, has been finished yet.
    NoPartYet,
    /// No cut of this edge has a limit of the wear model.
    NoLimit,
    /// Fewer than two edges of this tool have been used up.
    NoLivesYet,
    /// Nothing is being cut.
    NotCutting,
    /// The power lies below the no-load power by more than the uncertainty: braking, or the no-load power is outdated.
    BelowNoLoad,
    /// Neither the feed nor its override is known.
    FeedUnknown,
    /// No load is aimed at.
    NoTarget,
    /// The load that is aimed at is not measured.
    LoadUnknown,
    /// This place of the program has not been watched for enough parts.
    PlaceNotLearned,
    /// The programmed feed is right.
    NothingToChange,
    /// No power was measured.
    PowerUnknown,
    /// The control does not answer, and the meter shows more than the machine takes at rest: it may be doing anything but being off.
    ControlSilent {
        /// What the machine takes, W.
        power_w: f64,
    },
}

impl NoEstimate {
    /// Every word of [`NoEstimate::as_word`].
    pub const WORDS: [&'static str; 27] = [
        "not_yet",
        "input_missing",
        "machine_off",
        "spindle_stopped",
        "speed_changing",
        "contradiction",
        "not_settled",
        "not_learned",
        "extrapolated",
        "imbalance",
        "no_load_measured",
        "no_model",
        "cut_unknown",
        "outside_model",
        "not_observable",
        "no_part_yet",
        "not_cutting",
        "below_no_load",
        "feed_unknown",
        "no_target",
        "load_unknown",
        "place_not_learned",
        "nothing_to_change",
        "power_unknown",
        "control_silent",
        "no_limit",
        "no_lives_yet",
    ];

    /// The word used in `<quantity>_missing` columns, JSON and SQL.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::NotYet => "not_yet",
            Self::Input { .. } => "input_missing",
            Self::MachineOff => "machine_off",
            Self::SpindleStopped => "spindle_stopped",
            Self::SpeedChanging => "speed_changing",
            Self::Contradiction => "contradiction",
            Self::NotSettled => "not_settled",
            Self::NotLearned => "not_learned",
            Self::Extrapolated { .. } => "extrapolated",
            Self::Imbalance => "imbalance",
            Self::NoLoadMeasured => "no_load_measured",
            Self::NoModel => "no_model",
            Self::CutUnknown => "cut_unknown",
            Self::OutsideModel => "outside_model",
            Self::NotObservable => "not_observable",
            Self::NoPartYet => "no_part_yet",
            Self::NotCutting => "not_cutting",
            Self::BelowNoLoad => "below_no_load",
            Self::FeedUnknown => "feed_unknown",
            Self::NoTarget => "no_target",
            Self::LoadUnknown => "load_unknown",
            Self::PlaceNotLearned => "place_not_learned",
            Self::NothingToChange => "nothing_to_change",
            Self::PowerUnknown => "power_unknown",
            Self::ControlSilent { .. } => "control_silent",
            Self::NoLimit => "no_limit",
            Self::NoLivesYet => "no_lives_yet",
        }
    }
}

impl fmt::Display for NoEstimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotYet => f.write_str("no sample yet"),
            Self::Input { channel, absence } => write!(f, "{channel} is missing: {absence}"),
            Self::MachineOff => f.write_str("the machine is off"),
            Self::SpindleStopped => f.write_str("the spindle stands still"),
            Self::SpeedChanging => f.write_str("the spindle is changing speed"),
            Self::Contradiction => {
                f.write_str("the meter sees no power while the controller sees the spindle turn; check the meter")
            }
            Self::NotSettled => f.write_str("too few samples since the last change"),
            Self::NotLearned => f.write_str(
                "no-load power at this speed and gear stage is not known; let the spindle run there without feed",
            ),
            Self::Extrapolated { noise_gain } => write!(
                f,
                "this speed is too far from those learned (noise gain {noise_gain:.1}); let the spindle run here without feed"
            ),
            Self::Imbalance => f.write_str("load-loss coefficients contradict the power; identify them again"),
            Self::NoLoadMeasured => f.write_str(
                "nothing measures the load of the spindle: with the feed on, cutting cannot be told from moving through the air; add \
                 a power meter",
            ),
            Self::NoModel => {
                f.write_str("no wear model for this tool, material and operation; identify tool-wear makes one")
            }
            Self::CutUnknown => {
                f.write_str("depth, diameter, feed or speed of the cut are not known; the operations recipe gives them")
            }
            Self::OutsideModel => f.write_str("the cut lies outside those that the model was fitted on"),
            Self::NotObservable => f.write_str("the wear cannot be seen in the power of this cut"),
            Self::NoPartYet => f.write_str("no part has been finished yet"),
            Self::NoLimit => f.write_str("no cut of this edge has a limit of the wear model"),
            Self::NoLivesYet => f.write_str("fewer than two edges of this tool have been used up"),
            Self::NotCutting => f.write_str("nothing is being cut"),
            Self::BelowNoLoad => f.write_str("power is below no-load power: braking, or no-load power is outdated"),
            Self::FeedUnknown => f.write_str("neither the feed nor its override is known"),
            Self::NoTarget => f.write_str("no load is aimed at"),
            Self::LoadUnknown => f.write_str("the load that is aimed at is not measured"),
            Self::PlaceNotLearned => {
                f.write_str("this place of the program has not been watched for enough parts; the part counter must count them")
            }
            Self::NothingToChange => f.write_str("the programmed feed is right"),
            Self::PowerUnknown => f.write_str("no power was measured"),
            Self::ControlSilent { power_w } => {
                write!(f, "the control does not answer, and the machine draws {power_w:.0} W")
            }
        }
    }
}

/// Everything inferred at one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimates {
    /// Time of the sample that they were inferred from, ns.
    pub at_ns: TimeNs,
    /// What the machine is doing.
    pub state: State,
    /// What the state was inferred from.
    pub basis: StateBasis,
    /// Time of the sample from which on the state has held, ns.
    pub since_ns: TimeNs,
    /// Does the spindle turn? Known also where the state is not; `None` without a speed.
    pub spindle_turns: Option<bool>,
    /// Why the state is unknown, where it is.
    pub unknown_because: Option<NoEstimate>,
    /// Spindle power after the anti-pulse moving average, W.
    pub filtered_power_w: Estimated,
    /// Power the spindle would take at this speed without cutting, W.
    pub no_load_power_w: Estimated,
    /// Power that removes material, W.
    pub cutting_power_w: Estimated,
    /// Additional loss that exists only under load, W.
    pub load_loss_w: Estimated,
    /// What of the standard deviation of the cutting power all cuts on this drive have in common, W: the doubt of its load loss.
    pub cutting_power_common_sd_w: f64,
    /// Was the load loss measured on this drive?
    pub load_loss_origin: LoadLossOrigin,
    /// Least cutting power that stands out of no-load power and noise, W.
    pub visible_cutting_power_w: Estimated,
    /// Cutting power `[Pc]` at which the edge in use would be worn in this cut, W; from the library of wear models.
    pub wear_limit_w: Estimated,
    /// Flank wear of the edge in use after its last part, mm; only with a learned model.
    pub tool_wear_mm: Estimated,
    /// Rise of the cutting power by the wear of the edge in use, at a feed of 0.2 mm/rev, %.
    pub tool_growth_pct: Estimated,
    /// Probability that the edge in use passes its criterion by the end of the next part.
    pub tool_worn_probability: Estimated,
    /// Parts until the edge in use passes its criterion.
    pub tool_parts_left: Estimated,
    /// By how much the material takes more than usual, %: what all tools have in common.
    pub material_level_pct: Estimated,
    /// Parts in a row in which the edge in use took more than its limit in every operation that has one.
    pub tool_limit_parts: Figure,
    /// What the edge in use has cut over what the edges before it had cut when they were changed.
    pub tool_life_share: Figure,
    /// Where the no-load power comes from.
    pub no_load_origin: NoLoadOrigin,
    /// By how much the interpolation amplifies the noise of the learned powers; 0 where there is no no-load power.
    pub noise_gain: f64,
    /// Can cutting be seen?
    pub visibility: Visibility,
    /// Gear stage in force.
    pub gear_stage: u8,
    /// The load beside its target and beside what was learned.
    pub loads: Loads,
    /// The part that was finished last.
    pub part: PartFigures,
}

impl Estimates {
    /// Before the first sample.
    #[must_use]
    pub fn without_samples(at_ns: TimeNs) -> Self {
        Self {
            at_ns,
            state: State::Unknown,
            basis: StateBasis::default(),
            since_ns: at_ns,
            spindle_turns: None,
            unknown_because: Some(NoEstimate::NotYet),
            filtered_power_w: Err(NoEstimate::NotYet),
            no_load_power_w: Err(NoEstimate::NotYet),
            cutting_power_w: Err(NoEstimate::NotYet),
            load_loss_w: Err(NoEstimate::NotYet),
            cutting_power_common_sd_w: 0.0,
            load_loss_origin: LoadLossOrigin::NotCommissioned,
            visible_cutting_power_w: Err(NoEstimate::NotYet),
            wear_limit_w: Err(NoEstimate::NoModel),
            tool_wear_mm: Err(NoEstimate::NoPartYet),
            tool_growth_pct: Err(NoEstimate::NoPartYet),
            tool_worn_probability: Err(NoEstimate::NoPartYet),
            tool_parts_left: Err(NoEstimate::NoPartYet),
            material_level_pct: Err(NoEstimate::NoPartYet),
            tool_limit_parts: Err(NoEstimate::NoModel),
            tool_life_share: Err(NoEstimate::NoPartYet),
            no_load_origin: NoLoadOrigin::None,
            noise_gain: 0.0,
            visibility: Visibility::NotAsked,
            gear_stage: 0,
            loads: Loads::none(NoEstimate::NotYet),
            part: PartFigures::without_parts(),
        }
    }

    /// Every quantity with its name (which ends in the unit), for scripts, storage and HTTP.
    pub fn list_quantities(&self) -> [(&'static str, Estimated); 11] {
        [
            ("filtered_power_w", self.filtered_power_w),
            ("no_load_power_w", self.no_load_power_w),
            ("cutting_power_w", self.cutting_power_w),
            ("load_loss_w", self.load_loss_w),
            ("visible_cutting_power_w", self.visible_cutting_power_w),
            ("wear_limit_w", self.wear_limit_w),
            ("tool_wear_mm", self.tool_wear_mm),
            ("tool_growth_pct", self.tool_growth_pct),
            ("tool_worn_probability", self.tool_worn_probability),
            ("tool_parts_left", self.tool_parts_left),
            ("material_level_pct", self.material_level_pct),
        ]
    }

    /// The cutting power with the deviation that matters where cuts on this drive are compared with each other.
    ///
    /// # Errors
    /// As of the cutting power.
    pub fn comparable_cutting_power(&self) -> Estimated {
        let common_w = self.cutting_power_common_sd_w;
        self.cutting_power_w.map(|it| Estimate { sd: (it.sd * it.sd - common_w * common_w).max(0.0).sqrt(), ..it })
    }

    /// The figure of this name, to be set: of the load, and of the part that was finished last.
    pub fn figure_mut(&mut self, name: &str) -> Option<&mut Figure> {
        match name {
            "tool_limit_parts" => Some(&mut self.tool_limit_parts),
            "tool_life_share" => Some(&mut self.tool_life_share),
            "part_energy_j" => Some(&mut self.part.energy_j),
            "part_cutting_energy_j" => Some(&mut self.part.cutting_energy_j),
            "part_idle_s" => Some(&mut self.part.idle_s),
            _ => self.loads.figure_mut(name),
        }
    }
}
