//! The functions through which a script leaves its effects: requests, alarms, notes, channels of its own, and what it
//! remembers.

use super::collect::{RunOutput, ScriptResult};
use super::decision::{AlarmLevel, Axis, Stop};
use super::engine::Shared;
use super::problem::spoken;
use super::timers::AlarmText;
use super::vocabulary::{WordKind, find};
use rhai::{Dynamic, Engine, EvalAltResult, ImmutableString, Position};

type Text = ImmutableString;

/// Makes every one of them callable; their effects go to `shared`.
pub(super) fn register(engine: &mut Engine, shared: &Shared) {
    engine.register_fn("has", |value: Dynamic| !value.is_unit());
    engine.register_fn("clamp", |value: Dynamic, least: Dynamic, greatest: Dynamic| -> ScriptResult<f64> {
        let (least, greatest) = (number("clamp", &least)?, number("clamp", &greatest)?);
        Ok(number("clamp", &value)?.max(least).min(greatest))
    });
    settings(engine, shared);
    memory(engine, shared);
    requests(engine, shared);
    alarms(engine, shared);
    alarm_when(engine, shared);
    threshold(engine, shared, "alarm_above", 1.0);
    threshold(engine, shared, "alarm_below", -1.0);
}

/// `setting` stands in a text only until its value is put in its place; `setting_now` is what is put there where the value depends
/// on the tool or the operation.
fn settings(engine: &mut Engine, shared: &Shared) {
    engine.register_fn("setting", |_: Text, default: Dynamic, _: Dynamic| default);
    let to = shared.clone();
    engine.register_fn("setting_now", move |index: i64| {
        let collected = to.lock();
        let at = usize::try_from(index).ok();
        at.zip(collected.live.as_ref()).and_then(|(at, live)| live.get(at).cloned()).unwrap_or(Dynamic::UNIT)
    });
}

fn memory(engine: &mut Engine, shared: &Shared) {
    let to = shared.clone();
    engine.register_fn("note", move |text: Text| to.lock().note(text));
    let to = shared.clone();
    engine.register_fn("held_s", move |name: Text, condition: bool| {
        let collected = &mut *to.lock();
        collected.timers.held_s(&name, condition, collected.now_ns)
    });
    let to = shared.clone();
    engine.register_fn("changed", move |name: Text, value: Dynamic| to.lock().timers.changed(&name, value));
    let to = shared.clone();
    engine.register_fn("remember", move |name: Text, value: Dynamic| -> ScriptResult<()> {
        let value = optional("remember", &value)?;
        to.lock().timers.remember(&name, value)
    });
    let to = shared.clone();
    engine.register_fn("recall", move |name: Text| to.lock().timers.recall(&name));
    let to = shared.clone();
    engine.register_fn("remembered", move || to.lock().timers.remembered());
    let to = shared.clone();
    engine.register_fn("learn_anew", move |program: Text| to.lock().learn_anew(program));
    let to = shared.clone();
    engine.register_fn("forget", move |beginning: Text| to.lock().forget(&beginning));
}

fn requests(engine: &mut Engine, shared: &Shared) {
    let to = shared.clone();
    engine.register_fn("request_feed_override", move |pct: Dynamic, reason: Text| -> ScriptResult<()> {
        let pct = number("request_feed_override", &pct)?;
        to.lock().request = Some((pct, reason));
        Ok(())
    });
    let to = shared.clone();
    engine.register_fn("follow_feed_override", move |name: Text, reason: Text| -> ScriptResult<()> {
        let word = find(&name).filter(|word| word.kind == WordKind::Number);
        let word = word.ok_or_else(|| format!("`{name}` is no number that could be followed"))?;
        to.lock().follows = Some((word, reason));
        Ok(())
    });
    for (function, stop) in [("request_feed_hold", Stop::FeedHold), ("request_tool_change", Stop::ToolChange)] {
        let to = shared.clone();
        engine.register_fn(function, move |reason: Text| to.lock().stop(stop, reason));
    }
    let to = shared.clone();
    engine.register_fn("propose_offset_um", move |axis: Text, offset: Dynamic, reason: Text| -> ScriptResult<()> {
        let offset_um = number("propose_offset_um", &offset)?;
        let axis =
            Axis::of(&axis).ok_or_else(|| format!("there is no axis \"{axis}\"; write \"x\", \"y\" or \"z\""))?;
        to.lock().offset(axis, (offset_um, reason));
        Ok(())
    });
    let to = shared.clone();
    engine.register_fn("publish", move |name: Text, value: Dynamic, _unit: Text| -> ScriptResult<()> {
        let value = optional("publish", &value)?.filter(|value| value.is_finite());
        to.lock().publish(name, value);
        Ok(())
    });
}

fn alarms(engine: &mut Engine, shared: &Shared) {
    let to = shared.clone();
    engine.register_fn("alarm", move |name: Text, text: Text| to.lock().alarm(name, AlarmText::of(text)));
    let to = shared.clone();
    engine.register_fn("alarm", move |name: Text, level: Text, en: Text, zh: Text| -> ScriptResult<()> {
        to.lock().alarm(name, leveled(&level, en, zh)?)
    });
    let to = shared.clone();
    engine.register_fn("raise_alarm", move |name: Text, text: Text| to.lock().timers.raise(name, AlarmText::of(text)));
    let to = shared.clone();
    engine.register_fn("raise_alarm", move |name: Text, level: Text, en: Text, zh: Text| -> ScriptResult<()> {
        to.lock().timers.raise(name, leveled(&level, en, zh)?)
    });
    let to = shared.clone();
    engine.register_fn("clear_alarm", move |name: Text| to.lock().timers.clear(&name));
}

fn alarm_when(engine: &mut Engine, shared: &Shared) {
    let to = shared.clone();
    engine.register_fn(
        "alarm_when",
        move |name: Text, condition: bool, hold_s: Dynamic, text: Text| -> ScriptResult<()> {
            let hold_s = number("alarm_when", &hold_s)?;
            to.lock().alarm_turning(name, Some(condition), hold_s, AlarmText::of(text))
        },
    );
    let to = shared.clone();
    engine.register_fn(
        "alarm_when",
        move |name: Text, condition: bool, hold_s: Dynamic, level: Text, en: Text, zh: Text| -> ScriptResult<()> {
            let hold_s = number("alarm_when", &hold_s)?;
            to.lock().alarm_turning(name, Some(condition), hold_s, leveled(&level, en, zh)?)
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
        let (on, off, hold_s) = (number(function, on)?, number(function, off)?, number(function, hold_s)?);
        if sign * off > sign * on {
            let what = format!("{function}: `off` = {off} lies beyond `on` = {on}; the alarm would never be quiet");
            return Err(what.into());
        }
        Ok(Self { function, sign, on, off, hold_s })
    }

    fn judge(&self, collected: &mut RunOutput, name: Text, value: &Dynamic, text: AlarmText) -> ScriptResult<()> {
        let beyond = if collected.timers.alarm_active(&name) { self.off } else { self.on };
        let beside = |value: f64| self.sign * value > self.sign * beyond;
        let wanted = if value.is_unit() { None } else { Some(beside(number(self.function, value)?)) };
        collected.alarm_turning(name, wanted, self.hold_s, text)
    }
}

/// `alarm_above` with sign 1, `alarm_below` with sign -1.
fn threshold(engine: &mut Engine, shared: &Shared, function: &'static str, sign: f64) {
    let to = shared.clone();
    engine.register_fn(
        function,
        move |name: Text, value: Dynamic, on: Dynamic, off: Dynamic, hold_s: Dynamic, text: Text| -> ScriptResult<()> {
            let threshold = HysteresisThreshold::read(function, sign, [&on, &off, &hold_s])?;
            threshold.judge(&mut to.lock(), name, &value, AlarmText::of(text))
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
            threshold.judge(&mut to.lock(), name, &value, leveled(&level, en, zh)?)
        },
    );
}

fn leveled(level: &str, en: Text, zh: Text) -> ScriptResult<AlarmText> {
    let Some(level) = AlarmLevel::of(level) else {
        return Err(format!("\"{level}\" is no level; write \"info\", \"warning\" or \"critical\"").into());
    };
    Ok(AlarmText { level, en, zh })
}

/// A number; the absence of one is told apart from a wrong type.
fn number(function: &str, value: &Dynamic) -> ScriptResult<f64> {
    match optional(function, value)? {
        Some(number) => Ok(number),
        None => Err(Box::new(EvalAltResult::ErrorRuntime(Dynamic::UNIT, Position::NONE))),
    }
}

/// A number, or no value.
fn optional(function: &str, value: &Dynamic) -> ScriptResult<Option<f64>> {
    if value.is_unit() {
        return Ok(None);
    }
    let whole = || value.as_int().map(|whole| whole as f64);
    let number = value.as_float().or_else(|_| whole());
    number.map(Some).map_err(|_| format!("{function} needs a number, not {}", spoken(value)).into())
}
