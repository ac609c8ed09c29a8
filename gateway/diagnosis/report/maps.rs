//! Residual maps: the mean of recorded minus simulated over the two inputs that tell most, before and after.

use super::bins::{BinCell, Binned, compute_explained_share, list_axis_columns, sample_rows};
use super::data::{Data, Fit};
use super::text::{format_fixed, format_number, format_signed, with_unit};
use rules::physics::explain::Language;
use std::fmt::Write as _;

/// Bins of a map along each axis.
const BINS: usize = 10;
/// Columns whose pairs are tried.
const TRIED_MAX: usize = 7;
/// Rows below which a cell is left empty.
const ROWS_MIN: u32 = 3;
/// Weight of an axis that is only the order of rows.
const ORDER_WEIGHT: f64 = 0.6;
/// Weight of an axis by which the region is described.
const DESCRIBING_WEIGHT: f64 = 1.5;
/// Steps of colour on each side of zero.
const STEPS: f64 = 4.0;

pub(super) fn render_section(data: &Data<'_>) -> String {
    if data.diagnosis.fit.is_none() {
        return String::new();
    }
    let title = data.pick_text("Where in operating space", "在工况空间中的位置");
    let Some((across, up)) = most_telling(data) else {
        let none = data.pick_text(
            "No map: the recording has fewer than two inputs that vary.",
            "无图：记录中变化的输入少于两个。",
        );
        return format!("<section><h2>{title}</h2><p class=\"note\">{none}</p></section>\n");
    };
    let before = bin_residuals(data, &across, &up, Fit::Before);
    let top = before.iter().filter(|cell| cell.rows >= ROWS_MIN).fold(0.0_f64, |top, cell| top.max(cell.mean().abs()));
    let mut maps = map(data, (&across, &up), &before, top, data.has_added_effects().then_some(Fit::Before));
    if data.has_added_effects() {
        let after = bin_residuals(data, &across, &up, Fit::After);
        maps.push_str(&map(data, (&across, &up), &after, top, Some(Fit::After)));
    }
    let note = match data.tongue.0 {
        Language::En => format!(
            "Mean of recorded minus simulated over {} and {}, the two inputs that tell most about it. Cells without rows are empty.",
            data.tongue.name_column(&across.name),
            data.tongue.name_column(&up.name)
        ),
        Language::Zh => format!(
            "实测减仿真的均值，横纵轴为最能说明差异的两个输入：{}与{}。无数据的格为空。",
            data.tongue.name_column(&across.name),
            data.tongue.name_column(&up.name)
        ),
    };
    format!(
        "<section><h2>{title}</h2><p class=\"note\">{note}</p><div class=\"maps\">{maps}</div>{}</section>\n",
        render_legend(data, top)
    )
}

/// The pair of columns between whose cells most of the residual's variance lies.
fn most_telling<'a>(data: &Data<'a>) -> Option<(Binned<'a>, Binned<'a>)> {
    let rows = sample_rows(data);
    let mut columns: Vec<(f64, Binned<'a>)> = list_axis_columns(data, &rows, BINS)
        .into_iter()
        .map(|column| {
            let cells = tally_residuals(data, &rows, column.len(), |row| column.bin_of_row(data, row));
            (compute_explained_share(&cells) * weigh_column(data, &column), column)
        })
        .collect();
    columns.sort_by(|a, b| b.0.total_cmp(&a.0));
    columns.truncate(TRIED_MAX);
    let mut best: Option<(f64, usize, usize)> = None;
    for first in 0..columns.len() {
        for second in first + 1..columns.len() {
            let (a, b) = (&columns[first].1, &columns[second].1);
            let cell = |row: usize| Some(a.bin_of_row(data, row)? * b.len() + b.bin_of_row(data, row)?);
            let cells = tally_residuals(data, &rows, a.len() * b.len(), cell);
            let score =
                compute_explained_share(&cells) * compute_fill(&cells) * weigh_column(data, a) * weigh_column(data, b);
            if best.is_none_or(|(best, ..)| score > best + 1e-9) {
                best = Some((score, first, second));
            }
        }
    }
    let (_, first, second) = best?;
    let up = columns.swap_remove(second).1;
    let across = columns.swap_remove(first).1;
    // Words read better along the side.
    Some(if across.is_text() && !up.is_text() { (up, across) } else { (across, up) })
}

/// Settings of the machine, and what describes the region, tell more to act on than the mere order of rows.
fn weigh_column(data: &Data<'_>, column: &Binned<'_>) -> f64 {
    let order = ["run", "time_in_run_s"].contains(&column.name.as_str());
    match (order, super::bins::is_region_column(data, &column.name)) {
        (_, true) => DESCRIBING_WEIGHT,
        (true, false) => ORDER_WEIGHT,
        (false, false) => 1.0,
    }
}

fn tally_residuals(
    data: &Data<'_>,
    rows: &[usize],
    count: usize,
    bin: impl Fn(usize) -> Option<usize>,
) -> Vec<BinCell> {
    let mut cells = vec![BinCell::default(); count];
    for row in rows {
        if let Some((bin, residual)) = bin(*row).zip(data.residual(*row, Fit::Before)) {
            cells[bin].add(residual);
        }
    }
    cells
}

/// A map of two columns that say the same is a diagonal: little of it is filled, and it tells no more than one column.
fn compute_fill(cells: &[BinCell]) -> f64 {
    let used = cells.iter().filter(|cell| cell.rows >= ROWS_MIN).count();
    (used as f64 / cells.len().max(1) as f64).powf(0.25)
}

fn bin_residuals(data: &Data<'_>, across: &Binned<'_>, up: &Binned<'_>, fit: Fit) -> Vec<BinCell> {
    let mut cells = vec![BinCell::default(); across.len() * up.len()];
    for row in 0..data.count_rows() {
        if let (Some(x), Some(y), Some(residual)) =
            (across.bin_of_row(data, row), up.bin_of_row(data, row), data.residual(row, fit))
        {
            cells[y * across.len() + x].add(residual);
        }
    }
    cells
}

fn map(
    data: &Data<'_>,
    (across, up): (&Binned<'_>, &Binned<'_>),
    cells: &[BinCell],
    top: f64,
    fit: Option<Fit>,
) -> String {
    let (wide, high) = (across.len(), up.len());
    let mut grid = String::new();
    for y in (0..high).rev() {
        for x in 0..wide {
            grid.push_str(&render_cell(data, (across, up), (x, y), &cells[y * wide + x], top));
        }
    }
    let name = match fit {
        Some(Fit::Before) => data.pick_text("before", "之前"),
        Some(Fit::After) => data.pick_text("after", "之后"),
        None => data.pick_text("simulated", "仿真"),
    };
    let side = |(at, text): (f64, String)| format!("<span style=\"top:{:.1}%\">{text}</span>", 100.0 * (1.0 - at));
    let below = |(at, text): (f64, String)| format!("<span style=\"left:{:.1}%\">{text}</span>", 100.0 * at);
    let crowded = if across.format_axis_labels().len() > 6 { " crowded" } else { "" };
    format!(
        "<figure class=\"map\"><figcaption>{name}</figcaption><div class=\"ytitle\">{}</div><div class=\"area{}\"><div class=\"yl\">{}</div><div class=\"grid\" style=\"--c:{wide};--r:{high}\">{grid}</div><div class=\"xl{crowded}\">{}</div></div><div class=\"xtitle\">{}</div></figure>",
        data.tongue.name_column_with_unit(&up.name),
        if up.is_text() { " words" } else { "" },
        up.format_axis_labels().into_iter().map(side).collect::<String>(),
        across.format_axis_labels().into_iter().map(below).collect::<String>(),
        data.tongue.name_column_with_unit(&across.name),
    )
}

fn render_cell(
    data: &Data<'_>,
    (across, up): (&Binned<'_>, &Binned<'_>),
    (x, y): (usize, usize),
    cell: &BinCell,
    top: f64,
) -> String {
    if cell.rows < ROWS_MIN {
        return "<i></i>".to_owned();
    }
    let mean = cell.mean();
    let level = if top > 0.0 { (mean / top * STEPS).round().clamp(-STEPS, STEPS) } else { 0.0 };
    let mut html = String::new();
    let _ = write!(
        html,
        "<i class=\"d{:.0}\" title=\"{} {}, {} {}: {} ({} {})\"></i>",
        level + STEPS,
        data.tongue.name_column(&across.name),
        across.bin_text(x),
        data.tongue.name_column(&up.name),
        up.bin_text(y),
        with_unit(&format_signed(mean), &data.output_unit()).replace("<sup>", "^").replace("</sup>", ""),
        format_fixed(f64::from(cell.rows), 0),
        data.pick_text("rows", "行")
    );
    html
}

fn render_legend(data: &Data<'_>, top: f64) -> String {
    let swatches: String = (0..=8).map(|level| format!("<i class=\"d{level}\"></i>")).collect();
    let unit = data.output_unit();
    format!(
        "<p class=\"ramp\"><span>{}</span>{swatches}<span>{}</span><small>{}</small></p>",
        with_unit(&format_number(-top), &unit),
        with_unit(&format_signed(top), &unit),
        data.pick_text("simulated too high ← 0 → simulated too low", "仿真偏高 ← 0 → 仿真偏低")
    )
}
