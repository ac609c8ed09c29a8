//! A wear model with what it is for: the file that `identify tool-wear --out` writes, and a row of the library.

use super::conditions::FACTORS;
use super::model::WearModel;
use serde::{Deserialize, Serialize};

const SCHEMA: &str = "wear/1";

/// What a model is for. The library finds a model by these four texts.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, Default)]
pub struct WearKey {
    /// Name of the machine.
    pub machine: String,
    /// Tool, as the controller or the recipe names it.
    pub tool: String,
    /// Work material, as the recipe names it.
    pub work_material: String,
    /// Operation, as the recipe names it.
    pub operation: String,
}

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
