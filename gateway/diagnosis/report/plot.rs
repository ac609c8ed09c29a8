//! Curves over time as inline SVG: thinned so that every peak stays, drawn so that the text keeps its size on any screen.

use super::axis::Axis;
use std::fmt::Write as _;
use std::ops::Range;

/// Most points of one curve.
pub(super) const POINTS_MAX: usize = 1500;
/// Width and height of the drawing in its own units.
const WIDE: f64 = 3000.0;
const HIGH: f64 = 1000.0;

/// A curve as unbroken pieces.
pub(super) type Pieces = Vec<Vec<(f64, f64)>>;

/// One curve of a chart.
pub(super) struct Curve {
    /// Class that gives its colour.
    pub(super) class: String,
    /// What it is, escaped.
    pub(super) label: String,
    /// Its points in the axes' units.
    pub(super) pieces: Pieces,
}

pub(super) struct Plot {
    pub(super) x: Axis,
    pub(super) y: Axis,
    /// Words under and over the chart, escaped.
    pub(super) x_title: String,
    pub(super) y_title: String,
    /// Units for the read-out, escaped.
    pub(super) x_unit: String,
    pub(super) y_unit: String,
    /// The curves, drawn in order.
    pub(super) curves: Vec<Curve>,
    /// Vertical lines with labels, such as where a run begins.
    pub(super) marks: Vec<(f64, String)>,
    /// Vertical bands, such as held-out runs.
    pub(super) bands: Vec<(f64, f64)>,
    /// Is the chart low?
    pub(super) low: bool,
}

/// The values of rows as a curve of at most [`POINTS_MAX`] points: of every group of rows the least and the greatest
/// value stay, in their order. Where a whole group has no value the curve breaks.
pub(super) fn thin_curve(rows: Range<usize>, x: impl Fn(usize) -> f64, y: impl Fn(usize) -> Option<f64>) -> Pieces {
    let group = if rows.len() <= POINTS_MAX { 1 } else { rows.len().div_ceil(POINTS_MAX / 2) };
    let mut pieces: Pieces = Vec::new();
    let mut broken = true;
    let mut start = rows.start;
    while start < rows.end {
        let end = (start + group).min(rows.end);
        let known = find_extremes(start..end, &y);
        if broken && !known.is_empty() {
            pieces.push(Vec::new());
        }
        broken = known.is_empty();
        if let Some(piece) = pieces.last_mut() {
            piece.extend(known.into_iter().map(|(row, y)| (x(row), y)));
        }
        start = end;
    }
    pieces
}

/// The rows of the least and greatest value, in order; one row where they coincide.
fn find_extremes(rows: Range<usize>, y: &impl Fn(usize) -> Option<f64>) -> Vec<(usize, f64)> {
    let mut least: Option<(usize, f64)> = None;
    let mut greatest: Option<(usize, f64)> = None;
    for row in rows {
        if let Some(y) = y(row).filter(|y| y.is_finite()) {
            least = if least.is_none_or(|(_, least)| y < least) { Some((row, y)) } else { least };
            greatest = if greatest.is_none_or(|(_, greatest)| y > greatest) { Some((row, y)) } else { greatest };
        }
    }
    let mut both: Vec<(usize, f64)> = least.into_iter().chain(greatest).collect();
    both.sort_by_key(|(row, _)| *row);
    both.dedup_by_key(|(row, _)| *row);
    both
}

impl Plot {
    pub(super) fn render_html(&self) -> String {
        let mut html = format!(
            "<div class=\"plot{}\" data-x=\"{} {}\" data-y=\"{} {}\" data-ux=\"{}\" data-uy=\"{}\">",
            if self.low { " low" } else { "" },
            self.x.low,
            self.x.high,
            self.y.low,
            self.y.high,
            self.x_unit,
            self.y_unit
        );
        let _ = write!(html, "<div class=\"ytitle\">{}</div><div class=\"area\">", self.y_title);
        html.push_str(&self.mark_labels());
        html.push_str(&self.y_labels());
        html.push_str(&self.render_drawing());
        html.push_str(&self.x_labels());
        let _ = writeln!(html, "</div><div class=\"xtitle\">{}</div></div>", self.x_title);
        html
    }

    fn wanted_y(&self) -> f64 {
        if self.low { 4.0 } else { 5.0 }
    }

    fn y_labels(&self) -> String {
        let label = |(y, text): (f64, String)| {
            format!("<span style=\"top:{:.1}%\">{text}</span>", 100.0 * (1.0 - self.y.to_fraction(y)))
        };
        let labels: String = self.y.compute_ticks(self.wanted_y()).into_iter().map(label).collect();
        format!("<div class=\"yl\" aria-hidden=\"true\">{labels}</div>")
    }

    fn x_labels(&self) -> String {
        let label = |(x, text): (f64, String)| {
            format!("<span style=\"left:{:.1}%\">{text}</span>", 100.0 * self.x.to_fraction(x))
        };
        let labels: String = self.x.compute_ticks(5.0).into_iter().map(label).collect();
        format!("<div class=\"xl\" aria-hidden=\"true\">{labels}</div>")
    }

    fn render_drawing(&self) -> String {
        let names: Vec<&str> = self.curves.iter().map(|curve| curve.label.as_str()).collect();
        let mut html = String::from("<div class=\"draw\">");
        let _ = write!(
            html,
            "<svg viewBox=\"0 0 {WIDE} {HIGH}\" preserveAspectRatio=\"none\" role=\"img\" aria-label=\"{}: {}\">",
            self.y_title,
            names.join(", ")
        );
        for (from, to) in &self.bands {
            let (from, to) = (self.to_drawing_x(*from), self.to_drawing_x(*to));
            let _ = write!(html, "<rect class=\"band\" x=\"{from:.0}\" width=\"{:.0}\" height=\"{HIGH}\"/>", to - from);
        }
        let _ = write!(html, "<path class=\"grid\" d=\"{}\"/>", self.format_grid_path());
        if self.y.low < 0.0 && self.y.high > 0.0 {
            let _ = write!(html, "<path class=\"zero\" d=\"M0 {:.0}H{WIDE}\"/>", self.to_drawing_y(0.0));
        }
        for (at, _) in &self.marks {
            let _ = write!(html, "<path class=\"mark\" d=\"M{:.0} 0V{HIGH}\"/>", self.to_drawing_x(*at));
        }
        for curve in &self.curves {
            let line = self.format_curve_path(&curve.pieces);
            let _ = write!(html, "<path class=\"curve {}\" data-l=\"{}\" d=\"{line}\"/>", curve.class, curve.label);
        }
        html + "</svg></div>"
    }

    /// Names of the marks, above the drawing.
    fn mark_labels(&self) -> String {
        let named = self.marks.iter().filter(|(_, text)| !text.is_empty());
        let label = |(at, text): &(f64, String)| {
            format!("<span style=\"left:{:.1}%\">{text}</span>", 100.0 * self.x.to_fraction(*at))
        };
        let labels: String = named.map(label).collect();
        if labels.is_empty() { labels } else { format!("<div class=\"ml\" aria-hidden=\"true\">{labels}</div>") }
    }

    fn format_grid_path(&self) -> String {
        let ticks = self.y.compute_ticks(self.wanted_y());
        ticks.iter().map(|(y, _)| format!("M0 {:.0}H{WIDE}", self.to_drawing_y(*y))).collect()
    }

    fn to_drawing_x(&self, x: f64) -> f64 {
        WIDE * self.x.to_fraction(x)
    }

    fn to_drawing_y(&self, y: f64) -> f64 {
        HIGH * (1.0 - self.y.to_fraction(y))
    }

    /// The pieces as path data in whole steps, relative, so that it stays short.
    fn format_curve_path(&self, pieces: &Pieces) -> String {
        let mut text = String::new();
        for piece in pieces {
            let mut at: Option<(i64, i64)> = None;
            for (x, y) in piece {
                let here = (round_to_whole(self.to_drawing_x(*x)), round_to_whole(self.to_drawing_y(*y)));
                match at {
                    None => text.push_str(&format!("M{} {}l", here.0, here.1)),
                    Some(last) if last == here => continue,
                    Some(last) => {
                        text.push_str(&format_path_step(here.0 - last.0, here.1 - last.1, text.ends_with('l')))
                    }
                }
                at = Some(here);
            }
            if text.ends_with('l') {
                // A single value is drawn as a dot.
                text.push_str("1 0");
            }
        }
        text
    }
}

fn format_path_step(x: i64, y: i64, first: bool) -> String {
    let gap = if first || x < 0 { "" } else { " " };
    let between = if y < 0 { "" } else { " " };
    format!("{gap}{x}{between}{y}")
}

/// Within the drawing and a margin, so the conversion cannot overflow.
#[allow(clippy::cast_possible_truncation, reason = "the share of an axis is clamped")]
fn round_to_whole(x: f64) -> i64 {
    x.round() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_the_peaks_in_their_order_and_breaks_at_gaps() {
        let y = |row: usize| match row {
            40_000..50_000 => None,
            77_777 => Some(99.0),
            88_888 => Some(-99.0),
            row => Some((row % 7) as f64),
        };
        let pieces = thin_curve(0..100_000, |row| row as f64, y);
        assert_eq!(pieces.len(), 2);
        let points: Vec<(f64, f64)> = pieces.concat();
        assert!(points.len() <= POINTS_MAX);
        assert!(points.contains(&(77_777.0, 99.0)) && points.contains(&(88_888.0, -99.0)));
        assert!(points.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }

    #[test]
    fn few_rows_all_stay() {
        let pieces = thin_curve(3..10, |row| row as f64, |row| Some(row as f64));
        assert_eq!(pieces, vec![(3..10).map(|row| (f64::from(row), f64::from(row))).collect::<Vec<_>>()]);
    }
}
