//! One cell of a foreign table, and how a number may be written in it.

use adapter_core::clock::TimeNs;

/// A cell as the file holds it. Text is not judged yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell<'a> {
    /// Nothing.
    Empty,
    /// Text, as written.
    Text(&'a str),
    /// A number of a format that knows numbers.
    Number(f64),
    /// A truth value of such a format.
    Flag(bool),
    /// A moment: nanoseconds since 1970, UTC.
    Instant(TimeNs),
    /// A moment on the clock of a place that the file does not name: nanoseconds since 1970 as that clock counts.
    Local(TimeNs),
}

/// Text that stands for no value in every column.
const ABSENT: [&str; 16] = [
    "nan",
    "-nan",
    "#n/a",
    "#nv",
    "na",
    "n/a",
    "null",
    "none",
    "unavailable",
    "#value!",
    "#wert!",
    "#ref!",
    "#bezug!",
    "#div/0!",
    "#num!",
    "#zahl!",
];
/// Text that stands for no value among numbers only.
const ABSENT_NUMBER: [&str; 8] = ["-", "--", "---", "----", "?", "inf", "-inf", "∞"];
/// Pairs of words for no and yes.
const FLAGS: [(&str, &str); 12] = [
    ("off", "on"),
    ("false", "true"),
    ("no", "yes"),
    ("n", "y"),
    ("aus", "ein"),
    ("nein", "ja"),
    ("falsch", "wahr"),
    ("关", "开"),
    ("关闭", "打开"),
    ("否", "是"),
    ("假", "真"),
    ("inactive", "active"),
];

/// Does this text stand for no value, whatever the column?
#[must_use]
pub fn is_absent(text: &str) -> bool {
    let may_be = matches!(text.as_bytes().first(), None | Some(b'n' | b'N' | b'-' | b'#' | b'u' | b'U'));
    may_be && (text.is_empty() || text.len() <= 11 && ABSENT.iter().any(|absent| text.eq_ignore_ascii_case(absent)))
}

/// Does this text stand for no value in a column of numbers?
#[must_use]
pub fn is_absent_number(text: &str) -> bool {
    is_absent(text) || ABSENT_NUMBER.iter().any(|absent| text.eq_ignore_ascii_case(absent))
}

/// The pair that a word belongs to, and whether it says yes.
#[must_use]
pub fn parse_flag(text: &str) -> Option<(usize, bool)> {
    if text.len() > 8 {
        return None;
    }
    let lower = text.to_lowercase();
    let pair = FLAGS.iter().position(|(no, yes)| lower == *no || lower == *yes)?;
    Some((pair, lower == FLAGS[pair].1))
}

/// The words of a pair, no before yes.
#[must_use]
pub fn flag_words(pair: usize) -> (&'static str, &'static str) {
    FLAGS[pair]
}

/// The sign before the decimals.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Decimal {
    /// The point, as in 1.5
    Point,
    /// The comma, as in 1,5
    Comma,
}

impl Decimal {
    /// The sign as a character.
    #[must_use]
    pub fn sign(self) -> char {
        if self == Self::Point { '.' } else { ',' }
    }
}

/// What a written number says about the decimal sign of its column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// No sign at all: 1250.
    Whole,
    /// The point is the decimal sign: 1.5, 1,250.5.
    Point,
    /// The comma is: 1,5, 1.250,5.
    Comma,
    /// 1.250: one and a quarter, or twelve hundred and fifty.
    PointOrThousands,
    /// 1,250: the same question.
    CommaOrThousands,
}

/// A written number: its digits with signs, and what follows them (a unit).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WrittenNumber<'a> {
    digits: &'a str,
    /// What stands behind the digits: `sec`, `%`; mostly nothing.
    pub suffix: &'a str,
    /// What it says about the decimal sign.
    pub shape: Shape,
}

const GROUPING: [char; 5] = ['\'', '\u{2019}', ' ', '\u{a0}', '\u{202f}'];

/// Takes a text as a number; `None` where it is none under any decimal sign.
#[must_use]
pub fn written_number(text: &str) -> Option<WrittenNumber<'_>> {
    let (digits, suffix) = split_suffix(text)?;
    let unsigned = digits.trim_start_matches(['+', '-', '\u{2212}']);
    let mantissa = unsigned.split(['e', 'E']).next().unwrap_or(unsigned);
    let shape = classify_shape(mantissa)?;
    let written = WrittenNumber { digits, suffix, shape };
    [Decimal::Point, Decimal::Comma]
        .into_iter()
        .any(|decimal| written.parse_value(decimal).is_some())
        .then_some(written)
}

/// Digits, signs, grouping and exponent from the start; the rest is a suffix, which must not begin with a digit again.
fn split_suffix(text: &str) -> Option<(&str, &str)> {
    let bytes = text.as_bytes();
    let mut end = 0;
    let mut seen_digit = false;
    let mut chars = text.char_indices().peekable();
    while let Some((at, c)) = chars.next() {
        let next = chars.peek().map(|(_, next)| *next);
        let is_part = match c {
            '0'..='9' => {
                seen_digit = true;
                true
            }
            '+' | '-' | '\u{2212}' => at == 0 || matches!(bytes[at - 1], b'e' | b'E'),
            '.' | ',' => true,
            'e' | 'E' => seen_digit && next.is_some_and(|next| next.is_ascii_digit() || matches!(next, '+' | '-')),
            c if GROUPING.contains(&c) => seen_digit && next.is_some_and(|next| next.is_ascii_digit()),
            _ => false,
        };
        if !is_part {
            break;
        }
        end = at + c.len_utf8();
    }
    let suffix = text[end..].trim();
    let is_suffix = suffix.len() <= 8
        && !suffix.contains(|c: char| c.is_ascii_digit() || c == ':' || c == '-' || c == '/' && suffix.len() == 1);
    (seen_digit && is_suffix).then(|| (&text[..end], suffix))
}

fn classify_shape(mantissa: &str) -> Option<Shape> {
    let plain: String = mantissa.chars().filter(|c| !GROUPING.contains(c)).collect();
    let (points, commas) = (plain.matches('.').count(), plain.matches(',').count());
    let groups_of = |sign: char| {
        let mut parts = plain.split(['.', ',']);
        let first = parts.next().unwrap_or("");
        let mut inner: Vec<&str> = plain.split(sign).skip(1).collect();
        // The last group may carry decimals behind the other sign.
        if let Some(last) = inner.pop() {
            inner.push(last.split(['.', ',']).next().unwrap_or(last));
        }
        (1..=3).contains(&first.len()) && !first.starts_with('0') && inner.iter().all(|group| group.len() == 3)
    };
    match (points, commas) {
        (0, 0) => Some(Shape::Whole),
        (1, 0) => Some(if groups_of('.') { Shape::PointOrThousands } else { Shape::Point }),
        (0, 1) => Some(if groups_of(',') { Shape::CommaOrThousands } else { Shape::Comma }),
        (0, _) => groups_of(',').then_some(Shape::Point),
        (_, 0) => groups_of('.').then_some(Shape::Comma),
        (1, _) if plain.rfind('.') > plain.rfind(',') => groups_of(',').then_some(Shape::Point),
        (_, 1) if plain.rfind(',') > plain.rfind('.') => groups_of('.').then_some(Shape::Comma),
        _ => None,
    }
}

impl WrittenNumber<'_> {
    /// The number under this decimal sign; `None` where the signs do not suit it.
    #[must_use]
    pub fn parse_value(&self, decimal: Decimal) -> Option<f64> {
        let text = self.digits;
        if decimal == Decimal::Point
            && let Ok(number) = text.parse::<f64>()
        {
            return Some(number).filter(|number| number.is_finite());
        }
        let suits = match self.shape {
            Shape::Point => decimal == Decimal::Point,
            Shape::Comma => decimal == Decimal::Comma,
            Shape::Whole | Shape::PointOrThousands | Shape::CommaOrThousands => true,
        };
        if !suits {
            return None;
        }
        let group = if decimal == Decimal::Point { ',' } else { '.' };
        let plain: String = text
            .chars()
            .filter(|c| !GROUPING.contains(c) && *c != group)
            .map(|c| {
                if c == decimal.sign() {
                    '.'
                } else if c == '\u{2212}' {
                    '-'
                } else {
                    c
                }
            })
            .collect();
        plain.parse::<f64>().ok().filter(|number| number.is_finite())
    }

    /// Are thousands set apart in it?
    #[must_use]
    pub fn has_groups(&self, decimal: Decimal) -> bool {
        let other = if decimal == Decimal::Point { ',' } else { '.' };
        self.digits.contains(other) || self.digits.contains(GROUPING)
    }
}

#[cfg(test)]
mod tests {
    use super::super::plain_number::scan_plain_number;
    use super::*;

    fn read(text: &str, decimal: Decimal) -> Option<f64> {
        written_number(text)?.parse_value(decimal)
    }

    #[test]
    fn a_number_says_what_its_signs_can_mean() {
        for (text, shape) in [
            ("1250", Shape::Whole),
            ("-1.5e3", Shape::Point),
            ("0.250", Shape::Point),
            ("1250.250", Shape::Point),
            ("1.250", Shape::PointOrThousands),
            ("1,250", Shape::CommaOrThousands),
            ("1,5", Shape::Comma),
            ("1,250.0", Shape::Point),
            ("1.250,0", Shape::Comma),
            ("1,250,000", Shape::Point),
            ("1'250.5", Shape::Point),
        ] {
            assert_eq!(written_number(text).map(|number| number.shape), Some(shape), "{text}");
        }
        for none in ["", "abc", "1.2.3", "12:30", "2026-11-26", "1,25,3", "26.11.2026", "--", "e5", "1 2/3"] {
            assert_eq!(written_number(none), None, "{none}");
        }
    }

    #[test]
    fn the_same_text_is_another_number_under_another_sign() {
        assert_eq!(read("1.250", Decimal::Point), Some(1.25));
        assert_eq!(read("1.250", Decimal::Comma), Some(1250.0));
        assert_eq!(read("1,250.5", Decimal::Point), Some(1250.5));
        assert_eq!(read("1,250.5", Decimal::Comma), None);
        assert_eq!(read("+2,30E+02", Decimal::Comma), Some(230.0));
        assert_eq!(read("1'250.5", Decimal::Point), Some(1250.5));
        assert_eq!(read("12 sec", Decimal::Point), Some(12.0));
        assert_eq!(written_number("85 %").map(|number| number.suffix), Some("%"));
    }

    #[test]
    fn words_for_no_value_and_for_yes_and_no() {
        assert!(
            is_absent("NaN")
                && is_absent("#N/A")
                && is_absent("UNAVAILABLE")
                && !is_absent("-")
                && is_absent_number("-")
        );
        assert_eq!(parse_flag("EIN"), Some((4, true)));
        assert_eq!(parse_flag("关"), Some((7, false)));
        assert_eq!(parse_flag("only"), None);
    }

    proptest::proptest! {
        /// The quick way gives what the slow one does, to the last bit, or nothing.
        #[test]
        fn plain_numbers_are_the_same_numbers(text in "[+-]?[0-9]{0,12}[.,]?[0-9]{0,9}") {
            for decimal in [Decimal::Point, Decimal::Comma] {
                if let Some(plain) = scan_plain_number(&text, decimal) {
                    let slow = written_number(&text).expect("a number");
                    proptest::prop_assert_eq!(slow.shape, plain.shape, "{}", &text);
                    proptest::prop_assert_eq!(slow.parse_value(decimal).map(f64::to_bits), Some(plain.value.to_bits()), "{}", &text);
                    proptest::prop_assert_eq!(slow.suffix, "");
                }
            }
        }

        #[test]
        fn no_text_makes_it_panic(text in "[0-9.,eE+\\- '%a−\u{a0}]{0,14}") {
            if let Some(number) = written_number(&text) {
                let _ = (number.parse_value(Decimal::Point), number.parse_value(Decimal::Comma), number.has_groups(Decimal::Comma));
            }
        }
    }
}
