//! A column of numbers as time: in which unit they count, and since when.

use super::cell::Decimal;
use super::clock::ForeignColumns;
use super::error::RecordingError;
use super::note::{Note, NoteKind};
use super::plan::TimeKind;
use adapter_core::channel::unit::{Dimension, Unit};

/// A step so long, s, in whole numbers and without a unit, may as well be milliseconds.
const LONG_STEP: f64 = 10.0;
/// Days since 1899-12-30 of the years 2000 to 2100.
const EXCEL_DAYS: (f64, f64) = (36_526.0, 73_051.0);
/// Seconds since 1970 of the years 2000 to 2060.
const UNIX_SECONDS: (f64, f64) = (946_684_800.0, 2_840_140_800.0);
/// Seconds from 1904, where LabVIEW begins to count, to 1970.
const SINCE_1904_S: i64 = 2_082_844_800;

impl ForeignColumns<'_> {
    pub(super) fn plan_numeric_time(&self, index: usize, notes: &mut Vec<Note>) -> Result<TimeKind, RecordingError> {
        let survey = &self.surveys[index];
        let name = &self.names[index];
        let decimal = super::understand::decimal_of(self, index)?.unwrap_or(Decimal::Point);
        let is_ours = name.text == "time_s";
        let mut say = |en: String, zh: String| notes.push(Note::new(NoteKind::Assumption, en, zh));
        if let Some(time) = self.head.time.filter(|time| time.index == index && self.mapping.time.unit.is_none()) {
            say(
                format!("time is {} s + {} s times {}", time.start_s, time.step_s, name.text),
                format!("时间为{} s加{} s乘以{}", time.start_s, time.step_s, name.text),
            );
            return Ok(TimeKind::Seconds { decimal, factor: time.step_s, offset_s: time.start_s });
        }
        let unit = self.mapping.time.unit.clone().or_else(|| name.unit.clone().filter(|_| !is_ours));
        match unit.as_deref() {
            Some("excel") => return Ok(TimeKind::Days { decimal, factor: 1.0 }),
            Some("unix") => return Ok(TimeKind::Unix { decimal, factor: 1.0, epoch_s: 0 }),
            Some("labview") => return Ok(TimeKind::Unix { decimal, factor: 1.0, epoch_s: SINCE_1904_S }),
            _ => {}
        }
        // Milliseconds of this size would be of 1971: WinCC counts millionths of a spreadsheet's days under this name.
        let days = |x: f64| x / 1e6;
        if unit.as_deref() == Some("ms")
            && self.mapping.time.unit.is_none()
            && survey.find_range().is_some_and(|(low, high)| days(low) > EXCEL_DAYS.0 && days(high) < EXCEL_DAYS.1)
        {
            say(
                format!("{}: millionths of days since 1899-12-30, as WinCC counts them", name.text),
                format!("{}：自1899-12-30起的百万分之一天（WinCC）", name.text),
            );
            return Ok(TimeKind::Days { decimal, factor: 1e-6 });
        }
        if let Some(unit) = unit {
            let factor = self.find_time_factor(&unit, &name.text)?;
            return Ok(TimeKind::Seconds { decimal, factor, offset_s: 0.0 });
        }
        if self.looks_like_days(index) {
            say(
                format!("{}: days since 1899-12-30, as spreadsheets count them", name.text),
                format!("{}：电子表格的日期序号（自1899-12-30起的天数）", name.text),
            );
            return Ok(TimeKind::Days { decimal, factor: 1.0 });
        }
        if is_ours {
            return Ok(TimeKind::Seconds { decimal, factor: 1.0, offset_s: 0.0 });
        }
        if let Some((low, high)) = survey.find_range()
            && let Some(epoch) = find_epoch(low, high)
        {
            let Epoch { factor, epoch_s, word } = epoch;
            let since = if epoch_s == 0 { "1970" } else { "1904" };
            say(
                format!("{}: {word} since {since}, UTC", name.text),
                format!("{}：自{since}年起（UTC），单位{word}", name.text),
            );
            return Ok(TimeKind::Unix { decimal, factor, epoch_s });
        }
        let step = survey.mean_step().unwrap_or_default();
        if step >= LONG_STEP {
            return Err(self.build_header_error(
                format!(
                    "{} has no unit and goes on by {step} per row: say in a map whether these are s or ms ([time] unit = \"ms\")",
                    name.text
                ),
                format!("{}没有单位，每行递增{step}：请在映射文件中指定单位（[time] unit = \"ms\"或\"s\"）", name.text),
            ));
        }
        say(format!("{} in seconds", name.text), format!("{}以秒为单位", name.text));
        Ok(TimeKind::Seconds { decimal, factor: 1.0, offset_s: 0.0 })
    }

    /// Seconds of a unit of time.
    fn find_time_factor(&self, unit: &str, name: &str) -> Result<f64, RecordingError> {
        let known = Unit::from_symbol(unit).filter(|unit| unit.dimension == Dimension::Time);
        known.map(|known| known.factor).ok_or_else(|| {
            self.build_header_error(
                format!("the unit {unit} of the time column {name} is none of time"),
                format!("时间列{name}的单位{unit}不是时间单位"),
            )
        })
    }

    /// Spreadsheet days: of this century, and their steps are round in seconds but not as they stand.
    fn looks_like_days(&self, index: usize) -> bool {
        let survey = &self.surveys[index];
        let (Some((low, high)), Some(step)) = (survey.find_range(), survey.mean_step()) else { return false };
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

/// A clock that counts from a year on.
struct Epoch {
    factor: f64,
    /// Seconds from its zero to 1970.
    epoch_s: i64,
    word: &'static str,
}

/// Numbers that are a time since 1970 in some unit, or seconds since 1904, between the years 2000 and 2060. Both cannot be: what LabVIEW
/// counts of the years 2000 to 2056 would be of 2066 to 2122.
fn find_epoch(low: f64, high: f64) -> Option<Epoch> {
    let units = [(1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns")];
    let fits =
        |factor: f64, since_s: f64| low * factor - since_s > UNIX_SECONDS.0 && high * factor - since_s < UNIX_SECONDS.1;
    let unix = units.into_iter().find(|(factor, _)| fits(*factor, 0.0));
    let unix = unix.map(|(factor, word)| Epoch { factor, epoch_s: 0, word });
    #[expect(clippy::cast_precision_loss, reason = "a whole number far below 2^53")]
    let since_1904_s = SINCE_1904_S as f64;
    let labview = || fits(1.0, since_1904_s).then_some(Epoch { factor: 1.0, epoch_s: SINCE_1904_S, word: "s" });
    unix.or_else(labview)
}
