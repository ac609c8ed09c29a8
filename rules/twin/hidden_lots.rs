//! Lots that nobody wrote down: stretches of runs in which the cut is heavier or lighter, read from what the baseline
//! leaves.
//!
//! Where the lots are recorded they are the places at which material may change, and nothing is guessed. Where they are
//! not, an odd lot between others is a stretch of runs, and several lots are stretches one after another. Which runs
//! these are is read from the runs that are fitted, from two sums of each (the best segmentation by dynamic programming:
//! Bellman, Communications of the ACM 4 (1961), 284), and paid for as one choice of so many.

use super::designs::{Design, design, wanted};
use super::diagnose::Case;
use super::fit::Fit;
use super::linear::dot;
use crate::physics::catalogue::hardness_batch::{LOTS_MAX, odd_lot, unwritten_lots};
use crate::physics::{Form, effect};
use crate::statistics::count;
use std::ops::Range;

/// Runs of which a lot consists at least.
const LOT_RUNS_MIN: usize = 2;
/// Runs beyond which no stretches are looked for.
const RUNS_MAX: usize = 500;

impl Case<'_> {
    /// The likeliest odd lot and the likeliest lots of each number, where the recording names none.
    pub(super) fn hidden_lots(&self, base: &Fit) -> Vec<Design> {
        let named = self.scene.words("lot").is_some_and(|lots| lots.words().len() > 1);
        let runs = self.scene.runs().len();
        let Some(effect) = effect("hardness_batch").filter(|effect| wanted(*effect, self.model)) else {
            return Vec::new();
        };
        if named || runs > RUNS_MAX {
            return Vec::new();
        }
        let Some(sums) = self.sums_of_runs(base) else { return Vec::new() };
        let apart = |starts: &[usize]| !self.follow_the_tools(starts);
        let odd = sums
            .odd()
            .filter(|(lot, _)| apart(&[lot.start, lot.end]))
            .map(|(lot, choices)| odd_lot(&self.scene, lot.start, lot.end - 1, choices.ln()));
        let lots = (3..=LOTS_MAX).filter_map(|lots| {
            let starts = sums.starts(lots).filter(|starts| apart(starts))?;
            Some(unwritten_lots(&self.scene, &starts, ln_ways(runs, lots - 1)))
        });
        odd.into_iter().chain(lots).filter_map(|form| design(effect, &form, &self.scene, &self.frame)).collect()
    }

    /// Do most of these runs begin with a new tool? Then it is the tools that differ.
    fn follow_the_tools(&self, starts: &[usize]) -> bool {
        let Some(tools) = self.scene.words("tool") else { return false };
        let tool = |run: usize| tools.get(self.scene.runs()[run].start);
        let with_a_tool = starts.iter().filter(|run| tool(**run) != tool(**run - 1)).count();
        2 * with_a_tool > starts.len()
    }

    /// What each run tells of the weight of its cut.
    fn sums_of_runs(&self, base: &Fit) -> Option<RunSums> {
        let first = self.scene.run_names().first()?.clone();
        let always = Form { name: "step", place: Some(("run".to_owned(), first)), ..Form::default() };
        let (_, cut) = effect("hardness_batch")?.columns(&self.scene, &always)?.pop()?;
        let cut = self.frame.whiten(&self.frame.reduce(&cut), base.noise);
        let left = base.innovations(&self.frame);
        let mut sums = RunSums(vec![(0.0, 0.0)]);
        let mut group = 0;
        for run in self.scene.runs() {
            let begin = group;
            while group < self.frame.len() && self.frame.rows(group).start < run.end {
                group += 1;
            }
            let (cut, left) = (&cut[begin..group], &left[begin..group]);
            let (xx, xy) = sums.0[sums.0.len() - 1];
            sums.0.push((xx + dot(cut, cut), xy + dot(cut, left)));
        }
        Some(sums)
    }
}

/// Running sums over the runs: of the cut squared, and of the cut times what is left.
struct RunSums(Vec<(f64, f64)>);

impl RunSums {
    /// The stretch of runs that explains most with a gain of its own, and among how many it was chosen.
    fn odd(&self) -> Option<(Range<usize>, f64)> {
        let runs = self.0.len() - 1;
        let mut best: Option<(f64, Range<usize>)> = None;
        let mut choices = 0.0;
        for start in LOT_RUNS_MIN..runs {
            for end in start + LOT_RUNS_MIN..=runs.saturating_sub(LOT_RUNS_MIN) {
                let (before, lot, after) = (self.of(0..start), self.of(start..end), self.of(end..runs));
                let all = explained((before.0 + after.0, before.1 + after.1)) + explained(lot);
                choices += 1.0;
                if best.as_ref().is_none_or(|(most, _)| all > *most) {
                    best = Some((all, start..end));
                }
            }
        }
        best.map(|(_, lot)| (lot, choices))
    }

    /// The runs that begin the second and the further lots when so many lots explain most; `None` for too few runs.
    fn starts(&self, lots: usize) -> Option<Vec<usize>> {
        let runs = self.0.len() - 1;
        if runs < lots * LOT_RUNS_MIN {
            return None;
        }
        // Per number of runs: the most that is explained, and where the last lot begins.
        let mut most: Vec<Vec<(f64, usize)>> = vec![(0..=runs).map(|end| (explained(self.of(0..end)), 0)).collect()];
        for lot in 1..lots {
            let before = &most[lot - 1];
            let best = |end: usize| {
                let begins = lot * LOT_RUNS_MIN..(end + 1).saturating_sub(LOT_RUNS_MIN);
                let all = begins.map(|start| (before[start].0 + explained(self.of(start..end)), start));
                all.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NEG_INFINITY, 0))
            };
            most.push((0..=runs).map(best).collect());
        }
        let mut starts = Vec::new();
        let mut end = runs;
        for lot in (1..lots).rev() {
            end = most[lot][end].1;
            starts.push(end);
        }
        starts.reverse();
        Some(starts)
    }

    fn of(&self, runs: Range<usize>) -> (f64, f64) {
        let (from, to) = (self.0[runs.start], self.0[runs.end]);
        (to.0 - from.0, to.1 - from.1)
    }
}

/// What a gain over these sums explains; nothing where nothing is cut.
fn explained((xx, xy): (f64, f64)) -> f64 {
    if xx > 0.0 { xy * xy / xx } else { 0.0 }
}

/// Natural logarithm of the ways to set so many edges between so many runs.
fn ln_ways(runs: usize, edges: usize) -> f64 {
    (0..edges).map(|edge| (count(runs.saturating_sub(edge).max(1)) / count(edge + 1)).ln()).sum::<f64>().max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sums(gains: &[f64]) -> RunSums {
        let mut all = vec![(0.0, 0.0)];
        for (run, gain) in gains.iter().enumerate() {
            let (xx, xy) = all[run];
            // The second run is held out.
            let weight = if run == 1 { 0.0 } else { 10.0 };
            all.push((xx + weight, xy + weight * gain));
        }
        RunSums(all)
    }

    #[test]
    fn an_odd_lot_is_the_stretch_that_stands_out() {
        let odd = sums(&[0.0, 0.0, 0.0, 0.0, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0]);
        assert_eq!(odd.odd().map(|(lot, _)| lot), Some(4..7));
    }

    #[test]
    fn lots_begin_where_the_gain_changes() {
        let three = sums(&[0.0, 0.0, 0.0, 0.0, 0.1, 0.1, 0.1, -0.2, -0.2, -0.2]);
        assert_eq!(three.starts(3), Some(vec![4, 7]));
        let four = sums(&[0.0, 0.0, 0.3, 0.3, 0.1, 0.1, 0.1, -0.2, -0.2, -0.2]);
        assert_eq!(four.starts(4), Some(vec![2, 4, 7]));
    }

    #[test]
    fn too_few_runs_have_no_lots() {
        assert_eq!(sums(&[0.0, 1.0, 0.0]).odd(), None);
        assert_eq!(sums(&[0.0, 1.0, 0.0, 0.0, 0.0]).starts(3), None);
    }
}
