//! Fitting a response surface: all terms, then backward elimination.

use super::anova::{Anova, build_anova};
use super::coding::{Coding, Range, check_varied};
use super::conditions::{CUTTING_POWER, Cut, FACTORS, unit_trouble};
use super::surface::Surface;
use super::term::{WearTerm, second_order};
use crate::regression::{Column, Intercept, Refusal, RefusalKind, Regression, fit_unweighted};
use serde::Serialize;

/// Values of a factor that differ by less than this share of its range are one level.
const LEVEL_SHARE: f64 = 0.1;

/// Which terms the fit begins with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// The constant and the factors alone.
    Linear,
    /// These, and products of two factors.
    Interactions,
    /// And their squares, of factors with at least three values.
    Second,
}

/// How a surface is fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceOptions {
    /// Terms to begin with.
    pub order: Order,
    /// A term whose p exceeds this is dropped; 1 keeps all.
    pub p_out: f64,
    /// Keep a factor as long as a product or square with it stays.
    pub hierarchical: bool,
    /// Factors that were held on purpose; the model is for their value alone.
    pub held: Vec<String>,
}

impl Default for SurfaceOptions {
    fn default() -> Self {
        Self { order: Order::Second, p_out: 0.05, hierarchical: true, held: Vec::new() }
    }
}

/// A term that was dropped, in the order of dropping.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Dropped {
    /// The term, named as in the surface.
    pub term: String,
    /// Its F with one degree of freedom, when it was dropped.
    pub f: f64,
    /// Probability of so great an F by chance.
    pub p: f64,
}

/// A fitted surface with everything that it takes to judge it.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceFit {
    /// The surface with the terms that stayed.
    pub surface: Surface,
    /// The regression behind it: coefficients with intervals, R2, condition number.
    pub regression: Regression,
    /// Analysis of variance of the terms that stayed.
    pub anova: Anova,
    /// Terms that were dropped.
    pub dropped: Vec<Dropped>,
}

/// Fits a surface and drops what is not significant.
///
/// # Errors
/// A [`Refusal`]: conditions that cannot be or are in another unit, a factor that was not changed, too few cuts, a design in
/// which terms say the same.
pub fn fit_surface(cuts: &[Cut], options: &SurfaceOptions) -> Result<SurfaceFit, Refusal> {
    check_cuts(cuts)?;
    let range = Range::from_cuts(cuts);
    let held: Vec<&str> = options.held.iter().map(String::as_str).collect();
    check_varied(&range, &held)?;
    let coding = Coding::from_range(&range);
    let mut terms = list_candidate_terms(cuts, &range, options.order);
    let mut regression = regress_on_terms(cuts, &coding, &terms)?;
    let mut dropped = Vec::new();
    while let Some(at) = find_weakest_term(&terms, &regression, options) {
        let coefficient = &regression.coefficients[at];
        dropped.push(Dropped { term: coefficient.name.clone(), f: f_of(&regression, at), p: coefficient.p });
        terms.remove(at);
        regression = regress_on_terms(cuts, &coding, &terms)?;
    }
    let surface = build_surface(&terms, coding, range, &regression);
    let anova = build_anova(cuts, &regression);
    Ok(SurfaceFit { surface, regression, anova, dropped })
}

fn f_of(regression: &Regression, at: usize) -> f64 {
    let coefficient = &regression.coefficients[at];
    (coefficient.value / coefficient.standard_error.max(f64::MIN_POSITIVE)).powi(2).min(f64::MAX)
}

/// Values that cannot be, and units that were mistaken.
pub(super) fn check_cuts(cuts: &[Cut]) -> Result<(), Refusal> {
    for (index, cut) in cuts.iter().enumerate() {
        if let Some(problem) = cut.conditions.list_problems().into_iter().next() {
            return Err(Refusal::new(problem.kind(), problem.to_string(), "correct the table")
                .with_place(format!("row {}", index + 1)));
        }
        if !(cut.cutting_power_w.is_finite() && cut.cutting_power_w > 0.0) {
            let what = format!("{CUTTING_POWER} = {} is no power that removes material", cut.cutting_power_w);
            let next = "leave cuts in air out, and separate the no-load power first (identify no-load)";
            return Err(Refusal::new(RefusalKind::OutOfRange, what, next).with_place(format!("row {}", index + 1)));
        }
    }
    let trouble = |what| Err(Refusal::new(RefusalKind::Unit, what, "").with_place(CUTTING_POWER));
    unit_trouble(cuts).map_or(Ok(()), trouble)
}

/// The terms to begin with: those that the values of the factors can show.
fn list_candidate_terms(cuts: &[Cut], range: &Range, order: Order) -> Vec<WearTerm> {
    let levels: Vec<usize> = (0..FACTORS.len()).map(|at| count_distinct_levels(cuts, at)).collect();
    let shows = |term: &WearTerm| {
        let each = term.powers().iter().enumerate();
        let varied = each.clone().all(|(at, power)| *power == 0 || range.is_varied(at));
        let curved = each.clone().all(|(at, power)| *power < 2 || levels[at] >= 3);
        let wanted = match order {
            Order::Linear => term.order() <= 1,
            Order::Interactions => term.powers().iter().all(|power| *power <= 1),
            Order::Second => true,
        };
        varied && curved && wanted
    };
    second_order(FACTORS.len()).into_iter().filter(shows).collect()
}

fn count_distinct_levels(cuts: &[Cut], factor: usize) -> usize {
    let mut values: Vec<f64> = cuts.iter().map(|cut| cut.conditions.to_vector()[factor]).collect();
    values.sort_by(f64::total_cmp);
    let width = values.last().zip(values.first()).map_or(0.0, |(last, first)| last - first);
    // Measured levels scatter; a square that only their scatter shows would be nonsense.
    values.dedup_by(|a, b| (*a - *b).abs() <= LEVEL_SHARE * width);
    values.len()
}

/// Names of the terms in the symbols of the factors.
pub(super) fn format_term_name(term: &WearTerm) -> String {
    term.format_name(&FACTORS.map(|factor| factor.symbol))
}

fn regress_on_terms(cuts: &[Cut], coding: &Coding, terms: &[WearTerm]) -> Result<Regression, Refusal> {
    let points: Vec<[f64; 4]> = cuts.iter().map(|cut| coding.encode_conditions(&cut.conditions)).collect();
    let column = |term: &WearTerm| {
        Column::new(format_term_name(term), points.iter().map(|point| term.evaluate_at(point)).collect())
    };
    let columns: Vec<Column> = terms.iter().skip(1).map(column).collect();
    let y = Column::new(CUTTING_POWER, cuts.iter().map(|cut| cut.cutting_power_w).collect());
    fit_unweighted(&y, &columns, Intercept::Fitted).map_err(|refusal| match refusal.kind {
        RefusalKind::TooFew => Refusal {
            next: format!(
                "a surface of {} terms needs more cuts than that, and half as many again to be judged; take --order linear, \
                 or cut an L27 (`identify tool-wear --design L27`)",
                terms.len()
            ),
            ..refusal
        },
        RefusalKind::Collinear => Refusal {
            next: "this design cannot tell them apart: take --order linear or interactions, or cut a larger array".to_owned(),
            ..refusal
        },
        _ => refusal,
    })
}

/// The term to drop next: the least significant one that may go.
fn find_weakest_term(terms: &[WearTerm], regression: &Regression, options: &SurfaceOptions) -> Option<usize> {
    let free = |at: &usize| !options.hierarchical || !terms.iter().any(|other| other.contains(&terms[*at]));
    let p = |at: usize| regression.coefficients[at].p;
    // One term besides the constant always stays.
    let at = (1..terms.len()).filter(free).max_by(|a, b| p(*a).total_cmp(&p(*b)))?;
    (p(at) > options.p_out && terms.len() > 2).then_some(at)
}

fn build_surface(terms: &[WearTerm], coding: Coding, range: Range, regression: &Regression) -> Surface {
    let count = terms.len();
    Surface {
        coding,
        terms: terms.to_vec(),
        coefficients_w: regression.values(),
        covariance_w2: (0..count).map(|i| (0..count).map(|j| regression.covariance(i, j)).collect()).collect(),
        residual_sd_w: regression.residual_sd,
        degrees_of_freedom: regression.degrees_of_freedom,
        range,
    }
}

#[cfg(test)]
#[path = "fit_surface_tests.rs"]
mod tests;
