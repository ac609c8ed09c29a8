//! The model as it was given, over the recording as it is and under each unit that one of its columns might be in. Where the model misses the output by
//! half of it, and one unit makes it fit, that unit is asked for.

use super::{UnitDoubt, list_possible_units};
use crate::simulation;
use adapter_core::channel::quantity::unit_of;
use recording::Recording;
use recording::{Cells, Numbers};
use rules::twin::text_report::format_short_number;
use rules::twin::{Model, PartFunction};

/// Error over the size of the output from which a model is asked whether a unit is wrong,
const POOR: f64 = 0.4;
/// below which another unit makes it fit,
const GOOD: f64 = 0.3;
/// and by how much it must lower the error.
const BETTER: f64 = 0.35;
/// Units whose errors differ by less than this are told together: a batch of material changes a cut by as much.
const ALIKE: f64 = 0.05;
/// So many are told at most.
const TOLD_MAX: usize = 3;
/// Rows that are simulated; a long recording is thinned.
const ROWS_MAX: usize = 4000;
/// Columns that inputs follow from, so that they count as inputs too.
const INPUTS: [&str; 13] = [
    "spindle_speed_rpm",
    "feed_mm_min",
    "feed_per_rev_mm",
    "depth_of_cut_mm",
    "width_of_cut_mm",
    "diameter_mm",
    "removal_rate_cm3_min",
    "cutting_speed_m_min",
    "axis_velocity_mm_min",
    "axis_position_mm",
    "velocity_m_s",
    "acceleration_m_s2",
    "supply_voltage_v",
];

pub(super) fn find_doubts(recording: &Recording, model: &Model) -> Vec<UnitDoubt> {
    // Coefficients of columns that the user chose mean what the user says.
    let is_physical =
        model.parts.iter().any(|part| matches!(part.body, PartFunction::Effect(..) | PartFunction::Table(_)));
    let thin = thin_rows(recording);
    let Some(given) = relative_error(&thin, model).filter(|_| is_physical) else { return Vec::new() };
    if given < POOR {
        return Vec::new();
    }
    let mut found: Vec<UnitHypothesis> = Vec::new();
    let columns =
        INPUTS.iter().copied().filter(|name| thin.find_numbers(name).is_some()).chain([model.output.as_str()]);
    for column in columns {
        for (unit, factor) in list_possible_units(column) {
            let Some(under) = relative_error(&scale_column(&thin, column, factor), model) else { continue };
            if under < GOOD && under < BETTER * given {
                found.push(UnitHypothesis { error: under, column: column.to_owned(), unit, factor });
            }
        }
    }
    found.sort_by(|a, b| a.error.total_cmp(&b.error));
    let Some(limit) = found.first().map(|best| best.error + ALIKE) else { return Vec::new() };
    found.retain(|hypothesis| hypothesis.error <= limit);
    found.truncate(TOLD_MAX);
    vec![describe_doubt(&model.output, given, &found)]
}

/// A column taken to be in another unit.
struct UnitHypothesis {
    /// Error of the model then, over the size of the output.
    error: f64,
    column: String,
    unit: &'static str,
    /// Turns the numbers into those of the unit that the column's name says.
    factor: f64,
}

fn describe_doubt(output: &str, given: f64, found: &[UnitHypothesis]) -> UnitDoubt {
    let (mut en, mut zh, mut ask_en, mut ask_zh) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for UnitHypothesis { error, column, unit, factor } in found {
        let (after, factor, own) =
            (format_short_number(100.0 * error), format_short_number(*factor), unit_of(column).unwrap_or(""));
        en.push(format!("with {column} taken as {unit} ({factor} times as many {own}) it misses by {after} %"));
        zh.push(format!("若{column}以{unit}为单位（换算为{own}乘以{factor}），误差为{after} %"));
        ask_en.push(format!("{column} in {unit}"));
        ask_zh.push(format!("{column}以{unit}为单位"));
    }
    let before = format_short_number(100.0 * given);
    UnitDoubt::new(
        &found[0].column,
        format!("the model as given misses {output} by {before} %; {}: is {}?", en.join(", "), ask_en.join(", or ")),
        format!("按给定模型，{output}的误差为{before} %；{}：是否{}？", zh.join("，"), ask_zh.join("，或")),
    )
}

/// Error of the model as given over the size of the output, its root mean square.
fn relative_error(recording: &Recording, model: &Model) -> Option<f64> {
    let simulation = simulation::run(recording, model, false).ok()?;
    let (rmse, _) = simulation.rmse()?;
    let numbers = recording.find_numbers(&model.output)?;
    let (sum, count) = numbers.present_values().fold((0.0, 0.0), |(sum, count), x| (sum + x * x, count + 1.0));
    let size = (sum / f64::max(count, 1.0)).sqrt();
    (size > 0.0 && rmse.is_finite()).then(|| rmse / size)
}

fn thin_rows(recording: &Recording) -> Recording {
    let every = recording.count_rows().div_ceil(ROWS_MAX).max(1);
    if every == 1 {
        return recording.clone();
    }
    let kept: Vec<bool> = (0..recording.count_rows()).map(|row| row.is_multiple_of(every)).collect();
    recording.select_rows(&kept)
}

fn scale_column(recording: &Recording, column: &str, factor: f64) -> Recording {
    let mut other = recording.clone();
    let cells = recording
        .find_numbers(column)
        .map(|numbers| numbers.iter().map(|x| x.map(|x| x * factor)).collect::<Numbers>());
    if let Some(cells) = cells {
        other.set_column(column, Cells::Numbers(cells));
    }
    other
}
