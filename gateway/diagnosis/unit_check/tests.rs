//! Thirty mistakes of units, each in one column of a recording that is right otherwise: every one is told, and the right ones are not.

use super::*;
use recording::{Cells, Numbers, Words};
use rules::twin::parse_model;

const LATHE: &str = "schema = \"model/1\"\noutput = \"spindle_power_w\"\n\
    [[effect]]\nkind = \"no_load_power\"\nparameters = { p0_w = 120.0, p1_w_per_rpm = 0.22, p2_w_per_rpm2 = 2.5e-5 }\n\
    [[effect]]\nkind = \"cutting_power\"\nparameters = { kc11_n_per_mm2 = 1800.0, mc = 0.23 }\n";
const AXIS: &str = "schema = \"model/1\"\noutput = \"axis_current_a\"\n\
    [[effect]]\nkind = \"linear\"\ncolumns = { \"sign(axis_velocity_mm_min)\" = 1.5, axis_velocity_mm_min = 5e-5, one = 0.0 }\n";
const ROWS: usize = 640;

fn numbers(of: impl Fn(usize) -> f64) -> Cells {
    Cells::Numbers((0..ROWS).map(|row| Some(of(row))).collect::<Numbers>())
}

/// A lathe that cuts at four speeds, 5 % more than its model says.
fn lathe() -> Recording {
    let mut recording = Recording::new("t", (0..ROWS).map(|row| row as f64).collect(), None);
    let speed = |row: usize| [800.0, 1200.0, 1600.0, 2000.0][row / 20 % 4];
    let engaged = |row: usize| f64::from(u8::from(row % 20 >= 6));
    let cut = |row: usize| {
        engaged(row) * 1800.0 * 1.5 * 0.2_f64.powf(0.77) * (std::f64::consts::PI * 60.0 * speed(row) / 1000.0) / 60.0
    };
    recording.set_column(
        "run",
        Cells::Words((0..ROWS).map(|row| ["a", "b", "c", "d", "e", "f", "g", "h"][row / 80]).collect::<Words>()),
    );
    recording.set_column("spindle_speed_rpm", numbers(speed));
    recording.set_column("feed_mm_min", numbers(|row| 0.2 * speed(row)));
    recording.set_column("depth_of_cut_mm", numbers(|_| 1.5));
    recording.set_column("diameter_mm", numbers(|_| 60.0));
    recording.set_column("engaged", numbers(engaged));
    recording.set_column(
        "spindle_power_w",
        numbers(|row| 120.0 + 0.22 * speed(row) + 2.5e-5 * speed(row).powi(2) + 1.05 * cut(row)),
    );
    recording
}

/// With everything else that a machine may deliver.
fn rich() -> Recording {
    let mut recording = lathe();
    let speed = recording.find_numbers("spindle_speed_rpm").cloned().expect("there");
    let speed = |row: usize| speed.get(row).unwrap_or(0.0);
    let engaged = |row: usize| f64::from(u8::from(row % 20 >= 6));
    recording.set_column("feed_per_rev_mm", numbers(|_| 0.2));
    recording.set_column("cutting_speed_m_min", numbers(|row| std::f64::consts::PI * 60.0 * speed(row) / 1000.0));
    recording.set_column("total_power_w", numbers(|row| 1500.0 + 3.0 * speed(row) + 500.0 * engaged(row)));
    recording.set_column("spindle_current_a", numbers(|row| 4.0 + 6.0 * engaged(row)));
    recording.set_column("bearing_temperature_c", numbers(|row| 25.0 + 0.01 * row as f64));
    recording.set_column("ambient_temperature_c", numbers(|_| 21.0));
    recording.set_column("supply_voltage_v", numbers(|_| 400.0));
    recording.set_column("feed_override_pct", numbers(|row| if row % 50 == 0 { 90.0 } else { 100.0 }));
    recording.set_column("cutting_force_n", numbers(|row| 20.0 + 900.0 * engaged(row)));
    recording.set_column("thermal_error_um", numbers(|row| 12.0 * (row as f64 / ROWS as f64)));
    recording
}

/// An axis that goes back and forth over 400 mm.
fn axis() -> Recording {
    let mut recording = Recording::new("t", (0..ROWS).map(|row| row as f64 * 0.1).collect(), None);
    let velocity = |row: usize| if (row / 40).is_multiple_of(2) { 6000.0 } else { -6000.0 };
    let position = |row: usize| {
        let place = (row % 80) as f64;
        (if place < 40.0 { place } else { 80.0 - place }) * 10.0
    };
    recording.set_column("axis_velocity_mm_min", numbers(velocity));
    recording.set_column("axis_position_mm", numbers(position));
    recording.set_column("axis_current_a", numbers(|row| 1.5 * f64::signum(velocity(row)) + 5e-5 * velocity(row)));
    recording
}

fn told(recording: &Recording, model: &str) -> Vec<String> {
    find_input_doubts(recording, &parse_model(model).expect("a model")).into_iter().map(|doubt| doubt.text.en).collect()
}

fn with(mut recording: Recording, column: &str, factor: f64, offset: f64) -> Recording {
    if column == "time_s" {
        recording.time_s.iter_mut().for_each(|time_s| *time_s *= factor);
        return recording;
    }
    let cells = recording
        .find_numbers(column)
        .expect(column)
        .iter()
        .map(|x| x.map(|x| x * factor + offset))
        .collect::<Numbers>();
    recording.set_column(column, Cells::Numbers(cells));
    recording
}

#[test]
fn right_units_are_not_doubted() {
    for (recording, model) in [(lathe(), LATHE), (rich(), LATHE), (axis(), AXIS)] {
        assert_eq!(told(&recording, model), Vec::<String>::new());
    }
}

/// Column, and what turns the right number into that of the mistaken unit.
const MISTAKES: [(&str, f64, f64, &str); 30] = [
    ("spindle_speed_rpm", 1.0 / 60.0, 0.0, "1/s"),
    ("spindle_speed_rpm", 0.104_72, 0.0, "rad/s"),
    ("spindle_speed_rpm", 1e-3, 0.0, "1000/min"),
    ("feed_mm_min", 1e-3, 0.0, "m/min"),
    ("feed_mm_min", 1.0 / 60.0, 0.0, "mm/s"),
    ("feed_mm_min", 1.0 / 25.4, 0.0, "in/min"),
    ("depth_of_cut_mm", 1e-3, 0.0, "m"),
    ("depth_of_cut_mm", 1.0 / 25.4, 0.0, "in"),
    ("depth_of_cut_mm", 1e3, 0.0, "um"),
    ("diameter_mm", 1e-3, 0.0, "m"),
    ("diameter_mm", 1.0 / 25.4, 0.0, "in"),
    ("spindle_power_w", 1e-3, 0.0, "kW"),
    ("spindle_power_w", 1.0 / 745.7, 0.0, "hp"),
    ("spindle_power_w", 1e3, 0.0, "mW"),
    ("time_s", 1e3, 0.0, "ms"),
    ("time_s", 1.0 / 60.0, 0.0, "min"),
    ("time_s", 1.0 / 3600.0, 0.0, "h"),
    ("time_s", 1e6, 0.0, "us"),
    ("feed_per_rev_mm", 1.0 / 25.4, 0.0, "in/rev"),
    ("feed_per_rev_mm", 1e3, 0.0, "um/rev"),
    ("cutting_speed_m_min", 1.0 / 60.0, 0.0, "m/s"),
    ("total_power_w", 1e-3, 0.0, "kW"),
    ("spindle_current_a", 1e3, 0.0, "mA"),
    ("bearing_temperature_c", 1.0, 273.15, "K"),
    ("ambient_temperature_c", 1.8, 32.0, "°F"),
    ("supply_voltage_v", 1e-3, 0.0, "kV"),
    ("feed_override_pct", 1e-2, 0.0, "a share of 1"),
    ("cutting_force_n", 1e-3, 0.0, "kN"),
    ("thermal_error_um", 1e-3, 0.0, "mm"),
    ("thermal_error_um", 1e3, 0.0, "nm"),
];

/// The same of a feed axis.
const AXIS_MISTAKES: [(&str, f64, &str); 5] = [
    ("axis_velocity_mm_min", 1e-3, "m/min"),
    ("axis_velocity_mm_min", 1.0 / 60.0, "mm/s"),
    ("axis_position_mm", 1e-3, "m"),
    ("axis_position_mm", 1.0 / 25.4, "in"),
    ("time_s", 1e3, "ms"),
];

#[test]
fn thirty_mistakes_are_told() {
    let mut silent = Vec::new();
    let mut check = |recording: Recording, model: &str, column: &str, unit: &str| {
        let text = told(&recording, model).join("\n");
        if !text.contains(column) {
            silent.push(format!("{column} in {unit}: {text:?}"));
        }
    };
    for (column, factor, offset, unit) in MISTAKES {
        let base = if lathe().find_numbers(column).is_some() || column == "time_s" { lathe() } else { rich() };
        check(with(base, column, factor, offset), LATHE, column, unit);
    }
    for (column, factor, unit) in AXIS_MISTAKES {
        check(with(axis(), column, factor, 0.0), AXIS, column, unit);
    }
    println!("{} of 35 mistakes of units told", 35 - silent.len());
    assert!(silent.is_empty(), "{}", silent.join("\n"));
}

#[test]
fn a_parameter_far_from_its_nominal_value_is_asked_for() {
    let nominal = parse_model(LATHE).expect("a model");
    let mut refitted = nominal.clone();
    refitted.parts[0].parameters[1].value *= 60.0;
    let doubts = find_parameter_doubts(&nominal, &refitted);
    assert_eq!(doubts.len(), 1);
    let text = &doubts[0].text.en;
    assert!(
        text.contains("no_load_power.p1_w_per_rpm is 60 times its nominal value")
            && text.contains("spindle_speed_rpm in 1/s"),
        "{text}"
    );
    assert!(find_parameter_doubts(&nominal, &nominal).is_empty());
}
