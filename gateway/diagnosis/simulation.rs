//! A model over the inputs of a recording, and how far it is from what was recorded.

use recording::Recording;
use rules::twin::Model;
use rules::twin::diagnosis::find_output_unit;
use rules::twin::simulate::{FormDoubt, SimulatedRows, simulate_recording};
use rules::twin::text_report::{format_short_number, space_unit};
use serde_json::{Value, json};
use std::fmt::Write as _;

/// Half of a 95 % interval, in standard deviations.
const HALF_INTERVAL: f64 = 1.96;

/// What a model says about a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    output: String,
    name: String,
    /// Simulated output; `None` where an input is absent.
    total: Vec<Option<f64>>,
    /// Label and contribution of each part.
    parts: Vec<(String, Vec<f64>)>,
    /// Where the law of a no-load table is doubted most.
    form_doubts: Vec<(String, FormDoubt)>,
    recorded: Vec<Option<f64>>,
}

/// Runs `model` over the inputs of `recording`; the output need not be recorded.
///
/// # Errors
/// Everything the model needs and the recording lacks.
pub fn run(recording: &Recording, model: &Model, blind: bool) -> Result<Simulation, Vec<String>> {
    let SimulatedRows { total, parts, form_doubts, recorded } = simulate_recording(recording, model, blind)?;
    Ok(Simulation { output: model.output.clone(), name: model.name.clone(), total, parts, form_doubts, recorded })
}

impl Simulation {
    /// Simulated output row by row; `None` where an input is absent.
    #[must_use]
    pub fn total(&self) -> &[Option<f64>] {
        &self.total
    }

    /// Root mean square of recorded minus simulated, and over how many rows; `None` where the output is not recorded.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "numbers of rows are far below 2^53")]
    pub fn rmse(&self) -> Option<(f64, usize)> {
        let squares: Vec<f64> =
            self.recorded.iter().zip(&self.total).filter_map(|(r, s)| Some(((*r)? - (*s)?).powi(2))).collect();
        (!squares.is_empty()).then(|| ((squares.iter().sum::<f64>() / squares.len() as f64).sqrt(), squares.len()))
    }

    /// Label, mean, least and greatest contribution of each part.
    #[expect(clippy::cast_precision_loss, reason = "numbers of rows are far below 2^53")]
    fn part_summaries(&self) -> impl Iterator<Item = (&str, f64, f64, f64)> {
        self.parts.iter().map(|(label, values)| {
            let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            (label.as_str(), mean, low, values.iter().copied().fold(f64::NEG_INFINITY, f64::max))
        })
    }

    /// Lines for the reader: total, then mean and range of each part, in the unit of the output.
    #[must_use]
    pub fn format_text(&self) -> String {
        let unit = space_unit(find_output_unit(&self.output));
        let rows = self.total.iter().flatten().count();
        let mut text = format!("{}: {} simulated in {rows} of {} rows\n", self.name, self.output, self.total.len());
        for (label, mean, low, high) in self.part_summaries() {
            let _ = writeln!(
                text,
                "  {label}: mean {}, {} to {}{unit}",
                format_short_number(mean),
                format_short_number(low),
                format_short_number(high)
            );
        }
        for (label, doubt) in &self.form_doubts {
            let (power, half) = (format_short_number(doubt.power), format_short_number(HALF_INTERVAL * doubt.sd));
            let _ = writeln!(
                text,
                "  {label}: between known speeds it is in doubt, at {:.0} rpm {power} +- {half}{unit}; idle there to know it",
                doubt.speed_rpm
            );
        }
        match self.rmse() {
            Some((rmse, rows)) => {
                let _ =
                    writeln!(text, "rmse against the recording: {}{unit} over {rows} rows", format_short_number(rmse));
            }
            None => text.push_str("the output is not recorded, so there is nothing to compare it with\n"),
        }
        text
    }

    /// The document `simulation/1` for programs.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let part = |(label, mean, low, high): (&str, f64, f64, f64)| json!({ "effect": label, "mean": mean, "min": low, "max": high });
        let doubt = |(label, it): &(String, FormDoubt)| {
            let half = HALF_INTERVAL * it.sd;
            json!({ "effect": label, "speed_rpm": it.speed_rpm, "power": it.power, "uncertainty": half })
        };
        json!({
            "schema": "simulation/1",
            "model": self.name,
            "output": self.output,
            "unit": find_output_unit(&self.output),
            "rows": self.total.len(),
            "simulated_rows": self.total.iter().flatten().count(),
            "form_doubts": self.form_doubts.iter().map(doubt).collect::<Vec<_>>(),
            "parts": self.part_summaries().map(part).collect::<Vec<_>>(),
            "rmse": self.rmse().map(|(rmse, _)| rmse),
            "compared_rows": self.rmse().map_or(0, |(_, rows)| rows),
        })
    }

    /// One line per row of the recording: time, run, recorded, simulated, and each part's contribution.
    #[must_use]
    pub fn rows_csv(&self, recording: &Recording) -> String {
        let mut text = String::from("time_s,run,recorded,simulated");
        self.parts.iter().for_each(|(label, _)| text.push_str(&format!(",effect_{label}")));
        text.push('\n');
        let cell = |x: Option<f64>| x.map(|x| x.to_string()).unwrap_or_default();
        for run in recording.list_runs() {
            let name = quote_cell(&run.name);
            for row in run.rows {
                let (time_s, total) = (recording.time_s[row], self.total[row]);
                let _ = write!(text, "{time_s},{name},{},{}", cell(self.recorded[row]), cell(total));
                for (_, values) in &self.parts {
                    let _ = write!(text, ",{}", cell(total.map(|_| values[row])));
                }
                text.push('\n');
            }
        }
        text
    }
}

pub(super) fn quote_cell(text: &str) -> String {
    if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}
