//! Alarms and warnings of a control in words. Pure.

use super::answer::{Alarm, Status};

/// Which table of alarm types a control has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AlarmTable {
    /// 30i, 31i, 32i, 35i, 0i-D, 0i-F: two letters and four digits, `SV0417`.
    Newer,
    /// 16i, 18i, 21i, 0i-A to C: a word and the number, `P/S 100`.
    Older,
}

/// Types of alarms by their number. Source: FOCAS2 manual, `cnc_rdalmmsg2`; type 19 is on newer 30i only.
const NEWER_KINDS: [&str; 20] =
    ["SW", "PW", "IO", "PS", "OT", "OH", "SV", "SR", "MC", "SP", "DS", "IE", "BG", "SN", "", "EX", "", "", "", "PC"];

/// Types 0 to 2 are the program and setting alarms 100, 000 and 101, 3 the others below 256 and 10 those from 5000 on. Source:
/// FOCAS manual, `cnc_alarm`; an open adapter of the MTConnect project names types 0 to 10 in the same way.
const OLDER_KINDS: [&str; 16] =
    ["P/S", "P/S", "P/S", "P/S", "OT", "OH", "SV", "", "APC", "SP", "P/S", "LASER", "", "RIGID TAP", "", "EX"];

/// Warnings of the status word from 2 on: what the control says, and what to do. Source: FOCAS2 manual, `ODBST.alarm`.
const WARNINGS: [(&str, &str, &str); 7] = [
    (
        "BATTERY LOW",
        "电池电压低",
        "Change the battery while the control is switched on; without it positions and parameters are lost",
    ),
    ("FAN", "风扇异常", "Change the fan that the control names before it overheats"),
    ("PS WARNING", "程序警告", "Look at the message on the control's screen"),
    ("FSSB WARNING", "FSSB警告", "Look at the message on the control's screen"),
    ("INSULATION LOW", "绝缘下降", "Have the motor that the control names checked before it fails"),
    ("ENCODER WARNING", "编码器警告", "Have the encoder that the control names checked before it fails"),
    ("PMC ALARM", "PMC报警", "Look at the PMC alarm screen"),
];

/// At most so many alarms stand in the channel.
const ALARMS_SHOWN: usize = 4;

/// The warning of the status word, with what to do: `None` without one.
#[must_use]
pub fn describe_warning(status: &Status) -> Option<(String, &'static str)> {
    let place = usize::try_from(status.alarm - 2).ok()?;
    Some(match WARNINGS.get(place) {
        Some((en, zh, next)) => (format!("{en} {zh}"), next),
        None => (format!("WARNING {}", status.alarm), "Look at the message on the control's screen"),
    })
}

/// Does the status say that there is an alarm? A low battery (2 and more) is none.
#[must_use]
pub fn has_alarm(status: &Status) -> bool {
    status.alarm == 1
}

/// The text of the channel `alarm`: empty without one. `alarms` are those that could be read.
#[must_use]
pub fn format_alarms(status: &Status, alarms: &[Alarm], axes: &[String], table: AlarmTable) -> String {
    let mut texts = Vec::new();
    if status.emergency == 1 {
        texts.push("EMERGENCY STOP".to_owned());
    }
    if has_alarm(status) {
        texts.extend(alarms.iter().take(ALARMS_SHOWN).map(|alarm| format_alarm(alarm, axes, table)));
        if alarms.len() > ALARMS_SHOWN {
            texts.push(format!("and {} more", alarms.len() - ALARMS_SHOWN));
        }
        if alarms.is_empty() {
            texts.push("ALARM".to_owned());
        }
    }
    texts.join("; ")
}

pub(super) fn format_alarm(alarm: &Alarm, axes: &[String], table: AlarmTable) -> String {
    let place = usize::try_from(alarm.kind).ok();
    let of = |kinds: &'static [&'static str]| place.and_then(|kind| kinds.get(kind)).copied().unwrap_or("");
    let name = match table {
        AlarmTable::Newer => format!("{}{:04}", of(&NEWER_KINDS), alarm.number),
        AlarmTable::Older => format!("{} {:03}", of(&OLDER_KINDS), alarm.number),
    };
    let axis = usize::try_from(alarm.axis - 1).ok().and_then(|axis| axes.get(axis));
    let axis = axis.map_or(String::new(), |axis| format!(" ({axis})"));
    format!("{name}{axis} {}", alarm.text).trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(automatic: i16, run: i16) -> Status {
        Status { automatic, run, ..Status::default() }
    }

    #[test]
    fn alarms_are_named_with_their_axis() {
        let axes = ["X".to_owned(), "Y".to_owned()];
        let alarms = vec![Alarm { number: 417, kind: 6, axis: 2, text: "SERVO ALARM".to_owned() }; 6];
        let on = Status { alarm: 1, ..status(1, 0) };
        let alarm = |status: &Status, alarms: &[Alarm]| super::format_alarms(status, alarms, &axes, AlarmTable::Newer);
        assert_eq!(alarm(&on, &alarms[..1]), "SV0417 (Y) SERVO ALARM");
        assert!(alarm(&on, &alarms).ends_with("and 2 more"));
        assert_eq!(alarm(&on, &[]), "ALARM");
        assert_eq!(alarm(&status(1, 3), &alarms), "", "cleared on the control");
        assert_eq!(alarm(&Status { alarm: 2, ..status(1, 3) }, &[]), "", "a low battery stops nothing");
        assert_eq!(alarm(&Status { emergency: 1, ..on }, &[]), "EMERGENCY STOP; ALARM");
    }

    #[test]
    fn the_type_of_an_alarm_is_named_by_the_generation() {
        let named =
            |kind, number, table| format_alarm(&Alarm { number, kind, axis: 0, text: "X".to_owned() }, &[], table);
        let older = |kind, number| named(kind, number, AlarmTable::Older);
        assert_eq!(
            (older(1, 0), older(0, 100), older(10, 5010)),
            ("P/S 000 X".into(), "P/S 100 X".into(), "P/S 5010 X".into())
        );
        assert_eq!(
            (older(8, 300), older(9, 749), older(6, 417)),
            ("APC 300 X".into(), "SP 749 X".into(), "SV 417 X".into())
        );
        assert_eq!(named(8, 300, AlarmTable::Newer), "MC0300 X");
        assert_eq!(named(19, 50, AlarmTable::Newer), "PC0050 X");
        assert_eq!(named(14, 7, AlarmTable::Newer), "0007 X");
    }

    #[test]
    fn warnings_of_the_status_word_are_told_apart_from_alarms() {
        let warning = |alarm| super::describe_warning(&Status { alarm, ..Status::default() }).map(|(text, _)| text);
        assert_eq!((warning(0), warning(1)), (None, None));
        assert_eq!((warning(2), warning(3)), (Some("BATTERY LOW 电池电压低".into()), Some("FAN 风扇异常".into())));
        assert_eq!(warning(99).as_deref(), Some("WARNING 99"));
        assert!(!has_alarm(&Status { alarm: 3, ..Status::default() }));
    }
}
