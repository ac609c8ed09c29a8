//! What the built-in functions of one script remember from run to run: how long something has lasted, which alarms stand,
//! what was seen last, what was put away. Everything by name, every table bounded.

use super::collect::ScriptResult;
use super::decision::AlarmLevel;
use adapter_core::clock::{SECOND_NS, TimeNs};
use rhai::{Dynamic, ImmutableString};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// At most this many names of one kind (timers, alarms, remembered values) per script.
pub(super) const NAMES_MAX: usize = 64;
/// At most this many numbers put away with `remember`.
const KEPT_MAX: usize = 2048;
/// Bytes of the name of such a number.
const KEPT_NAME_MAX: usize = 96;

/// What an operator reads of an alarm.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct AlarmText {
    pub(super) level: AlarmLevel,
    pub(super) en: ImmutableString,
    pub(super) zh: ImmutableString,
}

impl AlarmText {
    /// One text for both languages.
    pub(super) fn from_text(text: ImmutableString) -> Self {
        Self { level: AlarmLevel::Warning, zh: text.clone(), en: text }
    }
}

#[derive(Debug, Default, Clone)]
pub(super) struct Timers {
    held_since: BTreeMap<ImmutableString, TimeNs>,
    alarms: BTreeMap<ImmutableString, AlarmTimer>,
    last: BTreeMap<ImmutableString, Dynamic>,
    latched: BTreeMap<ImmutableString, AlarmText>,
    kept: BTreeMap<ImmutableString, f64>,
}

#[derive(Debug, Default, Clone, Copy)]
struct AlarmTimer {
    active: bool,
    turning_since: Option<TimeNs>,
}

impl Timers {
    /// After a pause nothing is known of what happened in it: whatever was being timed begins anew.
    pub(super) fn restart_timing(&mut self) {
        self.held_since.clear();
        self.alarms.values_mut().for_each(|timer| timer.turning_since = None);
    }

    /// Does the alarm stand, after the condition has been `wanted` until now? `None` leaves it as it is.
    pub(super) fn alarm_turning(
        &mut self,
        name: &ImmutableString,
        wanted: Option<bool>,
        hold_s: f64,
        now_ns: TimeNs,
    ) -> ScriptResult<bool> {
        let timer = find_or_insert(&mut self.alarms, name, "alarms", NAMES_MAX)?;
        match wanted {
            Some(wanted) if wanted != timer.active => {
                let since = *timer.turning_since.get_or_insert(now_ns);
                if to_seconds(now_ns - since) >= hold_s {
                    *timer = AlarmTimer { active: wanted, turning_since: None };
                }
            }
            Some(_) | None => timer.turning_since = None,
        }
        Ok(timer.active)
    }

    /// Is the alarm of this name standing?
    pub(super) fn alarm_active(&self, name: &str) -> bool {
        self.alarms.get(name).is_some_and(|timer| timer.active) || self.latched.contains_key(name)
    }

    /// The alarm stands until it is cleared, with the text that was given last.
    pub(super) fn raise_alarm(&mut self, name: ImmutableString, text: AlarmText) -> ScriptResult<()> {
        if self.latched.len() >= NAMES_MAX && !self.latched.contains_key(name.as_str()) {
            return Err(too_many("alarms", NAMES_MAX));
        }
        self.latched.insert(name, text);
        Ok(())
    }

    pub(super) fn clear(&mut self, name: &str) {
        self.latched.remove(name);
        if let Some(timer) = self.alarms.get_mut(name) {
            *timer = AlarmTimer::default();
        }
    }

    /// Alarms that stand until they are cleared.
    pub(super) fn latched_alarms(&self) -> &BTreeMap<ImmutableString, AlarmText> {
        &self.latched
    }

    /// Seconds for which the condition has been true.
    pub(super) fn held_s(&mut self, name: &ImmutableString, condition: bool, now_ns: TimeNs) -> ScriptResult<f64> {
        if !condition {
            self.held_since.remove(name.as_str());
            return Ok(0.0);
        }
        if let Some(since) = self.held_since.get(name.as_str()) {
            return Ok(to_seconds(now_ns - since));
        }
        *find_or_insert(&mut self.held_since, name, "timers", NAMES_MAX)? = now_ns;
        Ok(0.0)
    }

    /// Is `value` another one than the last? No value changes nothing.
    pub(super) fn detect_change(&mut self, name: &ImmutableString, value: Dynamic) -> ScriptResult<bool> {
        if value.is_unit() {
            return Ok(false);
        }
        let last = find_or_insert(&mut self.last, name, "remembered values", NAMES_MAX)?;
        if are_equal(last, &value) {
            return Ok(false);
        }
        let first = last.is_unit();
        *last = value;
        Ok(!first)
    }

    /// Puts a number away; `None` forgets it.
    pub(super) fn remember_number(&mut self, name: &ImmutableString, value: Option<f64>) -> ScriptResult<()> {
        if name.len() > KEPT_NAME_MAX {
            return Err(format!("the name of a number to remember has at most {KEPT_NAME_MAX} bytes").into());
        }
        match value {
            Some(value) => *find_or_insert(&mut self.kept, name, "remembered numbers", KEPT_MAX)? = value,
            None => drop(self.kept.remove(name.as_str())),
        }
        Ok(())
    }

    /// A number put away before.
    pub(super) fn recall_number(&self, name: &str) -> Dynamic {
        self.kept.get(name).map_or(Dynamic::UNIT, |value| Dynamic::from_float(*value))
    }

    /// How many numbers are put away.
    pub(super) fn count_remembered(&self) -> i64 {
        // At most KEPT_MAX: the conversion never fails.
        i64::try_from(self.kept.len()).unwrap_or(i64::MAX)
    }

    /// Forgets every number whose name begins so.
    pub(super) fn forget_numbers(&mut self, beginning: &str) {
        self.kept.retain(|name, _| !name.starts_with(beginning));
    }

    /// What outlives the process. What was being timed does not: nothing is known of the time in between.
    pub(super) fn take_snapshot(&self) -> Value {
        let last =
            self.last.iter().filter_map(|(name, value)| Some((name.to_string(), serde_json::to_value(value).ok()?)));
        let latched = self.latched.iter().map(|(name, text)| {
            (name.to_string(), json!({ "level": text.level.as_word(), "en": text.en.as_str(), "zh": text.zh.as_str() }))
        });
        let kept = self.kept.iter().map(|(name, value)| (name.to_string(), json!(value)));
        json!({
            "last": last.collect::<Map<_, _>>(),
            "latched": latched.collect::<Map<_, _>>(),
            "kept": kept.collect::<Map<_, _>>(),
        })
    }

    /// From a snapshot; what cannot be read is left out.
    pub(super) fn from_snapshot(snapshot: &Value) -> Self {
        let table = |name: &str| snapshot[name].as_object().into_iter().flatten();
        let mut timers = Self::default();
        for (name, value) in table("last").take(NAMES_MAX) {
            if let Ok(value) = serde_json::from_value(value.clone()) {
                timers.last.insert(name.as_str().into(), value);
            }
        }
        for (name, text) in table("latched").take(NAMES_MAX) {
            let word = |key: &str| text[key].as_str().map(ImmutableString::from);
            if let (Some(level), Some(en), Some(zh)) =
                (text["level"].as_str().and_then(AlarmLevel::from_word), word("en"), word("zh"))
            {
                timers.latched.insert(name.as_str().into(), AlarmText { level, en, zh });
            }
        }
        let kept =
            table("kept").take(KEPT_MAX).filter_map(|(name, value)| Some((name.as_str().into(), value.as_f64()?)));
        timers.kept = kept.collect();
        timers
    }
}

fn are_equal(a: &Dynamic, b: &Dynamic) -> bool {
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

fn find_or_insert<'a, T: Default>(
    map: &'a mut BTreeMap<ImmutableString, T>,
    name: &ImmutableString,
    what: &str,
    most: usize,
) -> ScriptResult<&'a mut T> {
    if !map.contains_key(name.as_str()) {
        if map.len() >= most {
            return Err(too_many(what, most));
        }
        map.insert(name.clone(), T::default());
    }
    map.get_mut(name.as_str()).ok_or_else(|| too_many(what, most))
}

pub(super) fn too_many(what: &str, most: usize) -> Box<rhai::EvalAltResult> {
    format!("more than {most} {what} in one script; use the same name each time instead of building new ones").into()
}

pub(super) fn to_seconds(ns: i64) -> f64 {
    ns as f64 / SECOND_NS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_outlives_the_process_comes_back() {
        let mut timers = Timers::default();
        let name = ImmutableString::from("worn");
        timers
            .raise_alarm(name.clone(), AlarmText { level: AlarmLevel::Critical, en: "worn".into(), zh: "磨损".into() })
            .expect("room");
        timers.detect_change(&"tool".into(), "T1".into()).expect("room");
        timers.detect_change(&"count".into(), 3.0.into()).expect("room");
        timers.remember_number(&"O1/T1".into(), Some(0.1 + 0.2)).expect("room");
        let mut back = Timers::from_snapshot(&timers.take_snapshot());
        assert_eq!(back.latched_alarms(), timers.latched_alarms());
        assert_eq!(back.kept, timers.kept);
        assert_eq!(back.detect_change(&"tool".into(), "T1".into()).ok(), Some(false));
        assert_eq!(back.detect_change(&"tool".into(), "T2".into()).ok(), Some(true));
        assert_eq!(back.detect_change(&"count".into(), 3.0.into()).ok(), Some(false));
        assert_eq!(Timers::from_snapshot(&json!({ "last": 5, "kept": { "a": "x" } })).kept.len(), 0);
    }

    #[test]
    fn no_table_grows_without_end() {
        let mut timers = Timers::default();
        let last = (0..10_000)
            .map(|i| timers.remember_number(&format!("{i}").into(), Some(1.0)).is_ok())
            .filter(|ok| *ok)
            .count();
        assert_eq!(last, KEPT_MAX);
        timers.forget_numbers("");
        assert!(timers.kept.is_empty());
        assert!(timers.remember_number(&"x".repeat(200).into(), Some(1.0)).is_err());
    }
}
