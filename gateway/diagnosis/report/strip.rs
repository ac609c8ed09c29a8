//! A strip of runs with the affected stretches coloured and the onset marked.

use super::data::Data;
use super::text::{escape_html, format_fixed};
use rules::twin::region::{OnsetInterval, Region, Span};
use std::fmt::Write as _;

/// Runs above which every run becomes one tile.
const LANES_MAX: usize = 40;
/// Tiles at most; neighbouring runs share one beyond that.
const TILES_MAX: usize = 400;
/// Columns over all lanes at most.
const COLUMNS_MAX: usize = 6000;
/// Only the first regions are drawn, so many of them.
pub(super) const REGIONS_MAX: usize = 4;
/// Steps of colour strength.
const STEPS: usize = 4;

/// The strip of every region; empty where nothing is located.
pub(super) fn render_strip(data: &Data<'_>) -> String {
    let regions: Vec<&Region> = data.diagnosis.mismatch.iter().take(REGIONS_MAX).collect();
    if regions.is_empty() || data.runs.is_empty() {
        return String::new();
    }
    let coverage: Vec<Vec<Vec<f64>>> = regions.iter().map(|region| compute_coverage(data, region)).collect();
    let body = if data.runs.len() > LANES_MAX {
        render_tiles(data, &coverage)
    } else {
        render_lanes(data, &regions, &coverage)
    };
    format!("<div class=\"strip\">{body}</div>{}", render_legend(data))
}

fn count_lane_columns(data: &Data<'_>) -> usize {
    if data.runs.len() > LANES_MAX { 1 } else { (COLUMNS_MAX / data.runs.len()).clamp(20, 600) }
}

fn longest_s(data: &Data<'_>) -> f64 {
    data.runs.iter().map(|run| data.length_s(&run.rows)).fold(f64::MIN_POSITIVE, f64::max)
}

/// Per run and column of its lane the share of time that is affected. Spans stand in the order of the runs.
fn compute_coverage(data: &Data<'_>, region: &Region) -> Vec<Vec<f64>> {
    let wide = count_lane_columns(data);
    let tiled = data.runs.len() > LANES_MAX;
    let longest = longest_s(data);
    let mut lanes = vec![vec![0.0; wide]; data.runs.len()];
    let mut run = 0;
    for span in &region.spans {
        while run < data.runs.len() && !contains_span(data, run, span) {
            run += 1;
        }
        let Some(here) = data.runs.get(run) else { break };
        let length = data.length_s(&here.rows);
        let row_s = length / (here.rows.len().max(2) - 1) as f64;
        let scale = wide as f64 / if tiled { length.max(f64::MIN_POSITIVE) } else { longest };
        let from = (span.from_s - data.time_s(here.rows.start) - 0.5 * row_s).max(0.0) * scale;
        let to = (span.to_s - data.time_s(here.rows.start) + 0.5 * row_s).min(length) * scale;
        add_coverage(&mut lanes[run], from, to);
    }
    lanes
}

fn contains_span(data: &Data<'_>, run: usize, span: &Span) -> bool {
    let run = &data.runs[run];
    run.name == span.run && span.from_s <= data.time_s(run.rows.end - 1) && span.from_s >= data.time_s(run.rows.start)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the lane")]
fn add_coverage(lane: &mut [f64], from: f64, to: f64) {
    let first = from.floor().max(0.0) as usize;
    let last = (to.ceil().max(0.0) as usize).min(lane.len());
    for (column, share) in lane.iter_mut().enumerate().take(last).skip(first) {
        let at = column as f64;
        *share += (to.min(at + 1.0) - from.max(at)).max(0.0);
    }
}

/// Strength of the colour for a share: none, or one to [`STEPS`].
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and STEPS")]
fn to_colour_strength(share: f64) -> usize {
    if share < 0.02 { 0 } else { (share * STEPS as f64).ceil().clamp(1.0, STEPS as f64) as usize }
}

fn render_lanes(data: &Data<'_>, regions: &[&Region], coverage: &[Vec<Vec<f64>>]) -> String {
    let wide = count_lane_columns(data);
    let high = regions.len();
    let mut html = String::new();
    for (index, run) in data.runs.iter().enumerate() {
        let end = wide as f64 * data.length_s(&run.rows) / longest_s(data);
        let held = if data.held.iter().any(|unit| unit.rows == run.rows) { " class=\"held\"" } else { "" };
        let _ = write!(
            html,
            "<div class=\"lane\"><span{held}>{}</span><div class=\"row\" style=\"--n:{high}\"><svg viewBox=\"0 0 {wide} {high}\" preserveAspectRatio=\"none\"><rect class=\"base\" width=\"{:.1}\" height=\"{high}\"/>",
            escape_html(&run.name),
            end.max(1.0)
        );
        for (lane, region) in coverage.iter().enumerate() {
            html.push_str(&render_lane_paths(&region[index], lane));
        }
        html.push_str("</svg>");
        for region in regions {
            if let Some(onset) = region.onset.as_ref().filter(|onset| onset.run == run.name) {
                html.push_str(&onset_mark(data, index, onset));
            }
        }
        html.push_str("</div></div>");
    }
    html + render_time_axis(data).as_str()
}

/// One path per strength.
fn render_lane_paths(columns: &[f64], lane: usize) -> String {
    let mut html = String::new();
    for step in 1..=STEPS {
        let mut line = String::new();
        let mut column = 0;
        while column < columns.len() {
            let same = columns[column..].iter().take_while(|share| to_colour_strength(**share) == step).count();
            if same > 0 {
                let _ = write!(line, "M{column} {lane}.08h{same}v.84h-{same}z");
            }
            column += same.max(1);
        }
        if !line.is_empty() {
            let _ = write!(html, "<path class=\"e{lane} s{step}\" d=\"{line}\"/>");
        }
    }
    html
}

fn onset_mark(data: &Data<'_>, run: usize, onset: &OnsetInterval) -> String {
    let start = data.time_s(data.runs[run].rows.start);
    let share = |time_s: f64| 100.0 * ((time_s - start) / longest_s(data)).clamp(0.0, 1.0);
    let (low, high) = (share(onset.low_s), share(onset.high_s));
    format!(
        "<b class=\"between\" style=\"left:{low:.2}%;width:{:.2}%\"></b><b class=\"onset\" style=\"left:{:.2}%\"></b>",
        high - low,
        share(onset.time_s)
    )
}

fn render_time_axis(data: &Data<'_>) -> String {
    let (divisor, unit) = super::axis::time_unit(longest_s(data));
    let axis = super::axis::Axis { low: 0.0, high: longest_s(data) / divisor };
    let label =
        |(x, text): (f64, String)| format!("<span style=\"left:{:.1}%\">{text}</span>", 100.0 * axis.to_fraction(x));
    let labels: String = axis.compute_ticks(5.0).into_iter().map(label).collect();
    let title = data.pick_text("time since the start of the run", "运行开始后的时间");
    format!(
        "<div class=\"lane\"><span></span><div class=\"xl\">{labels}</div></div><div class=\"xtitle\">{title} ({unit})</div>"
    )
}

/// Runs as tiles, coloured by the affected share of their time.
fn render_tiles(data: &Data<'_>, coverage: &[Vec<Vec<f64>>]) -> String {
    let group = data.runs.len().div_ceil(TILES_MAX);
    let mut html = String::new();
    for (lane, region) in coverage.iter().enumerate() {
        html.push_str("<div class=\"mosaic\">");
        for (index, runs) in region.chunks(group).enumerate() {
            let share = runs.iter().map(|run| run[0]).sum::<f64>() / runs.len() as f64;
            let first = &data.runs[index * group].name;
            let last = &data.runs[index * group + runs.len() - 1].name;
            let names = if runs.len() == 1 {
                escape_html(first)
            } else {
                format!("{}…{}", escape_html(first), escape_html(last))
            };
            let share_text = format_fixed(100.0 * share.min(1.0), 0);
            let _ = write!(
                html,
                "<i class=\"e{lane} s{}\" title=\"{names}: {share_text} %\"></i>",
                to_colour_strength(share)
            );
        }
        html.push_str("</div>");
    }
    let note = data.pick_text(
        "One tile per run, in order; the darker, the more of the run is affected.",
        "每格一个运行，按顺序排列；颜色越深，受影响的时间越多。",
    );
    format!("{html}<p class=\"note\">{note}</p>")
}

fn render_legend(data: &Data<'_>) -> String {
    let regions = data.diagnosis.mismatch.iter().take(REGIONS_MAX).enumerate();
    let mut html: String = regions
        .map(|(lane, region)| {
            format!("<span><i class=\"e{lane} s{STEPS}\"></i>{}</span>", data.tongue.name_effect(&region.effect))
        })
        .collect();
    if data.diagnosis.mismatch.iter().any(|region| region.onset.is_some()) {
        let _ = write!(
            html,
            "<span><i class=\"onset\"></i>{}</span>",
            data.pick_text("onset, with its 95 % interval shaded", "起始时刻，阴影为95 %区间")
        );
    }
    let whole =
        data.runs.len() <= LANES_MAX && data.held.iter().any(|unit| data.runs.iter().any(|run| run.rows == unit.rows));
    if whole {
        let _ = write!(
            html,
            "<span><em class=\"held\"></em>{}</span>",
            data.pick_text("held out of the fit", "留出、未参与拟合")
        );
    }
    format!("<p class=\"legend\">{html}</p>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_covers_its_columns_in_part() {
        let mut lane = vec![0.0; 4];
        add_coverage(&mut lane, 0.5, 2.25);
        assert_eq!(lane, vec![0.5, 1.0, 0.25, 0.0]);
        add_coverage(&mut lane, 3.9, 9.0);
        assert!((lane[3] - 0.1).abs() < 1e-12);
        assert_eq!([0.0, 0.01, 0.1, 0.5, 1.2].map(to_colour_strength), [0, 0, 1, 2, 4]);
    }
}
