//! What the library of wear models needs to know of a model: what it is for, the figures of its row, and its text.

use serde::{Deserialize, Serialize};

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

/// A model as a row of the library.
#[derive(Debug, Clone, PartialEq)]
pub struct LibraryRow {
    /// What it is for.
    pub key: WearKey,
    /// The word of its form.
    pub form: &'static str,
    /// Flank wear at which the edge is worn, mm.
    pub criterion_mm: f64,
    /// How many cuts it was fitted to.
    pub cuts: usize,
    /// One standard deviation of what it leaves, W.
    pub residual_sd_w: f64,
    /// Share of the variance explained.
    pub r2: f64,
    /// Where the cuts came from.
    pub origin: String,
    /// The whole model as a text, from which it is read back.
    pub toml: String,
}

/// A model that the library can hold. The library stores rows and texts; what the numbers mean is the model's.
pub trait LibraryModel: Sized {
    /// What is wrong with a model, in words.
    type Error: std::fmt::Display;

    /// The row of this model.
    ///
    /// # Errors
    /// A number that a text cannot hold.
    fn to_row(&self) -> Result<LibraryRow, Self::Error>;

    /// Reads the text of a row back.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    fn from_toml(text: &str) -> Result<Self, Self::Error>;
}
