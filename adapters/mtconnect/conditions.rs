//! Which faults and warnings stand. A condition says what becomes of one of them: a fault or a warning begins to stand, `Normal` with its
//! number ends it, `Normal` without a number ends all of the data item (Part 3, Condition).

use crate::streams::{ConditionFields, ConditionLevel, Observation};
use adapter_core::text::limit_text;
use std::collections::{HashMap, VecDeque};

/// At most so many stand at once; the oldest are forgotten.
const STANDING_MAX: usize = 256;
/// At most so many are shown in a channel, as with other controls.
const SHOWN_MAX: usize = 4;

#[derive(Debug, Clone, PartialEq, Eq)]
struct StandingCondition {
    item: String,
    key: Option<String>,
    level: ConditionLevel,
    text: String,
}

/// The conditions of a device.
#[derive(Debug, Clone, Default)]
pub(crate) struct StandingConditions {
    standing: VecDeque<StandingCondition>,
    /// Whether the agent knows the condition of an item, and the last number that it told of it.
    items: HashMap<String, KnownItem>,
}

#[derive(Debug, Clone, Copy, Default)]
struct KnownItem {
    is_available: bool,
    sequence: Option<u64>,
}

impl StandingConditions {
    pub(crate) fn record_condition(&mut self, observation: &Observation, fields: &ConditionFields) {
        let key = fields.condition_id.clone().or_else(|| fields.native_code.clone());
        let is_available = fields.level != ConditionLevel::Unavailable;
        self.items.insert(observation.item.clone(), KnownItem { is_available, sequence: observation.sequence });
        let ends_all = !is_available || fields.level == ConditionLevel::Normal && key.is_none();
        self.standing.retain(|other| other.item != observation.item || !(ends_all || other.key == key));
        if matches!(fields.level, ConditionLevel::Fault | ConditionLevel::Warning) {
            if self.standing.len() >= STANDING_MAX {
                self.standing.pop_front();
            }
            let text = describe_condition(observation, fields);
            self.standing.push_back(StandingCondition {
                item: observation.item.clone(),
                key,
                level: fields.level,
                text,
            });
        }
    }

    /// Is the condition of one of these items known, and told after the agent lost the control (`lost_at`, a sequence number)?
    pub(crate) fn is_known(&self, items: &[String], lost_at: Option<u64>) -> bool {
        let is_known = |known: &KnownItem| known.is_available && (lost_at.is_none() || known.sequence > lost_at);
        items.iter().filter_map(|item| self.items.get(item)).any(is_known)
    }

    /// What stands of these items at this level, as the other controls tell it; empty without one.
    pub(crate) fn format_standing(&self, items: &[String], level: ConditionLevel) -> Vec<String> {
        let of_level = |other: &&StandingCondition| other.level == level && items.contains(&other.item);
        let mut texts: Vec<String> = self.standing.iter().filter(of_level).map(|other| other.text.clone()).collect();
        if let Some(more) = texts.len().checked_sub(SHOWN_MAX).filter(|more| *more > 0) {
            texts.truncate(SHOWN_MAX);
            texts.push(format!("and {more} more"));
        }
        texts
    }
}

/// `SV0417 SERVO ALARM`; without a text the type of the condition.
fn describe_condition(observation: &Observation, fields: &ConditionFields) -> String {
    let words = if observation.text.is_empty() {
        [Some(fields.kind.as_str()), fields.qualifier.as_deref()].into_iter().flatten().collect::<Vec<_>>().join(" ")
    } else {
        observation.text.clone()
    };
    let text = match &fields.native_code {
        Some(code) if !words.starts_with(code.as_str()) => format!("{code} {words}"),
        _ => words,
    };
    limit_text(&text).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(conditions: &mut StandingConditions, item: &str, level: ConditionLevel, code: Option<&str>, text: &str) {
        let fields = ConditionFields {
            level,
            kind: "SYSTEM".to_owned(),
            native_code: code.map(str::to_owned),
            condition_id: None,
            qualifier: Some("HIGH".to_owned()),
        };
        let observation = Observation {
            item: item.to_owned(),
            element: String::new(),
            sub_type: None,
            component: String::new(),
            sequence: Some(7),
            timestamp: String::new(),
            text: text.to_owned(),
            condition: None,
        };
        conditions.record_condition(&observation, &fields);
    }

    #[test]
    fn faults_stand_until_they_are_ended_by_their_number_or_all_at_once() {
        use ConditionLevel::{Fault, Normal, Unavailable, Warning};
        let mut conditions = StandingConditions::default();
        let items = ["a".to_owned(), "b".to_owned()];
        let shown = |conditions: &StandingConditions, level| conditions.format_standing(&items, level).join("; ");
        assert!(!conditions.is_known(&items, None));
        record(&mut conditions, "a", Fault, Some("SV0417"), "SERVO ALARM");
        record(&mut conditions, "a", Fault, Some("OT0500"), "");
        record(&mut conditions, "b", Warning, None, "battery");
        assert_eq!(shown(&conditions, Fault), "SV0417 SERVO ALARM; OT0500 SYSTEM HIGH");
        assert_eq!(shown(&conditions, Warning), "battery");
        record(&mut conditions, "a", Normal, Some("SV0417"), "");
        assert_eq!(shown(&conditions, Fault), "OT0500 SYSTEM HIGH");
        record(&mut conditions, "a", Warning, Some("OT0500"), "near the end");
        assert_eq!(
            (shown(&conditions, Fault), shown(&conditions, Warning)),
            (String::new(), "battery; OT0500 near the end".to_owned())
        );
        record(&mut conditions, "a", Normal, None, "");
        record(&mut conditions, "b", Unavailable, None, "");
        assert_eq!(shown(&conditions, Warning), "");
        assert!(conditions.is_known(&items, None) && !conditions.is_known(&items[1..], None));
        assert!(
            conditions.is_known(&items, Some(6)) && !conditions.is_known(&items, Some(7)),
            "older than the loss of the control"
        );
    }

    #[test]
    fn many_faults_are_counted_and_forgotten_from_the_oldest_on() {
        let mut conditions = StandingConditions::default();
        for number in 0..1000 {
            record(&mut conditions, "a", ConditionLevel::Fault, Some(&number.to_string()), "x");
        }
        let shown = conditions.format_standing(&["a".to_owned()], ConditionLevel::Fault);
        assert_eq!((shown.len(), shown[4].as_str()), (5, "and 252 more"));
    }
}
