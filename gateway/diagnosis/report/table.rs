//! Tables, all of one make: they scroll by themselves where the page is narrow.

/// Head of a column.
pub(super) enum ColumnHead<'a> {
    /// A column of words.
    Words(&'a str),
    /// A column of numbers, set to the right.
    Number(&'a str),
}

/// A table from its heads and its rows, the latter in HTML.
pub(super) fn render_table(heads: &[ColumnHead<'_>], rows: &str) -> String {
    let head = |head: &ColumnHead<'_>| match head {
        ColumnHead::Words(text) => format!("<th>{text}</th>"),
        ColumnHead::Number(text) => format!("<th class=\"n\">{text}</th>"),
    };
    let heads: String = heads.iter().map(head).collect();
    format!("<div class=\"scroll\"><table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>")
}

/// A section with a title, a note and a table.
pub(super) fn render_table_section(title: &str, note: &str, heads: &[ColumnHead<'_>], rows: &str) -> String {
    format!("<section><h2>{title}</h2><p class=\"note\">{note}</p>{}</section>\n", render_table(heads, rows))
}
