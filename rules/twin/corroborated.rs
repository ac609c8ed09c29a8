//! Causes that another drive shows by itself. Where the load of the feed drives grows with the use of each tool and
//! settles in each pass, wear and settling are no longer two guesses among many: they are tested first, together and
//! each beside the other, not against the best that chance makes of the whole catalogue (a fixed sequence of tests keeps
//! the error rate). Alone, each hides the other: the pass falls while the edge wears.

use super::gate::p_value;
use super::scan::HypothesisBank;
use super::search::{EffectSearch, Hypothesis, P_MAX};

/// Kinds that describe what happens within a pass.
const WITHIN_A_PASS: [&str; 2] = ["entry_exit", "depth_taper"];

/// The p-value of wear that must not be exceeded beside a settling that stands at half of [`P_MAX`]: that the tools wear
/// is beyond doubt, the question is only whether this output shows it, and a wrong yes adds a little wear to tools that
/// do wear.
const SHOWN_P_MAX: f64 = 0.1;

impl EffectSearch<'_, '_> {
    /// The hypothesis of the causes that the feed drives show, as far as this output shows them too, with their
    /// p-values.
    pub(super) fn corroborated(&mut self, from: &Hypothesis) -> Option<(Hypothesis, Vec<f64>)> {
        self.data.scene.feed_load_growth()?;
        let wear = self.designs_of(&["flank_wear"]);
        let settling = self.designs_of(&WITHIN_A_PASS);
        let worn = self.best_of(from, &wear);
        let settled = self.best_of(from, &settling);
        let both = settled.as_ref().and_then(|settled| self.best_of(settled, &wear));
        if let (Some(both), Some(settled), Some(worn)) = (&both, &settled, &worn) {
            let of_wear = self.p_of(settled, both, &wear);
            let of_settling = self.p_of(worn, both, &settling);
            if of_wear <= SHOWN_P_MAX && of_settling <= 0.5 * P_MAX {
                return Some((both.clone(), vec![of_settling, of_wear]));
            }
        }
        let alone = |found: Option<Hypothesis>, designs: &[usize]| {
            let found = found?;
            let p = self.p_of(from, &found, designs);
            (p <= P_MAX).then(|| (found, vec![p]))
        };
        alone(settled, &settling).or_else(|| alone(worn, &wear))
    }

    fn designs_of(&self, kinds: &[&str]) -> Vec<usize> {
        let all = self.bank.designs.iter().enumerate();
        all.filter(|(_, design)| kinds.contains(&design.kind.as_str())).map(|(index, _)| index).collect()
    }

    fn best_of(&mut self, from: &Hypothesis, designs: &[usize]) -> Option<Hypothesis> {
        let fitted: Vec<Hypothesis> = designs.iter().filter_map(|design| self.with(from, *design)).collect();
        fitted.into_iter().max_by(|a, b| a.information.total_cmp(&b.information))
    }

    /// Could noise alone have made one of these designs as good on top of `from` as it is in `best`?
    fn p_of(&self, from: &Hypothesis, best: &Hypothesis, designs: &[usize]) -> f64 {
        let designs: Vec<_> = designs.iter().map(|index| self.bank.designs[*index].clone()).collect();
        let bank = HypothesisBank::new(&designs, self.bank.frame());
        p_value(&bank, &from.fit, &best.fit, None, self.ln_rows, self.seed, false)
    }
}
