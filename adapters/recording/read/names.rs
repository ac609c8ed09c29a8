//! What a foreign name means: a dictionary of the field's words in English, German and Chinese, and the unit that stands in the name.

use adapter_core::channel::unit::Unit;
use adapter_core::channel::{ChannelId, Kind, quantity};

/// WordRow for a column, written as [`squeeze_name`] gives them.
type WordRow = (&'static str, &'static [&'static str]);

#[rustfmt::skip]
const DICTIONARY: &[WordRow] = &[
    ("spindle_speed_rpm", &["spindlespeed", "spindelspeed", "spindlerpm", "speed", "drehzahl", "spindeldrehzahl", "hauptspindeldrehzahl", "n", "rpm", "rotationalspeed", "rotaryvelocity", "spindlevelocity", "主轴转速", "转速", "主轴速度", "主軸回転速度", "主軸回転数", "nckservodataactvelmot"]),
    ("spindle_programmed_rpm", &["programmedspindlespeed", "programmedspeed", "commandedspindlespeed", "commandedspeed", "solldrehzahl", "编程转速", "主轴编程转速", "指令转速", "主轴指令转速"]),
    ("feed_mm_min", &["feed", "feedrate", "pathfeedrate", "pathfeed", "vorschub", "vorschubgeschwindigkeit", "bahnvorschub", "bahngeschwindigkeit", "vf", "进给", "进给速度", "进给率"]),
    ("feed_programmed_mm_min", &["programmedfeed", "commandedfeed", "programmedfeedrate", "sollvorschub", "编程进给", "编程进给速度", "指令进给"]),
    ("feed_per_rev_mm", &["feedperrev", "feedperrevolution", "feed", "vorschub", "vorschubproumdrehung", "umdrehungsvorschub", "f", "每转进给", "每转进给量"]),
    ("feed_override_pct", &["feedoverride", "feedrateoverride", "vorschuboverride", "进给倍率"]),
    ("spindle_override_pct", &["spindleoverride", "spindeloverride", "主轴倍率"]),
    ("depth_of_cut_mm", &["depthofcut", "depth", "ap", "schnitttiefe", "zustellung", "切深", "切削深度", "背吃刀量"]),
    ("width_of_cut_mm", &["widthofcut", "ae", "eingriffsbreite", "schnittbreite", "切宽", "切削宽度", "侧吃刀量"]),
    ("diameter_mm", &["diameter", "workdiameter", "tooldiameter", "durchmesser", "werkstueckdurchmesser", "werkzeugdurchmesser", "直径", "工件直径", "刀具直径"]),
    ("teeth", &["teeth", "numberofteeth", "flutes", "zaehne", "zaehnezahl", "齿数", "刀具齿数"]),
    ("removal_rate_cm3_min", &["removalrate", "materialremovalrate", "mrr", "zeitspanvolumen", "材料去除率", "去除率"]),
    ("engaged", &["engaged", "incut", "engagement", "cutting", "eingriff", "imeingriff", "imschnitt", "切削", "切削中", "切入"]),
    ("coolant_on", &["coolant", "coolanton", "coolantpump", "kuehlmittel", "kuehlmittelein", "kss", "kuehlschmierstoff", "冷却", "冷却液", "切削液"]),
    ("hydraulics_on", &["hydraulics", "hydraulicson", "hydraulik", "液压"]),
    ("spindle_power_w", &["spindlepower", "spindeleleistung", "spindelleistung", "hauptspindelleistung", "wirkleistungspindel", "spindelwirkleistung", "主轴功率", "主轴有功功率"]),
    ("total_power_w", &["totalpower", "machinepower", "gesamtleistung", "maschinenleistung", "整机功率", "总功率"]),
    ("spindle_current_a", &["spindlecurrent", "spindelstrom", "主轴电流"]),
    ("spindle_load_pct", &["spindleload", "spindellast", "spindelauslastung", "主轴负载", "主轴负荷"]),
    ("spindle_torque_nm", &["spindletorque", "spindeldrehmoment", "主轴扭矩", "主轴转矩"]),
    ("axis_position_mm", &["axisposition", "position", "achsposition", "istposition", "轴位置", "位置"]),
    ("axis_velocity_mm_min", &["axisvelocity", "velocity", "achsgeschwindigkeit", "geschwindigkeit", "轴速度", "速度"]),
    ("axis_current_a", &["axiscurrent", "achsstrom", "vorschubmotorstrom", "轴电流"]),
    ("axis_power_w", &["axispower", "achsleistung", "轴功率"]),
    ("x_axis_position_mm", &["xposition", "xaxisposition", "positionx", "xachseposition", "x轴位置"]),
    ("y_axis_position_mm", &["yposition", "yaxisposition", "positiony", "yachseposition", "y轴位置"]),
    ("z_axis_position_mm", &["zposition", "zaxisposition", "positionz", "zachseposition", "z轴位置"]),
    ("cutting_force_n", &["cuttingforce", "schnittkraft", "fc", "切削力", "主切削力"]),
    ("bearing_temperature_c", &["bearingtemperature", "lagertemperatur", "spindellagertemperatur", "轴承温度", "主轴轴承温度"]),
    ("motor_temperature_c", &["motortemperature", "motortemperatur", "电机温度", "主轴电机温度"]),
    ("ambient_temperature_c", &["ambienttemperature", "roomtemperature", "umgebungstemperatur", "raumtemperatur", "hallentemperatur", "环境温度", "室温"]),
    ("coolant_temperature_c", &["coolanttemperature", "kuehlmitteltemperatur", "冷却液温度", "切削液温度"]),
    ("thermal_error_um", &["thermalerror", "thermaldisplacement", "thermischerfehler", "thermischeverlagerung", "verlagerung", "热误差", "热变形", "热位移"]),
    ("supply_voltage_v", &["supplyvoltage", "mainsvoltage", "netzspannung", "电源电压", "供电电压"]),
    ("gear_stage", &["gearstage", "gear", "getriebestufe", "gang", "挡位", "档位"]),
    ("torque_nm", &["torque", "drehmoment", "moment", "扭矩", "转矩"]),
    ("force_n", &["force", "kraft", "力"]),
    ("acceleration_m_s2", &["acceleration", "beschleunigung", "加速度"]),
    ("run", &["run", "lauf", "versuch", "messung", "pass", "批次", "试验", "试验号", "运行"]),
    ("part", &["part", "partnumber", "teil", "werkstueck", "teilenummer", "工件", "零件", "工件号"]),
    ("tool", &["tool", "toolnumber", "werkzeug", "werkzeugnummer", "wkz", "刀具", "刀号", "刀具号"]),
    ("lot", &["lot", "materiallot", "charge", "材料批", "炉号"]),
    ("program", &["program", "programname", "programm", "programmname", "ncprogramm", "程序", "程序号", "程序名"]),
    ("block", &["block", "blocknumber", "linenumber", "satz", "satznummer", "程序段", "程序段号", "行号"]),
    ("operation", &["operation", "arbeitsgang", "operationname", "bearbeitung", "工序", "工步"]),
];

/// Names that mean one of several columns: a person has to say which.
#[rustfmt::skip]
const UNSURE: &[WordRow] = &[
    ("spindle_power_w", &["power", "activepower", "wattage", "leistung", "wirkleistung", "p", "p1", "pavg", "功率", "有功功率", "電力"]),
    ("total_power_w", &["power", "activepower", "wattage", "leistung", "wirkleistung", "p", "p1", "ptotal", "psum", "pavg", "功率", "有功功率", "電力"]),
    ("spindle_current_a", &["current", "strom", "i", "irms1", "i1", "电流", "電流"]),
    ("axis_current_a", &["current", "strom", "i", "irms1", "i1", "电流", "電流"]),
    ("supply_voltage_v", &["voltage", "spannung", "u", "urms1", "u1", "电压"]),
    ("spindle_load_pct", &["load", "last", "auslastung", "负载", "负荷", "tcmd"]),
    ("motor_temperature_c", &["temperature", "temperatur", "温度"]),
    ("bearing_temperature_c", &["temperature", "temperatur", "温度"]),
    ("diameter_mm", &["d"]),
    ("teeth", &["z"]),
];

#[rustfmt::skip]
const TIME: &[&str] = &[
    "time", "zeit", "t", "timestamp", "zeitstempel", "datetime", "dateandtime", "datumzeit", "datumuhrzeit", "datumundzeit",
    "date", "datum", "uhrzeit", "xvalue", "elapsedtime", "elapsed", "etime", "timesincepoweron", "sampletime", "index",
    "utc", "时间", "时间戳", "日期时间", "采样时间", "日期", "时刻", "测量时间", "localtime", "logtime",
    "messzeit", "zeitpunkt", "acquisitiontime", "timeindex", "sourcetimestamp", "servertimestamp", "recordtime", "记录时间", "times", "timestring",
    "時刻", "時間", "日時", "日付",
];
const DATE: &[&str] = &["date", "datum", "日期", "日付"];
/// Left out of a name before it is looked up.
const NOISE: &[&str] = &[
    "actual",
    "act",
    "ist",
    "istwert",
    "aktuelle",
    "aktueller",
    "aktuell",
    "value",
    "wert",
    "measured",
    "gemessene",
    "gemessen",
    "mittlere",
    "avg",
    "mean",
    "s1",
    "ch1",
    "main",
    "haupt",
    "ch2",
    "实际",
    "当前",
    "实测",
    "测量",
    "平均",
];

/// A foreign name taken apart.
#[derive(Debug, Clone, PartialEq)]
pub struct ForeignName {
    /// As it stands in the file.
    pub text: String,
    /// What [`squeeze_name`] leaves of it without its unit,
    whole: String,
    /// and without words that say nothing of the quantity.
    squeezed: String,
    /// The unit in it, as written.
    pub unit: Option<String>,
}

/// Small letters and digits of every script, umlauts written out, nothing between them.
#[must_use]
pub fn squeeze_name(text: &str) -> String {
    let mut plain = String::new();
    for c in text.chars().flat_map(char::to_lowercase) {
        match c {
            'ä' => plain.push_str("ae"),
            'ö' => plain.push_str("oe"),
            'ü' => plain.push_str("ue"),
            'ß' => plain.push_str("ss"),
            c if c.is_alphanumeric() => plain.push(c),
            _ => {}
        }
    }
    plain
}

impl ForeignName {
    /// Takes a name apart; `row_unit` is what a line of units says of its column.
    #[must_use]
    pub fn from_text(text: &str, row_unit: Option<&str>) -> Self {
        let (mut rest, mut unit) = (text.trim().to_owned(), None);
        // The last bracket that holds a unit; other brackets name an axis or a channel.
        for (open, close) in [('[', ']'), ('(', ')'), ('（', '）'), ('<', '>'), ('{', '}'), ('【', '】')] {
            if let Some((at, inner, end)) = last_bracket(&rest, open, close)
                && Unit::from_symbol(inner).is_some()
            {
                unit = Some(inner.trim().to_owned());
                rest = format!("{} {}", &rest[..at], &rest[end..]);
                break;
            }
        }
        if unit.is_none()
            && let Some((name, after)) = split_unit(&rest)
        {
            unit = Some(after.to_owned());
            rest = name.to_owned();
        }
        let row_unit = row_unit
            .map(|unit| unit.trim().trim_matches(['(', ')', '[', ']', '（', '）']).trim())
            .filter(|unit| !unit.is_empty());
        let unit = unit.or_else(|| row_unit.map(str::to_owned));
        let words: Vec<String> = split_words(&without_brackets(&rest));
        let telling: Vec<&String> = words.iter().filter(|word| !NOISE.contains(&word.as_str())).collect();
        let kept: String = if telling.is_empty() { words.concat() } else { telling.into_iter().cloned().collect() };
        let kept = NOISE.iter().filter(|noise| !noise.is_ascii()).fold(kept, |kept, noise| {
            let less = kept.replace(noise, "");
            if less.is_empty() { kept } else { less }
        });
        Self { text: text.trim().to_owned(), whole: words.concat(), squeezed: kept, unit }
    }

    /// May this be the time of the rows?
    #[must_use]
    pub fn is_time(&self) -> bool {
        TIME.contains(&self.squeezed.as_str()) || TIME.contains(&self.whole.as_str())
    }

    /// May this be a date beside a time of day?
    #[must_use]
    pub fn is_date(&self) -> bool {
        DATE.contains(&self.squeezed.as_str())
    }

    /// Is this the millisecond that some meters write beside the time?
    #[must_use]
    pub fn is_time_part(&self) -> bool {
        self.is_time() && self.unit.as_deref() == Some("ms")
    }

    /// The column that this name means beyond doubt, its unit permitting.
    #[must_use]
    pub fn find_meaning(&self) -> Option<&'static str> {
        let known = DICTIONARY.iter().find(|(column, words)| {
            let is_it = words.contains(&self.squeezed.as_str())
                || words.iter().any(|word| word.len() > 14 && word.is_ascii() && self.whole.contains(word));
            is_it && self.suits_column(column)
        });
        known.map(|(column, _)| *column)
    }

    /// Columns that it may mean, the likeliest first.
    #[must_use]
    pub fn list_candidates(&self) -> Vec<&'static str> {
        let mut found: Vec<&'static str> = self.find_meaning().into_iter().collect();
        let all = || DICTIONARY.iter().chain(UNSURE);
        let exact = all().filter(|(_, words)| words.contains(&self.squeezed.as_str()));
        let near = all()
            .filter(|(_, words)| words.iter().any(|word| word.chars().count() > 2 && self.squeezed.contains(word)));
        for (column, _) in exact.chain(near) {
            if self.may_suit(column) && !found.contains(column) {
                found.push(column);
            }
        }
        found
    }

    /// The conversion to the unit of the column: factor and offset. `None`: no unit is known, or one of another quantity.
    #[must_use]
    pub fn find_conversion(&self, column: &str) -> Option<(f64, f64)> {
        find_unit_conversion(self.unit.as_deref(), column)
    }

    fn suits_column(&self, column: &str) -> bool {
        self.find_conversion(column).is_some()
    }

    /// Not of another quantity.
    fn may_suit(&self, column: &str) -> bool {
        self.unit.is_none() || self.suits_column(column)
    }
}

/// What turns a number of this unit into one of the column's: factor and offset. A column without a unit (a flag, a text) needs none.
#[must_use]
pub fn find_unit_conversion(unit: Option<&str>, column: &str) -> Option<(f64, f64)> {
    let is_text = crate::TEXT_COLUMNS.contains(&column)
        || ChannelId::from_name(column).is_some_and(|id| id.channel().kind == Kind::Text);
    if is_text {
        return Some((1.0, 0.0));
    }
    let own = quantity::unit_of(column)?;
    let Some(unit) = unit else { return (own == "1").then_some((1.0, 0.0)) };
    let (from, to) = (Unit::from_symbol(unit)?, Unit::from_symbol(own)?);
    // A feed per revolution is a length that goes with the revolution; a share is a hundredth.
    from.compute_conversion(to)
}

fn last_bracket(text: &str, open: char, close: char) -> Option<(usize, &str, usize)> {
    let end = text.rfind(close)?;
    let at = text[..end].rfind(open)?;
    Some((at, &text[at + open.len_utf8()..end], end + close.len_utf8()))
}

fn without_brackets(text: &str) -> String {
    let mut kept = text.to_owned();
    for (open, close) in [('[', ']'), ('(', ')'), ('（', '）'), ('<', '>')] {
        while let Some((at, _, end)) = last_bracket(&kept, open, close) {
            let shorter = format!("{} {}", &kept[..at], &kept[end..]);
            if squeeze_name(&shorter).is_empty() {
                break;
            }
            kept = shorter;
        }
    }
    kept
}

/// A unit at the end of a name: `SpindlePower_W`, `Drehzahl in 1/min`, `Leistung / kW`, `feed_mm_min`.
fn split_unit(text: &str) -> Option<(&str, &str)> {
    for between in [" in ", " / ", ", ", " - "] {
        if let Some((name, unit)) = text.rsplit_once(between)
            && Unit::from_symbol(unit).is_some()
        {
            return Some((name, unit));
        }
    }
    let lower_end = quantity::without_unit(text);
    if lower_end.len() < text.len()
        && let Some(unit) = quantity::unit_of(text)
    {
        return Some((lower_end, unit));
    }
    let (name, unit) = text.rsplit_once(['_', ' '])?;
    let is_unit = unit.len() < 8 && !unit.chars().all(|c| c.is_ascii_digit()) && Unit::from_symbol(unit).is_some();
    is_unit.then_some((name, unit))
}

/// The words of a name: at spaces and signs, and where a small letter meets a capital.
fn split_words(text: &str) -> Vec<String> {
    let mut parts: Vec<String> = Vec::new();
    let mut word = String::new();
    let mut before = ' ';
    for c in text.chars() {
        let boundary = !c.is_alphanumeric() || c.is_uppercase() && before.is_lowercase();
        if boundary && !word.is_empty() {
            parts.push(squeeze_name(&word));
            word.clear();
        }
        if c.is_alphanumeric() {
            word.push(c);
        }
        before = c;
    }
    if !word.is_empty() {
        parts.push(squeeze_name(&word));
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn meaning(text: &str) -> Option<(&'static str, f64)> {
        let name = ForeignName::from_text(text, None);
        let column = name.find_meaning()?;
        Some((column, name.find_conversion(column)?.0))
    }

    #[test]
    fn names_of_three_languages_are_understood_with_their_units() {
        for (text, column, factor) in [
            ("Drehzahl [1/min]", "spindle_speed_rpm", 1.0),
            ("主轴转速(rpm)", "spindle_speed_rpm", 1.0),
            ("主轴功率（kW）", "spindle_power_w", 1000.0),
            ("Spindle Speed (r/s)", "spindle_speed_rpm", 60.0),
            ("Actual spindle speed [rpm]", "spindle_speed_rpm", 1.0),
            ("SpindlePower_W", "spindle_power_w", 1.0),
            ("Vorschub in m/min", "feed_mm_min", 1000.0),
            ("Vorschub [mm/U]", "feed_per_rev_mm", 1.0),
            ("Kühlmittel", "coolant_on", 1.0),
            ("Wirkleistung Spindel / kW", "spindle_power_w", 1000.0),
            ("批次", "run", 1.0),
            ("spindle_speed_rpm", "spindle_speed_rpm", 1.0),
        ] {
            assert_eq!(meaning(text), Some((column, factor)), "{text}");
        }
        let power = ForeignName::from_text("Spindelleistung", Some("(kW)"));
        assert_eq!(power.find_conversion("spindle_power_w"), Some((1000.0, 0.0)));
    }

    #[test]
    fn what_is_not_sure_is_only_a_candidate() {
        for text in ["Leistung [kW]", "Spindle speed", "Drehzahl [kW]", "Channel A (V)", "P1[W]"] {
            assert_eq!(meaning(text), None, "{text}");
        }
        let power = ForeignName::from_text("Leistung [kW]", None);
        assert_eq!(power.list_candidates(), ["spindle_power_w", "total_power_w"]);
        assert_eq!(ForeignName::from_text("Spindle speed", None).list_candidates()[0], "spindle_speed_rpm");
    }

    #[test]
    fn every_column_of_the_dictionary_exists() {
        for (column, words) in DICTIONARY.iter().chain(UNSURE) {
            let known = crate::TEXT_COLUMNS.contains(column) || quantity::unit_of(column).is_some();
            assert!(known, "{column}");
            for word in *words {
                assert_eq!(squeeze_name(word), *word);
            }
        }
    }
}
