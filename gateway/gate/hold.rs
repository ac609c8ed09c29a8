//! The reasons that hold 100 %, whatever a script asks for.

use super::thread_cycle::{Cycle, ThreadCycle};
use adapter_core::state::State;
use adapter_core::words::{execution, mode, of_channel, operation};
use adapter_core::{Absence, ChannelId, Sample};
use std::fmt;

/// Why 100 % is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// The configuration says `mode = "off"`.
    Off,
    /// A value that the decision needs is missing or too old.
    Missing(ChannelId, Absence),
    /// Neither power, nor current, nor load of the spindle is measured: only estimates would speak for the request.
    OnlyEstimated,
    /// The state of the machine is unknown.
    StateUnknown,
    /// The controller shows an alarm.
    Alarm,
    /// The controller is in handwheel, jog or reference mode.
    Manual,
    /// Single commands typed in.
    Mdi,
    /// One block at a time.
    SingleBlock,
    /// The program is tried out without cutting: the feed is not the programmed one.
    DryRun,
    /// The controller is in another mode than automatic.
    NotAutomatic,
    /// The source gives this channel a word that it cannot have: what the machine does is not known.
    UnknownWord(ChannelId),
    /// Feed hold was pressed.
    FeedHold,
    /// No program runs at the controller.
    NotRunning,
    /// A program runs or stands in the middle, which matters to offsets only.
    Running,
    /// The machine moves in rapid traverse.
    Rapid,
    /// A thread is cut: the feed follows the spindle.
    Threading,
    /// A thread is tapped: the feed follows the spindle.
    Tapping,
}

impl Hold {
    /// The reason in Chinese.
    #[must_use]
    pub fn describe_in_chinese(self) -> String {
        let fixed = match self {
            Self::Missing(channel, absence) => return format!("{} 无有效数据（{absence}）", channel.channel().zh),
            Self::UnknownWord(channel) => {
                let words = of_channel(channel.name()).unwrap_or_default().join("、");
                return format!("{}的文字不是{words}之一", channel.channel().zh);
            }
            Self::Off => "闸门关闭",
            Self::OnlyEstimated => "主轴功率、电流、负载均无实测值",
            Self::StateUnknown => "机床状态未知",
            Self::Alarm => "数控系统报警",
            Self::Manual => "手动方式",
            Self::Mdi => "MDI 方式",
            Self::SingleBlock => "单段方式",
            Self::DryRun => "空运行",
            Self::NotAutomatic => "非自动方式",
            Self::FeedHold => "进给保持",
            Self::NotRunning => "程序未运行",
            Self::Running => "程序运行中",
            Self::Rapid => "快速移动",
            Self::Threading => "螺纹切削",
            Self::Tapping => "攻丝",
        };
        fixed.to_owned()
    }
}

impl fmt::Display for Hold {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Missing(channel, absence) => return write!(f, "{channel} has no fresh value ({absence})"),
            Self::UnknownWord(channel) => {
                let words = of_channel(channel.name()).unwrap_or_default().join(", ");
                return write!(f, "{channel} has a word that is none of {words}: what the machine does is not known");
            }
            Self::Off => "the gate is off",
            Self::OnlyEstimated => "no power, current or load of the spindle is measured",
            Self::StateUnknown => "the state of the machine is unknown",
            Self::Alarm => "the controller shows an alarm",
            Self::Manual => "the controller is in a manual mode",
            Self::Mdi => "the controller is in MDI",
            Self::SingleBlock => "single block",
            Self::DryRun => "dry run",
            Self::NotAutomatic => "the controller is not in automatic",
            Self::FeedHold => "feed hold",
            Self::NotRunning => "no program runs",
            Self::Running => "a program runs or stands in the middle",
            Self::Rapid => "rapid traverse",
            Self::Threading => "a thread is being cut",
            Self::Tapping => "a thread is being tapped",
        })
    }
}

const MODE: ChannelId = ChannelId::find_constant("mode");
pub(super) const EXECUTION: ChannelId = ChannelId::find_constant("execution");
const FEED: ChannelId = ChannelId::find_constant("feed_mm_min");
const SPEED: ChannelId = ChannelId::find_constant("spindle_speed_rpm");
const ALARM: ChannelId = ChannelId::find_constant("alarm");
const RAPID: ChannelId = ChannelId::find_constant("rapid");
const SINGLE_BLOCK: ChannelId = ChannelId::find_constant("single_block");
const DRY_RUN: ChannelId = ChannelId::find_constant("dry_run");
const OPERATION: ChannelId = ChannelId::find_constant("operation");
const BLOCK: ChannelId = ChannelId::find_constant("block");

/// What a decision needs to know of the machine that is written to: only that machine itself can tell it.
pub const EVIDENCE: [ChannelId; 10] =
    [MODE, EXECUTION, FEED, SPEED, ALARM, RAPID, SINGLE_BLOCK, DRY_RUN, OPERATION, BLOCK];

/// Without a fresh value of each of these nothing is known of the machine.
const NEEDED: [ChannelId; 4] = [MODE, EXECUTION, FEED, SPEED];
/// A controller may not have these at all; one that has them and is silent is another matter.
const OPTIONAL: [ChannelId; 5] = [ALARM, RAPID, OPERATION, SINGLE_BLOCK, DRY_RUN];
/// One of these has to be measured.
const LOADS: [ChannelId; 3] = [
    ChannelId::find_constant("spindle_power_w"),
    ChannelId::find_constant("spindle_current_a"),
    ChannelId::find_constant("spindle_load_pct"),
];
/// Switches of the operator that hold while they are on.
const SWITCHES: [(ChannelId, Hold); 2] = [(SINGLE_BLOCK, Hold::SingleBlock), (DRY_RUN, Hold::DryRun)];

/// What NC blocks have said about threads, and how old a value may be. The channels are constants: one that the table does not have
/// does not compile, so no interlock can lose its channel.
#[derive(Debug)]
pub(super) struct Interlocks {
    stale_ns: i64,
    cycle: ThreadCycle,
}

impl Interlocks {
    pub(super) fn new(stale_ns: i64) -> Self {
        Self { stale_ns, cycle: ThreadCycle::default() }
    }

    /// The first reason, or none. Called at every tick: it also follows the NC blocks.
    pub(super) fn find_hold(&mut self, sample: &Sample, state: State) -> Option<Hold> {
        if let Some(block) = sample.text(BLOCK) {
            self.cycle.follow_block(block);
        }
        self.find_thread_hold(sample)
            .or_else(|| self.find_data_hold(sample))
            .or_else(|| self.find_controller_hold(sample))
            .or_else(|| self.find_motion_hold(sample, state))
    }

    /// Threads come first: there a change of the feed spoils the part even when everything else is well.
    fn find_thread_hold(&self, sample: &Sample) -> Option<Hold> {
        let operation = sample.text(OPERATION).unwrap_or_default();
        if operation.eq_ignore_ascii_case(operation::THREADING) {
            return Some(Hold::Threading);
        }
        if operation.eq_ignore_ascii_case(operation::TAPPING) {
            return Some(Hold::Tapping);
        }
        self.cycle.active_cycle().map(|cycle| match cycle {
            Cycle::Threading => Hold::Threading,
            Cycle::Tapping => Hold::Tapping,
        })
    }

    fn find_data_hold(&self, sample: &Sample) -> Option<Hold> {
        let find_missing = |id| self.find_absence(sample, id).map(|why| (id, why));
        if let Some((id, why)) = NEEDED.into_iter().find_map(find_missing) {
            return Some(Hold::Missing(id, why));
        }
        let silent = OPTIONAL.into_iter().filter_map(find_missing);
        let mut silent = silent.filter(|(_, why)| !matches!(why, Absence::NotProvided | Absence::NotSupported));
        if let Some((id, why)) = silent.next() {
            return Some(Hold::Missing(id, why));
        }
        let measured = LOADS.into_iter().any(|id| self.find_absence(sample, id).is_none());
        (!measured).then_some(Hold::OnlyEstimated)
    }

    /// Why there is no fresh value.
    fn find_absence(&self, sample: &Sample, id: ChannelId) -> Option<Absence> {
        let slot = sample.slot(id);
        match &slot.value {
            Err(why) => Some(*why),
            Ok(_) if slot.age_ns > self.stale_ns || slot.age_ns < 0 => Some(Absence::Stale),
            Ok(_) => None,
        }
    }

    /// The number in this channel, unless it is too old.
    pub(super) fn fresh_number(&self, sample: &Sample, id: ChannelId) -> Option<f64> {
        self.find_absence(sample, id).is_none().then(|| sample.number(id).ok())?
    }

    /// What stands in the way of moving an offset; nothing between two programs. Call it after [`Interlocks::find_hold`].
    pub(super) fn between_programs(&self, sample: &Sample, state: State) -> Option<Hold> {
        let needed = [MODE, EXECUTION, ALARM];
        let missing = needed.into_iter().find_map(|id| self.find_absence(sample, id).map(|why| (id, why)));
        if let Some((id, why)) = missing {
            return Some(Hold::Missing(id, why));
        }
        let rests = [execution::READY, execution::PROGRAM_COMPLETED];
        self.find_mode_hold(sample).or_else(|| match sample.text(EXECUTION).unwrap_or_default() {
            _ if state == State::Unknown => Some(Hold::StateUnknown),
            word if rests.contains(&word) => None,
            execution::FEED_HOLD => Some(Hold::FeedHold),
            word if execution::ALL.contains(&word) => Some(Hold::Running),
            _ => Some(Hold::UnknownWord(EXECUTION)),
        })
    }

    /// No alarm, and automatic.
    fn find_mode_hold(&self, sample: &Sample) -> Option<Hold> {
        if !sample.text(ALARM).unwrap_or_default().is_empty() {
            return Some(Hold::Alarm);
        }
        match sample.text(MODE).unwrap_or_default() {
            mode::AUTOMATIC => None,
            mode::SEMI_AUTOMATIC => Some(Hold::SingleBlock),
            mode::MANUAL_DATA_INPUT => Some(Hold::Mdi),
            mode::MANUAL => Some(Hold::Manual),
            mode::EDIT => Some(Hold::NotAutomatic),
            _ => Some(Hold::UnknownWord(MODE)),
        }
    }

    fn find_controller_hold(&self, sample: &Sample) -> Option<Hold> {
        if let Some(hold) = self.find_mode_hold(sample) {
            return Some(hold);
        }
        let is_on = |id: ChannelId| sample.number(id).is_ok_and(|flag| flag > 0.0);
        if let Some((_, hold)) = SWITCHES.into_iter().find(|(id, _)| is_on(*id)) {
            return Some(hold);
        }
        match sample.text(EXECUTION).unwrap_or_default() {
            execution::ACTIVE => None,
            execution::FEED_HOLD => Some(Hold::FeedHold),
            word if execution::ALL.contains(&word) => Some(Hold::NotRunning),
            _ => Some(Hold::UnknownWord(EXECUTION)),
        }
    }

    fn find_motion_hold(&self, sample: &Sample, state: State) -> Option<Hold> {
        let rapid = sample.number(RAPID).is_ok_and(|flag| flag > 0.0);
        match state {
            State::Unknown => Some(Hold::StateUnknown),
            State::Rapid => Some(Hold::Rapid),
            _ if rapid => Some(Hold::Rapid),
            _ => None,
        }
    }
}
