//! Handlers: functions whose body runs as a piece of the script, so that it sees the same variables and `memory`.
//!
//! A function of the language sees nothing but its arguments. So the body of a handler is compiled by itself: the text of the
//! file with everything else blanked out, which keeps line and column of every message.

use super::compile::ScriptFile;
use super::events::{EventKind, handled};
use super::problem::{self, Problem};
use rhai::{AST, Engine, ImmutableString, Position};

/// A handler, ready to run.
pub(super) struct Handling {
    pub(super) kind: EventKind,
    pub(super) name: ImmutableString,
    pub(super) parameters: Vec<ImmutableString>,
    /// As written, to look through.
    pub(super) plain: AST,
    pub(super) ast: AST,
}

/// Every handler of a file; `whole` is the file, compiled without optimization.
pub(super) fn handlers(
    file: &ScriptFile,
    whole: &AST,
    checking: &Engine,
    running: &Engine,
    problems: &mut Vec<Problem>,
) -> Vec<Handling> {
    let mut found = Vec::new();
    for function in whole.iter_fn_def() {
        let (begin, end) = (function.body.start_position(), function.body.end_position());
        let kind = match handled(&file.name, &function.name, function.params.len(), begin) {
            Ok(Some(kind)) => kind,
            Ok(None) => continue,
            Err(problem) => {
                problems.push(problem);
                continue;
            }
        };
        let text = only(&file.text, begin, end);
        let compiled = checking.compile(&text).and_then(|plain| Ok((plain, running.compile(&text)?)));
        match compiled {
            Ok((plain, ast)) => {
                let (name, parameters) = (function.name.clone(), function.params.to_vec());
                found.push(Handling { kind, name, parameters, plain, ast });
            }
            Err(error) => problems.push(problem::of_parse(&file.name, &error)),
        }
    }
    found.sort_by_key(|handler| handler.kind);
    found
}

/// The functions of a file that are no handlers.
pub(super) fn functions_but(whole: &AST, handlers: &[Handling]) -> AST {
    let mut functions = whole.clone_functions_only();
    functions.retain_functions(|_, _, name, _| !handlers.iter().any(|handler| handler.name == name));
    functions
}

/// The text between two positions, everything else blank; lines and columns stay.
fn only(text: &str, begin: Position, end: Position) -> String {
    let key = |at: Position| (at.line().unwrap_or(usize::MAX), at.position().unwrap_or(0));
    let (begin, end, mut line, mut column) = (key(begin), key(end), 1, 0);
    let keep = |c: char| {
        if c == '\n' {
            (line, column) = (line + 1, 0);
            return c;
        }
        column += 1;
        if (line, column) > begin && (line, column) < end { c } else { ' ' }
    };
    text.chars().map(keep).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_stands_where_it_stood() {
        let text = "let x = 1; // 中文\nfn f() {\n  x\n}\nlet y;";
        let left = only(text, Position::new(2, 8), Position::new(4, 1));
        assert_eq!(left.trim(), "x");
        assert_eq!(left.lines().nth(2), Some("  x"));
        assert_eq!(left.chars().count(), text.chars().count());
    }
}
