//! Columns of which one follows from others: a constant factor between both is a unit.

use super::{UnitDoubt, find_nearest_unit, median};
use recording::Recording;
use recording::derive_quantity;
use rules::twin::text_report::format_short_number;

/// Two courses that belong together keep their ratio within this share of it in half of the rows.
const STEADY: f64 = 0.1;
/// A ratio this near to one needs no word.
const ALIKE: f64 = 0.3;
/// Ratio and factor of a unit are the same within this much of the logarithm.
const SAME: f64 = 0.12;
/// Rows that must speak.
const ROWS_MIN: usize = 20;

/// Columns that do not fit one another.
pub(super) fn find_doubts(recording: &Recording) -> Vec<UnitDoubt> {
    let mut found = Vec::new();
    for (name, others) in [
        ("feed_per_rev_mm", &["feed_mm_min", "spindle_speed_rpm"][..]),
        ("cutting_speed_m_min", &["spindle_speed_rpm", "diameter_mm"]),
        ("removal_rate_cm3_min", &["depth_of_cut_mm", "width_of_cut_mm", "feed_mm_min"]),
    ] {
        let (Some(given), Some(follows)) = (recording.find_numbers(name), derive_quantity(recording, name)) else {
            continue;
        };
        let pairs = given.iter().zip(follows.iter()).filter_map(|(given, follows)| Some((given?, follows?)));
        found.extend(find_relation_doubt(name, others, pairs.collect()));
    }
    for prefix in ["", "x_", "y_", "z_"] {
        found.extend(find_position_doubt(recording, prefix));
    }
    found.extend(find_power_doubts(recording));
    found
}

/// One column and those that it follows from; pairs are given and computed.
fn find_relation_doubt(name: &str, others: &[&str], pairs: Vec<(f64, f64)>) -> Option<UnitDoubt> {
    let ratios: Vec<f64> =
        pairs.into_iter().filter(|(a, b)| a.abs() > 1e-9 && b.abs() > 1e-9).map(|(a, b)| (a / b).abs()).collect();
    if ratios.len() < ROWS_MIN {
        return None;
    }
    let middle = median(ratios.clone())?;
    let steady = ratios.iter().filter(|ratio| (*ratio / middle).ln().abs() < STEADY).count();
    if middle.ln().abs() < ALIKE || 2 * steady < ratios.len() {
        return None;
    }
    // The column itself may be in another unit, or one of those that it follows from.
    let own = find_nearest_unit(name, 1.0 / middle, SAME).map(|(unit, _)| (name, unit));
    let of_others = others.iter().filter_map(|other| {
        let up = find_nearest_unit(other, middle, SAME).or_else(|| find_nearest_unit(other, 1.0 / middle, SAME));
        up.map(|(unit, _)| (*other, unit))
    });
    let guesses: Vec<(&str, &str)> = own.into_iter().chain(of_others).collect();
    let list: Vec<String> = guesses.iter().map(|(column, unit)| format!("{column} in {unit}")).collect();
    let list_zh: Vec<String> = guesses.iter().map(|(column, unit)| format!("{column}以{unit}为单位")).collect();
    let (end, end_zh) = if list.is_empty() {
        ("; one of them is in another unit".to_owned(), "；其中之一的单位不对".to_owned())
    } else {
        (format!(": is {}?", list.join(", or ")), format!("：是否{}？", list_zh.join("，或")))
    };
    let (ratio, others_list) = (format_short_number(middle), others.join(", "));
    Some(UnitDoubt::new(
        name,
        format!("{name} is {ratio} times what follows from {others_list}{end}"),
        format!("{name}是由{others_list}推算值的{ratio}倍{end_zh}"),
    ))
}

/// How the position changes is the velocity.
fn find_position_doubt(recording: &Recording, prefix: &str) -> Option<UnitDoubt> {
    let (position, velocity) = (format!("{prefix}axis_position_mm"), format!("{prefix}axis_velocity_mm_min"));
    let (places, speeds) = (recording.find_numbers(&position)?, recording.find_numbers(&velocity)?);
    let mut pairs = Vec::new();
    for run in recording.list_runs() {
        for row in run.rows.clone().skip(1) {
            let dt_s = recording.time_s[row] - recording.time_s[row - 1];
            let step = |row: usize| {
                Some((places.get(row)? - places.get(row - 1)?, 0.5 * (speeds.get(row)? + speeds.get(row - 1)?)))
            };
            // The ends of a stroke would mix both ways.
            let same_way = speeds
                .get(row)
                .zip(speeds.get(row - 1))
                .is_some_and(|(now, before)| now * before > 0.0 && (now / before - 1.0).abs() < 0.05);
            if let Some((moved, speed)) = step(row).filter(|_| dt_s > 0.0 && same_way) {
                pairs.push((moved / dt_s * 60.0, speed));
            }
        }
    }
    let ratios: Vec<f64> =
        pairs.iter().filter(|(a, b)| a.abs() > 1e-9 && b.abs() > 1e-9).map(|(a, b)| (a / b).abs()).collect();
    let middle = median(ratios.clone()).filter(|middle| middle.ln().abs() > ALIKE)?;
    let steady = ratios.iter().filter(|ratio| (*ratio / middle).ln().abs() < 0.3).count();
    if ratios.len() < ROWS_MIN || 2 * steady < ratios.len() {
        return None;
    }
    let ratio = format_short_number(middle);
    let mut guesses: Vec<(String, String)> = Vec::new();
    let mut add =
        |column: &str, unit: &str| guesses.push((format!("{column} in {unit}"), format!("{column}以{unit}为单位")));
    if let Some((unit, _)) = find_nearest_unit(&position, 1.0 / middle, SAME) {
        add(&position, unit);
    }
    if let Some((unit, _)) = find_nearest_unit(&velocity, middle, SAME) {
        add(&velocity, unit);
    }
    if let Some((unit, _)) = find_nearest_unit("time_s", middle, SAME) {
        add("time_s", unit);
    }
    let (en, zh): (Vec<String>, Vec<String>) = guesses.into_iter().unzip();
    Some(UnitDoubt::new(
        &velocity,
        format!(
            "{position} changes {ratio} times as fast as {velocity} says: is {}?",
            or_another(&en.join(", or "), "one of them in another unit")
        ),
        format!(
            "{position}的变化速度是{velocity}的{ratio}倍：是否{}？",
            or_another(&zh.join("，或"), "其中之一的单位不对")
        ),
    ))
}

fn or_another(list: &str, none: &str) -> String {
    if list.is_empty() { none.to_owned() } else { list.to_owned() }
}

/// The spindle is a part of the machine; torque times speed is power.
fn find_power_doubts(recording: &Recording) -> Vec<UnitDoubt> {
    let mut found = Vec::new();
    let number = |name: &str| recording.find_numbers(name);
    let typical = |a: &str, b: &str| -> Option<f64> {
        let (a, b) = (number(a)?, number(b)?);
        let ratios: Vec<f64> = a
            .iter()
            .zip(b.iter())
            .filter_map(|(a, b)| Some((a?, b?)))
            .filter(|(a, b)| *a > 1e-9 && *b > 1e-9)
            .map(|(a, b)| a / b)
            .collect();
        (ratios.len() >= ROWS_MIN).then(|| median(ratios)).flatten()
    };
    if let Some(ratio) = typical("spindle_power_w", "total_power_w") {
        let text = format_short_number(ratio);
        if ratio > 5.0 {
            found.push(UnitDoubt::new(
                "total_power_w",
                format!(
                    "spindle_power_w is {text} times total_power_w, of which it is a part: is total_power_w in kW?"
                ),
                format!(
                    "spindle_power_w是total_power_w的{text}倍，而前者是后者的一部分：total_power_w是否以kW为单位？"
                ),
            ));
        } else if ratio < 1e-4 {
            found.push(UnitDoubt::new(
                "spindle_power_w",
                format!("spindle_power_w is {text} of total_power_w: is it in kW?"),
                format!("spindle_power_w只有total_power_w的{text}：是否以kW为单位？"),
            ));
        }
    }
    let (torque, speed) = (number("spindle_torque_nm").or_else(|| number("torque_nm")), number("spindle_speed_rpm"));
    if let (Some(torque), Some(speed), Some(power)) = (torque, speed, number("spindle_power_w")) {
        let rows = torque.iter().zip(speed.iter()).zip(power.iter());
        let ratios: Vec<f64> = rows
            .filter_map(|((torque, speed), power)| Some((power?, torque? * speed? * std::f64::consts::TAU / 60.0)))
            .filter(|(electric, mechanical)| *electric > 1e-9 && *mechanical > 1e-9)
            .map(|(electric, mechanical)| electric / mechanical)
            .collect();
        if let Some(ratio) =
            median(ratios.clone()).filter(|ratio| ratios.len() >= ROWS_MIN && !(0.03..30.0).contains(ratio))
        {
            let text = format_short_number(ratio);
            found.push(UnitDoubt::new(
                "torque_nm",
                format!("spindle_power_w is {text} times torque times speed: is one of the three in another unit (kW, N cm, 1/s)?"),
                format!("spindle_power_w是扭矩乘转速的{text}倍：三者之一是否用了其他单位（kW、N cm、1/s）？"),
            ));
        }
    }
    found
}
