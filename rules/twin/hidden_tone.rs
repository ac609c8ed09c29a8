//! Run-out as a hypothesis whose state nobody records: where in its turn each cut begins (`tone`).

use super::designs::{Design, design, wanted};
use super::diagnose::Case;
use super::fit::{Fit, residual};
use super::frame::Frame;
use super::tone::{self, Tone, Turning};
use crate::physics::{Form, Scene, effect};

/// The kind.
pub(super) const KIND: &str = "runout";

/// The cut in step with the spindle, per group of a frame; `None` where the sampling is too slow to show it.
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
        // The tone is read from the residual it explains: what it seems to gain beyond its likelihood is no gain.
        let left: Vec<f64> = base.residual.iter().zip(&values).map(|(x, tone)| x - tone).collect();
        let (likelihood, noise) = super::noise::fit_near(&left, &self.frame, found.noise);
        let ln_choices = likelihood - base.log_likelihood - 0.5 * found.information;
        let form = Form { name: "latent", ln_choices: ln_choices.max(0.0), ..Form::default() };
        let found_as = design(runout, &form, &self.scene, &self.frame)?;
        self.tone = Some(found);
        Some(Design { noise: Some(noise), ..found_as })
    }

    /// Follows what an excerpt has shown of it through the whole recording.
    pub(super) fn show_tone(&mut self, base: &Fit) {
        let (Some(whole), Some(found)) = (&mut self.whole, &self.tone) else { return };
        let Some(residual) = whole.with_data(|data| residual(data, &base.parts)) else { return };
        let Some(turning) = turning(&whole.scene, &whole.frame) else { return };
        let values = tone::values(&residual, &whole.frame, &turning, found);
        if let Some(tone) = whole.tone_per_row(&values, found) {
            whole.scene.set_latent(KIND, tone);
        }
    }

    /// The tone in every row: as told where the rows were fitted, expected from earlier rows in held-out runs.
    fn tone_per_row(&self, values: &[f64], found: &Tone) -> Option<Vec<f64>> {
        let turning = turning(&self.scene, &self.held_frame)?;
        let simulated = self.scene.simulated().unwrap_or_default();
        let left: Vec<f64> = self.scene.recorded().iter().zip(simulated).map(|(x, simulated)| x - simulated).collect();
        let left = self.held_frame.reduce(&left);
        let mut tone = self.frame.spread(values, self.scene.rows());
        for groups in &self.held_frame.stretches {
            let of = [0, 1].map(|of| turning[of][groups.clone()].to_vec());
            let expected = tone::follow(&left[groups.clone()], &of, found);
            groups.clone().zip(expected).for_each(|(group, expected)| tone[self.held_frame.rows(group)].fill(expected));
        }
        Some(tone)
    }
}
