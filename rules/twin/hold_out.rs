//! Units of hold-out: the runs, or stretches of them where there are few; and which of them take no part.
//!
//! Those that are held out stand for the others: of many random choices the one is taken whose tools, operations, lots and
//! operating points are most like those of the whole recording. So no tool, no operation and no place of a program that
//! repeats is held out as a whole where another choice exists.

use numerics::statistics::{count_to_f64, quantile};
use physics::Scene;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Runs below which stretches of runs are units, and stretches that are wanted then.
const RUNS_MIN: usize = 4;
const STRETCHES: usize = 24;
/// Rows of a stretch at least.
const STRETCH_ROWS: usize = 10;
/// One unit in so many is held out.
pub(super) const FOLDS: usize = 4;
/// Choices that are compared.
const CHOICES: u64 = 400;
/// Columns of words that a choice should represent.
const WORDS: [&str; 6] = ["tool", "lot", "operation", "program", "part", "pass"];
/// Share of the rows of a unit beyond the ends of its range.
const ENDS: f64 = 0.03;
/// Words of a column beyond which each is nearly a unit of its own and nothing is represented.
const WORDS_MAX: usize = 64;

/// A stretch of rows that is held out, or not, as a whole.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unit {
    /// The run's name; with a part number where one run is cut into several units.
    pub name: String,
    /// The rows of the scene that it covers.
    pub rows: Range<usize>,
}

/// Units of hold-out of a scene.
#[must_use]
pub fn list_units(scene: &Scene) -> Vec<Unit> {
    split_into_units(scene.runs(), scene.run_names())
}

/// The same from the rows and names of the runs.
#[must_use]
pub fn split_into_units(runs: &[Range<usize>], names: &[String]) -> Vec<Unit> {
    let named = runs.iter().zip(names);
    if runs.len() >= RUNS_MIN {
        return named.map(|(rows, name)| Unit { name: name.clone(), rows: rows.clone() }).collect();
    }
    let per_run = (STRETCHES / runs.len().max(1)).max(1);
    named.flat_map(|(rows, name)| split_run(rows, name, per_run)).collect()
}

fn split_run(rows: &Range<usize>, name: &str, wanted: usize) -> Vec<Unit> {
    let parts = wanted.min(rows.len() / STRETCH_ROWS).max(1);
    let edge = |index: usize| rows.start + rows.len() * index / parts;
    (0..parts)
        .map(|index| Unit { name: format!("{name}[{}/{parts}]", index + 1), rows: edge(index)..edge(index + 1) })
        .collect()
}

/// Random numbers from a seed (splitmix64): the same recording gives the same answer.
#[derive(Debug, Clone)]
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// A number between 0 and 1.
    pub(super) fn draw_uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        #[expect(clippy::cast_precision_loss, reason = "53 bits")]
        let share = (z >> 11) as f64;
        (share + 0.5) / 9_007_199_254_740_992.0
    }

    /// A random order of so many things.
    pub(super) fn draw_permutation(&mut self, size: usize) -> Vec<usize> {
        let mut keyed: Vec<(f64, usize)> = (0..size).map(|index| (self.draw_uniform(), index)).collect();
        keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
        keyed.into_iter().map(|(_, index)| index).collect()
    }
}

/// Which units take no part: a quarter of those that have rows to compare, none of fewer than four.
#[must_use]
pub(super) fn select_held_out_units(scene: &Scene, units: &[Unit], seed: u64) -> BTreeSet<usize> {
    let rows = |unit: usize| units[unit].rows.clone().filter(|row| scene.usable_rows()[*row]).count();
    let known: Vec<usize> = (0..units.len()).filter(|unit| rows(*unit) > 0).collect();
    if known.len() < FOLDS {
        return BTreeSet::new();
    }
    let wanted = known.len() / FOLDS;
    let features = Features::from_units(scene, units, &known);
    let mut best: Option<(f64, BTreeSet<usize>)> = None;
    for choice in 0..CHOICES {
        let order = Random::new(seed.wrapping_mul(CHOICES).wrapping_add(choice)).draw_permutation(known.len());
        let chosen: BTreeSet<usize> = order[..wanted].iter().copied().collect();
        let distance = features.compute_distance(&chosen);
        if best.as_ref().is_none_or(|best| distance < best.0) {
            best = Some((distance, chosen));
        }
    }
    best.map(|(_, chosen)| chosen.into_iter().map(|index| known[index]).collect()).unwrap_or_default()
}

/// What tells units apart, standardised: one list per unit.
struct Features {
    of_unit: Vec<Vec<f64>>,
    /// For each word of a column: the units that hold it.
    holders: Vec<BTreeSet<usize>>,
}

impl Features {
    fn from_units(scene: &Scene, units: &[Unit], known: &[usize]) -> Self {
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let over_units = |of: &dyn Fn(&[f64]) -> f64, values: &[f64]| -> Vec<f64> {
            known.iter().map(|unit| of(&values[units[*unit].rows.clone()])).collect()
        };
        let end = |values: &[f64], share: f64| quantile(values.iter().copied(), share).unwrap_or(0.0);
        let names = scene.column_names().filter(|name| *name != scene.output_name());
        for values in names.filter_map(|name| scene.column(name)).chain(scene.simulated_output()) {
            columns.push(over_units(&numerics::statistics::mean, values));
            // What is held out should lie within what is fitted.
            columns.push(over_units(&|values| end(values, ENDS), values));
            columns.push(over_units(&|values| end(values, 1.0 - ENDS), values));
        }
        let place: Vec<f64> = (0..known.len()).map(count_to_f64).collect();
        columns.push(place.iter().map(|at| (at - 0.5 * count_to_f64(known.len())).abs()).collect());
        columns.push(place);
        let mut holders = Vec::new();
        for name in WORDS {
            let Some(words) = scene.text_column(name).filter(|words| words.words().len() <= WORDS_MAX) else {
                continue;
            };
            let mut of_word: BTreeMap<u32, BTreeSet<usize>> = BTreeMap::new();
            for (index, unit) in known.iter().enumerate() {
                let codes: BTreeSet<u32> = units[*unit].rows.clone().filter_map(|row| words.find_code(row)).collect();
                codes.into_iter().for_each(|code| {
                    of_word.entry(code).or_default().insert(index);
                });
            }
            holders.extend(of_word.into_values().filter(|units| units.len() > 1));
        }
        let columns: Vec<Vec<f64>> = columns.into_iter().filter_map(standardise_column).collect();
        let of_unit = (0..known.len()).map(|unit| columns.iter().map(|column| column[unit]).collect()).collect();
        Self { of_unit, holders }
    }

    /// How unlike the whole a choice is.
    fn compute_distance(&self, chosen: &BTreeSet<usize>) -> f64 {
        let size = count_to_f64(chosen.len());
        let columns = self.of_unit.first().map_or(0, Vec::len);
        let mean = |column: usize| chosen.iter().map(|unit| self.of_unit[*unit][column]).sum::<f64>() / size;
        // The mean of so many independent units differs from that of all by one over their number.
        let points: f64 =
            (0..columns).map(|column| size * mean(column).powi(2)).sum::<f64>() / count_to_f64(columns.max(1));
        let share = size / count_to_f64(self.of_unit.len());
        let word = |holders: &BTreeSet<usize>| {
            let held = count_to_f64(holders.intersection(chosen).count());
            let expected = share * count_to_f64(holders.len());
            let alone = if held >= count_to_f64(holders.len()) { 10.0 } else { 0.0 };
            (held - expected).powi(2) / expected + alone
        };
        let words: f64 = self.holders.iter().map(word).sum::<f64>() / count_to_f64(self.holders.len().max(1));
        points + words
    }
}

/// A column of mean zero and deviation one; nothing where it does not change.
fn standardise_column(column: Vec<f64>) -> Option<Vec<f64>> {
    let middle = numerics::statistics::mean(&column);
    let spread = numerics::statistics::rms(&column.iter().map(|x| x - middle).collect::<Vec<_>>());
    (spread > 1e-9 * middle.abs().max(1e-12)).then(|| column.iter().map(|x| (x - middle) / spread).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::Recording;
    use recording::{Cells, Numbers, Words};

    /// Runs of ten rows each: depth and tool by the number of the run.
    fn scene(runs: usize, depth: impl Fn(usize) -> f64, tool: impl Fn(usize) -> String) -> Scene {
        let rows = 10 * runs;
        let mut recording = Recording::new("test", (0..rows).map(count_to_f64).collect(), None);
        let words = |of: &dyn Fn(usize) -> String| {
            let all: Vec<String> = (0..rows).map(|row| of(row / 10)).collect();
            Cells::Words(all.iter().map(String::as_str).collect::<Words>())
        };
        recording.set_column("run", words(&|run| run.to_string()));
        recording.set_column("tool", words(&tool));
        let depths = (0..rows).map(|row| depth(row / 10)).collect();
        recording.set_column("depth_of_cut_mm", Cells::Numbers(Numbers::from_values(depths)));
        recording.set_column("spindle_power_w", Cells::Numbers(Numbers::from_values(vec![1.0; rows])));
        Scene::new(&recording, "spindle_power_w", &BTreeMap::new()).expect("a scene")
    }

    #[test]
    fn no_place_of_a_plan_that_repeats_is_held_out_as_a_whole() {
        let scene = scene(24, |run| count_to_f64(run % 4), |_| "T1".to_owned());
        let held = select_held_out_units(&scene, &list_units(&scene), 1);
        assert_eq!(held.len(), 6);
        for place in 0..4 {
            let of_place = held.iter().filter(|unit| **unit % 4 == place).count();
            assert!((1..=3).contains(&of_place), "place {place}: {held:?}");
        }
    }

    #[test]
    fn a_tool_that_several_runs_share_is_not_held_out_as_a_whole() {
        let scene = scene(8, |_| 1.0, |run| format!("T{}", run / 2));
        for seed in 0..5 {
            let held = select_held_out_units(&scene, &list_units(&scene), seed);
            assert!((0..4).all(|tool| !(held.contains(&(2 * tool)) && held.contains(&(2 * tool + 1)))), "{held:?}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_choice() {
        let scene = scene(40, count_to_f64, |run| format!("T{run}"));
        let units = list_units(&scene);
        assert_eq!(select_held_out_units(&scene, &units, 3), select_held_out_units(&scene, &units, 3));
        assert_ne!(select_held_out_units(&scene, &units, 3), select_held_out_units(&scene, &units, 4));
    }
}
