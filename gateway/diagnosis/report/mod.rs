//! The diagnosis as one self-contained HTML page, in the order a machinist and then an engineer reads: the answer, where,
//! what, how much better, when, where in operating space, what else, what next.
//!
//! The page loads nothing: styles, drawings and a small read-out script stand in it. It reads without the script, on a
//! phone, on paper, and in the dark. Same input, same bytes.

mod axis;
mod better;
mod bins;
mod contribution;
mod data;
mod doubts;
mod maps;
mod missing;
mod next;
mod place;
mod plot;
mod response;
mod strip;
mod table;
#[cfg(test)]
mod tests;
mod text;
mod verdict;

use data::Data;
pub use data::PageInput;
use std::fmt::Write as _;
pub use text::escape_html;

/// Styles of the page.
const STYLE: &str = include_str!("style.css");
/// The read-out under the pointer.
const READ_OUT: &str = include_str!("read_out.js");

/// The page as HTML. Time and memory grow linearly with the rows, its size does not.
#[must_use]
pub fn page(input: &PageInput<'_>) -> String {
    let data = Data::new(input);
    let mut html = head(&data);
    html.push_str(&doubts::render_section(&data));
    html.push_str(&verdict::render_section(&data));
    html.push_str(&place::render_section(&data));
    html.push_str(&missing::render_section(&data));
    html.push_str(&next::render_alternatives(&data));
    html.push_str(&next::render_experiment(&data));
    html.push_str(&better::render_section(&data));
    html.push_str(&contribution::render_section(&data));
    html.push_str(&maps::render_section(&data));
    html.push_str(&next::render_shifts(&data));
    html.push_str(&next::render_data_quality(&data));
    html.push_str(&next::render_glossary(&data));
    let _ = write!(html, "</main>\n<script>{READ_OUT}</script>\n</body>\n</html>\n");
    html
}

fn head(data: &Data<'_>) -> String {
    let output = data.tongue.name_column(&data.diagnosis.output);
    let title = format!("{}{output}", data.pick_text("Diagnosis: ", "诊断："));
    let source = file_name(&data.input.recording.source);
    let model = &data.diagnosis.model.name;
    let lines = [
        (data.pick_text("simulation", "仿真"), escape_html(model)),
        (data.pick_text("recording", "记录"), escape_html(source)),
        (data.pick_text("quantity", "物理量"), data.tongue.name_column_with_unit(&data.diagnosis.output)),
    ];
    let lines: String = lines
        .iter()
        .filter(|(_, value)| !value.is_empty())
        .map(|(name, value)| format!("<span>{name} <b>{value}</b></span>"))
        .collect();
    format!(
        "<!doctype html>\n<html lang=\"{}\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n<meta name=\"color-scheme\" content=\"light dark\">\n<title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n<header>{lines}</header>\n",
        data.pick_text("en", "zh")
    )
}

/// The last part of a path: where a file lies is nobody's business.
fn file_name(source: &str) -> &str {
    source.rsplit(['/', '\\']).next().unwrap_or(source)
}
