//! The reasons that hold 100 %, whatever a script asks for.

use super::find_channel;
use super::thread_cycle::ThreadCycle;
use adapter_core::words::{execution, mode, of_channel, operation};
use adapter_core::{Absence, ChannelId, Sample};
use rules::estimators::{Estimates, State};
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

/// The channels that are looked at, and what NC blocks have said about threads.
#[derive(Debug)]
pub(super) struct Interlocks {
    stale_ns: i64,
    mode: Option<ChannelId>,
    execution: Option<ChannelId>,
    feed: Option<ChannelId>,
    speed: Option<ChannelId>,
    alarm: Option<ChannelId>,
    rapid: Option<ChannelId>,
    switches: [(Option<ChannelId>, Hold); 2],
    operation: Option<ChannelId>,
    block: Option<ChannelId>,
    loads: [Option<ChannelId>; 3],
    cycle: ThreadCycle,
}

impl Interlocks {
    pub(super) fn new(stale_ns: i64) -> Self {
        Self {
            stale_ns,
            mode: find_channel("mode"),
            execution: find_channel("execution"),
            feed: find_channel("feed_mm_min"),
            speed: find_channel("spindle_speed_rpm"),
            alarm: find_channel("alarm"),
            rapid: find_channel("rapid"),
            switches: [(find_channel("single_block"), Hold::SingleBlock), (find_channel("dry_run"), Hold::DryRun)],
            operation: find_channel("operation"),
            block: find_channel("block"),
            loads: ["spindle_power_w", "spindle_current_a", "spindle_load_pct"].map(find_channel),
            cycle: ThreadCycle::default(),
        }
    }

    /// The first reason, or none. Called at every tick: it also follows the NC blocks.
    pub(super) fn find_hold(&mut self, sample: &Sample, estimates: &Estimates) -> Option<Hold> {
        if let Some(block) = self.block.and_then(|block| sample.text(block)) {
            self.cycle.follow_block(block);
        }
        self.find_thread_hold(sample)
            .or_else(|| self.find_data_hold(sample))
            .or_else(|| self.find_controller_hold(sample))
            .or_else(|| self.find_motion_hold(sample, estimates))
    }

    /// Threads come first: there a change of the feed spoils the part even when everything else is well.
    fn find_thread_hold(&self, sample: &Sample) -> Option<Hold> {
        let operation = self.operation.and_then(|operation| sample.text(operation)).unwrap_or_default();
        if operation.eq_ignore_ascii_case(operation::THREADING) {
            return Some(Hold::Threading);
        }
        if operation.eq_ignore_ascii_case(operation::TAPPING) {
            return Some(Hold::Tapping);
        }
        self.cycle.hold()
    }

    fn find_data_hold(&self, sample: &Sample) -> Option<Hold> {
        let needed = [self.mode, self.execution, self.feed, self.speed];
        let missing = needed.into_iter().flatten().find_map(|id| self.find_absence(sample, id).map(|why| (id, why)));
        if let Some((id, why)) = missing {
            return Some(Hold::Missing(id, why));
        }
        let switches = self.switches.map(|(id, _)| id);
        let optional = [self.alarm, self.rapid, self.operation].into_iter().chain(switches).flatten();
        let silent = optional.filter_map(|id| self.find_absence(sample, id).map(|why| (id, why)));
        // A controller may not have these at all; one that has them and is silent is another matter.
        let mut silent = silent.filter(|(_, why)| !matches!(why, Absence::NotProvided | Absence::NotSupported));
        if let Some((id, why)) = silent.next() {
            return Some(Hold::Missing(id, why));
        }
        let measured = self.loads.into_iter().flatten().any(|id| self.find_absence(sample, id).is_none());
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
    pub(super) fn between_programs(&self, sample: &Sample, estimates: &Estimates) -> Option<Hold> {
        let needed = [self.mode, self.execution].into_iter().flatten();
        let missing = needed.chain(self.alarm).find_map(|id| self.find_absence(sample, id).map(|why| (id, why)));
        if let Some((id, why)) = missing {
            return Some(Hold::Missing(id, why));
        }
        let rests = [execution::READY, execution::PROGRAM_COMPLETED];
        self.find_mode_hold(sample).or_else(|| {
            match self.execution.and_then(|id| sample.text(id)).unwrap_or_default() {
                _ if estimates.state == State::Unknown => Some(Hold::StateUnknown),
                word if rests.contains(&word) => None,
                execution::FEED_HOLD => Some(Hold::FeedHold),
                word if execution::ALL.contains(&word) => Some(Hold::Running),
                _ => self.execution.map(Hold::UnknownWord),
            }
        })
    }

    /// No alarm, and automatic.
    fn find_mode_hold(&self, sample: &Sample) -> Option<Hold> {
        let text = |id: Option<ChannelId>| id.and_then(|id| sample.text(id)).unwrap_or_default();
        if !text(self.alarm).is_empty() {
            return Some(Hold::Alarm);
        }
        match text(self.mode) {
            mode::AUTOMATIC => None,
            mode::SEMI_AUTOMATIC => Some(Hold::SingleBlock),
            mode::MANUAL_DATA_INPUT => Some(Hold::Mdi),
            mode::MANUAL => Some(Hold::Manual),
            mode::EDIT => Some(Hold::NotAutomatic),
            _ => self.mode.map(Hold::UnknownWord),
        }
    }

    fn find_controller_hold(&self, sample: &Sample) -> Option<Hold> {
        if let Some(hold) = self.find_mode_hold(sample) {
            return Some(hold);
        }
        let text = |id: Option<ChannelId>| id.and_then(|id| sample.text(id)).unwrap_or_default();
        let on = |id: Option<ChannelId>| id.and_then(|id| sample.number(id).ok()).is_some_and(|flag| flag > 0.0);
        if let Some((_, hold)) = self.switches.iter().find(|(id, _)| on(*id)) {
            return Some(*hold);
        }
        match text(self.execution) {
            execution::ACTIVE => None,
            execution::FEED_HOLD => Some(Hold::FeedHold),
            word if execution::ALL.contains(&word) => Some(Hold::NotRunning),
            _ => self.execution.map(Hold::UnknownWord),
        }
    }

    fn find_motion_hold(&self, sample: &Sample, estimates: &Estimates) -> Option<Hold> {
        let rapid = self.rapid.and_then(|id| sample.number(id).ok()).is_some_and(|flag| flag > 0.0);
        match estimates.state {
            State::Unknown => Some(Hold::StateUnknown),
            State::Rapid => Some(Hold::Rapid),
            _ if rapid => Some(Hold::Rapid),
            _ => None,
        }
    }
}
