//! The cases of a `switch` over a word of the vocabulary. The compiled form keeps only their hashes, so they are read from the text.

use super::{ExpressionKind, KindMistake, LikeWords, infer_kind};
use crate::declared::scan::{skip_text_or_comment, to_position};
use rhai::{Expr, Position};

/// What is wrong with the cases of the `switch` that looks at this expression.
pub(crate) fn find_case_mistakes(text: &str, looked_at: &Expr, like: LikeWords<'_>) -> Vec<KindMistake> {
    let ExpressionKind::Word(seen) = infer_kind(looked_at, like) else { return Vec::new() };
    if seen.one_of.is_empty() {
        return Vec::new();
    }
    let Some(begin) = to_byte_offset(text, looked_at.position()) else { return Vec::new() };
    let wrong = |(at, case): &(usize, &str)| {
        let known = seen.one_of.contains(case);
        (!known)
            .then(|| (to_position(text, *at), format!("`{}` is never \"{case}\"", seen.name), seen.right_word(case)))
    };
    find_literals(text, begin).iter().filter_map(wrong).collect()
}

/// Byte of a line and column.
fn to_byte_offset(text: &str, at: Position) -> Option<usize> {
    let (line, column) = (at.line()?, at.position()?);
    let before: usize = text.split_inclusive('\n').take(line - 1).map(str::len).sum();
    let rest = text.get(before..)?;
    Some(before + rest.char_indices().nth(column - 1).map_or(rest.len(), |(byte, _)| byte))
}

/// The texts that stand as cases: directly inside the braces, before `=>`.
fn find_literals(text: &str, begin: usize) -> Vec<(usize, &str)> {
    let (mut found, mut open, mut depth, mut at) = (Vec::new(), Vec::new(), 0_usize, begin);
    while at < text.len() {
        let after = skip_text_or_comment(text, at);
        if after > at {
            if depth == 1 && text[at..].starts_with('"') {
                open.push((at, &text[at + 1..after - 1]));
            }
            at = after;
            continue;
        }
        let rest = &text[at..];
        if depth == 1 && rest.starts_with("=>") {
            found.append(&mut open);
        }
        match rest.chars().next() {
            Some('{' | '(' | '[') => depth += 1,
            Some('}' | ')' | ']') if depth <= 1 => return found,
            Some('}' | ')' | ']') => depth -= 1,
            Some(',') if depth == 1 => open.clear(),
            _ => {}
        }
        at += rest.chars().next().map_or(1, char::len_utf8);
    }
    found
}
