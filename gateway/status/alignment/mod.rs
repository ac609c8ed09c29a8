//! One time base while the box runs: how late each power meter is against the controller, shown and, where the
//! configuration says so, taken into account by the merge.
//!
//! Readings are seen on their way to the merge with the stamps of their sources. Changes of spindle speed are gathered
//! (`rules::estimators::alignment`), never with power from while the machine cuts or may: that is known from the state of
//! the estimators, a little later than the readings, which is why a change is only used some seconds after it. An estimate
//! takes longer than a tick may and is made on a thread of its own, one at a time, at most one a minute for each meter, and
//! one in ten minutes once it is known.
//!
//! What is found is shown with its width, or with the reason why it cannot be known. With `merge` in `[alignment]` the stamps of
//! the meter's source are shifted by it: only by a lag that is known, slowly, and standing still while the machine cuts;
//! what is aimed at is told as an event. Every new change of speed is asked whether it still has that lag: two in a row that say
//! another one make it unknown until it is found anew. A lag that can no longer be known changes nothing that is in force.
//!
//! | file | what |
//! |---|---|
//! | `pair` | a controller and a meter: what is gathered, what is known, what is in force |
//! | `background` | the thread that estimates |
//! | `delay_status` | what of it is shown and stored |
//!
//! **Deterministic where time is simulated.** With `--speed` the answer of an estimate is waited for and taken at a fixed
//! time after it was asked for, so that the same readings give the same samples. Against the clock it is taken when it has
//! come, not before that time.
//!
//! Which sources: the first that delivers the spindle speed, and for each of the two powers the first that delivers it,
//! where that is another source; a meter that delivers both is aligned by the spindle's power.

mod background;
mod delay_status;
mod pair;

pub use background::Patience;
pub use delay_status::{AlignmentStatus, SERIES, list_series};

use adapter_core::clock::{SECOND_NS, TimeNs};
use adapter_core::merge::{Merge, SourceId, SourcePlan};
use adapter_core::{ChannelId, Reading};
use background::Background;
use gateway_base::log::{Notice, Severity};
use gateway_config::{self as config, AlignmentUse};
use gateway_history::ExtraValue;
use pair::Pair;
use rules::estimators::State;

/// The powers that are aligned; the first one that a meter delivers stands for all it delivers.
const POWERS: [&str; 2] = ["spindle_power_w", "total_power_w"];
const SPEED: &str = "spindle_speed_rpm";

/// Estimates how late each power meter is against the controller, and gives the merge what it puts back.
pub struct Alignment {
    pairs: Vec<Pair>,
    background: Background,
    cutting: bool,
    origin_ns: Option<TimeNs>,
    last_ns: Option<TimeNs>,
    notices: Vec<Notice>,
}

impl Alignment {
    /// Of these sources, in the order of the merge.
    #[must_use]
    pub fn from_plans(plans: &[SourcePlan], config: &config::AlignmentConfig, patience: Patience) -> Self {
        let first = |channel: ChannelId| plans.iter().position(|plan| plan.channels.contains(&channel));
        let mut pairs: Vec<Pair> = Vec::new();
        for (name, purpose) in POWERS.into_iter().zip([config.spindle_power, config.total_power]) {
            let (Some(speed), Some(power)) = (ChannelId::from_name(SPEED), ChannelId::from_name(name)) else {
                continue;
            };
            let (Some(controller), Some(meter)) = (first(speed), first(power)) else { continue };
            let taken = pairs.iter().any(|pair| pair.meter == SourceId(meter));
            if controller != meter && !taken && purpose != AlignmentUse::Off {
                let names = [plans[controller].name.clone(), plans[meter].name.clone()];
                pairs.push(Pair::new([SourceId(controller), SourceId(meter)], [speed, power], names, purpose));
            }
        }
        let background = Background::new(patience);
        Self { pairs, background, cutting: true, origin_ns: None, last_ns: None, notices: Vec::new() }
    }

    /// Looks at a poll on its way to the merge; `None`: it failed.
    pub fn observe_readings(&mut self, source: SourceId, readings: Option<&[Reading]>) {
        let origin_ns = &mut self.origin_ns;
        for pair in &mut self.pairs {
            pair.observe_readings(source, readings, |at_ns| seconds_since(at_ns, *origin_ns.get_or_insert(at_ns)));
        }
    }

    /// What the machine did at a time of the merge's; told after every tick. Where the state is not known it may have cut.
    pub fn record_state(&mut self, at_ns: TimeNs, state: State) {
        self.cutting = matches!(state, State::Cutting | State::Unknown);
        if let Some(origin_ns) = self.origin_ns.filter(|_| self.cutting) {
            self.pairs.iter_mut().for_each(|pair| pair.collector.record_cutting(seconds_since(at_ns, origin_ns)));
        }
    }

    /// Once per tick, before the merge is asked: takes answers, asks for new ones, and tells the merge the lags in force.
    pub fn update_lags(&mut self, now_ns: TimeNs, merge: &mut Merge) {
        let passed_s = self.last_ns.replace(now_ns).map_or(0.0, |last_ns| seconds_since(now_ns, last_ns));
        let Some(origin_ns) = self.origin_ns else { return };
        for (index, pair) in self.pairs.iter_mut().enumerate() {
            if let Some(found) = self.background.take_estimate(index, now_ns) {
                let change = pair.accept_estimate(found, now_ns, seconds_since(now_ns, origin_ns));
                self.notices.extend(change.map(|change| Notice::new(Severity::Info, change.0, change.1)));
            }
            let change = pair.check_newest_change(now_ns);
            self.notices.extend(change.map(|change| Notice::new(Severity::Info, change.0, change.1)));
            if pair.is_due(now_ns) && self.background.is_idle() && pair.collector.take_gathered_data().new {
                self.background.request_estimate(index, pair.collector.transients().to_vec(), now_ns);
            }
            if pair.is_for_merge() {
                merge.set_lag_ns(pair.meter, to_nanoseconds(pair.follower.step_lag(passed_s, self.cutting)));
            }
        }
    }

    /// What has happened since it was last asked for, to be remembered as events.
    pub fn take_notices(&mut self) -> Vec<Notice> {
        std::mem::take(&mut self.notices)
    }

    /// For the page, the API and the metrics.
    #[must_use]
    pub fn build_status(&self) -> Vec<AlignmentStatus> {
        self.pairs.iter().map(Pair::build_status).collect()
    }

    /// The newest values of [`list_series`].
    #[must_use]
    pub fn current_values(&self) -> [ExtraValue<'static>; SERIES] {
        pair::collect_values(POWERS.map(|name| self.pairs.iter().find(|pair| pair.power_name() == name)))
    }
}

#[expect(
    clippy::cast_precision_loss,
    reason = "a double counts nanoseconds exactly for 104 days, then to a fraction of a ms"
)]
fn seconds_since(at_ns: TimeNs, origin_ns: TimeNs) -> f64 {
    (at_ns - origin_ns) as f64 / SECOND_NS as f64
}

#[expect(clippy::cast_possible_truncation, reason = "a lag of seconds")]
fn to_nanoseconds(seconds: f64) -> i64 {
    (seconds * SECOND_NS as f64).round() as i64
}
