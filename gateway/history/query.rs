//! Questions to a history: which time, which series, how fine, under which conditions.

use super::block::Cells;
use super::error::HistoryError;
use super::reader::Reader;
use super::reason::Reasons;
use super::series::Series;
use super::series_kind::SeriesKind;
use super::walk::{SegmentStretch, Walk};
use adapter_core::channel::find_nearest_name;
use adapter_core::clock::TimeNs;
use adapter_core::tool_name::tool_of;
use std::ops::{ControlFlow, Range};
use std::sync::Arc;

/// The series that the state filter looks at.
pub const STATE_SERIES: &str = "machine_state";

/// A question for samples.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Query {
    /// From this time on; `None` from the beginning.
    pub from_ns: Option<TimeNs>,
    /// Before this time; `None` to the end.
    pub to_ns: Option<TimeNs>,
    /// Names of series; empty asks for every series that anything delivered in that time.
    pub series: Vec<String>,
    /// Only rows in this machine state.
    pub state: Option<String>,
    /// Only rows under this programme.
    pub program: Option<String>,
    /// Only rows with this tool.
    pub tool: Option<String>,
}

impl Query {
    /// Every series from `from_ns` to before `to_ns`.
    #[must_use]
    pub fn between(from_ns: TimeNs, to_ns: TimeNs) -> Self {
        Self { from_ns: Some(from_ns), to_ns: Some(to_ns), ..Self::default() }
    }

    /// The same for these series only.
    #[must_use]
    pub fn with_series<'a>(mut self, series: impl IntoIterator<Item = &'a str>) -> Self {
        self.series = series.into_iter().map(str::to_owned).collect();
        self
    }

    pub(crate) fn range(&self) -> Range<TimeNs> {
        self.from_ns.unwrap_or(TimeNs::MIN)..self.to_ns.unwrap_or(TimeNs::MAX)
    }

    /// Does it ask for rows that meet a condition?
    pub(crate) fn has_filter(&self) -> bool {
        self.state.is_some() || self.program.is_some() || self.tool.is_some()
    }
}

/// Consecutive rows of one segment.
#[derive(Debug, Clone)]
pub struct Chunk<'a> {
    /// The segment: time decreases only from one to the next.
    pub segment: i64,
    /// When, row by row.
    pub at_ns: Vec<TimeNs>,
    /// The series asked for.
    pub series: &'a [Series],
    /// Their cells, in the same order.
    pub columns: Vec<Cells>,
    reasons: &'a Reasons,
}

impl Chunk<'_> {
    /// The reason why `columns[column]` has no value in `row`; `None` when it has one.
    #[must_use]
    pub fn missing_reason(&self, column: usize, row: usize) -> Option<&str> {
        self.reasons.find_word(self.columns[column].missing_code(row))
    }
}

/// A condition on text: series and the word it must hold.
type Condition = (i64, String, bool);

impl Reader {
    /// Hands every stretch of rows that answers `query` to `each`, in the order of recording, until it breaks off. All of
    /// it is one moment's view, also while the gateway writes on.
    ///
    /// # Errors
    /// [`HistoryError::Question`] for a series that does not exist, [`HistoryError::Damaged`], or what `SQLite` says.
    pub fn for_each_chunk(
        &self,
        query: &Query,
        mut each: impl FnMut(&Chunk<'_>) -> ControlFlow<()>,
    ) -> Result<(), HistoryError> {
        let _view = self.begin_view()?;
        let known: Arc<[Series]> = self.read_series()?.into();
        let wanted = self.resolve_series(query, &known)?;
        let conditions = build_conditions(query, &known)?;
        let mut walk = Walk::new(&self.db, query.range(), known)?;
        while let Some(stretch) = walk.next(&self.db)? {
            let rows = find_matching_rows(&mut walk, &stretch, &conditions)?;
            if rows.is_empty() {
                continue;
            }
            let chunk = read_chunk(&mut walk, &stretch, &rows, &wanted)?;
            let chunk = Chunk { reasons: &walk.reasons, ..chunk };
            if each(&chunk).is_break() {
                break;
            }
        }
        self.note_damage(&walk);
        Ok(())
    }

    /// The series that `query` asks for.
    pub(crate) fn resolve_series(&self, query: &Query, known: &Arc<[Series]>) -> Result<Vec<Series>, HistoryError> {
        if !query.series.is_empty() {
            return query.series.iter().map(|name| find_series(known, name).cloned()).collect();
        }
        Ok(self.find_delivered(query, known)?.into_iter().map(|(series, _)| series).collect())
    }

    /// The series that anything delivered in the time of `query`, and whether a value of them is missing anywhere.
    pub(crate) fn find_delivered(
        &self,
        query: &Query,
        known: &Arc<[Series]>,
    ) -> Result<Vec<(Series, bool)>, HistoryError> {
        let _view = self.begin_view()?;
        let mut seen = vec![(false, false); known.len()];
        let mut walk = Walk::new(&self.db, query.range(), known.clone())?;
        while let Some(stretch) = walk.next(&self.db)? {
            for (id, missing) in stretch.delivered_series(known) {
                if let Some(index) = known.iter().position(|series| series.id == id) {
                    seen[index].0 = true;
                    seen[index].1 |= missing;
                }
            }
        }
        let found = known.iter().zip(seen).filter(|(_, (delivered, _))| *delivered);
        Ok(found.map(|(series, (_, missing))| (series.clone(), missing)).collect())
    }
}

/// The series called `name`.
pub(crate) fn find_series<'a>(known: &'a [Series], name: &str) -> Result<&'a Series, HistoryError> {
    known.iter().find(|series| *series.name == *name).ok_or_else(|| {
        let hint = find_nearest_name(name, known.iter().map(|series| &*series.name));
        let hint = hint.map_or_else(
            || "`cnc-gateway history query --sql 'SELECT name, unit FROM series'` lists what is stored".to_owned(),
            |near| format!("did you mean {near}?"),
        );
        HistoryError::Question(format!("this history has no series {name}; {hint}"))
    })
}

fn build_conditions(query: &Query, known: &[Series]) -> Result<Vec<Condition>, HistoryError> {
    let asked = [(STATE_SERIES, &query.state), ("program", &query.program), ("tool", &query.tool)];
    let set = asked.into_iter().filter_map(|(name, word)| word.as_ref().map(|word| (name, word)));
    set.map(|(name, word)| {
        let series = find_series(known, name)?;
        if series.kind == SeriesKind::Text {
            return Ok((series.id, word.clone(), name == "tool"));
        }
        Err(HistoryError::Question(format!("the series {name} of this history holds numbers, not words")))
    })
    .collect()
}

/// The rows of `stretch` in the range that meet every condition.
fn find_matching_rows(
    walk: &mut Walk,
    stretch: &SegmentStretch,
    conditions: &[Condition],
) -> Result<Vec<usize>, HistoryError> {
    let mut rows: Vec<usize> = walk.rows_of(stretch).collect();
    for (series, word, tool) in conditions {
        let Some(cells) = walk.read_cells(stretch, *series)? else { return Ok(Vec::new()) };
        // Asked for a tool, every edge of it is meant.
        let is = |found: &str| found == word || *tool && tool_of(found) == word;
        rows.retain(|row| cells.word_at(*row).is_some_and(is));
    }
    Ok(rows)
}

static NO_REASONS: Reasons = Reasons::none();

fn read_chunk<'a>(
    walk: &mut Walk,
    stretch: &SegmentStretch,
    rows: &[usize],
    wanted: &'a [Series],
) -> Result<Chunk<'a>, HistoryError> {
    let whole = rows.len() == stretch.at_ns.len();
    let mut columns = Vec::with_capacity(wanted.len());
    for series in wanted {
        columns.push(match walk.read_cells(stretch, series.id)? {
            None => Cells::not_provided(rows.len()),
            Some(cells) if whole => cells,
            Some(cells) => cells.select_rows(rows),
        });
    }
    let at_ns = rows.iter().map(|row| stretch.at_ns[*row]).collect();
    Ok(Chunk { segment: stretch.segment, at_ns, series: wanted, columns, reasons: &NO_REASONS })
}
