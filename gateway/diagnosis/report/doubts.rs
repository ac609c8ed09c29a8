//! What may be wrong before anything is claimed: units, and how the file was understood.

use super::data::Data;
use super::text::escape_html;
use adapter_core::bilingual::Bilingual;

/// The section; empty where nothing is doubtful.
pub(super) fn render_section(data: &Data<'_>) -> String {
    let context = data.input.context;
    if context.doubts.is_empty() {
        return String::new();
    }
    let items: String =
        context.doubts.iter().map(|doubt| format!("<li>{}</li>", pick_text(data, &doubt.text))).collect();
    format!(
        "<section class=\"doubts\"><h2>{}</h2><ul>{items}</ul></section>\n",
        data.pick_text(
            "Are the units right? Until that is settled, what follows may mean nothing.",
            "单位是否正确？确认之前，以下结论可能没有意义。"
        )
    )
}

/// One sentence of the context in the language of the page, escaped.
pub(super) fn pick_text(data: &Data<'_>, text: &Bilingual) -> String {
    escape_html(data.pick_text(&text.en, &text.zh))
}
