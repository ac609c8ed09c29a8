//! An effect over the input that governs it: the fitted law as a line, what the recording shows as points.

use super::axis::Axis;
use super::bins::{BinCell, Binned, compute_explained_share, list_axis_columns, sample_rows};
use super::data::{Data, Fit};
use super::plot::{Curve, Plot};

/// Bins along the input.
const BINS: usize = 28;
/// Share of the effect that one input must govern for the chart to be honest.
const GOVERNED_MIN: f64 = 0.75;
/// How often a law may turn along its input; more is the mark of an input that merely goes along with others.
const TURNS_MAX: usize = 3;
/// Change of direction, as a share of the range, that counts as a turn.
const TURN_SHARE: f64 = 0.05;
/// Rows below which a bin shows no point.
const ROWS_MIN: u32 = 5;

/// The chart; empty where no single input governs the effect.
pub(super) fn render_chart(data: &Data<'_>, effect: &str) -> String {
    let Some((_, values)) = data.diagnosis.rows.effects.iter().find(|(name, _)| name == effect) else {
        return String::new();
    };
    let rows = sample_rows(data);
    let inputs = list_axis_columns(data, &rows, BINS).into_iter().filter(|column| !column.is_text());
    let judged = inputs.map(|column| (compute_explained_share(&bin_effect(data, &rows, &column, values)), column));
    let Some((governed, column)) = judged.reduce(|best, next| if next.0 > best.0 + 1e-9 { next } else { best }) else {
        return String::new();
    };
    if governed < GOVERNED_MIN { String::new() } else { render_curve(data, &rows, &column, values) }
}

fn bin_effect(data: &Data<'_>, rows: &[usize], column: &Binned<'_>, values: &[f64]) -> Vec<BinCell> {
    let mut cells = vec![BinCell::default(); column.len()];
    for row in rows {
        if let (Some(bin), Some(x)) = (column.bin_of_row(data, *row), values.get(*row)) {
            cells[bin].add(*x);
        }
    }
    cells
}

/// Mean input, law and law plus what remains, per bin.
fn render_curve(data: &Data<'_>, rows: &[usize], column: &Binned<'_>, values: &[f64]) -> String {
    let mut cells = vec![(BinCell::default(), BinCell::default(), BinCell::default()); column.len()];
    for row in rows {
        let here = column.bin_of_row(data, *row).zip(column.value_of_row(data, *row)).zip(values.get(*row));
        if let (Some(((bin, x), effect)), Some(rest)) = (here, data.residual(*row, Fit::After)) {
            cells[bin].0.add(x);
            cells[bin].1.add(*effect);
            cells[bin].2.add(*effect + rest);
        }
    }
    if count_turns(cells.iter().filter(|(x, ..)| x.rows >= ROWS_MIN).map(|(_, law, _)| law.mean())) > TURNS_MAX {
        return String::new();
    }
    // The line is whole where rows lie along it, dashed between.
    let pieces = cells.split(|(x, ..)| x.rows < ROWS_MIN).filter(|piece| !piece.is_empty());
    let line: Vec<Vec<(f64, f64)>> =
        pieces.map(|piece| piece.iter().map(|(x, law, _)| (x.mean(), law.mean())).collect()).collect();
    cells.retain(|(x, ..)| x.rows >= ROWS_MIN);
    let between: Vec<(f64, f64)> = cells.iter().map(|(x, law, _)| (x.mean(), law.mean())).collect();
    let points = cells.iter().map(|(x, _, seen)| vec![(x.mean(), seen.mean())]).collect();
    let spread = cells.iter().map(|(x, _, seen)| {
        let (mean, half) = (seen.mean(), seen.half_width());
        vec![(x.mean(), mean - half), (x.mean(), mean + half)]
    });
    let spread: Vec<Vec<(f64, f64)>> = spread.collect();
    let all = spread.iter().chain(&line).flatten().map(|(_, y)| *y);
    let (Some(x), Some(y)) = (Axis::from_values(line.iter().flatten().map(|(x, _)| *x)), Axis::from_values(all)) else {
        return String::new();
    };
    let curve = |class: &str, label: &str, pieces| Curve { class: class.to_owned(), label: label.to_owned(), pieces };
    let plot = Plot {
        x: x.with_margin(),
        y: y.with_zero().with_margin(),
        x_title: data.tongue.name_column_with_unit(&column.name),
        y_title: format!("{} ({})", data.pick_text("this effect", "该效应"), data.output_unit()),
        x_unit: super::text::unit_of(&column.name),
        y_unit: data.output_unit(),
        curves: vec![
            curve("spread", "", spread),
            curve("gap", "", vec![between]),
            curve("law", data.pick_text("fitted law", "拟合公式"), line),
            curve("points", data.pick_text("recording", "记录"), points),
        ],
        marks: Vec::new(),
        bands: Vec::new(),
        low: true,
    };
    let note = data.pick_text(
        "Line: the fitted law, dashed where no rows lie. Points: what the recording shows once everything else is taken off, mean with its 95 % interval.",
        "线：拟合公式（虚线处无数据）。点：扣除其他影响后记录所显示的均值及其95 %区间。",
    );
    format!("{}<p class=\"note\">{note}</p>", plot.render_html())
}

/// How often a sequence turns by more than [`TURN_SHARE`] of its range.
fn count_turns(values: impl Iterator<Item = f64> + Clone) -> usize {
    let Some(range) = Axis::from_values(values.clone()) else { return 0 };
    let enough = TURN_SHARE * (range.high - range.low);
    let (mut turns, mut rising, mut peak) = (0, None, None);
    for x in values {
        let last = *peak.get_or_insert(x);
        let up = x > last;
        match rising {
            Some(before) if before == up => peak = Some(x),
            _ if (x - last).abs() > enough => {
                turns += usize::from(rising.is_some());
                (rising, peak) = (Some(up), Some(x));
            }
            _ => {}
        }
    }
    turns
}

#[cfg(test)]
mod tests {
    use super::count_turns;

    #[test]
    fn small_steps_back_are_no_turns() {
        assert_eq!(count_turns([0.0, 1.0, 0.99, 2.0, 3.0].into_iter()), 0);
        assert_eq!(count_turns([0.0, 3.0, 1.0, 3.0, 0.0].into_iter()), 3);
        assert_eq!(count_turns([1.0; 5].into_iter()), 0);
        assert_eq!(count_turns(std::iter::empty()), 0);
    }
}
