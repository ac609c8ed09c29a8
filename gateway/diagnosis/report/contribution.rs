//! What each added effect contributes, over the whole recording.

use super::axis::{Axis, time_unit};
use super::data::{Data, Fit};
use super::plot::{Curve, Plot, thin_curve};
use super::text::capitalise_first;
use super::text::escape_html;

/// Runs above which their beginnings are no longer marked, and no longer named.
const MARKED_MAX: usize = 60;
const NAMED_MAX: usize = 14;
/// Only the first effects have a chart, so many of them.
const EFFECTS_MAX: usize = 6;

/// The section; empty where nothing was added.
pub(super) fn render_section(data: &Data<'_>) -> String {
    if !data.has_added_effects() || data.count_rows() == 0 {
        return String::new();
    }
    let charts: String = data
        .diagnosis
        .rows
        .effects
        .iter()
        .take(EFFECTS_MAX)
        .map(|(name, values)| render_chart(data, name, values))
        .collect();
    let note = data.pick_text(
        "In the order of the recording; pauses between runs are left out, thin lines mark the beginning of a run, shaded runs were held out.",
        "按记录顺序排列；省略运行之间的停顿，细线表示运行开始，阴影为留出的运行。",
    );
    format!(
        "<section><h2>{}</h2><p class=\"note\">{note}</p>{charts}</section>\n",
        data.pick_text("When it acts", "何时起作用")
    )
}

fn render_chart(data: &Data<'_>, name: &str, values: &[f64]) -> String {
    let rows = 0..data.count_rows().min(values.len());
    let Some(y) = Axis::from_values(values.iter().copied()) else { return String::new() };
    let length = data.worked_s(rows.end.saturating_sub(1));
    let (divisor, time) = time_unit(length);
    let known = |row: usize| data.simulated_value(row, Fit::After).map(|_| values[row]);
    let pieces = thin_curve(rows, |row| data.worked_s(row) / divisor, known);
    let lane = data.diagnosis.mismatch.iter().position(|region| region.effect == name);
    let class =
        lane.filter(|lane| *lane < super::strip::REGIONS_MAX).map_or("none".to_owned(), |lane| format!("e{lane}"));
    let label = data.tongue.name_effect(name);
    let plot = Plot {
        x: Axis { low: 0.0, high: (length / divisor).max(f64::MIN_POSITIVE) },
        y: y.with_zero().with_margin(),
        x_title: format!("{} ({time})", data.pick_text("recorded time", "记录时间")),
        y_title: format!("{} ({})", capitalise_first(&label), data.output_unit()),
        x_unit: time.to_owned(),
        y_unit: data.output_unit(),
        curves: vec![Curve { class: format!("{class} fill"), label, pieces }],
        marks: list_run_starts(data, divisor),
        bands: list_held_out_bands(data, divisor),
        low: true,
    };
    plot.render_html()
}

fn list_run_starts(data: &Data<'_>, divisor: f64) -> Vec<(f64, String)> {
    let count = data.runs.len();
    if !(2..=MARKED_MAX).contains(&count) {
        return Vec::new();
    }
    let name = |name: &str| if count <= NAMED_MAX { escape_html(name) } else { String::new() };
    data.runs.iter().enumerate().map(|(index, run)| (data.start_s(index) / divisor, name(&run.name))).collect()
}

fn list_held_out_bands(data: &Data<'_>, divisor: f64) -> Vec<(f64, f64)> {
    if data.held.len() > MARKED_MAX {
        return Vec::new();
    }
    let at = |row: usize| data.worked_s(row) / divisor;
    data.held.iter().map(|unit| (at(unit.rows.start), at(unit.rows.end - 1))).collect()
}
