//! One thing that is wrong, where, and what to do about it.

use rules::script::ScriptProblem;
use serde::{Deserialize, Serialize};
use std::fmt;

/// One thing that is wrong in a file or a setting that the user wrote.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Problem {
    /// The file, or the environment variable.
    pub file: String,
    /// Line from 1, when the problem lies in a line of text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line: Option<usize>,
    /// Column from 1, in characters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub column: Option<usize>,
    /// What is wrong, without the place and the advice.
    pub what: String,
    /// What to do next.
    pub next: String,
}

impl Problem {
    /// A problem of a whole file or variable.
    #[must_use]
    pub fn in_file(file: impl Into<String>, what: impl Into<String>, next: impl Into<String>) -> Self {
        Self { file: file.into(), line: None, column: None, what: what.into(), next: next.into() }
    }

    /// The same problem at a byte offset of the file's text.
    #[must_use]
    pub fn with_position(mut self, text: &str, offset: usize) -> Self {
        let (line, column) = line_column(text, offset);
        self.line = Some(line);
        self.column = Some(column);
        self
    }
}

impl From<ScriptProblem> for Problem {
    fn from(problem: ScriptProblem) -> Self {
        let ScriptProblem { file, line, column, what, next } = problem;
        Self { file, line, column, what, next }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        for number in [self.line, self.column].into_iter().flatten() {
            write!(f, ":{number}")?;
        }
        write!(f, ": {}", self.what)?;
        if self.next.is_empty() { Ok(()) } else { write!(f, "\n    {}", self.next) }
    }
}

/// Line and column, both from 1, of a byte offset.
fn line_column(text: &str, offset: usize) -> (usize, usize) {
    let mut end = offset.min(text.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let before = &text[..end];
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_columns_count_characters_from_one() {
        assert_eq!(line_column("a\n机床x", 8), (2, 3));
        assert_eq!(line_column("", 0), (1, 1));
        assert_eq!(line_column("机", 1), (1, 1));
        assert_eq!(line_column("ab", 99), (1, 3));
    }
}
