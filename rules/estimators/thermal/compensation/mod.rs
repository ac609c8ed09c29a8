//! From a predicted thermal error to the increments that a controller is sent.
//!
//! The wanted value is the error with its sign turned, clamped; it follows the prediction only when that has left a dead
//! band, moves no faster than a slew limit, and is sent in whole pulses (or least increments of an external offset). The
//! fraction of a pulse that cannot be sent is carried, so that the sum of all increments is never more than one pulse
//! away from the value in force. Source: pulse insertion, N = E / pulse equivalent; that increments are sent and a
//! remainder carried is what the source leaves open.
//!
//! Without a prediction the value in force stands: heat does not jump. In bypass, and after `hold_s` without a prediction, it goes
//! back to zero at the slew limit. Temperatures outside those of the identification are no reason to withhold the compensation: the
//! law is followed with a wider deviation, far outside at the value of the edge, and where the deviation is as great as what would be
//! compensated the value in force stands. After a reference return the controller has forgotten every inserted pulse, and the value is sent anew.

use super::predictor::ThermalPrediction;
use serde::{Deserialize, Serialize};

/// Limits of the compensation; every length in micrometres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompensationSettings {
    /// Length of one pulse or least increment, um.
    pub pulse_um: f64,
    /// Greatest compensation to either side, um.
    pub limit_um: f64,
    /// Greatest change, um per second.
    pub slew_um_per_s: f64,
    /// Changes of the prediction below this are not followed, um.
    pub dead_band_um: f64,
    /// How long the value in force stands without a prediction before it goes back to zero, s.
    pub hold_s: f64,
    /// Does a positive increment move the tool towards positive error?
    pub positive_moves_along_error: bool,
}

impl Default for CompensationSettings {
    /// 1 um pulses, at most 100 um, 0.5 um/s, dead band 1 um, ten minutes.
    fn default() -> Self {
        Self {
            pulse_um: 1.0,
            limit_um: 100.0,
            slew_um_per_s: 0.5,
            dead_band_um: 1.0,
            hold_s: 600.0,
            positive_moves_along_error: true,
        }
    }
}

/// A setting that cannot work.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("compensation: {name} = {value}, but {need}")]
pub struct CompensationSettingError {
    /// Name of the field of [`CompensationSettings`].
    pub name: &'static str,
    /// The number given, in the unit of that field.
    pub value: f64,
    /// What it must be.
    pub need: &'static str,
}

impl CompensationSettings {
    /// # Errors
    /// The first setting that cannot work, millimetres given for micrometres among them.
    pub fn check_values(&self) -> Result<(), CompensationSettingError> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        let wrong = |name, value, need| Err(CompensationSettingError { name, value, need });
        if !positive(self.pulse_um) || self.pulse_um > 100.0 {
            return wrong("pulse_um", self.pulse_um, "a pulse is between 0 and 100 um long");
        }
        if !positive(self.limit_um) || self.limit_um < self.pulse_um || self.limit_um > 1000.0 {
            return wrong("limit_um", self.limit_um, "the limit lies between one pulse and 1000 um (is it in mm?)");
        }
        if !positive(self.slew_um_per_s) {
            return wrong("slew_um_per_s", self.slew_um_per_s, "a slew limit is greater than zero");
        }
        if !(0.0..self.limit_um).contains(&self.dead_band_um) {
            return wrong("dead_band_um", self.dead_band_um, "a dead band is zero or more and less than the limit");
        }
        if !(self.hold_s.is_finite() && self.hold_s >= 0.0) {
            return wrong("hold_s", self.hold_s, "a duration is zero or more");
        }
        Ok(())
    }
}

/// Why the compensation does not follow a prediction now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Standing {
    /// Nothing stands in the way: the value follows the prediction.
    Follows,
    /// The prediction moved less than the dead band.
    DeadBand,
    /// There is no prediction: the value stands.
    NoPrediction,
    /// The temperatures lie outside the range of identification: it follows, with a wider deviation.
    Extrapolated,
    /// They lie far outside: the value is that of the edge up to which the law goes on.
    AtTheEdge,
    /// The deviation of the prediction is as great as the error that it predicts: the value stands.
    Doubted,
    /// There has been no prediction for longer than `hold_s`: back to zero.
    HeldTooLong,
    /// Switched off: back to zero.
    Bypass,
    /// The axis returns to its reference: nothing is sent.
    ReferenceReturn,
}

impl Standing {
    /// The word used in JSON and SQL.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Follows => "follows",
            Self::DeadBand => "dead_band",
            Self::NoPrediction => "no_prediction",
            Self::Extrapolated => "extrapolated",
            Self::AtTheEdge => "at_the_edge",
            Self::Doubted => "doubted",
            Self::HeldTooLong => "held_too_long",
            Self::Bypass => "bypass",
            Self::ReferenceReturn => "reference_return",
        }
    }
}

/// What one step of the compensation yields.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompensationStep {
    /// Pulses to insert now, positive or negative.
    pub increment_pulses: i64,
    /// The sum of all pulses since the last reference return, um.
    pub sent_um: f64,
    /// The value in force, after clamp, dead band and slew, um.
    pub value_um: f64,
    /// `value_um` less `sent_um`: less than one pulse.
    pub remainder_um: f64,
    /// The wanted value was cut at the limit.
    pub clamped: bool,
    /// Does it follow the prediction, and if not, why.
    pub standing: Standing,
}

/// What the machine is doing, as far as the compensation must know.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AxisSituation {
    /// Compensation is switched off.
    pub bypass: bool,
    /// The axis is returning to its reference.
    pub reference_return: bool,
}

/// The longest step that counts in full: after a pause the value must not jump.
const STEP_S_MAX: f64 = 1.0;

/// Turns predictions into increments.
#[derive(Debug, Clone, PartialEq)]
pub struct Compensator {
    settings: CompensationSettings,
    target_um: f64,
    value_um: f64,
    sent_pulses: i64,
    without_s: f64,
    clamped: bool,
}

impl Compensator {
    /// A compensator that has sent nothing.
    ///
    /// # Errors
    /// A setting that cannot work.
    pub fn new(settings: CompensationSettings) -> Result<Self, CompensationSettingError> {
        settings.check_values()?;
        Ok(Self { settings, target_um: 0.0, value_um: 0.0, sent_pulses: 0, without_s: 0.0, clamped: false })
    }

    /// One step, `dt_s` after the one before.
    pub fn advance_compensation(
        &mut self,
        dt_s: f64,
        prediction: Option<&ThermalPrediction>,
        axis: AxisSituation,
    ) -> CompensationStep {
        let dt_s = if dt_s.is_finite() { dt_s.max(0.0) } else { 0.0 };
        if axis.reference_return {
            // The controller takes the reference as it is: what was inserted before is gone.
            self.sent_pulses = 0;
            self.value_um = 0.0;
            return self.report_step(0, Standing::ReferenceReturn);
        }
        let standing = self.update_target(dt_s, prediction, axis.bypass);
        let most_um = self.settings.slew_um_per_s * dt_s.min(STEP_S_MAX);
        self.value_um += (self.target_um - self.value_um).clamp(-most_um, most_um);
        let missing = self.value_um / self.settings.pulse_um - self.sent_pulses as f64;
        #[expect(clippy::cast_possible_truncation, reason = "at most limit / pulse, which the settings bound")]
        let increment = missing.trunc() as i64;
        self.sent_pulses += increment;
        self.report_step(increment, standing)
    }

    /// Sets the target and tells whether the prediction is followed.
    fn update_target(&mut self, dt_s: f64, prediction: Option<&ThermalPrediction>, bypass: bool) -> Standing {
        if bypass {
            return self.go_home(Standing::Bypass);
        }
        let Some(prediction) = prediction.filter(|it| it.safe_um.is_finite()) else {
            self.without_s += dt_s;
            if self.without_s > self.settings.hold_s {
                return self.go_home(Standing::HeldTooLong);
            }
            self.target_um = self.value_um;
            return Standing::NoPrediction;
        };
        self.without_s = 0.0;
        if prediction.outside.is_some()
            && prediction.error_um.sd > prediction.safe_um.abs().max(self.settings.dead_band_um)
        {
            self.target_um = self.value_um;
            return Standing::Doubted;
        }
        let followed = self.follow_error(prediction.safe_um);
        match prediction.outside {
            Some(_) if prediction.is_at_the_edge() => Standing::AtTheEdge,
            Some(_) => Standing::Extrapolated,
            None => followed,
        }
    }

    fn follow_error(&mut self, error_um: f64) -> Standing {
        let against = if self.settings.positive_moves_along_error { -error_um } else { error_um };
        let wanted = against.clamp(-self.settings.limit_um, self.settings.limit_um);
        self.clamped = wanted != against;
        if (wanted - self.target_um).abs() <= self.settings.dead_band_um {
            return Standing::DeadBand;
        }
        self.target_um = wanted;
        Standing::Follows
    }

    fn go_home(&mut self, why: Standing) -> Standing {
        self.target_um = 0.0;
        self.clamped = false;
        why
    }

    fn report_step(&self, increment_pulses: i64, standing: Standing) -> CompensationStep {
        let sent_um = self.sent_pulses as f64 * self.settings.pulse_um;
        let remainder_um = self.value_um - sent_um;
        let (value_um, clamped) = (self.value_um, self.clamped);
        CompensationStep { increment_pulses, sent_um, value_um, remainder_um, clamped, standing }
    }
}

#[cfg(test)]
mod tests;
