//! Run-out as a hypothesis whose state nobody records: where in its turn each cut begins (`tone`).

use super::designs::{Design, design, wanted};
use super::diagnose::Case;
use super::fit::Fit;
use super::frame::Frame;
use super::tone::{self, Tone, Turning};
use crate::physics::{Form, Scene, effect};

/// The kind.
pub(super) const KIND: &str = "runout";

/// The cut in step with the spindle, per group of a frame. Where a turn is shorter than two rows its image at the sampling
/// rate is in step all the same, as long as the recorded speed is true; `None` where it is not.
fn turning(scene: &Scene, frame: &Frame) -> Option<Turning> {
    let runout = effect(KIND)?;
    let columns: Vec<Vec<f64>> =
        runout.columns(scene, &Form::plain())?.iter().map(|(_, column)| frame.reduce(column)).collect();
    columns.try_into().ok()
}

impl Case<'_> {
    /// A tone in step with the spindle, as a hypothesis, where what the baseline leaves has one that carries over.
    pub(super) fn hidden_tone(&mut self, base: &Fit) -> Option<Design> {
        let runout = effect(KIND)?;
        if !self.is_row_by_row() || !wanted(runout, self.model) {
            return None;
        }
        let turning = turning(&self.scene, &self.frame)?;
        let found = tone::find(&base.residual, &self.frame, base.noise, base.log_likelihood, &turning)?;
        let values = tone::values(&base.residual, &self.frame, &turning, &found);
        let tone = self.tone_per_row(&values, &found)?;
        if !self.carries_over(&tone) {
            return None;
        }
        self.scene.set_latent(KIND, tone);
        let (ln_choices, noise) = self.seeming_choices(base, &values, found.noise, found.information);
        let form = Form { name: "latent", ln_choices, ..Form::default() };
        let found_as = design(runout, &form, &self.scene, &self.frame)?;
        self.tone = Some(found);
        Some(Design { noise: Some(noise), ..found_as })
    }

    /// Follows a tone that an excerpt has shown through this recording, which is the whole.
    pub(super) fn show_tone(&mut self, residual: &[f64], found: &Tone) {
        let Some(turning) = turning(&self.scene, &self.frame) else { return };
        let values = tone::values(residual, &self.frame, &turning, found);
        if let Some(tone) = self.tone_per_row(&values, found) {
            self.scene.set_latent(KIND, tone);
        }
    }

    /// The tone in every row: as told where the rows were fitted, expected from earlier rows in held-out runs.
    fn tone_per_row(&self, values: &[f64], found: &Tone) -> Option<Vec<f64>> {
        let turning = turning(&self.scene, &self.held_frame)?;
        Some(self.state_per_row(values, |groups, left| {
            let of = [0, 1].map(|of| turning[of][groups.clone()].to_vec());
            tone::follow(left, &of, found)
        }))
    }
}
