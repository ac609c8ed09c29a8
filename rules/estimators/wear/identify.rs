//! Everything that is learned from a set of cuts: both forms, which one to take, and where the wear can be seen.

use super::compare::{FormComparison, compare_forms};
use super::conditions::{Cut, CutConditions, FACTORS};
use super::fit_surface::{SurfaceFit, SurfaceOptions, fit_surface};
use super::model::WearModel;
use super::physical::{PhysicalFit, fit_physical};
use super::threshold::{PowerLimit, compute_power_limit};
use crate::regression::{Refusal, RefusalKind};
use serde::Serialize;
use serde_json::{Value, json};

/// How a wear model is fitted, and which criterion it is for.
#[derive(Debug, Clone, PartialEq)]
pub struct WearOptions {
    /// How the surface is fitted; factors that were held count for both forms.
    pub surface: SurfaceOptions,
    /// Flank wear at which an edge is worn, mm.
    pub criterion_mm: f64,
    /// `surface` or `physical`; `None`: the one that the comparison recommends.
    pub form: Option<String>,
}

impl Default for WearOptions {
    fn default() -> Self {
        Self { surface: SurfaceOptions::default(), criterion_mm: 0.3, form: None }
    }
}

/// The limit at one place of the design.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DesignPoint {
    /// Cutting speed of this place, m/min.
    pub cutting_speed_m_min: f64,
    /// Feed of this place, mm/rev.
    pub feed_per_rev_mm: f64,
    /// Depth of cut of this place, mm.
    pub depth_of_cut_mm: f64,
    /// The power limit of such a cut.
    #[serde(flatten)]
    pub threshold: PowerLimit,
}

/// Both forms fitted to the cuts, which one was taken, and its limits.
#[derive(Debug, Clone, PartialEq)]
pub struct LearnedWear {
    /// The cuts that both were fitted to.
    pub cuts: Vec<Cut>,
    /// The response surface, or why there is none.
    pub surface: Result<SurfaceFit, Refusal>,
    /// The physical form, or why there is none.
    pub physical: Result<PhysicalFit, Refusal>,
    /// Both on cuts that they have not seen.
    pub comparison: FormComparison,
    /// The form that was asked for, or that the comparison recommends.
    pub model: WearModel,
    /// Share of the variance that it explains.
    pub r2: f64,
    /// Flank wear at which an edge is worn, mm.
    pub criterion_mm: f64,
    /// The limit at the middle and at the corners of speed, feed and depth.
    pub places: Vec<DesignPoint>,
}

/// Fits both forms and compares them.
///
/// # Errors
/// The reason when neither form can be fitted, or not the one that was asked for.
pub fn identify_tool_wear(cuts: Vec<Cut>, options: &WearOptions) -> Result<LearnedWear, Refusal> {
    if let Some(problem) = FACTORS[0]
        .find_problem(options.criterion_mm)
        .map(|problem| problem.to_string())
        .or_else(|| describe_zero_criterion(options.criterion_mm))
    {
        return Err(Refusal::new(RefusalKind::Unit, problem, "give the criterion in mm, for example 0.3")
            .with_place("criterion"));
    }
    let surface = fit_surface(&cuts, &options.surface);
    let physical = fit_physical(&cuts, &options.surface.held);
    let comparison = compare_forms(&cuts, &options.surface);
    let (model, r2) =
        choose_form(&surface, &physical, options.form.as_deref().unwrap_or(comparison.recommended), options)?;
    let places = list_design_points(&model, options.criterion_mm);
    Ok(LearnedWear { cuts, surface, physical, comparison, model, r2, criterion_mm: options.criterion_mm, places })
}

fn describe_zero_criterion(criterion_mm: f64) -> Option<String> {
    (criterion_mm <= 0.0).then(|| "a criterion of 0 is reached by a sharp edge".to_owned())
}

fn choose_form(
    surface: &Result<SurfaceFit, Refusal>,
    physical: &Result<PhysicalFit, Refusal>,
    form: &str,
    options: &WearOptions,
) -> Result<(WearModel, f64), Refusal> {
    let of_surface = || surface.as_ref().map(|it| (WearModel::Surface(it.surface.clone()), it.regression.r2));
    let of_physical = || physical.as_ref().map(|it| (WearModel::Physical(it.physical.clone()), it.r2));
    let (first, second) = if form == "surface" { (of_surface(), of_physical()) } else { (of_physical(), of_surface()) };
    let other = if options.form.is_none() { second.ok() } else { None };
    first.or_else(|refusal| other.ok_or_else(|| refusal.clone()))
}

/// The middle, then every corner of the factors that were changed.
fn list_design_points(model: &WearModel, criterion_mm: f64) -> Vec<DesignPoint> {
    let range = model.range();
    let side = |at: usize, high: bool| if high { range.greatest[at] } else { range.least[at] };
    let mut points = vec![[1, 2, 3].map(|at| 0.5 * (range.least[at] + range.greatest[at]))];
    for corner in 0..8_u8 {
        points.push([1, 2, 3].map(|at| side(at, corner >> (3 - at) & 1 == 1)));
    }
    points.dedup();
    let place = |[speed, feed, depth]: [f64; 3]| {
        let cut = CutConditions::from_vector([criterion_mm, speed, feed, depth]);
        let threshold = compute_power_limit(model, &cut, criterion_mm).ok()?;
        Some(DesignPoint { cutting_speed_m_min: speed, feed_per_rev_mm: feed, depth_of_cut_mm: depth, threshold })
    };
    points.into_iter().filter_map(place).collect()
}

impl LearnedWear {
    /// All of it as JSON, for programs.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let surface = self.surface.as_ref().map_or_else(refusal_to_json, |fit| {
            json!({
                "formula": fit.surface.format_formula(),
                "coding": fit.surface.coding,
                "coefficients_w": fit.regression.coefficients,
                "residual_sd_w": fit.regression.residual_sd,
                "degrees_of_freedom": fit.regression.degrees_of_freedom,
                "condition_number": fit.regression.condition_number,
                "anova": fit.anova,
                "dropped": fit.dropped,
            })
        });
        let physical = self.physical.as_ref().map_or_else(refusal_to_json, |fit| {
            json!({
                "formula": "P = P0 (vc/vc0)^x (f/f0)^y (ap/ap0)^z + W VB vc ap",
                "reference": {
                    "cutting_speed_m_min": fit.physical.reference[0],
                    "feed_per_rev_mm": fit.physical.reference[1],
                    "depth_of_cut_mm": fit.physical.reference[2],
                },
                "coefficients": fit.coefficients,
                "script_model": fit.physical.to_short_form(),
                "residual_sd_w": fit.physical.residual_sd_w,
                "degrees_of_freedom": fit.physical.degrees_of_freedom,
                "condition_number": fit.condition_number,
                "r2": fit.r2,
                "adjusted_r2": fit.adjusted_r2,
                "predicted_r2": fit.predicted_r2,
            })
        });
        json!({
            "cuts": self.cuts.len(),
            "surface": surface,
            "physical": physical,
            "comparison": self.comparison,
            "taken": self.model.form(),
            "criterion_mm": self.criterion_mm,
            "limits": self.places,
        })
    }
}

fn refusal_to_json(refusal: &Refusal) -> Value {
    json!({ "refused": refusal })
}
