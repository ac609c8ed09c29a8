//! What is wrong with a script, where, and what to do: every message an integrator gets from the script host.

use rhai::{Dynamic, EvalAltResult, ParseError, ParseErrorType, Position};
use std::fmt;

/// One thing that is wrong with a script.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScriptProblem {
    /// The file, as it was named to the host.
    pub file: String,
    /// Line from 1, where it lies in a line.
    pub line: Option<usize>,
    /// Column from 1, where it lies at one.
    pub column: Option<usize>,
    /// What is wrong, in words, without the place.
    pub what: String,
    /// What to do next; may be empty.
    pub next: String,
}

impl ScriptProblem {
    pub(super) fn new(file: &str, at: Position, what: impl Into<String>, next: impl Into<String>) -> Self {
        Self { file: file.to_owned(), line: at.line(), column: at.position(), what: what.into(), next: next.into() }
    }
}

impl fmt::Display for ScriptProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        for number in [self.line, self.column].into_iter().flatten() {
            write!(f, ":{number}")?;
        }
        write!(f, ": {}", self.what)?;
        if self.next.is_empty() { Ok(()) } else { write!(f, "\n    {}", self.next) }
    }
}

/// A text that is no script.
pub(super) fn of_parse(file: &str, error: &ParseError) -> ScriptProblem {
    let (what, next) = match error.err_type() {
        ParseErrorType::BadInput(rhai::LexError::ImproperSymbol(symbol, _)) if symbol == "=" => {
            ("`=` sets a variable; here two values are compared".to_owned(), "write `==`".to_owned())
        }
        ParseErrorType::BadInput(rhai::LexError::ImproperSymbol(symbol, hint))
            if !is_word(symbol) && !hint.is_empty() =>
        {
            (format!("`{symbol}` is no operator of a script"), hint.clone())
        }
        ParseErrorType::Reserved(word) | ParseErrorType::BadInput(rhai::LexError::ImproperSymbol(word, _)) => {
            describe_reserved(word)
        }
        ParseErrorType::MissingToken(token, _) if token == ";" => {
            (error.err_type().to_string(), "end the statement before this place with `;`".to_owned())
        }
        ParseErrorType::MissingToken(token, _) => {
            (error.err_type().to_string(), format!("a `{token}` is missing here"))
        }
        ParseErrorType::UnexpectedEOF => {
            ("the file ends in the middle of a statement".to_owned(), "close every `{` and every `\"`".to_owned())
        }
        ParseErrorType::ExprTooDeep => {
            ("the expression is nested too deeply".to_owned(), "use `let` for its parts".to_owned())
        }
        ParseErrorType::AssignmentToConstant(name) => {
            (format!("`{name}` is a constant and cannot be set"), "write `let` instead of `const`".to_owned())
        }
        other => (other.to_string(), String::new()),
    };
    ScriptProblem::new(file, error.position(), what, next)
}

fn is_word(symbol: &str) -> bool {
    symbol.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

fn describe_reserved(word: &str) -> (String, String) {
    let next = match word {
        "print" | "debug" => "note(\"...\") writes a line into the history",
        "import" | "export" => "each file stands on its own; alarms, notes and requests of all files are joined",
        "eval" => "write the statements themselves",
        _ => "choose another name",
    };
    (format!("`{word}` cannot be used in a script"), next.to_owned())
}

/// The same in a text that was compiled behind `lines` lines of declarations.
pub(super) fn of_run_behind(file: &str, error: &EvalAltResult, lines: usize) -> ScriptProblem {
    let mut problem = of_run(file, error, super::OPERATIONS_MAX);
    problem.line = problem.line.map(|line| line.saturating_sub(lines).max(1));
    problem
}

/// An error while running. `file` is where it happened.
pub(super) fn of_run(file: &str, error: &EvalAltResult, operations: u64) -> ScriptProblem {
    let (inner, at) = find_innermost(error);
    let (what, next) = match inner {
        EvalAltResult::ErrorTooManyOperations(_) => (
            format!("the script did not come to an end within {operations} operations and was stopped"),
            "look for a loop that never ends, or do less at each run".to_owned(),
        ),
        EvalAltResult::ErrorTerminated(..) => (
            "the run lasted too long by the clock and was stopped".to_owned(),
            "do less at each run; if the text is short, the box is overloaded: see the load of its processor"
                .to_owned(),
        ),
        EvalAltResult::ErrorStackOverflow(_) => (
            "functions call each other too deeply".to_owned(),
            "a function that calls itself needs a condition that ends it".to_owned(),
        ),
        EvalAltResult::ErrorDataTooLarge(what, _) => (
            format!("{} grows beyond the limit", what.to_lowercase()),
            "remove old entries; a script is no place for a history".to_owned(),
        ),
        EvalAltResult::ErrorFunctionNotFound(signature, _) => not_found(signature),
        EvalAltResult::ErrorVariableNotFound(name, _) => {
            (format!("there is no `{name}`"), "`cnc-gateway check --vocabulary` lists what there is".to_owned())
        }
        EvalAltResult::ErrorRuntime(value, _) => (value.to_string(), String::new()),
        other => (without_position(other), String::new()),
    };
    ScriptProblem::new(file, at, what, next)
}

fn without_position(error: &EvalAltResult) -> String {
    let mut copy = error.to_string();
    if let Some(at) = copy.rfind(" (line ") {
        copy.truncate(at);
    }
    copy
}

/// `+ (f64, ())` in words.
fn not_found(signature: &str) -> (String, String) {
    let (name, types) = signature.split_once(" (").unwrap_or((signature, ")"));
    let types = types.trim_end_matches(')').replace("i64", "number").replace("f64", "number");
    let types = types.replace("&str | ImmutableString | String", "text").replace('(', "no value");
    let what = format!("`{name}` cannot be used on {}", types.replace(", ", " and "));
    let next = if signature.contains("()") {
        "ask has(x) first, or write (x ?? 0.0) to use another number where x has no value"
    } else {
        "`cnc-gateway check --vocabulary` lists the functions and what they take"
    };
    (what, next.to_owned())
}

/// The error at the bottom of the calls, and where it happened.
fn find_innermost(error: &EvalAltResult) -> (&EvalAltResult, Position) {
    match error {
        EvalAltResult::ErrorInFunctionCall(_, _, inner, at) => {
            let (inner, deeper) = find_innermost(inner);
            (inner, if deeper.is_none() { *at } else { deeper })
        }
        other => (other, other.position()),
    }
}

/// Did the script work on a value that was not there?
pub(super) fn is_absence(error: &EvalAltResult) -> bool {
    match find_innermost(error).0 {
        EvalAltResult::ErrorFunctionNotFound(signature, _) => signature.contains("()"),
        EvalAltResult::ErrorRuntime(value, _) => value.is_unit(),
        _ => false,
    }
}

/// The type of a value, as a reader of the message calls it.
pub(super) fn describe_type(value: &Dynamic) -> &'static str {
    match value.type_name() {
        "i64" | "f64" => "a number",
        "string" | "char" => "text",
        "array" => "a list",
        "map" => "a map",
        "bool" => "true or false",
        _ => "a value of this kind",
    }
}

#[cfg(test)]
mod tests {
    use crate::{ScriptFile, compile_scripts};

    #[test]
    fn an_equals_sign_in_a_condition_is_told_as_such() {
        for (text, part) in [
            ("if state = \"cutting\" { note(\"x\"); }", "write `==`"),
            ("let a = 1;\nif a = 2 { note(\"x\"); }", "write `==`"),
            ("let import = 2;", "each file stands on its own"),
        ] {
            let file = ScriptFile { name: "a.rhai".to_owned(), text: text.to_owned() };
            let told = compile_scripts(&[file]).err().expect("no script");
            let told: Vec<String> = told.iter().map(ToString::to_string).collect();
            assert!(told.iter().any(|it| it.contains(part)), "{text}: {told:?}");
            assert!(!told.iter().any(|it| it.contains("choose another name")), "{told:?}");
        }
    }
}
