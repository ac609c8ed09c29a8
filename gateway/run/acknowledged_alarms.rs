//! Which of the alarms that stand a person has seen. To have seen one changes nothing about it: it stands until its reason has
//! gone, and when it comes again it has not been seen.

use adapters::clock::TimeNs;
use gateway_status::{Acknowledged, AlarmStatus};

/// Which of the alarms that stand a person has seen.
#[derive(Debug, Default)]
pub struct AcknowledgedAlarms {
    standing: Vec<String>,
    alarms: Vec<Acknowledged>,
}

impl AcknowledgedAlarms {
    /// These alarms stand now.
    pub fn update_standing(&mut self, alarms: &[AlarmStatus]) {
        self.standing = alarms.iter().map(|alarm| alarm.code.clone()).collect();
        self.alarms.retain(|seen| alarms.iter().any(|alarm| alarm.code == seen.code && alarm.since_ms <= seen.at_ms));
    }

    /// Somebody has seen this one; false when it does not stand.
    pub fn acknowledge_alarm(&mut self, code: &str, by: &str, at_ns: TimeNs) -> bool {
        if !self.standing.iter().any(|standing| standing == code) {
            return false;
        }
        self.alarms.retain(|seen| seen.code != code);
        let (code, by, at_ms) = (code.to_owned(), by.to_owned(), at_ns.div_euclid(1_000_000));
        self.alarms.push(Acknowledged { code, by, at_ms });
        true
    }

    /// Those that have been seen.
    #[must_use]
    pub fn list_alarms(&self) -> Vec<Acknowledged> {
        self.alarms.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alarm(code: &str, since_ms: i64) -> AlarmStatus {
        let (severity, text) = ("warning".to_owned(), String::new());
        AlarmStatus { code: code.to_owned(), severity, zh: text.clone(), text, since_ms }
    }

    #[test]
    fn an_alarm_that_comes_again_has_not_been_seen() {
        let mut seen = AcknowledgedAlarms::default();
        assert!(!seen.acknowledge_alarm("overload", "Li", 5_000_000), "it does not stand");
        seen.update_standing(&[alarm("overload", 1)]);
        assert!(seen.acknowledge_alarm("overload", "Li", 5_000_000));
        seen.update_standing(&[alarm("overload", 1)]);
        assert_eq!(seen.list_alarms().len(), 1);
        seen.update_standing(&[alarm("overload", 9)]);
        assert!(seen.list_alarms().is_empty(), "raised again since");
        seen.acknowledge_alarm("overload", "Li", 10_000_000);
        seen.update_standing(&[]);
        assert!(seen.list_alarms().is_empty(), "gone");
    }
}
