//! The map of a foreign file (`map/1`): how it is written, and which of its columns is which of ours. Whatever it says is not guessed.

use super::moment::{WrittenDate, written_moment};
use super::separator::Separator;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// How a foreign file is written, and which of its columns is which of ours.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mapping {
    /// The version of the notation: `map/1`.
    #[serde(default)]
    pub schema: String,
    /// Name of the encoding: `GBK`, `windows-1252`, `UTF-16LE`.
    pub encoding: Option<String>,
    /// The sign between cells; `tab` and `space` by name.
    pub separator: Option<String>,
    /// The sign before decimals.
    pub decimal: Option<char>,
    /// Line of the names, from 1.
    pub header_line: Option<u64>,
    /// Line of the units.
    pub units_line: Option<u64>,
    /// The names of the columns, for a file that has no line of names.
    #[serde(default)]
    pub names: Vec<String>,
    /// The sheet of a workbook, the group of a TDMS file, the variable of a MAT file.
    pub sheet: Option<String>,
    /// What is said about time.
    #[serde(default)]
    pub time: TimeMapping,
    /// What is said about single columns.
    #[serde(default)]
    pub column: Vec<ColumnMapping>,
    /// Columns that have a time of their own.
    #[serde(default)]
    pub clock: Vec<ClockMapping>,
}

/// What a map says about time.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeMapping {
    /// The column of time, by its name in the file or `#3`.
    pub column: Option<String>,
    /// The column of the date, where the time of day stands in another one,
    pub date: Option<String>,
    /// which is this one.
    pub clock: Option<String>,
    /// Seconds from one row to the next, where there is no column of time.
    pub step: Option<f64>,
    /// When the first row was, where there is no column of time: `2026-03-17T08:15:00`, with or without a zone.
    pub start: Option<String>,
    /// `s`, `ms`, ..., `excel` (days since 1900), `unix` (seconds since 1970), `labview` (seconds since 1904).
    pub unit: Option<String>,
    /// The clock on the wall, such as `Europe/Berlin`; for times that do not say it.
    pub zone: Option<String>,
    /// `dmy` or `mdy`, for dates that could be either.
    pub order: Option<String>,
    /// `times`: each time column is a clock of its own, and the values are brought together by them (default). `rows`: what
    /// stands in a row was measured together, whatever the further time columns say.
    pub clocks: Option<String>,
    /// `refuse` (default), `join` or `run`. Where time goes back, with `join` what comes after follows one period later; with `run`
    /// a new run begins there.
    pub set_back: Option<String>,
}

/// Columns that have a time of their own in one file.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClockMapping {
    /// The columns, by their names in the file or `#3`.
    pub columns: Vec<String>,
    /// Their column of time,
    pub time: Option<String>,
    /// or the seconds from one row to the next.
    pub step: Option<f64>,
}

/// One column of the file.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColumnMapping {
    /// Its name in the file, or `#3` for the third one.
    pub from: String,
    /// Its name in the recording; empty: it is left out.
    #[serde(default)]
    pub to: String,
    /// The unit of its numbers; without it, what the file says.
    pub unit: Option<String>,
    /// A further factor, such as that of a current clamp.
    pub scale: Option<f64>,
    /// Added after the factor, in the unit of `to`.
    pub offset: Option<f64>,
}

/// What is wrong with a map.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{file}: {reason}")]
pub struct MappingError {
    /// Name of the file with the map.
    pub file: String,
    /// What is wrong with it, in words.
    pub reason: String,
}

impl Mapping {
    /// What it says besides the columns and their clocks: how the file is opened, and what becomes of the times of its rows.
    pub(super) fn without_plan(&self) -> Self {
        let TimeMapping { zone, clocks, set_back, .. } = self.time.clone();
        Self {
            schema: String::new(),
            decimal: None,
            time: TimeMapping { zone, clocks, set_back, ..TimeMapping::default() },
            column: Vec::new(),
            clock: Vec::new(),
            ..self.clone()
        }
    }

    /// Reads a map from its text.
    ///
    /// # Errors
    /// What is wrong with it, with the line.
    pub fn parse(text: &str, file: &str) -> Result<Self, MappingError> {
        let wrong = |reason: String| MappingError { file: file.to_owned(), reason };
        let mapping: Self = toml::from_str(text).map_err(|error| wrong(error.to_string()))?;
        if mapping.schema != "map/1" {
            return Err(wrong("schema must be \"map/1\"".to_owned()));
        }
        if let Some(decimal) = mapping.decimal.filter(|decimal| !['.', ','].contains(decimal)) {
            return Err(wrong(format!("decimal = {decimal:?}: it is \".\" or \",\"")));
        }
        if let Some(sign) = mapping.separator.as_deref().filter(|sign| Separator::from_text(sign).is_none()) {
            return Err(wrong(format!("separator = {sign:?}: it is one sign, \"tab\" or \"space\"")));
        }
        for (name, value, known) in [
            ("order", &mapping.time.order, &["dmy", "mdy"][..]),
            ("clocks", &mapping.time.clocks, &["times", "rows"]),
            ("set_back", &mapping.time.set_back, &["refuse", "join", "run"]),
        ] {
            if let Some(value) = value.as_deref().filter(|value| !known.contains(value)) {
                return Err(wrong(format!("[time] {name} = {value:?}: it is {}", known.join(" or "))));
            }
        }
        if let Some(name) = &mapping.encoding
            && encoding_rs::Encoding::for_label(name.as_bytes()).is_none()
        {
            return Err(wrong(format!("encoding = {name:?} is not known; write GBK, windows-1252, UTF-16LE or such")));
        }
        if let Some(zone) = &mapping.time.zone
            && jiff::tz::TimeZone::get(zone).is_err()
        {
            return Err(wrong(format!(
                "[time] zone = {zone:?} is not known; write Europe/Berlin, Asia/Shanghai, UTC or such"
            )));
        }
        mapping.check_time().map_err(wrong)?;
        for (index, column) in mapping.column.iter().enumerate() {
            if mapping.column[..index].iter().any(|other| other.from == column.from) {
                return Err(wrong(format!("[[column]] from = {:?} stands twice", column.from)));
            }
            if !column.to.is_empty() && mapping.column[..index].iter().any(|other| other.to == column.to) {
                return Err(wrong(format!("two columns are mapped to {}: leave one out with to = \"\"", column.to)));
            }
            if column.scale.is_some_and(|scale| !scale.is_finite() || scale == 0.0)
                || column.offset.is_some_and(|offset| !offset.is_finite())
            {
                return Err(wrong(format!(
                    "[[column]] from = {:?}: scale and offset are finite numbers, and scale is not 0",
                    column.from
                )));
            }
        }
        Ok(mapping)
    }

    /// What contradicts itself in what is said of time.
    fn check_time(&self) -> Result<(), String> {
        let time = &self.time;
        if time.date.is_some() != time.clock.is_some() || time.clock.is_some() && time.column.is_some() {
            return Err("[time] date and clock stand together, and without column".to_owned());
        }
        if time.step.is_some() && (time.column.is_some() || time.clock.is_some()) {
            return Err(
                "[time] step is for a file without a column of time: leave column, date and clock out".to_owned()
            );
        }
        if let Some(start) = time.start.as_deref() {
            if time.step.is_none() {
                return Err("[time] start goes with step, for a file without a column of time".to_owned());
            }
            if written_moment(start).is_none_or(|moment| !matches!(moment.date, Some(WrittenDate::YearFirst(..)))) {
                return Err(format!("[time] start = {start:?}: write it as 2026-03-17T08:15:00"));
            }
        }
        let is_step = |step: &f64| step.is_finite() && *step > 0.0;
        if time.step.iter().chain(self.clock.iter().filter_map(|clock| clock.step.as_ref())).any(|step| !is_step(step))
        {
            return Err("step: seconds from one row to the next, greater than 0".to_owned());
        }
        for clock in &self.clock {
            if clock.time.is_some() == clock.step.is_some() || clock.columns.is_empty() {
                return Err("[[clock]] has columns, and either time or step".to_owned());
            }
        }
        Ok(())
    }

    /// Reads a map from its file.
    ///
    /// # Errors
    /// It cannot be read, or something is wrong with it.
    pub fn read(path: &Path) -> Result<Self, MappingError> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path)
            .map_err(|error| MappingError { file: file.clone(), reason: error.to_string() })?;
        Self::parse(&text, &file)
    }

    /// Where the map of a recording lies when nobody says another place: `week.csv.map.toml` beside `week.csv`.
    #[must_use]
    pub fn build_path_beside(recording: &Path) -> PathBuf {
        let mut name = recording.as_os_str().to_owned();
        name.push(".map.toml");
        PathBuf::from(name)
    }

    /// What is said of the column of this name, the `index`th.
    #[must_use]
    pub fn find_column(&self, name: &str, index: usize) -> Option<&ColumnMapping> {
        let number = format!("#{}", index + 1);
        self.column.iter().find(|column| column.from == name || column.from == number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_is_read_and_its_mistakes_are_named() {
        let text = "schema = \"map/1\"\ndecimal = \",\"\n[time]\ncolumn = \"Zeit\"\nzone = \"Europe/Berlin\"\n\
                    [[column]]\nfrom = \"P1[W]\"\nto = \"spindle_power_w\"\nscale = 3.0\n";
        let map = Mapping::parse(text, "m").expect("fine");
        assert_eq!(map.find_column("P1[W]", 4).map(|column| column.to.as_str()), Some("spindle_power_w"));
        for (wrong, word) in [
            ("", "schema"),
            ("schema = \"map/1\"\ndecimal = \"x\"", "decimal"),
            ("schema = \"map/1\"\nencoding = \"klingon\"", "klingon"),
            ("schema = \"map/1\"\n[time]\nzone = \"Mars\"", "Mars"),
            (
                "schema = \"map/1\"\n[[column]]\nfrom = \"a\"\nto = \"x\"\n[[column]]\nfrom = \"b\"\nto = \"x\"",
                "two columns",
            ),
            ("schema = \"map/1\"\nseperator = \",\"", "seperator"),
            ("schema = \"map/1\"\n[time]\nstep = 0", "step"),
            ("schema = \"map/1\"\n[time]\ndate = \"Datum\"", "stand together"),
            ("schema = \"map/1\"\n[time]\nstart = \"2026-03-17T08:15:00\"", "goes with step"),
            ("schema = \"map/1\"\n[[clock]]\ncolumns = [\"a\"]", "either time or step"),
        ] {
            let error = Mapping::parse(wrong, "m").expect_err("wrong").to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
