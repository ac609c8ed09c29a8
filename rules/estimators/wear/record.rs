//! A wear model with what it is for: the file that `identify tool-wear --out` writes, and a row of the library.

use super::conditions::FACTORS;
use super::model::WearModel;
use adapter_core::model_library::{LibraryModel, LibraryRow, WearKey};
use serde::{Deserialize, Serialize};

const SCHEMA: &str = "wear/1";

/// A model, what it is for, and where it comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WearRecord {
    /// `wear/1`; a file with another one is refused.
    pub schema: String,
    /// What it is for.
    #[serde(flatten)]
    pub key: WearKey,
    /// Flank wear at which the edge is worn, mm.
    pub criterion_mm: f64,
    /// Where the cuts came from.
    pub origin: String,
    /// How many cuts the model was fitted to.
    pub cuts: usize,
    /// Share of the variance explained.
    pub r2: f64,
    /// The fitted surface or physical form.
    pub model: WearModel,
}

impl LibraryModel for WearRecord {
    type Error = String;

    fn to_row(&self) -> Result<LibraryRow, Self::Error> {
        let residual_sd_w = match &self.model {
            WearModel::Surface(surface) => surface.residual_sd_w,
            WearModel::Physical(physical) => physical.residual_sd_w,
        };
        Ok(LibraryRow {
            key: self.key.clone(),
            form: self.model.form(),
            criterion_mm: self.criterion_mm,
            cuts: self.cuts,
            residual_sd_w,
            r2: self.r2,
            origin: self.origin.clone(),
            toml: self.to_toml()?,
        })
    }

    fn from_toml(text: &str) -> Result<Self, Self::Error> {
        Self::parse(text)
    }
}

impl WearRecord {
    /// A record of this version.
    #[must_use]
    pub fn new(key: WearKey, criterion_mm: f64, (origin, cuts, r2): (String, usize, f64), model: WearModel) -> Self {
        Self { schema: SCHEMA.to_owned(), key, criterion_mm, origin, cuts, r2, model }
    }

    /// The file.
    ///
    /// # Errors
    /// A number that TOML cannot hold; models hold none.
    pub fn to_toml(&self) -> Result<String, String> {
        toml::to_string(self).map_err(|error| error.to_string())
    }

    /// Reads a file back.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn parse(text: &str) -> Result<Self, String> {
        let record: Self = toml::from_str(text).map_err(|error| format!("not a wear model (wear/1): {error}"))?;
        if record.schema != SCHEMA {
            return Err(format!("schema {:?} is not known; {SCHEMA} is", record.schema));
        }
        if let Some(problem) = FACTORS[0].find_problem(record.criterion_mm) {
            return Err(format!("the criterion: {problem}"));
        }
        if record.model.is_sound() { Ok(record) } else { Err("its numbers do not belong together".to_owned()) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::surface::build_published_surface;
    use super::*;

    fn key(texts: [&str; 4]) -> WearKey {
        let [machine, tool, work_material, operation] = texts.map(str::to_owned);
        WearKey { machine, tool, work_material, operation }
    }

    #[test]
    fn a_record_comes_back_and_a_spoilt_one_does_not() {
        let record = WearRecord::new(
            key(["CHK460", "T01", "45# steel", "rough"]),
            0.3,
            ("patent".to_owned(), 27, 0.9929),
            WearModel::Surface(build_published_surface()),
        );
        let text = record.to_toml().expect("TOML");
        assert_eq!(WearRecord::parse(&text), Ok(record.clone()));
        for (old, new, part) in [
            ("wear/1", "wear/9", "is not known"),
            ("criterion_mm = 0.3", "criterion_mm = 300.0", "is it in um?"),
            ("1035.63, ", "", "do not belong together"),
            ("1035.63", "nan", "do not belong together"),
        ] {
            let told = WearRecord::parse(&text.replace(old, new)).expect_err(part);
            assert!(told.contains(part), "{part}: {told}");
        }
    }
}
