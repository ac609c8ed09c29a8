//! Why a recording cannot be read, and what was refused of one that can.

use adapter_core::bilingual::Bilingual;
use std::fmt;
use thiserror::Error;

/// Why a row was refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RowProblem {
    /// Line of the file, the first being line 1; the row of a workbook.
    pub line: u64,
    /// Column, where one cell is to blame.
    pub column: Option<String>,
    /// What is wrong and what was expected.
    pub reason: String,
}

impl fmt::Display for RowProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}", self.line)?;
        if let Some(column) = &self.column {
            write!(f, ", column {column}")?;
        }
        write!(f, ": {}", self.reason)
    }
}

/// What to do about a file that cannot be read.
fn next_step(error: &std::io::Error) -> &'static str {
    use std::io::ErrorKind::{InvalidData, InvalidInput, IsADirectory, UnexpectedEof};
    match error.kind() {
        UnexpectedEof => "The file ends too early: copy it again.",
        InvalidData | InvalidInput => "The file is damaged: copy or export it again.",
        IsADirectory => "Name a file in it.",
        _ => "Check the path and the permissions.",
    }
}

/// Why a recording cannot be read at all.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be opened or read.
    #[error("{file}: {error}. {}", next_step(.error))]
    Io {
        /// Name of the file, as it was given.
        file: String,
        /// What the system said.
        error: std::io::Error,
    },
    /// The header makes the whole file unusable.
    #[error("{file}, line {line}: {reason}")]
    Header {
        /// Name of the file, as it was given.
        file: String,
        /// Line of the file, counted from 1.
        line: u64,
        /// What is wrong and what was expected.
        reason: Bilingual,
    },
    /// The format is not read, or a bound is met.
    #[error("{file}: {reason}")]
    Format {
        /// Name of the file, as it was given.
        file: String,
        /// What is wrong and what to do.
        reason: Bilingual,
    },
    /// No row of the file can be used.
    #[error("{file}: no usable row{}; a recording is a line of column names, with time_s or a clock among them, and rows of values", describe_first(.problems))]
    Empty {
        /// Name of the file, as it was given.
        file: String,
        /// Refused rows with their reasons.
        problems: Vec<RowProblem>,
    },
}

impl RecordingError {
    /// The format of this file cannot be read.
    pub(super) fn with_format_reason(file: &str, en: impl Into<String>, zh: impl Into<String>) -> Self {
        Self::Format { file: file.to_owned(), reason: Bilingual::new(en, zh) }
    }

    /// The same in Chinese, where it was written in Chinese.
    #[must_use]
    pub fn describe_in_chinese(&self) -> String {
        match self {
            Self::Header { file, line, reason } => format!("{file}，第{line}行：{}", reason.zh),
            Self::Format { file, reason } => format!("{file}：{}", reason.zh),
            Self::Empty { file, problems } => {
                format!(
                    "{file}：没有可用的行{}；记录由一行列名（含time_s或时刻列）和数据行组成",
                    describe_first(problems)
                )
            }
            Self::Io { file, error } => format!("{file}：无法读取（{error}）"),
        }
    }
}

fn describe_first(problems: &[RowProblem]) -> String {
    problems.first().map(|problem| format!("; first problem: {problem}")).unwrap_or_default()
}
