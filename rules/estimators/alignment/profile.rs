//! The residual over lag and window: its minimum, and whether another lag does as well.

use super::fit::{FittedLag, PredictorSet, Ready, fit_transients};

/// Windows that are tried before the best one is refined, s.
const WINDOWS_S: [f64; 6] = [0.03, 0.1, 0.2, 0.4, 0.7, 1.2];
/// Step of the lags that are tried, s.
pub(super) const STEP_S: f64 = 0.05;

/// The best lag and window.
#[derive(Debug, Clone, Copy)]
pub(super) struct Best {
    pub(super) lag_s: f64,
    pub(super) window_s: f64,
    pub(super) fitted: FittedLag,
    /// Least residual at a lag that is another minimum, with that lag.
    pub(super) rival: Option<(f64, f64)>,
    /// Does the minimum lie at an end of the lags that were tried?
    pub(super) at_end: bool,
}

/// Residuals over all lags at the window that is best for each.
pub(super) fn search_lags(ready: &[Ready], lags_s: (f64, f64), window_max_s: f64, shape: PredictorSet) -> Best {
    let windows: Vec<f64> = WINDOWS_S.into_iter().filter(|window| *window <= window_max_s).collect();
    search_at(ready, lags_s, &windows, shape, window_max_s)
}

/// The same over these windows only, before the best one is refined.
pub(super) fn search_at(
    ready: &[Ready],
    lags_s: (f64, f64),
    windows: &[f64],
    shape: PredictorSet,
    window_max_s: f64,
) -> Best {
    let course: Vec<(f64, f64, f64)> = list_lags(lags_s)
        .map(|lag_s| {
            let tried = windows.iter().map(|window_s| (fit_transients(ready, lag_s, *window_s, shape).rss, *window_s));
            let (rss, window_s) = tried.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0.02));
            (lag_s, window_s, rss)
        })
        .collect();
    let at = (0..course.len()).min_by(|a, b| course[*a].2.total_cmp(&course[*b].2)).unwrap_or(0);
    let (lag_s, window_s, _) = course[at];
    let (lag_s, window_s) = refine_lag_and_window(ready, lag_s, window_s, window_max_s, shape);
    let fitted = fit_transients(ready, lag_s, window_s, shape);
    Best { lag_s, window_s, fitted, rival: find_rival_minimum(&course, at), at_end: at == 0 || at + 1 == course.len() }
}

pub(super) fn list_lags((from_s, to_s): (f64, f64)) -> impl Iterator<Item = f64> {
    let mut next_s = from_s;
    std::iter::from_fn(move || {
        let lag_s = next_s;
        next_s += STEP_S;
        (lag_s <= to_s + 1e-9).then_some(lag_s)
    })
}

/// Lag and window in turn, each by a search that halves its step.
fn refine_lag_and_window(
    ready: &[Ready],
    lag_s: f64,
    window_s: f64,
    window_max_s: f64,
    shape: PredictorSet,
) -> (f64, f64) {
    let (mut lag_s, mut window_s) = (lag_s, window_s);
    for _ in 0..2 {
        let of_window = |window_s: f64| fit_transients(ready, lag_s, window_s, shape).rss;
        window_s = find_minimum(window_s, 0.4 * window_s + 0.02, (0.01, window_max_s), of_window);
        let of_lag = |lag_s: f64| fit_transients(ready, lag_s, window_s, shape).rss;
        lag_s = find_minimum(lag_s, STEP_S, (lag_s - 2.0 * STEP_S, lag_s + 2.0 * STEP_S), of_lag);
    }
    (lag_s, window_s)
}

/// A minimum near `start`, to a 64th of the step.
pub(super) fn find_minimum(start: f64, step: f64, limits: (f64, f64), value: impl Fn(f64) -> f64) -> f64 {
    let (mut at, mut step) = (start, step);
    let mut best = value(at);
    for _ in 0..14 {
        let sides = [at - step, at + step].map(|side| side.clamp(limits.0, limits.1));
        let better = sides.into_iter().map(|side| (value(side), side)).min_by(|a, b| a.0.total_cmp(&b.0));
        match better.filter(|(side_value, _)| *side_value < best) {
            Some((side_value, side)) => (best, at) = (side_value, side),
            None => step *= 0.5,
        }
    }
    at
}

/// The deepest other minimum of the course.
fn find_rival_minimum(course: &[(f64, f64, f64)], best: usize) -> Option<(f64, f64)> {
    let rss = |at: usize| course[at].2;
    let minimum = |at: usize| (at == 0 || rss(at) <= rss(at - 1)) && (at + 1 == course.len() || rss(at) <= rss(at + 1));
    let others = (0..course.len()).filter(|at| at.abs_diff(best) > 2 && minimum(*at));
    others.map(|at| (course[at].0, rss(at))).min_by(|a, b| a.1.total_cmp(&b.1))
}
