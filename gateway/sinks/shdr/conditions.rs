//! Which alarm is which condition of MTConnect.
//!
//! A FANUC control names the kind of an alarm by the two letters of its code (B-64485EN, alarm list); a code without such letters is
//! one of the gateway, of a script, or of another make: those are the condition of the gateway itself.

use super::model::{Component, replace_separators};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct AlarmKind {
    /// Name in the lines.
    pub(super) name: &'static str,
    /// Type of the standard.
    pub(super) kind: &'static str,
    pub(super) component: Component,
}

const fn define_condition(name: &'static str, kind: &'static str, component: Component) -> AlarmKind {
    AlarmKind { name, kind, component }
}

/// Of what no kind is known.
pub(super) const OWN: AlarmKind = define_condition("alarms", "SYSTEM", Component::Controller);
const SYSTEM: AlarmKind = define_condition("system", "SYSTEM", Component::Path);
const LOGIC: AlarmKind = define_condition("logic_program", "LOGIC_PROGRAM", Component::Controller);
const MOTION: AlarmKind = define_condition("motion_program", "MOTION_PROGRAM", Component::Path);
const COMMUNICATIONS: AlarmKind = define_condition("communications", "COMMUNICATIONS", Component::Controller);
const SERVO: AlarmKind = define_condition("servo", "ACTUATOR", Component::Axes);
const TRAVEL: AlarmKind = define_condition("travel", "POSITION", Component::Axes);
const OVERHEAT: AlarmKind = define_condition("overheat", "TEMPERATURE", Component::Axes);
const SPINDLE: AlarmKind = define_condition("spindle_drive", "ACTUATOR", Component::Spindle);

pub(super) const ALL: [AlarmKind; 9] = [OWN, SYSTEM, LOGIC, MOTION, COMMUNICATIONS, SERVO, TRAVEL, OVERHEAT, SPINDLE];

/// The two letters of a code, and the condition.
const KINDS: [(&str, AlarmKind); 15] = [
    ("SW", SYSTEM),
    ("PW", SYSTEM),
    ("SR", SYSTEM),
    ("DS", SYSTEM),
    ("IE", SYSTEM),
    ("BG", SYSTEM),
    ("SN", SYSTEM),
    ("IO", COMMUNICATIONS),
    ("PS", MOTION),
    ("OT", TRAVEL),
    ("OH", OVERHEAT),
    ("SV", SERVO),
    ("SP", SPINDLE),
    ("MC", LOGIC),
    ("EX", LOGIC),
];

/// Who raises the alarms that a control shows.
const CONTROLLER: &str = "controller";

/// The conditions of an alarm, each with its native code and its text: a control may show several alarms at once.
pub(super) fn split_alarm(
    source: &str,
    code: &str,
    text: &str,
) -> impl Iterator<Item = (&'static AlarmKind, String, String)> {
    let shown: Vec<&str> = if source == CONTROLLER { code.split("; ").collect() } else { Vec::new() };
    let alone = shown.is_empty().then(|| (&OWN, replace_separators(code), replace_separators(text)));
    let parts: Vec<_> = shown.into_iter().map(parse_alarm_part).collect();
    parts.into_iter().chain(alone)
}

/// `SV0417 (Y) SERVO ALARM`: kind, number and words.
fn parse_alarm_part(shown: &str) -> (&'static AlarmKind, String, String) {
    let (code, words) = shown.split_once(' ').unwrap_or((shown, ""));
    let known = code.split_at_checked(2).filter(|(_, number)| number.chars().all(|digit| digit.is_ascii_digit()));
    let known = known.and_then(|(letters, _)| KINDS.iter().find(|(kind, _)| *kind == letters));
    match known {
        Some((_, condition)) => (condition, replace_separators(code), replace_separators(words)),
        None => (&OWN, replace_separators(shown), replace_separators(shown)),
    }
}
