//! How much better: errors before and after on runs that took no part in fitting, and the curves themselves.

use super::axis::{Axis, time_unit};
use super::data::{Data, Fit};
use super::plot::{Curve, Plot, thin_curve};
use super::text::{format_number, with_unit};
use rules::physics::explain::Language;
use rules::twin::diagnosis::Fits;
use rules::twin::hold_out::Unit;
use std::fmt::Write as _;
use std::ops::Range;

/// Held-out runs whose curves are drawn.
const CURVES_MAX: usize = 6;
/// Held-out runs listed with their errors.
const LISTED_MAX: usize = 24;

/// The section; empty where nothing was fitted.
pub(super) fn render_section(data: &Data<'_>) -> String {
    let Some(fit) = &data.diagnosis.fit else { return String::new() };
    let title = if data.has_added_effects() {
        data.pick_text("How much better", "改进多少")
    } else {
        data.pick_text("How well it fits", "吻合程度")
    };
    format!(
        "<section><h2>{title}</h2>{}{}{}</section>\n",
        render_error_bars(data, fit),
        per_run(data),
        render_curves(data)
    )
}

/// One bar of a bar chart.
struct Bar<'a> {
    class: &'a str,
    label: String,
    value: Option<f64>,
}

fn render_error_bars(data: &Data<'_>, fit: &Fits) -> String {
    let mut rows =
        vec![(data.pick_text("held-out runs", "留出的运行"), fit.before.held_out_rmse, fit.after.held_out_rmse)];
    rows.push((data.pick_text("fitted runs", "参与拟合的运行"), Some(fit.before.rmse), Some(fit.after.rmse)));
    let top = [fit.before.held_out_rmse, fit.after.held_out_rmse, Some(fit.before.rmse), Some(fit.after.rmse)];
    let top = top.into_iter().flatten().fold(fit.noise_floor, f64::max).max(f64::MIN_POSITIVE) * 1.04;
    let mut html = String::new();
    for (name, before, after) in rows {
        let mut pair =
            vec![Bar { class: "before", label: data.pick_text("before", "之前").to_owned(), value: before }];
        if data.has_added_effects() {
            pair.push(Bar { class: "after", label: data.pick_text("after", "之后").to_owned(), value: after });
        } else {
            pair[0] = Bar { class: "after", label: String::new(), value: before };
        }
        let pair: String = pair.iter().map(|bar| bar_row(data, bar, top, fit.noise_floor)).collect();
        let _ = write!(html, "<div class=\"bars\"><h4>{name}</h4>{pair}</div>");
    }
    let floor = with_unit(&format_number(fit.noise_floor), &data.output_unit());
    let note = match data.tongue.0 {
        Language::En => {
            format!("Root mean square of recorded minus simulated. The dashed line is the ordinary noise, {floor}.")
        }
        Language::Zh => format!("实测减仿真的均方根。虚线为普通噪声{floor}。"),
    };
    let before = data.pick_text(
        " \u{201c}Before\u{201d} is the simulation refitted to this recording, not its nominal parameters.",
        "“之前”指对此记录重新拟合后的仿真，而非名义参数。",
    );
    let before = if data.has_added_effects() { before } else { "" };
    format!("<div class=\"pairs\">{html}</div><p class=\"note\">{note}{before}</p>")
}

fn bar_row(data: &Data<'_>, bar: &Bar<'_>, top: f64, floor: f64) -> String {
    let Some(value) = bar.value else {
        let none = data.pick_text("no figure: too few runs to hold one out", "无数值：运行次数太少，无法留出");
        return format!("<div class=\"bar\"><span>{}</span><p class=\"note\">{none}</p></div>", bar.label);
    };
    format!(
        "<div class=\"bar\"><span>{}</span><div class=\"track\"><i class=\"{}\" style=\"width:{:.2}%\"></i><b style=\"left:{:.2}%\"></b></div><span class=\"v\">{}</span></div>",
        bar.label,
        bar.class,
        100.0 * value / top,
        100.0 * floor / top,
        with_unit(&format_number(value), &data.output_unit())
    )
}

/// A held-out run with its errors.
struct Held<'a> {
    unit: &'a Unit,
    before: f64,
    after: f64,
}

fn collect_held_out<'a>(data: &'a Data<'_>) -> Vec<Held<'a>> {
    let errors = |unit: &'a Unit| {
        let before = data.compute_rmse(unit.rows.clone(), Fit::Before)?;
        Some(Held { unit, before, after: data.compute_rmse(unit.rows.clone(), Fit::After)? })
    };
    data.held.iter().filter_map(errors).collect()
}

/// So many of the runs, evenly spread from the least to the greatest improvement, in the order of the recording.
fn select_spread_runs<'a>(mut held: Vec<Held<'a>>, wanted: usize) -> Vec<Held<'a>> {
    if held.len() > wanted {
        held.sort_by(|a, b| (a.before - a.after).total_cmp(&(b.before - b.after)));
        let last = held.len() - 1;
        let chosen: Vec<usize> = (0..wanted).map(|k| k * last / (wanted - 1).max(1)).collect();
        let mut index = 0;
        held.retain(|_| {
            index += 1;
            chosen.contains(&(index - 1))
        });
        held.sort_by_key(|held| held.unit.rows.start);
    }
    held
}

/// Every held-out run as a line from its error before to its error after.
fn per_run(data: &Data<'_>) -> String {
    let all = collect_held_out(data);
    let (count, floor) = (all.len(), data.diagnosis.fit.as_ref().map_or(0.0, |fit| fit.noise_floor));
    if count < 2 || !data.has_added_effects() {
        return String::new();
    }
    let listed = select_spread_runs(all, LISTED_MAX);
    let top = listed.iter().fold(floor, |top, held| top.max(held.before).max(held.after)).max(f64::MIN_POSITIVE) * 1.04;
    let mut html: String = listed.iter().map(|held| render_dumbbell(data, held, top, floor)).collect();
    if count > LISTED_MAX {
        let note = match data.tongue.0 {
            Language::En => {
                format!("{LISTED_MAX} of {count} held-out runs, spread evenly from the least to the most improved.")
            }
            Language::Zh => format!("{count}次留出运行中的{LISTED_MAX}次，按改进程度均匀选取。"),
        };
        let _ = write!(html, "<p class=\"note\">{note}</p>");
    }
    format!(
        "<h3>{}</h3><div class=\"dumbbells\">{html}</div>{}",
        data.pick_text("Every held-out run", "每次留出的运行"),
        render_legend(data, false)
    )
}

fn render_dumbbell(data: &Data<'_>, held: &Held<'_>, top: f64, floor: f64) -> String {
    let at = |x: f64| 100.0 * x / top;
    let (low, high) = (held.before.min(held.after), held.before.max(held.after));
    format!(
        "<div class=\"bar\"><span>{}</span><div class=\"track thin\"><b style=\"left:{:.2}%\"></b><u style=\"left:{:.2}%;width:{:.2}%\"></u><i class=\"dot before\" style=\"left:{:.2}%\"></i><i class=\"dot after\" style=\"left:{:.2}%\"></i></div><span class=\"v\">{} → {}</span></div>",
        data.unit_name(&held.unit.name),
        at(floor),
        at(low),
        at(high - low),
        at(held.before),
        at(held.after),
        format_number(held.before),
        with_unit(&format_number(held.after), &data.output_unit())
    )
}

fn render_legend(data: &Data<'_>, recorded: bool) -> String {
    let mut html = String::new();
    if recorded {
        let _ = write!(html, "<span><i class=\"key rec\"></i>{}</span>", data.pick_text("recorded", "实测"));
    }
    let (before, after) = match data.has_added_effects() {
        true => {
            (data.pick_text("simulated before", "之前的仿真"), Some(data.pick_text("simulated after", "之后的仿真")))
        }
        false => (data.pick_text("simulated", "仿真"), None),
    };
    let class = if after.is_some() { "before" } else { "after" };
    let _ = write!(html, "<span><i class=\"key {class}\"></i>{before}</span>");
    if let Some(after) = after {
        let _ = write!(html, "<span><i class=\"key after\"></i>{after}</span>");
    }
    format!("<p class=\"legend\">{html}</p>")
}

/// Recorded, before and after over time, one chart per held-out run, chosen by a tab.
fn render_curves(data: &Data<'_>) -> String {
    let all = collect_held_out(data);
    let count = all.len();
    let drawn = select_spread_runs(all, CURVES_MAX);
    if drawn.is_empty() {
        return String::new();
    }
    let best = (0..drawn.len()).max_by(|a, b| {
        let gain = |k: usize| drawn[k].before - drawn[k].after;
        gain(*a).total_cmp(&gain(*b)).then(b.cmp(a))
    });
    let mut html =
        format!("<h3>{}</h3>", data.pick_text("Recorded and simulated, on held-out runs", "留出运行上的实测与仿真"));
    if count > drawn.len() {
        let note = data.pick_text(
            "The least improved, the most improved, and runs between.",
            "包括改进最小、最大以及介于其间的运行。",
        );
        let _ = write!(html, "<p class=\"note\">{note}</p>");
    }
    html.push_str("<div class=\"tabs\">");
    for (index, held) in drawn.iter().enumerate() {
        let checked = if Some(index) == best { " checked" } else { "" };
        let name = data.unit_name(&held.unit.name);
        let _ = write!(
            html,
            "<input type=\"radio\" name=\"run\" id=\"run{index}\"{checked}><label for=\"run{index}\">{name}</label>"
        );
    }
    for held in &drawn {
        let _ = write!(
            html,
            "<div class=\"tab\"><h4>{}: {}</h4>{}</div>",
            data.unit_name(&held.unit.name),
            format_errors(data, held),
            render_run_charts(data, held)
        );
    }
    format!("{html}</div>{}", render_legend(data, true))
}

fn format_errors(data: &Data<'_>, held: &Held<'_>) -> String {
    let after = with_unit(&format_number(held.after), &data.output_unit());
    match data.has_added_effects() {
        true => format!("{} {} → {after}", data.pick_text("error", "误差"), format_number(held.before)),
        false => format!("{} {after}", data.pick_text("error", "误差")),
    }
}

/// The curves, and below them what remains of them.
fn render_run_charts(data: &Data<'_>, held: &Held<'_>) -> String {
    let rows = held.unit.rows.clone();
    let start = data.time_s(rows.start);
    let (divisor, time) = time_unit(data.length_s(&rows));
    let x = |row: usize| (data.time_s(row) - start) / divisor;
    let drawn = |class: &str, label: &str, y: &dyn Fn(usize) -> Option<f64>| Curve {
        class: class.to_owned(),
        label: label.to_owned(),
        pieces: thin_curve(rows.clone(), x, y),
    };
    let (before, after) = (data.pick_text("before", "之前"), data.pick_text("after", "之后"));
    let (class, before) =
        if data.has_added_effects() { ("before", before) } else { ("after", data.pick_text("simulated", "仿真")) };
    let mut values = vec![
        drawn("rec", data.pick_text("recorded", "实测"), &|row| data.recorded_value(row)),
        drawn(class, before, &|row| data.simulated_value(row, Fit::Before)),
    ];
    let mut rest = vec![drawn(class, before, &|row| data.residual(row, Fit::Before))];
    if data.has_added_effects() {
        values.push(drawn("after", after, &|row| data.simulated_value(row, Fit::After)));
        rest.push(drawn("after", after, &|row| data.residual(row, Fit::After)));
    }
    let Some(across) = Axis::from_values([x(rows.start), x(rows.end - 1)].into_iter()) else { return String::new() };
    let output = data.tongue.name_column_with_unit(&data.diagnosis.output);
    let difference = format!("{} ({})", data.pick_text("recorded minus simulated", "实测减仿真"), data.output_unit());
    let plot = |curves: Vec<Curve>, y: Option<Axis>, y_title: String, low: bool| {
        let y = y.map(Axis::with_margin)?;
        let x_title = format!("{} ({time})", data.pick_text("time", "时间"));
        let (x, x_unit, y_unit) = (across.clone(), time.to_owned(), data.output_unit());
        Some(
            Plot { x, y, x_title, y_title, x_unit, y_unit, curves, marks: Vec::new(), bands: Vec::new(), low }
                .render_html(),
        )
    };
    let upper = plot(values, find_value_range(data, &rows), output, false);
    let lower = plot(rest, rest_span(data, &rows), difference, true);
    upper.into_iter().chain(lower).collect()
}

/// Range of recorded and simulated values. Spikes that took no part in the comparison may leave the frame.
fn find_value_range(data: &Data<'_>, rows: &Range<usize>) -> Option<Axis> {
    let recorded = |row: usize| data.was_compared(row).then(|| data.recorded_value(row)).flatten();
    let all =
        |row: usize| [recorded(row), data.simulated_value(row, Fit::Before), data.simulated_value(row, Fit::After)];
    Axis::from_values(rows.clone().flat_map(all).flatten())
}

/// Range of what remains.
fn rest_span(data: &Data<'_>, rows: &Range<usize>) -> Option<Axis> {
    let all = |row: usize| [data.residual(row, Fit::Before), data.residual(row, Fit::After)];
    Axis::from_values(rows.clone().flat_map(all).flatten()).map(Axis::with_zero)
}
