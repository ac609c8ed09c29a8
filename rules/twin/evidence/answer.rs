//! The answer: verdict, names, what stands beside them, and what each contributes.

use super::posterior::Group;
use super::thresholds::THRESHOLDS;
use crate::diagnosis::{Existence, UNKNOWN, Verdict};
use std::collections::BTreeMap;

/// Another name, and what it would replace.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rival {
    pub(super) name: String,
    pub(super) instead_of: String,
    /// Nats by which it is less likely.
    pub(super) nats: f64,
}

impl Rival {
    /// Something without a name that may stand where a name is told.
    pub(super) fn new_unknown(instead_of: &str, nats: f64) -> Self {
        Self { name: UNKNOWN.to_owned(), instead_of: instead_of.to_owned(), nats }
    }
}

/// Why something that is there is not told.
#[derive(Debug, Clone)]
pub(super) struct Withdrawn {
    /// Names of what was found in the fitted rows; `unknown` where it had none.
    pub(super) found: Vec<String>,
    /// Were they fitted runs that were predicted from the others, or those held out?
    pub(super) among_fitted: bool,
    /// Root mean square errors there without it and with it, where they were computed.
    pub(super) errors: Option<(f64, f64)>,
}

#[derive(Debug, Clone)]
pub(super) struct EvidenceAnswer {
    pub(super) verdict: Verdict,
    /// Names, the most important first.
    pub(super) names: Vec<String>,
    pub(super) rivals: Vec<Rival>,
    /// The output with what is missing.
    pub(super) after: Vec<f64>,
    /// Contribution of each name.
    pub(super) contributions: Vec<(String, Vec<f64>)>,
    /// What each leaves once the baseline has been refitted.
    pub(super) remaining: Vec<(String, Vec<f64>)>,
    /// Twice the logarithm of the evidence over nothing.
    pub(super) information: f64,
    /// Probability of each name, averaged over resamples.
    pub(super) probabilities: BTreeMap<String, f64>,
    pub(super) existence: Existence,
    /// What is there and not told.
    pub(super) withdrawn: Option<Withdrawn>,
    /// Names that a curve got by projection.
    pub(super) claimed: Vec<String>,
    /// Channel of the largest nameless curve.
    pub(super) drawn_over: Option<String>,
    /// Number of the likeliest noise.
    pub(super) noise: usize,
    pub(super) debug: String,
}

/// A contribution under a name.
pub(super) type Named = (String, Vec<f64>);

impl EvidenceAnswer {
    /// Becomes what it was; what was tried meanwhile stays in the notes.
    pub(super) fn restore(&mut self, known: Self) {
        let debug = std::mem::take(&mut self.debug);
        *self = Self { debug, ..known };
    }

    /// Probability of a name; `None` of one that no set held.
    pub(super) fn find_probability(&self, name: &str) -> Option<f64> {
        self.probabilities.get(name).copied()
    }

    /// Something real that no name explains; names that come near stand beside it.
    pub(super) fn mark_unexplained(&mut self, groups: &[Group<'_>], ln: f64) {
        let mut near: Vec<(String, f64)> = self.names.iter().map(|name| (name.clone(), 0.0)).collect();
        for other in groups.iter().filter(|other| other.ln > ln - THRESHOLDS.beside) {
            for name in other.names.iter().flatten() {
                if !near.iter().any(|(known, _)| known == name) {
                    near.push((name.clone(), (ln - other.ln).max(0.0)));
                }
            }
        }
        self.rivals = Vec::new();
        self.names = Vec::new();
        self.withdraw_names(near);
    }

    /// Takes some names back: what they contribute goes to the nearest law beside each.
    pub(super) fn replace_names(&mut self, refused: &[String]) -> Vec<String> {
        let mut unnamed = Vec::new();
        for name in refused {
            let may_stand = |rival: &&Rival| rival.instead_of == *name && rival.name != UNKNOWN;
            let nearest = self.rivals.iter().filter(may_stand).min_by(|a, b| a.nats.total_cmp(&b.nats));
            // One law alone would stand there unrivalled, though it was not the best.
            let several = self.rivals.iter().filter(may_stand).count() > 1;
            let next = nearest.map(|rival| rival.name.clone()).filter(|next| several && !self.names.contains(next));
            let Some(next) = next else {
                unnamed.push(name.clone());
                continue;
            };
            self.rivals.retain(|rival| rival.name != next);
            for named in [&mut self.contributions, &mut self.remaining] {
                named.iter_mut().filter(|(known, _)| known == name).for_each(|(known, _)| next.clone_into(known));
            }
            self.names.iter_mut().filter(|known| *known == name).for_each(|known| next.clone_into(known));
            self.rivals.iter_mut().filter(|r| r.instead_of == *name).for_each(|r| next.clone_into(&mut r.instead_of));
            self.verdict = Verdict::Ambiguous;
        }
        unnamed
    }

    /// Takes some names back: what they contribute has no name. Where little is left under names, or none, all are taken back.
    pub(super) fn reject_names(&mut self, refused: &[String], energy: impl Fn(&[f64]) -> f64) {
        for all in [&mut self.contributions, &mut self.remaining] {
            let (gone, mut kept): (Vec<Named>, Vec<Named>) =
                std::mem::take(all).into_iter().partition(|(name, _)| refused.contains(name) || name == UNKNOWN);
            let rows = gone.first().map_or(0, |(_, x)| x.len());
            kept.push((UNKNOWN.to_owned(), sum_contributions(&gone, rows)));
            *all = kept;
        }
        let rows = self.remaining.first().map_or(0, |(_, x)| x.len());
        let whole = energy(&sum_contributions(&self.remaining, rows)).max(f64::MIN_POSITIVE);
        let unknown = self.remaining.iter().find(|(name, _)| name == UNKNOWN).map_or(0.0, |(_, x)| energy(x));
        self.names.retain(|name| !refused.contains(name));
        if let Some(first) = self.names.first() {
            // What stood beside a refused name stands beside what is told.
            for rival in self.rivals.iter_mut().filter(|rival| refused.contains(&rival.instead_of)) {
                first.clone_into(&mut rival.instead_of);
            }
        }
        if self.names.is_empty() || unknown > THRESHOLDS.unknown_share * whole {
            self.withdraw_names(refused.iter().map(|name| (name.clone(), 0.0)).collect());
        } else if let Some(first) = self.names.first() {
            // A part that has lost its name keeps the whole from being sure.
            self.verdict = Verdict::Ambiguous;
            let beside = |name: &String| Rival { name: name.clone(), instead_of: first.clone(), nats: 0.0 };
            let rivals: Vec<Rival> = refused.iter().map(beside).collect();
            self.rivals.extend(rivals);
        }
    }

    /// Lets a rival and what it stands beside exchange their places; gives the rival that takes this back.
    pub(super) fn exchange_name(&mut self, rival: &Rival) -> Rival {
        let Rival { name, instead_of, .. } = rival;
        for named in [&mut self.contributions, &mut self.remaining] {
            named.iter_mut().filter(|(known, _)| known == instead_of).for_each(|(known, _)| known.clone_from(name));
        }
        self.names.iter_mut().filter(|known| *known == instead_of).for_each(|known| known.clone_from(name));
        for known in &mut self.rivals {
            if known.name == *name && known.instead_of == *instead_of {
                known.name.clone_from(instead_of);
            }
            if known.instead_of == *instead_of {
                known.instead_of.clone_from(name);
            }
        }
        Rival { name: instead_of.clone(), instead_of: name.clone(), nats: rival.nats }
    }

    /// Sets a rival beside another of the names.
    pub(super) fn move_rival(&mut self, rival: &Rival, instead_of: &str) {
        let is_it = |known: &&mut Rival| known.name == rival.name && known.instead_of == rival.instead_of;
        self.rivals.iter_mut().filter(is_it).for_each(|known| instead_of.clone_into(&mut known.instead_of));
    }

    /// Takes a rival out; what was likely of it is likely of the name that it stood beside.
    pub(super) fn drop_rival(&mut self, rival: &Rival) {
        self.rivals.retain(|known| known.name != rival.name || known.instead_of != rival.instead_of);
        let mass = self.probabilities.remove(&rival.name).unwrap_or(0.0);
        let told = self.probabilities.entry(rival.instead_of.clone()).or_default();
        *told = (*told + mass).min(1.0);
    }

    /// Sets something without a name beside some names: their curves are theirs, their textbook laws are not.
    pub(super) fn add_unknown_rivals(&mut self, doubted: &[String]) {
        if self.verdict == Verdict::Unexplained {
            return;
        }
        self.verdict = Verdict::Ambiguous;
        self.rivals.extend(doubted.iter().map(|name| Rival::new_unknown(name, 0.0)));
    }

    /// Takes the names back: they and these others stand beside something without a name.
    pub(super) fn withdraw_names(&mut self, others: Vec<(String, f64)>) {
        let names = std::mem::take(&mut self.names).into_iter().map(|name| (name, 0.0));
        let rivals = std::mem::take(&mut self.rivals).into_iter().map(|rival| (rival.name, rival.nats));
        let mut near: Vec<(String, f64)> = Vec::new();
        for (name, nats) in names.chain(rivals).chain(others).filter(|(name, _)| name != UNKNOWN) {
            if !near.iter().any(|(known, _)| *known == name) {
                near.push((name, nats));
            }
        }
        let rival = |(name, nats)| Rival { name, instead_of: UNKNOWN.to_owned(), nats };
        self.rivals = near.into_iter().map(rival).collect();
        self.names = vec![UNKNOWN.to_owned()];
        self.verdict = Verdict::Unexplained;
        for all in [&mut self.contributions, &mut self.remaining] {
            let rows = all.first().map_or(0, |(_, x)| x.len());
            *all = vec![(UNKNOWN.to_owned(), sum_contributions(all, rows))];
        }
    }
}

/// The sum of all contributions.
pub(super) fn sum_contributions(all: &[Named], rows: usize) -> Vec<f64> {
    let mut sum = vec![0.0; rows];
    for (_, x) in all {
        sum.iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
    }
    sum
}
