//! The alarms of one script: which begin and which end after a run.

use super::{Outputs, Slot};
use crate::decision::{Alarm, SCRIPT_STOPPED};
use crate::timers::AlarmText;
use adapter_core::clock::TimeNs;
use std::sync::Arc;

impl Slot {
    /// Begins and ends alarms: those that the body named and those that stand until they are cleared.
    pub(super) fn update_alarms(&self, now_ns: TimeNs, outputs: &mut Outputs<'_>) {
        for (name, text) in self.named.iter().map(|(name, text)| (name, text)).chain(self.timers.latched_alarms()) {
            let standing = |alarm: &Alarm| *alarm.script == *self.script.file && *alarm.name == **name;
            if !outputs.alarms.iter().any(standing) {
                self.begin_alarm(name, text, now_ns, outputs);
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
