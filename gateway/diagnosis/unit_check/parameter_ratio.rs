//! Refitted parameters beside the nominal ones: one that is many times its nominal value is not this machine's, or its column is in another unit.

use super::{UnitDoubt, list_possible_units};
use rules::physics::Entry;
use rules::twin::text_report::{format_short_number, space_unit};
use rules::twin::{Model, Parameter, Part, PartFunction};

/// Times its nominal value from which a parameter is asked for. Two machines of a kind differ by less than three.
const MANY: f64 = 8.0;
/// Ratio and factor of a unit are the same within this much of the logarithm.
const SAME: f64 = 0.45;

/// Columns that a parameter multiplies, by words in its name.
const COLUMNS: [(&str, &str); 6] = [
    ("rpm", "spindle_speed_rpm"),
    ("kc11", "depth_of_cut_mm, diameter_mm, feed_mm_min or the output"),
    ("per_mm_min", "axis_velocity_mm_min"),
    ("per_m_s", "velocity_m_s"),
    ("per_c", "a temperature"),
    ("per_k", "a temperature"),
];

/// Parameters of the nominal model whose refitted value is far from it.
#[must_use]
pub fn find_parameter_doubts(nominal: &Model, refitted: &Model) -> Vec<UnitDoubt> {
    let mut found = Vec::new();
    for part in nominal.parts.iter().filter(|part| matches!(part.body, PartFunction::Effect(..))) {
        let Some(other) = refitted.parts.iter().find(|other| other.label() == part.label()) else { continue };
        for parameter in part
            .parameters
            .iter()
            .filter(|parameter| parameter.entry == Entry::Linear && !parameter.fixed && parameter.value != 0.0)
        {
            found.extend(other.find_parameter(&parameter.name).and_then(|now| compare_parameter(part, parameter, now)));
        }
    }
    found
}

fn compare_parameter(part: &Part, nominal: &Parameter, now: &Parameter) -> Option<UnitDoubt> {
    let ratio = now.value / nominal.value;
    let (low, high) = nominal.range;
    let outside = now.value < low || now.value > high;
    // A parameter at zero is a part that is not needed; that is no unit.
    if !(ratio.abs() > MANY || outside && ratio.abs() > 1e-3) {
        return None;
    }
    let name = format!("{}.{}", part.label(), nominal.name);
    let column = COLUMNS.iter().find(|(word, _)| nominal.name.contains(word)).map(|(_, column)| *column);
    let unit = column.filter(|column| !column.contains(' ')).and_then(|column| {
        let known = list_possible_units(column).into_iter().find(|(_, factor)| {
            (ratio.abs() / factor).ln().abs() < SAME || (ratio.abs().sqrt() / factor).ln().abs() < SAME / 2.0
        });
        known.map(|(unit, _)| format!("{column} in {unit}"))
    });
    let asked = unit
        .or_else(|| column.map(|column| format!("{column} in another unit")))
        .unwrap_or_else(|| "one of its columns in another unit".to_owned());
    let (times, value, was) =
        (format_short_number(ratio), format_short_number(now.value), format_short_number(nominal.value));
    let unit = space_unit(&nominal.unit);
    Some(UnitDoubt::new(
        &name,
        format!("{name} is {times} times its nominal value ({value} for {was}{unit}): is {asked}?"),
        format!("{name}是名义值的{times}倍（{value}，名义值{was}{unit}）：是否单位有误（{asked}）？"),
    ))
}
