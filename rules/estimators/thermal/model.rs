//! A thermal law as a file that the box runs: `thermal/1`, JSON.

use super::law::ThermalLaw;
use serde::{Deserialize, Serialize};

/// What the file calls itself.
pub const SCHEMA: &str = "thermal/1";

/// The file that `identify thermal --model` writes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThermalModel {
    /// [`SCHEMA`]; a file with another one is refused.
    pub schema: String,
    /// Name of the machine; a law of another machine is refused. Empty: of any.
    #[serde(default)]
    pub machine: String,
    /// The law that predicts the error from temperatures.
    pub law: ThermalLaw,
}

impl ThermalModel {
    /// The model of a law.
    #[must_use]
    pub fn new(machine: String, law: ThermalLaw) -> Self {
        Self { schema: SCHEMA.to_owned(), machine, law }
    }

    /// Reads a file for the machine of this name.
    ///
    /// # Errors
    /// Not such a file, of another machine, or a law that cannot be used, in words.
    pub fn read(text: &str, machine: &str) -> Result<Self, String> {
        let model: Self =
            serde_json::from_str(text).map_err(|error| format!("is no thermal model ({SCHEMA}): {error}"))?;
        if model.schema != SCHEMA {
            return Err(format!("is {:?}, this gateway reads {SCHEMA}", model.schema));
        }
        if !model.machine.is_empty() && model.machine != machine {
            return Err(format!("was identified for machine {:?}, this is {machine:?}", model.machine));
        }
        model.law.check_consistency().map_err(|refusal| refusal.to_string())?;
        Ok(model)
    }

    /// As the file.
    ///
    /// # Errors
    /// A number that JSON cannot hold.
    pub fn to_json_text(&self) -> Result<String, String> {
        serde_json::to_string_pretty(self).map(|text| text + "\n").map_err(|error| error.to_string())
    }
}
