//! Moments as people write them: `2026-11-26T14:03:01.25+01:00`, `26.11.2026 14:03:01,250`, `11/26/2026 2:03 PM`,
//! `2026年11月26日 14时03分01秒`, `14:03:01`.

use adapter_core::clock::{SECOND_NS, TimeNs};

/// Which number of a date is the day where the year stands last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum DateOrder {
    /// 26.11.2026
    DayFirst,
    /// 11/26/2026
    MonthFirst,
}

/// The date of a written moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WrittenDate {
    /// Year, month, day.
    YearFirst(i16, i8, i8),
    /// Two numbers in an order that the text alone need not tell, and the year; was it written with points?
    YearLast(i8, i8, i16, bool),
}

/// A moment as written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct WrittenMoment {
    /// The date; `None`: a time of day alone.
    pub(crate) date: Option<WrittenDate>,
    /// Nanoseconds since midnight; `None`: a date alone.
    pub(crate) time_of_day_ns: Option<i64>,
    /// Seconds east of Greenwich, where the text says it.
    pub(crate) offset_s: Option<i32>,
}

struct Scanner<'a> {
    rest: &'a str,
}

impl Scanner<'_> {
    /// The digits here, at most so many of them; how many there were.
    fn take_number(&mut self, most: usize) -> Option<(i64, usize)> {
        let length = self.rest.bytes().take_while(u8::is_ascii_digit).count();
        if length == 0 || length > most {
            return None;
        }
        let number = self.rest[..length].parse().ok()?;
        self.rest = &self.rest[length..];
        Some((number, length))
    }

    fn take_any(&mut self, any_of: &[&str]) -> Option<usize> {
        let index = any_of.iter().position(|text| self.rest.starts_with(text))?;
        self.rest = &self.rest[any_of[index].len()..];
        Some(index)
    }

    fn skip_spaces(&mut self) {
        self.rest = self.rest.trim_start();
    }
}

/// Takes a text as a moment.
#[must_use]
pub(crate) fn written_moment(text: &str) -> Option<WrittenMoment> {
    let text = text.trim_start_matches('\'').trim_matches('"');
    if text.len() < 5 || text.len() > 48 {
        return None;
    }
    let mut scanner = Scanner { rest: text };
    let is_half = HALVES.iter().any(|half| text.starts_with(half));
    if !text.starts_with(|c: char| c.is_ascii_digit()) && !is_half {
        // Mar 17, 2026 08:15:00
        take_month(text)?;
    }
    if let Some(duration) = parse_days(&mut scanner) {
        return Some(duration);
    }
    scanner.rest = text;
    let date = parse_date(&mut scanner);
    if date.is_none() {
        scanner.rest = text;
    } else {
        scanner.skip_spaces();
        let _between = scanner.take_any(&["T", "t", ",", "-", "_", ";"]);
        scanner.skip_spaces();
    }
    let time_of_day_ns =
        if date.is_some() && scanner.rest.is_empty() { None } else { Some(time_of_day(&mut scanner)?) };
    let offset_s = if time_of_day_ns.is_some() { parse_offset(&mut scanner)? } else { None };
    scanner.skip_spaces();
    scanner.rest.is_empty().then_some(WrittenMoment { date, time_of_day_ns, offset_s })
}

/// Halves of the day, each first one before noon.
const HALVES: [&str; 12] = ["AM", "PM", "am", "pm", "a.m.", "p.m.", "上午", "下午", "午前", "午後", "오전", "오후"];
/// The first letters of months in English and German, with the number of each.
const MONTHS: [(&str, i8); 17] = [
    ("jan", 1),
    ("feb", 2),
    ("mar", 3),
    ("mär", 3),
    ("mrz", 3),
    ("apr", 4),
    ("may", 5),
    ("mai", 5),
    ("jun", 6),
    ("jul", 7),
    ("aug", 8),
    ("sep", 9),
    ("oct", 10),
    ("okt", 10),
    ("nov", 11),
    ("dec", 12),
    ("dez", 12),
];

/// The month at the beginning of a text, and what follows its letters.
fn take_month(text: &str) -> Option<(i8, &str)> {
    let end = text.find(|c: char| !c.is_alphabetic()).unwrap_or(text.len());
    let word = text[..end].to_lowercase();
    let month = MONTHS.iter().find(|(start, _)| word.starts_with(start)).map(|(_, month)| *month)?;
    Some((month, text[end..].trim_start_matches('.')))
}

/// `0 days 00:00:01.5`, as pandas writes durations.
fn parse_days(scanner: &mut Scanner<'_>) -> Option<WrittenMoment> {
    let (days, _) = scanner.take_number(5)?;
    scanner.take_any(&[" days ", " day "])?;
    let ns = days.checked_mul(86_400 * SECOND_NS)?.checked_add(time_of_day(scanner)?)?;
    scanner.rest.is_empty().then_some(WrittenMoment { date: None, time_of_day_ns: Some(ns), offset_s: None })
}

/// `17-Mar-2026`, `17 March 2026`, `Mar 17, 2026`.
fn parse_named_date(text: &str) -> Option<(WrittenDate, &str)> {
    let mut scanner = Scanner { rest: text };
    let between = ["-", " ", ". ", ".", "/"];
    let (day, month) = match take_month(text) {
        Some((month, rest)) => {
            scanner.rest = rest.trim_start();
            let (day, _) = scanner.take_number(2)?;
            scanner.take_any(&[", ", " "])?;
            (day, month)
        }
        None => {
            let (day, _) = scanner.take_number(2)?;
            scanner.take_any(&between)?;
            let (month, rest) = take_month(scanner.rest)?;
            scanner.rest = rest;
            scanner.take_any(&between)?;
            (day, month)
        }
    };
    let (year, 4) = scanner.take_number(4)? else { return None };
    let date = WrittenDate::YearFirst(i16::try_from(year).ok()?, month, i8::try_from(day).ok()?);
    Some((date, scanner.rest))
}

fn parse_date(scanner: &mut Scanner<'_>) -> Option<WrittenDate> {
    if let Some((date, rest)) = parse_named_date(scanner.rest) {
        scanner.rest = rest;
        return Some(date);
    }
    let (first, digits) = scanner.take_number(4)?;
    let sign = scanner.take_any(&["-", "/", ".", "年"])?;
    let (second, _) = scanner.take_number(2)?;
    scanner.take_any(&[["-"], ["/"], ["."], ["月"]][sign])?;
    let (third, last_digits) = scanner.take_number(4)?;
    if sign == 3 {
        scanner.take_any(&["日", "号"])?;
    }
    let small = |number: i64| i8::try_from(number).ok();
    let year = |number: i64, digits: usize| i16::try_from(if digits == 2 { 2000 + number } else { number }).ok();
    match (digits, last_digits) {
        (4, 1 | 2) => Some(WrittenDate::YearFirst(year(first, 4)?, small(second)?, small(third)?)),
        (1 | 2, 4) | (2, 2) => {
            Some(WrittenDate::YearLast(small(first)?, small(second)?, year(third, last_digits)?, sign == 2))
        }
        _ => None,
    }
}

fn time_of_day(scanner: &mut Scanner<'_>) -> Option<i64> {
    let before = scanner.take_any(&HALVES);
    scanner.skip_spaces();
    let (hour, _) = scanner.take_number(2)?;
    let sign = scanner.take_any(&[":", "时", "h"])?;
    let (minute, _) = scanner.take_number(2)?;
    let mut ns = 0;
    let mut second = 0;
    let more = match sign {
        0 => scanner.take_any(&[":"]).is_some(),
        1 => scanner.take_any(&["分"]).is_some() && !scanner.rest.is_empty(),
        _ => scanner.take_any(&["m"]).is_some(),
    };
    if more {
        second = scanner.take_number(2)?.0;
        if scanner.take_any(&[".", ",", ":"]).is_some() {
            let (digits, length) = scanner.take_number(18)?;
            ns = if length <= 9 {
                digits * 10_i64.pow(u32::try_from(9 - length).ok()?)
            } else {
                digits / 10_i64.pow(u32::try_from(length - 9).ok()?)
            };
        }
        let _unit = scanner.take_any(&["秒", "s"]);
    }
    scanner.skip_spaces();
    let half = before.or_else(|| scanner.take_any(&HALVES));
    let hour = match half {
        Some(index) if index % 2 == 0 => hour % 12,
        Some(_) => hour % 12 + 12,
        None => hour,
    };
    let legal = (half.is_none() || hour < 24) && hour <= 24 && minute < 60 && second <= 60;
    legal.then_some((hour * 3600 + minute * 60 + second) * SECOND_NS + ns)
}

/// `Some(None)`: none is written.
fn parse_offset(scanner: &mut Scanner<'_>) -> Option<Option<i32>> {
    scanner.skip_spaces();
    if scanner.take_any(&["Z", "z", "UTC", "GMT"]).is_some() && scanner.rest.is_empty() {
        return Some(Some(0));
    }
    let Some(sign) = scanner.take_any(&["+", "-", "\u{2212}"]) else { return Some(None) };
    let (hours, digits) = scanner.take_number(4)?;
    let (hours, minutes) = if digits > 2 {
        (hours / 100, hours % 100)
    } else if scanner.take_any(&[":"]).is_some() {
        (hours, scanner.take_number(2)?.0)
    } else {
        (hours, 0)
    };
    let seconds = i32::try_from(hours * 3600 + minutes * 60).ok().filter(|seconds| *seconds <= 18 * 3600)?;
    Some(Some(if sign == 0 { seconds } else { -seconds }))
}

/// What all moments of a column say together about the order of day and month.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct OrderEvidence {
    /// Dates whose first number is greater than 12,
    pub(crate) day_first: u64,
    /// and whose second one is.
    pub(crate) month_first: u64,
    /// Dates with the year last.
    pub(crate) year_last: u64,
    /// Of them written with points: the day stands first.
    pub(crate) points: u64,
}

impl OrderEvidence {
    /// Takes a date into account.
    pub(crate) fn record_date(&mut self, date: WrittenDate) {
        if let WrittenDate::YearLast(first, second, _, points) = date {
            self.year_last += 1;
            self.day_first += u64::from(first > 12);
            self.month_first += u64::from(second > 12);
            self.points += u64::from(points);
        }
    }

    /// The order; `Err`: it cannot be told, or the dates contradict one another.
    ///
    /// # Errors
    /// Both numbers are months in every date, or the dates contradict one another.
    pub(crate) fn decide_order(&self) -> Result<DateOrder, ()> {
        match (self.day_first > 0, self.month_first > 0) {
            (true, false) => Ok(DateOrder::DayFirst),
            (false, true) => Ok(DateOrder::MonthFirst),
            (false, false) if self.points == self.year_last => Ok(DateOrder::DayFirst),
            _ => Err(()),
        }
    }
}

impl WrittenMoment {
    /// Nanoseconds since 1970 as a clock of the place counts; a date alone is its midnight, a time alone is of 1970-01-01.
    /// `None` where there is no such date.
    #[must_use]
    pub(crate) fn local_ns(&self, order: DateOrder) -> Option<TimeNs> {
        let days = match self.date {
            None => 0,
            Some(date) => {
                let (year, month, day) = match (date, order) {
                    (WrittenDate::YearFirst(year, month, day), _) => (year, month, day),
                    (WrittenDate::YearLast(day, month, year, _), DateOrder::DayFirst) => (year, month, day),
                    (WrittenDate::YearLast(month, day, year, _), DateOrder::MonthFirst) => (year, month, day),
                };
                let date = jiff::civil::Date::new(year, month, day).ok()?;
                i64::from((date - jiff::civil::Date::constant(1970, 1, 1)).get_days())
            }
        };
        days.checked_mul(86_400 * SECOND_NS)?.checked_add(self.time_of_day_ns.unwrap_or(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn local(text: &str, order: DateOrder) -> Option<String> {
        let ns = written_moment(text)?.local_ns(order)?;
        jiff::Timestamp::from_nanosecond(i128::from(ns)).ok().map(|stamp| stamp.to_string())
    }

    #[test]
    fn moments_of_many_hands_are_the_same_moment() {
        for text in [
            "2026-11-26T14:03:01.25",
            "2026-11-26 14:03:01.250",
            "2026/11/26 14:03:01.25",
            "26.11.2026 14:03:01,250",
            "26.11.26 14:03:01,250",
            "26/11/2026 02:03:01.250 PM",
            "'26-11-2026 14:03:01.250",
            "26-Nov-2026 14:03:01.250",
            "26 November 2026 14:03:01.250",
            "Nov 26, 2026 2:03:01.250 PM",
            "2026/11/26 下午 2:03:01.250",
            "2026/11/26 下午02:03:01.250",
            "2026/11/26 2:03:01.250 p.m.",
            "\"2026-11-26T14:03:01.25\"",
        ] {
            assert_eq!(local(text, DateOrder::DayFirst).as_deref(), Some("2026-11-26T14:03:01.25Z"), "{text}");
        }
        assert_eq!(local("2026年11月26日 14时03分01秒", DateOrder::DayFirst).as_deref(), Some("2026-11-26T14:03:01Z"));
        assert_eq!(local("11/26/2026 2:03:01 PM", DateOrder::MonthFirst).as_deref(), Some("2026-11-26T14:03:01Z"));
        assert_eq!(local("11/26/2026 2:03:01 PM", DateOrder::DayFirst), None);
    }

    #[test]
    fn a_duration_in_days_is_a_time_without_a_date() {
        let ns = |text: &str| written_moment(text).map(|moment| (moment.date.is_some(), moment.time_of_day_ns));
        assert_eq!(ns("0 days 00:00:01.5"), Some((false, Some(1_500_000_000))));
        assert_eq!(ns("1 days 00:00:01"), Some((false, Some(86_401_000_000_000))));
    }

    #[test]
    fn the_zone_is_kept() {
        let offset = |text: &str| written_moment(text).map(|moment| moment.offset_s);
        assert_eq!(offset("2026-11-26T14:03:01Z"), Some(Some(0)));
        assert_eq!(offset("2026-11-26T14:03:01+01:00"), Some(Some(3600)));
        assert_eq!(offset("2026-11-26 14:03:01 -0530"), Some(Some(-19_800)));
        assert_eq!(offset("2026-11-26 14:03:01"), Some(None));
    }

    #[test]
    fn what_is_no_moment_is_none() {
        for text in ["", "12", "1.5", "26.11", "2026-13-01 10:00 x", "25:00", "1,250.0", "12:61:00", "r1 10:00:00"] {
            assert!(written_moment(text).and_then(|moment| moment.local_ns(DateOrder::DayFirst)).is_none(), "{text}");
        }
    }

    #[test]
    fn the_order_follows_from_all_dates_together() {
        let order = |texts: &[&str]| {
            let mut evidence = OrderEvidence::default();
            texts.iter().filter_map(|text| written_moment(text)?.date).for_each(|date| evidence.record_date(date));
            evidence.decide_order()
        };
        assert_eq!(order(&["01/02/2026 10:00", "13/02/2026 10:00"]), Ok(DateOrder::DayFirst));
        assert_eq!(order(&["01/02/2026 10:00"]), Err(()));
        assert_eq!(order(&["01.02.2026 10:00"]), Ok(DateOrder::DayFirst));
    }

    proptest::proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "[0-9:.,/ TZ年月日时分秒+\\-APM]{0,30}") {
            if let Some(moment) = written_moment(&text) {
                let _ = (moment.local_ns(DateOrder::DayFirst), moment.local_ns(DateOrder::MonthFirst));
            }
        }
    }
}
