//! The diagnosis as JSON (`diagnosis/1`) and as rows.

use super::diagnosis::{
    Alternative, Diagnosis, Existence, Experiment, Fits, Missing, ParameterEstimate, Quality, Rows, Shift,
};
use super::region::{Condition, OnsetInterval, Region, Span};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;

/// Significant digits of a printed number.
const DIGITS: usize = 6;

/// A finite number with six significant digits, so that the text does not depend on the last bits.
fn encode_number(x: f64) -> Value {
    if !x.is_finite() {
        return Value::Null;
    }
    let rounded: f64 = format!("{x:.*e}", DIGITS - 1).parse().unwrap_or(x);
    json!(rounded)
}

fn encode_optional(x: Option<f64>) -> Value {
    x.map_or(Value::Null, encode_number)
}

/// The diagnosis as JSON, numbers with six significant digits.
#[must_use]
pub fn to_json(diagnosis: &Diagnosis) -> Value {
    let faults = diagnosis.data_quality.iter();
    json!({
        "schema": "diagnosis/1",
        "output": diagnosis.output,
        "unit": diagnosis.unit,
        "verdict": diagnosis.verdict.as_word(),
        "summary": diagnosis.summary.en,
        "existence": diagnosis.existence.as_ref().map_or(Value::Null, encode_existence),
        "fit": diagnosis.fit.as_ref().map_or(Value::Null, encode_fits),
        "mismatch": diagnosis.mismatch.iter().map(encode_region).collect::<Vec<_>>(),
        "missing": diagnosis.missing.iter().map(encode_missing).collect::<Vec<_>>(),
        "alternatives": diagnosis.alternatives.iter().map(encode_alternative).collect::<Vec<_>>(),
        "baseline_shift": diagnosis.baseline_shift.iter().map(encode_shift).collect::<Vec<_>>(),
        "data_quality": faults.map(|f| json!({ "fault": f.kind.as_word(), "column": f.column, "rows": f.rows })).collect::<Vec<_>>(),
        "remainder": diagnosis.remainder.iter().map(|left| left.en.as_str()).collect::<Vec<_>>(),
        "next_experiment": diagnosis.next_experiment.as_ref().map_or(Value::Null, encode_experiment),
    })
}

fn encode_existence(existence: &Existence) -> Value {
    json!({
        "probability_of_nothing": encode_number(existence.probability_of_nothing),
        "effective_rows": encode_number(existence.effective_rows),
        "false_alarm_rate": encode_number(existence.false_alarm_rate),
    })
}

fn encode_fits(fits: &Fits) -> Value {
    let quality =
        |q: &Quality| json!({ "rmse": encode_number(q.rmse), "held_out_rmse": encode_optional(q.held_out_rmse) });
    json!({
        "rows": fits.rows,
        "runs": fits.runs,
        "held_out_runs": fits.held_out_runs,
        "noise_floor": encode_number(fits.noise_floor),
        "before": quality(&fits.before),
        "after": quality(&fits.after),
    })
}

fn encode_region(region: &Region) -> Value {
    let mut object = Map::new();
    object.insert("share".to_owned(), encode_number(region.share));
    object.insert("mean".to_owned(), encode_number(region.mean));
    object.insert("conditions".to_owned(), region.conditions.iter().map(encode_condition).collect());
    object.insert("spans".to_owned(), region.spans.iter().map(encode_span).collect());
    if let Some(onset) = &region.onset {
        object.insert("onset".to_owned(), encode_onset(onset));
    }
    Value::Object(object)
}

fn encode_condition(condition: &Condition) -> Value {
    match condition {
        Condition::Range { column, min, max } => {
            json!({ "column": column, "min": encode_optional(*min), "max": encode_optional(*max) })
        }
        Condition::Equals { column, words } => json!({ "column": column, "equals": words }),
    }
}

fn encode_span(span: &Span) -> Value {
    json!({ "run": span.run, "from_s": span.from_s, "to_s": span.to_s })
}

fn encode_onset(onset: &OnsetInterval) -> Value {
    json!({ "run": onset.run, "time_s": onset.time_s, "low_s": onset.low_s, "high_s": onset.high_s })
}

fn encode_missing(missing: &Missing) -> Value {
    json!({
        "effect": missing.effect,
        "statement": missing.statement,
        "equation": missing.equation,
        "parameters": missing.parameters.iter().map(encode_estimate).collect::<Vec<_>>(),
        "delta_ic": encode_number(missing.delta_ic),
        "p_value": encode_number(missing.p_value),
        "held_out_rmse_before": encode_optional(missing.held_out_rmse_before),
        "held_out_rmse_after": encode_optional(missing.held_out_rmse_after),
        "absorbed_share": encode_number(missing.absorbed_share),
    })
}

fn encode_estimate(e: &ParameterEstimate) -> Value {
    json!({ "name": e.name, "value": encode_number(e.value), "low": encode_number(e.low), "high": encode_number(e.high), "unit": e.unit })
}

fn encode_alternative(other: &Alternative) -> Value {
    json!({
        "effect": other.effect,
        "instead_of": other.instead_of,
        "delta_ic": encode_number(other.delta_ic),
        "separating_experiment": other.separating_experiment,
    })
}

fn encode_shift(shift: &Shift) -> Value {
    json!({ "parameter": shift.parameter, "before": encode_number(shift.before), "after": encode_number(shift.after) })
}

fn encode_experiment(experiment: &Experiment) -> Value {
    json!({
        "statement": experiment.statement,
        "statement_zh": experiment.statement_zh,
        "minutes": encode_number(experiment.minutes),
        "expected_delta_ic": encode_number(experiment.expected_delta_ic),
        "effect": experiment.effect,
    })
}

/// The rows as CSV: time, run, recorded, simulated before and after, contribution of each added effect.
#[must_use]
pub fn format_rows_csv(scene_time_s: &[f64], runs: &[String], recorded: &[Option<f64>], rows: &Rows) -> String {
    let mut text = String::from("time_s,run,recorded,simulated_before,simulated_after");
    for (kind, _) in &rows.effects {
        let _ = write!(text, ",effect_{kind}");
    }
    text.push('\n');
    let cell = |x: Option<f64>| x.map(|x| encode_number(x).to_string()).unwrap_or_default();
    for (row, time_s) in scene_time_s.iter().enumerate() {
        let at = |values: &[Option<f64>]| cell(values.get(row).copied().flatten());
        let run = runs.get(row).map_or("", String::as_str);
        let _ = write!(text, "{time_s},{},{}", quote_cell(run), at(recorded));
        let _ = write!(text, ",{},{}", at(&rows.simulated_before), at(&rows.simulated_after));
        let known = rows.simulated_after.get(row).copied().flatten().is_some();
        for (_, values) in &rows.effects {
            let _ = write!(text, ",{}", cell(values.get(row).copied().filter(|_| known)));
        }
        text.push('\n');
    }
    text
}

fn quote_cell(text: &str) -> String {
    if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}
