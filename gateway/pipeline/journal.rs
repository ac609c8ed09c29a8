//! What changed from one tick to the next, as records: the state, and the alarm that the controller shows.

use super::channels::Channels;
use adapter_core::Sample;
use adapter_core::clock::TimeNs;
use gateway_history::{Alarm, AlarmClear, Record, StateChange};
use rules::estimators::wear::tool_of;
use rules::estimators::{Estimates, State};
use std::sync::Arc;

/// Who raises the controller's alarms.
const CONTROLLER: &str = "controller";

/// Remembers what was last recorded.
#[derive(Debug, Clone, Default)]
pub struct Journal {
    state: Option<State>,
    /// When the state that is recorded began; before the first one, when the recording did.
    since_ns: Option<TimeNs>,
    alarm: Option<(Arc<str>, TimeNs)>,
}

impl Journal {
    /// Gives every record that this tick makes to `keep`.
    pub fn record_tick(
        &mut self,
        channels: &Channels,
        sample: &Sample,
        estimates: &Estimates,
        mut keep: impl FnMut(Record),
    ) {
        self.since_ns.get_or_insert(sample.at_ns);
        if self.state != Some(estimates.state) {
            keep(self.state_change(channels, sample, estimates).into());
        }
        let shown = sample.text(channels.alarm).filter(|text| !text.is_empty());
        // A controller that does not answer has not cleared its alarm.
        let silent = sample.slot(channels.alarm).value.is_err();
        if !silent && shown != self.alarm.as_ref().map(|(text, _)| &**text) {
            self.change_alarm(shown, sample.at_ns, keep);
        }
    }

    /// The state began when the estimators say so, but never before the state that it ends, nor before the first sample.
    fn state_change(&mut self, channels: &Channels, sample: &Sample, estimates: &Estimates) -> StateChange {
        let least_ns = self.since_ns.unwrap_or(sample.at_ns);
        let at_ns = estimates.since_ns.clamp(least_ns, sample.at_ns.max(least_ns));
        (self.state, self.since_ns) = (Some(estimates.state), Some(at_ns));
        let text = |channel| sample.text(channel).unwrap_or_default().to_owned();
        StateChange {
            at_ns,
            state: estimates.state.as_word().to_owned(),
            program: text(channels.program),
            tool: tool_of(&text(channels.tool)).to_owned(),
        }
    }

    fn change_alarm(&mut self, shown: Option<&str>, at_ns: TimeNs, mut keep: impl FnMut(Record)) {
        if let Some((code, _)) = self.alarm.take() {
            keep(AlarmClear { at_ns, code: code.to_string(), source: CONTROLLER.to_owned() }.into());
        }
        if let Some(text) = shown {
            self.alarm = Some((Arc::from(text), at_ns));
            let (code, severity) = (text.to_owned(), "critical".to_owned());
            let (en, zh) = (text.to_owned(), text.to_owned());
            keep(Alarm { at_ns, code, source: CONTROLLER.to_owned(), severity, en, zh }.into());
        }
    }

    /// The controller's alarm that stands, and since when.
    #[must_use]
    pub fn standing_alarm(&self) -> Option<(&str, TimeNs)> {
        self.alarm.as_ref().map(|(text, since_ns)| (&**text, *since_ns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use adapter_core::{ChannelId, Slot, Value};

    fn records(journal: &mut Journal, at_ns: TimeNs, state: State, alarm: Option<&str>) -> Vec<Record> {
        let mut sample = Sample::new_empty(at_ns);
        if let Some(text) = alarm {
            let slot = Slot { value: Ok(Value::Text(text.into())), age_ns: 0 };
            sample.set_slot(ChannelId::from_name("alarm").expect("in the table"), slot);
        }
        let estimates = Estimates { state, since_ns: at_ns - 3, ..Estimates::without_samples(at_ns) };
        let mut kept = Vec::new();
        journal.record_tick(&Channels::new(), &sample, &estimates, |record| kept.push(record));
        kept
    }

    #[test]
    fn a_state_is_recorded_once_and_never_before_the_one_it_ends() {
        let mut journal = Journal::default();
        let first = records(&mut journal, 10, State::Idle, None);
        assert!(matches!(&first[..], [Record::State(change)] if change.at_ns == 10), "no sample before it: {first:?}");
        assert!(records(&mut journal, 11, State::Idle, None).is_empty());
        let changed = records(&mut journal, 12, State::Cutting, None);
        assert!(matches!(&changed[..], [Record::State(change)] if change.at_ns == 10), "{changed:?}");
        let changed = records(&mut journal, 20, State::Idle, None);
        assert!(matches!(&changed[..], [Record::State(change)] if change.at_ns == 17), "{changed:?}");
    }

    #[test]
    fn a_state_of_which_the_beginning_is_not_known_begins_with_the_sample() {
        // 3 is what the estimates of this test subtract: they say 0, which is "not known".
        let first = records(&mut Journal::default(), 3, State::Unknown, None);
        assert!(matches!(&first[..], [Record::State(change)] if change.at_ns == 3), "{first:?}");
    }

    #[test]
    fn the_controllers_alarm_is_raised_and_cleared_and_survives_silence() {
        let mut journal = Journal::default();
        records(&mut journal, 10, State::Idle, Some(""));
        assert!(matches!(&records(&mut journal, 11, State::Idle, Some("SV0401"))[..], [Record::Alarm(_)]));
        assert!(records(&mut journal, 12, State::Idle, None).is_empty());
        assert!(matches!(
            &records(&mut journal, 13, State::Idle, Some("OT506"))[..],
            [Record::AlarmClear(_), Record::Alarm(_)]
        ));
        assert!(matches!(&records(&mut journal, 14, State::Idle, Some(""))[..], [Record::AlarmClear(_)]));
    }
}
