//! The functions through which a script leaves its effects: requests, alarms, notes, channels of its own, and what it
//! remembers.

use super::collect::{RunOutput, ScriptResult};
use super::decision::{AlarmLevel, Axis, Stop};
use super::engine::Shared;
use super::problem::describe_type;
use super::timers::AlarmText;
use super::vocabulary::{WordKind, find_word};
use rhai::{Dynamic, Engine, EvalAltResult, ImmutableString, Position};

type Text = ImmutableString;

/// Makes every one of them callable; their effects go to `shared`.
pub(super) fn register_outcomes(engine: &mut Engine, shared: &Shared) {
    engine.register_fn("has", |value: Dynamic| !value.is_unit());
    engine.register_fn("clamp", |value: Dynamic, least: Dynamic, greatest: Dynamic| -> ScriptResult<f64> {
        let (least, greatest) = (require_number("clamp", &least)?, require_number("clamp", &greatest)?);
        Ok(require_number("clamp", &value)?.max(least).min(greatest))
    });
    register_settings(engine, shared);
    register_memory(engine, shared);
    register_requests(engine, shared);
    register_alarms(engine, shared);
    alarm_when(engine, shared);
    register_threshold(engine, shared, "alarm_above", 1.0);
    register_threshold(engine, shared, "alarm_below", -1.0);
}

/// `setting` stands in a text only until its value is put in its place; `setting_now` is what is put there where the value depends
/// on the tool or the operation.
fn register_settings(engine: &mut Engine, shared: &Shared) {
    engine.register_fn("setting", |_: Text, default: Dynamic, _: Dynamic| default);
    let to = shared.clone();
    engine.register_fn("setting_now", move |index: i64| {
        let collected = to.lock();
        let at = usize::try_from(index).ok();
        at.zip(collected.live.as_ref()).and_then(|(at, live)| live.get(at).cloned()).unwrap_or(Dynamic::UNIT)
    });
}

fn register_memory(engine: &mut Engine, shared: &Shared) {
    let to = shared.clone();
    engine.register_fn("note", move |text: Text| to.lock().add_note(text));
    let to = shared.clone();
    engine.register_fn("held_s", move |name: Text, condition: bool| {
        let collected = &mut *to.lock();
        collected.timers.held_s(&name, condition, collected.now_ns)
    });
    let to = shared.clone();
    engine.register_fn("changed", move |name: Text, value: Dynamic| to.lock().timers.detect_change(&name, value));
    let to = shared.clone();
    engine.register_fn("remember", move |name: Text, value: Dynamic| -> ScriptResult<()> {
        let value = read_optional_number("remember", &value)?;
        to.lock().timers.remember_number(&name, value)
    });
    let to = shared.clone();
    engine.register_fn("recall", move |name: Text| to.lock().timers.recall_number(&name));
    let to = shared.clone();
    engine.register_fn("remembered", move || to.lock().timers.count_remembered());
    let to = shared.clone();
    engine.register_fn("learn_anew", move |program: Text| to.lock().learn_anew(program));
    let to = shared.clone();
    engine.register_fn("forget", move |beginning: Text| to.lock().forget_numbers(&beginning));
}

fn register_requests(engine: &mut Engine, shared: &Shared) {
    let to = shared.clone();
    engine.register_fn("request_feed_override", move |pct: Dynamic, reason: Text| -> ScriptResult<()> {
        let pct = require_number("request_feed_override", &pct)?;
        to.lock().request = Some((pct, reason));
        Ok(())
    });
    let to = shared.clone();
    engine.register_fn("follow_feed_override", move |name: Text, reason: Text| -> ScriptResult<()> {
        let word = find_word(&name).filter(|word| word.kind == WordKind::Number);
        let word = word.ok_or_else(|| format!("`{name}` is no number that could be followed"))?;
        to.lock().follows = Some((word, reason));
        Ok(())
    });
    for (function, stop) in [("request_feed_hold", Stop::FeedHold), ("request_tool_change", Stop::ToolChange)] {
        let to = shared.clone();
        engine.register_fn(function, move |reason: Text| to.lock().request_stop(stop, reason));
    }
    let to = shared.clone();
    engine.register_fn("propose_offset_um", move |axis: Text, offset: Dynamic, reason: Text| -> ScriptResult<()> {
        let offset_um = require_number("propose_offset_um", &offset)?;
        let axis = Axis::from_word(&axis)
            .ok_or_else(|| format!("there is no axis \"{axis}\"; write \"x\", \"y\" or \"z\""))?;
        to.lock().propose_offset(axis, (offset_um, reason));
        Ok(())
    });
    let to = shared.clone();
    engine.register_fn("publish", move |name: Text, value: Dynamic, _unit: Text| -> ScriptResult<()> {
        let value = read_optional_number("publish", &value)?.filter(|value| value.is_finite());
        to.lock().publish_value(name, value);
        Ok(())
    });
}

fn register_alarms(engine: &mut Engine, shared: &Shared) {
    let to = shared.clone();
    engine.register_fn("alarm", move |name: Text, text: Text| to.lock().add_alarm(name, AlarmText::from_text(text)));
    let to = shared.clone();
    engine.register_fn("alarm", move |name: Text, level: Text, en: Text, zh: Text| -> ScriptResult<()> {
        to.lock().add_alarm(name, build_alarm_text(&level, en, zh)?)
    });
    let to = shared.clone();
    engine.register_fn("raise_alarm", move |name: Text, text: Text| {
        to.lock().timers.raise_alarm(name, AlarmText::from_text(text))
    });
    let to = shared.clone();
    engine.register_fn("raise_alarm", move |name: Text, level: Text, en: Text, zh: Text| -> ScriptResult<()> {
        to.lock().timers.raise_alarm(name, build_alarm_text(&level, en, zh)?)
    });
    let to = shared.clone();
    engine.register_fn("clear_alarm", move |name: Text| to.lock().timers.clear(&name));
}

fn alarm_when(engine: &mut Engine, shared: &Shared) {
    let to = shared.clone();
    engine.register_fn(
        "alarm_when",
        move |name: Text, condition: bool, hold_s: Dynamic, text: Text| -> ScriptResult<()> {
            let hold_s = require_number("alarm_when", &hold_s)?;
            to.lock().alarm_turning(name, Some(condition), hold_s, AlarmText::from_text(text))
        },
    );
    let to = shared.clone();
    engine.register_fn(
        "alarm_when",
        move |name: Text, condition: bool, hold_s: Dynamic, level: Text, en: Text, zh: Text| -> ScriptResult<()> {
            let hold_s = require_number("alarm_when", &hold_s)?;
            to.lock().alarm_turning(name, Some(condition), hold_s, build_alarm_text(&level, en, zh)?)
        },
    );
}

/// A threshold with its hysteresis: function, sign (1 above, -1 below), and the three numbers.
struct HysteresisThreshold {
    function: &'static str,
    sign: f64,
    on: f64,
    off: f64,
    hold_s: f64,
}

impl HysteresisThreshold {
    fn read(function: &'static str, sign: f64, [on, off, hold_s]: [&Dynamic; 3]) -> ScriptResult<Self> {
        let (on, off, hold_s) =
            (require_number(function, on)?, require_number(function, off)?, require_number(function, hold_s)?);
        if sign * off > sign * on {
            let what = format!("{function}: `off` = {off} lies beyond `on` = {on}; the alarm would never be quiet");
            return Err(what.into());
        }
        Ok(Self { function, sign, on, off, hold_s })
    }

    fn judge_value(&self, collected: &mut RunOutput, name: Text, value: &Dynamic, text: AlarmText) -> ScriptResult<()> {
        let beyond = if collected.timers.alarm_active(&name) { self.off } else { self.on };
        let beside = |value: f64| self.sign * value > self.sign * beyond;
        let wanted = if value.is_unit() { None } else { Some(beside(require_number(self.function, value)?)) };
        collected.alarm_turning(name, wanted, self.hold_s, text)
    }
}

/// `alarm_above` with sign 1, `alarm_below` with sign -1.
fn register_threshold(engine: &mut Engine, shared: &Shared, function: &'static str, sign: f64) {
    let to = shared.clone();
    engine.register_fn(
        function,
        move |name: Text, value: Dynamic, on: Dynamic, off: Dynamic, hold_s: Dynamic, text: Text| -> ScriptResult<()> {
            let threshold = HysteresisThreshold::read(function, sign, [&on, &off, &hold_s])?;
            threshold.judge_value(&mut to.lock(), name, &value, AlarmText::from_text(text))
        },
    );
    let to = shared.clone();
    engine.register_fn(
        function,
        move |name: Text,
              value: Dynamic,
              on: Dynamic,
              off: Dynamic,
              hold_s: Dynamic,
              level: Text,
              en: Text,
              zh: Text|
              -> ScriptResult<()> {
            let threshold = HysteresisThreshold::read(function, sign, [&on, &off, &hold_s])?;
            threshold.judge_value(&mut to.lock(), name, &value, build_alarm_text(&level, en, zh)?)
        },
    );
}

fn build_alarm_text(level: &str, en: Text, zh: Text) -> ScriptResult<AlarmText> {
    let Some(level) = AlarmLevel::from_word(level) else {
        return Err(format!("\"{level}\" is no level; write \"info\", \"warning\" or \"critical\"").into());
    };
    Ok(AlarmText { level, en, zh })
}

/// A number; the absence of one is told apart from a wrong type.
fn require_number(function: &str, value: &Dynamic) -> ScriptResult<f64> {
    match read_optional_number(function, value)? {
        Some(number) => Ok(number),
        None => Err(Box::new(EvalAltResult::ErrorRuntime(Dynamic::UNIT, Position::NONE))),
    }
}

/// A number, or no value.
fn read_optional_number(function: &str, value: &Dynamic) -> ScriptResult<Option<f64>> {
    if value.is_unit() {
        return Ok(None);
    }
    let whole = || value.as_int().map(|whole| whole as f64);
    let number = value.as_float().or_else(|_| whole());
    number.map(Some).map_err(|_| format!("{function} needs a number, not {}", describe_type(value)).into())
}
