//! What a script leaves behind in one run, and what its timers remember between runs.

use adapters::clock::{SECOND_NS, TimeNs};
use rhai::{Dynamic, EvalAltResult, ImmutableString};
use std::collections::BTreeMap;

/// At most this many names of one kind (timers, alarms, remembered values) per script.
const NAMES_MAX: usize = 64;
/// At most this many notes in one run.
const NOTES_MAX: usize = 8;

pub(super) type Outcome<T> = Result<T, Box<EvalAltResult>>;

/// What the built-in functions of one script remember between runs.
#[derive(Debug, Default)]
pub(super) struct Timers {
    held_since: BTreeMap<ImmutableString, TimeNs>,
    alarms: BTreeMap<ImmutableString, AlarmTimer>,
    last: BTreeMap<ImmutableString, Dynamic>,
}

#[derive(Debug, Default, Clone, Copy)]
struct AlarmTimer {
    active: bool,
    turning_since: Option<TimeNs>,
}

impl Timers {
    /// After a pause nothing is known of what happened in it: whatever was being timed begins anew.
    pub(super) fn restart(&mut self) {
        self.held_since.clear();
        self.alarms.values_mut().for_each(|timer| timer.turning_since = None);
    }
}

/// What one run of one script leaves behind.
#[derive(Debug, Default)]
pub(super) struct Collected {
    pub(super) now_ns: TimeNs,
    pub(super) timers: Timers,
    pub(super) request: Option<(f64, ImmutableString)>,
    pub(super) alarms: Vec<(ImmutableString, ImmutableString)>,
    pub(super) notes: Vec<ImmutableString>,
    refusals: Vec<(&'static str, String)>,
}

impl Collected {
    /// Ready for the next run; keeps the buffers.
    pub(super) fn begin(&mut self, now_ns: TimeNs) {
        self.now_ns = now_ns;
        self.request = None;
        self.alarms.clear();
        self.notes.clear();
        self.refusals.clear();
    }

    /// A method had no answer in this run; the last reason of each counts.
    pub(super) fn refused(&mut self, method: &'static str, reason: &str) {
        self.refusals.retain(|(known, _)| *known != method);
        self.refusals.push((method, reason.to_owned()));
    }

    /// Why the method of this name last had no answer in this run; `()` where it had one.
    pub(super) fn why(&self, method: &str) -> Dynamic {
        let found = self.refusals.iter().find(|(known, _)| *known == method);
        found.map_or(Dynamic::UNIT, |(_, reason)| reason.into())
    }

    /// What methods refused in this run, for the operator.
    pub(super) fn refusals(&self) -> impl Iterator<Item = String> {
        self.refusals.iter().map(|(method, reason)| format!("{method} has no value ({reason})"))
    }

    pub(super) fn alarm(&mut self, name: ImmutableString, text: ImmutableString) -> Outcome<()> {
        if let Some(known) = self.alarms.iter_mut().find(|(known, _)| *known == name) {
            known.1 = text;
        } else if self.alarms.len() < NAMES_MAX {
            self.alarms.push((name, text));
        } else {
            return Err(too_many("alarms"));
        }
        Ok(())
    }

    pub(super) fn note(&mut self, text: ImmutableString) {
        if self.notes.len() < NOTES_MAX {
            self.notes.push(text);
        }
    }

    /// Raises or clears by what the condition has been for `hold_s`; `None` leaves the alarm as it is.
    pub(super) fn alarm_turning(
        &mut self,
        name: ImmutableString,
        wanted: Option<bool>,
        hold_s: f64,
        text: ImmutableString,
    ) -> Outcome<()> {
        let now_ns = self.now_ns;
        let timer = entry(&mut self.timers.alarms, &name, "alarms")?;
        match wanted {
            Some(wanted) if wanted != timer.active => {
                let since = *timer.turning_since.get_or_insert(now_ns);
                if seconds(now_ns - since) >= hold_s {
                    *timer = AlarmTimer { active: wanted, turning_since: None };
                }
            }
            Some(_) | None => timer.turning_since = None,
        }
        if timer.active { self.alarm(name, text) } else { Ok(()) }
    }

    /// Is the alarm of this name standing?
    pub(super) fn alarm_active(&self, name: &str) -> bool {
        self.timers.alarms.get(name).is_some_and(|timer| timer.active)
    }

    /// Seconds for which the condition has been true.
    pub(super) fn held_s(&mut self, name: &ImmutableString, condition: bool) -> Outcome<f64> {
        if !condition {
            self.timers.held_since.remove(name.as_str());
            return Ok(0.0);
        }
        let now_ns = self.now_ns;
        if let Some(since) = self.timers.held_since.get(name.as_str()) {
            return Ok(seconds(now_ns - since));
        }
        *entry(&mut self.timers.held_since, name, "timers")? = now_ns;
        Ok(0.0)
    }

    /// Is `value` another one than the last? No value changes nothing.
    pub(super) fn changed(&mut self, name: &ImmutableString, value: Dynamic) -> Outcome<bool> {
        if value.is_unit() {
            return Ok(false);
        }
        let last = entry(&mut self.timers.last, name, "remembered values")?;
        if same(last, &value) {
            return Ok(false);
        }
        let first = last.is_unit();
        *last = value;
        Ok(!first)
    }
}

fn same(a: &Dynamic, b: &Dynamic) -> bool {
    match (a.as_float(), b.as_float()) {
        (Ok(a), Ok(b)) => return a == b,
        (Ok(_), Err(_)) | (Err(_), Ok(_)) => return false,
        _ => {}
    }
    match (a.read_lock::<ImmutableString>(), b.read_lock::<ImmutableString>()) {
        (Some(a), Some(b)) => *a == *b,
        _ => a.as_int().ok() == b.as_int().ok() && a.as_bool().ok() == b.as_bool().ok() && a.is_unit() == b.is_unit(),
    }
}

fn entry<'a, T: Default>(
    map: &'a mut BTreeMap<ImmutableString, T>,
    name: &ImmutableString,
    what: &str,
) -> Outcome<&'a mut T> {
    if !map.contains_key(name.as_str()) {
        if map.len() >= NAMES_MAX {
            return Err(too_many(what));
        }
        map.insert(name.clone(), T::default());
    }
    map.get_mut(name.as_str()).ok_or_else(|| too_many(what))
}

fn too_many(what: &str) -> Box<EvalAltResult> {
    format!("more than {NAMES_MAX} {what} in one script; use the same name each time instead of building new ones")
        .into()
}

fn seconds(ns: i64) -> f64 {
    ns as f64 / SECOND_NS as f64
}
