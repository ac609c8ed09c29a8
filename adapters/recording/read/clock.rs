//! Which column is the time of the rows, and what its cells are.

use super::cell::Decimal;
use super::cell_unit::plan_cell_units;
use super::convert::utc_or_local;
use super::error::RecordingError;
use super::head::Head;
use super::mapping::Mapping;
use super::moment::{DateOrder, written_moment};
use super::names::ForeignName;
use super::note::Note;
use super::plan::{TimeKind, TimePlan};
use super::survey::ColumnSurvey;
use adapter_core::bilingual::Bilingual;
use adapter_core::channel::unit::{Dimension, Unit};

/// What is known of the columns of a table.
pub(super) struct ForeignColumns<'a> {
    pub(super) file: &'a str,
    pub(super) head: &'a Head,
    pub(super) names: &'a [ForeignName],
    pub(super) surveys: &'a [ColumnSurvey],
    pub(super) mapping: &'a Mapping,
    /// The decimal sign of the file, where it is one.
    pub(super) decimal: Option<Decimal>,
}

/// Columns with a time of their own.
pub(super) struct OwnClock {
    pub(super) time: TimePlan,
    pub(super) columns: Vec<usize>,
}

impl ForeignColumns<'_> {
    pub(super) fn build_header_error(&self, en: String, zh: String) -> RecordingError {
        RecordingError::Header { file: self.file.to_owned(), line: self.head.line, reason: Bilingual::new(en, zh) }
    }

    /// Mostly moments of a calendar, or digits of which every one is.
    fn has_moments(&self, index: usize) -> bool {
        let survey = &self.surveys[index];
        let moments = survey.moments + survey.instants + survey.locals;
        moments > 0 && 2 * moments > survey.count_filled()
            || self.is_compact(index, survey.compact_moments)
            || self.is_compact(index, survey.compact_dates)
    }

    fn has_times_of_day(&self, index: usize) -> bool {
        let survey = &self.surveys[index];
        survey.times_of_day > 0 && 2 * survey.times_of_day > survey.count_filled()
            || self.is_compact(index, survey.compact_times) && self.find_compact_date(index).is_some()
    }

    /// Is every number of a column named as time or date of one kind of digits?
    fn is_compact(&self, index: usize, count: u64) -> bool {
        let survey = &self.surveys[index];
        let name = &self.names[index];
        name.unit.is_none()
            && (name.is_time() || name.is_date())
            && count > 0
            && count == survey.count_numbers()
            && count == survey.count_filled()
    }

    /// A column of dates in digits beside one of times in digits.
    fn find_compact_date(&self, index: usize) -> Option<usize> {
        let is_date = |other: &usize| *other != index && self.is_compact(*other, self.surveys[*other].compact_dates);
        (0..self.names.len()).find(is_date)
    }

    fn has_numbers(&self, index: usize) -> bool {
        let survey = &self.surveys[index];
        survey.count_numbers() > 0 && 2 * survey.count_numbers() > survey.count_filled()
    }

    /// Holds dates only, or moments at midnight only.
    fn has_dates_only(&self, index: usize) -> bool {
        let survey = &self.surveys[index];
        self.has_moments(index)
            && (survey.dates == survey.moments + survey.instants + survey.locals && survey.compact_moments == 0)
    }

    fn find_column(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| known.text == name)
    }

    /// The columns of time, the first being that of the first columns.
    pub(super) fn find_clocks(&self, notes: &mut Vec<Note>) -> Result<Vec<TimePlan>, RecordingError> {
        let said = &self.mapping.time;
        if let Some(step_s) = said.step {
            return Ok(vec![self.plan_steps(step_s)]);
        }
        if let (Some(date), Some(clock)) = (&said.date, &said.clock) {
            let (date, clock) = (self.find_given_column(date)?, self.find_given_column(clock)?);
            return Ok(vec![self.plan_date_and_time(clock, Some(date))?]);
        }
        let first = match &said.column {
            Some(name) => self.find_given_column(name)?,
            None => self
                .find_column("time_utc")
                .or_else(|| self.find_column("time_s"))
                .or_else(|| self.head.time.map(|time| time.index))
                .map_or_else(|| self.find_time_column(), Ok)?,
        };
        let mut clocks = vec![self.plan_time(first, notes)?];
        let again = |index: &usize| {
            *index != first && self.names[*index].text == self.names[first].text && !self.names[first].text.is_empty()
        };
        for index in (0..self.names.len()).filter(again) {
            clocks.push(self.plan_time(index, notes)?);
        }
        clocks.sort_by_key(|clock| clock.index);
        Ok(clocks)
    }

    /// The clocks that a map says of single columns.
    pub(super) fn find_own_clocks(&self, notes: &mut Vec<Note>) -> Result<Vec<OwnClock>, RecordingError> {
        let mut found = Vec::new();
        for said in &self.mapping.clock {
            let columns = said.columns.iter().map(|name| self.find_given_column(name)).collect::<Result<_, _>>()?;
            let time = match (&said.time, said.step) {
                (Some(name), _) => self.plan_time(self.find_given_column(name)?, notes)?,
                (None, step_s) => self.plan_steps(step_s.unwrap_or(1.0)),
            };
            found.push(OwnClock { time, columns });
        }
        Ok(found)
    }

    /// The clock of the rows as they are counted.
    pub(super) fn plan_steps(&self, step_s: f64) -> TimePlan {
        let moment = self.mapping.time.start.as_deref().and_then(written_moment);
        let start = moment.and_then(|moment| utc_or_local(moment, DateOrder::DayFirst));
        TimePlan {
            index: None,
            date: None,
            milliseconds: None,
            kind: TimeKind::Step { step_s, start },
            cell_units: None,
            source: "the rows".to_owned(),
        }
    }

    pub(super) fn find_given_column(&self, name: &str) -> Result<usize, RecordingError> {
        let by_number = name.strip_prefix('#').and_then(|number| number.parse::<usize>().ok()?.checked_sub(1));
        let index = self.find_column(name).or(by_number.filter(|index| *index < self.names.len()));
        index.ok_or_else(|| {
            let known = self.list_column_names();
            self.build_header_error(
                format!("the map names a column {name} for its times; the columns are {known}"),
                format!("映射文件为时间指定了列{name}；现有列：{known}"),
            )
        })
    }

    fn list_column_names(&self) -> String {
        let names: Vec<&str> =
            self.names.iter().map(|name| name.text.as_str()).filter(|name| !name.is_empty()).take(30).collect();
        names.join(", ")
    }

    /// By name and content: moments before times of day before numbers; at last a first column of moments without a name.
    fn find_time_column(&self) -> Result<usize, RecordingError> {
        let named = |index: &usize| self.names[*index].is_time() && self.surveys[*index].count_filled() > 0;
        let all = || (0..self.names.len()).filter(named);
        let is_of_time = |index: &usize| {
            let unit = self.names[*index].unit.as_deref().and_then(Unit::from_symbol);
            unit.is_none_or(|unit| unit.dimension == Dimension::Time)
        };
        let found = all()
            .find(|index| self.has_moments(*index) && !self.has_dates_only(*index))
            .or_else(|| all().find(|index| self.has_times_of_day(*index)))
            .or_else(|| {
                all().filter(is_of_time).find(|index| self.has_numbers(*index) && !self.names[*index].is_date())
            })
            .or_else(|| all().filter(is_of_time).find(|index| self.has_numbers(*index) || self.has_moments(*index)))
            .or_else(|| (0..self.names.len()).find(|index| self.has_moments(*index) && !self.has_dates_only(*index)));
        found.ok_or_else(|| {
            let known = self.list_column_names();
            self.build_header_error(
                format!(
                    "no column of time: none is named time_s or time_utc, and none of the others ({known}) is known to hold it. Say in a map which \
                     one it is ([time] column), or, where the rows follow one another evenly, by how many seconds ([time] step = 0.1)"
                ),
                format!("没有时间列：既没有time_s或time_utc，其他列（{known}）也无法识别为时间。请在映射文件中指定时间列（[time] column），或在各行等间隔时指定间隔秒数（[time] step = 0.1）"),
            )
        })
    }

    pub(super) fn plan_time(&self, index: usize, notes: &mut Vec<Note>) -> Result<TimePlan, RecordingError> {
        let survey = &self.surveys[index];
        if self.has_moments(index) {
            let mut plan = self.plan_date_and_time(index, None)?;
            plan.kind = TimeKind::Moments { order: self.find_date_order(index)? };
            return Ok(plan);
        }
        if self.has_times_of_day(index) {
            let date = self.find_compact_date(index).or_else(|| {
                (0..self.names.len()).find(|other| self.names[*other].is_date() && self.has_moments(*other))
            });
            return self.plan_date_and_time(index, date);
        }
        let mut plan = self.plan_date_and_time(index, None)?;
        if self.has_numbers(index) {
            plan.kind = self.plan_numeric_time(index, notes)?;
            let unit = self.mapping.time.unit.as_deref().or(self.names[index].unit.as_deref());
            plan.cell_units = plan_cell_units(survey, unit).filter(|_| self.mapping.time.unit.is_none());
            return Ok(plan);
        }
        let example = survey
            .word_examples
            .first()
            .map_or_else(String::new, |example| format!(" (line {}: {:?})", example.line, example.text));
        Err(self.build_header_error(
            format!("column {} holds no times{example}", plan.source),
            format!("列{}中没有时间{example}", plan.source),
        ))
    }

    /// A time of day, with the date and the milliseconds beside it.
    fn plan_date_and_time(&self, index: usize, date: Option<usize>) -> Result<TimePlan, RecordingError> {
        let source =
            if self.names[index].text.is_empty() { format!("#{}", index + 1) } else { self.names[index].text.clone() };
        let is_part = |other: &usize| {
            *other != index
                && self.names[*other].is_time_part()
                && self.surveys[*other].find_range().is_some_and(|(low, high)| low >= 0.0 && high < 1000.0)
        };
        let milliseconds = (0..self.names.len()).find(is_part).filter(|_| self.has_times_of_day(index));
        let kind = match date {
            Some(date) => TimeKind::Moments { order: self.find_date_order(date)? },
            None => TimeKind::TimesOfDay,
        };
        Ok(TimePlan { index: Some(index), date, milliseconds, kind, cell_units: None, source })
    }

    fn find_date_order(&self, index: usize) -> Result<DateOrder, RecordingError> {
        match self.mapping.time.order.as_deref() {
            Some("mdy") => return Ok(DateOrder::MonthFirst),
            Some(_) => return Ok(DateOrder::DayFirst),
            None => {}
        }
        let name = &self.names[index].text;
        self.surveys[index].order.decide_order().map_err(|()| {
            self.build_header_error(
                format!("the dates of column {name} can be read with the day or with the month first: say which in a map ([time] order = \"dmy\" or \"mdy\")"),
                format!("列{name}的日期既可按日在前也可按月在前理解：请在映射文件中指定（[time] order = \"dmy\"或\"mdy\"）"),
            )
        })
    }
}
