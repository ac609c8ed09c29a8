//! Words and numbers of the page: two languages, quantities with units, escaping.

use adapter_core::channel::{ChannelId, quantity};
use rules::physics::explain::Language;
use rules::physics::{CATALOGUE, EffectDoc, find_effect};
use rules::twin::diagnosis::Experiment;
use rules::twin::region::Condition;

/// Words of a condition that are listed.
const WORDS_MAX: usize = 8;

/// Text that came from data, safe between tags and in attributes.
pub fn escape_html(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c if c.is_control() && c != '\n' && c != '\t' => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// The language of the page.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tongue(pub(super) Language);

impl Tongue {
    /// The text in the page's language.
    pub(super) fn pick_text<'a>(self, en: &'a str, zh: &'a str) -> &'a str {
        self.0.select_text(en, zh)
    }

    /// Words in a row: `a, b and c`.
    pub(super) fn join_words(self, words: &[String], last: (&str, &str)) -> String {
        let joint = self.pick_text(last.0, last.1);
        match words {
            [] => String::new(),
            [one] => one.clone(),
            [first @ .., end] => format!("{}{joint}{end}", first.join(self.pick_text(", ", "、"))),
        }
    }

    /// Words in a row; of many the first, and how many more.
    fn join_first_words(self, words: &[String]) -> String {
        let Some(more) = words.len().checked_sub(WORDS_MAX).filter(|more| *more > 1) else {
            return self.join_words(words, (" or ", "或"));
        };
        let first = words[..WORDS_MAX].join(self.pick_text(", ", "、"));
        match self.0 {
            Language::En => format!("{first} or one of {more} more"),
            Language::Zh => format!("{first}等（另有{more}个）"),
        }
    }

    /// The name of an effect in plain words, escaped.
    pub(super) fn name_effect(self, kind: &str) -> String {
        if kind.starts_with("unknown") {
            return self.pick_text("an unknown effect", "未知影响").to_owned();
        }
        let plain = || escape_html(&kind.replace('_', " "));
        find_effect(kind).map_or_else(plain, |effect| escape_html(effect.doc().texts(self.0).name))
    }

    /// What to record next, in the page's language. Escaped.
    pub(super) fn translate_experiment(self, next: &Experiment) -> String {
        match next.statement_zh.filter(|_| self.0 == Language::Zh) {
            Some(zh) => escape_html(zh),
            None => self.translate_catalogue(&next.statement),
        }
    }

    /// A text of the catalogue in the page's language; other text as it is. Escaped.
    pub(super) fn translate_catalogue(self, text: &str) -> String {
        let pairs = CATALOGUE.iter().flat_map(|effect| list_translations(effect.doc()));
        let found = pairs.into_iter().find_map(|(en, zh)| Some((zh, text.strip_prefix(en)?)));
        match (self.0, found) {
            (Language::Zh, Some((zh, rest))) => escape_html(&format!("{zh}{rest}")),
            _ => escape_html(text),
        }
    }

    /// What a parameter of an effect is; empty where the catalogue does not know it.
    pub(super) fn describe_parameter(self, kind: &str, name: &str) -> String {
        let doc = find_effect(kind).and_then(|effect| effect.doc().find_parameter(name));
        doc.map(|doc| escape_html(self.pick_text(doc.en, doc.zh))).unwrap_or_default()
    }

    /// A column as words without its unit, escaped.
    pub(super) fn name_column(self, name: &str) -> String {
        let known = ChannelId::from_name(name).map(|id| id.channel().zh);
        match (self.0, known, find_special_name(name)) {
            (_, _, Some((en, zh))) => self.pick_text(en, zh).to_owned(),
            (Language::Zh, Some(zh), _) => escape_html(zh),
            _ => escape_html(&quantity::without_unit(name).replace('_', " ")),
        }
    }

    /// A column with its unit in brackets, escaped.
    pub(super) fn name_column_with_unit(self, name: &str) -> String {
        let unit = unit_of(name);
        if unit.is_empty() { self.name_column(name) } else { format!("{} ({unit})", self.name_column(name)) }
    }

    /// A condition in words, escaped.
    pub(super) fn describe_condition(self, condition: &Condition) -> String {
        match condition {
            Condition::Equals { column, words } => {
                let words: Vec<String> = words.iter().map(|word| escape_html(word)).collect();
                format!("{}{}{}", self.name_column(column), self.pick_text(" is ", "为"), self.join_first_words(&words))
            }
            Condition::Range { column, min, max } => self.describe_range(column, *min, *max),
        }
    }

    fn describe_range(self, column: &str, min: Option<f64>, max: Option<f64>) -> String {
        if column == "engaged" && min.is_some() != max.is_some() {
            let inside = min.is_some();
            let (en, zh) = describe_engagement(inside);
            return self.pick_text(en, zh).to_owned();
        }
        let name = self.name_column(column);
        let with_unit = |x: f64| with_unit(&format_number(x), &unit_of(column));
        match (min, max) {
            (Some(min), Some(max)) if self.0 == Language::En => {
                format!("{name} is between {} and {}", format_number(min), with_unit(max))
            }
            (Some(min), Some(max)) => format!("{name}在{}至{}之间", format_number(min), with_unit(max)),
            (Some(min), None) => format!("{name}{}{}", self.pick_text(" is above ", "高于"), with_unit(min)),
            (None, Some(max)) => format!("{name}{}{}", self.pick_text(" is below ", "低于"), with_unit(max)),
            (None, None) => format!("{name}{}", self.pick_text(" has any value", "任意值")),
        }
    }
}

fn list_translations(doc: &'static EffectDoc) -> [(&'static str, &'static str); 2] {
    [(doc.en.statement, doc.zh.statement), (doc.en.experiment, doc.zh.experiment)]
}

fn describe_engagement(cut: bool) -> (&'static str, &'static str) {
    if cut {
        ("the tool is in the cut", "刀具切削时")
    } else {
        ("the tool is out of the cut", "刀具未切削时")
    }
}

fn find_special_name(name: &str) -> Option<(&'static str, &'static str)> {
    let known = [
        ("run", ("run", "运行")),
        ("tool", ("tool", "刀具")),
        ("lot", ("lot", "材料批")),
        ("operation", ("operation", "工序")),
        ("program", ("program", "程序")),
        ("time_in_run_s", ("time in the run", "运行内时间")),
        ("time_s", ("time", "时间")),
        ("cutting_speed_m_min", ("cutting speed", "切削速度")),
        ("cutting_time_min", ("time in the cut of this tool", "刀具累计切削时间")),
        ("feed_per_tooth_mm", ("feed per tooth", "每齿进给量")),
        ("spindle_acceleration_rpm_per_s", ("spindle acceleration", "主轴加速度")),
    ];
    known.into_iter().find(|(known, _)| *known == name).map(|(_, words)| words)
}

/// The unit of a column as printed, escaped; empty for pure numbers and text.
pub(super) fn unit_of(name: &str) -> String {
    quantity::unit_of(name).map_or_else(String::new, unit_text)
}

/// A unit as printed: powers raised, micro as a letter. Escaped.
pub(super) fn unit_text(unit: &str) -> String {
    let mut text = String::new();
    let mut before = ' ';
    for c in if unit == "1" { "" } else { unit }.chars() {
        if c == '^' {
            before = c;
            continue;
        }
        text.push(match c {
            'p' if before == '^' => 'ᵖ',
            '2' if before.is_alphabetic() || ['^', ')'].contains(&before) => '²',
            '3' if before.is_alphabetic() || ['^', ')'].contains(&before) => '³',
            '*' => '·',
            c => c,
        });
        before = c;
    }
    if let Some(rest) = text.strip_prefix("um") {
        text = format!("µm{rest}");
    }
    escape_html(&text)
}

/// A printed number before its printed unit, kept on one line.
pub(super) fn with_unit(number: &str, unit: &str) -> String {
    match unit {
        "" => number.to_owned(),
        "%" => format!("{number}\u{202f}%"),
        unit => format!("{number}\u{a0}{unit}"),
    }
}

/// A number with three significant digits.
pub(super) fn format_number(x: f64) -> String {
    format_significant(x, 3)
}

/// A number with so many significant digits, whole digits kept.
pub(super) fn format_significant(x: f64, digits: i32) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    let size = decimal_exponent(x);
    if !(-4..7).contains(&size) { format_scientific(x, digits) } else { format_fixed(x, (digits - 1 - size).max(0)) }
}

/// A number with its sign.
pub(super) fn format_signed(x: f64) -> String {
    if x > 0.0 { format!("+{}", format_number(x)) } else { format_number(x) }
}

/// Decimal exponent of the leading digit.
pub(super) fn decimal_exponent(x: f64) -> i32 {
    if x == 0.0 || !x.is_finite() {
        return 0;
    }
    let text = format!("{:.2e}", x.abs());
    text.rsplit('e').next().and_then(|e| e.parse().ok()).unwrap_or(0)
}

/// A number with so many decimals, thousands set apart, a true minus sign.
pub(super) fn format_fixed(x: f64, decimals: i32) -> String {
    let places = decimals.clamp(0, 12).unsigned_abs() as usize;
    let text = format!("{:.places$}", x.abs());
    let (whole, rest) = text.split_once('.').map_or((text.as_str(), String::new()), |(w, r)| (w, format!(".{r}")));
    let minus = if x < 0.0 && text.chars().any(|c| c.is_ascii_digit() && c != '0') { "\u{2212}" } else { "" };
    format!("{minus}{}{rest}", group_digits(whole))
}

fn group_digits(whole: &str) -> String {
    if whole.len() < 5 {
        return whole.to_owned();
    }
    let mut text = String::new();
    for (index, c) in whole.chars().enumerate() {
        if index > 0 && (whole.len() - index).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(c);
    }
    text
}

fn format_scientific(x: f64, digits: i32) -> String {
    let places = (digits - 1).max(0).unsigned_abs() as usize;
    let text = format!("{:.places$e}", x.abs());
    let (mantissa, power) = text.split_once('e').unwrap_or((&text, "0"));
    let minus = if x < 0.0 { "\u{2212}" } else { "" };
    format!("{minus}{mantissa}\u{202f}×\u{202f}10<sup>{}</sup>", power.replace('-', "\u{2212}"))
}

/// A law as HTML: one line per part, products and powers as printed mathematics.
pub(super) fn format_law(text: &str) -> String {
    let lines: Vec<String> =
        text.split("; ").map(|part| format!("<span class=\"line\">{}</span>", format_formula(part))).collect();
    lines.join("")
}

fn format_formula(text: &str) -> String {
    let text = text
        .replace(" * ", "\u{2009}·\u{2009}")
        .replace(" - ", " \u{2212} ")
        .replace("= -", "= \u{2212}")
        .replace("(-", "(\u{2212}");
    let mut html = String::new();
    let mut rest = text.as_str();
    while let Some((before, after)) = rest.split_once('^') {
        let end = power_end(after);
        html.push_str(&escape_html(before));
        let power = after[..end].trim_start_matches('(').trim_end_matches(')');
        html.push_str(&format!("<sup>{}</sup>", escape_html(power)));
        rest = &after[end..];
    }
    html + escape_html(rest).as_str()
}

/// Where the power at the start of the text ends: after a bracketed term, a number or a name.
fn power_end(text: &str) -> usize {
    if text.starts_with('(') {
        return text.find(')').map_or(text.len(), |at| at + 1);
    }
    text.find(|c: char| !(c.is_alphanumeric() || c == '.')).unwrap_or(text.len())
}

/// First letter upper case, where it is a plain letter.
pub(super) fn capitalise_first(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// A share in percent; what is less than a tenth of a percent from none or all is told so.
pub(super) fn format_percent(x: f64) -> String {
    let text = match x {
        x if x <= 0.0 => "0".to_owned(),
        x if x >= 100.0 => "100".to_owned(),
        x if x <= 0.1 => "&lt;\u{202f}0.1".to_owned(),
        x if x >= 99.9 => "&gt;\u{202f}99.9".to_owned(),
        x => format_fixed(x, i32::from(!(1.0..=99.0).contains(&x))),
    };
    with_unit(&text, "%")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_as_in_print() {
        let printed = [0.0, 12.345, -0.012345, 12345.6, 1.5e-7, -123_456_789.0].map(format_number);
        let wanted = ["0", "12.3", "\u{2212}0.0123", "12\u{202f}346"];
        assert_eq!(printed[..4], wanted);
        assert_eq!(printed[4], "1.50\u{202f}×\u{202f}10<sup>\u{2212}7</sup>");
        assert_eq!(printed[5], "\u{2212}1.23\u{202f}×\u{202f}10<sup>8</sup>");
        assert_eq!(format_fixed(-0.001, 1), "0.0");
        assert_eq!(decimal_exponent(999.9), 3);
    }

    #[test]
    fn units_and_columns() {
        assert_eq!(unit_text("N/mm2"), "N/mm²");
        assert_eq!(unit_text("um/K"), "µm/K");
        assert_eq!(unit_text("W/(mm min^p)"), "W/(mm minᵖ)");
        assert_eq!(unit_of("x_force_n"), "N");
        let en = Tongue(Language::En);
        assert_eq!(en.name_column_with_unit("axis_velocity_mm_min"), "axis velocity (mm/min)");
        assert_eq!(en.name_column_with_unit("engaged"), "engaged");
        let tool = Condition::Equals { column: "tool".into(), words: vec!["<T1>".into(), "T2".into()] };
        assert_eq!(en.describe_condition(&tool), "tool is &lt;T1&gt; or T2");
    }

    #[test]
    fn laws_are_set_as_mathematics_and_escaped() {
        assert_eq!(format_formula("P = k * W^p"), "P = k\u{2009}·\u{2009}W<sup>p</sup>");
        assert_eq!(format_formula("g^(5/3) < n"), "g<sup>5/3</sup> &lt; n");
        assert_eq!(format_formula("x^"), "x<sup></sup>");
    }
}
