//! A law that goes on learning from a probe: every reading corrects it by a bounded step.
//!
//! Method: recursive least squares with the covariance of identification (Kalman update of intercept and coefficients), so a
//! reading moves most what is known least. Between readings the level of the machine wanders (a chuck is changed, a probe is
//! calibrated anew), so the variance of the intercept grows with every reading. A reading may be wrong - a chip under the
//! probe - so one alone moves the prediction by [`FollowSettings::step_um`] at most, and all together by
//! [`FollowSettings::total_um`]: beyond that the law is not corrected any more but has to be identified again.

use super::law::ThermalLaw;
use super::predictor::{PredictedAndMeasured, Predictor, ThermalPrediction};
use adapter_core::Absence;
use serde::{Deserialize, Serialize};

/// The level wanders by this share of the residual deviation from reading to reading.
const WANDERS: f64 = 0.5;
/// Lagged states whose beginning was guessed teach nothing until so much of it is forgotten.
const SETTLED: f64 = 0.05;

/// How far readings may move the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowSettings {
    /// Greatest change of the prediction by one reading, um.
    pub step_um: f64,
    /// Greatest change of the prediction by all readings, um.
    pub total_um: f64,
}

/// A law as it was identified and as readings have corrected it. What is stored between runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Corrected {
    /// The law before any reading corrected it.
    pub identified: ThermalLaw,
    /// The law with every reading so far: the one to predict with.
    pub law: ThermalLaw,
    /// Readings that corrected it.
    pub readings: u64,
}

/// What became of a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correction {
    /// Measured, predicted and residual before the correction.
    pub compared: PredictedAndMeasured,
    /// Change of the prediction, um.
    pub change_um: f64,
    /// What held the change back, if something did.
    pub held: Option<HoldReason>,
}

/// Why a reading did not correct the law, or not in full.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HoldReason {
    /// There is no reading.
    NoReading,
    /// The temperatures lie outside those of identification.
    Outside,
    /// The states of lagged temperatures still depend on how they were taken to begin.
    Unsettled,
    /// One reading moves the law by a step at most.
    Step,
    /// All readings together have moved the law as far as they may: identify it again.
    Total,
}

impl HoldReason {
    /// The word used in JSON and events.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::NoReading => "no_reading",
            Self::Outside => "outside",
            Self::Unsettled => "unsettled",
            Self::Step => "step",
            Self::Total => "total",
        }
    }
}

/// A predictor that readings correct.
#[derive(Debug, Clone)]
pub struct ThermalFollower {
    predictor: Predictor,
    identified: ThermalLaw,
    readings: u64,
    settings: FollowSettings,
}

impl ThermalFollower {
    /// Goes on with a law that readings may have corrected before, for temperatures that arrive in the order of `sensors`.
    ///
    /// # Errors
    /// A law that cannot be used, or a sensor of it that is not among `sensors`.
    pub fn new(
        corrected: Corrected,
        sensors: &[&str],
        settings: FollowSettings,
    ) -> Result<Self, crate::regression::Refusal> {
        corrected.identified.check_consistency()?;
        let predictor = Predictor::new(corrected.law, sensors)?;
        Ok(Self { predictor, identified: corrected.identified, readings: corrected.readings, settings })
    }

    /// The predictor, to take the temperatures of a tick.
    pub fn predictor_mut(&mut self) -> &mut Predictor {
        &mut self.predictor
    }

    /// What is to be stored.
    #[must_use]
    pub fn to_corrected_law(&self) -> Corrected {
        let law = self.predictor.law().clone();
        Corrected { identified: self.identified.clone(), law, readings: self.readings }
    }

    /// Readings that corrected the law.
    #[must_use]
    pub fn readings(&self) -> u64 {
        self.readings
    }

    /// Takes a reading of the error that belongs to `prediction`, the last one of the predictor.
    pub fn correct_with_reading(
        &mut self,
        prediction: &ThermalPrediction,
        measured_um: Result<f64, Absence>,
    ) -> Correction {
        let compared = prediction.compare_with_measured(measured_um);
        let nothing = |held| Correction { compared, change_um: 0.0, held: Some(held) };
        let Ok(residual) = compared.residual_um else { return nothing(HoldReason::NoReading) };
        if !prediction.is_inside_range() {
            return nothing(HoldReason::Outside);
        }
        if self.predictor.unsettled_share() > SETTLED {
            return nothing(HoldReason::Unsettled);
        }
        let point = self.predictor.point.clone();
        let law = self.predictor.law();
        let moved_um = law.error_um(&point) - self.identified.error_um(&point);
        let (gain, product, through) = compute_gain(law, &point);
        let full_um = through * residual.value;
        let step_um = full_um.clamp(-self.settings.step_um, self.settings.step_um);
        let total_um = self.settings.total_um;
        let change_um =
            (moved_um + step_um).clamp(-total_um.max(moved_um.abs()), total_um.max(moved_um.abs())) - moved_um;
        let held = match () {
            () if (change_um - step_um).abs() > 1e-9 => Some(HoldReason::Total),
            () if (step_um - full_um).abs() > 1e-9 => Some(HoldReason::Step),
            () => None,
        };
        let share = if through > 0.0 { change_um / through } else { 0.0 };
        // The level that wanders is no sign of strange temperatures: what counts as outside is judged with its doubt added.
        let known_um = self.identified.law_sd_max_um.hypot(self.identified.residual_sd_um);
        self.predictor.law_mut().law_sd_max_um = known_um;
        correct_law(self.predictor.law_mut(), &gain, &product, share);
        self.readings += 1;
        Correction { compared, change_um, held }
    }
}

/// Gain of every coefficient, covariance times point, and the change of the prediction per micrometre of residual.
fn compute_gain(law: &ThermalLaw, point: &[f64]) -> (Vec<f64>, Vec<f64>, f64) {
    let wander = WANDERS * law.residual_sd_um;
    let product = |row: usize| {
        let known: f64 = law.covariance[row].iter().zip(point).map(|(entry, x)| entry * x).sum();
        known + if row == 0 { wander * wander } else { 0.0 }
    };
    let product: Vec<f64> = (0..point.len()).map(product).collect();
    let of_law: f64 = product.iter().zip(point).map(|(entry, x)| entry * x).sum();
    let total = (of_law + law.residual_sd_um * law.residual_sd_um).max(f64::MIN_POSITIVE);
    let gain: Vec<f64> = product.iter().map(|entry| entry / total).collect();
    (gain, product, of_law / total)
}

/// `residual_um` is that of the reading, or less of it where the step is bounded.
fn correct_law(law: &mut ThermalLaw, gain: &[f64], product: &[f64], residual_um: f64) {
    let wander = WANDERS * law.residual_sd_um;
    law.intercept_um += gain[0] * residual_um;
    for (term, gain) in law.terms.iter_mut().zip(&gain[1..]) {
        term.um_per_k += gain * residual_um;
    }
    law.covariance[0][0] += wander * wander;
    for (row, gain) in law.covariance.iter_mut().zip(gain) {
        for (entry, product) in row.iter_mut().zip(product) {
            *entry -= gain * product;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::law::{Path, ThermalTerm};
    use super::*;
    use adapter_core::clock::SECOND_NS;

    fn law() -> ThermalLaw {
        let term = ThermalTerm {
            sensor: "bearing_temperature_c".to_owned(),
            path: Path::Direct,
            um_per_k: 2.0,
            interval: (1.8, 2.2),
            range_c: (20.0, 50.0),
        };
        ThermalLaw {
            intercept_um: -40.0,
            intercept_interval: (-42.0, -38.0),
            tau_s: None,
            tau_interval_s: None,
            residual_sd_um: 1.0,
            law_sd_max_um: 3.0,
            lag_spread_k: 0.0,
            terms: vec![term],
            covariance: vec![vec![12.5, -0.35], vec![-0.35, 0.01]],
        }
    }

    fn follower(step_um: f64, total_um: f64) -> ThermalFollower {
        let corrected = Corrected { identified: law(), law: law(), readings: 0 };
        let settings = FollowSettings { step_um, total_um };
        ThermalFollower::new(corrected, &["bearing_temperature_c"], settings).expect("a law")
    }

    /// Readings of a machine whose error is `scale` times the law plus `shift_um`, at temperatures that go up and down.
    fn read(follower: &mut ThermalFollower, readings: i64, scale: f64, shift_um: f64) -> f64 {
        let mut last = 0.0;
        for k in 0..readings {
            let temperature_c = 35.0 + 10.0 * (k as f64 * 0.9).sin();
            let prediction =
                follower.predictor_mut().predict_error(k * 600 * SECOND_NS, &[Ok(temperature_c)]).expect("there");
            let truth = scale * (2.0 * temperature_c - 40.0) + shift_um;
            last = follower.correct_with_reading(&prediction, Ok(truth)).compared.residual_um.expect("a reading").value;
        }
        last
    }

    #[test]
    fn readings_bring_a_shifted_and_scaled_machine_back() {
        let mut follower = follower(2.0, 40.0);
        let last = read(&mut follower, 40, 1.2, 6.0);
        assert!(last.abs() < 1.0, "{last}");
        assert_eq!(follower.readings(), 40);
    }

    #[test]
    fn a_law_that_is_known_exactly_follows_as_well() {
        let mut exact = law();
        exact.covariance = vec![vec![12.5e-4, -0.35e-4], vec![-0.35e-4, 0.01e-4]];
        exact.law_sd_max_um = 0.03;
        let corrected = Corrected { identified: exact.clone(), law: exact, readings: 0 };
        let settings = FollowSettings { step_um: 3.0, total_um: 40.0 };
        let mut follower = ThermalFollower::new(corrected, &["bearing_temperature_c"], settings).expect("a law");
        let last = read(&mut follower, 20, 1.0, 12.0);
        assert!(last.abs() < 1.0 && follower.readings() == 20, "{last} {}", follower.readings());
    }

    #[test]
    fn one_wrong_reading_moves_the_law_by_a_step() {
        let mut follower = follower(2.0, 40.0);
        let prediction = follower.predictor_mut().predict_error(0, &[Ok(30.0)]).expect("there");
        let correction = follower.correct_with_reading(&prediction, Ok(prediction.error_um.value + 500.0));
        assert_eq!((correction.held, correction.change_um.round()), (Some(HoldReason::Step), 2.0));
        let after = follower.predictor_mut().predict_error(SECOND_NS, &[Ok(30.0)]).expect("there");
        assert!((after.error_um.value - prediction.error_um.value - 2.0).abs() < 1e-9);
    }

    #[test]
    fn all_readings_together_are_bounded_and_a_reading_outside_teaches_nothing() {
        let mut follower = follower(2.0, 5.0);
        read(&mut follower, 60, 1.0, 100.0);
        let moved =
            follower.predictor_mut().predict_error(60 * 600 * SECOND_NS, &[Ok(35.0)]).expect("there").error_um.value
                - 30.0;
        assert!(moved < 7.0, "{moved}");
        let outside = follower.predictor_mut().predict_error(70 * 600 * SECOND_NS, &[Ok(80.0)]).expect("there");
        assert_eq!(follower.correct_with_reading(&outside, Ok(0.0)).held, Some(HoldReason::Outside));
        assert_eq!(
            follower.correct_with_reading(&outside, Err(Absence::NotRecorded)).held,
            Some(HoldReason::NoReading)
        );
    }
}
