//! Which column is the time of the rows, and what its cells are.

use super::cell::Decimal;
use super::error::RecordingError;
use super::head::Head;
use super::mapping::Mapping;
use super::moment::DateOrder;
use super::names::ForeignName;
use super::plan::{Note, NoteKind, TimeKind, TimePlan};
use super::survey::ColumnSurvey;
use adapter_core::bilingual::Bilingual;
use adapter_core::channel::unit::{Dimension, Unit};

/// A step so long, s, in whole numbers and without a unit, may as well be milliseconds.
const LONG_STEP: f64 = 10.0;
/// Days since 1899-12-30 of the years 2000 to 2100.
const EXCEL_DAYS: (f64, f64) = (36_526.0, 73_051.0);

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

impl ForeignColumns<'_> {
    pub(super) fn build_header_error(&self, en: String, zh: String) -> RecordingError {
        RecordingError::Header { file: self.file.to_owned(), line: self.head.line, reason: Bilingual::new(en, zh) }
    }

    /// Mostly moments of a calendar.
    fn has_moments(&self, index: usize) -> bool {
        let survey = &self.surveys[index];
        let moments = survey.moments + survey.instants + survey.locals;
        moments > 0 && 2 * moments > survey.count_filled()
    }

    fn has_times_of_day(&self, index: usize) -> bool {
        let survey = &self.surveys[index];
        survey.times_of_day > 0 && 2 * survey.times_of_day > survey.count_filled()
    }

    fn has_numbers(&self, index: usize) -> bool {
        let survey = &self.surveys[index];
        survey.count_numbers() > 0 && 2 * survey.count_numbers() > survey.count_filled()
    }

    /// Holds dates only, or moments at midnight only.
    fn has_dates_only(&self, index: usize) -> bool {
        let survey = &self.surveys[index];
        self.has_moments(index) && survey.dates == survey.moments + survey.instants + survey.locals
    }

    fn find_column(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|known| known.text == name)
    }

    /// The columns of time, the first being that of the first columns.
    pub(super) fn find_clocks(&self, notes: &mut Vec<Note>) -> Result<Vec<TimePlan>, RecordingError> {
        let first = match &self.mapping.time.column {
            Some(name) => self.find_given_column(name)?,
            None => self
                .find_column("time_utc")
                .or_else(|| self.find_column("time_s"))
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

    fn find_given_column(&self, name: &str) -> Result<usize, RecordingError> {
        let by_number = name.strip_prefix('#').and_then(|number| number.parse::<usize>().ok()?.checked_sub(1));
        let index = self.find_column(name).or(by_number.filter(|index| *index < self.names.len()));
        index.ok_or_else(|| {
            let known = self.list_column_names();
            self.build_header_error(
                format!("the map names {name} as the time; the columns are {known}"),
                format!("映射文件指定{name}为时间列；现有列：{known}"),
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
                     one it is ([time] column), or add one"
                ),
                format!("没有时间列：既没有time_s或time_utc，其他列（{known}）也无法识别为时间。请在映射文件中指定（[time] column），或添加时间列"),
            )
        })
    }

    fn plan_time(&self, index: usize, notes: &mut Vec<Note>) -> Result<TimePlan, RecordingError> {
        let source =
            if self.names[index].text.is_empty() { format!("#{}", index + 1) } else { self.names[index].text.clone() };
        let mut plan = TimePlan { index, date: None, milliseconds: None, kind: TimeKind::TimesOfDay, source };
        let survey = &self.surveys[index];
        if self.has_moments(index) {
            plan.kind = TimeKind::Moments { order: self.find_date_order(index)? };
        } else if self.has_times_of_day(index) {
            plan.date = (0..self.names.len()).find(|other| self.names[*other].is_date() && self.has_moments(*other));
            if let Some(date) = plan.date {
                plan.kind = TimeKind::Moments { order: self.find_date_order(date)? };
            }
            plan.milliseconds = (0..self.names.len()).find(|other| {
                *other != index
                    && self.names[*other].is_time_part()
                    && self.surveys[*other].range.is_some_and(|(low, high)| low >= 0.0 && high < 1000.0)
            });
        } else if self.has_numbers(index) {
            plan.kind = self.plan_numeric_time(index, notes)?;
        } else {
            let example = survey
                .word_examples
                .first()
                .map_or_else(String::new, |example| format!(" (line {}: {:?})", example.line, example.text));
            return Err(self.build_header_error(
                format!("column {} holds no times{example}", plan.source),
                format!("列{}中没有时间{example}", plan.source),
            ));
        }
        Ok(plan)
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

    fn plan_numeric_time(&self, index: usize, notes: &mut Vec<Note>) -> Result<TimeKind, RecordingError> {
        let survey = &self.surveys[index];
        let name = &self.names[index];
        let decimal = super::understand::decimal_of(self, index)?.unwrap_or(Decimal::Point);
        let is_ours = name.text == "time_s";
        let unit = self
            .mapping
            .time
            .unit
            .clone()
            .or_else(|| name.unit.clone().filter(|_| !is_ours))
            .or_else(|| survey.suffix.clone());
        match unit.as_deref() {
            Some("excel") => return Ok(TimeKind::Days { decimal }),
            Some("unix") => return Ok(TimeKind::Unix { decimal, factor: 1.0 }),
            _ => {}
        }
        if let Some(unit) = unit {
            let known = Unit::from_symbol(&unit).filter(|unit| unit.dimension == Dimension::Time);
            let known = known.ok_or_else(|| {
                self.build_header_error(
                    format!("the unit {unit} of the time column {} is none of time", name.text),
                    format!("时间列{}的单位{unit}不是时间单位", name.text),
                )
            })?;
            return Ok(TimeKind::Seconds { decimal, factor: known.factor });
        }
        if self.looks_like_days(index) {
            notes.push(Note::new(
                NoteKind::Assumption,
                format!("{}: days since 1899-12-30, as spreadsheets count them", name.text),
                format!("{}：电子表格的日期序号（自1899-12-30起的天数）", name.text),
            ));
            return Ok(TimeKind::Days { decimal });
        }
        if is_ours {
            return Ok(TimeKind::Seconds { decimal, factor: 1.0 });
        }
        if let Some((low, high)) = survey.range
            && let Some((factor, word)) = since_1970(low, high)
        {
            notes.push(Note::new(
                NoteKind::Assumption,
                format!("{}: {word} since 1970, UTC", name.text),
                format!("{}：自1970年起（UTC），单位{word}", name.text),
            ));
            return Ok(TimeKind::Unix { decimal, factor });
        }
        if survey.mean_step().is_some_and(|step| step >= LONG_STEP) {
            return Err(self.build_header_error(
                format!(
                    "{} has no unit and goes on by {} per row: say in a map whether these are s or ms ([time] unit = \"ms\")",
                    name.text,
                    survey.mean_step().unwrap_or_default()
                ),
                format!("{}没有单位，每行递增{}：请在映射文件中指定单位（[time] unit = \"ms\"或\"s\"）", name.text, survey.mean_step().unwrap_or_default()),
            ));
        }
        notes.push(Note::new(
            NoteKind::Assumption,
            format!("{} in seconds", name.text),
            format!("{}以秒为单位", name.text),
        ));
        Ok(TimeKind::Seconds { decimal, factor: 1.0 })
    }

    /// Spreadsheet days: of this century, and their steps are round in seconds but not as they stand.
    fn looks_like_days(&self, index: usize) -> bool {
        let survey = &self.surveys[index];
        let (Some((low, high)), Some(step)) = (survey.range, survey.mean_step()) else { return false };
        let is_round = |step: f64| {
            let parts = step * 100.0;
            (parts - parts.round()).abs() < 0.02 && parts.round() >= 1.0
        };
        low > EXCEL_DAYS.0
            && high < EXCEL_DAYS.1
            && step > 0.0
            && step < 0.5
            && is_round(step * 86_400.0)
            && !is_round(step * 10.0)
    }
}

/// Numbers that are a time since 1970 in some unit between the years 2000 and 2100.
fn since_1970(low: f64, high: f64) -> Option<(f64, &'static str)> {
    let units = [(1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns")];
    units.into_iter().find(|(factor, _)| low * factor > 946_684_800.0 && high * factor < 4_102_444_800.0)
}
