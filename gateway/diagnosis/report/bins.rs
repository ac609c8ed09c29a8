//! Columns cut into bins, and how much of a quantity's variation a column tells.

use super::data::Data;
use super::text::{escape_html, format_number};
use recording::{Cells, Numbers, Words, derive_quantity};
use rules::twin::region::Condition;
use std::borrow::Cow;

/// Rows looked at to choose columns and bins.
const SAMPLE_MAX: usize = 40_000;
/// Different values up to which each gets its own bin.
const LEVELS_MAX: usize = 10;
/// Words up to which a text column is an axis.
const WORDS_MAX: usize = 12;
/// Text columns that may be an axis.
const GROUPS: [&str; 5] = ["operation", "tool", "lot", "run", "program"];
/// Quantities computed where the recording lacks them.
const DERIVED: [&str; 4] =
    ["cutting_speed_m_min", "removal_rate_cm3_min", "cutting_time_min", "spindle_acceleration_rpm_per_s"];
/// Words in the names of what is measured, not set: not axes unless the region is described by them.
const MEASURED: [&str; 8] = ["power", "current", "force", "torque", "load", "error", "_missing", "residual"];

/// Where a column's values come from.
enum ColumnSource<'a> {
    Numbers(Cow<'a, Numbers>),
    Words(&'a Words),
    /// Seconds since the run began.
    InRun,
}

/// How values are cut.
enum Cut {
    /// One bin per value.
    Levels(Vec<f64>),
    /// One bin between each two neighbouring edges.
    Edges(Vec<f64>),
    /// One bin per word.
    Words(Vec<String>),
}

/// A column with its bins.
pub(super) struct Binned<'a> {
    pub(super) name: String,
    values: ColumnSource<'a>,
    cut: Cut,
}

impl Binned<'_> {
    pub(super) fn len(&self) -> usize {
        match &self.cut {
            Cut::Levels(levels) => levels.len(),
            Cut::Edges(edges) => edges.len() - 1,
            Cut::Words(words) => words.len(),
        }
    }

    /// Is it a text column?
    pub(super) fn is_text(&self) -> bool {
        matches!(self.cut, Cut::Words(_))
    }

    /// The value in a row of a quantity.
    pub(super) fn value_of_row(&self, data: &Data<'_>, row: usize) -> Option<f64> {
        match &self.values {
            ColumnSource::Numbers(numbers) => numbers.get(row),
            ColumnSource::Words(words) => words.find_code(row).map(f64::from),
            ColumnSource::InRun => {
                let run = data.runs.get(data.run_of(row))?;
                Some(data.time_s(row) - data.time_s(run.rows.start))
            }
        }
    }

    /// The bin of a row.
    pub(super) fn bin_of_row(&self, data: &Data<'_>, row: usize) -> Option<usize> {
        if let (ColumnSource::Words(words), Cut::Words(_)) = (&self.values, &self.cut) {
            return words.find_code(row).and_then(|code| usize::try_from(code).ok());
        }
        let x = self.value_of_row(data, row)?;
        Some(match &self.cut {
            Cut::Levels(levels) => levels.partition_point(|level| *level < x).min(levels.len() - 1),
            Cut::Edges(edges) => edges[1..edges.len() - 1].partition_point(|edge| *edge <= x),
            Cut::Words(_) => return None,
        })
    }

    /// Labels along the axis: where, as a share of its length, and what.
    pub(super) fn format_axis_labels(&self) -> Vec<(f64, String)> {
        let count = self.len() as f64;
        let middle = |index: usize| (index as f64 + 0.5) / count;
        match &self.cut {
            Cut::Levels(levels) => levels.iter().enumerate().map(|(i, x)| (middle(i), format_number(*x))).collect(),
            Cut::Words(words) => words.iter().enumerate().map(|(i, word)| (middle(i), escape_html(word))).collect(),
            Cut::Edges(edges) => {
                let axis = super::axis::Axis { low: edges[0], high: edges[edges.len() - 1] };
                axis.compute_ticks(4.0).into_iter().map(|(x, text)| (axis.to_fraction(x), text)).collect()
            }
        }
    }

    /// A bin in words, escaped.
    pub(super) fn bin_text(&self, index: usize) -> String {
        match &self.cut {
            Cut::Levels(levels) => format_number(levels[index]),
            Cut::Edges(edges) => format!("{} … {}", format_number(edges[index]), format_number(edges[index + 1])),
            Cut::Words(words) => escape_html(&words[index]),
        }
    }
}

/// Rows to look at when choosing.
pub(super) fn sample_rows(data: &Data<'_>) -> Vec<usize> {
    let step = data.count_rows().div_ceil(SAMPLE_MAX).max(1);
    (0..data.count_rows()).step_by(step).filter(|row| data.was_compared(*row)).collect()
}

/// Every column that may be an axis, cut into about `bins` bins.
pub(super) fn list_axis_columns<'a>(data: &Data<'a>, rows: &[usize], bins: usize) -> Vec<Binned<'a>> {
    let recording = data.input.recording;
    let mut sources: Vec<(String, ColumnSource<'a>)> = Vec::new();
    for column in recording.columns().iter().filter(|column| may_be_axis(data, &column.name)) {
        match &column.cells {
            Cells::Numbers(numbers) => {
                sources.push((column.name.clone(), ColumnSource::Numbers(Cow::Borrowed(numbers))))
            }
            Cells::Words(words) if GROUPS.contains(&column.name.as_str()) => {
                sources.push((column.name.clone(), ColumnSource::Words(words)));
            }
            Cells::Words(_) => {}
        }
    }
    for name in DERIVED.into_iter().filter(|name| recording.find_numbers(name).is_none()) {
        if let Some(numbers) = derive_quantity(recording, name) {
            sources.push((name.to_owned(), ColumnSource::Numbers(Cow::Owned(numbers))));
        }
    }
    sources.push(("time_in_run_s".to_owned(), ColumnSource::InRun));
    sources.into_iter().filter_map(|(name, values)| bin_column(data, rows, bins, name, values)).collect()
}

fn may_be_axis(data: &Data<'_>, name: &str) -> bool {
    let declared = data.diagnosis.model.roles.values().any(|column| column == name);
    name != data.diagnosis.output
        && (declared || is_region_column(data, name) || !MEASURED.iter().any(|word| name.contains(word)))
}

/// Is a region described by this column?
pub(super) fn is_region_column(data: &Data<'_>, name: &str) -> bool {
    let by = |condition: &Condition| match condition {
        Condition::Range { column, .. } | Condition::Equals { column, .. } => column == name,
    };
    data.diagnosis.mismatch.iter().any(|region| region.conditions.iter().any(by))
}

fn bin_column<'a>(
    data: &Data<'a>,
    rows: &[usize],
    bins: usize,
    name: String,
    values: ColumnSource<'a>,
) -> Option<Binned<'a>> {
    if let ColumnSource::Words(words) = &values {
        let words = words.words().to_vec();
        let fits = (2..=WORDS_MAX).contains(&words.len());
        return fits.then_some(Binned { name, values, cut: Cut::Words(words) });
    }
    let mut column = Binned { name, values, cut: Cut::Levels(Vec::new()) };
    let mut known: Vec<f64> = rows.iter().filter_map(|row| column.value_of_row(data, *row)).collect();
    known.sort_by(f64::total_cmp);
    let trim = known.len() / 100;
    let (low, high) = (*known.get(trim)?, *known.get(known.len().checked_sub(1 + trim)?)?);
    let mut levels = known;
    levels.dedup();
    column.cut = if levels.len() <= LEVELS_MAX {
        Cut::Levels(levels)
    } else {
        let edge = |k: usize| low + (high - low) * k as f64 / bins as f64;
        Cut::Edges((0..=bins).map(edge).collect())
    };
    let wide = match &column.cut {
        Cut::Edges(_) => high > low,
        _ => column.len() > 1,
    };
    wide.then_some(column)
}

/// Mean and count per cell.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct BinCell {
    pub(super) sum: f64,
    pub(super) squares: f64,
    pub(super) rows: u32,
}

impl BinCell {
    pub(super) fn add(&mut self, x: f64) {
        self.sum += x;
        self.squares += x * x;
        self.rows = self.rows.saturating_add(1);
    }

    pub(super) fn mean(&self) -> f64 {
        self.sum / f64::from(self.rows.max(1))
    }

    /// Half width of the mean's 95 % interval, rows taken as independent.
    pub(super) fn half_width(&self) -> f64 {
        let count = f64::from(self.rows.max(2));
        let variance = (self.squares / count - self.mean() * self.mean()).max(0.0);
        1.96 * (variance / (count - 1.0)).sqrt()
    }
}

/// Share of the variance that lies between the cells, less what chance alone would put there.
pub(super) fn compute_explained_share(cells: &[BinCell]) -> f64 {
    let rows: f64 = cells.iter().map(|cell| f64::from(cell.rows)).sum();
    let sum: f64 = cells.iter().map(|cell| cell.sum).sum();
    let squares: f64 = cells.iter().map(|cell| cell.squares).sum();
    let used = cells.iter().filter(|cell| cell.rows > 0).count() as f64;
    let whole = squares - sum * sum / rows.max(1.0);
    if whole <= 0.0 || rows <= used + 1.0 {
        return 0.0;
    }
    let between: f64 =
        cells.iter().filter(|cell| cell.rows > 0).map(|cell| cell.sum * cell.mean()).sum::<f64>() - sum * sum / rows;
    let chance = (used - 1.0) * (whole - between) / (rows - used);
    (between - chance) / whole
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(values: &[f64]) -> BinCell {
        let mut cell = BinCell::default();
        values.iter().for_each(|x| cell.add(*x));
        cell
    }

    #[test]
    fn a_column_tells_everything_or_nothing() {
        let apart = compute_explained_share(&[cell(&[1.0, 1.01, 0.99]), cell(&[-1.0, -1.01, -0.99])]);
        let alike = compute_explained_share(&[cell(&[1.0, -1.0, 0.5]), cell(&[1.0, -1.0, 0.5])]);
        assert!(apart > 0.999 && alike < 0.05, "{apart} {alike}");
    }
}
