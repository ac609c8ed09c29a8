//! What puts a name in doubt although nothing else explains as much: rows that took no part show little of it, or tools,
//! operations, parts and passes each ask for a coefficient of their own where a law of the machine has one for all.

use super::agreement::{Grouping, differs_in_any, is_of_the_machine, runs};
use super::designs::AT_EDGES;
use super::diagnose::Case;
use super::fit::Fit;
use super::frame::Frame;
use super::noise::Arma;
use super::search::Hypothesis;
use crate::statistics::robust_deviation;
use std::collections::BTreeMap;

/// Share of what is named that the rows held out must show, and deviations of chance by which they must show less than
/// all of it to be in doubt. Of names that are right one in a hundred is (`tests/concealed`).
const SHOWN_MIN: f64 = 0.65;
const DEVIATE: f64 = 1.8;
/// Robust deviations of the innovations beyond which a row is stray.
const STRAY: f64 = 6.0;
/// Columns of words whose groups must agree, and the share of a coefficient by which they may differ.
const GROUPS: [&str; 4] = ["tool", "operation", "part", "lot"];
const SHARE_MAX: f64 = 0.45;
/// The same for passes: the same law is not quite the same in every one.
const SHARE_OF_PASSES_MAX: f64 = 0.65;
/// Kinds that follow a tool's use or warm up anew in every pass, or that drift, or whose size is that of few rows.
const MAY_DIFFER: [&str; 6] =
    ["flank_wear", "bearing_warm_up", "zero_drift", "override_delay", "clock_lag", "meter_window"];

/// The outputs that two fits simulate for every row.
pub(super) struct Totals<'a> {
    pub(super) before: &'a [f64],
    pub(super) after: &'a [f64],
}

/// How much of what a fit adds the rows held out show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shown {
    /// Its coefficient there: one where it is as large as named.
    share: f64,
    /// Standard deviation of that.
    deviation: f64,
}

impl Shown {
    fn is_too_little(self) -> bool {
        self.share < SHOWN_MIN && 1.0 - self.share > DEVIATE * self.deviation
    }
}

impl Case<'_> {
    /// How much of what one fit adds to another the rows held out show, in its own noise; `None` where nothing was held out
    /// or nothing is added.
    pub(super) fn shown(&self, after: &Fit, totals: &Totals<'_>) -> Option<Shown> {
        let held = &self.told().held_frame;
        let [before, after] = [totals.before, totals.after].map(|total| self.innovations_of(total, held, after.noise));
        let stray = STRAY * robust_deviation(after.iter().copied())?;
        let (mut along, mut added, mut rows) = (0.0, 0.0, 0.0);
        let mut left = 0.0;
        for (before, after) in before.iter().zip(&after).filter(|(b, a)| b.abs().min(a.abs()) < stray) {
            along += before * (before - after);
            added += (before - after).powi(2);
            left += after.powi(2).min(stray * stray);
            rows += 1.0;
        }
        let deviation = (left / rows / added).sqrt();
        (added > 0.0 && deviation.is_finite()).then(|| Shown { share: along / added, deviation })
    }

    fn innovations_of(&self, total: &[f64], frame: &Frame, noise: Arma) -> Vec<f64> {
        let recorded = self.told().scene.recorded();
        let left: Vec<f64> = recorded.iter().zip(total).map(|(recorded, simulated)| recorded - simulated).collect();
        frame.evened(&frame.reduce(&left), noise)
    }

    /// Which of the named kinds is put in doubt, given what the rows held out show of all of them.
    pub(super) fn doubted(&self, best: &Hypothesis, shown: Option<Shown>) -> Option<String> {
        let kind = |position: usize| best.fit.parts[best.first_part() + position].kind.as_str();
        let mut members = 0..best.members.len();
        // Of edges the rows held out may have none.
        let follows_a_law = |position: usize| is_of_the_machine(kind(position)) && !AT_EDGES.contains(&kind(position));
        if shown.is_some_and(Shown::is_too_little) && members.clone().all(follows_a_law) {
            return members.next().map(|position| kind(position).to_owned());
        }
        let groupings = self.groupings();
        let differs = |position: usize| {
            !MAY_DIFFER.contains(&kind(position))
                && differs_in_any(&best.fit, &self.frame, best.first_part() + position, &groupings)
        };
        members.find(|position| differs(*position)).map(|position| kind(position).to_owned())
    }

    /// The groups that must agree: tools and other words, runs, passes.
    fn groupings(&self) -> Vec<Grouping> {
        let groups = 0..self.frame.len();
        let of_column = |name: &&str| {
            let words = self.scene.words(name)?;
            let mut seen = BTreeMap::new();
            let mut number = |group: usize| {
                let next = seen.len();
                let word = words.get(self.frame.rows(group).start)?;
                Some(*seen.entry(word.to_owned()).or_insert(next))
            };
            Some(Grouping { group: groups.clone().map(&mut number).collect(), share_max: SHARE_MAX })
        };
        let passes = self.scene.passes();
        let pass = |group: usize| passes.iter().position(|pass| pass.contains(&self.frame.rows(group).start));
        let runs = Grouping { group: runs(&self.frame), share_max: SHARE_MAX };
        let passes = Grouping { group: groups.clone().map(pass).collect(), share_max: SHARE_OF_PASSES_MAX };
        GROUPS.iter().filter_map(of_column).chain([runs, passes]).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::twin::{Diagnosis, diagnose, parse_model};
    use adapters::recording::read_csv;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use std::fmt::Write;

    /// A slide in twelve runs with six tools, each of which drags by so much, N s/m, that a model of its mass lacks.
    fn found(drag: [f64; 6], drag_held_out: f64) -> Diagnosis {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(7);
        let mut text = String::from("time_s,run,tool,velocity_m_s,acceleration_m_s2,axis_force_n\n");
        for row in 0..2400_u32 {
            let (run, tool, t) = (row / 200, row / 40 % 6, 0.5 * f64::from(row));
            let (velocity, acceleration) = (0.1 * (t / 3.0).sin() + 0.05 * (t / 7.3).sin(), 0.033 * (t / 3.0).cos());
            let noise: f64 = StandardNormal.sample(&mut rng);
            let drag = if run % 4 == 3 { drag_held_out } else { drag[tool as usize] };
            let force = 100.0 * acceleration + drag * velocity + noise;
            writeln!(text, "{t},r{run},T{tool},{velocity:.5},{acceleration:.5},{force:.3}").expect("a string takes it");
        }
        let model = "schema = \"model/1\"\noutput = \"axis_force_n\"\n[[effect]]\nkind = \"axis_inertia\"\n\
                     parameters = { mass_kg = 100.0 }\n";
        let recording = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        diagnose(&recording, &parse_model(model).expect("fine"), 1).expect("comparable")
    }

    fn told(found: &Diagnosis) -> (Vec<&str>, Vec<&str>) {
        let named = found.missing.iter().map(|missing| missing.effect.as_str()).collect();
        (named, found.alternatives.iter().map(|other| other.effect.as_str()).collect())
    }

    /// Is the name told with a doubt?
    fn doubted(found: &Diagnosis) -> bool {
        found.missing[0].statement.contains("not ruled out") || !found.alternatives.is_empty()
    }

    #[test]
    fn one_law_for_every_tool_and_every_run_is_beyond_doubt() {
        let found = found([30.0; 6], 30.0);
        assert_eq!((told(&found), doubted(&found)), ((vec!["viscous_friction"], vec![]), false));
    }

    #[test]
    fn a_law_that_every_tool_has_its_own_of_may_be_something_else() {
        let found = found([60.0, 30.0, 0.0, 45.0, 15.0, 30.0], 30.0);
        assert_eq!((told(&found).0, doubted(&found)), (vec!["viscous_friction"], true), "{}", found.debug);
    }

    #[test]
    fn what_rows_held_out_hardly_confirm_may_be_something_else() {
        let found = found([30.0; 6], 17.0);
        let fit = found.fit.as_ref().expect("fitted");
        assert!(!fit.carries_little(), "{}", found.debug);
        assert_eq!((told(&found).0, doubted(&found)), (vec!["viscous_friction"], true), "{}", found.debug);
    }
}
