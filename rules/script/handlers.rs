//! Handlers, trials and `fn settings()`: functions that the host calls, whose body runs as a piece of the script, so that a handler
//! sees the same variables and `memory`, and the settings see the constants.
//!
//! A function of the language sees nothing but its arguments. So the body of a handler is compiled by itself: the text of the
//! file with everything else blanked out, which keeps line and column of every message.

use super::compile::ScriptFile;
use super::events::{EventKind, classify_handler};
use super::problem::{self, ScriptProblem};
use super::trials::{self, Trial};
use super::variables::ScriptBody;
use rhai::{AST, Engine, ImmutableString, ParseError, Position, ScriptFuncDef};

/// The function that the host calls once, when the file is loaded.
pub(super) const SETTINGS_FUNCTION: &str = "settings";

/// A handler, ready to run.
pub(super) struct Handling {
    pub(super) kind: EventKind,
    pub(super) parameters: Vec<ImmutableString>,
    pub(super) body: ScriptBody,
}

/// A handler as it stands in a file.
pub(super) struct Written {
    pub(super) kind: EventKind,
    name: ImmutableString,
    pub(super) parameters: Vec<ImmutableString>,
    text: String,
    pub(super) plain: AST,
}

/// The functions of a file that the host calls.
#[derive(Default)]
pub(super) struct Called {
    pub(super) handlers: Vec<Written>,
    pub(super) trials: Vec<Trial>,
    /// The body of `fn settings()`.
    pub(super) settings: Option<AST>,
}

/// Every handler and every trial of a file; `whole` is the file, compiled without optimization.
pub(super) fn find_called_functions(
    file: &ScriptFile,
    whole: &AST,
    checking: &Engine,
    problems: &mut Vec<ScriptProblem>,
) -> Called {
    let mut called = Called::default();
    for function in whole.iter_fn_def() {
        if let Err(problem) = called.add(file, function, checking) {
            problems.push(problem);
        }
    }
    called.handlers.sort_by_key(|handler| handler.kind);
    called
}

impl Called {
    fn add(&mut self, file: &ScriptFile, function: &ScriptFuncDef, checking: &Engine) -> Result<(), ScriptProblem> {
        let (begin, end) = (function.body.start_position(), function.body.end_position());
        let (name, parameters) = (function.name.clone(), function.params.to_vec());
        let trial = name.starts_with(trials::PREFIX);
        let kind = classify_handler(&file.name, &name, parameters.len(), begin)?;
        let settings = name == SETTINGS_FUNCTION && parameters.is_empty();
        if !trial && kind.is_none() && !settings {
            return Ok(());
        }
        if trial && !parameters.is_empty() {
            let next = format!("write fn {name}() {{ ... }}");
            return Err(ScriptProblem::new(&file.name, begin, format!("the trial `{name}` has parameters"), next));
        }
        let text = blank_outside(&file.text, begin, end);
        let plain = checking.compile(&text).map_err(|error| problem::of_parse(&file.name, &error))?;
        if settings {
            self.settings = Some(plain);
            return Ok(());
        }
        match kind {
            Some(kind) => self.handlers.push(Written { kind, name, parameters, text, plain }),
            // Compiled as written, so that an error is told at its very place.
            None => self.trials.push(Trial { name: name.to_string(), at: begin, ast: plain.clone(), plain }),
        }
        Ok(())
    }

    /// The handlers, compiled for the variables that they will find: `names`, then their own parameters.
    pub(super) fn compile_handlers(&self, running: &Engine, names: &[String]) -> Result<Vec<Handling>, ParseError> {
        let one = |handler: &Written| {
            let parameters = handler.parameters.iter().map(ToString::to_string);
            let names: Vec<String> = names.iter().cloned().chain(parameters).collect();
            let body = ScriptBody::compile_behind_names(running, &handler.text, &names)?;
            Ok(Handling { kind: handler.kind, parameters: handler.parameters.clone(), body })
        };
        self.handlers.iter().map(one).collect()
    }

    fn has_function(&self, name: &str) -> bool {
        let settings = self.settings.is_some() && name == SETTINGS_FUNCTION;
        settings
            || self.handlers.iter().any(|handler| handler.name == name)
            || self.trials.iter().any(|trial| trial.name == name)
    }

    /// The functions of the file that are the script's own.
    pub(super) fn extract_own_functions(&self, whole: &AST) -> AST {
        let mut functions = whole.clone_functions_only();
        functions.retain_functions(|_, _, name, _| !self.has_function(name));
        functions
    }
}

/// The text between two positions, everything else blank; lines and columns stay.
pub(super) fn blank_outside(text: &str, begin: Position, end: Position) -> String {
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
        let left = blank_outside(text, Position::new(2, 8), Position::new(4, 1));
        assert_eq!(left.trim(), "x");
        assert_eq!(left.lines().nth(2), Some("  x"));
        assert_eq!(left.chars().count(), text.chars().count());
    }
}
