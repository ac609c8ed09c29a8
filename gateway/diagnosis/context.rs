//! What a report says besides the diagnosis itself: how the recordings were understood, which units are doubtful, and how far the simulation that
//! somebody already had was off as it was given.

use super::series::{error_as_given, series_column};
use super::unit_check::{self, UnitDoubt};
use adapter_core::bilingual::Bilingual;
use recording::Recording;
use rules::physics::explain::Language;
use rules::twin::text_report::{format_short_number, space_unit};
use rules::twin::{Diagnosis, Model};
use serde_json::{Value, json};

/// How the recordings were understood, which units are doubtful, and how far a given series was off.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DiagnosisContext {
    /// How the recordings were understood.
    pub reading: Vec<Bilingual>,
    /// Units that are doubtful.
    pub doubts: Vec<UnitDoubt>,
    /// The series that was given beside the recording.
    pub series: Option<SeriesErrors>,
}

/// The error of a series as given and with gain and offset fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeriesErrors {
    /// Rows that hold both the output and the series.
    pub rows: usize,
    /// Root mean square of recorded minus series, in the unit of the output.
    pub as_given: f64,
    /// With gain and offset.
    pub refitted: f64,
    /// Factor of the series in the least squares fit.
    pub gain: f64,
    /// Fitted offset, in the unit of the output.
    pub offset: f64,
}

impl DiagnosisContext {
    /// Before the diagnosis: units of the inputs, error of the series.
    #[must_use]
    pub fn from_recording(recording: &Recording, model: &Model, reading: Vec<Bilingual>) -> Self {
        Self {
            reading,
            doubts: unit_check::find_input_doubts(recording, model),
            series: series_errors(recording, &model.output),
        }
    }

    /// Adds what only the fitted parameters show.
    #[must_use]
    pub fn with_diagnosis(mut self, nominal: &Model, diagnosis: &Diagnosis) -> Self {
        self.doubts.extend(unit_check::find_parameter_doubts(nominal, &diagnosis.model));
        self
    }

    /// Before everything else in a report of words.
    #[must_use]
    pub fn to_words(&self, language: Language, unit: &str) -> String {
        let pick = |text: &Bilingual| language.select_text(&text.en, &text.zh).clone();
        let mut text = String::new();
        for doubt in &self.doubts {
            let mark = language.select_text("unit? ", "单位？");
            text.push_str(&format!("{mark}{}\n", pick(&doubt.text)));
        }
        if let Some(series) = &self.series {
            text.push_str(&format!("{}\n", pick(&series.describe_errors(unit))));
        }
        text
    }

    /// Adds what it knows to the document of a diagnosis.
    pub fn add_to(&self, document: &mut Value) {
        let both = |text: &Bilingual| json!({ "en": text.en, "zh": text.zh });
        if !self.reading.is_empty() {
            document["reading"] = self.reading.iter().map(both).collect();
        }
        if !self.doubts.is_empty() {
            let doubt = |doubt: &UnitDoubt| json!({ "about": doubt.about, "en": doubt.text.en, "zh": doubt.text.zh });
            document["unit_doubts"] = self.doubts.iter().map(doubt).collect();
        }
        if let Some(series) = &self.series {
            document["simulated"] = json!({
                "rows": series.rows,
                "as_given_rmse": series.as_given,
                "refitted_rmse": series.refitted,
                "gain": series.gain,
                "offset": series.offset,
            });
        }
    }
}

impl SeriesErrors {
    /// One sentence with both errors, in `unit`, in both languages.
    #[must_use]
    pub fn describe_errors(&self, unit: &str) -> Bilingual {
        let [given, fitted, gain, offset] =
            [self.as_given, self.refitted, self.gain, self.offset].map(format_short_number);
        let unit = space_unit(unit);
        Bilingual::new(
            format!(
                "your simulation as given misses the recording by {given}{unit}; times {gain} plus {offset}{unit} it misses by {fitted}{unit}"
            ),
            format!("给定的仿真与记录相差{given}{unit}；乘以{gain}再加{offset}{unit}后相差{fitted}{unit}"),
        )
    }
}

/// Least squares of recorded = gain * series + offset.
#[expect(clippy::cast_precision_loss, reason = "numbers of rows are far below 2^53")]
fn series_errors(recording: &Recording, output: &str) -> Option<SeriesErrors> {
    let (as_given, rows) = error_as_given(recording, output)?;
    let (recorded, series) = (recording.find_numbers(output)?, recording.find_numbers(&series_column(output))?);
    let pairs: Vec<(f64, f64)> = series.iter().zip(recorded.iter()).filter_map(|(x, y)| Some((x?, y?))).collect();
    let n = pairs.len() as f64;
    let mean = pairs.iter().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x / n, sum.1 + y / n));
    let (sxx, sxy) = pairs
        .iter()
        .fold((0.0, 0.0), |sum, (x, y)| (sum.0 + (x - mean.0).powi(2), sum.1 + (x - mean.0) * (y - mean.1)));
    let gain = if sxx > 0.0 { sxy / sxx } else { 0.0 };
    let offset = mean.1 - gain * mean.0;
    let squares: f64 = pairs.iter().map(|(x, y)| (y - gain * x - offset).powi(2)).sum();
    Some(SeriesErrors { rows, as_given, refitted: (squares / n).sqrt(), gain, offset })
}
