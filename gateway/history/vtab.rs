//! The table `samples` of `cnc-gateway history query --sql`: one row per tick over all blocks, one column per series.
//!
//! Columns: `at_ns`, `time_utc` (milliseconds), `segment`, then every series by its name, NULL where there is no value,
//! and hidden beside each `<series>_missing` with the reason. Conditions on `at_ns` and `time_utc` limit which blocks
//! are read; only the series a statement uses are decoded.

use super::block::Cells;
use super::error::{HistoryError, REPAIR};
use super::schema;
use super::series::Series;
use super::series_kind::SeriesKind;
use super::walk::{SegmentStretch, Walk};
use adapter_core::clock::{SECOND_NS, TimeNs};
use rusqlite::types::{Value, ValueRef};
use rusqlite::vtab::{Context, Filters, IndexConstraintOp, IndexInfo};
use rusqlite::{Connection, Error};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ffi::{CString, c_int};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const AT_NS: c_int = 0;
const TIME_UTC: c_int = 1;
const SEGMENT: c_int = 2;
/// Columns before the series.
const FIXED: usize = 3;

pub(super) fn module_error(error: HistoryError) -> Error {
    Error::ModuleError(error.to_string())
}

pub(super) struct Samples {
    path: PathBuf,
    series: Arc<[Series]>,
}

impl Samples {
    pub(super) fn connect(path: &Path) -> Result<Self, Error> {
        let db = schema::open_for_reading(path).map_err(module_error)?;
        let series = schema::known_series(&db).map_err(module_error)?.into();
        Ok(Self { path: path.to_owned(), series })
    }

    /// The statement that declares the columns.
    pub(super) fn declare_columns(&self) -> Result<CString, Error> {
        let mut columns = vec!["at_ns INTEGER".to_owned(), "time_utc TEXT".to_owned(), "segment INTEGER".to_owned()];
        for series in self.series.iter() {
            let kind = if series.kind == SeriesKind::Text { "TEXT" } else { "REAL" };
            columns.push(format!("{} {kind}", quote_name(&series.name)));
        }
        for series in self.series.iter() {
            columns.push(format!("{} TEXT HIDDEN", quote_name(&format!("{}_missing", series.name))));
        }
        Ok(CString::new(format!("CREATE TABLE x({})", columns.join(", ")))?)
    }

    /// Takes over the conditions on time: one letter per argument of [`Cursor::begin_scan`], small for `at_ns`, capital for
    /// `time_utc`. `SQLite` checks them again row by row.
    pub(super) fn plan_query(info: &mut IndexInfo) {
        let mut letters = String::new();
        for (constraint, mut usage) in info.constraints_and_usages() {
            let letter = encode_constraint(constraint.column(), constraint.operator());
            // A condition without a place is left to `SQLite`.
            let place = c_int::try_from(letters.len() + 1);
            if let (Some(letter), Ok(place)) = (letter.filter(|_| constraint.is_usable()), place) {
                letters.push(letter);
                usage.set_argv_index(place);
            }
        }
        // A moment is one row; each bound leaves, say, a quarter. The figures only have to order the plans.
        let moment = letters.contains(['e', 'E']);
        let rows = if moment { 1 } else { 100_000_000 >> (2 * letters.len()) };
        info.set_estimated_rows(rows);
        info.set_estimated_cost(10_000.0 + 10.0 * rows as f64);
        info.set_idx_str(&letters);
    }

    pub(super) fn open_cursor(&self) -> Result<Cursor, Error> {
        let db = schema::open_for_reading(&self.path).map_err(module_error)?;
        // One view for the whole scan, also while the gateway writes on.
        db.execute_batch("BEGIN")?;
        Ok(Cursor { db, series: self.series.clone(), place: None })
    }
}

fn quote_name(name: &str) -> String {
    format!("\"{}\"", name.replace('"', "\"\""))
}

fn encode_constraint(column: c_int, operator: IndexConstraintOp) -> Option<char> {
    use IndexConstraintOp::{
        SQLITE_INDEX_CONSTRAINT_EQ as Equal, SQLITE_INDEX_CONSTRAINT_GE as NotBelow,
        SQLITE_INDEX_CONSTRAINT_GT as Above, SQLITE_INDEX_CONSTRAINT_LE as NotAbove,
        SQLITE_INDEX_CONSTRAINT_LT as Below,
    };
    let letter = match operator {
        Above | NotBelow => 'g',
        Below | NotAbove => 'l',
        Equal => 'e',
        _ => return None,
    };
    match column {
        AT_NS => Some(letter),
        TIME_UTC => Some(letter.to_ascii_uppercase()),
        _ => None,
    }
}

/// Where a scan is.
struct Place {
    walk: RefCell<Walk>,
    stretch: Option<SegmentStretch>,
    rows: Range<usize>,
    cells: RefCell<BTreeMap<i64, Option<Cells>>>,
}

/// One scan of the table.
pub(super) struct Cursor {
    db: Connection,
    series: Arc<[Series]>,
    place: Option<Place>,
}

impl Cursor {
    /// Begins a scan of the range that the arguments leave.
    pub(super) fn begin_scan(&mut self, letters: &str, arguments: &Filters<'_>) -> Result<(), Error> {
        let mut range = TimeNs::MIN..TimeNs::MAX;
        for (letter, argument) in letters.chars().zip(arguments.iter()) {
            let bounds = if letter.is_ascii_lowercase() { number_bounds(argument) } else { text_bounds(argument) };
            if letter != 'l' && letter != 'L' {
                range.start = range.start.max(bounds.start);
            }
            if letter != 'g' && letter != 'G' {
                range.end = range.end.min(bounds.end);
            }
        }
        let walk = Walk::new(&self.db, range, self.series.clone()).map_err(module_error)?;
        self.place =
            Some(Place { walk: RefCell::new(walk), stretch: None, rows: 0..0, cells: RefCell::new(BTreeMap::new()) });
        self.next_stretch()
    }

    pub(super) fn next(&mut self) -> Result<(), Error> {
        let Some(place) = &mut self.place else { return Ok(()) };
        place.rows.start += 1;
        if place.rows.is_empty() { self.next_stretch() } else { Ok(()) }
    }

    fn next_stretch(&mut self) -> Result<(), Error> {
        let Some(place) = &mut self.place else { return Ok(()) };
        let walk = place.walk.get_mut();
        place.stretch = walk.next(&self.db).map_err(module_error)?;
        if let Some(damaged) = walk.damaged.first() {
            // A statement has no way to tell what was left out of a sum.
            return Err(Error::ModuleError(format!(
                "{damaged} were changed by the disk: leave them out with conditions on at_ns; {REPAIR}"
            )));
        }
        place.cells.get_mut().clear();
        place.rows = place.stretch.as_ref().map_or(0..0, |stretch| walk.rows_of(stretch));
        Ok(())
    }

    pub(super) fn is_at_end(&self) -> bool {
        self.place.as_ref().is_none_or(|place| place.stretch.is_none())
    }

    pub(super) fn current_rowid(&self) -> i64 {
        let row = |place: &Place| place.stretch.as_ref().map(|stretch| stretch.first_row + place.rows.start as i64);
        self.place.as_ref().and_then(row).unwrap_or(0)
    }

    pub(super) fn write_column(&self, context: &mut Context, column: c_int) -> Result<(), Error> {
        let Some((place, stretch)) = self.place.as_ref().and_then(|place| Some((place, place.stretch.as_ref()?)))
        else {
            return Ok(());
        };
        match column {
            AT_NS => context.set_result(stretch.at_ns[place.rows.start]),
            TIME_UTC => context.set_result(time_text(stretch.at_ns[place.rows.start])),
            SEGMENT => context.set_result(stretch.segment),
            column => {
                let unknown = || Error::ModuleError(format!("the table of samples has no column {column}"));
                let index = usize::try_from(column).ok().and_then(|column| column.checked_sub(FIXED));
                context.set_result(self.read_cell(place, stretch, index.ok_or_else(unknown)?)?)
            }
        }
    }

    fn read_cell(&self, place: &Place, stretch: &SegmentStretch, index: usize) -> Result<Value, Error> {
        let (series, reason) = match self.series.get(index) {
            Some(series) => (series.id, false),
            None => (self.series[index - self.series.len()].id, true),
        };
        let mut cache = place.cells.borrow_mut();
        if let std::collections::btree_map::Entry::Vacant(vacant) = cache.entry(series) {
            vacant.insert(place.walk.borrow_mut().read_cells(stretch, series).map_err(module_error)?);
        }
        let (cells, row) = (cache.get(&series).and_then(Option::as_ref), place.rows.start);
        if reason {
            let code = cells.map_or(super::reason::NOT_PROVIDED, |cells| cells.missing_code(row));
            let word = place.walk.borrow().reasons.find_word(code).map(str::to_owned);
            return Ok(word.map_or(Value::Null, Value::Text));
        }
        let number = cells.and_then(|cells| cells.number_at(row)).map(Value::Real);
        let text = || cells.and_then(|cells| cells.word_at(row)).map(|word| Value::Text(word.to_owned()));
        Ok(number.or_else(text).unwrap_or(Value::Null))
    }
}

/// Fixed width, so that comparing texts compares times.
fn time_text(at_ns: TimeNs) -> String {
    jiff::Timestamp::from_nanosecond(i128::from(at_ns))
        .map_or_else(|_| at_ns.to_string(), |at| at.strftime("%Y-%m-%dT%H:%M:%S.%3fZ").to_string())
}

fn number_bounds(argument: ValueRef<'_>) -> Range<TimeNs> {
    match argument {
        ValueRef::Integer(at_ns) => at_ns..at_ns.saturating_add(1),
        // A cast saturates at the ends of time, which is what a bound beyond them means; a double is not exact here.
        ValueRef::Real(at_ns) => (at_ns as i64).saturating_sub(1024)..(at_ns as i64).saturating_add(1024),
        _ => TimeNs::MIN..TimeNs::MAX,
    }
}

/// From the beginning to the end of what a time, or the beginning of one (`2026-01-05T08`), names.
fn text_bounds(argument: ValueRef<'_>) -> Range<TimeNs> {
    const FULL: &str = "0000-01-01T00:00:00Z";
    const UNREAD: Range<TimeNs> = TimeNs::MIN..TimeNs::MAX;
    let Ok(text) = argument.as_str() else { return UNREAD };
    let length = text.len().min(19);
    let Some(padded) = text.get(..length).map(|start| format!("{start}{}", &FULL[length..])) else { return UNREAD };
    let Ok(at) = padded.parse::<jiff::Timestamp>() else { return UNREAD };
    let Ok(start_ns) = i64::try_from(at.as_nanosecond()) else { return UNREAD };
    let width_s = match length {
        0..=4 => 366 * 86_400,
        5..=7 => 31 * 86_400,
        8..=10 => 86_400,
        11..=13 => 3_600,
        14..=16 => 60,
        _ => 1,
    };
    start_ns.saturating_sub(SECOND_NS)..start_ns.saturating_add((width_s + 1) * SECOND_NS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_beginning_of_a_time_names_a_range() {
        let bounds = |text: &str| text_bounds(ValueRef::Text(text.as_bytes()));
        let start_ns = 1_767_571_200_000_000_000;
        for text in ["2026-01-05", "2026-01-05T00", "2026-01-05T00:00:00.000Z", "2026-01"] {
            let range = bounds(text);
            assert!(range.contains(&start_ns) && range.end > start_ns, "{text} {range:?}");
        }
        assert_eq!(bounds("soon"), TimeNs::MIN..TimeNs::MAX);
        assert_eq!(bounds("2026-13-77"), TimeNs::MIN..TimeNs::MAX);
        assert_eq!(time_text(start_ns + 120_000_000), "2026-01-05T00:00:00.120Z");
    }
}
