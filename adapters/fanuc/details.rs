//! The slow group: what holds between two readings and may be a second old. Parts, gear stage, times, texts, codes and tool
//! life, of the path that is written to.
//!
//! Only values that hold between readings: one that is interpolated would keep all the others waiting for it. What a control
//! does not have is asked for once per connection.

use super::alarms;
use super::answer::{FocasAnswer, OperatorMessage, PastAlarm};
use super::item::{BlockWord, FocasItem, Question, Spindle, Timer};
use super::line::Asked;
use super::readings::build_reading;
use super::states::OrAbsence;
use super::view::{View, to_number_value, to_text_value};
use adapter_core::channel::ChannelId;
use adapter_core::reading::{Absence, Reading, Stamp, Value};

/// Parameters of the parts made, made in all, and required.
const PARTS: FocasItem = FocasItem::Parameter(6711, 0);
const PARTS_TOTAL: FocasItem = FocasItem::Parameter(6712, 0);
const PARTS_REQUIRED: FocasItem = FocasItem::Parameter(6713, 0);
const GEAR: FocasItem = FocasItem::Spindles(Spindle::Gear);
/// Bytes of the block that runs.
const BLOCK: FocasItem = FocasItem::ExecutedText(112);
/// At most so many messages are shown.
const MESSAGES: FocasItem = FocasItem::Messages(2);
/// So many of the last alarms are shown.
const ALARMS_SHOWN: u16 = 3;

/// Numbers of the group, whose items are read as they are.
const NUMBERS: [(&str, FocasItem); 4] =
    [("part_count", PARTS), ("gear_stage", GEAR), ("parts_total", PARTS_TOTAL), ("parts_required", PARTS_REQUIRED)];

const TIMES: [(&str, FocasItem); 4] = [
    ("power_on_time_s", FocasItem::Timer(Timer::PowerOn)),
    ("operating_time_s", FocasItem::Timer(Timer::Operating)),
    ("cutting_time_s", FocasItem::Timer(Timer::Cutting)),
    ("cycle_time_s", FocasItem::Timer(Timer::Cycle)),
];

/// The others, in the order of [`find_other_values`].
const OTHERS: [&str; 8] = [
    "block_text",
    "operator_message",
    "g_codes",
    "m_code",
    "main_program",
    "alarm_history",
    "tool_life",
    "tool_life_used",
];

/// Channels of the group; without details the first two only.
pub(super) fn list_channels(details: bool) -> Vec<ChannelId> {
    let names = NUMBERS.iter().chain(&TIMES).map(|(name, _)| *name).chain(OTHERS);
    names.take(if details { usize::MAX } else { 2 }).filter_map(ChannelId::from_name).collect()
}

/// What changes slowly: parts and gear stage, without the details that a source asks for besides.
#[must_use]
pub fn list_slow_questions(path: u8) -> Vec<Question> {
    list_questions(path, false)
}

/// What is asked for.
pub(super) fn list_questions(path: u8, details: bool) -> Vec<Question> {
    let others = [
        BLOCK,
        MESSAGES,
        FocasItem::GCodes,
        FocasItem::ModalWord(BlockWord::M),
        FocasItem::Program,
        FocasItem::HistoryCount,
        FocasItem::ToolGroup,
    ];
    let items = NUMBERS.iter().chain(&TIMES).map(|(_, item)| *item).chain(others);
    items.take(if details { usize::MAX } else { 2 }).map(|item| item.to_question(path)).collect()
}

/// What has to be asked for besides, which follows from the first answers: the last alarms, the life of the tools in use, and
/// the path of a main program that has no number.
pub(super) fn list_further_questions(asked: &Asked) -> Vec<Question> {
    let view = View { asked, path: asked.path };
    let whole = |item| match view.find_answer(item) {
        Ok(FocasAnswer::Whole(whole)) => u16::try_from(*whole).ok().filter(|whole| *whole > 0),
        _ => None,
    };
    let first = |last: u16| last.saturating_sub(ALARMS_SHOWN - 1).max(1);
    let history = whole(FocasItem::HistoryCount).map(|last| FocasItem::AlarmHistory(first(last), last));
    let life = whole(FocasItem::ToolGroup).map(FocasItem::ToolLife);
    let is_named = matches!(view.find_answer(FocasItem::Program), Ok(FocasAnswer::Program { main: 0, .. }));
    let main = is_named.then_some(FocasItem::MainProgram);
    history.into_iter().chain(life).chain(main).map(|item| item.to_question(asked.path)).collect()
}

/// The readings of the group. `further` are the results of what was asked for besides.
pub(super) fn append_readings(asked: &Asked, further: Option<&Asked>, details: bool, out: &mut Vec<Reading>) {
    let view = View { asked, path: asked.path };
    let stamp = Stamp::of_request(asked.began_ns, asked.ended_ns);
    let numbers = NUMBERS.iter().map(|(name, item)| (*name, to_number_value(view.find_number(*item))));
    let times = TIMES.iter().map(|(name, item)| (*name, to_number_value(find_seconds(&view, *item))));
    let others = OTHERS.into_iter().zip(find_other_values(&view, further));
    let all = numbers.chain(times).chain(others).take(if details { usize::MAX } else { 2 });
    let named = all.filter_map(|(name, value)| ChannelId::from_name(name).map(|channel| (channel, value)));
    out.extend(named.map(|(channel, value)| build_reading(channel, stamp, value)));
}

fn find_seconds(view: &View<'_>, item: FocasItem) -> OrAbsence<f64> {
    match view.find_answer(item)? {
        FocasAnswer::Time { minutes, milliseconds } => {
            Ok(f64::from(*minutes) * 60.0 + f64::from(*milliseconds) / 1000.0)
        }
        _ => Err(Absence::OutOfRange),
    }
}

fn find_other_values(view: &View<'_>, further: Option<&Asked>) -> [OrAbsence<Value>; 8] {
    let block = match view.find_answer(BLOCK) {
        Ok(FocasAnswer::Named { name, .. }) => Ok(name.lines().next().unwrap_or_default().trim().to_owned()),
        other => other.and(Err(Absence::OutOfRange)),
    };
    let messages = match view.find_answer(MESSAGES) {
        Ok(FocasAnswer::Messages(messages)) => Ok(join_messages(messages)),
        other => other.and(Err(Absence::OutOfRange)),
    };
    let codes = match view.find_answer(FocasItem::GCodes) {
        Ok(FocasAnswer::Names(codes)) => Ok(codes.join(" ")),
        other => other.and(Err(Absence::OutOfRange)),
    };
    let m_code = view.find_number(FocasItem::ModalWord(BlockWord::M)).map(|code| format!("M{code}"));
    let [life, used] = find_tool_life(view, further);
    let texts = [block, messages, codes, m_code, main_program(view, further), describe_history(view, further)];
    let [block, messages, codes, m_code, main, history] = texts.map(to_text_value);
    [block, messages, codes, m_code, main, history, to_number_value(life), to_number_value(used)]
}

/// Number and text of every message; a control without one sends a number that is none.
fn join_messages(messages: &[OperatorMessage]) -> String {
    let shown = messages.iter().filter(|message| message.number >= 0 && !message.text.is_empty());
    shown.map(|message| format!("{} {}", message.number, message.text)).collect::<Vec<_>>().join("; ")
}

/// The last alarms, the newest first.
fn describe_history(view: &View<'_>, further: Option<&Asked>) -> OrAbsence<String> {
    let count = view.find_number(FocasItem::HistoryCount)?;
    if count < 1.0 {
        return Ok(String::new());
    }
    let found = further.and_then(|further| {
        let at = further.questions.iter().position(|asked| matches!(asked.item, FocasItem::AlarmHistory(..)))?;
        further.results.get(at)
    });
    match found {
        Some(Ok(FocasAnswer::History(past))) => {
            let axes = view.asked.facts.axes_of(view.path).unwrap_or_default();
            let one = |PastAlarm { alarm, at: [year, month, day, hour, minute, second] }: &PastAlarm| {
                let year = i32::from(*year);
                // Older controls give two digits.
                let year = if year < 100 { 2000 + year } else { year };
                let text = alarms::format_alarm(alarm, axes, view.asked.facts.alarm_table());
                format!("{year:04}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02} {text}")
            };
            Ok(past.iter().rev().map(one).collect::<Vec<_>>().join("; "))
        }
        Some(Ok(_)) => Err(Absence::OutOfRange),
        Some(Err(error)) => Err(error.to_absence()),
        None => Err(Absence::NotSupported),
    }
}

/// Number of the main program, or the end of its path where it has none. Source: FOCAS2 manual, `cnc_rdprgnum`, which gives 0 for a
/// program whose name is no number.
fn main_program(view: &View<'_>, further: Option<&Asked>) -> OrAbsence<String> {
    match view.find_answer(FocasItem::Program)? {
        FocasAnswer::Program { main: 0, .. } => {}
        FocasAnswer::Program { main, .. } => return Ok(format!("O{main}")),
        _ => return Err(Absence::OutOfRange),
    }
    match further.and_then(|further| further.find_item_result(FocasItem::MainProgram)) {
        Some(Ok(FocasAnswer::Text(path))) => Ok(adapter_core::text::last_part(path).to_owned()),
        Some(Err(error)) => Err(error.to_absence()),
        _ => Err(Absence::NotSupported),
    }
}

/// Life and use of the tools in use.
fn find_tool_life(view: &View<'_>, further: Option<&Asked>) -> [OrAbsence<f64>; 2] {
    if let Err(reason) = view.find_answer(FocasItem::ToolGroup) {
        return [Err(reason); 2];
    }
    let found = further.and_then(|further| {
        let at = further.questions.iter().position(|asked| matches!(asked.item, FocasItem::ToolLife(_)))?;
        further.results.get(at)
    });
    match found {
        Some(Ok(FocasAnswer::Life { life, count, .. })) => [Ok(f64::from(*life)), Ok(f64::from(*count))],
        Some(Ok(_)) => [Err(Absence::OutOfRange); 2],
        Some(Err(error)) => [Err(error.to_absence()); 2],
        // No group is in use.
        None => [Err(Absence::NotSupported); 2],
    }
}
