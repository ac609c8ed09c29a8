//! Where an effect acts, in the fewest words that cover it: conditions on what a person can set or see (a speed, a tool, the
//! age of an edge, the time on the clock), found by what they cover of the rows in which it acts, less the share of the rows
//! that they take in, less a price for each condition and each word of a list. So a threshold is told in place of a list of
//! runs.

use super::region::Condition;
use adapter_core::channel::quantity::Quantity;
use numerics::statistics::count_to_f64;
use recording::Recording;
use recording::{Numbers, Words, derive_quantity};

/// Price of one condition, in shares of what is covered: a reader takes it in for a thirtieth. Lower: words that cover noise;
/// higher: one condition where two are needed.
const CONDITION_PRICE: f64 = 0.03;
/// Price of each further word of a list: less than a condition of its own.
const WORD_PRICE: f64 = 0.02;
/// Conditions that hold together, at most: more are not kept in mind.
const CONDITIONS_MAX: usize = 3;
/// Thresholds that are tried for each column before the best is moved: the cost of a search grows with their square.
const THRESHOLDS_TRIED: usize = 24;
/// Words of a list, at most: a longer one is a condition on something else.
const WORDS_MAX: usize = 4;
/// Rows that are looked at; a long recording is thinned: a place is known to less than a thousandth of it.
const ROWS_MAX: usize = 6000;

/// A column as the search sees it.
enum PlaceColumn<'a> {
    Numbers(String, Vec<Option<f64>>),
    Words(&'a str, &'a Words),
}

/// The search over one recording.
pub(super) struct PlaceSearch<'a> {
    rows: Vec<usize>,
    columns: Vec<PlaceColumn<'a>>,
}

impl<'a> PlaceSearch<'a> {
    /// Over what can be told of a recording of this output.
    pub(super) fn new(recording: &'a Recording, output: &str) -> Self {
        let every = recording.count_rows().div_ceil(ROWS_MAX).max(1);
        let rows: Vec<usize> = (0..recording.count_rows()).step_by(every).collect();
        let mut columns = Vec::new();
        for column in recording.columns() {
            let name = column.name.as_str();
            if let Some(numbers) = recording.find_numbers(name).filter(|_| is_place_column(name, output)) {
                columns.push(PlaceColumn::Numbers(name.to_owned(), read_values(numbers, &rows)));
            }
            if let Some(words) = recording
                .find_words(name)
                .filter(|words| words.words().len() > 1 && !name.ends_with("_missing") && name != "time_utc")
            {
                columns.push(PlaceColumn::Words(name, words));
            }
        }
        for name in ["cutting_speed_m_min", "cutting_time_min", "feed_per_rev_mm"] {
            if recording.find_numbers(name).is_none()
                && let Some(numbers) = derive_quantity(recording, name)
            {
                columns.push(PlaceColumn::Numbers(name.to_owned(), read_values(&numbers, &rows)));
            }
        }
        if recording.pauses_known() {
            columns.push(PlaceColumn::Numbers(
                "time_s".to_owned(),
                rows.iter().map(|row| Some(recording.time_s[*row])).collect(),
            ));
        }
        if recording.list_runs().len() > 1 {
            columns.push(PlaceColumn::Numbers("time_in_run_s".to_owned(), compute_time_in_run_s(recording, &rows)));
        }
        Self { rows, columns }
    }

    /// Conditions that together describe the affected rows; none where nothing describes them.
    pub(super) fn find_conditions(&self, active: &[bool]) -> Vec<Condition> {
        let at = |row: &usize| active.get(*row).copied().unwrap_or(false);
        self.select_conditions(&self.rows.iter().map(at).collect::<Vec<bool>>())
    }

    /// Share of the affected rows within, less the share of all rows within.
    fn compute_gain(&self, inside: &[bool], affected: &[bool]) -> f64 {
        let all = affected.iter().filter(|affected| **affected).count();
        let within = affected.iter().zip(inside).filter(|(affected, inside)| **affected && **inside).count();
        let rows = inside.iter().filter(|inside| **inside).count();
        compute_share(within, all) - compute_share(rows, self.rows.len())
    }

    fn apply_condition(&self, inside: &mut [bool], condition: &Condition) {
        for column in &self.columns {
            match (column, condition) {
                (PlaceColumn::Numbers(name, values), Condition::Range { column, min, max }) if name == column => {
                    let holds = |x: &f64| min.is_none_or(|min| *x >= min) && max.is_none_or(|max| *x <= max);
                    inside
                        .iter_mut()
                        .zip(values)
                        .for_each(|(inside, value)| *inside &= value.as_ref().is_some_and(holds));
                }
                (PlaceColumn::Words(name, cells), Condition::Equals { column, words }) if name == column => {
                    let holds = |row: usize| cells.get(row).is_some_and(|word| words.iter().any(|known| known == word));
                    inside.iter_mut().zip(&self.rows).for_each(|(inside, row)| *inside &= holds(*row));
                }
                _ => {}
            }
        }
    }

    /// One condition after the other, each the one that gains most.
    fn select_conditions(&self, affected: &[bool]) -> Vec<Condition> {
        let (mut chosen, mut value): (Vec<Condition>, f64) = (Vec::new(), 0.0);
        let mut inside = vec![true; self.rows.len()];
        while chosen.len() < CONDITIONS_MAX {
            let mut best: Option<(f64, Condition)> = None;
            for candidate in self.columns.iter().flat_map(|column| self.list_candidates(column, &inside, affected)) {
                if chosen.iter().any(|known| known.column() == candidate.column()) {
                    continue;
                }
                let mut narrowed = inside.clone();
                self.apply_condition(&mut narrowed, &candidate);
                let mut all = chosen.clone();
                all.push(candidate.clone());
                let worth = self.compute_gain(&narrowed, affected) - compute_penalty(&all);
                if best.as_ref().is_none_or(|(most, _)| worth > *most) {
                    best = Some((worth, candidate));
                }
            }
            let Some((_, condition)) = best.filter(|(worth, _)| *worth > value + 1e-9) else { break };
            let (worth, condition, narrowed) = self.refine_bounds(condition, &chosen, &inside, affected);
            (value, inside) = (worth, narrowed);
            chosen.push(condition);
        }
        chosen
    }

    /// Moves the bounds of a range to the value where it gains most: the thresholds that are tried first stand far apart.
    fn refine_bounds(
        &self,
        condition: Condition,
        chosen: &[Condition],
        inside: &[bool],
        affected: &[bool],
    ) -> (f64, Condition, Vec<bool>) {
        let worth = |candidate: Condition| {
            let mut narrowed = inside.to_vec();
            self.apply_condition(&mut narrowed, &candidate);
            let gain = self.compute_gain(&narrowed, affected)
                - compute_penalty(&[chosen, std::slice::from_ref(&candidate)].concat());
            (gain, candidate, narrowed)
        };
        let sorted = self.list_distinct_values(condition.column(), inside);
        let mut best = worth(condition);
        let mut step = sorted.len().div_ceil(2 * THRESHOLDS_TRIED);
        while step > 0 && !sorted.is_empty() {
            for candidate in shift_bounds(&best.1, &sorted, step) {
                let other = worth(candidate);
                if other.0 > best.0 {
                    best = other;
                }
            }
            step /= 2;
        }
        best
    }

    /// The different values of a column of numbers within, in order.
    fn list_distinct_values(&self, column: &str, inside: &[bool]) -> Vec<f64> {
        let named = |of: &&PlaceColumn<'_>| matches!(of, PlaceColumn::Numbers(name, _) if name == column);
        let Some(PlaceColumn::Numbers(_, values)) = self.columns.iter().find(named) else { return Vec::new() };
        sort_distinct_values(values, inside)
    }

    fn list_candidates(&self, column: &PlaceColumn<'_>, inside: &[bool], affected: &[bool]) -> Vec<Condition> {
        match column {
            PlaceColumn::Numbers(name, values) => list_thresholds(values, inside)
                .into_iter()
                .flat_map(|(low, high)| build_range(name, low, high))
                .collect(),
            PlaceColumn::Words(name, words) => self.list_word_conditions(name, words, inside, affected),
        }
    }

    /// The words that hold most of the affected for their rows: the first one, the first two, and so on.
    fn list_word_conditions(&self, name: &str, words: &Words, inside: &[bool], affected: &[bool]) -> Vec<Condition> {
        let mut counts = vec![(0_usize, 0_usize); words.words().len()];
        for ((row, inside), affected) in self.rows.iter().zip(inside).zip(affected) {
            if let Some(code) = words.find_code(*row).filter(|_| *inside) {
                counts[code as usize].0 += usize::from(*affected);
                counts[code as usize].1 += 1;
            }
        }
        let affected_share = |code: &usize| compute_share(counts[*code].0, counts[*code].1);
        let mut order: Vec<usize> = (0..counts.len()).filter(|code| counts[*code].1 > 0).collect();
        order.sort_by(|a, b| affected_share(b).total_cmp(&affected_share(a)));
        (1..=WORDS_MAX.min(order.len().saturating_sub(1)))
            .map(|count| {
                let mut list: Vec<usize> = order[..count].to_vec();
                list.sort_unstable();
                Condition::Equals {
                    column: name.to_owned(),
                    words: list.into_iter().map(|code| words.words()[code].clone()).collect(),
                }
            })
            .collect()
    }
}

/// Beside its greatest value so small a value of a column is zero: what a computation leaves of it is no place.
const NOTHING: f64 = 1e-9;

fn read_values(numbers: &Numbers, rows: &[usize]) -> Vec<Option<f64>> {
    let top = numbers.present_values().fold(0.0_f64, |top, x| top.max(x.abs()));
    let value = |row: &usize| numbers.get(*row).map(|x| if x.abs() < NOTHING * top { 0.0 } else { x });
    rows.iter().map(value).collect()
}

/// So many of so many.
fn compute_share(part: usize, whole: usize) -> f64 {
    count_to_f64(part) / count_to_f64(whole.max(1))
}

fn compute_penalty(conditions: &[Condition]) -> f64 {
    let words = |condition: &Condition| match condition {
        Condition::Equals { words, .. } => count_to_f64(words.len().saturating_sub(1)),
        Condition::Range { min: Some(_), max: Some(_), .. } => 0.5,
        Condition::Range { .. } => 0.0,
    };
    conditions.iter().map(|condition| CONDITION_PRICE + WORD_PRICE * words(condition)).sum()
}

/// A person can set it or see it, and it is not what the effect acts on.
fn is_place_column(name: &str, output: &str) -> bool {
    let measured =
        [Quantity::Power, Quantity::Current, Quantity::Force, Quantity::Torque, Quantity::Load, Quantity::Displacement];
    name != output && !name.starts_with("simulated_") && !measured.contains(&Quantity::from_column_name(name))
}

fn compute_time_in_run_s(recording: &Recording, rows: &[usize]) -> Vec<Option<f64>> {
    let runs = recording.list_runs();
    let start = |row: usize| runs.get(runs.partition_point(|run| run.rows.end <= row)).map(|run| run.rows.start);
    rows.iter().map(|row| Some(recording.time_s[*row] - recording.time_s[start(*row)?])).collect()
}

/// The different values within, in order.
fn sort_distinct_values(values: &[Option<f64>], inside: &[bool]) -> Vec<f64> {
    let mut sorted: Vec<f64> =
        values.iter().zip(inside).filter(|(_, inside)| **inside).filter_map(|(value, _)| *value).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    sorted
}

/// The same range with one bound moved by so many values, up and down; a bound lies between two values.
fn shift_bounds(condition: &Condition, sorted: &[f64], step: usize) -> Vec<Condition> {
    let Condition::Range { column, min, max } = condition else { return Vec::new() };
    let moved = |bound: f64| {
        let at = sorted.partition_point(|value| *value < bound);
        [at.saturating_sub(step), (at + step).min(sorted.len() - 1)]
            .into_iter()
            .filter(|at| *at > 0)
            .map(|at| f64::midpoint(sorted[at - 1], sorted[at]))
    };
    let range = |min: Option<f64>, max: Option<f64>| Condition::Range { column: column.clone(), min, max };
    let of_min = min.iter().flat_map(|bound| moved(*bound)).map(|bound| range(Some(bound), *max));
    let of_max = max.iter().flat_map(|bound| moved(*bound)).map(|bound| range(*min, Some(bound)));
    of_min.chain(of_max).collect()
}

/// Pairs of neighbouring values at even shares of the rows that are inside: a threshold lies between both.
fn list_thresholds(values: &[Option<f64>], inside: &[bool]) -> Vec<(f64, f64)> {
    let sorted = sort_distinct_values(values, inside);
    if sorted.len() < 2 {
        return Vec::new();
    }
    let count = THRESHOLDS_TRIED.min(sorted.len() - 1);
    let mut places: Vec<usize> = (0..count).map(|k| (2 * k + 1) * (sorted.len() - 1) / (2 * count)).collect();
    places.dedup();
    let bounds: Vec<f64> = places.into_iter().map(|place| f64::midpoint(sorted[place], sorted[place + 1])).collect();
    let mut pairs: Vec<(f64, f64)> = bounds.iter().map(|bound| (*bound, f64::INFINITY)).collect();
    pairs.extend(bounds.iter().map(|bound| (f64::NEG_INFINITY, *bound)));
    for (index, low) in bounds.iter().enumerate() {
        pairs.extend(bounds[index + 1..].iter().map(|high| (*low, *high)));
    }
    pairs
}

fn build_range(name: &str, low: f64, high: f64) -> Option<Condition> {
    Some(Condition::Range {
        column: name.to_owned(),
        min: low.is_finite().then_some(low),
        max: high.is_finite().then_some(high),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::Cells;

    /// 24 parts, an edge changed every six; an effect from the second minute of an edge on.
    fn recording() -> (Recording, Vec<f64>) {
        let rows = 24 * 30;
        let mut recording = Recording::new("t", (0..rows).map(f64::from).collect(), None);
        let number = |of: &dyn Fn(i32) -> f64| Cells::Numbers((0..rows).map(|row| Some(of(row))).collect::<Numbers>());
        recording.set_column("spindle_speed_rpm", number(&|row| f64::from(800 + 400 * (row % 3))));
        recording.set_column("engaged", number(&|_| 1.0));
        recording.set_column("spindle_power_w", number(&|row| f64::from(row)));
        let text = |of: &dyn Fn(i32) -> String| {
            Cells::Words((0..rows).map(of).collect::<Vec<_>>().iter().map(String::as_str).collect::<Words>())
        };
        recording.set_column("run", text(&|row| format!("Teil {}", row / 30 + 1)));
        recording.set_column("tool", text(&|row| format!("T{}", row / 180)));
        let effect = (0..rows).map(|row| if row % 180 >= 60 { 50.0 } else { 0.0 }).collect();
        (recording, effect)
    }

    #[test]
    fn a_threshold_is_told_and_not_a_list_of_runs() {
        let (recording, effect) = recording();
        let search = PlaceSearch::new(&recording, "spindle_power_w");
        let active: Vec<bool> = effect.iter().map(|x| *x > 0.0).collect();
        let found = search.find_conditions(&active);
        let [Condition::Range { column, min: Some(min), max: None }] = &found[..] else { panic!("{found:?}") };
        assert_eq!(column, "cutting_time_min");
        assert!((min - 1.0).abs() < 0.1, "{min}");
    }

    #[test]
    fn what_acts_everywhere_needs_no_words() {
        let (recording, _) = recording();
        let search = PlaceSearch::new(&recording, "spindle_power_w");
        assert!(search.find_conditions(&vec![true; recording.count_rows()]).is_empty());
    }
}
