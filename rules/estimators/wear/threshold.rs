//! Live: the power at which the edge is worn, and the wear that a measured power means.

use super::conditions::{ConditionFactor, CutConditions, WEAR};
use super::model::WearModel;
use super::power_prediction::Predicted;
use crate::estimate::Estimate;
use crate::regression::{Refusal, RefusalKind};
use serde::Serialize;

/// Share of the criterion that half the 95 % interval of a single wear estimate may have for the wear to count as
/// observable. Published case: at b = -1, c = 1 the power rises by 89 W per mm of wear and scatters by 37.6 W, so that one
/// standard deviation is 0.42 mm; there the wear cannot be seen.
pub const OBSERVABLE_SHARE: f64 = 0.5;
/// Parts that are pooled at most: an edge that makes fewer would be worn before its wear is seen.
pub const POOLED_PARTS_MAX: u32 = 30;

/// Can the wear be seen in the power of this cut?
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Observability {
    /// The interval of a single estimate is narrow against the criterion.
    Observable,
    /// Of a single part it is not, of the mean over [`PowerLimit::parts_to_observe`] parts it is.
    ObservableOverParts,
    /// It is not: an alarm would be chance. Observe at another cut of the part.
    NotObservableHere,
}

impl Observability {
    /// The word in JSON, scripts and SQL.
    #[must_use]
    pub fn as_word(self) -> &'static str {
        match self {
            Self::Observable => "observable",
            Self::ObservableOverParts => "observable_over_parts",
            Self::NotObservableHere => "not_observable_here",
        }
    }
}

/// The power limit `[Pc]` of one cut.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PowerLimit {
    /// Criterion of the flank wear, mm.
    pub criterion_mm: f64,
    /// Cutting power `[Pc]` of this cut with an edge worn to the criterion, W.
    pub power_w: f64,
    /// Standard deviation of a single cut with an edge worn to the criterion, W.
    pub sd_w: f64,
    /// Ends of the 95 % interval of such a cut, W.
    pub interval_w: (f64, f64),
    /// Change of power per millimetre of wear at the criterion, W/mm.
    pub slope_w_per_mm: f64,
    /// Half the 95 % interval of the wear from a single power, mm; `None` where the power does not rise with the wear.
    pub wear_half_interval_mm: Option<f64>,
    /// Over how many parts the wear can be seen: 1 where a single one tells it; `None` where as many as an edge makes do not.
    pub parts_to_observe: Option<u32>,
    /// Can the wear be seen here?
    pub observability: Observability,
    /// Factors in which this cut lies outside what the model was fitted on.
    pub extrapolated: Vec<&'static str>,
}

impl PowerLimit {
    /// The limit of an operation that takes so much more than the model says, as a logarithm; as it is where that was not learned.
    #[must_use]
    pub(super) fn move_by(self, level: Option<Estimate>) -> Self {
        let Some(level) = level else { return self };
        let factor = level.value.exp();
        let own = |watts: f64| watts * factor;
        let (power_w, sd_w) = (own(self.power_w), own(self.sd_w).hypot(own(self.power_w) * level.sd));
        let half = 0.5 * (self.interval_w.1 - self.interval_w.0) * sd_w / self.sd_w.max(f64::MIN_POSITIVE);
        Self {
            power_w,
            sd_w,
            interval_w: (power_w - half, power_w + half),
            slope_w_per_mm: own(self.slope_w_per_mm),
            wear_half_interval_mm: self.wear_half_interval_mm.map(|_| half / own(self.slope_w_per_mm)),
            ..self
        }
    }
}

/// The wear that a power means.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WearEstimate {
    /// Flank wear, mm; not below 0.
    pub flank_wear_mm: f64,
    /// Standard deviation, mm: of the measured power, of the law, of single cuts about it.
    pub sd_mm: f64,
    /// Ends of the 95 % interval, mm; the lower one not below 0.
    pub interval_mm: (f64, f64),
    /// Can the wear be seen here? An estimate that is not observable is a number with an honest, useless interval.
    pub observability: Observability,
    /// Factors (the wear among them) in which this cut lies outside what the model was fitted on.
    pub extrapolated: Vec<&'static str>,
}

fn list_names(outside: Vec<&'static ConditionFactor>) -> Vec<&'static str> {
    outside.into_iter().map(|factor| factor.name).collect()
}

fn check_conditions(conditions: &CutConditions) -> Result<(), Refusal> {
    match conditions.list_problems().into_iter().next() {
        None => Ok(()),
        Some(problem) => {
            Err(Refusal::new(RefusalKind::OutOfRange, problem.to_string(), "look at the sources of this cut"))
        }
    }
}

/// The power limit at `criterion_mm` for the cutting speed, feed and depth of `cut` (its wear does not count).
///
/// # Errors
/// Conditions that cannot be, or a limit that is no positive finite power (far outside of what was fitted).
pub fn compute_power_limit(model: &WearModel, cut: &CutConditions, criterion_mm: f64) -> Result<PowerLimit, Refusal> {
    let worn = cut.with_wear(criterion_mm);
    check_conditions(&worn)?;
    let predicted = model.predict_power(&worn);
    let (power_w, sd_w) = (predicted.power_w, predicted.observation_sd_w());
    let outside = model.find_factors_outside(&worn);
    if !(power_w.is_finite() && power_w > 0.0 && sd_w.is_finite()) {
        return Err(not_a_power(power_w, &outside));
    }
    let half = predicted.interval_factor() * sd_w;
    let slope_w_per_mm = model.wear_slope_w_per_mm(&worn);
    let wear_half_interval_mm = (slope_w_per_mm > 0.0).then(|| half / slope_w_per_mm).filter(|it| it.is_finite());
    let parts_to_observe = parts_to_observe(&predicted, slope_w_per_mm, criterion_mm);
    Ok(PowerLimit {
        criterion_mm,
        power_w,
        sd_w,
        interval_w: (power_w - half, power_w + half),
        slope_w_per_mm,
        wear_half_interval_mm,
        parts_to_observe,
        observability: match parts_to_observe {
            Some(1) => Observability::Observable,
            Some(_) => Observability::ObservableOverParts,
            None => Observability::NotObservableHere,
        },
        extrapolated: list_names(outside),
    })
}

/// The least number of parts whose mean power tells the wear. The scatter of single cuts becomes less with their number, the error
/// of the law does not.
fn parts_to_observe(predicted: &Predicted, slope_w_per_mm: f64, criterion_mm: f64) -> Option<u32> {
    let narrow_w = OBSERVABLE_SHARE * criterion_mm * slope_w_per_mm / predicted.interval_factor();
    let scatter = |parts: u32| predicted.residual_sd_w / f64::from(parts).sqrt();
    (1..=POOLED_PARTS_MAX).find(|parts| predicted.law_sd_w.hypot(scatter(*parts)) <= narrow_w)
}

fn judge_observability(half_mm: Option<f64>, criterion_mm: f64) -> Observability {
    match half_mm {
        Some(half_mm) if half_mm <= OBSERVABLE_SHARE * criterion_mm => Observability::Observable,
        _ => Observability::NotObservableHere,
    }
}

fn not_a_power(power_w: f64, outside: &[&'static ConditionFactor]) -> Refusal {
    let where_: Vec<&str> = outside.iter().map(|factor| factor.name).collect();
    let what =
        format!("the model gives {power_w:.0} W, which is no cutting power; outside its range: {}", where_.join(", "));
    Refusal::new(RefusalKind::OutOfRange, what, "take the physical form, or make cuts like this one and fit again")
}

/// The wear from a cutting power with its standard deviation, at the speed, feed and depth of `cut`. `criterion_mm` is what
/// the interval is compared with.
///
/// # Errors
/// Conditions or a power that cannot be; a power that does not rise with the wear here; a power below that of a sharp edge by
/// more than the uncertainty (the cut is another than stated); one that no believable wear gives.
pub fn estimate_wear(
    model: &WearModel,
    cut: &CutConditions,
    (power_w, power_sd_w): (f64, f64),
    criterion_mm: f64,
) -> Result<WearEstimate, Refusal> {
    check_conditions(&cut.with_wear(criterion_mm))?;
    if !(power_w.is_finite() && power_w > 0.0 && power_sd_w.is_finite() && power_sd_w >= 0.0) {
        let what = format!("{power_w} W with a standard deviation of {power_sd_w} W is no cutting power");
        return Err(Refusal::new(RefusalKind::OutOfRange, what, "ask only while the machine cuts"));
    }
    let wear_mm = invert_for_wear(model, cut, power_w)?;
    let at = cut.with_wear(wear_mm.max(0.0));
    let predicted = model.predict_power(&at);
    let slope = model.wear_slope_w_per_mm(&at);
    let sd_mm = predicted.observation_sd_w().hypot(power_sd_w) / slope;
    let half_mm = predicted.interval_factor() * sd_mm;
    if wear_mm + half_mm < 0.0 {
        let what = format!("{power_w:.0} W is less than a sharp edge takes here, by {:.0} W", -wear_mm * slope);
        let next =
            "check depth, feed and speed of this cut (the recipe), or the load loss; the model may be of another tool";
        return Err(Refusal::new(RefusalKind::Contradiction, what, next));
    }
    let outside = model.range().find_factors_outside(&at);
    Ok(WearEstimate {
        flank_wear_mm: wear_mm.max(0.0),
        sd_mm,
        interval_mm: ((wear_mm - half_mm).max(0.0), wear_mm + half_mm),
        observability: judge_observability(Some(half_mm), criterion_mm),
        extrapolated: list_names(outside),
    })
}

/// Both forms are at most quadratic in the wear: Newton from the middle of the range, on the rising branch.
fn invert_for_wear(model: &WearModel, cut: &CutConditions, power_w: f64) -> Result<f64, Refusal> {
    let range = model.range();
    let mut wear_mm = 0.5 * (range.least[WEAR] + range.greatest[WEAR]);
    for _ in 0..60 {
        let at = cut.with_wear(wear_mm);
        let slope = model.wear_slope_w_per_mm(&at);
        if !(slope > 0.0 && slope.is_finite()) {
            let what = format!("the power does not rise with the wear here ({slope:.0} W/mm)");
            return Err(Refusal::new(
                RefusalKind::NotIdentifiable,
                what,
                "observe the wear at another cut of the part",
            ));
        }
        let step = (power_w - model.predict_power(&at).power_w) / slope;
        wear_mm += step;
        if step.abs() < 1e-12 {
            break;
        }
    }
    let greatest = 3.0 * range.greatest[WEAR];
    if wear_mm.is_finite() && wear_mm.abs() <= greatest {
        return Ok(wear_mm);
    }
    let what =
        format!("{power_w:.0} W would mean {wear_mm:.2} mm of wear, beyond three times the greatest that was fitted");
    let next = "the cut is another than stated: check depth, feed and speed (the recipe)";
    Err(Refusal::new(RefusalKind::OutOfRange, what, next))
}

#[cfg(test)]
mod tests {
    use super::super::coding::Coding;
    use super::super::surface::published_over;
    use super::*;

    /// The published surface over a coding that makes sense; the patent's own is lost.
    fn model() -> WearModel {
        WearModel::Surface(published_over(Coding { centre: [0.195, 120.0, 0.15, 1.0], half: [0.13, 30.0, 0.05, 0.25] }))
    }

    fn cut(coded: [f64; 3]) -> CutConditions {
        CutConditions::from_vector([0.0, 120.0 + 30.0 * coded[0], 0.15 + 0.05 * coded[1], 1.0 + 0.25 * coded[2]])
    }

    #[test]
    fn the_published_limit_is_found_and_what_lies_outside_the_cube_is_flagged() {
        let found = compute_power_limit(&model(), &cut([1.0, 1.0, 1.0]), 0.3).expect("a limit");
        assert!((found.power_w - 1958.16).abs() < 0.01 && found.extrapolated.is_empty(), "{found:?}");
        let outside = compute_power_limit(&model(), &cut([1.0, 1.0, 1.4]), 0.3).expect("a limit");
        assert_eq!(outside.extrapolated, ["depth_of_cut_mm"]);
        assert!(
            compute_power_limit(&model(), &cut([1.0, 1.0, 1.0]), 300.0)
                .expect_err("um")
                .to_string()
                .contains("is it in um?")
        );
    }

    #[test]
    fn where_the_published_surface_is_blind_it_says_so() {
        let blind = compute_power_limit(&model(), &cut([-1.0, 1.0, 0.0]), 0.3).expect("a limit");
        assert!((blind.slope_w_per_mm - 89.3).abs() < 0.1, "{blind:?}");
        assert_eq!(blind.observability, Observability::NotObservableHere);
        let middle = compute_power_limit(&model(), &cut([0.0; 3]), 0.3).expect("a limit");
        assert_eq!(middle.observability, Observability::Observable);
        assert!((middle.wear_half_interval_mm.expect("rises") - 0.123).abs() < 0.001, "{middle:?}");
    }

    #[test]
    fn the_wear_comes_back_with_an_interval() {
        let (model, cut) = (model(), cut([0.0; 3]));
        let power_w = model.predict_power(&cut.with_wear(0.276)).power_w;
        let found = estimate_wear(&model, &cut, (power_w, 10.0), 0.3).expect("a wear");
        assert!((found.flank_wear_mm - 0.276).abs() < 1e-9);
        assert!((found.sd_mm - 37.6_f64.hypot(10.0) / 642.3).abs() < 1e-3, "{found:?}");
        assert_eq!(found.observability, Observability::Observable);
        let sharp = estimate_wear(&model, &cut, (900.0, 10.0), 0.3).expect("a sharp edge");
        assert_eq!((sharp.flank_wear_mm, sharp.interval_mm.0), (0.0, 0.0));
    }

    #[test]
    fn powers_that_this_cut_cannot_take_are_refused() {
        let (model, cut) = (model(), cut([0.0; 3]));
        for (power_w, part) in
            [(500.0, "less than a sharp edge"), (3000.0, "beyond three times"), (f64::NAN, "no cutting power")]
        {
            let told = estimate_wear(&model, &cut, (power_w, 10.0), 0.3).expect_err("refused").to_string();
            assert!(told.contains(part), "{part}: {told}");
        }
    }

    #[test]
    fn an_interval_as_wide_as_the_criterion_is_not_observable() {
        assert_eq!(judge_observability(Some(0.14), 0.3), Observability::Observable);
        assert_eq!(judge_observability(Some(0.16), 0.3), Observability::NotObservableHere);
        assert_eq!(judge_observability(None, 0.3), Observability::NotObservableHere);
    }
}
