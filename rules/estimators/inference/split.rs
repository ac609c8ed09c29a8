//! The power of the moment in its parts: no-load power, cutting power, load loss.

use super::Inference;
use crate::estimate::{Estimate, Estimated, NoEstimate};
use crate::estimate_words::LoadLossOrigin;
use crate::load_loss_doubt::LoadLossDoubt;
use crate::no_load::NoLoad;
use crate::situation::visible_excess_w;

/// Power this many standard deviations below no-load power is no cutting power of zero but a contradiction.
const BELOW_NO_LOAD_SD: f64 = 3.0;

/// Of the share that is lost, so much at most differs between cuts that are compared with each other (oil and windings warm up), one
/// standard deviation; the rest of its doubt is that of the drive, the same in each of them. Smaller: a warm-up passes for wear;
/// greater: an overload is told later.
const LOSS_VARIES_SD: f64 = 0.05;

/// The power above no-load power in its parts.
#[derive(Debug, Clone, Copy)]
pub(super) struct PowerParts {
    pub(super) cutting_power_w: Estimate,
    pub(super) load_loss_w: Estimate,
    /// What of the deviation of the cutting power all cuts on this drive have in common.
    pub(super) common_sd_w: f64,
}

impl Inference {
    pub(super) fn load_loss_origin(&self) -> LoadLossOrigin {
        match self.settings.load_loss_doubt(self.state.signals.stage()) {
            Some(_) => LoadLossOrigin::Commissioned,
            None => LoadLossOrigin::NotCommissioned,
        }
    }

    pub(super) fn split_power(
        &self,
        filtered: Estimated,
        no_load: Result<NoLoad, NoEstimate>,
        speed_rpm: f64,
    ) -> Result<PowerParts, NoEstimate> {
        let known = no_load?;
        let filtered = filtered?;
        let stage = self.state.signals.stage();
        let law = self.settings.load_loss(stage);
        let excess_w = filtered.value - known.power_w;
        let excess_sd_w = filtered.sd.hypot(known.sd_w);
        if excess_w < -BELOW_NO_LOAD_SD * excess_sd_w {
            return Err(NoEstimate::BelowNoLoad);
        }
        // Noise below no-load power is no negative cutting power.
        let split = law.split_excess_power(excess_w.max(0.0), speed_rpm).ok_or(NoEstimate::Imbalance)?;
        let doubt = self.settings.load_loss_doubt(stage).unwrap_or(LoadLossDoubt::NOT_COMMISSIONED);
        let by_loss_w = doubt.cutting_sd_w(&law, &split, speed_rpm);
        let varies_w = by_loss_w.min(LOSS_VARIES_SD * split.slope * split.cutting_power_w);
        let cutting = Estimate { value: split.cutting_power_w, sd: (split.slope * excess_sd_w).hypot(by_loss_w) };
        let loss = Estimate { value: split.load_loss_w, sd: ((1.0 - split.slope) * excess_sd_w).hypot(by_loss_w) };
        let common_sd_w = (by_loss_w * by_loss_w - varies_w * varies_w).max(0.0).sqrt();
        Ok(PowerParts { cutting_power_w: cutting, load_loss_w: loss, common_sd_w })
    }

    /// Cutting power that would be noticed within one window.
    pub(super) fn least_visible(&self, no_load: Result<NoLoad, NoEstimate>, speed_rpm: f64) -> Estimated {
        let known = no_load?;
        let signals = &self.state.signals;
        let noise_w = signals.noise.sd() * known.power_w;
        let excess_w = visible_excess_w(known, signals, &self.settings)
            + self.settings.cutting_evidence * noise_w / self.settings.window_samples;
        let load_loss = self.settings.load_loss(signals.stage());
        let split = load_loss.split_excess_power(excess_w, speed_rpm).ok_or(NoEstimate::Imbalance)?;
        Ok(Estimate { value: split.cutting_power_w, sd: split.slope * known.sd_w })
    }
}
