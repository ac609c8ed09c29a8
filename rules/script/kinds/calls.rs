//! Arguments of the functions of the host that are wrong whatever the machine does.

use super::{ExpressionKind, KindMistake, LikeWords, UNITS_OFF, WordInUse, infer_kind, near_word};
use crate::decision::{AlarmLevel, Axis};
use crate::vocabulary::{WordKind, find_word, list_words};
use rhai::{Expr, FnCallExpr, ImmutableString, Position};

/// What an argument has to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wants {
    Text,
    Number,
    /// Percent of the programmed feed.
    Percent,
    Flag,
    Level,
    Axis,
    /// The name of an estimate or a channel with a number.
    NumberWord,
    Anything,
}

use Wants::{Anything, Flag, Level, Number, Percent, Text};

/// The functions whose arguments are looked at, by name and number of arguments.
const WANTED: [(&str, &[Wants]); 24] = [
    ("alarm", &[Text, Text]),
    ("alarm", &[Text, Level, Text, Text]),
    ("raise_alarm", &[Text, Text]),
    ("raise_alarm", &[Text, Level, Text, Text]),
    ("clear_alarm", &[Text]),
    ("alarm_when", &[Text, Flag, Number, Text]),
    ("alarm_when", &[Text, Flag, Number, Level, Text, Text]),
    ("alarm_above", &[Text, Number, Number, Number, Number, Text]),
    ("alarm_above", &[Text, Number, Number, Number, Number, Level, Text, Text]),
    ("alarm_below", &[Text, Number, Number, Number, Number, Text]),
    ("alarm_below", &[Text, Number, Number, Number, Number, Level, Text, Text]),
    ("request_feed_override", &[Percent, Text]),
    ("follow_feed_override", &[Wants::NumberWord, Text]),
    ("learn_anew", &[Text]),
    ("request_feed_hold", &[Text]),
    ("request_tool_change", &[Text]),
    ("propose_offset_um", &[Wants::Axis, Number, Text]),
    ("publish", &[Text, Number, Text]),
    ("note", &[Text]),
    ("held_s", &[Text, Flag]),
    ("changed", &[Text, Anything]),
    ("remember", &[Text, Number]),
    ("recall", &[Text]),
    ("clamp", &[Number, Number, Number]),
];

/// Below this a number of percent is a share: nobody asks for a feed of 1 %.
const SHARE_MAX: f64 = 2.0;
/// Greatest feed override that a control knows, %.
const PERCENT_MAX: f64 = 254.0;

/// What is wrong with the arguments of this call.
pub(crate) fn find_call_mistakes(call: &FnCallExpr, like: LikeWords<'_>) -> Vec<KindMistake> {
    let name = call.name.as_str();
    if let ("given", [Expr::Map(entries, _)]) = (name, &call.args[..]) {
        return entries.0.iter().filter_map(|(word, value)| find_given_mistake(&word.name, value)).collect();
    }
    let Some((_, wanted)) = WANTED.iter().find(|(known, wants)| *known == name && wants.len() == call.args.len())
    else {
        return Vec::new();
    };
    wanted
        .iter()
        .zip(&call.args)
        .filter_map(|(wants, given)| find_argument_mistake(name, *wants, given, like))
        .collect()
}

/// A text that a trial gives and that never comes from a machine.
fn find_given_mistake(name: &str, value: &Expr) -> Option<KindMistake> {
    let seen = WordInUse::from_word(name, find_word(name).filter(|word| word.kind == WordKind::Text)?);
    let Expr::StringConstant(text, at) = value else { return None };
    let known = seen.one_of.is_empty() || seen.one_of.contains(&text.as_str());
    (!known).then(|| (*at, format!("`{name}` is never \"{text}\""), seen.right_word(text)))
}

fn find_argument_mistake(function: &str, wants: Wants, given: &Expr, like: LikeWords<'_>) -> Option<KindMistake> {
    let at = given.position();
    let value = infer_kind(given, like);
    let wrong = |what: String, next: &str| Some((at, what, next.to_owned()));
    match (wants, &value) {
        (Number | Percent, ExpressionKind::Text(text)) => {
            wrong(format!("`{function}` needs a number here, not the text \"{text}\""), UNITS_OFF)
        }
        (Number | Percent, ExpressionKind::Word(seen)) if seen.kind == WordKind::Text => wrong(
            format!("`{function}` needs a number here, and `{}` is a text", seen.name),
            "name a channel with a number",
        ),
        (Number | Percent, ExpressionKind::Flag) => {
            wrong(format!("`{function}` needs a number here, not true or false"), "write 1.0 or 0.0")
        }
        (Percent, ExpressionKind::Number(pct)) => find_percent_mistake(function, *pct, at),
        (Flag, ExpressionKind::Word(_) | ExpressionKind::Number(_) | ExpressionKind::SomeNumber) => {
            super::compare::find_condition_mistake(given, like)
        }
        (Flag, ExpressionKind::Text(text)) => wrong(
            format!("`{function}` needs a condition here, not the text \"{text}\""),
            "write a comparison: x > 5.0",
        ),
        (Level, ExpressionKind::Text(text)) if AlarmLevel::from_word(text).is_none() => {
            let words = AlarmLevel::ALL.map(AlarmLevel::as_word);
            Some((at, format!("\"{text}\" is no level of an alarm"), right_word(text, &words)))
        }
        (Wants::Axis, ExpressionKind::Text(text)) if Axis::from_word(text).is_none() => {
            let words = Axis::ALL.map(Axis::as_word);
            // Of names of one letter every one is near to every other.
            Some((at, format!("there is no axis \"{text}\""), format_list(&words)))
        }
        (Wants::NumberWord, ExpressionKind::Text(text)) => {
            let numbers = || list_words().iter().filter(|word| word.kind == WordKind::Number).map(|word| word.name);
            if numbers().any(|name| name == *text) {
                return None;
            }
            Some((
                at,
                format!("`{text}` is no number that `{function}` could follow"),
                right_word(text, &numbers().collect::<Vec<_>>()),
            ))
        }
        (Text | Level | Wants::Axis, ExpressionKind::Number(number)) => {
            wrong(format!("`{function}` needs a text here, not the number {number}"), "write it in quotes")
        }
        (Text | Level | Wants::Axis, ExpressionKind::Word(seen)) if seen.kind == WordKind::Number => {
            let what = format!("`{function}` needs a text here, and `{}` is a number", seen.name);
            Some((at, what, format!("write it into a text: `${{{}}}` between backquotes", seen.name)))
        }
        _ => None,
    }
}

/// An override is written in percent of the programmed feed.
fn find_percent_mistake(function: &str, pct: f64, at: Position) -> Option<KindMistake> {
    if pct > 0.0 && pct < SHARE_MAX {
        let what = format!("`{function}` takes percent of the programmed feed, and {pct} is a share");
        return Some((at, what, format!("write {}", 100.0 * pct)));
    }
    if (0.0..=PERCENT_MAX).contains(&pct) {
        return None;
    }
    let what = format!("{pct} is no feed override");
    Some((at, what, format!("it is a number from 0 to {PERCENT_MAX}, in percent of the programmed feed")))
}

fn right_word(text: &str, words: &[&str]) -> String {
    near_word(text, words.iter().copied())
        .map_or_else(|| format_list(words), |near| format!("did you mean \"{near}\"?"))
}

/// A list that is short enough to be read, or where to find it.
fn format_list(words: &[&str]) -> String {
    if words.len() > 12 {
        return "`cnc-gateway check --vocabulary` lists them".to_owned();
    }
    format!("write one of {}", words.join(", "))
}

/// The names of alarms in one file: those that are raised, and those that are cleared or expected.
#[derive(Debug, Default)]
pub(crate) struct AlarmNames {
    raised: Vec<ImmutableString>,
    used: Vec<(ImmutableString, Position)>,
    /// A name is put together while the script runs: then nothing is known.
    built: bool,
}

impl AlarmNames {
    /// Notes the alarm that a call raises, clears or expects.
    pub(crate) fn add(&mut self, call: &FnCallExpr) {
        let raises = ["alarm", "raise_alarm", "alarm_when", "alarm_above", "alarm_below"].contains(&call.name.as_str());
        let uses = ["clear_alarm", "expect_alarm", "expect_no_alarm"].contains(&call.name.as_str());
        match call.args.first() {
            Some(Expr::StringConstant(name, _)) if raises => self.raised.push(name.clone()),
            Some(Expr::StringConstant(name, at)) if uses => self.used.push((name.clone(), *at)),
            Some(_) if raises => self.built = true,
            _ => {}
        }
    }

    /// Names that nothing in this file raises.
    pub(crate) fn list_mistakes(&self) -> Vec<KindMistake> {
        let unknown = |name: &ImmutableString| !self.built && !self.raised.contains(name);
        let told = |(name, at): &(ImmutableString, Position)| {
            let near = near_word(name, self.raised.iter().map(ImmutableString::as_str));
            let next = near.map_or_else(
                || "write the name of an alarm that this script raises".to_owned(),
                |near| format!("did you mean \"{near}\"?"),
            );
            (*at, format!("this script raises no alarm \"{name}\""), next)
        };
        self.used.iter().filter(|(name, _)| unknown(name)).map(told).collect()
    }
}
