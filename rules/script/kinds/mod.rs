//! What kind of value an expression has, as far as that is known before a script runs, and what can therefore never be true.
//!
//! `state == "cuting"`, `coolant_on == false` and `program == 1234` compile, and the rule behind them never fires. What each
//! channel and estimate can be is known, so all of these are told when the file is read, with the right word.
//!
//! | file | what |
//! |---|---|
//! | `compare` | comparisons, lists, conditions |
//! | `calls` | arguments of the functions of the host: levels, axes, percents, names of alarms |
//! | `switch` | the cases of a `switch` over a word |

pub(super) mod calls;
pub(super) mod compare;
pub(super) mod switch;

use super::fields;
use super::vocabulary::{Word, WordKind, find_word};
use adapter_core::ChannelId;
use adapter_core::channel::find_nearest_name;
use rhai::{Expr, Position};

/// What to do with a text in the place of a number.
const UNITS_OFF: &str = "write the number without quotes and without its unit";

/// A mistake: where, what is wrong, what to write.
pub(super) type KindMistake = (Position, String, String);

/// Something that a script can look at, with what is known of its values.
#[derive(Debug, Clone)]
pub(super) struct WordInUse {
    /// As it is written.
    name: String,
    kind: WordKind,
    /// The words that a text can be; empty: any.
    one_of: Vec<&'static str>,
    /// Least and greatest value of a channel.
    range: Option<(f64, f64)>,
    unit: &'static str,
}

impl WordInUse {
    fn from_word(name: &str, word: &'static Word) -> Self {
        let channel = ChannelId::from_name(word.name).map(ChannelId::channel);
        let range = channel.filter(|_| word.kind == WordKind::Number).map(|channel| channel.range);
        Self { name: name.to_owned(), kind: word.kind, one_of: word.one_of.to_vec(), range, unit: word.unit }
    }

    /// A number that is 0 or 1.
    fn is_switch(&self) -> bool {
        self.kind == WordKind::Number && self.unit == "1" && self.range == Some((0.0, 1.0))
    }

    /// How to ask for a number in place of true or false.
    fn suggest_comparison(&self) -> String {
        let Self { name, .. } = self;
        if self.is_switch() {
            format!("write `{name} > 0` for on and `{name} == 0` for off")
        } else {
            format!("compare it: `{name} > 0`; whether it has a value is has({name})")
        }
    }

    /// The unit behind a number; nothing for pure numbers.
    fn with_unit(&self) -> String {
        if self.unit == "1" || self.unit.is_empty() { String::new() } else { format!(" in {}", self.unit) }
    }

    /// Every word, or the nearest one.
    fn right_word(&self, text: &str) -> String {
        near_word(text, self.one_of.iter().copied()).map_or_else(
            || format!("it is one of {}", self.one_of.join(", ")),
            |near| format!("did you mean \"{near}\"?"),
        )
    }
}

/// The nearest word; capitals do not count.
fn near_word<'w>(text: &str, words: impl Iterator<Item = &'w str> + Clone) -> Option<&'w str> {
    let same = words.clone().find(|word| word.eq_ignore_ascii_case(text));
    same.or_else(|| {
        let small: Vec<(String, &str)> = words.map(|word| (word.to_lowercase(), word)).collect();
        let near = find_nearest_name(&text.to_lowercase(), small.iter().map(|(word, _)| word.as_str()))?.to_owned();
        small.into_iter().find(|(word, _)| *word == near).map(|(_, word)| word)
    })
}

/// What is known of the value of an expression.
#[derive(Debug, Clone)]
pub(super) enum ExpressionKind<'e> {
    Word(WordInUse),
    Number(f64),
    Text(&'e str),
    Flag,
    /// Computed: a number, whatever it is.
    SomeNumber,
    Unknown,
}

/// Names that stand for something of the vocabulary besides its own words: the parameters of a handler.
pub(super) type LikeWords<'a> = &'a [(&'a str, &'static Word)];

/// What is known of this expression.
pub(super) fn infer_kind<'e>(expr: &'e Expr, like: LikeWords<'_>) -> ExpressionKind<'e> {
    match expr {
        Expr::IntegerConstant(number, _) => ExpressionKind::Number(*number as f64),
        Expr::FloatConstant(number, _) => ExpressionKind::Number(**number),
        Expr::StringConstant(text, _) => ExpressionKind::Text(text),
        Expr::BoolConstant(..) | Expr::And(..) | Expr::Or(..) => ExpressionKind::Flag,
        Expr::Variable(name, short, _) if name.0.is_none() && short.is_none() => infer_word_kind(&name.1, like),
        Expr::Dot(pair, ..) => infer_field_kind(&pair.lhs, &pair.rhs),
        Expr::Coalesce(options, _) => options.first().map_or(ExpressionKind::Unknown, |first| infer_kind(first, like)),
        Expr::FnCall(call, _) if call.op_token.is_some() => infer_operation_kind(&call.name, &call.args, like),
        _ => ExpressionKind::Unknown,
    }
}

fn infer_word_kind(name: &str, like: LikeWords<'_>) -> ExpressionKind<'static> {
    let stands_for = like.iter().find(|(known, _)| *known == name).map(|(_, word)| *word);
    match stands_for.or_else(|| find_word(name)).filter(|word| word.kind != WordKind::Map) {
        Some(word) => ExpressionKind::Word(WordInUse::from_word(name, word)),
        None => ExpressionKind::Unknown,
    }
}

/// Kind of a field of a record: `sample.x`, `age_s.x`, `missing.x`.
fn infer_field_kind(left: &Expr, right: &Expr) -> ExpressionKind<'static> {
    let (Expr::Variable(record, ..), Expr::Property(property, _)) = (left, right) else {
        return ExpressionKind::Unknown;
    };
    let Some(found) = fields::find_record(&record.1).and_then(|record| record.find_field(&property.2).ok()) else {
        return ExpressionKind::Unknown;
    };
    let name = format!("{}.{}", record.1, property.2);
    match found.list_reasons() {
        Some(one_of) => ExpressionKind::Word(WordInUse { name, kind: WordKind::Text, one_of, range: None, unit: "" }),
        None if found.is_age() => ExpressionKind::SomeNumber,
        None => ExpressionKind::Word(WordInUse::from_word(&name, found.word)),
    }
}

/// Arithmetic gives a number where one side is one; a comparison is true or false.
fn infer_operation_kind<'e>(operator: &str, operands: &'e [Expr], like: LikeWords<'_>) -> ExpressionKind<'e> {
    let number = |expr: &Expr| match infer_kind(expr, like) {
        ExpressionKind::Number(_) | ExpressionKind::SomeNumber => true,
        ExpressionKind::Word(seen) => seen.kind == WordKind::Number,
        _ => false,
    };
    match operator {
        "-" | "*" | "/" | "%" | "**" if operands.iter().any(number) => ExpressionKind::SomeNumber,
        "+" if operands.iter().all(number) => ExpressionKind::SomeNumber,
        "==" | "!=" | "<" | "<=" | ">" | ">=" | "!" => ExpressionKind::Flag,
        _ => ExpressionKind::Unknown,
    }
}
