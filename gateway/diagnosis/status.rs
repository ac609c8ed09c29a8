//! The twin in the status document and at `/api/v1/twin`.

use serde::Serialize;

/// Where one regime stands.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RegimeStatus {
    /// `standby`, `idle`, `cutting` or `moving`.
    pub regime: &'static str,
    /// `learning`, `watching` or `differing`.
    pub stage: &'static str,
    /// Blocks of half a minute that were learned from, and how many are needed; while learning.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learned: Option<(usize, usize)>,
    /// Differences up to this size are usual, in the unit of the output.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub usual: Option<f64>,
    /// Mean difference since it began, in the unit of the output.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub difference: Option<f64>,
    /// The same over the simulated output, %.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub difference_pct: Option<f64>,
    /// Since when, with the ends of the 95 % interval, milliseconds since 1970: most likely, earliest, latest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub since_ms: Option<[i64; 3]>,
    /// One sentence for the operator, in English; absent while nothing differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
    /// The same in Chinese.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zh: Option<String>,
}

/// A finished diagnosis in short.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiagnosisStatus {
    /// When it was finished, milliseconds since 1970.
    pub at_ms: i64,
    /// The stretch that was examined.
    pub from_ms: i64,
    /// End of the stretch, milliseconds since 1970.
    pub to_ms: i64,
    /// The word of the verdict, as in `diagnosis/1`.
    pub verdict: String,
    /// What was found, in English, as the history keeps it.
    pub summary: String,
    /// What is missing, most important first.
    pub missing: Vec<String>,
    /// What to type to take the improved model over.
    pub accept: String,
}

/// The model beside the running machine, and how far the machine is from it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TwinStatus {
    /// Name of the model in charge.
    pub model: String,
    /// Path of the model file in charge.
    pub file: String,
    /// The quantity that is simulated.
    pub output: String,
    /// Unit of all figures.
    pub unit: &'static str,
    /// The second that the figures are of, milliseconds since 1970.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_ms: Option<i64>,
    /// Mean recorded output of this second.
    pub twin_recorded: Option<f64>,
    /// What the model expects at this second.
    pub twin_expected: Option<f64>,
    /// Recorded minus expected output of this second, in `unit`.
    pub twin_residual: Option<f64>,
    /// The reason for none, as a word.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missing: Option<&'static str>,
    /// The same in plain words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
    /// Every regime that has been seen.
    pub regimes: Vec<RegimeStatus>,
    /// Since when a diagnosis is under way, milliseconds since 1970.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diagnosing_since_ms: Option<i64>,
    /// The newest diagnosis of this process.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diagnosis: Option<DiagnosisStatus>,
    /// What is wrong with the newest text of the file, while the one before stays in charge.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub problem: Option<String>,
}
