//! Comparisons, lists and conditions that can never be true, or never be computed.

use super::{ExpressionKind, KindMistake, LikeWords, UNITS_OFF, WordInUse, infer_kind};
use crate::vocabulary::WordKind;
use rhai::{Expr, FnCallExpr, Position};

const EQUAL: [&str; 2] = ["==", "!="];
const ORDER: [&str; 4] = ["<", "<=", ">", ">="];

/// What is wrong with a comparison, `x in [...]`, or `!x`.
pub(crate) fn find_operator_mistakes(call: &FnCallExpr, at: Position, like: LikeWords<'_>) -> Vec<KindMistake> {
    let name = call.name.as_str();
    match &call.args[..] {
        [left, right] if EQUAL.contains(&name) || ORDER.contains(&name) => {
            let equal = EQUAL.contains(&name);
            find_pair_mistake(left, right, equal, like)
                .or_else(|| find_pair_mistake(right, left, equal, like))
                .into_iter()
                .collect()
        }
        // `x in list` is compiled as contains(list, x).
        [Expr::Array(items, _), wanted] if name == "contains" => {
            items.iter().filter_map(|item| find_pair_mistake(wanted, item, true, like)).collect()
        }
        [of] if name == "!" => find_condition_mistake(of, like).into_iter().collect(),
        _ => Vec::new(),
    }
    .into_iter()
    .map(|(place, what, next)| (if place.is_none() { at } else { place }, what, next))
    .collect()
}

/// A word beside something that it is compared with.
fn find_pair_mistake(word: &Expr, other: &Expr, equal: bool, like: LikeWords<'_>) -> Option<KindMistake> {
    let ExpressionKind::Word(seen) = infer_kind(word, like) else { return None };
    let at = other.position();
    let WordInUse { name, .. } = &seen;
    let wrong = |what: String, next: String| Some((at, what, next));
    match (seen.kind, infer_kind(other, like)) {
        (WordKind::Text, ExpressionKind::Text(text))
            if !seen.one_of.is_empty() && !seen.one_of.contains(&text) && equal =>
        {
            wrong(format!("`{name}` is never \"{text}\""), seen.right_word(text))
        }
        (WordKind::Text, ExpressionKind::Number(number)) => {
            let what = format!("`{name}` is a text, and no text equals the number {number}");
            wrong(
                what,
                if seen.one_of.is_empty() { format!("write it in quotes: \"{number}\"") } else { seen.right_word("") },
            )
        }
        (WordKind::Text, ExpressionKind::SomeNumber) => wrong(
            format!("`{name}` is a text and is compared with a number"),
            "compare it with a text in quotes".to_owned(),
        ),
        (WordKind::Text, ExpressionKind::Flag) => {
            wrong(format!("`{name}` is a text, not true or false"), format!("whether it has a value is has({name})"))
        }
        (WordKind::Text, ExpressionKind::Word(other)) if other.kind == WordKind::Number => {
            let what = format!("`{name}` is a text and `{}` a number", other.name);
            wrong(what, "nothing can be both; compare it with another one".to_owned())
        }
        (WordKind::Number, ExpressionKind::Text(text)) => {
            let what = format!("`{name}` is a number{}, and no number equals the text \"{text}\"", seen.with_unit());
            wrong(what, UNITS_OFF.to_owned())
        }
        (WordKind::Number, ExpressionKind::Flag) => {
            wrong(format!("`{name}` is a number, not true or false"), seen.suggest_comparison())
        }
        (WordKind::Number, ExpressionKind::Number(number)) => {
            let (least, greatest) = seen.range?;
            let outside = !(least..=greatest).contains(&number);
            let what = format!("`{name}` lies between {least} and {greatest}{}, never at {number}", seen.with_unit());
            outside.then(|| (at, what, "look at the unit of the number".to_owned()))
        }
        _ => None,
    }
}

/// A number or a text where true or false is needed: `if coolant_on { ... }`.
pub(crate) fn find_condition_mistake(expr: &Expr, like: LikeWords<'_>) -> Option<KindMistake> {
    let at = expr.position();
    match infer_kind(expr, like) {
        ExpressionKind::Word(seen) if seen.kind == WordKind::Number => {
            Some((at, format!("`{}` is a number and no condition", seen.name), seen.suggest_comparison()))
        }
        ExpressionKind::Word(seen) => {
            let next = format!("compare it: `{0} == \"...\"`; whether it has a value is has({0})", seen.name);
            Some((at, format!("`{}` is a text and no condition", seen.name), next))
        }
        ExpressionKind::Number(_) | ExpressionKind::SomeNumber => {
            Some((at, "a number is no condition".to_owned(), "compare it with another number".to_owned()))
        }
        _ => None,
    }
}
