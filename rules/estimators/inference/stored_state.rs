//! What the estimators remember, to be stored and taken up again.

use super::{Inference, InferenceState, RestoreError};
use crate::settings::Settings;

impl Inference {
    /// Everything remembered, to be stored and given to [`Inference::from_snapshot`] after a restart.
    #[must_use]
    pub fn take_snapshot(&self) -> serde_json::Value {
        serde_json::to_value(&self.state).unwrap_or(serde_json::Value::Null)
    }

    /// Continues where a snapshot was taken. A pause longer than `gap_s` makes the detector begin anew, with the
    /// learned no-load powers.
    ///
    /// # Errors
    /// The snapshot is not one of this version.
    pub fn from_snapshot(settings: Settings, snapshot: serde_json::Value) -> Result<Self, RestoreError> {
        let memory: InferenceState = serde_json::from_value(snapshot)?;
        Ok(Self { state: memory, ..Self::new(settings) })
    }
}
