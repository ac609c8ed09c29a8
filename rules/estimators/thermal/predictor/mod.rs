//! The law at work: every tick an error with its uncertainty, measured beside predicted, without allocating.

use super::law::{Path, TERMS_MAX, ThermalLaw, first_order};
use crate::estimate::Estimate;
use crate::regression::{Refusal, RefusalKind};
use adapter_core::Absence;
use std::fmt;

/// A reading above this was meant in kelvin: no part of a machine tool that holds a sensor is so hot in °C.
const KELVIN_FROM_C: f64 = 200.0;
/// A temperature may leave the range of identification by this share of it, and at least by this much.
const MARGIN_SHARE: f64 = 0.05;
const MARGIN_K: f64 = 0.5;
/// The law goes on beyond the range of a sensor for this share of the range. Farther out it is held at that point: a straight line that
/// was seen over 20 K is no worse at 8 K more than nothing at all, at 40 K it may be.
const FAR_SHARE: f64 = 0.5;
/// Beyond its range a coefficient may be another one by this share, one standard deviation: heat transfer is not linear.
const SLOPE_DOUBT: f64 = 0.25;
/// The law's own deviation may exceed the greatest during identification by this factor.
const LAW_SD_FACTOR: f64 = 1.5;
/// A residual beyond this many standard deviations contradicts the law.
const CONTRADICTION_SD: f64 = 3.0;

/// Why there is no prediction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoPrediction {
    /// A sensor of the law gives no value.
    Missing {
        /// Position among the sensors given to [`Predictor::new`].
        sensor: usize,
        /// Why it gives none.
        absence: Absence,
    },
    /// A sensor gives kelvin.
    Kelvin {
        /// Position among the sensors.
        sensor: usize,
    },
    /// Fewer temperatures were given than there are sensors.
    TooFew,
}

impl NoPrediction {
    /// The word used in JSON and SQL.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Missing { .. } => "input_missing",
            Self::Kelvin { .. } => "kelvin",
            Self::TooFew => "mismatch",
        }
    }
}

impl fmt::Display for NoPrediction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing { sensor, absence } => write!(f, "temperature {} is missing: {absence}", sensor + 1),
            Self::Kelvin { sensor } => {
                write!(f, "temperature {} is above {KELVIN_FROM_C} °C: is it in kelvin? subtract 273.15", sensor + 1)
            }
            Self::TooFew => f.write_str("there are fewer temperatures than sensors in the law"),
        }
    }
}

/// What lies outside of what the law was learned from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outside {
    /// One temperature lies outside what was seen during identification.
    Sensor {
        /// Position among the sensors.
        sensor: usize,
        /// The temperature now, °C.
        temperature_c: f64,
        /// What was seen during identification, °C.
        range_c: (f64, f64),
    },
    /// Each temperature lies inside, all together do not.
    Combination,
}

/// A predicted thermal error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThermalPrediction {
    /// The error, um, with the standard deviation of a single measurement around it.
    pub error_um: Estimate,
    /// Standard deviation of the law itself at this point, from the intervals of its coefficients, um.
    pub law_sd_um: f64,
    /// The error that may be compensated, um: that of the law, but not farther outside of its range than the law goes on.
    pub safe_um: f64,
    /// Set where this is an extrapolation; the deviation of `error_um` is wider then.
    pub outside: Option<Outside>,
}

impl ThermalPrediction {
    /// Do all temperatures lie within the range of identification?
    #[must_use]
    pub fn is_inside_range(&self) -> bool {
        self.outside.is_none()
    }

    /// Farther outside than the law goes on: `safe_um` is that of the edge.
    #[must_use]
    pub fn is_at_the_edge(&self) -> bool {
        self.safe_um != self.error_um.value
    }

    /// Measured and residual beside this prediction.
    #[must_use]
    pub fn compare_with_measured(&self, measured_um: Result<f64, Absence>) -> PredictedAndMeasured {
        let measured_um =
            measured_um.and_then(|value| if value.is_finite() { Ok(value) } else { Err(Absence::OutOfRange) });
        let residual_um =
            measured_um.map(|measured| Estimate { value: measured - self.error_um.value, sd: self.error_um.sd });
        let contradicts = residual_um.is_ok_and(|it| it.value.abs() > CONTRADICTION_SD * it.sd);
        PredictedAndMeasured { measured_um, predicted: *self, residual_um, contradicts }
    }
}

/// Measured, predicted and residual, side by side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PredictedAndMeasured {
    /// The measured error, um, or why there is none.
    pub measured_um: Result<f64, Absence>,
    /// What the law says at the same time.
    pub predicted: ThermalPrediction,
    /// Measured less predicted, um, with the deviation that is expected of it.
    pub residual_um: Result<Estimate, Absence>,
    /// The residual is greater than three of its deviations.
    pub contradicts: bool,
}

/// A law bound to the order in which temperatures arrive.
#[derive(Debug, Clone)]
pub struct Predictor {
    law: ThermalLaw,
    /// For every term, the position of its sensor.
    sensor_of: Vec<usize>,
    sensors: usize,
    /// For every term, temperature and state after the last complete sample.
    last: Vec<(f64, f64)>,
    last_ns: Option<i64>,
    /// What is left of a wrong beginning of the states, 1 to 0.
    unsettled: f64,
    /// The point of the last prediction: one, then a temperature or a state per term.
    pub(super) point: Vec<f64>,
}

impl Predictor {
    /// A predictor for temperatures that arrive in the order of `sensors`.
    ///
    /// # Errors
    /// A law that cannot be used, or a sensor of it that is not among `sensors`.
    pub fn new(law: ThermalLaw, sensors: &[&str]) -> Result<Self, Refusal> {
        law.check_consistency()?;
        let position = |name: &str| {
            let next = "connect the sensor, or identify the law again without it";
            let missing = || Refusal::new(RefusalKind::Missing, "no source delivers it", next).with_place(name);
            sensors.iter().position(|sensor| *sensor == name).ok_or_else(missing)
        };
        let sensor_of = law.terms.iter().map(|term| position(&term.sensor)).collect::<Result<Vec<usize>, _>>()?;
        let last = vec![(0.0, 0.0); law.terms.len()];
        Ok(Self {
            law,
            sensor_of,
            sensors: sensors.len(),
            last,
            last_ns: None,
            unsettled: 1.0,
            point: Vec::with_capacity(TERMS_MAX + 1),
        })
    }

    /// The law, to correct it by a reading.
    pub(super) fn law_mut(&mut self) -> &mut ThermalLaw {
        &mut self.law
    }

    /// Standard deviation of a beginning of the lagged states that was guessed, as a share of what it was; 0 once forgotten.
    #[must_use]
    pub fn unsettled_share(&self) -> f64 {
        if self.law.tau_s.is_some() { self.unsettled } else { 0.0 }
    }

    /// The law that it predicts with.
    #[must_use]
    pub fn law(&self) -> &ThermalLaw {
        &self.law
    }

    /// The error at `at_ns` with these temperatures in °C. Lagged states move on with every complete sample; over a gap
    /// they follow the straight line between the temperatures before and after it.
    ///
    /// # Errors
    /// [`NoPrediction`] where a sensor of the law gives no value; sensors that the law does not use may be missing.
    pub fn predict_error(
        &mut self,
        at_ns: i64,
        temperatures_c: &[Result<f64, Absence>],
    ) -> Result<ThermalPrediction, NoPrediction> {
        if temperatures_c.len() < self.sensors {
            return Err(NoPrediction::TooFew);
        }
        let mut point = [1.0; TERMS_MAX + 1];
        for (slot, sensor) in point.iter_mut().skip(1).zip(&self.sensor_of) {
            *slot = check_temperature(*sensor, temperatures_c[*sensor])?;
        }
        let point = &mut point[..=self.law.terms.len()];
        let outside = self.find_outside_range(&point[1..]);
        self.advance_lagged_states(at_ns, &mut point[1..]);
        self.point.clear();
        self.point.extend_from_slice(point);
        Ok(self.evaluate_at(point, outside))
    }

    /// Replaces the temperatures of lagged terms by their states.
    fn advance_lagged_states(&mut self, at_ns: i64, values: &mut [f64]) {
        let dt_s = self.last_ns.map(|last_ns| at_ns.saturating_sub(last_ns) as f64 * 1e-9);
        let tau_s = self.law.tau_s.unwrap_or(0.0);
        for ((value, last), term) in values.iter_mut().zip(&mut self.last).zip(&self.law.terms) {
            let temperature = *value;
            // Before the first sample the machine is taken to have stood at this temperature.
            let state = dt_s.map_or(temperature, |dt_s| first_order(last.1, last.0, temperature, dt_s, tau_s));
            *last = if dt_s.is_none_or(|dt_s| dt_s > 0.0) { (temperature, state) } else { *last };
            if term.path == Path::Lagged {
                *value = state;
            }
        }
        self.unsettled *= dt_s.filter(|_| tau_s > 0.0).map_or(1.0, |dt_s| (-dt_s.max(0.0) / tau_s).exp());
        self.last_ns = Some(self.last_ns.map_or(at_ns, |last_ns| last_ns.max(at_ns)));
    }

    fn evaluate_at(&self, point: &[f64], outside: Option<Outside>) -> ThermalPrediction {
        let law_sd_um = self.law.law_sd_um(point);
        let lagged = self.law.terms.iter().filter(|term| term.path == Path::Lagged);
        let slope: f64 = lagged.map(|term| term.um_per_k.abs()).sum();
        let start_sd_um = self.unsettled * slope * self.law.lag_spread_k;
        // What blocks left out showed holds the law's own deviation already, at points that the law knows as well.
        let beyond = (law_sd_um / self.law.law_sd_max_um.max(f64::MIN_POSITIVE)).max(1.0);
        let (safe, outside_sd_um) = self.held_near(point);
        let sd = (beyond * self.law.residual_sd_um).hypot(start_sd_um).hypot(outside_sd_um);
        let together = beyond > LAW_SD_FACTOR;
        ThermalPrediction {
            error_um: Estimate { value: self.law.error_um(point), sd },
            law_sd_um,
            safe_um: self.law.error_um(&safe[..point.len()]),
            outside: outside.or(together.then_some(Outside::Combination)),
        }
    }

    /// The point, no farther outside of the range of identification than the law goes on; and what the way out adds to the deviation.
    fn held_near(&self, point: &[f64]) -> ([f64; TERMS_MAX + 1], f64) {
        let mut safe = [1.0; TERMS_MAX + 1];
        let mut variance = 0.0;
        for ((safe, value), term) in safe.iter_mut().skip(1).zip(&point[1..]).zip(&self.law.terms) {
            let (least, greatest) = term.range_c;
            let far_k = FAR_SHARE * (greatest - least);
            *safe = value.clamp(least - far_k, greatest + far_k);
            let beyond_k = (least - value).max(value - greatest).max(0.0);
            variance += (SLOPE_DOUBT * term.um_per_k * beyond_k).powi(2);
        }
        (safe, variance.sqrt())
    }

    fn find_outside_range(&self, temperatures_c: &[f64]) -> Option<Outside> {
        let terms = self.law.terms.iter().zip(temperatures_c).zip(&self.sensor_of);
        terms.into_iter().find_map(|((term, temperature_c), sensor)| {
            let (least, greatest) = term.range_c;
            let margin = margin_k(least, greatest);
            let inside = (least - margin..=greatest + margin).contains(temperature_c);
            let (sensor, temperature_c, range_c) = (*sensor, *temperature_c, term.range_c);
            (!inside).then_some(Outside::Sensor { sensor, temperature_c, range_c })
        })
    }
}

/// By how much a temperature may leave the range of identification.
pub(super) fn margin_k(least_c: f64, greatest_c: f64) -> f64 {
    (MARGIN_SHARE * (greatest_c - least_c)).max(MARGIN_K)
}

fn check_temperature(sensor: usize, temperature_c: Result<f64, Absence>) -> Result<f64, NoPrediction> {
    let value = temperature_c.map_err(|absence| NoPrediction::Missing { sensor, absence })?;
    if !value.is_finite() {
        return Err(NoPrediction::Missing { sensor, absence: Absence::OutOfRange });
    }
    if value > KELVIN_FROM_C { Err(NoPrediction::Kelvin { sensor }) } else { Ok(value) }
}

#[cfg(test)]
mod tests;
