//! Is this recording fit to be compared with this model? Everything that is wrong, at once, each with what to record
//! instead.

use super::bind::bind_model;
use super::diagnosis::find_output_unit;
use super::inputs::list_input_columns;
use super::model::{Model, Part, simulate_parts};
use super::text_report::space_unit;
use adapter_core::channel::{ChannelId, Kind};
use numerics::statistics::{count_to_f64, median};
use physics::Scene;
use recording::Numbers;
use recording::Recording;

/// Share of values outside the physical range beyond which the unit must be wrong.
const OUTSIDE_SHARE_MAX: f64 = 0.01;
/// Share of rows without progress of time beyond which the time stamps are useless.
const STANDING_SHARE_MAX: f64 = 0.2;
/// Recorded over simulated, or the inverse, that means another prefix of the unit (kW for W): a
/// thousand, with a factor of about three to either side because the model is not exact.
const PREFIX: (f64, f64) = (300.0, 3000.0);
/// Celsius that no part of a machine tool has, but the air has in kelvin.
const KELVIN: (f64, f64) = (270.0, 330.0);
/// Runs below which stretches of runs are held out in place of runs.
const RUNS_MIN: usize = 4;

/// What was found before the comparison.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Examination {
    /// Reasons why the input cannot be used.
    pub unusable: Vec<String>,
    /// What makes the answer weaker than it could be.
    pub notes: Vec<String>,
}

/// Examines a recording for a model.
#[must_use]
pub fn examine_recording(recording: &Recording, model: &Model) -> Examination {
    let mut found = Examination::default();
    for column in recording.columns() {
        if let Some(numbers) = recording.find_numbers(&column.name) {
            check_value_range(&column.name, numbers, &mut found);
            check_temperature_unit(&column.name, numbers, &mut found);
        }
    }
    check_time_stamps(recording, &mut found);
    check_derived_quantities(recording, &mut found);
    match Scene::new(recording, &model.output, &model.roles) {
        Err(error) => found.unusable.push(error.to_string()),
        Ok(mut scene) => match bind_model(model, &scene) {
            Err(problems) => found.unusable.extend(problems),
            Ok(parts) => check_nominal_model(&parts, &mut scene, &mut found),
        },
    }
    found
}

/// Values outside what is physically possible in the channel's unit.
///
/// Of a measured quantity only the size tells the unit: a current is recorded below zero where its meter has noise at rest or gives
/// the direction, and its unit is right all the same.
fn check_value_range(name: &str, numbers: &Numbers, found: &mut Examination) {
    let Some(channel) = ChannelId::from_name(name).map(ChannelId::channel) else { return };
    let outside = |x: &f64| !channel.accepts_number(*x);
    let outsiders = numbers.present_values().filter(outside).count();
    if outsiders == 0 {
        return;
    }
    let all = numbers.count_present();
    let example = numbers.present_values().find(outside).unwrap_or_default();
    let (low, high) = channel.range;
    let unit = space_unit(channel.unit);
    let text = format!("{name}: {outsiders} of {all} values lie outside {low} to {high}{unit}, such as {example}");
    let is_of_wrong_size = |x: &f64| outside(x) && (channel.kind == Kind::Held || x.abs() > low.abs().max(high.abs()));
    let wrong = numbers.present_values().filter(is_of_wrong_size).count();
    if count_to_f64(wrong) > OUTSIDE_SHARE_MAX * count_to_f64(all) {
        let next =
            if channel.unit == "1" { "check the scale".to_owned() } else { format!("record it in {}", channel.unit) };
        found.unusable.push(format!("{text}: wrong unit? {next}, or leave the column out"));
    } else {
        found.notes.push(text);
    }
}

fn check_temperature_unit(name: &str, numbers: &Numbers, found: &mut Examination) {
    if !name.ends_with("temperature_c") {
        return;
    }
    let Some(middle) = median(numbers.present_values().collect()) else { return };
    if middle > KELVIN.0 && middle < KELVIN.1 {
        found.unusable.push(format!("{name}: a median of {middle} looks like kelvin; record degrees Celsius"));
    }
}

fn check_time_stamps(recording: &Recording, found: &mut Examination) {
    let steps = |rows: std::ops::Range<usize>| -> usize {
        recording.time_s[rows].windows(2).filter(|pair| pair[1] <= pair[0]).count()
    };
    let standing: usize = recording.list_runs().into_iter().map(|run| steps(run.rows)).sum();
    let rows = recording.count_rows();
    if count_to_f64(standing) > STANDING_SHARE_MAX * count_to_f64(rows) {
        found.unusable.push(format!(
            "time does not advance in {standing} of {rows} rows: record the time of each sample with its decimals \
             (stamps in whole seconds do not suffice for several samples per second)"
        ));
    }
    let runs = recording.list_runs().len();
    if runs < RUNS_MIN {
        found.notes.push(format!(
            "{runs} run{}: stretches are held out in place of runs; record at least {RUNS_MIN} runs (column run) for a \
             test on runs that took no part",
            if runs == 1 { "" } else { "s" }
        ));
    }
}

/// Quantities that must agree because one follows from others: a constant factor between them is a unit.
fn check_derived_quantities(recording: &Recording, found: &mut Examination) {
    for (name, factors) in [
        ("feed_per_rev_mm", &[(60.0, "mm/s in feed_mm_min, or rev/s in spindle_speed_rpm")][..]),
        ("cutting_speed_m_min", &[(60.0, "m/s"), (1000.0, "mm/min")][..]),
    ] {
        let (Some(given), Some(follows)) = (recording.find_numbers(name), recording::derive_quantity(recording, name))
        else {
            continue;
        };
        let ratio = |(given, follows): (Option<f64>, Option<f64>)| Some(given? / follows.filter(|x| x.abs() > 1e-9)?);
        let ratios: Vec<f64> = given.iter().zip(follows.iter()).filter_map(ratio).filter(|x| *x > 0.0).collect();
        let Some(middle) = median(ratios) else { continue };
        for (factor, unit) in factors {
            if (middle / factor).ln().abs() < 0.05 || (middle * factor).ln().abs() < 0.05 {
                found.unusable.push(format!(
                    "{name} is {middle:.4} times what follows from the other columns: a wrong unit ({unit})?"
                ));
            }
        }
    }
}

/// The nominal model over the recording: does its output have the size of the recorded one, and do its inputs change?
fn check_nominal_model(parts: &[Part], scene: &mut Scene, found: &mut Examination) {
    let inputs = list_input_columns(scene, parts);
    for name in &inputs {
        if let Some((low, high)) = scene.column(name).and_then(find_extremes)
            && low == high
        {
            found.notes.push(format!(
                "{name} is {low} in every row: what depends on it cannot be told from a constant; vary it"
            ));
        }
    }
    let Some(simulated) = simulate_parts(parts, scene) else {
        found.unusable.push("the model cannot be simulated over this recording".to_owned());
        return;
    };
    if parts.iter().any(|part| matches!(part.kind.as_str(), "no_load_power" | "cutting_power")) {
        check_unit_prefix(scene, &simulated.total, found);
    }
}

fn check_unit_prefix(scene: &Scene, simulated: &[f64], found: &mut Examination) {
    let usable = |row: &usize| scene.usable_rows()[*row];
    let typical = |values: &[f64]| median((0..values.len()).filter(usable).map(|row| values[row].abs()).collect());
    let (Some(recorded), Some(simulated)) = (typical(scene.recorded_output()), typical(simulated)) else { return };
    let (output, unit) = (scene.output_name(), find_output_unit(scene.output_name()));
    let inside = |ratio: f64| ratio > PREFIX.0 && ratio < PREFIX.1;
    if recorded > 0.0 && simulated > 0.0 && (inside(recorded / simulated) || inside(simulated / recorded)) {
        found.unusable.push(format!(
            "{output}: the recording says {recorded:.4}, the model {simulated:.4} (medians): a factor of about 1000, such \
             as kW for W; record {output} in {unit}, or correct the model"
        ));
    }
}

fn find_extremes(values: &[f64]) -> Option<(f64, f64)> {
    let first = *values.first()?;
    Some(values.iter().fold((first, first), |(low, high), x| (low.min(*x), high.max(*x))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse_model;
    use recording::read_csv;

    const MODEL: &str = "schema = \"model/1\"\noutput = \"spindle_power_w\"\n[[effect]]\nkind = \"no_load_power\"\n\
                         parameters = { p0_w = 120.0, p1_w_per_rpm = 0.22, p2_w_per_rpm2 = 0.0 }\n";

    fn examined(csv: &str) -> Examination {
        let recording = read_csv(csv.as_bytes(), "t.csv").expect("readable").recording;
        examine_recording(&recording, &parse_model(MODEL).expect("fine"))
    }

    #[test]
    fn every_wrong_unit_is_named_at_once() {
        let text = "time_s,spindle_speed_rpm,spindle_power_w,engaged,bearing_temperature_c\n\
                    0,1000,0.34,100,293\n1,2000,0.56,100,294\n2,1000,0.34,100,293\n";
        let all = examined(text).unusable.join("\n");
        for wanted in ["engaged: 3 of 3 values lie outside 0 to 1", "kelvin", "kW for W"] {
            assert!(all.contains(wanted), "{wanted} in:\n{all}");
        }
    }

    /// Half the rows below zero: noise of a current meter at rest. Ten thousand times the size: milliamperes.
    #[test]
    fn a_current_below_zero_has_no_wrong_unit() {
        let of = |factor: f64| {
            let rows = [-0.07, 0.03, -0.02, 12.0].iter().zip(0..);
            let rows: Vec<String> = rows.map(|(amps, second)| format!("{second},1000,340,{}", amps * factor)).collect();
            examined(&format!("time_s,spindle_speed_rpm,spindle_power_w,spindle_current_a\n{}\n", rows.join("\n")))
        };
        assert_eq!(of(1.0).unusable, Vec::<String>::new());
        let outside = |note: &String| note.contains("lie outside");
        assert!(!of(1.0).notes.iter().any(outside), "noise about zero is no fault");
        let milli = of(1e3).unusable.join("\n");
        assert!(milli.contains("wrong unit? record it in A"), "{milli}");
    }

    #[test]
    fn missing_inputs_and_standing_time_are_named_at_once() {
        let all = examined("time_s,spindle_power_w\n0,300\n0,310\n0,305\n").unusable.join("\n");
        assert!(all.contains("time does not advance in 2 of 3 rows") && all.contains("spindle_speed_rpm"), "{all}");
    }

    #[test]
    fn a_good_recording_has_nothing_but_notes() {
        let found = examined("time_s,spindle_speed_rpm,spindle_power_w\n0,1000,340\n1,1000,341\n");
        assert_eq!(found.unusable, Vec::<String>::new());
        assert!(found.notes.iter().any(|note| note.contains("spindle_speed_rpm is 1000 in every row")), "{found:?}");
    }
}
