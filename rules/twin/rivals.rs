//! Rivals of the best hypothesis, fitted from where it stands: a class is told by likelihoods, and these are worth comparing
//! only where each has found its best noise and its best baseline.

use super::model::Part;
use super::search::{EffectSearch, Hypothesis};
use std::collections::BTreeSet;

/// Information by which a rival may be behind before it is fitted again.
const BEHIND_MAX: f64 = 30.0;
/// Information by which a rival must then be better to stand in its place.
const BETTER: f64 = 1.0;
/// Rivals that are fitted again.
const RIVALS: usize = 5;

/// A hypothesis with another kind in the place of one member.
struct Rival {
    members: Vec<usize>,
    place: usize,
    /// What stands there, as it was fitted.
    part: Part,
}

impl EffectSearch<'_, '_> {
    /// The best after its near rivals have been fitted again from where it stands.
    pub(super) fn beside_rivals(&mut self, mut best: Hypothesis) -> Hypothesis {
        for rival in self.rivals(&best) {
            let mut parts = best.fit.parts.clone();
            parts[self.base.parts.len() + rival.place] = rival.part;
            let Some(again) = self.fitted(rival.members, &parts, best.fit.noise) else { continue };
            if again.information > best.information + BETTER {
                self.tried.push(std::mem::replace(&mut best, again));
                break;
            }
            self.tried.push(again);
        }
        best
    }

    /// The nearest of each kind and place among those that were tried, best first.
    fn rivals(&self, best: &Hypothesis) -> Vec<Rival> {
        let kind = |member: usize| self.bank.designs[member].kind.as_str();
        let near = |other: &&Hypothesis| {
            other.members.len() == best.members.len() && best.information - other.information < BEHIND_MAX
        };
        let mut near: Vec<&Hypothesis> = self.tried.iter().filter(near).collect();
        near.sort_by(|a, b| b.information.total_cmp(&a.information));
        let mut seen = BTreeSet::new();
        let mut rivals = Vec::new();
        for other in near {
            let Some((place, new)) = swapped(best, other) else { continue };
            let (gone, came) = (kind(best.members[place]), kind(other.members[new]));
            if gone != came && rivals.len() < RIVALS && seen.insert((place, came)) {
                let mut members = best.members.clone();
                members[place] = other.members[new];
                rivals.push(Rival { members, place, part: other.fit.parts[self.base.parts.len() + new].clone() });
            }
        }
        rivals
    }
}

/// The one place in which two hypotheses differ: in the first, and in the other.
fn swapped(one: &Hypothesis, other: &Hypothesis) -> Option<(usize, usize)> {
    let alone = |of: &Hypothesis, than: &Hypothesis| {
        let mut new = (0..of.members.len()).filter(|at| !than.members.contains(&of.members[*at]));
        let first = new.next()?;
        new.next().is_none().then_some(first)
    };
    alone(one, other).zip(alone(other, one))
}
