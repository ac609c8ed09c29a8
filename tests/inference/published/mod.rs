//! Published numbers beside ours: `cargo test --test inference published:: -- --nocapture` prints one table.
//!
//! A misprint of a publication is listed with the reason and not asserted. Every other row is.

mod current;
mod power;
mod thermal;
mod wear;

/// One line of the table.
pub(crate) struct Row {
    /// What it is, with its unit.
    pub(crate) quantity: String,
    /// The number of the publication, or recomputed from its formula.
    pub(crate) published: f64,
    /// What this program computes.
    pub(crate) ours: f64,
    /// Greatest difference that passes, in the unit of the number.
    pub(crate) tolerance: f64,
    /// Document and place.
    pub(crate) source: String,
    /// Why the published number cannot be right, where it cannot.
    pub(crate) misprint: Option<&'static str>,
}

impl Row {
    pub(crate) fn new(quantity: impl Into<String>, published: f64, ours: f64, tolerance: f64, source: &str) -> Self {
        let source = source.to_owned();
        Self { quantity: quantity.into(), published, ours, tolerance, source, misprint: None }
    }

    /// A published number that does not follow from the publication's own formulas.
    pub(crate) fn misprint(quantity: &str, published: f64, ours: f64, source: &str, why: &'static str) -> Self {
        Self { misprint: Some(why), ..Self::new(quantity, published, ours, 0.0, source) }
    }

    fn holds(&self) -> bool {
        self.misprint.is_some() || (self.ours - self.published).abs() <= self.tolerance
    }
}

/// Seven figures, without trailing zeros.
fn figures(value: f64) -> String {
    let decimals = if value == 0.0 { 0 } else { (6.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize };
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

fn line(row: &Row) -> String {
    let verdict = match row.misprint {
        Some(why) => format!("MISPRINT: {why}"),
        None if row.holds() => "ok".to_owned(),
        None => "DIFFERS".to_owned(),
    };
    format!(
        "{:<58} {:>14} {:>14} {:>11.2e} {:>9.1e}  {:<28} {verdict}",
        row.quantity,
        figures(row.published),
        figures(row.ours),
        row.ours - row.published,
        row.tolerance,
        row.source
    )
}

#[test]
fn published_numbers_are_reproduced() {
    let rows: Vec<Row> =
        [power::rows(), current::rows(), thermal::rows(), wear::rows()].into_iter().flatten().collect();
    println!(
        "{:<58} {:>14} {:>14} {:>11} {:>9}  {:<28} verdict",
        "quantity", "published", "ours", "difference", "tolerance", "source"
    );
    rows.iter().for_each(|row| println!("{}", line(row)));
    let misprints = rows.iter().filter(|row| row.misprint.is_some()).count();
    println!("{} rows, {misprints} of them misprints of the publications", rows.len());
    let wrong: Vec<String> = rows.iter().filter(|row| !row.holds()).map(line).collect();
    assert!(wrong.is_empty(), "not reproduced:\n{}", wrong.join("\n"));
}
