//! Where something stands in a text of a script: calls outside of texts and comments, and what their brackets hold.

use rhai::Position;
use std::ops::Range;

/// A call that was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Call {
    /// The whole of it, from the name to the closing bracket, in bytes.
    pub(crate) span: Range<usize>,
    /// What stands between the brackets, in bytes.
    pub(crate) inside: Range<usize>,
}

/// Every call of a function of this name. A call whose bracket is never closed is left to the compiler.
pub(crate) fn find_calls(text: &str, name: &str) -> Vec<Call> {
    let bytes = text.as_bytes();
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let after = skip_text_or_comment(text, at);
        if after > at {
            at = after;
            continue;
        }
        let begins = text[at..].starts_with(name) && !text[..at].ends_with(part_of_name);
        let open = at + name.len() + text[at..].get(name.len()..).map_or(0, count_blank_bytes);
        if begins && bytes.get(open) == Some(&b'(') {
            if let Some(close) = find_closing_bracket(text, open) {
                found.push(Call { span: at..close + 1, inside: open + 1..close });
            }
            at = open;
        }
        at += text[at..].chars().next().map_or(1, char::len_utf8);
    }
    found
}

fn part_of_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_' || c == '.'
}

/// Bytes of white space at the beginning.
fn count_blank_bytes(text: &str) -> usize {
    text.len() - text.trim_start().len()
}

/// The bracket that closes the one at `open`.
fn find_closing_bracket(text: &str, open: usize) -> Option<usize> {
    let (mut depth, mut at) = (0_usize, open);
    while at < text.len() {
        let after = skip_text_or_comment(text, at);
        if after > at {
            at = after;
            continue;
        }
        let c = text[at..].chars().next()?;
        match c {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => {
                depth = depth.checked_sub(1)?;
                if depth == 0 {
                    return (c == ')').then_some(at);
                }
            }
            _ => {}
        }
        at += c.len_utf8();
    }
    None
}

/// The end of the text or comment that begins here; `at` itself where none does.
pub(crate) fn skip_text_or_comment(text: &str, at: usize) -> usize {
    let rest = &text[at..];
    let to = |found: Option<usize>, more: usize| found.map_or(text.len(), |found| at + found + more);
    if rest.starts_with("//") {
        return to(rest.find('\n'), 0);
    }
    if rest.starts_with("/*") {
        return to(rest.find("*/"), 2);
    }
    match rest.as_bytes().first() {
        Some(b'`') => to(rest[1..].find('`').map(|found| found + 1), 1),
        Some(b'"') => {
            let mut escaped = false;
            let end = rest[1..].find(|c| {
                let ends = c == '"' && !escaped;
                escaped = c == '\\' && !escaped;
                ends
            });
            to(end.map(|found| found + 1), 1)
        }
        _ => at,
    }
}

/// The text at the beginning of this piece, where it is one: `"name"`.
pub(crate) fn read_quoted(text: &str) -> Option<&str> {
    let text = text.trim_start().strip_prefix('"')?;
    text.split_once('"').map(|(inside, _)| inside)
}

/// Line and column of a byte of the text, from 1. The engine counts both in 16 bits: what lies beyond 65535 stands there.
pub(crate) fn to_position(text: &str, at: usize) -> Position {
    let before = &text[..at];
    let line = before.matches('\n').count() + 1;
    let column = before[before.rfind('\n').map_or(0, |end| end + 1)..].chars().count() + 1;
    let short = |number: usize| u16::try_from(number).unwrap_or(u16::MAX);
    Position::new(short(line), short(column))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_is_found_where_it_is_one() {
        let text =
            "// setting(1)\nlet a = setting(\"a) \", 1, #{ en: \"(\" }); // ok\nlet b = my_setting(2) + `setting(3)`;";
        let found = find_calls(text, "setting");
        assert_eq!(found.len(), 1);
        assert_eq!(&text[found[0].inside.clone()], "\"a) \", 1, #{ en: \"(\" }");
        assert!(text[found[0].span.clone()].ends_with(')'));
        assert_eq!(to_position(text, found[0].span.start), Position::new(2, 9));
        assert_eq!(read_quoted(&text[found[0].inside.clone()]), Some("a) "));
        assert!(find_calls("setting(1", "setting").is_empty() && find_calls("setting", "setting").is_empty());
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "(setting|[(){}\\[\\]\"`/*\\\\]|\\PC|\n){0,40}") {
            for call in find_calls(&text, "setting") {
                let _ = (&text[call.span], &text[call.inside]);
            }
        }
    }
}
