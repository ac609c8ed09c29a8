//! The map of a file as a person clicks it on the page. The file is read for it, so this is done in the child that reads files of strangers.

use super::map_file::{MapProposal, ProposalError, ProposedColumn, verify_proposal};
use adapter_core::bilingual::Bilingual;
use recording::Mapping;
use recording::read::{Preview, TimePreview, preview_recording};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The map of a file, as a person clicked it.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClickedMap {
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
    decimal: String,
    /// Seconds from one row to the next, where no column is the time.
    #[serde(default)]
    step: Option<f64>,
}

/// What a person says of a column.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClickedColumn {
    from: String,
    to: String,
    #[serde(default)]
    unit: String,
}

impl ClickedMap {
    /// The map as text, after the file was read back under it.
    ///
    /// # Errors
    /// It is no map, or the file would be read otherwise; in words.
    pub(super) fn propose_toml(&self, path: &Path, base: &Mapping) -> Result<String, ProposalError> {
        let found = preview_recording(path, base).ok();
        let time = found.as_ref().map(|found| found.time.clone()).unwrap_or_default();
        let toml = self.to_toml(base, &time);
        Mapping::parse(&toml, "the map")?;
        // Of the columns a person decides; the times stay as they are read unless something was said of them.
        if let Some(found) = found.filter(|_| !self.says_time() && self.decimal.is_empty()) {
            let names = self.list_names(&found);
            verify_proposal(path, &toml, found, &names)?;
        }
        Ok(toml)
    }

    /// As a map: what is not said here stays as the file was understood.
    fn to_toml(&self, base: &Mapping, found: &TimePreview) -> String {
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
    fn list_names(&self, found: &Preview) -> Vec<String> {
        let before = found.columns.iter().filter_map(|column| column.to.clone());
        self.columns.iter().map(|column| column.to.clone()).chain(before).collect()
    }

    /// The time was said by the person who clicked.
    fn says_time(&self) -> bool {
        self.step.is_some()
            || [&self.time, &self.zone, &self.time_unit, &self.order].iter().any(|text| !text.is_empty())
    }
}
