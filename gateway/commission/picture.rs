//! The fits as pictures: dots in a frame, on one page that needs nothing else.

use gateway_diagnosis::report::escape_html;
use std::fmt::Write as _;

/// Size of a picture, in units of the picture.
const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 300.0;
const MARGIN: f64 = 56.0;

/// One measured point of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dot {
    /// Across, in the unit of the horizontal axis.
    pub x: f64,
    /// Up, in the unit of the vertical axis.
    pub y: f64,
    /// Half of the bar through it; 0 for none.
    pub sd: f64,
}

/// A scatter of dots with two labelled axes, drawn as SVG.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    title: String,
    units: (String, String),
    dots: Vec<Dot>,
    /// A line from corner to corner, where both axes mean the same.
    diagonal: bool,
}

impl Picture {
    /// Something over something else.
    #[must_use]
    pub fn new_curve(title: &str, x_unit: &str, y_unit: &str, dots: Vec<Dot>) -> Self {
        Self { title: title.to_owned(), units: (x_unit.to_owned(), y_unit.to_owned()), dots, diagonal: false }
    }

    /// Measured across, fitted up.
    #[must_use]
    pub fn new_agreement(title: &str, unit: &str, dots: Vec<Dot>) -> Self {
        let units = (format!("measured, {unit}"), format!("fitted, {unit}"));
        Self { title: title.to_owned(), units, dots, diagonal: true }
    }

    fn axis_ranges(&self) -> ((f64, f64), (f64, f64)) {
        let of = |values: &mut dyn Iterator<Item = f64>| {
            let (least, greatest) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
            let margin = (0.06 * (greatest - least)).max(1e-9);
            if least.is_finite() { (least - margin, greatest + margin) } else { (0.0, 1.0) }
        };
        let x = of(&mut self.dots.iter().map(|dot| dot.x));
        let y = of(&mut self.dots.iter().flat_map(|dot| [dot.y - dot.sd, dot.y + dot.sd]));
        if self.diagonal { ((x.0.min(y.0), x.1.max(y.1)), (x.0.min(y.0), x.1.max(y.1))) } else { (x, y) }
    }

    fn to_svg(&self) -> String {
        let (x, y) = self.axis_ranges();
        let across = |value: f64| MARGIN + (value - x.0) / (x.1 - x.0) * (WIDTH - 1.4 * MARGIN);
        let up = |value: f64| HEIGHT - MARGIN - (value - y.0) / (y.1 - y.0) * (HEIGHT - 1.6 * MARGIN);
        let mut svg = format!(
            "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\"><title>{}</title><path class=\"axis\" d=\"M{MARGIN} {} V{} H{}\"/>",
            escape_html(&self.title),
            0.6 * MARGIN,
            HEIGHT - MARGIN,
            WIDTH - 0.4 * MARGIN
        );
        if self.diagonal {
            let (a, b) = (x.0.max(y.0), x.1.min(y.1));
            let _ = write!(
                svg,
                "<path class=\"line\" d=\"M{:.1} {:.1} L{:.1} {:.1}\"/>",
                across(a),
                up(a),
                across(b),
                up(b)
            );
        }
        for dot in &self.dots {
            let (cx, cy) = (across(dot.x), up(dot.y));
            if dot.sd > 0.0 {
                let _ = write!(
                    svg,
                    "<path class=\"line\" d=\"M{cx:.1} {:.1} V{:.1}\"/>",
                    up(dot.y - dot.sd),
                    up(dot.y + dot.sd)
                );
            }
            let _ = write!(svg, "<circle cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"3\"/>");
        }
        for value in [x.0, x.1] {
            let _ = write!(
                svg,
                "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{value:.4}</text>",
                across(value),
                HEIGHT - 0.65 * MARGIN
            );
        }
        for value in [y.0, y.1] {
            let _ = write!(
                svg,
                "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{value:.4}</text>",
                MARGIN - 4.0,
                up(value)
            );
        }
        let _ = write!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text><text x=\"4\" y=\"16\">{}</text></svg>",
            0.5 * WIDTH,
            HEIGHT - 0.25 * MARGIN,
            escape_html(&self.units.0),
            escape_html(&self.units.1)
        );
        svg
    }
}

/// A whole page of HTML: the report as it was printed, then every picture that has dots.
#[must_use]
pub fn render_page(machine: &str, text: &str, pictures: &[Picture]) -> String {
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Commissioning of {0}</title><style>body{{font:15px sans-serif;\
         max-width:60rem;margin:2rem auto;padding:0 1rem}}svg{{width:30rem;max-width:100%}}.axis{{fill:none;stroke:#333}}\
         .line{{fill:none;stroke:#888}}circle{{fill:#1667a8}}text{{font-size:11px}}pre{{white-space:pre-wrap}}</style>\
         <h1>Commissioning of {0} 调试报告</h1><pre>{1}</pre>",
        escape_html(machine),
        escape_html(text)
    );
    for picture in pictures.iter().filter(|picture| !picture.dots.is_empty()) {
        let _ = write!(page, "<h2>{}</h2>{}", escape_html(&picture.title), picture.to_svg());
    }
    page + "</html>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_drawn_whatever_the_numbers_are() {
        let dots = vec![Dot { x: 1.0, y: 2.0, sd: 0.5 }, Dot { x: 3.0, y: 4.0, sd: 0.0 }];
        let page = render_page(
            "<lathe>",
            "all & known",
            &[Picture::new_agreement("Fit", "W", dots), Picture::new_curve("None", "", "", Vec::new())],
        );
        assert_eq!(page.matches("<circle").count(), 2);
        assert!(page.contains("&lt;lathe&gt;") && !page.contains("NaN"));
        let one = Picture::new_curve("One", "rpm", "W", vec![Dot { x: 5.0, y: 5.0, sd: 0.0 }]).to_svg();
        assert!(!one.contains("NaN") && !one.contains("inf"), "{one}");
    }
}
