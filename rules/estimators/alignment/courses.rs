//! Two courses of one quantity on two clocks that nobody set: a torque sensor's file beside the spindle power of the gateway.
//!
//! Method: both courses are averaged onto a common grid; the lag with the highest correlation over the overlap is found, first
//! among all lags on a coarse grid, then on a fine one about it, in two halves of the overlap for the drift of one clock
//! against the other. Unlike [`super::align`], which needs changes of speed in a meter's power, this needs cuts in both.
//!
//! Not identifiable where the best correlation is poor, or another lag is as good: cuts that repeat like the teeth of a comb
//! fit in many places. Cuts of different length and power, or an idle stretch of its own length, tell them apart.

use crate::regression::{Refusal, RefusalKind};
use numerics::statistics::correlate_pairs;

/// Step of the coarse grid, s.
const COARSE_S: f64 = 1.0;
/// The least correlation that counts as the same course.
const CORRELATION_MIN: f64 = 0.9;
/// Another lag must correlate less by this much.
const RIVAL_MARGIN: f64 = 0.02;
/// Lags closer than this are no rivals, s.
const RIVAL_APART_S: f64 = 5.0;
/// Share of the shorter course that must overlap.
const OVERLAP_MIN: f64 = 0.6;
/// At most so many points of the coarse grid: 12 h.
const POINTS_MAX: usize = 43_200;

/// Where the second course lies on the clock of the first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matched {
    /// Time of the first clock less time of the second, at `middle_s` of the second, s.
    pub lag_s: f64,
    /// Change of that lag per second of the second clock.
    pub drift: f64,
    /// Time of the second clock at which `lag_s` holds, s.
    pub middle_s: f64,
    /// Correlation at that lag.
    pub correlation: f64,
    /// Highest correlation at any other lag.
    pub rival: f64,
}

impl Matched {
    /// The time of the first clock at a time of the second.
    #[must_use]
    pub fn on_first_clock(&self, second_s: f64) -> f64 {
        second_s + self.lag_s + self.drift * (second_s - self.middle_s)
    }
}

/// A course on an even grid: means of what fell into each step; `None` where nothing did.
struct Grid {
    begin_s: f64,
    step_s: f64,
    values: Vec<Option<f64>>,
}

impl Grid {
    fn from_course(course: &[(f64, f64)], step_s: f64) -> Self {
        let begin_s = course.first().map_or(0.0, |first| first.0);
        let end_s = course.last().map_or(0.0, |last| last.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded by the caller")]
        let cell = |time_s: f64| ((time_s - begin_s) / step_s).max(0.0) as usize;
        let mut sums = vec![(0.0, 0.0); cell(end_s) + 1];
        for (time_s, value) in course {
            if let Some(sum) = sums.get_mut(cell(*time_s)) {
                *sum = (sum.0 + value, sum.1 + 1.0);
            }
        }
        let values = sums.into_iter().map(|(sum, n)| (n > 0.0).then(|| sum / n)).collect();
        Self { begin_s, step_s, values }
    }

    /// Correlation with another grid of the same step whose beginning lies at this place, and how many points overlap.
    fn correlate_shifted(&self, other: &Self, place: isize) -> (f64, usize) {
        let pairs = other.values.iter().enumerate().filter_map(|(index, y)| {
            Some((self.values.get(index.checked_add_signed(place)?).copied().flatten()?, (*y)?))
        });
        let (correlation, n) = correlate_pairs(pairs);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
        (correlation, n as usize)
    }
}

/// Finds where `second` lies on the clock of `first`. Both are times in s, ascending, with values of the same course in any unit
/// and sign.
///
/// # Errors
/// A [`Refusal`]: too little of a course, no lag at which they agree, or several.
pub fn match_courses(first: &[(f64, f64)], second: &[(f64, f64)]) -> Result<Matched, Refusal> {
    check_course(first)?;
    check_course(second)?;
    let (one, other) = (Grid::from_course(first, COARSE_S), Grid::from_course(second, COARSE_S));
    let (place, correlation, rival) = search_coarse_lag(&one, &other)?;
    if correlation.abs() < CORRELATION_MIN {
        let what = format!("at no lag do the two courses agree: the best correlation is {:.2}", correlation.abs());
        return Err(Refusal::new(
            RefusalKind::Contradiction,
            what,
            "check that both were recorded during the same cuts",
        ));
    }
    if rival > correlation.abs() - RIVAL_MARGIN {
        let what = format!("two lags fit equally (correlation {:.3} and {rival:.3})", correlation.abs());
        let next = "record cuts of different lengths or powers, so that they fit in one place only";
        return Err(Refusal::new(RefusalKind::NotIdentifiable, what, next));
    }
    #[expect(clippy::cast_precision_loss, reason = "at most half a day of seconds")]
    let about_s = one.begin_s - other.begin_s + place as f64 * COARSE_S;
    let middle_s = 0.5 * (second[0].0 + second[second.len() - 1].0);
    let (early, late): (Vec<_>, Vec<_>) = second.iter().copied().partition(|(time_s, _)| *time_s < middle_s);
    let lag_s = refine_lag(first, second, about_s);
    let halves = (refine_lag(first, &early, about_s), refine_lag(first, &late, about_s));
    let apart_s = middle_time_s(&late) - middle_time_s(&early);
    let drift = if apart_s > 60.0 { (halves.1 - halves.0) / apart_s } else { 0.0 };
    // A clock that is off by more than 1 part in 1000 is no clock: then the halves hold too little.
    let drift = if drift.abs() < 1e-3 { drift } else { 0.0 };
    Ok(Matched { lag_s, drift, middle_s, correlation: correlation.abs(), rival })
}

fn middle_time_s(course: &[(f64, f64)]) -> f64 {
    course.first().zip(course.last()).map_or(0.0, |(first, last)| 0.5 * (first.0 + last.0))
}

fn check_course(course: &[(f64, f64)]) -> Result<(), Refusal> {
    let ordered = course.windows(2).all(|pair| pair[1].0 >= pair[0].0);
    let finite = course.iter().all(|(time_s, value)| time_s.is_finite() && value.is_finite());
    let length_s = course.first().zip(course.last()).map_or(0.0, |(first, last)| last.0 - first.0);
    if !ordered || !finite {
        let what = "a course whose times do not ascend, or with a number that is none";
        return Err(Refusal::new(RefusalKind::NotFinite, what, "sort the file by time and leave out empty rows"));
    }
    #[expect(clippy::cast_precision_loss, reason = "a bound")]
    let longest_s = POINTS_MAX as f64 * COARSE_S;
    if !(30.0..=longest_s).contains(&length_s) {
        let what = format!("a course of {length_s:.0} s");
        return Err(Refusal::new(RefusalKind::TooFew, what, "give 30 s to 12 h that hold several cuts"));
    }
    Ok(())
}

/// Place of the highest magnitude of correlation, that correlation, and the highest magnitude anywhere else.
fn search_coarse_lag(one: &Grid, other: &Grid) -> Result<(isize, f64, f64), Refusal> {
    let known = |grid: &Grid| grid.values.iter().flatten().count();
    #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
    let least = (OVERLAP_MIN * known(one).min(known(other)) as f64) as usize;
    let length = |grid: &Grid| grid.values.len().cast_signed();
    let tried: Vec<(isize, f64)> = (-length(other)..=length(one))
        .filter_map(|place| {
            let (correlation, overlap) = one.correlate_shifted(other, place);
            (overlap >= least.max(10)).then_some((place, correlation))
        })
        .collect();
    let best = tried.iter().copied().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    let (place, correlation) = best.ok_or_else(|| {
        let what = "the two courses never overlap enough to compare them";
        Refusal::new(RefusalKind::TooFew, what, "give the stretch of the history in which the sensor recorded")
    })?;
    #[expect(clippy::cast_precision_loss, reason = "at most a day of seconds")]
    let apart = |at: isize| (at - place).abs() as f64 * one.step_s > RIVAL_APART_S;
    let rival = tried.iter().filter(|(at, _)| apart(*at)).map(|(_, it)| it.abs()).fold(0.0, f64::max);
    Ok((place, correlation, rival))
}

/// The lag about `about_s` at which the second course, looked up in the first, agrees best.
fn refine_lag(first: &[(f64, f64)], second: &[(f64, f64)], about_s: f64) -> f64 {
    let agreement = |lag_s: f64| {
        let pairs = second.iter().filter_map(|(time_s, y)| Some((interpolate_course(first, time_s + lag_s)?, *y)));
        correlate_pairs(pairs).0.abs()
    };
    let mut best = (about_s, agreement(about_s));
    for step_s in [0.5, 0.1, 0.02] {
        let from = best.0;
        for k in -8..=8 {
            let lag_s = from + f64::from(k) * step_s;
            let found = agreement(lag_s);
            if found > best.1 {
                best = (lag_s, found);
            }
        }
    }
    best.0
}

/// The first course at a time, in a straight line between its points; `None` outside and over gaps of more than 2 s.
fn interpolate_course(first: &[(f64, f64)], time_s: f64) -> Option<f64> {
    let next = first.partition_point(|(at_s, _)| *at_s < time_s);
    let (after, before) = (first.get(next)?, first.get(next.checked_sub(1)?)?);
    let span_s = after.0 - before.0;
    if !(0.0..=2.0).contains(&span_s) {
        return None;
    }
    let share = if span_s > 0.0 { (time_s - before.0) / span_s } else { 0.0 };
    Some(before.1 + share * (after.1 - before.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cuts of different lengths and powers, at 10 Hz.
    fn course(rate_hz: f64, seconds: f64, of: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        (0..(rate_hz * seconds) as usize).map(|k| k as f64 / rate_hz).map(|time_s| (time_s, of(time_s))).collect()
    }

    fn cuts(time_s: f64) -> f64 {
        let starts = [(20.0, 9.0, 5.0), (45.0, 14.0, 9.0), (75.0, 6.0, 3.0), (110.0, 22.0, 12.0), (160.0, 11.0, 7.0)];
        starts.iter().find(|(at, length, _)| (*at..at + length).contains(&time_s)).map_or(0.2, |(.., torque)| *torque)
    }

    #[test]
    fn a_lag_of_hours_and_a_drift_are_found() {
        let first = course(10.0, 200.0, |time_s| 80.0 * cuts(time_s) + 300.0);
        let drift = 2e-4;
        let second: Vec<(f64, f64)> = course(25.0, 190.0, |time_s| -cuts(time_s))
            .into_iter()
            .map(|(at, v)| ((at - 5000.0) / (1.0 + drift), v))
            .collect();
        let matched = match_courses(&first, &second).expect("the same cuts");
        for time_s in [25.0, 100.0, 165.0] {
            let error_s = matched.on_first_clock((time_s - 5000.0) / (1.0 + drift)) - time_s;
            assert!(error_s.abs() < 0.12, "{time_s}: {error_s} {matched:?}");
        }
    }

    #[test]
    fn a_comb_and_strangers_are_refused() {
        let comb = course(10.0, 300.0, |time_s| f64::from(u8::from(time_s % 20.0 < 10.0)));
        let tooth = course(10.0, 100.0, |time_s| f64::from(u8::from(time_s % 20.0 < 10.0)));
        assert_eq!(match_courses(&comb, &tooth).expect_err("many places").kind, RefusalKind::NotIdentifiable);
        let other = course(10.0, 150.0, |time_s| (time_s * 0.7).sin() + (time_s * 0.13).cos());
        assert!(match_courses(&course(10.0, 200.0, cuts), &other).is_err());
        assert!(match_courses(&[], &other).is_err());
    }
}
