//! What a script sees: one table, made from the table of channels and from the estimates.

use super::callable::FUNCTIONS;
use super::events::HANDLERS;
use super::fields::RECORDS;
use super::quantities::{FIGURES, QUANTITIES};
use super::trials::TRIAL_FUNCTIONS;
use adapter_core::clock::SECOND_NS;
use adapter_core::words::of_channel;
use adapter_core::{ChannelId, Sample};
use estimators::loads::Figure;
use estimators::wear::tool_of;
use estimators::{Estimated, Estimates, LoadLossOrigin, NoEstimate, NoLoadOrigin, SETTINGS, State, Visibility};
use std::collections::HashMap;
use std::sync::LazyLock;

/// What kind of value a word has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WordKind {
    /// A number in the unit of the word, or no value.
    Number,
    /// Text, or no value.
    Text,
    /// An object map of the script's own.
    Map,
}

/// One word a script can use as a variable.
#[derive(Debug, Clone, Copy)]
pub struct Word {
    /// Name in the script.
    pub name: &'static str,
    /// Unit symbol; `1` for pure numbers, empty for text.
    pub unit: &'static str,
    /// Number, text or map.
    pub kind: WordKind,
    /// The words that a text can be; empty where it can be any.
    pub one_of: &'static [&'static str],
    /// What it is, in English.
    pub en: &'static str,
    /// What it is, in Chinese.
    pub zh: &'static str,
    pub(super) source: WordSource,
}

/// Where the value of a word comes from.
#[derive(Debug, Clone, Copy)]
pub(super) enum WordSource {
    Channel(ChannelId),
    /// The tool of a name that may name its edge.
    Tool(ChannelId),
    Quantity(fn(&Estimates) -> Estimated),
    Deviation(fn(&Estimates) -> Estimated),
    Figure(fn(&Estimates) -> Figure),
    Number(fn(&View<'_>) -> f64),
    Text(fn(&Estimates) -> &'static str),
    Memory,
}

/// What is looked at in one run.
pub(super) struct View<'a> {
    pub(super) sample: &'a Sample,
    pub(super) estimates: &'a Estimates,
    pub(super) dt_s: f64,
}

/// A word's value in one run.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum WordValue<'a> {
    Number(f64),
    Text(&'a str),
    Absent,
}

impl Word {
    /// The value in this run.
    pub(super) fn read_value<'a>(&self, view: &View<'a>) -> WordValue<'a> {
        match self.source {
            WordSource::Channel(id) => read_channel(view.sample, id),
            WordSource::Tool(id) => {
                view.sample.text(id).map_or(WordValue::Absent, |name| WordValue::Text(tool_of(name)))
            }
            WordSource::Quantity(read) => {
                read(view.estimates).map_or(WordValue::Absent, |it| WordValue::Number(it.value))
            }
            WordSource::Deviation(read) => {
                read(view.estimates).map_or(WordValue::Absent, |it| WordValue::Number(it.sd))
            }
            WordSource::Figure(read) => read(view.estimates).map_or(WordValue::Absent, WordValue::Number),
            WordSource::Number(read) => WordValue::Number(read(view)),
            WordSource::Text(read) => WordValue::Text(read(view.estimates)),
            WordSource::Memory => WordValue::Absent,
        }
    }

    /// Why there is no value, for the operator; `None` when there is one.
    pub(super) fn why_absent(&self, view: &View<'_>) -> Option<String> {
        match self.source {
            WordSource::Channel(id) | WordSource::Tool(id) => {
                view.sample.slot(id).value.as_ref().err().map(ToString::to_string)
            }
            WordSource::Quantity(read) | WordSource::Deviation(read) => {
                read(view.estimates).err().map(|why| why.to_string())
            }
            WordSource::Figure(read) => read(view.estimates).err().map(|why| why.to_string()),
            WordSource::Number(_) | WordSource::Text(_) | WordSource::Memory => None,
        }
    }

    /// Is it a figure without a standard deviation?
    pub(super) fn is_figure(&self) -> bool {
        matches!(self.source, WordSource::Figure(_))
    }

    /// May a script write to it?
    pub(super) fn is_writable(&self) -> bool {
        matches!(self.source, WordSource::Memory)
    }
}

fn read_channel(sample: &Sample, id: ChannelId) -> WordValue<'_> {
    match &sample.slot(id).value {
        Ok(value) => value
            .as_number()
            .map(WordValue::Number)
            .or(value.as_text().map(WordValue::Text))
            .unwrap_or(WordValue::Absent),
        Err(_) => WordValue::Absent,
    }
}

const fn define_word(
    name: &'static str,
    unit: &'static str,
    kind: WordKind,
    texts: (&'static str, &'static str),
    source: WordSource,
) -> Word {
    Word { name, unit, kind, one_of: &[], en: texts.0, zh: texts.1, source }
}

/// The channel that names tool and edge.
const TOOL: &str = "tool";

/// Words that are neither channels nor quantities.
const OWN: [Word; 11] = [
    define_word(
        "state",
        "",
        WordKind::Text,
        ("State of the machine", "机床状态"),
        WordSource::Text(|it| it.state.as_word()),
    ),
    define_word(
        "state_s",
        "s",
        WordKind::Number,
        ("How long the machine has been in this state", "当前状态持续时间"),
        WordSource::Number(|view| since_s(view.sample.at_ns, view.estimates.since_ns)),
    ),
    define_word(
        "unknown_because",
        "",
        WordKind::Text,
        ("Why the state is unknown; empty in every other state", "机床状态未知的原因"),
        WordSource::Text(|it| it.unknown_because.map_or("", NoEstimate::as_word)),
    ),
    define_word(
        "visibility",
        "",
        WordKind::Text,
        ("Can cutting be seen in the power?", "切削是否可分辨"),
        WordSource::Text(|it| it.visibility.as_word()),
    ),
    define_word(
        "no_load_origin",
        "",
        WordKind::Text,
        ("Where the no-load power comes from", "空载功率的来源"),
        WordSource::Text(|it| it.no_load_origin.as_word()),
    ),
    define_word(
        "load_loss_origin",
        "",
        WordKind::Text,
        ("Was the load loss measured on this drive?", "附加损耗是否已标定"),
        WordSource::Text(|it| it.load_loss_origin.as_word()),
    ),
    define_word(
        "cutting_power_comparable_sd_w",
        "W",
        WordKind::Number,
        (
            "One standard deviation of the cutting power where cuts on this drive are compared: without the doubt of its load loss that all of \
             them have in common",
            "同一主轴各次切削相互比较时切削功率的标准不确定度",
        ),
        WordSource::Deviation(Estimates::comparable_cutting_power),
    ),
    define_word(
        "load_held",
        "",
        WordKind::Text,
        ("Why constant load does not raise the feed; empty where nothing is in the way", "恒负荷不提高进给的原因"),
        WordSource::Text(|it| it.loads.load_held),
    ),
    define_word(
        "now_s",
        "s",
        WordKind::Number,
        ("Time of this tick, seconds since 1970", "当前时间"),
        WordSource::Number(|view| since_s(view.sample.at_ns, 0)),
    ),
    define_word(
        "dt_s",
        "s",
        WordKind::Number,
        ("Time since this script ran last; 0 at the first run and after a pause", "距上次运行的时间"),
        WordSource::Number(|view| view.dt_s),
    ),
    define_word(
        "memory",
        "",
        WordKind::Map,
        (
            "What this script remembers between runs, also when the file is changed or the box starts again: memory.count = 1",
            "脚本自身的存储",
        ),
        WordSource::Memory,
    ),
];

fn since_s(now_ns: i64, then_ns: i64) -> f64 {
    now_ns.saturating_sub(then_ns) as f64 / SECOND_NS as f64
}

static STATES: LazyLock<Vec<&str>> = LazyLock::new(|| State::ALL.map(State::as_word).to_vec());
static VISIBILITIES: LazyLock<Vec<&str>> = LazyLock::new(|| Visibility::ALL.map(Visibility::as_word).to_vec());
static LOAD_LOSS_ORIGINS: LazyLock<Vec<&str>> =
    LazyLock::new(|| LoadLossOrigin::ALL.map(LoadLossOrigin::as_word).to_vec());
static ORIGINS: LazyLock<Vec<&str>> = LazyLock::new(|| NoLoadOrigin::ALL.map(NoLoadOrigin::as_word).to_vec());

/// The words that a text of this name can be; empty where it can be any.
fn one_of(name: &str) -> &'static [&'static str] {
    match name {
        "state" => &STATES,
        "visibility" => &VISIBILITIES,
        "no_load_origin" => &ORIGINS,
        "load_loss_origin" => &LOAD_LOSS_ORIGINS,
        _ => of_channel(name).unwrap_or_default(),
    }
}

static WORDS: LazyLock<Vec<Word>> = LazyLock::new(|| {
    let mut words = OWN.to_vec();
    for (name, deviation, unit, en, zh, read) in QUANTITIES {
        words.push(define_word(name, unit, WordKind::Number, (en, zh), WordSource::Quantity(read)));
        let texts = ("One standard deviation of the quantity of this name", "标准不确定度");
        words.push(define_word(deviation, unit, WordKind::Number, texts, WordSource::Deviation(read)));
    }
    for (name, unit, en, zh, read) in FIGURES {
        words.push(define_word(name, unit, WordKind::Number, (en, zh), WordSource::Figure(read)));
    }
    for id in ChannelId::list_all() {
        let row = id.channel();
        let kind = if row.kind == adapter_core::channel::Kind::Text { WordKind::Text } else { WordKind::Number };
        if row.name != TOOL {
            words.push(define_word(row.name, row.unit, kind, (row.en, row.zh), WordSource::Channel(id)));
            continue;
        }
        let texts = ("Tool in use, without its edge: T1 for every edge of T1", "刀具（不含刀刃号）");
        words.push(define_word(TOOL, "", kind, texts, WordSource::Tool(id)));
        let texts = ("Edge in use, as the controller names it: T1-2 is the second edge of T1", "刀刃（控制器名称）");
        words.push(define_word("edge", "", kind, texts, WordSource::Channel(id)));
    }
    words.iter_mut().for_each(|word| word.one_of = one_of(word.name));
    words
});

/// Every word a script can use as a variable: its own, the estimates, the channels.
#[must_use]
pub fn list_words() -> &'static [Word] {
    &WORDS
}

static PLACES: LazyLock<HashMap<&str, usize>> =
    LazyLock::new(|| WORDS.iter().enumerate().map(|(at, word)| (word.name, at)).collect());

/// The word of this name.
pub(super) fn find_word(name: &str) -> Option<&'static Word> {
    PLACES.get(name).and_then(|at| WORDS.get(*at))
}

fn format_table(first: &str, second: &str, rows: impl Iterator<Item = (&'static str, &'static str)>) -> String {
    let rows: String = rows.map(|(code, what)| format!("| `{code}` | {what} |\n")).collect();
    format!("| {first} | {second} |\n|---|---|\n{rows}")
}

/// The whole vocabulary as Markdown, in English or Chinese: what `check --vocabulary` prints.
#[must_use]
pub fn format_vocabulary(chinese: bool) -> String {
    let pick = |en: &'static str, zh: &'static str| if chinese { zh } else { en };
    let mut text = String::from("## Variables\n\n| name | unit | what |\n|---|---|---|\n");
    for word in list_words() {
        let one_of = if word.one_of.is_empty() { String::new() } else { format!(": {}", word.one_of.join(", ")) };
        text += &format!("| `{}` | {} | {}{one_of} |\n", word.name, word.unit, pick(word.en, word.zh));
    }
    text += "\n## Records\n\n";
    text += &format_table("name", "what", RECORDS.iter().map(|it| (it.example, pick(it.en, it.zh))));
    text += "\n## Handlers\n\nFunctions that are called when something happens; they see constants, variables and `memory`.\n\n";
    text += "| function | when |\n|---|---|\n";
    for handler in HANDLERS {
        text += &format!("| `fn {}` | {} |\n", handler.signature, pick(handler.en, handler.zh));
    }
    text += "\n## Functions\n\n";
    text += &format_table("function", "what", FUNCTIONS.iter().map(|it| (it.signature, pick(it.en, it.zh))));
    text += "\n## Trials\n\nFunctions named `trial_...` in the file of the script; `cnc-gateway rules test` runs them. They call:\n\n";
    text += &format_table("function", "what", TRIAL_FUNCTIONS.iter().map(|it| (it.signature, pick(it.en, it.zh))));
    text += "\n`cnc-gateway rules api` lists the methods besides: power separation, curves, compensation, wear.\n";
    text +=
        "\n## Settings\n\nReturned by `fn settings() { #{ name: value } }`, read once when the script is loaded.\n\n";
    text += "| name | unit | default | range | what |\n|---|---|---|---|---|\n";
    for row in SETTINGS {
        let (least, greatest) = row.range;
        text += &format!("| `{}` | {} | {} | {least} to {greatest} | {} |\n", row.name, row.unit, row.default, row.en);
    }
    text += "| `no_load_stage_N` | rpm, W | none | at most 16 points | No-load powers of gear stage N known beforehand: [[rpm, W], ...] |\n";
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_quantity_of_the_estimates_is_a_word() {
        let mut estimates = Estimates::without_samples(0);
        assert!(FIGURES.iter().all(|row| estimates.figure_mut(row.0).is_some()));
        let names: Vec<&str> = QUANTITIES.iter().map(|quantity| quantity.0).collect();
        let expected: Vec<&str> = estimates.list_quantities().iter().map(|quantity| quantity.0).collect();
        assert_eq!(names, expected);
    }

    #[test]
    fn no_name_means_two_things_and_every_text_is_there() {
        let names: BTreeSet<_> = list_words().iter().map(|word| word.name).collect();
        assert_eq!(names.len(), list_words().len());
        assert!(list_words().iter().all(|word| !word.en.is_empty() && !word.zh.is_empty()));
        assert_eq!(
            list_words().len(),
            ChannelId::count_channels() + 1 + OWN.len() + 2 * QUANTITIES.len() + FIGURES.len()
        );
    }
}
