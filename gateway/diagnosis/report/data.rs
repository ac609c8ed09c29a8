//! The rows behind the page: runs, what was held out, residuals, and a clock without pauses.

use super::text::{Tongue, escape_html};
use crate::context::DiagnosisContext;
use recording::{Numbers, Recording, Run};
use rules::physics::explain::Language;
use rules::twin::diagnosis::Diagnosis;
use rules::twin::hold_out::{Unit, split_into_units};
use std::ops::Range;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fit {
    /// Refitted without the missing physics.
    Before,
    /// Refitted with the missing physics.
    After,
}

/// What the page is made from.
#[derive(Debug, Clone, Copy)]
pub struct PageInput<'a> {
    /// What the page tells of; its rows are those of `recording`.
    pub diagnosis: &'a Diagnosis,
    /// The recording it was made from, with the same rows in the same order.
    pub recording: &'a Recording,
    /// What is said besides: units that are doubtful, the series that was given.
    pub context: &'a DiagnosisContext,
    /// Language of the page.
    pub language: Language,
}

/// Everything the sections read.
pub(super) struct Data<'a> {
    pub(super) input: &'a PageInput<'a>,
    pub(super) diagnosis: &'a Diagnosis,
    pub(super) tongue: Tongue,
    pub(super) runs: Vec<Run>,
    /// The held-out runs or stretches.
    pub(super) held: Vec<Unit>,
    /// Start of every run on a clock without the pauses between runs.
    starts_s: Vec<f64>,
    recorded: Option<&'a Numbers>,
}

impl<'a> Data<'a> {
    pub(super) fn new(input: &'a PageInput<'a>) -> Self {
        let diagnosis = input.diagnosis;
        let runs = input.recording.list_runs();
        let rows: Vec<Range<usize>> = runs.iter().map(|run| run.rows.clone()).collect();
        let names: Vec<String> = runs.iter().map(|run| run.name.clone()).collect();
        let held = diagnosis.fit.as_ref().map_or(&[][..], |fit| &fit.held_out_runs);
        let held = split_into_units(&rows, &names).into_iter().filter(|unit| held.contains(&unit.name)).collect();
        let starts_s = compute_run_starts(&input.recording.time_s, &rows);
        let recorded = input.recording.find_numbers(&diagnosis.output);
        Self { input, diagnosis, tongue: Tongue(input.language), runs, held, starts_s, recorded }
    }

    /// The text in the page's language.
    pub(super) fn pick_text<'t>(&self, en: &'t str, zh: &'t str) -> &'t str {
        self.tongue.pick_text(en, zh)
    }

    /// How many rows the recording has.
    pub(super) fn count_rows(&self) -> usize {
        self.input.recording.count_rows()
    }

    /// Time of the row as recorded, s; 0 beyond the last row.
    pub(super) fn time_s(&self, row: usize) -> f64 {
        self.input.recording.time_s.get(row).copied().unwrap_or(0.0)
    }

    pub(super) fn recorded_value(&self, row: usize) -> Option<f64> {
        self.recorded?.get(row)
    }

    pub(super) fn simulated_value(&self, row: usize, fit: Fit) -> Option<f64> {
        let rows = &self.diagnosis.rows;
        let values = if fit == Fit::Before { &rows.simulated_before } else { &rows.simulated_after };
        values.get(row).copied().flatten()
    }

    /// Did the row take part in the comparison?
    pub(super) fn was_compared(&self, row: usize) -> bool {
        self.diagnosis.rows.compared.get(row).copied().unwrap_or(false)
    }

    /// Recorded minus simulated, where the row took part.
    pub(super) fn residual(&self, row: usize, fit: Fit) -> Option<f64> {
        self.recorded_value(row)
            .zip(self.simulated_value(row, fit))
            .filter(|_| self.was_compared(row))
            .map(|(a, b)| a - b)
    }

    /// Root mean square error over rows; `None` where none took part.
    pub(super) fn compute_rmse(&self, rows: Range<usize>, fit: Fit) -> Option<f64> {
        let (sum, count) = rows
            .filter_map(|row| self.residual(row, fit))
            .fold((0.0, 0_u32), |(sum, count), x| (sum + x * x, count.saturating_add(1)));
        (count > 0).then(|| (sum / f64::from(count)).sqrt())
    }

    /// Was something added to the model?
    pub(super) fn has_added_effects(&self) -> bool {
        !self.diagnosis.rows.effects.is_empty()
    }

    /// Seconds of recording up to the start of a run, pauses left out.
    pub(super) fn start_s(&self, run: usize) -> f64 {
        self.starts_s.get(run).copied().unwrap_or(0.0)
    }

    /// The run of a row.
    pub(super) fn run_of(&self, row: usize) -> usize {
        self.runs.partition_point(|run| run.rows.end <= row)
    }

    /// Seconds of recording up to a row, pauses left out.
    pub(super) fn worked_s(&self, row: usize) -> f64 {
        let run = self.run_of(row);
        let first = self.runs.get(run).map_or(0, |run| run.rows.start);
        self.start_s(run) + self.time_s(row) - self.time_s(first)
    }

    /// A moment as the recording knows it: by the clock where it knows the day, else run and seconds.
    pub(super) fn format_moment(&self, run: &str, time_s: f64) -> String {
        let at = self.format_clock_time(time_s).unwrap_or_else(|| {
            let seconds = super::text::with_unit(&super::text::format_fixed(time_s, self.time_decimals()), "s");
            format!("{}{seconds}", self.pick_text("at ", ""))
        });
        format!("{}, {at}", self.unit_name(run))
    }

    /// The clock of this computer's zone; `None` where the recording does not know the day.
    pub(super) fn format_clock_time(&self, time_s: f64) -> Option<String> {
        let start_ns = self.input.recording.start_ns?;
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let at_ns = i128::from(start_ns) + (time_s * 1e9) as i128;
        let stamp = jiff::Timestamp::from_nanosecond(at_ns).ok()?.to_zoned(jiff::tz::TimeZone::system());
        Some(stamp.strftime("%Y-%m-%d %H:%M:%S").to_string())
    }

    /// Decimals that the steps of time need: none at 1 Hz, two at 200 Hz.
    pub(super) fn time_decimals(&self) -> i32 {
        let times = &self.input.recording.time_s;
        let rows = times.len().max(2);
        let step_s = (times.last().unwrap_or(&0.0) - times.first().unwrap_or(&0.0)) / (rows - 1) as f64;
        if step_s > 0.0 { (-super::text::decimal_exponent(step_s)).clamp(0, 4) } else { 0 }
    }

    /// Length of a stretch in seconds.
    pub(super) fn length_s(&self, rows: &Range<usize>) -> f64 {
        if rows.is_empty() { 0.0 } else { (self.time_s(rows.end - 1) - self.time_s(rows.start)).max(0.0) }
    }

    /// The unit of the output, escaped.
    pub(super) fn output_unit(&self) -> String {
        super::text::unit_text(&self.diagnosis.unit)
    }

    /// The name of a run or stretch in words, escaped.
    pub(super) fn unit_name(&self, name: &str) -> String {
        let Some((run, part)) = name.strip_suffix(']').and_then(|name| name.rsplit_once('[')) else {
            return format!("{} {}", self.pick_text("run", "运行"), escape_html(name));
        };
        let (run, part) = (escape_html(run), escape_html(part));
        match (self.runs.len(), self.tongue.0) {
            (1, rules::physics::explain::Language::En) => format!("stretch {part}"),
            (1, rules::physics::explain::Language::Zh) => format!("第{part}段"),
            (_, rules::physics::explain::Language::En) => format!("run {run}, stretch {part}"),
            (_, rules::physics::explain::Language::Zh) => format!("运行 {run} 第{part}段"),
        }
    }
}

fn compute_run_starts(time_s: &[f64], runs: &[Range<usize>]) -> Vec<f64> {
    let mut at = 0.0;
    let mut starts = Vec::with_capacity(runs.len());
    for run in runs {
        starts.push(at);
        let length = time_s[run.end - 1] - time_s[run.start];
        at += length.max(0.0) + length.max(0.0) / (run.len() as f64);
    }
    starts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_leaves_pauses_out_and_goes_on_where_time_restarts() {
        let time_s = [0.0, 1.0, 2.0, 0.0, 1.0, 500.0];
        assert_eq!(compute_run_starts(&time_s, &[0..3, 3..5, 5..6]), vec![0.0, 2.0 + 2.0 / 3.0, 2.0 + 2.0 / 3.0 + 1.5]);
    }
}
