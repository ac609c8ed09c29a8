//! What each added effect contributes, over the whole recording.

use super::axis::{Axis, time_unit};
use super::data::{Data, Fit};
use super::place::capital;
use super::plot::{Curve, Plot, thinned};
use super::text::escape;

/// Runs above which their beginnings are no longer marked, and no longer named.
const MARKED_MAX: usize = 60;
const NAMED_MAX: usize = 14;
/// Effects drawn.
const EFFECTS_MAX: usize = 6;

/// The section; empty where nothing was added.
pub(super) fn section(data: &Data<'_>) -> String {
    if !data.added() || data.rows() == 0 {
        return String::new();
    }
    let charts: String =
        data.diagnosis.rows.effects.iter().take(EFFECTS_MAX).map(|(name, values)| chart(data, name, values)).collect();
    let note = data.say(
        "In the order of the recording; pauses between runs are left out, thin lines mark the beginning of a run, shaded runs were held out.",
        "按记录顺序排列；省略运行之间的停顿，细线表示运行开始，阴影为留出的运行。",
    );
    format!(
        "<section><h2>{}</h2><p class=\"note\">{note}</p>{charts}</section>\n",
        data.say("When it acts", "何时起作用")
    )
}

fn chart(data: &Data<'_>, name: &str, values: &[f64]) -> String {
    let rows = 0..data.rows().min(values.len());
    let Some(y) = Axis::of(values.iter().copied()) else { return String::new() };
    let length = data.worked_s(rows.end.saturating_sub(1));
    let (divisor, time) = time_unit(length);
    let known = |row: usize| data.simulated(row, Fit::After).map(|_| values[row]);
    let pieces = thinned(rows, |row| data.worked_s(row) / divisor, known);
    let lane = data.diagnosis.mismatch.iter().position(|region| region.effect == name);
    let class =
        lane.filter(|lane| *lane < super::strip::REGIONS_MAX).map_or("none".to_owned(), |lane| format!("e{lane}"));
    let label = data.tongue.effect(name);
    let plot = Plot {
        x: Axis { low: 0.0, high: (length / divisor).max(f64::MIN_POSITIVE) },
        y: y.with_zero().padded(),
        x_title: format!("{} ({time})", data.say("recorded time", "记录时间")),
        y_title: format!("{} ({})", capital(&label), data.unit()),
        x_unit: time.to_owned(),
        y_unit: data.unit(),
        curves: vec![Curve { class: format!("{class} fill"), label, pieces }],
        marks: marks(data, divisor),
        bands: bands(data, divisor),
        low: true,
    };
    plot.html()
}

fn marks(data: &Data<'_>, divisor: f64) -> Vec<(f64, String)> {
    let count = data.runs.len();
    if !(2..=MARKED_MAX).contains(&count) {
        return Vec::new();
    }
    let name = |name: &str| if count <= NAMED_MAX { escape(name) } else { String::new() };
    data.runs.iter().enumerate().map(|(index, run)| (data.start_s(index) / divisor, name(&run.name))).collect()
}

fn bands(data: &Data<'_>, divisor: f64) -> Vec<(f64, f64)> {
    if data.held.len() > MARKED_MAX {
        return Vec::new();
    }
    let at = |row: usize| data.worked_s(row) / divisor;
    data.held.iter().map(|unit| (at(unit.rows.start), at(unit.rows.end - 1))).collect()
}
