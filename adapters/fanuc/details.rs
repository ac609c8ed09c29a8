//! The slow group: what holds between two readings and may be a second old. Parts, gear stage, times, texts, codes and tool
//! life, of the path that is written to.
//!
//! Only values that hold between readings: one that is interpolated would keep all the others waiting for it. What a control
//! does not have is asked for once per connection.

use super::answer::{Answer, Message, PastAlarm};
use super::item::{Item, Question, Spindle, Timer, Word};
use super::line::Asked;
use super::readings::reading;
use super::states::{self, Found};
use super::view::{View, number, text};
use crate::channel::ChannelId;
use crate::reading::{Absence, Reading, Stamp, Value};

/// Parameters of the parts made, made in all, and required.
const PARTS: Item = Item::Parameter(6711, 0);
const PARTS_TOTAL: Item = Item::Parameter(6712, 0);
const PARTS_REQUIRED: Item = Item::Parameter(6713, 0);
const GEAR: Item = Item::Spindles(Spindle::Gear);
/// Bytes of the block that runs.
const BLOCK: Item = Item::ExecutedText(128);
/// At most so many messages are shown.
const MESSAGES: Item = Item::Messages(2);
/// So many of the last alarms are shown.
const ALARMS_SHOWN: u16 = 3;

/// Numbers of the group, whose items are read as they are.
const NUMBERS: [(&str, Item); 4] =
    [("part_count", PARTS), ("gear_stage", GEAR), ("parts_total", PARTS_TOTAL), ("parts_required", PARTS_REQUIRED)];

/// Meters of time.
const TIMES: [(&str, Item); 4] = [
    ("power_on_time_s", Item::Timer(Timer::PowerOn)),
    ("operating_time_s", Item::Timer(Timer::Operating)),
    ("cutting_time_s", Item::Timer(Timer::Cutting)),
    ("cycle_time_s", Item::Timer(Timer::Cycle)),
];

/// The others, in the order of [`others`].
const OTHERS: [&str; 7] =
    ["block_text", "operator_message", "g_codes", "m_code", "alarm_history", "tool_life", "tool_life_used"];

/// Channels of the group; without details the first two only.
pub(super) fn channels(details: bool) -> Vec<ChannelId> {
    let names = NUMBERS.iter().chain(&TIMES).map(|(name, _)| *name).chain(OTHERS);
    names.take(if details { usize::MAX } else { 2 }).filter_map(ChannelId::of).collect()
}

/// What is asked for.
pub(super) fn questions(path: u8, details: bool) -> Vec<Question> {
    let others = [BLOCK, MESSAGES, Item::GCodes, Item::ModalWord(Word::M), Item::HistoryCount, Item::ToolGroup];
    let items = NUMBERS.iter().chain(&TIMES).map(|(_, item)| *item).chain(others);
    items.take(if details { usize::MAX } else { 2 }).map(|item| item.on(path)).collect()
}

/// What has to be asked for besides, which follows from the first answers: the last alarms, and the life of the tools in
/// use.
pub(super) fn further(asked: &Asked) -> Vec<Question> {
    let view = View { asked, path: asked.path };
    let whole = |item| match view.answer(item) {
        Ok(Answer::Whole(whole)) => u16::try_from(*whole).ok().filter(|whole| *whole > 0),
        _ => None,
    };
    let first = |last: u16| last.saturating_sub(ALARMS_SHOWN - 1).max(1);
    let history = whole(Item::HistoryCount).map(|last| Item::AlarmHistory(first(last), last));
    let life = whole(Item::ToolGroup).map(Item::ToolLife);
    history.into_iter().chain(life).map(|item| item.on(asked.path)).collect()
}

/// The readings of the group. `further` are the results of what was asked for besides.
pub(super) fn readings(asked: &Asked, further: Option<&Asked>, details: bool, out: &mut Vec<Reading>) {
    let view = View { asked, path: asked.path };
    let stamp = Stamp::of_request(asked.began_ns, asked.ended_ns);
    let numbers = NUMBERS.iter().map(|(name, item)| (*name, number(view.number(*item))));
    let times = TIMES.iter().map(|(name, item)| (*name, number(seconds(&view, *item))));
    let others = OTHERS.into_iter().zip(others(&view, further));
    let all = numbers.chain(times).chain(others).take(if details { usize::MAX } else { 2 });
    let named = all.filter_map(|(name, value)| ChannelId::of(name).map(|channel| (channel, value)));
    out.extend(named.map(|(channel, value)| reading(channel, stamp, value)));
}

fn seconds(view: &View<'_>, item: Item) -> Found<f64> {
    match view.answer(item)? {
        Answer::Time { minutes, milliseconds } => Ok(f64::from(*minutes) * 60.0 + f64::from(*milliseconds) / 1000.0),
        _ => Err(Absence::OutOfRange),
    }
}

fn others(view: &View<'_>, further: Option<&Asked>) -> [Found<Value>; 7] {
    let block = match view.answer(BLOCK) {
        Ok(Answer::Named { name, .. }) => Ok(name.lines().next().unwrap_or_default().trim().to_owned()),
        other => other.and(Err(Absence::OutOfRange)),
    };
    let messages = match view.answer(MESSAGES) {
        Ok(Answer::Messages(messages)) => Ok(joined(messages)),
        other => other.and(Err(Absence::OutOfRange)),
    };
    let codes = match view.answer(Item::GCodes) {
        Ok(Answer::Names(codes)) => Ok(codes.join(" ")),
        other => other.and(Err(Absence::OutOfRange)),
    };
    let m_code = view.number(Item::ModalWord(Word::M)).map(|code| format!("M{code}"));
    let [life, used] = life(view, further);
    [text(block), text(messages), text(codes), text(m_code), text(history(view, further)), number(life), number(used)]
}

/// Number and text of every message; a control without one sends a number that is none.
fn joined(messages: &[Message]) -> String {
    let shown = messages.iter().filter(|message| message.number >= 0 && !message.text.is_empty());
    shown.map(|message| format!("{} {}", message.number, message.text)).collect::<Vec<_>>().join("; ")
}

/// The last alarms, the newest first.
fn history(view: &View<'_>, further: Option<&Asked>) -> Found<String> {
    let count = view.number(Item::HistoryCount)?;
    if count < 1.0 {
        return Ok(String::new());
    }
    let found = further.and_then(|further| {
        let at = further.questions.iter().position(|asked| matches!(asked.item, Item::AlarmHistory(..)))?;
        further.results.get(at)
    });
    match found {
        Some(Ok(Answer::History(past))) => {
            let axes = view.asked.facts.axes_of(view.path).unwrap_or_default();
            let one = |PastAlarm { alarm, at: [year, month, day, hour, minute, second] }: &PastAlarm| {
                let year = i32::from(*year);
                // Older controls give two digits.
                let year = if year < 100 { 2000 + year } else { year };
                let text = states::one(alarm, axes);
                format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02} {text}")
            };
            Ok(past.iter().rev().map(one).collect::<Vec<_>>().join("; "))
        }
        Some(Ok(_)) => Err(Absence::OutOfRange),
        Some(Err(error)) => Err(error.absence()),
        None => Err(Absence::NotSupported),
    }
}

/// Life and use of the tools in use.
fn life(view: &View<'_>, further: Option<&Asked>) -> [Found<f64>; 2] {
    if let Err(reason) = view.answer(Item::ToolGroup) {
        return [Err(reason); 2];
    }
    let found = further.and_then(|further| {
        let at = further.questions.iter().position(|asked| matches!(asked.item, Item::ToolLife(_)))?;
        further.results.get(at)
    });
    match found {
        Some(Ok(Answer::Life { life, count, .. })) => [Ok(f64::from(*life)), Ok(f64::from(*count))],
        Some(Ok(_)) => [Err(Absence::OutOfRange); 2],
        Some(Err(error)) => [Err(error.absence()); 2],
        // No group is in use.
        None => [Err(Absence::NotSupported); 2],
    }
}
