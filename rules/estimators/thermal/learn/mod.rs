//! From warm-ups to a law: sensors, static and late forms, and which of them predicts what it has not seen.

use super::course::Course;
use super::cross_validation::{HeldOut, held_out};
use super::lagged::{LagForm, compute_lagged_states, fit_lagged, held_out_lagged, some_taus};
use super::regression::{ThermalFit, fit_static, to_column};
use super::selection::{Selection, SelectionSettings, select_late, select_sensors};
use crate::regression::{Column, Refusal, RefusalKind};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// Rows that cross-validation works on; more are averaged first.
const ROWS_MAX: usize = 400;
/// A late law must lower the error of blocks left out by this share.
const GAIN_MIN: f64 = 0.05;
/// ... and raise the log likelihood by this: half of the 99.9 % point of chi-squared with three degrees of freedom, for
/// a time constant, a coefficient and the beginning.
const LIKELIHOOD_MIN: f64 = 8.13;

/// A fitted law and how it predicts.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CandidateLaw {
    /// Coefficients with intervals, memory of the noise, residuals.
    pub fit: ThermalFit,
    /// Error of blocks left out.
    pub held_out: HeldOut,
    /// Mean residual while the first sensor warms less that while it cools, um: the loop that the law leaves. None where
    /// it does not do both.
    pub hysteresis_um: Option<f64>,
}

/// Both laws that were tried, and which of them to use.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ThermalLearned {
    /// The sensors of the law to use, and why.
    pub selection: Selection,
    /// The law without lag.
    pub without_lag: CandidateLaw,
    /// The best law with lag, or why there is none.
    #[serde(serialize_with = "or_refused")]
    pub with_lag: Result<CandidateLaw, Refusal>,
    /// Is the law with lag the one to use?
    pub lag_chosen: bool,
    /// Why that law and not the other, in words.
    pub reason: String,
    /// Are the blocks that were left out whole runs?
    pub blocks_are_runs: bool,
    /// How many blocks were left out, one at a time.
    pub blocks: usize,
    /// Neighbouring rows that are averaged before errors of blocks left out are told.
    pub rows_averaged: usize,
}

/// The candidate, or `{"refused": ...}`.
fn or_refused<S: Serializer>(late: &Result<CandidateLaw, Refusal>, to: S) -> Result<S::Ok, S::Error> {
    match late {
        Ok(candidate) => candidate.serialize(to),
        Err(refusal) => {
            let mut map = to.serialize_map(Some(1))?;
            map.serialize_entry("refused", refusal)?;
            map.end()
        }
    }
}

impl ThermalLearned {
    /// The law to use.
    #[must_use]
    pub fn best_candidate(&self) -> &CandidateLaw {
        match &self.with_lag {
            Ok(late) if self.lag_chosen => late,
            _ => &self.without_lag,
        }
    }
}

/// Learns a law; `sensors` names those to use, none lets the data choose.
///
/// # Errors
/// A [`Refusal`] that says what cannot be learned, where, and what to record instead.
pub fn learn_law(
    course: &Course,
    settings: SelectionSettings,
    sensors: Option<&[String]>,
) -> Result<ThermalLearned, Refusal> {
    course.find_usable_sensors()?;
    let chosen = sensors.map(|names| find_positions(course, names)).transpose()?;
    let mut selection = match &chosen {
        Some(chosen) => describe_given_sensors(course, settings, chosen)?,
        None => select_sensors(course, settings)?,
    };
    let without_lag = build_candidate(course, &selection.chosen, fit_static(course, &selection.chosen)?)?;
    says_something(&without_lag)?;
    let mut with_lag = best_late(course, &selection.chosen);
    let (mut lag_chosen, mut reason) = decide_on_lag(&without_lag, &with_lag);
    // A late law may want other sensors than those that imitate a lag best.
    let other = if sensors.is_none() { late_with_own_sensors(course, settings, &with_lag) } else { None };
    if let Some((own, candidate)) = other {
        let late = Ok(candidate);
        let (chosen, why) = decide_on_lag(&without_lag, &late);
        if chosen {
            (selection, with_lag, lag_chosen, reason) = (own, late, chosen, why);
        }
    }
    let (blocks_are_runs, blocks) = (course.blocks_are_runs(), course.split_into_blocks().len());
    let rows_averaged = course.rows().div_ceil(ROWS_MAX);
    Ok(ThermalLearned { selection, without_lag, with_lag, lag_chosen, reason, blocks_are_runs, blocks, rows_averaged })
}

/// The late law of the sensors that suit it best, where it predicts clearly better than that of the others.
fn late_with_own_sensors(
    course: &Course,
    settings: SelectionSettings,
    other: &Result<CandidateLaw, Refusal>,
) -> Option<(Selection, CandidateLaw)> {
    let selection = select_late(course, settings, &some_taus(course).ok()?).ok()?;
    let candidate = late_candidate(course, &selection.chosen, LagForm::All).ok()?;
    let better = other.as_ref().map_or(true, |other| candidate.held_out.is_better_than(&other.held_out, GAIN_MIN));
    better.then_some((selection, candidate))
}

fn find_positions(course: &Course, names: &[String]) -> Result<Vec<usize>, Refusal> {
    let position = |name: &String| {
        let known: Vec<&str> = course.sensors().iter().map(|sensor| sensor.name.as_str()).collect();
        let next = format!("choose among {}", known.join(", "));
        let missing =
            || Refusal::new(RefusalKind::Missing, "is not among the usable temperatures", next).with_place(name);
        known.iter().position(|sensor| sensor == name).ok_or_else(missing)
    };
    names.iter().map(position).collect()
}

fn describe_given_sensors(
    course: &Course,
    settings: SelectionSettings,
    chosen: &[usize],
) -> Result<Selection, Refusal> {
    let everything = SelectionSettings { inflation_max: f64::INFINITY, ..settings };
    super::selection::describe_chosen(course, everything, chosen.to_vec())
}

fn build_candidate(course: &Course, sensors: &[usize], fit: ThermalFit) -> Result<CandidateLaw, Refusal> {
    let columns: Vec<Column> = sensors.iter().map(|at| to_column(&course.sensors()[*at])).collect();
    let (short, columns) = course.condense_rows(&columns, ROWS_MAX);
    let held_out = held_out(&columns, short.error_um(), &short.split_into_blocks())?;
    let hysteresis_um = hysteresis_um(course, sensors, &fit.residuals_um);
    Ok(CandidateLaw { fit: widen_residual_sd(fit, &held_out), held_out, hysteresis_um })
}

/// What a law leaves of rows that it was not fitted to is what is to be expected of it later.
fn widen_residual_sd(mut fit: ThermalFit, held_out: &HeldOut) -> ThermalFit {
    fit.law.residual_sd_um = fit.law.residual_sd_um.max(held_out.rms_um);
    fit
}

/// A law whose every interval holds zero explains nothing.
fn says_something(candidate: &CandidateLaw) -> Result<(), Refusal> {
    let away = |it: &super::law::ThermalTerm| it.interval.0 * it.interval.1 > 0.0;
    if candidate.fit.law.terms.iter().any(away) {
        return Ok(());
    }
    let rows = candidate.fit.memory.effective_rows;
    let what = format!("no coefficient differs from zero: the rows tell as much as {rows:.1} independent ones");
    let next = "record several warm-ups and cool-downs at different speeds, each longer than an hour";
    Err(Refusal::new(RefusalKind::NotIdentifiable, what, next).with_place(super::quantities::THERMAL_ERROR))
}

/// The late law that predicts best. The second form is not the first with a term more, and must be clearly better both in
/// blocks left out and in likelihood.
fn best_late(course: &Course, sensors: &[usize]) -> Result<CandidateLaw, Refusal> {
    let all = late_candidate(course, sensors, LagForm::All)?;
    let Ok(twice) = late_candidate(course, sensors, LagForm::FirstTwice) else { return Ok(all) };
    let likelier = twice.fit.likelihood > all.fit.likelihood + LIKELIHOOD_MIN;
    Ok(if likelier && twice.held_out.is_better_than(&all.held_out, GAIN_MIN) { twice } else { all })
}

fn late_candidate(course: &Course, sensors: &[usize], form: LagForm) -> Result<CandidateLaw, Refusal> {
    let held_out = held_out_lagged(course, sensors, form, ROWS_MAX)?;
    let fit = fit_lagged(course, sensors, form)?;
    let hysteresis_um = hysteresis_um(course, sensors, &fit.residuals_um);
    Ok(CandidateLaw { fit: widen_residual_sd(fit, &held_out), held_out, hysteresis_um })
}

fn decide_on_lag(plain: &CandidateLaw, late: &Result<CandidateLaw, Refusal>) -> (bool, String) {
    let late = match late {
        Ok(late) => late,
        Err(refusal) => return (false, format!("without lag, because a lag cannot be learned: {refusal}")),
    };
    let (before, after) = (plain.held_out.rms_um, late.held_out.rms_um);
    let gained = late.fit.likelihood - plain.fit.likelihood;
    let numbers =
        format!("blocks left out {before:.2} um without, {after:.2} um with lag; log likelihood {gained:+.1}");
    if !late.held_out.is_better_than(&plain.held_out, GAIN_MIN) {
        return (false, format!("without lag: a lag does not predict better ({numbers})"));
    }
    if gained < LIKELIHOOD_MIN {
        return (false, format!("without lag: remembering errors explain the rows as well ({numbers})"));
    }
    (true, format!("with lag: {numbers}"))
}

/// Mean residual while the first sensor warms less that while it cools.
fn hysteresis_um(course: &Course, sensors: &[usize], residuals_um: &[f64]) -> Option<f64> {
    let values = &course.sensors()[*sensors.first()?].values;
    let behind = compute_lagged_states(course, values, (20.0 * course.period_s()).min(0.1 * course.longest_s()));
    let ahead: Vec<f64> = values.iter().zip(&behind).map(|(value, state)| value - state).collect();
    let threshold = 0.3 * numerics::statistics::rms(&ahead);
    let mean = |sign: f64| {
        let rows = residuals_um.iter().zip(&ahead).filter(|(_, ahead)| sign * **ahead > threshold);
        let chosen: Vec<f64> = rows.map(|(residual, _)| *residual).collect();
        (chosen.len() * 20 >= residuals_um.len()).then(|| chosen.iter().sum::<f64>() / chosen.len() as f64)
    };
    Some(mean(1.0)? - mean(-1.0)?)
}

#[cfg(test)]
mod tests;
