//! What a trial can call.

use super::trial_context::{Theatre, TrialContext};
use crate::callable::{Function, define_function};
use crate::collect::ScriptResult;
use crate::decision::{Axis, Stop};
use rhai::{Dynamic, Engine, ImmutableString, Map};

/// Every function of trials.
pub const TRIAL_FUNCTIONS: &[Function] = &[
    define_function(
        "given(#{ name: value })",
        "From now on the script sees these channels, estimates and `state`; () for no value; what was given before stays",
        "设定脚本看到的通道、估计量和状态",
    ),
    define_function("after_s(seconds)", "Lets time pass: the script runs at every tick of it", "经过若干秒"),
    define_function("pace_s(seconds)", "Ticks come this far apart from now on; 0.1 s unless said", "设定周期"),
    define_function(
        "expect_override(least, greatest)",
        "A feed override in this range is asked for, %",
        "期望倍率请求在此范围",
    ),
    define_function("expect_no_override()", "No feed override is asked for", "期望无倍率请求"),
    define_function("expect_alarm(name)", "The alarm stands", "期望报警有效"),
    define_function("expect_no_alarm(name)", "The alarm does not stand", "期望报警无效"),
    define_function("expect_no_alarms()", "No alarm stands", "期望无任何报警"),
    define_function("expect_feed_hold()", "A feed hold was asked for while time last passed", "期望请求进给保持"),
    define_function("expect_no_feed_hold()", "None was", "期望无进给保持请求"),
    define_function("expect_tool_change()", "A tool change was asked for while time last passed", "期望请求换刀"),
    define_function("expect_no_tool_change()", "None was", "期望无换刀请求"),
    define_function(
        "expect_offset_um(axis, least, greatest)",
        "An offset in this range is proposed, um",
        "期望补偿量在此范围",
    ),
    define_function("expect_no_offset(axis)", "No offset is proposed for the axis", "期望无补偿建议"),
    define_function(
        "expect_published(name, least, greatest)",
        "The channel of the script's own is in this range",
        "期望自定义通道在此范围",
    ),
    define_function(
        "expect_setting(name, least, greatest)",
        "A setting of the estimators is in this range",
        "期望设定值在此范围",
    ),
    define_function("expect_note(part)", "A note with these words was written", "期望写入包含此文字的记录"),
];

type TrialText = ImmutableString;
type Expectation = Result<(), String>;

pub(super) fn register_trial_functions(engine: &mut Engine, theatre: &Theatre) {
    register_time(engine, theatre);
    register_overrides(engine, theatre);
    register_alarms(engine, theatre);
    register_stops(engine, theatre);
    register_numbers(engine, theatre);
    register_settings(engine, theatre);
    let on = theatre.clone();
    engine.register_fn("expect_note", move |part: TrialText| {
        check_expectation(&on, |stage| {
            let said: Vec<&str> = stage.notes().iter().map(|note| &**note).collect();
            let found = said.iter().any(|note| note.contains(part.as_str()));
            found
                .then_some(())
                .ok_or_else(|| format!("expected a note with \"{part}\"; noted: {}", format_names(&said)))
        })
    });
}

fn register_time(engine: &mut Engine, theatre: &Theatre) {
    let on = theatre.clone();
    engine.register_fn("given", move |values: Map| -> ScriptResult<()> {
        let mut stage = on.lock();
        values.iter().try_for_each(|(name, value)| stage.give_value(name, value).map_err(Into::into))
    });
    let on = theatre.clone();
    engine.register_fn("after_s", move |seconds: Dynamic| -> ScriptResult<()> {
        on.lock().pass_time(read_number(&seconds)).map_err(Into::into)
    });
    let on = theatre.clone();
    engine.register_fn("pace_s", move |seconds: Dynamic| -> ScriptResult<()> {
        on.lock().set_pace(read_number(&seconds)).map_err(Into::into)
    });
}

fn register_overrides(engine: &mut Engine, theatre: &Theatre) {
    let asked = |stage: &TrialContext| match &stage.decision().request {
        Some(request) => format!("{:.1} % is asked for ({})", request.pct, request.reason),
        None => format!("none is asked for{}", stage.explain_waiting()),
    };
    let on = theatre.clone();
    engine.register_fn("expect_override", move |least: Dynamic, greatest: Dynamic| {
        check_expectation(&on, |stage| {
            let pct = stage.decision().request.as_ref().map(|request| request.pct);
            let (least, greatest) = (read_number(&least), read_number(&greatest));
            let fits = pct.is_some_and(|pct| pct >= least && pct <= greatest);
            fits.then_some(())
                .ok_or_else(|| format!("expected an override of {least} to {greatest} %; {}", asked(stage)))
        })
    });
    let on = theatre.clone();
    engine.register_fn("expect_no_override", move || {
        check_expectation(&on, |stage| {
            let none = stage.decision().request.is_none();
            none.then_some(()).ok_or_else(|| format!("expected no override; {}", asked(stage)))
        })
    });
}

fn register_alarms(engine: &mut Engine, theatre: &Theatre) {
    let standing = |stage: &TrialContext| {
        let names: Vec<&str> = stage.alarms().iter().map(|alarm| &*alarm.name).collect();
        format!("standing: {}{}", format_names(&names), stage.explain_waiting())
    };
    let stands = |stage: &TrialContext, name: &str| stage.alarms().iter().any(|alarm| *alarm.name == *name);
    let on = theatre.clone();
    engine.register_fn("expect_alarm", move |name: TrialText| {
        check_expectation(&on, |stage| {
            stands(stage, &name).then_some(()).ok_or_else(|| format!("expected the alarm {name}; {}", standing(stage)))
        })
    });
    let on = theatre.clone();
    engine.register_fn("expect_no_alarm", move |name: TrialText| {
        check_expectation(&on, |stage| {
            (!stands(stage, &name))
                .then_some(())
                .ok_or_else(|| format!("expected no alarm {name}; {}", standing(stage)))
        })
    });
    let on = theatre.clone();
    engine.register_fn("expect_no_alarms", move || {
        check_expectation(&on, |stage| {
            let none = stage.alarms().is_empty();
            none.then_some(()).ok_or_else(|| format!("expected no alarm; {}", standing(stage)))
        })
    });
}

fn register_stops(engine: &mut Engine, theatre: &Theatre) {
    let rows = [
        ("expect_feed_hold", Stop::FeedHold, true),
        ("expect_no_feed_hold", Stop::FeedHold, false),
        ("expect_tool_change", Stop::ToolChange, true),
        ("expect_no_tool_change", Stop::ToolChange, false),
    ];
    for (function, stop, wanted) in rows {
        let on = theatre.clone();
        engine.register_fn(function, move || {
            check_expectation(&on, |stage| {
                let (fits, word) = (stage.is_stop_requested(stop) == wanted, stop.as_word());
                let what = if wanted { "was not asked for" } else { "was asked for" };
                fits.then_some(()).ok_or_else(|| format!("{word} {what}{}", stage.explain_waiting()))
            })
        });
    }
}

fn register_numbers(engine: &mut Engine, theatre: &Theatre) {
    let on = theatre.clone();
    engine.register_fn("expect_offset_um", move |axis: TrialText, least: Dynamic, greatest: Dynamic| {
        let what = format!("the offset of {axis}");
        check_expectation(&on, |stage| {
            check_within(&what, stage.offset_um(axis_of(&axis)?), (&least, &greatest), stage)
        })
    });
    let on = theatre.clone();
    engine.register_fn("expect_no_offset", move |axis: TrialText| {
        check_expectation(&on, |stage| match stage.offset_um(axis_of(&axis)?) {
            None => Ok(()),
            Some(offset_um) => Err(format!("expected no offset of {axis}; {offset_um:.1} um is proposed")),
        })
    });
    let on = theatre.clone();
    engine.register_fn("expect_published", move |name: TrialText, least: Dynamic, greatest: Dynamic| {
        check_expectation(&on, |stage| check_within(&name, stage.find_published(&name)?, (&least, &greatest), stage))
    });
}

fn register_settings(engine: &mut Engine, theatre: &Theatre) {
    let on = theatre.clone();
    engine.register_fn("expect_setting", move |name: TrialText, least: Dynamic, greatest: Dynamic| {
        let what = format!("the setting {name}");
        check_expectation(&on, |stage| check_within(&what, stage.find_setting(&name), (&least, &greatest), stage))
    });
}

fn check_within(
    what: &str,
    value: Option<f64>,
    (least, greatest): (&Dynamic, &Dynamic),
    stage: &TrialContext,
) -> Expectation {
    let (least, greatest) = (read_number(least), read_number(greatest));
    match value {
        Some(value) if value >= least && value <= greatest => Ok(()),
        Some(value) => Err(format!("expected {what} from {least} to {greatest}; it is {value}")),
        None => Err(format!("expected {what} from {least} to {greatest}; there is none{}", stage.explain_waiting())),
    }
}

fn axis_of(axis: &str) -> Result<Axis, String> {
    Axis::from_word(axis).ok_or_else(|| format!("there is no axis \"{axis}\"; write \"x\", \"y\" or \"z\""))
}

/// Counts what is met, and says when something was not.
fn check_expectation(on: &Theatre, check: impl FnOnce(&TrialContext) -> Expectation) -> ScriptResult<()> {
    let mut stage = on.lock();
    let outcome = check(&stage);
    match outcome {
        Ok(()) => stage.met += 1,
        Err(what) => return Err(format!("after {:.1} s: {what}", stage.passed_s()).into()),
    }
    Ok(())
}

/// NaN where it is no number, which nothing fits.
fn read_number(value: &Dynamic) -> f64 {
    value.as_float().ok().or_else(|| value.as_int().ok().map(|whole| whole as f64)).unwrap_or(f64::NAN)
}

fn format_names(names: &[&str]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
