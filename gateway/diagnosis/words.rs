//! What the twin notices, in plain words.

use adapter_core::clock::{SECOND_NS, TimeNs};
use rules::twin::live::{LevelChange, Mismatch, Regime};
use rules::twin::text_report::{format_short_number, space_unit};

/// A time in seconds since 1970 as nanoseconds.
#[must_use]
pub fn to_nanoseconds(at_s: f64) -> TimeNs {
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let at_ns = (at_s * SECOND_NS as f64) as i64;
    at_ns
}

/// A moment with its day and its zone: the page shows each such moment by the clock of the reader.
fn format_time(at_s: f64) -> String {
    let stamp = jiff::Timestamp::from_nanosecond(i128::from(to_nanoseconds(at_s)));
    stamp.map_or_else(|_| "?".to_owned(), |stamp| stamp.strftime("%Y-%m-%d %H:%M UTC").to_string())
}

/// A difference for the operator with its beginning, English and Chinese: for the history and the log, whose times are UTC.
#[must_use]
pub fn mismatch_since(found: &Mismatch, quantity: (&str, &str), unit: &str) -> (String, String) {
    let ((en, zh), (en_since, zh_since)) =
        (describe_mismatch(found, quantity, unit), describe_onset(found.onset.as_ref()));
    (format!("{en_since}, {}", lower_first(&en)), format!("{zh_since}，{zh}"))
}

/// A difference for the operator, English and Chinese, without a time: who shows it has the clock of the reader.
#[must_use]
pub fn describe_mismatch(found: &Mismatch, quantity: (&str, &str), unit: &str) -> (String, String) {
    let size = format_short_number(found.mean.abs()) + space_unit(unit).as_str();
    let percent = found
        .difference_percent()
        .map_or(String::new(), |percent| format!(" ({} %)", format_short_number(percent.abs())));
    let (en_where, zh_where) = found.regime.as_phrases();
    let (en_way, zh_way) = if found.mean > 0.0 { ("more", "高") } else { ("less", "低") };
    let (en, zh) = quantity;
    (
        format!("{} {en_where} is {size}{percent} {en_way} than the simulation says", short_name(en)),
        format!("{zh_where}{zh}比仿真值{zh_way}{size}{percent}"),
    )
}

fn describe_onset(onset: Option<&LevelChange>) -> (String, String) {
    let Some(LevelChange { at_s, low_s, high_s, .. }) = onset else {
        return ("Ever since the comparison began".to_owned(), "自开始比较以来".to_owned());
    };
    // Whole minutes that contain the interval.
    let (low, high) = ((low_s / 60.0).floor() * 60.0, (high_s / 60.0).ceil() * 60.0);
    let (at, low, high) = (format_time(*at_s), format_time(low), format_time(high));
    (format!("Since {at} (between {low} and {high})"), format!("自{at}（{low}至{high}之间）起"))
}

/// The end of a difference, English and Chinese.
#[must_use]
pub fn describe_agreement(regime: Regime, quantity: (&str, &str)) -> (String, String) {
    let (en_where, zh_where) = regime.as_phrases();
    let (en, zh) = quantity;
    (format!("{} {en_where} agrees with the simulation again", short_name(en)), format!("{zh_where}{zh}与仿真重新一致"))
}

/// `Power into the spindle drive, negative when ...` up to the comma.
fn short_name(name: &str) -> &str {
    name.split(',').next().unwrap_or(name)
}

/// A sentence within a sentence.
fn lower_first(name: &str) -> String {
    let mut letters = name.chars();
    let first = letters.next().map(|letter| letter.to_lowercase().to_string()).unwrap_or_default();
    first + letters.as_str()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_reads_as_a_sentence() {
        let onset =
            LevelChange { at_s: 1.8e9, low_s: 1.8e9 - 600.0, high_s: 1.8e9 + 86_400.0, mean: 61.0, expected: 1000.0 };
        let found = Mismatch { regime: Regime::Cutting, onset: Some(onset), mean: 61.0, expected: 1000.0 };
        let (en, zh) =
            mismatch_since(&found, ("Power into the spindle drive, negative when it brakes", "主轴驱动功率"), "W");
        let expected = "Since 2027-01-15 08:00 UTC (between 2027-01-15 07:50 UTC and 2027-01-16 08:00 UTC), power into the spindle \
                        drive while cutting is 61 W (6.1 %) more than the simulation says";
        assert_eq!(en, expected);
        assert!(zh.starts_with("自2027-01-15 08:00 UTC（2027-01-15 07:50 UTC至2027-01-16 08:00 UTC之间）起"), "{zh}");
        assert!(zh.contains("切削时主轴驱动功率比仿真值高61 W"), "{zh}");
    }
}
