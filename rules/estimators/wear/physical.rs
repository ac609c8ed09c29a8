//! The physical form: `P = P0 (vc/vc0)^x (f/f0)^y (ap/ap0)^z + W VB vc ap`.
//!
//! The first part is the exponential cutting-force law `Fc = C ap^x f^y vc^n` times the speed, the second the friction of
//! the worn flank, `dPc = mu H VB s vc` with the engaged edge `s` in proportion to the depth. Five numbers that stay
//! sensible outside the cuts they come from; a quadratic surface does not.
//!
//! Fitted by Gauss-Newton over the exponents with the two linear numbers solved exactly at each step (variable projection,
//! Golub and Pereyra 1973; a step that makes it worse is halved); standard errors from the Jacobian at the end.

use super::coding::{Range, check_varied};
use super::conditions::{CUTTING_POWER, Cut, CutConditions, FACTORS, WEAR};
use super::fit_surface::check_cuts;
use super::power_prediction::Predicted;
use crate::regression::{CONFIDENCE, Column, Intercept, Refusal, RefusalKind, Regression, fit_unweighted, t_quantile};
use serde::{Deserialize, Serialize};

/// Steps of the iteration, at most.
const STEPS_MAX: usize = 100;
/// Halvings of one step, at most.
const HALVINGS_MAX: usize = 30;
/// Relative change of the sum of squares that ends the iteration.
const CONVERGED: f64 = 1e-12;
/// Names of the numbers, in their order.
pub const PHYSICAL_NAMES: [&str; 5] =
    ["cutting_power_w", "speed_exponent", "feed_exponent", "depth_exponent", "wear_w_min_m_mm2"];

/// A fitted physical form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Physical {
    /// vc0, f0, ap0 (m/min, mm/rev, mm): the geometric middle of the cuts.
    pub reference: [f64; 3],
    /// P0: cutting power of a sharp edge at the reference, W.
    pub cutting_power_w: f64,
    /// Exponents of vc, f, ap; 1 for a factor that was held.
    pub exponents: [f64; 3],
    /// W: power per VB vc ap, W per (mm m/min mm).
    pub wear_w_min_m_mm2: f64,
    /// Covariance of P0, the exponents and W, in this order; 0 for what was held.
    pub covariance: Vec<Vec<f64>>,
    /// Standard deviation of one cut about the law, W.
    pub residual_sd_w: f64,
    /// Cuts less fitted numbers.
    pub degrees_of_freedom: f64,
    /// What it was fitted on.
    pub range: Range,
}

impl Physical {
    fn compute_ratios(&self, conditions: &CutConditions) -> [f64; 3] {
        let values = conditions.to_vector();
        std::array::from_fn(|at| values[at + 1] / self.reference[at])
    }

    fn sharp_w(&self, conditions: &CutConditions) -> f64 {
        self.cutting_power_w * power_law(&self.compute_ratios(conditions), &self.exponents)
    }

    /// Power at these conditions, W.
    #[must_use]
    pub fn power_w(&self, conditions: &CutConditions) -> f64 {
        self.sharp_w(conditions) + self.wear_w_min_m_mm2 * friction_term(conditions)
    }

    /// Change of power per millimetre of flank wear, W/mm.
    #[must_use]
    pub fn wear_slope_w_per_mm(&self, conditions: &CutConditions) -> f64 {
        self.wear_w_min_m_mm2 * conditions.cutting_speed_m_min * conditions.depth_of_cut_mm
    }

    /// Derivatives with respect to P0, the exponents and W.
    fn compute_gradient(&self, conditions: &CutConditions) -> [f64; 5] {
        let law = power_law(&self.compute_ratios(conditions), &self.exponents);
        let by = self.compute_ratios(conditions).map(|ratio| self.cutting_power_w * law * ratio.ln());
        [law, by[0], by[1], by[2], friction_term(conditions)]
    }

    /// Power and its uncertainty.
    #[must_use]
    pub fn predict_power(&self, conditions: &CutConditions) -> Predicted {
        let gradient = self.compute_gradient(conditions);
        let row = |i: usize| self.covariance[i].iter().zip(&gradient).map(|(entry, x)| entry * x).sum::<f64>();
        let variance: f64 = (0..self.covariance.len()).map(|i| gradient[i] * row(i)).sum();
        Predicted {
            power_w: self.power_w(conditions),
            law_sd_w: variance.max(0.0).sqrt(),
            residual_sd_w: self.residual_sd_w,
            degrees_of_freedom: self.degrees_of_freedom,
        }
    }
}

fn power_law(ratios: &[f64; 3], exponents: &[f64; 3]) -> f64 {
    ratios.iter().zip(exponents).map(|(ratio, exponent)| ratio.powf(*exponent)).product()
}

/// The product VB vc ap, with which the friction of the worn flank goes.
fn friction_term(conditions: &CutConditions) -> f64 {
    conditions.flank_wear_mm * conditions.cutting_speed_m_min * conditions.depth_of_cut_mm
}

/// A fitted form with what it takes to judge it.
#[derive(Debug, Clone, PartialEq)]
pub struct PhysicalFit {
    /// The fitted form, as a model holds it.
    pub physical: Physical,
    /// Its five numbers (those that were fitted) as the last linearisation gives them: values, errors, intervals.
    pub coefficients: Vec<FittedNumber>,
    /// Share of the variance explained.
    pub r2: f64,
    /// The same, for the number of coefficients.
    pub adjusted_r2: f64,
    /// Share explained of cuts that were left out one at a time (of the linearisation).
    pub predicted_r2: Option<f64>,
    /// Greatest over least singular value of the scaled Jacobian.
    pub condition_number: f64,
    /// Steps of the iteration.
    pub steps: usize,
}

/// One number with its uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FittedNumber {
    /// Name, ending in the unit.
    pub name: &'static str,
    /// The fitted value, in the unit that the name ends in.
    pub value: f64,
    /// Standard error of the value, in the same unit.
    pub standard_error: f64,
    /// Ends of the 95 % interval.
    pub interval: (f64, f64),
}

/// Fits the physical form; factors that were `held` keep the exponent 1.
///
/// # Errors
/// A [`Refusal`]: conditions that cannot be or are in another unit, a factor that was not changed, too few cuts, an iteration
/// that does not settle.
pub fn fit_physical(cuts: &[Cut], held: &[String]) -> Result<PhysicalFit, Refusal> {
    check_cuts(cuts)?;
    let range = Range::from_cuts(cuts);
    let names: Vec<&str> = held.iter().map(String::as_str).collect();
    check_varied(&range, &names)?;
    if !range.is_varied(WEAR) {
        let what = "the flank wear is the same in every cut";
        return Err(Refusal::new(RefusalKind::Constant, what, "cut with edges of different wear")
            .with_place(FACTORS[WEAR].name));
    }
    let free: Vec<usize> = (0..5).filter(|at| !(1..=3).contains(at) || range.is_varied(*at)).collect();
    let mut work = PhysicalRegression { cuts, free, physical: build_initial_guess(cuts, range) };
    work.solve_linear()?;
    let (last, steps) = work.iterate_gauss_newton()?;
    Ok(work.build_fit(&last, steps))
}

/// Exponents of 1 about the geometric middle.
fn build_initial_guess(cuts: &[Cut], range: Range) -> Physical {
    let count = cuts.len() as f64;
    let middle = |at: usize| (cuts.iter().map(|cut| cut.conditions.to_vector()[at].ln()).sum::<f64>() / count).exp();
    Physical {
        reference: [middle(1), middle(2), middle(3)],
        cutting_power_w: 0.0,
        exponents: [1.0; 3],
        wear_w_min_m_mm2: 0.0,
        covariance: Vec::new(),
        residual_sd_w: 0.0,
        degrees_of_freedom: 0.0,
        range,
    }
}

struct PhysicalRegression<'a> {
    cuts: &'a [Cut],
    /// Which of the five numbers are fitted.
    free: Vec<usize>,
    physical: Physical,
}

impl PhysicalRegression<'_> {
    fn compute_residuals(&self, physical: &Physical) -> Vec<f64> {
        self.cuts.iter().map(|cut| cut.cutting_power_w - physical.power_w(&cut.conditions)).collect()
    }

    fn residual_sum_of_squares(&self, physical: &Physical) -> f64 {
        self.compute_residuals(physical).iter().map(|residual| residual * residual).sum()
    }

    fn build_jacobian(&self, physical: &Physical) -> Vec<Column> {
        let gradients: Vec<[f64; 5]> = self.cuts.iter().map(|cut| physical.compute_gradient(&cut.conditions)).collect();
        let column =
            |at: &usize| Column::new(PHYSICAL_NAMES[*at], gradients.iter().map(|gradient| gradient[*at]).collect());
        self.free.iter().map(column).collect()
    }

    /// P0 and W of these exponents.
    fn fit_linear_part(&self, exponents: [f64; 3]) -> Result<Physical, Refusal> {
        let mut physical = Physical { exponents, cutting_power_w: 1.0, ..self.physical.clone() };
        let column = |name: &str, law: &dyn Fn(&CutConditions) -> f64| {
            Column::new(name, self.cuts.iter().map(|cut| law(&cut.conditions)).collect())
        };
        let sharp = column(PHYSICAL_NAMES[0], &|it| physical.sharp_w(it));
        let worn = column(PHYSICAL_NAMES[4], &friction_term);
        let y = Column::new(CUTTING_POWER, self.cuts.iter().map(|cut| cut.cutting_power_w).collect());
        let solved = fit_unweighted(&y, &[sharp, worn], Intercept::None)?.values();
        (physical.cutting_power_w, physical.wear_w_min_m_mm2) = (solved[0], solved[1]);
        Ok(physical)
    }

    fn solve_linear(&mut self) -> Result<(), Refusal> {
        self.physical = self.fit_linear_part(self.physical.exponents)?;
        Ok(())
    }

    fn fit_linearised(&self) -> Result<Regression, Refusal> {
        let y = Column::new(CUTTING_POWER, self.compute_residuals(&self.physical));
        fit_unweighted(&y, &self.build_jacobian(&self.physical), Intercept::None).map_err(|refusal| {
            match refusal.kind {
                RefusalKind::TooFew => Refusal {
                    next: "the physical form has five numbers: make at least eight cuts, better an L9 or L27"
                        .to_owned(),
                    ..refusal
                },
                _ => refusal,
            }
        })
    }

    /// Gauss-Newton until the sum of squares stands still; the last linearisation.
    fn iterate_gauss_newton(&mut self) -> Result<(Regression, usize), Refusal> {
        for step in 1..=STEPS_MAX {
            let linearised = self.fit_linearised()?;
            let before = self.residual_sum_of_squares(&self.physical);
            let better = self.shorter_until_better(&linearised, before)?;
            let Some(better) = better else { return Ok((linearised, step)) };
            let gained = before - self.residual_sum_of_squares(&better);
            self.physical = better;
            if gained <= CONVERGED * before {
                return Ok((self.fit_linearised()?, step));
            }
        }
        let next = "look for cuts with another power than the rest; the table may mix tools or materials";
        Err(Refusal::new(RefusalKind::Contradiction, "the physical form does not settle on these cuts", next))
    }

    /// The step of the linearisation, halved until it is better; `None` when no step is.
    fn shorter_until_better(&self, linearised: &Regression, before: f64) -> Result<Option<Physical>, Refusal> {
        let mut length = 1.0;
        for _ in 0..HALVINGS_MAX {
            let mut exponents = self.physical.exponents;
            for (at, value) in self.free.iter().zip(linearised.values()) {
                if (1..=3).contains(at) {
                    exponents[*at - 1] += length * value;
                }
            }
            let sane = exponents.iter().all(|exponent| exponent.abs() < 10.0);
            let found = if sane { Some(self.fit_linear_part(exponents)?) } else { None };
            if let Some(found) = found.filter(|found| self.residual_sum_of_squares(found) < before) {
                return Ok(Some(found));
            }
            length *= 0.5;
        }
        Ok(None)
    }

    fn build_fit(mut self, last: &Regression, steps: usize) -> PhysicalFit {
        let mean = self.cuts.iter().map(|cut| cut.cutting_power_w).sum::<f64>() / self.cuts.len() as f64;
        let total: f64 = self.cuts.iter().map(|cut| (cut.cutting_power_w - mean).powi(2)).sum();
        let share = |lost: f64| if total > 0.0 { 1.0 - lost / total } else { 0.0 };
        let left_out: Option<f64> = last
            .residuals
            .iter()
            .zip(&last.leverage)
            .map(|(residual, leverage)| (*leverage < 1.0 - 1e-9).then(|| (residual / (1.0 - leverage)).powi(2)))
            .sum();
        self.physical.covariance = self.estimate_covariance(last);
        self.physical.residual_sd_w = last.residual_sd;
        self.physical.degrees_of_freedom = last.degrees_of_freedom;
        PhysicalFit {
            coefficients: self.build_coefficients(last),
            r2: share(last.rss),
            adjusted_r2: share(last.rss * (self.cuts.len() as f64 - 1.0) / last.degrees_of_freedom),
            predicted_r2: left_out.map(share),
            condition_number: last.condition_number,
            steps,
            physical: self.physical,
        }
    }

    /// Covariance of the five numbers. Heavy cuts scatter more than light ones, so that the residuals are not all of one size:
    /// errors are the greater ones of the ordinary form and of the one that takes each residual as it is (HC3: MacKinnon,
    /// White 1985), correlations those of the latter.
    fn estimate_covariance(&self, last: &Regression) -> Vec<Vec<f64>> {
        let columns = self.build_jacobian(&self.physical);
        let count = columns.len();
        let spread: Vec<f64> =
            last.residuals.iter().zip(&last.leverage).map(|(it, leverage)| it / (1.0 - leverage).max(1e-6)).collect();
        // Row by row what a residual moves each number by.
        let moves = |row: usize, i: usize| {
            (0..count).map(|k| last.inverse[i][k] * columns[k].values[row]).sum::<f64>() * spread[row]
        };
        let by_residual = |i: usize, j: usize| (0..spread.len()).map(|row| moves(row, i) * moves(row, j)).sum::<f64>();
        let widen: Vec<f64> = (0..count)
            .map(|i| (last.covariance(i, i) / by_residual(i, i).max(f64::MIN_POSITIVE)).sqrt().max(1.0))
            .map(|factor| if factor.is_finite() { factor } else { 1.0 })
            .collect();
        let mut covariance = vec![vec![0.0; 5]; 5];
        for (i, a) in self.free.iter().enumerate() {
            for (j, b) in self.free.iter().enumerate() {
                covariance[*a][*b] = widen[i] * widen[j] * by_residual(i, j);
            }
        }
        covariance
    }

    /// The numbers with their errors; the values of the last linearisation itself are 0 by then.
    fn build_coefficients(&self, last: &Regression) -> Vec<FittedNumber> {
        let [x, y, z] = self.physical.exponents;
        let values = [self.physical.cutting_power_w, x, y, z, self.physical.wear_w_min_m_mm2];
        let t = t_quantile(0.5 + 0.5 * CONFIDENCE, last.degrees_of_freedom);
        let one = |at: &usize| {
            let standard_error = self.physical.covariance[*at][*at].max(0.0).sqrt();
            let half = t * standard_error;
            let interval = (values[*at] - half, values[*at] + half);
            FittedNumber { name: PHYSICAL_NAMES[*at], value: values[*at], standard_error, interval }
        };
        self.free.iter().map(one).collect()
    }
}

#[cfg(test)]
#[path = "physical_tests.rs"]
mod tests;
