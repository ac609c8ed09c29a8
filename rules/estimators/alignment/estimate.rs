//! Lag, width, drift and window over all transients, or why they cannot be known.

use super::fit::{FittedLag, PowerModel, PredictorSet, Ready, fit_transients, residual_sum_of_squares};
use super::profile::{Best, find_minimum, search_at, search_lags};
use super::speed::Transient;
use numerics::statistics::count_to_f64;
use std::fmt;

/// What is looked for and what is asked of an answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LagSettings {
    /// Least and greatest lag that is looked for, s.
    pub lags_s: (f64, f64),
    /// Longest averaging window of a meter, s.
    pub window_max_s: f64,
    /// Fewer transients give no answer.
    pub transients_min: usize,
    /// A transient changes the speed by at least this, rpm.
    pub change_min_rpm: f64,
    /// A change that takes longer than this at its steepest tells level rather than delay, s.
    pub rise_max_s: f64,
    /// The model explains at least this share of the power, or is no model of it.
    pub explained_min: f64,
    /// Changing the speed takes at least this share of the power's variance: only that part tells a delay from a level.
    pub inertia_share_min: f64,
    /// A 95 % interval wider than this on either side is no answer, s.
    pub uncertainty_max_s: f64,
}

impl Default for LagSettings {
    fn default() -> Self {
        Self {
            lags_s: (-0.6, 1.5),
            window_max_s: 1.3,
            transients_min: 4,
            change_min_rpm: 200.0,
            rise_max_s: 6.0,
            explained_min: 0.7,
            inertia_share_min: 0.05,
            uncertainty_max_s: 0.1,
        }
    }
}

/// A change of the lag over time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// The meter's clock runs slow against the controller's by so many parts per million.
    pub ppm: f64,
    /// Half its 95 % interval, ppm.
    pub uncertainty_ppm: f64,
}

/// The lag between two clocks, and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lag {
    /// Power stamped `t` belongs to the speed stamped `t - lag_s`; at `at_s` when there is a drift.
    pub lag_s: f64,
    /// Half its 95 % interval, s: the greatest of what the scatter of the transients, the residual's own curvature, and
    /// leaving a term out of the model say.
    pub uncertainty_s: f64,
    /// The time that the lag is for: the middle of the transients, s.
    pub at_s: f64,
    /// How the lag changes; `None` where the transients lie too close together in time to tell.
    pub drift: Option<Drift>,
    /// How long the meter averages, s.
    pub window_s: f64,
    /// What the power is made of.
    pub model: PowerModel,
    /// Time constant of the excess of a run-up in it, s.
    pub excess_tau_s: f64,
    /// Residual standard deviation, W.
    pub residual_w: f64,
    /// Share of the power's variance that is explained.
    pub explained: f64,
    /// Share of the power's variance that only changing the speed explains: what the lag is known from.
    pub inertia_share: f64,
    /// From so many transients.
    pub transients: usize,
}

impl Lag {
    /// The lag at another time, with its drift if that is known to be different from 0.
    #[must_use]
    pub fn predict_lag(&self, time_s: f64) -> f64 {
        let drift = self.drift.filter(|drift| drift.ppm.abs() > drift.uncertainty_ppm);
        self.lag_s + drift.map_or(0.0, |drift| 1e-6 * drift.ppm * (time_s - self.at_s))
    }
}

/// Why a lag cannot be known from what there is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NotIdentifiable {
    /// Too few changes of speed that are quick enough.
    TooFewTransients {
        /// How many there are.
        found: usize,
        /// How many are asked for.
        wanted: usize,
    },
    /// The model explains too little of the power: something else takes it.
    Unexplained {
        /// Share of the power's variance that the model explains, 0 to 1.
        explained: f64,
    },
    /// The speed changes too slowly to be felt in the power.
    TooSlow {
        /// Share of the power's variance that goes into changing the speed.
        inertia_share: f64,
    },
    /// The best lag lies at the end of the range that was looked at.
    OutOfRange {
        /// The end of the range at which it lies, s.
        lag_s: f64,
    },
    /// Another lag explains the power as well.
    Ambiguous {
        /// The best one, s.
        lag_s: f64,
        /// The other one, s.
        rival_s: f64,
    },
    /// The interval is too wide: the changes are too slow or too small.
    TooWide {
        /// Half the 95 % interval, s.
        uncertainty_s: f64,
    },
    /// It was known, and the last changes of speed say another one.
    Changed {
        /// The lag that was known, s.
        from_s: f64,
        /// What the last changes say, s.
        to_s: f64,
    },
}

impl NotIdentifiable {
    /// A stable word for programs.
    #[must_use]
    pub fn as_word(&self) -> &'static str {
        match self {
            Self::TooFewTransients { .. } => "too_few_transients",
            Self::Unexplained { .. } => "unexplained",
            Self::TooSlow { .. } => "too_slow",
            Self::OutOfRange { .. } => "out_of_range",
            Self::Ambiguous { .. } => "ambiguous",
            Self::TooWide { .. } => "too_wide",
            Self::Changed { .. } => "changed",
        }
    }
}

impl fmt::Display for NotIdentifiable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewTransients { found, wanted } => {
                write!(
                    f,
                    "{found} quick changes of spindle speed without cutting, {wanted} are needed: start and stop the spindle"
                )
            }
            Self::Unexplained { explained } => {
                write!(
                    f,
                    "speed explains {:.0} % of the power only: is this the meter of this machine?",
                    100.0 * explained
                )
            }
            Self::TooSlow { inertia_share } => {
                let percent = 100.0 * inertia_share;
                write!(
                    f,
                    "changing the speed takes {percent:.1} % of the variation of the power only: start and stop the spindle faster"
                )
            }
            Self::OutOfRange { lag_s } => write!(f, "the lag is beyond {lag_s:.1} s: check the clocks of the sources"),
            Self::Ambiguous { lag_s, rival_s } => {
                write!(
                    f,
                    "lags of {lag_s:.2} s and {rival_s:.2} s explain the power alike: vary the speeds and the pauses"
                )
            }
            Self::Changed { from_s, to_s } => {
                write!(f, "it was {from_s:.2} s and is about {to_s:.2} s now; it is estimated anew")
            }
            Self::TooWide { uncertainty_s } => {
                write!(
                    f,
                    "known to {uncertainty_s:.2} s only: the speed changes too slowly; start and stop the spindle"
                )
            }
        }
    }
}

/// Places of coefficients in the model.
const INERTIA: usize = 4;
const EXCESS: usize = 6;
/// Time constants of the excess of a run-up that are tried, s.
const EXCESS_TAU_S: [f64; 3] = [0.25, 0.6, 1.2];
/// Where the excess takes no part its time constant does not matter.
const NO_EXCESS_TAU_S: f64 = 1.0;
/// An excess must take away this share of the residual to be believed.
const EXCESS_SHARE: f64 = 0.1;
/// Transients over less than this tell nothing of a drift, s.
const DRIFT_SPAN_S: f64 = 60.0;
/// What reading ramps ten times a second and drawing straight lines between leaves, s.
const SAMPLING_S: f64 = 0.008;
/// Two-sided 95 % of a normal distribution.
const Z95: f64 = 1.96;

/// Lag, window and drift from all transients together.
///
/// # Errors
/// [`NotIdentifiable`]: why it cannot be known, and what to do.
pub fn estimate_lag(transients: &[Transient], settings: &LagSettings) -> Result<Lag, NotIdentifiable> {
    let usable: Vec<&Transient> = transients.iter().filter(|transient| is_usable(transient, settings)).collect();
    if usable.len() < settings.transients_min {
        return Err(NotIdentifiable::TooFewTransients { found: usable.len(), wanted: settings.transients_min });
    }
    let Joint { ready, best, excess_tau_s } = fit_jointly(&usable, settings);
    let explained = 1.0 - best.fitted.rss / best.fitted.total.max(f64::MIN_POSITIVE);
    if explained < settings.explained_min || best.fitted.model[INERTIA] <= 0.0 {
        return Err(NotIdentifiable::Unexplained { explained });
    }
    let inertia_share = inertia_share(&ready, &best);
    if inertia_share < settings.inertia_share_min {
        return Err(NotIdentifiable::TooSlow { inertia_share });
    }
    if best.at_end {
        return Err(NotIdentifiable::OutOfRange { lag_s: best.lag_s });
    }
    let lags = fit_each_transient(&ready, &best);
    let line = Line::fit_weighted_lags(&lags);
    let of_noise_s = line.uncertainty.max(curvature_s(&ready, &best, lags.len()));
    let uncertainty_s = of_noise_s.max(of_model_s(&ready, &best)).hypot(SAMPLING_S);
    if let Some((rival_s, _)) = best.rival.filter(|(_, rss)| as_good(*rss, &best.fitted)) {
        return Err(NotIdentifiable::Ambiguous { lag_s: best.lag_s, rival_s });
    }
    if uncertainty_s > settings.uncertainty_max_s {
        return Err(NotIdentifiable::TooWide { uncertainty_s });
    }
    Ok(Lag {
        lag_s: line.level,
        uncertainty_s,
        at_s: line.at_s,
        drift: line.drift,
        window_s: best.window_s,
        model: best.fitted.power_model(),
        excess_tau_s,
        residual_w: (best.fitted.rss / count_to_f64(best.fitted.rows)).sqrt(),
        explained,
        inertia_share,
        transients: lags.len(),
    })
}

fn is_usable(transient: &Transient, settings: &LagSettings) -> bool {
    let (least, greatest) = transient.range_rpm();
    let quick = greatest - least <= settings.rise_max_s * transient.steepest_rpm_s();
    quick && greatest - least >= settings.change_min_rpm && transient.power.len() >= 10 && transient.speed.len() >= 10
}

/// Lag and window that fit all transients best.
struct Joint {
    ready: Vec<Ready>,
    best: Best,
    excess_tau_s: f64,
}

/// The best lag and window, with the excess of a run-up where it is really there.
fn fit_jointly(usable: &[&Transient], settings: &LagSettings) -> Joint {
    let top_rpm = usable.iter().map(|transient| transient.range_rpm().1).fold(0.0, f64::max);
    let make = |tau_s: f64| -> Vec<Ready> {
        usable
            .iter()
            .map(|one| Ready::from_transient(one, top_rpm, tau_s, settings.lags_s, settings.window_max_s))
            .collect()
    };
    let plain = make(NO_EXCESS_TAU_S);
    let best = search_lags(
        &plain,
        settings.lags_s,
        settings.window_max_s,
        PredictorSet { excess: false, ..PredictorSet::WHOLE },
    );
    let with_excess = EXCESS_TAU_S.into_iter().map(|tau_s| {
        let (ready, shape) = (make(tau_s), PredictorSet::WHOLE);
        let best = search_at(&ready, settings.lags_s, &[best.window_s], shape, settings.window_max_s);
        Joint { ready, best, excess_tau_s: tau_s }
    });
    let other = with_excess.min_by(|a, b| a.best.fitted.rss.total_cmp(&b.best.fitted.rss));
    match other.filter(|other| other.best.fitted.rss < (1.0 - EXCESS_SHARE) * best.fitted.rss) {
        Some(found) => found,
        None => Joint { ready: plain, best, excess_tau_s: NO_EXCESS_TAU_S },
    }
}

fn select_predictors(best: &Best) -> PredictorSet {
    PredictorSet { excess: best.fitted.model[EXCESS] != 0.0, ..PredictorSet::WHOLE }
}

/// Share of the power's variance that only changing the speed explains.
fn inertia_share(ready: &[Ready], best: &Best) -> f64 {
    let without =
        fit_transients(ready, best.lag_s, best.window_s, PredictorSet { inertia: false, ..select_predictors(best) });
    (without.rss - best.fitted.rss) / best.fitted.total.max(f64::MIN_POSITIVE)
}

/// How far the lag moves when a term of the no-load power is left out: what an imperfect law may do to it.
fn of_model_s(ready: &[Ready], best: &Best) -> f64 {
    let moved_s = |without: PredictorSet| {
        let rss = |lag_s: f64| fit_transients(ready, lag_s, best.window_s, without).rss;
        let lag_s = find_minimum(best.lag_s, 0.05, (best.lag_s - 0.5, best.lag_s + 0.5), rss);
        (lag_s - best.lag_s).abs()
    };
    moved_s(PredictorSet { cube: false, ..select_predictors(best) })
        .max(0.5 * moved_s(PredictorSet { turning: false, ..select_predictors(best) }))
}

/// Time and lag of each transient under the common model, with the weight of its residual's curvature.
fn fit_each_transient(ready: &[Ready], best: &Best) -> Vec<(f64, f64, f64)> {
    let model = &best.fitted.model;
    let of_one = |one: &Ready| {
        let rss = |lag_s: f64| residual_sum_of_squares(one, model, lag_s, best.window_s);
        let lag_s = find_minimum(best.lag_s, 0.04, (best.lag_s - 0.3, best.lag_s + 0.3), rss);
        let step_s = 0.05;
        let bend = rss(lag_s + step_s) + rss(lag_s - step_s) - 2.0 * rss(lag_s);
        (one.middle_s, lag_s, bend.max(0.0))
    };
    ready.iter().filter(|one| one.rows() >= 5).map(of_one).filter(|(_, _, bend)| *bend > 0.0).collect()
}

/// A residual that noise alone could make as small as the least one (F-like bound, generous for correlated residuals).
fn as_good(rss: f64, fitted: &FittedLag) -> bool {
    let freedom = (count_to_f64(fitted.rows) / 4.0 - 8.0).max(4.0);
    rss <= fitted.rss * (1.0 + 8.0 / freedom)
}

/// Half the 95 % interval from the curvature of the common residual, the noise taken as remembered over four readings.
fn curvature_s(ready: &[Ready], best: &Best, transients: usize) -> f64 {
    let (step_s, shape) = (0.03, select_predictors(best));
    let rss = |lag_s: f64| fit_transients(ready, lag_s, best.window_s, shape).rss;
    let bend = (rss(best.lag_s + step_s) + rss(best.lag_s - step_s) - 2.0 * best.fitted.rss) / (step_s * step_s);
    let freedom = (count_to_f64(best.fitted.rows) - 8.0).max(1.0);
    let variance = best.fitted.rss / freedom;
    let student = 1.0 + 2.5 / count_to_f64(transients).max(2.0);
    if bend > 0.0 { student * Z95 * (2.0 * 4.0 * variance / bend).sqrt() } else { f64::INFINITY }
}

/// Lag over time: level, its interval, and the slope where the times allow one.
struct Line {
    level: f64,
    uncertainty: f64,
    at_s: f64,
    drift: Option<Drift>,
}

impl Line {
    fn fit_weighted_lags(lags: &[(f64, f64, f64)]) -> Self {
        let weight: f64 = lags.iter().map(|(.., weight)| weight).sum();
        let mean = |of: &dyn Fn(&(f64, f64, f64)) -> f64| lags.iter().map(|lag| lag.2 * of(lag)).sum::<f64>() / weight;
        let (at_s, level) = (mean(&|lag| lag.0), mean(&|lag| lag.1));
        let spread = mean(&|lag| (lag.0 - at_s).powi(2));
        let slope = if spread > 0.0 { mean(&|lag| (lag.0 - at_s) * (lag.1 - level)) / spread } else { 0.0 };
        let span_s = lags.iter().map(|lag| (lag.0 - at_s).abs()).fold(0.0, f64::max);
        let sloped = span_s > 0.5 * DRIFT_SPAN_S && lags.len() >= 4;
        let used = if sloped { slope } else { 0.0 };
        let scatter = mean(&|lag| (lag.1 - level - used * (lag.0 - at_s)).powi(2));
        // Effective number of transients, as Kish counts unequal weights.
        let squares: f64 = lags.iter().map(|(.., weight)| weight * weight).sum();
        let effective = (weight * weight / squares.max(f64::MIN_POSITIVE)).max(1.0);
        let freedom = (effective - if sloped { 2.0 } else { 1.0 }).max(0.5);
        let student = Z95 * (1.0 + 1.5 / freedom);
        let variance = scatter * effective / freedom;
        let uncertainty = student * (variance / effective).sqrt();
        let drift = sloped.then(|| Drift {
            ppm: 1e6 * slope,
            uncertainty_ppm: 1e6 * student * (variance / effective / spread).sqrt(),
        });
        Self { level, uncertainty, at_s, drift }
    }
}
