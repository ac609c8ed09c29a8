//! A column beside what machines have. The ranges are wide: a value outside of them is another unit, or no machine tool.

use super::{UnitDoubt, median};
use recording::Numbers;
use recording::Recording;
use rules::twin::text_report::format_short_number;

/// Column, what its greatest values lie between, and the unit that smaller and greater ones look like.
type Size = (&'static str, (f64, f64), &'static str, &'static str);

/// From the smallest to the greatest machine tools of the catalogues: a watchmaker's lathe to a vertical lathe of 10 m, micro milling to gantry mills.
const SIZES: [Size; 27] = [
    ("spindle_speed_rpm", (90.0, 2e5), "1/s, rad/s or 1000/min", "deg/s"),
    ("spindle_programmed_rpm", (90.0, 2e5), "1/s, rad/s or 1000/min", "deg/s"),
    ("feed_mm_min", (4.0, 6e4), "m/min or mm/rev", "um/min"),
    ("feed_programmed_mm_min", (4.0, 6e4), "m/min or mm/rev", "um/min"),
    ("feed_per_rev_mm", (1e-3, 8.0), "inch or m", "um"),
    ("depth_of_cut_mm", (5e-3, 60.0), "m or inch", "um"),
    ("width_of_cut_mm", (1e-2, 600.0), "m or inch", "um"),
    ("diameter_mm", (0.5, 5e3), "m", "um"),
    ("removal_rate_cm3_min", (1e-3, 3e3), "m3/h or in3/s", "mm3/min"),
    ("spindle_power_w", (25.0, 2e5), "kW", "mW"),
    ("total_power_w", (60.0, 5e5), "kW", "mW"),
    ("axis_power_w", (1.0, 1e5), "kW", "mW"),
    ("spindle_current_a", (0.1, 1200.0), "kA", "mA"),
    ("axis_current_a", (0.05, 600.0), "kA", "mA"),
    ("cutting_force_n", (1.0, 1e5), "kN", "mN"),
    ("torque_nm", (5e-3, 2e4), "kN m", "N mm or N cm"),
    ("spindle_torque_nm", (5e-3, 2e4), "kN m", "N mm or N cm"),
    ("supply_voltage_v", (80.0, 1100.0), "kV", "mV"),
    ("thermal_error_um", (0.6, 3000.0), "mm or inch", "nm"),
    ("axis_velocity_mm_min", (5.0, 1.5e5), "m/min, mm/s or m/s", "um/min"),
    ("x_axis_velocity_mm_min", (5.0, 1.5e5), "m/min, mm/s or m/s", "um/min"),
    ("y_axis_velocity_mm_min", (5.0, 1.5e5), "m/min, mm/s or m/s", "um/min"),
    ("z_axis_velocity_mm_min", (5.0, 1.5e5), "m/min, mm/s or m/s", "um/min"),
    ("axis_position_mm", (2.0, 3e4), "m or inch", "um"),
    ("velocity_m_s", (1e-3, 6.0), "km/h", "mm/s or mm/min"),
    ("feed_override_pct", (5.0, 254.0), "a share of 1", "per mille"),
    ("spindle_override_pct", (5.0, 254.0), "a share of 1", "per mille"),
];

/// Fahrenheit that a workshop has in degrees, but no air has in Celsius.
const FAHRENHEIT_AIR: (f64, f64) = (48.0, 110.0);
/// A row that lasts longer than this while cuts come and go, s.
const LONG_ROW_S: f64 = 90.0;
/// Cuts and speeds that last no longer than this, on average, are not those of a machine that is recorded for more than a trial, s.
const SHORT_CUT_S: f64 = 1.0;
/// So many changes make an average.
const LEAST_CHANGES: usize = 10;

pub(super) fn find_doubts(recording: &Recording) -> Vec<UnitDoubt> {
    let mut found: Vec<UnitDoubt> = SIZES.iter().filter_map(|size| find_size_doubt(recording, size)).collect();
    found.extend(find_temperature_doubts(recording));
    found.extend(find_time_doubt(recording));
    found
}

/// The value that one in twenty of those that are not zero exceeds.
fn upper_quantile(numbers: &Numbers) -> Option<f64> {
    let mut sizes: Vec<f64> = numbers.present_values().map(f64::abs).filter(|size| *size > 0.0).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() * 19 / 20).copied()
}

fn find_size_doubt(recording: &Recording, (name, (low, high), smaller, greater): &Size) -> Option<UnitDoubt> {
    let great = upper_quantile(recording.find_numbers(name)?)?;
    let unit = if great < *low {
        smaller
    } else if great > *high {
        greater
    } else {
        return None;
    };
    let text = format_short_number(great);
    Some(UnitDoubt::new(
        name,
        format!("{name}: its great values are about {text}, which no machine tool has: is it in {unit}?"),
        format!("{name}：较大的值约为{text}，机床上不会出现：单位是否为{unit}？"),
    ))
}

fn find_temperature_doubts(recording: &Recording) -> Vec<UnitDoubt> {
    let middle =
        |name: &str| recording.find_numbers(name).and_then(|numbers| median(numbers.present_values().collect()));
    let names =
        recording.columns().iter().map(|column| column.name.as_str()).filter(|name| name.ends_with("temperature_c"));
    let is_air =
        middle("ambient_temperature_c").is_some_and(|middle| middle > FAHRENHEIT_AIR.0 && middle < FAHRENHEIT_AIR.1);
    let say = |name: &str, middle: f64, unit: &str| {
        let text = format_short_number(middle);
        UnitDoubt::new(
            name,
            format!("{name} is {text} in the middle: is it in {unit}?"),
            format!("{name}的中位值为{text}：单位是否为{unit}？"),
        )
    };
    names
        .filter_map(|name| {
            let middle = middle(name)?;
            if middle > 200.0 {
                Some(say(name, middle, "kelvin"))
            } else if is_air && (name == "ambient_temperature_c" || middle > FAHRENHEIT_AIR.0) || middle > 125.0 {
                Some(say(name, middle, "°F"))
            } else {
                None
            }
        })
        .collect()
}

/// Steps of time that are not round in seconds and are so in another unit; rows that last longer than the cuts in them.
fn find_time_doubt(recording: &Recording) -> Option<UnitDoubt> {
    let mut steps: Vec<f64> =
        recording.time_s.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    let step = *steps.get(steps.len() / 2)?;
    let text = format_short_number(step);
    if step >= LONG_ROW_S && changes_often(recording) {
        let unit = if step >= 5e5 { "us" } else { "ms" };
        return Some(UnitDoubt::new(
            "time_s",
            format!("time_s goes on by {text} per row while speed or cut change every few rows: is it in {unit}?"),
            format!("time_s每行递增{text}，而转速或切削每隔几行就变化：单位是否为{unit}？"),
        ));
    }
    // Rows at 60 Hz are a third of 50 ms apart as well, but their cuts last.
    let is_odd = !is_round(step * 1e3) && !is_round(step * 1e6);
    let is_hasty = seconds_per_change(recording).is_some_and(|seconds| seconds < SHORT_CUT_S);
    let units = [(60.0, "min"), (3600.0, "h"), (86_400.0, "d")];
    let unit = units.into_iter().find(|(factor, _)| is_odd && is_hasty && is_round(step * factor * 1e3));
    unit.map(|(_, unit)| {
        UnitDoubt::new(
            "time_s",
            format!("time_s goes on by {text} per row, which is round in {unit} only: is it in {unit}?"),
            format!("time_s每行递增{text}，仅以{unit}为单位时为整数：单位是否为{unit}？"),
        )
    })
}

/// Is this a whole number of parts, to what a file with six digits keeps?
fn is_round(parts: f64) -> bool {
    parts.round() >= 1.0 && (parts - parts.round()).abs() < (2e-3 * parts.max(1.0)).min(0.1)
}

/// How long speed and cut stay as they are, on average.
fn seconds_per_change(recording: &Recording) -> Option<f64> {
    let span_s = recording.time_s.last()? - recording.time_s.first()?;
    let changes = count_changes(recording);
    (changes >= LEAST_CHANGES).then(|| span_s / changes as f64)
}

/// Do the speed or the cut change so often that a row cannot last minutes?
fn changes_often(recording: &Recording) -> bool {
    recording.count_rows() >= 60 && 40 * count_changes(recording) > recording.count_rows()
}

/// How often the speed or the cut becomes another.
fn count_changes(recording: &Recording) -> usize {
    let of = |name: &str| {
        recording.find_numbers(name).map_or(0, |numbers| {
            let values: Vec<f64> = numbers.present_values().collect();
            values.windows(2).filter(|pair| (pair[1] - pair[0]).abs() > 0.05 * pair[0].abs().max(pair[1].abs())).count()
        })
    };
    ["spindle_speed_rpm", "engaged", "feed_mm_min", "axis_velocity_mm_min"].map(of).into_iter().max().unwrap_or(0)
}
