//! The map of a file as a person clicked it on the page.

use adapters::bilingual::Bilingual;
use adapters::recording::Mapping;
use adapters::recording::read::{Preview, TimePreview};
use gateway_diagnosis::map_file::{MapProposal, ProposedColumn};
use serde::Deserialize;

/// The map of a file, as a person clicked it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ClickedMap {
    columns: Vec<ClickedColumn>,
    #[serde(default)]
    time: String,
    #[serde(default)]
    zone: String,
    #[serde(default)]
    time_unit: String,
    #[serde(default)]
    order: String,
    #[serde(default)]
    pub(super) decimal: String,
    /// Seconds from one row to the next, where no column is the time.
    #[serde(default)]
    step: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ClickedColumn {
    from: String,
    to: String,
    #[serde(default)]
    unit: String,
}

impl ClickedMap {
    /// As a map: what is not said here stays as the file was understood.
    pub(super) fn to_toml(&self, base: &Mapping, found: &TimePreview) -> String {
        let columns = self.columns.iter().map(|column| ProposedColumn {
            from: column.from.clone(),
            name: column.from.clone(),
            to: Some(column.to.clone()),
            unit: Some(column.unit.clone()).filter(|unit| !unit.is_empty()),
            candidates: Vec::new(),
            is_time: false,
        });
        let said = |text: &String| Some(text.clone()).filter(|text| !text.is_empty());
        let mut base = base.clone();
        base.column.clear();
        for (to, text) in [
            (&mut base.time.zone, &self.zone),
            (&mut base.time.unit, &self.time_unit),
            (&mut base.time.order, &self.order),
        ] {
            *to = said(text).or(to.take());
        }
        base.decimal = self.decimal.chars().next().or(base.decimal);
        let proposal = MapProposal {
            columns: columns.collect(),
            time: said(&self.time),
            step: self.step,
            time_preview: found.clone(),
            base,
        };
        proposal.to_toml(&Bilingual::default(), "the file")
    }

    /// Every column, by the name it has and the one it gets: a person has looked at all of them.
    pub(super) fn list_names(&self, found: &Preview) -> Vec<String> {
        let before = found.columns.iter().filter_map(|column| column.to.clone());
        self.columns.iter().map(|column| column.to.clone()).chain(before).collect()
    }

    /// The time was said by the person who clicked.
    pub(super) fn says_time(&self) -> bool {
        self.step.is_some()
            || [&self.time, &self.zone, &self.time_unit, &self.order].iter().any(|text| !text.is_empty())
    }
}
