//! A map that a foreign file is proposed: what is sure is taken, what is not is a question, and the file says why.

use adapter_core::bilingual::Bilingual;
use adapter_core::channel::quantity::unit_of;
use recording::Recording;
use recording::read::{ColumnPreview, Preview, preview_rows};
use rules::twin::format_toml_text;
use std::fmt::Write as _;

/// One column of a proposal.
#[derive(Debug, Clone, PartialEq)]
pub struct ProposedColumn {
    /// Its name in the file.
    pub from: String,
    /// What it becomes; `None`: it keeps its name; empty: it is left out.
    pub to: Option<String>,
    /// Its unit, where the file does not say it or a person says another one.
    pub unit: Option<String>,
    /// What it may be, where that is not sure.
    pub candidates: Vec<&'static str>,
    /// It holds the time.
    pub is_time: bool,
}

/// How the columns of a file could be read, before a person has confirmed it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MapProposal {
    /// The columns in the order of the file.
    pub columns: Vec<ProposedColumn>,
    /// The column of time, where a person said it.
    pub time: Option<String>,
}

impl MapProposal {
    /// From how a file is understood.
    #[must_use]
    pub fn from_preview(preview: &Preview) -> Self {
        let column = |column: &ColumnPreview| {
            let sure = column
                .to
                .clone()
                .filter(|to| *to != column.from || unit_of(to).is_some() || column.candidates.is_empty());
            let candidates = if sure.is_some() && sure.as_deref() != Some(column.from.as_str()) {
                Vec::new()
            } else {
                column.candidates.clone()
            };
            ProposedColumn { from: column.from.clone(), to: sure, unit: None, candidates, is_time: column.is_time }
        };
        Self {
            columns: preview.columns.iter().filter(|column| !column.from.is_empty()).map(column).collect(),
            time: None,
        }
    }

    /// Columns that a person has to decide about.
    #[must_use]
    pub fn open_questions(&self) -> Vec<usize> {
        let is_question = |column: &ProposedColumn| {
            let kept = column.to.as_deref().is_none_or(|to| to == column.from);
            !column.is_time && kept && column.candidates.iter().any(|candidate| *candidate != column.from)
        };
        (0..self.columns.len()).filter(|index| is_question(&self.columns[*index])).collect()
    }

    /// The map as TOML, with a word about each line in both languages.
    #[must_use]
    pub fn to_toml(&self, statement: &Bilingual, file: &str) -> String {
        let mut text = format!(
            "# Map of {file}: how it is read. What stands here is not guessed.\n# {file}的映射：如何读取该文件。此处写明的内容不再猜测。\n"
        );
        if !statement.en.is_empty() {
            let _ = write!(text, "# Assumed: {}\n# 假设：{}\n", statement.en, statement.zh);
        }
        text.push_str(
            "# encoding = \"GBK\"      separator = \";\"      decimal = \",\"      header_line = 3      units_line = 4      sheet = \"Data\"\n\
             schema = \"map/1\"\n\n[time]\n# unit = \"ms\"      zone = \"Europe/Berlin\"      order = \"dmy\"      clocks = \"rows\"      set_back = \"join\"\n",
        );
        let time = self
            .time
            .as_deref()
            .or_else(|| self.columns.iter().find(|column| column.is_time).map(|column| column.from.as_str()));
        if let Some(time) = time {
            let _ = writeln!(text, "column = {}", format_toml_text(time));
        }
        for column in self.columns.iter().filter(|column| !column.is_time && Some(column.from.as_str()) != time) {
            text.push_str(&column_toml(column));
        }
        text
    }
}

fn column_toml(column: &ProposedColumn) -> String {
    let to = column.to.as_deref().unwrap_or(&column.from);
    let mut text = format!("\n[[column]]\nfrom = {}\nto = {}\n", format_toml_text(&column.from), format_toml_text(to));
    if let Some(unit) = &column.unit {
        let _ = writeln!(text, "unit = {}", format_toml_text(unit));
    }
    let others: Vec<&str> = column.candidates.iter().copied().filter(|candidate| *candidate != to).collect();
    if !others.is_empty() {
        let _ = writeln!(text, "# may be / 可能是: {}", others.join(", "));
    }
    text
}

/// The first rows as understood: a table of at most so many columns.
#[must_use]
pub fn first_rows(recording: &Recording, rows: usize, columns: usize) -> String {
    let (head, rows) = preview_rows(recording, rows);
    let mut lines: Vec<Vec<String>> = std::iter::once(head).chain(rows).collect();
    lines.iter_mut().for_each(|line| line.truncate(columns + 1));
    let width = |index: usize| lines.iter().map(|line| line[index].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..lines[0].len()).map(width).collect();
    let mut text = String::new();
    for line in &lines {
        for (cell, width) in line.iter().zip(&widths) {
            let room = width.saturating_sub(cell.chars().count());
            let _ = write!(text, "  {cell}{}", " ".repeat(room));
        }
        text.push('\n');
    }
    text
}
