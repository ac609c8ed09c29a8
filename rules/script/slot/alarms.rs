//! The alarms of one script: which begin and which end after a run.

use super::{Outputs, Slot};
use crate::decision::{Alarm, SCRIPT_STOPPED};
use crate::timers::AlarmText;
use adapter_core::clock::{SECOND_NS, TimeNs};
use std::sync::Arc;

/// Another text of a standing alarm is told so often at most: a text with a measured number in it changes at every run. The cost is that a
/// second fact under one name is told up to so much later; facts that must not wait have names of their own.
const TEXT_EVERY_NS: i64 = 5 * SECOND_NS;

impl Slot {
    /// Begins and ends alarms: those that the body named and those that stand until they are cleared. One whose text or level has
    /// changed ends and begins anew: what was told before is no longer so.
    pub(super) fn update_alarms(&self, now_ns: TimeNs, outputs: &mut Outputs<'_>) {
        for (name, text) in self.named.iter().map(|(name, text)| (name, text)).chain(self.timers.latched_alarms()) {
            let standing = |alarm: &Alarm| *alarm.script == *self.script.file && *alarm.name == **name;
            match outputs.alarms.iter().position(standing) {
                None => self.begin_alarm(name, text, now_ns, outputs),
                Some(at) if tells_another_fact(&outputs.alarms[at], text, now_ns) => {
                    outputs.decision.alarms.push(outputs.alarms.remove(at).to_change(false));
                    self.begin_alarm(name, text, now_ns, outputs);
                }
                Some(_) => {}
            }
        }
        let own = |alarm: &Alarm| *alarm.script == *self.script.file && *alarm.name != *SCRIPT_STOPPED;
        let asked = |alarm: &Alarm| {
            let named = self.named.iter().any(|(name, _)| **name == *alarm.name);
            named || self.timers.latched_alarms().contains_key(&*alarm.name)
        };
        let over = |alarm: &Alarm| own(alarm) && !asked(alarm);
        let ended = outputs.alarms.iter().filter(|alarm| over(alarm)).map(|alarm| alarm.to_change(false));
        outputs.decision.alarms.extend(ended);
        outputs.alarms.retain(|alarm| !over(alarm));
    }

    pub(super) fn begin_alarm(&self, name: &str, text: &AlarmText, since_ns: TimeNs, outputs: &mut Outputs<'_>) {
        let (en, zh) = (Arc::from(text.en.as_str()), Arc::from(text.zh.as_str()));
        let script = self.script.file.clone();
        let alarm = Alarm { name: Arc::from(name), script, level: text.level, en, zh, since_ns };
        outputs.decision.alarms.push(alarm.to_change(true));
        outputs.alarms.push(alarm);
    }
}

/// Does this text say something else than the alarm that stands, and may it be told already? A graver level is told at once.
fn tells_another_fact(standing: &Alarm, text: &AlarmText, now_ns: TimeNs) -> bool {
    let other = standing.level != text.level || *standing.en != *text.en || *standing.zh != *text.zh;
    let waited = !(0..TEXT_EVERY_NS).contains(&(now_ns - standing.since_ns));
    other && (waited || text.level > standing.level)
}
