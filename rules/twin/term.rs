//! Terms of a `linear` part: a column, `one`, a power, a sign, an absolute value or a delay of a column.

use physics::Scene;
use physics::state::delay_values;
use thiserror::Error;

/// Why a text is no term.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum TermError {
    /// A power other than 2 and 3; holds the whole text.
    #[error("{0}: the power must be 2 or 3")]
    Power(String),
    /// A delay without a comma; holds the whole text.
    #[error("{0}: write delay(column, seconds)")]
    DelayForm(String),
    /// A delay that is no finite number; holds the whole text.
    #[error("{0}: the delay must be a number of seconds")]
    DelaySeconds(String),
    /// Where a column should stand: empty, or with characters that no name has.
    #[error("{0:?} is not the name of a column")]
    ColumnName(String),
}

/// One term, read from its text.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    text: String,
    law: TermKind,
}

#[derive(Debug, Clone, PartialEq)]
enum TermKind {
    One,
    Column(String),
    Power(String, i32),
    Sign(String),
    Abs(String),
    Delay(String, f64),
}

impl Term {
    /// Parses `one`, `column`, `column^2`, `column^3`, `sign(column)`, `abs(column)` or `delay(column, 0.5)`.
    ///
    /// # Errors
    /// [`TermError`].
    pub fn parse(text: &str) -> Result<Self, TermError> {
        let whole = || text.to_owned();
        let trimmed = text.trim();
        let law = if trimmed == "one" {
            TermKind::One
        } else if let Some((column, power)) = trimmed.split_once('^') {
            let power = power.trim().parse().ok().filter(|power| [2, 3].contains(power));
            TermKind::Power(parse_column_name(column)?, power.ok_or_else(|| TermError::Power(whole()))?)
        } else if let Some(inside) = parse_call_argument(trimmed, "sign") {
            TermKind::Sign(parse_column_name(inside)?)
        } else if let Some(inside) = parse_call_argument(trimmed, "abs") {
            TermKind::Abs(parse_column_name(inside)?)
        } else if let Some(inside) = parse_call_argument(trimmed, "delay") {
            let (column, delay) = inside.split_once(',').ok_or_else(|| TermError::DelayForm(whole()))?;
            let delay = delay.trim().parse().ok().filter(|delay: &f64| delay.is_finite());
            TermKind::Delay(parse_column_name(column)?, delay.ok_or_else(|| TermError::DelaySeconds(whole()))?)
        } else {
            TermKind::Column(parse_column_name(trimmed)?)
        };
        Ok(Self { text: trimmed.to_owned(), law })
    }

    /// The term as the file has it, without spaces around it.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The column it reads; `None` for `one`.
    #[must_use]
    pub fn input(&self) -> Option<&str> {
        match &self.law {
            TermKind::One => None,
            TermKind::Column(name)
            | TermKind::Power(name, _)
            | TermKind::Sign(name)
            | TermKind::Abs(name)
            | TermKind::Delay(name, _) => Some(name),
        }
    }

    /// Its values, `None` when the column is missing.
    #[must_use]
    pub fn compute_column(&self, scene: &Scene) -> Option<Vec<f64>> {
        let Some(input) = self.input() else { return Some(vec![1.0; scene.rows()]) };
        let values = scene.column(input)?;
        Some(match &self.law {
            TermKind::One | TermKind::Column(_) => values.to_vec(),
            TermKind::Power(_, power) => values.iter().map(|x| x.powi(*power)).collect(),
            TermKind::Sign(_) => values.iter().map(|x| if *x == 0.0 { 0.0 } else { x.signum() }).collect(),
            TermKind::Abs(_) => values.iter().map(|x| x.abs()).collect(),
            TermKind::Delay(_, delay_s) => delay_values(scene, values, *delay_s),
        })
    }
}

fn parse_call_argument<'a>(text: &'a str, function: &str) -> Option<&'a str> {
    text.strip_prefix(function)?.trim_start().strip_prefix('(')?.strip_suffix(')')
}

fn parse_column_name(text: &str) -> Result<String, TermError> {
    let text = text.trim();
    let fine = !text.is_empty() && text.chars().all(|c| c.is_alphanumeric() || c == '_');
    if fine { Ok(text.to_owned()) } else { Err(TermError::ColumnName(text.to_owned())) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_of_the_contract_is_understood() {
        for text in ["one", "velocity_m_s", "a^2", "a^3", "sign(a)", "abs(a)", "delay(a, 0.5)"] {
            assert!(Term::parse(text).is_ok(), "{text}");
        }
        for text in ["a^4", "sin(a)", "delay(a)", ""] {
            assert!(Term::parse(text).is_err(), "{text}");
        }
    }
}
