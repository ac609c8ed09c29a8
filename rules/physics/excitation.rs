//! What a recording excites: levels, visits, boundaries and the grids of shapes worth trying in it.

use super::{Effect, Form, Scene};
use numerics::statistics::{count_to_f64, find_greatest_magnitude};
use recording::Words;
use std::collections::BTreeSet;

/// Do the values differ by more than a thousandth of the greatest?
pub(crate) fn has_variation(values: &[f64]) -> bool {
    compute_spread(values) > 1e-3 * find_greatest_magnitude(values)
}

/// The plain form of an effect where its first column varies in the recording; no form where nothing could tell it.
pub(crate) fn propose_plain_form(effect: &dyn Effect, scene: &Scene) -> Vec<Form> {
    let columns = effect.compute_columns(scene, &Form::without_shape());
    columns.filter(|columns| has_variation(&columns[0].1)).map(|_| Form::without_shape()).into_iter().collect()
}

/// Separate stretches of rows in which `holds`; a new run starts a new stretch.
pub(crate) fn count_visits(scene: &Scene, holds: impl Fn(usize) -> bool) -> usize {
    scene
        .runs()
        .iter()
        .map(|run| run.clone().filter(|row| holds(*row) && (*row == run.start || !holds(*row - 1))).count())
        .sum()
}

/// Gaps from which a band of speeds is no level with its jitter any more: constant cutting speed passes through all.
const BAND_GAPS: f64 = 4.0;

/// Speeds in rpm half-way between the levels at which the spindle stays, which are apart by more than `gap_share` of the
/// greatest, and at every such gap within a band that it passes through; at most `most` of them, as many rows between each.
pub(crate) fn list_speeds_between_levels(scene: &Scene, gap_share: f64, most: usize) -> Vec<f64> {
    let Some(speeds) = list_steady_speeds_rpm(scene) else { return Vec::new() };
    let gap = gap_share * find_greatest_magnitude(&speeds);
    let bands = speeds.chunk_by(|slower, faster| faster - slower <= gap);
    let levels: Vec<&[f64]> = bands.flat_map(|band| split_speed_band(band, gap)).collect();
    let mut rows = 0;
    let between = levels.windows(2).map(|pair| {
        rows += pair[0].len();
        // Chunks are never empty.
        (rows, 0.5 * (pair[0][pair[0].len() - 1] + pair[1][0]))
    });
    thin_places(&between.collect::<Vec<_>>(), speeds.len(), most)
}

/// A band of speeds in rising order: one level, or one for every gap that it is wide.
fn split_speed_band(mut band: &[f64], gap: f64) -> Vec<&[f64]> {
    let mut levels = Vec::new();
    if band[band.len() - 1] - band[0] > BAND_GAPS * gap {
        while let Some(first) = band.first() {
            let (level, rest) = band.split_at(band.partition_point(|speed| *speed <= first + gap));
            levels.push(level);
            band = rest;
        }
    } else {
        levels.push(band);
    }
    levels
}

/// Of places with the rows below each, in rising order, at most `most`, with as many of the rows between one and the next.
fn thin_places(places: &[(usize, f64)], rows: usize, most: usize) -> Vec<f64> {
    if places.len() <= most {
        return places.iter().map(|(_, place)| *place).collect();
    }
    let nearest = |index: usize| {
        let wanted = (2 * index + 1) * rows / (2 * most);
        places.iter().min_by_key(|(below, _)| below.abs_diff(wanted)).map(|(_, place)| *place)
    };
    let mut chosen: Vec<f64> = (0..most).filter_map(nearest).collect();
    chosen.dedup();
    chosen
}

/// Speeds of the rows in which the spindle turns and hardly accelerates, in rising order.
fn list_steady_speeds_rpm(scene: &Scene) -> Option<Vec<f64>> {
    let speed = scene.role_values(super::Role::Speed)?;
    let rates = super::drive::compute_rate(scene, speed);
    let slow = 0.02 * find_greatest_magnitude(speed);
    let mut steady: Vec<f64> =
        speed.iter().zip(&rates).filter(|(n, rate)| n.abs() > 1.0 && rate.abs() < slow).map(|(n, _)| n.abs()).collect();
    steady.sort_by(f64::total_cmp);
    Some(steady)
}

/// The time constants of the grid that this recording can tell: two periods to half of its longest stretch.
pub(crate) fn list_time_constants(scene: &Scene, grid_s: &[f64]) -> Vec<f64> {
    let longest_s = super::state::compute_elapsed_s(scene).into_iter().fold(0.0, f64::max);
    grid_s.iter().copied().filter(|tau_s| (2.0 * scene.period_s()..=0.5 * longest_s).contains(tau_s)).collect()
}

/// One form per time constant that this recording can tell.
pub(crate) fn build_lag_forms(scene: &Scene, name: &'static str, grid_s: &[f64]) -> Vec<Form> {
    let form = |tau_s| Form { name, ..Form::from_shape(&[("tau_s", tau_s)]) };
    list_time_constants(scene, grid_s).into_iter().map(form).collect()
}

/// Shortest delay, in sampling periods, that is worth trying where rows are recorded faster than the grid is fine.
const SHORTEST_PERIODS: f64 = 0.35;
/// Ratio of the delays between that one and the grid.
const DELAY_RATIO: f64 = 2.2;

/// Delays worth trying, in seconds: those of the grid, none below a quarter of the sampling period; and shorter ones,
/// down to part of a row, where the recording is fast enough to tell them.
pub(crate) fn list_delays(scene: &Scene, grid_s: &[f64]) -> Vec<f64> {
    let (period_s, finest_s) = (scene.period_s(), grid_s.first().copied().unwrap_or(0.0));
    let short = |delay: &f64| Some(delay * DELAY_RATIO);
    let short = std::iter::successors(Some(SHORTEST_PERIODS * period_s), short);
    let short = short.take_while(|delay| *delay > 0.0 && *delay < 0.7 * finest_s);
    let mut delays: Vec<f64> = short.chain(grid_s.iter().map(|delay| delay.max(0.25 * period_s))).collect();
    delays.dedup();
    delays
}

/// Runs at whose start a step is tried, at most, evenly spread: in a month of runs a change is dated to some of them.
const STEPS_MAX: usize = 96;

/// Forms that step at the start of a run and stay, with at least two runs on either side.
pub(crate) fn build_step_forms(scene: &Scene, name: &'static str) -> Vec<Form> {
    let mut seen = BTreeSet::new();
    let first_of_name: Vec<bool> = scene.run_names().iter().map(|run| seen.insert(run.clone())).collect();
    let last = scene.runs().len().saturating_sub(2);
    let starts: Vec<&String> =
        (2..=last).filter(|run| first_of_name[*run]).map(|run| &scene.run_names()[run]).collect();
    let ln_choices = compute_ln_count(starts.len());
    let form =
        |run: &&String| Form { name, place: Some(("run".to_owned(), (*run).clone())), ln_choices, ..Form::default() };
    starts.iter().step_by(starts.len().div_ceil(STEPS_MAX).max(1)).map(form).collect()
}

/// The position among the scene's runs of the first run of this name.
pub(crate) fn find_run(scene: &Scene, name: &str) -> Option<usize> {
    scene.run_names().iter().position(|known| known == name)
}

/// One from the first row of the run on, zero before; `None` when there is no such run.
pub(crate) fn mark_rows_since_run(scene: &Scene, run: &str) -> Option<Vec<f64>> {
    let start = scene.runs()[find_run(scene, run)?].start;
    Some((0..scene.rows()).map(|row| if row >= start { 1.0 } else { 0.0 }).collect())
}

/// The form of a step of which only a stretch of runs is known in which it begins. Its shape: `height`, the size that is looked for, and
/// `deviation`, the noise behind which it is looked for.
pub const FOLLOWED: &str = "followed";

/// One in the rows in which a step of such a form has begun; `per_height` is what the step adds where its size is one.
pub(crate) fn follow_step_form(scene: &Scene, form: &Form, per_height: &[f64]) -> Option<Vec<f64>> {
    let (height, deviation) = (form.shape_value("height")?, form.shape_value("deviation")?);
    let step: Vec<f64> = per_height.iter().map(|x| height * x).collect();
    follow_step(scene, &form.place.as_ref()?.1, &step, deviation)
}

/// Squared deviations gained from which a level is taken to have begun.
pub const BEGUN: f64 = 12.0;

/// One from the last run of a stretch, `first to last`, on. In each earlier run of the stretch one in the rows whose earlier rows of
/// the same run tell that `step` has begun, behind a noise of this deviation in the unit of the output; zero before the stretch.
pub(crate) fn follow_step(scene: &Scene, stretch: &str, step: &[f64], deviation: f64) -> Option<Vec<f64>> {
    let (first, last) = parse_run_stretch(scene, stretch)?;
    let simulated = scene.simulated_output()?;
    let start = scene.runs()[last].start;
    let mut begun: Vec<f64> = (0..scene.rows()).map(|row| f64::from(u8::from(row >= start))).collect();
    for run in &scene.runs()[first..last] {
        let mut gained = 0.0;
        for row in run.clone() {
            begun[row] = f64::from(u8::from(gained > BEGUN));
            if scene.usable_rows()[row] {
                let left = scene.recorded_output()[row] - simulated[row];
                gained += (left.powi(2) - (left - step[row]).powi(2)) / deviation.powi(2).max(f64::MIN_POSITIVE);
            }
        }
    }
    Some(begun)
}

/// A stretch of runs as `follow_step` reads it.
#[must_use]
pub fn format_run_stretch(first: &str, last: &str) -> String {
    format!("{first}{RUN_TO_RUN}{last}")
}

/// One in the rows of a stretch of runs, `first to last`, zero elsewhere; `None` when there are no such runs.
pub(crate) fn mark_rows_within_runs(scene: &Scene, stretch: &str) -> Option<Vec<f64>> {
    let (first, last) = parse_run_stretch(scene, stretch)?;
    let rows = scene.runs()[first].start..scene.runs()[last].end;
    Some((0..scene.rows()).map(|row| if rows.contains(&row) { 1.0 } else { 0.0 }).collect())
}

/// The first and the last run of a stretch that is written `first to last`.
fn parse_run_stretch(scene: &Scene, stretch: &str) -> Option<(usize, usize)> {
    let (first, last) = stretch.split_once(RUN_TO_RUN)?;
    let (first, last) = (find_run(scene, first)?, find_run(scene, last)?);
    (first <= last).then_some((first, last))
}

/// Between the first and the last run of a stretch.
const RUN_TO_RUN: &str = " to ";

/// One form per word of a text column, where it has `2..=most` words.
pub(crate) fn build_word_forms(scene: &Scene, name: &'static str, column: &str, most: usize) -> Vec<Form> {
    let Some(words) = scene.text_column(column) else { return Vec::new() };
    let words = words.words();
    if !(2..=most).contains(&words.len()) {
        return Vec::new();
    }
    let ln_choices = compute_ln_count(words.len());
    let form =
        |word: &String| Form { name, place: Some((column.to_owned(), word.clone())), ln_choices, ..Form::default() };
    words.iter().map(form).collect()
}

/// Between the units that the place of a form names.
pub(crate) const UNIT_TO_UNIT: &str = ", ";

/// The place of a form with a term for each word of a text column; `None` where it has no `2..=most` words, or one of them could not be told
/// from two.
pub(crate) fn list_units(scene: &Scene, column: &str, most: usize) -> Option<(String, String)> {
    let words = scene.text_column(column)?.words();
    let tellable = words.iter().all(|word| !word.contains(UNIT_TO_UNIT));
    ((2..=most).contains(&words.len()) && tellable).then(|| (column.to_owned(), words.join(UNIT_TO_UNIT)))
}

/// The units that a form names, and which rows are of which. A unit that nobody has measured yet is like the others in the mean.
pub(crate) struct NamedUnits<'a> {
    words: Option<&'a Words>,
    pub(crate) names: Vec<&'a str>,
}

impl<'a> NamedUnits<'a> {
    pub(crate) fn new(scene: &'a Scene, column: &str, names: Vec<&'a str>) -> Self {
        Self { words: scene.text_column(column), names }
    }

    /// The share of a unit's term in a row: the whole of its own rows, an equal part where the row is of none that is named.
    pub(crate) fn compute_share(&self, unit: &str, row: usize) -> f64 {
        match self.words.and_then(|words| words.get(row)).filter(|word| self.names.contains(word)) {
            Some(own) => f64::from(u8::from(own == unit)),
            None => 1.0 / count_to_f64(self.names.len()),
        }
    }
}

/// The form without the units of its place that are not met; as it is where fewer than two are.
#[must_use]
pub fn keep_met_units(form: Form, is_met: impl Fn(&str) -> bool) -> Form {
    let Some((column, named)) = &form.place else { return form };
    let met: Vec<&str> = named.split(UNIT_TO_UNIT).filter(|unit| is_met(unit)).collect();
    if met.len() < 2 {
        return form;
    }
    let place = Some((column.clone(), met.join(UNIT_TO_UNIT)));
    Form { place, ..form }
}

/// One in the rows where the text column holds the word.
pub(crate) fn mark_word_rows(scene: &Scene, column: &str, word: &str) -> Option<Vec<f64>> {
    let words = scene.text_column(column)?;
    Some((0..scene.rows()).map(|row| if words.get(row) == Some(word) { 1.0 } else { 0.0 }).collect())
}

/// Natural logarithm of a number of alternatives; zero for none or one.
pub(crate) fn compute_ln_count(count: usize) -> f64 {
    (count.max(1) as f64).ln()
}

/// Share of the recording that is over, 0 to 1; a pause of unknown length counts as one period.
pub(crate) fn compute_recording_share(scene: &Scene) -> Vec<f64> {
    let elapsed_s = compute_clock_elapsed_s(scene);
    let whole_s = elapsed_s.last().copied().unwrap_or(0.0).max(f64::MIN_POSITIVE);
    elapsed_s.iter().map(|elapsed_s| elapsed_s / whole_s).collect()
}

/// Seconds since the first row on the clock that never restarts.
pub(crate) fn compute_clock_elapsed_s(scene: &Scene) -> Vec<f64> {
    scene.clock_s().to_vec()
}

/// Difference of the greatest and the least value.
pub(crate) fn compute_spread(values: &[f64]) -> f64 {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (high - low).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::{split_speed_band, thin_places};

    #[test]
    fn speeds_that_are_held_are_levels_and_a_band_that_is_passed_through_is_cut() {
        let held = [995.0, 1000.0, 1004.0, 1012.0];
        assert_eq!(split_speed_band(&held, 9.0), [&held], "jitter");
        let passed: Vec<f64> = (0..100).map(|row| 500.0 + 10.0 * f64::from(row)).collect();
        let levels = split_speed_band(&passed, 90.0);
        assert!(levels.len() == 10 && levels.iter().all(|level| level.len() == 10), "{levels:?}");
    }

    #[test]
    fn of_many_places_those_with_as_many_rows_between_are_kept() {
        let places: Vec<(usize, f64)> = (1..100).map(|place| (place * place, 10.0 * place as f64)).collect();
        assert_eq!(thin_places(&places, 10_000, 4), [350.0, 610.0, 790.0, 940.0]);
        assert_eq!(thin_places(&places[..3], 10_000, 4), [10.0, 20.0, 30.0]);
    }
}
