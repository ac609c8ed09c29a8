//! The least that every build must reach, on a sample that takes about a minute.

use crate::concealed::groups::{Order, orders};
use crate::concealed::score::outcome::Outcome;
use crate::concealed::score::tally::Tally;

/// What is counted.
#[derive(Clone, Copy, Debug)]
enum Figure {
    /// Share named; at least.
    Named,
    /// Share whose class holds the truth, of those that give names; at least.
    InClass,
    /// Share that reports anything; at most.
    Reported,
    /// Share with one sure name that is wrong; at most.
    SureAndWrong,
    /// Share right by what the case expects; at least.
    Right,
    /// Tool failed or broke the contract; at most, as a share.
    Failed,
    /// Seconds of the slowest recording; at most.
    Seconds,
}

/// Beginning of the group's name, the figure, and its floor or ceiling.
const FLOORS: [(&str, Figure, f64); 10] = [
    ("single-rich-rho1", Figure::Named, 0.6),
    ("single-rich-rho2", Figure::Named, 0.6),
    ("single-rich", Figure::InClass, 0.6),
    ("single-prod-rho1", Figure::Named, 0.5),
    ("pair-rich-rho1", Figure::Named, 0.3),
    ("drive-rho1", Figure::Named, 0.5),
    ("nothing", Figure::Reported, 0.1),
    ("unlisted", Figure::SureAndWrong, 0.5),
    ("", Figure::Failed, 0.0),
    ("", Figure::Seconds, 5.0),
];

/// Groups and how many of their cases the short run takes, spread over the group.
const SAMPLE: [(&str, usize); 8] = [
    ("single-rich-rho1", 12),
    ("single-rich-rho2", 8),
    ("single-prod-rho1", 8),
    ("pair-rich-rho1", 4),
    ("unlisted-rich-rho1", 6),
    ("nothing-", 18),
    ("drive-rho1", 6),
    ("thermal-rho2", 3),
];

/// The cases of the short run.
pub(crate) fn sample() -> Vec<Order> {
    drawn(&SAMPLE)
}

/// So many cases of each group, spread over it.
fn drawn(groups: &[(&str, usize)]) -> Vec<Order> {
    let mut sample = Vec::new();
    for (begin, count) in groups.iter().copied() {
        let group: Vec<Order> = orders(1).into_iter().filter(|o| o.group().starts_with(begin)).collect();
        let step = group.len().div_ceil(count).max(1);
        sample.extend(group.into_iter().step_by(step));
    }
    sample
}

/// Groups and how many of their cases are held against the measured shares.
const GUARDED: [(&str, usize); 4] =
    [("single-rich-rho2", 8), ("single-rich-rho1", 6), ("nothing-", 6), ("drive-rho1", 3)];

/// Beginning of the group's name, the figure, and the share that the campaign measured on other seeds (handbook chapter
/// `measured`): of effects of half a deviation or more 94 % were named, of recordings with nothing hidden none of 312 was
/// reported (upper end of the interval 2 %).
const MEASURED: [(&str, Figure, f64); 4] = [
    ("single-", Figure::Named, 0.94),
    ("drive-", Figure::Named, 0.94),
    ("nothing-", Figure::Reported, 0.02),
    ("", Figure::Failed, 0.0),
];

/// Probability with which a build as good as the measured one misses a floor by the choice of the cases.
const BY_CHANCE: f64 = 0.01;

/// The cases that are held against the measured shares.
pub(crate) fn guarded() -> Vec<Order> {
    drawn(&GUARDED)
}

/// Every measured share that so few cases contradict, in words.
pub(crate) fn contradicted(outcomes: &[Outcome]) -> Vec<String> {
    let of = |(begin, figure, share): &(&str, Figure, f64)| {
        let size = outcomes.iter().filter(|outcome| outcome.group.starts_with(begin)).count();
        let few = f64::from(u32::try_from(size).unwrap_or(u32::MAX)).max(1.0);
        let limit = match figure {
            Figure::Reported | Figure::Failed | Figure::SureAndWrong => 1.0 - f64::from(least(size, 1.0 - share)) / few,
            _ => f64::from(least(size, *share)) / few,
        };
        miss(outcomes, begin, *figure, limit)
    };
    MEASURED.iter().filter_map(of).collect()
}

/// The least count of `size` draws of this probability that is undercut by chance in at most `BY_CHANCE` (binomial).
fn least(size: usize, probability: f64) -> u32 {
    let size = u32::try_from(size).unwrap_or(u32::MAX);
    let (mut below, mut ways) = (0.0, 1.0);
    for hits in 0..size {
        let misses = size - hits;
        below += ways * probability.powi(hits.cast_signed()) * (1.0 - probability).powi(misses.cast_signed());
        if below > BY_CHANCE {
            return hits;
        }
        ways *= f64::from(misses) / f64::from(hits + 1);
    }
    size
}

/// Bounds of the tables of the binomial distribution: 14 draws of .94 give 10 or fewer in 0.8 %, 11 or fewer in 4.6 %.
#[test]
fn floors_follow_the_binomial_distribution() {
    assert_eq!(least(14, 0.94), 11);
    assert_eq!(least(6, 0.98), 5);
    assert_eq!(least(3, 1.0), 3);
}

/// Every floor that was not reached, in words.
pub(crate) fn missed(outcomes: &[Outcome]) -> Vec<String> {
    FLOORS.iter().filter_map(|(begin, figure, limit)| miss(outcomes, begin, *figure, *limit)).collect()
}

fn miss(outcomes: &[Outcome], begin: &str, figure: Figure, limit: f64) -> Option<String> {
    let group: Vec<&Outcome> = outcomes.iter().filter(|o| o.group.starts_with(begin)).collect();
    let tally = Tally(&group);
    let naming: Vec<&Outcome> = group.iter().filter(|o| o.gave_names).copied().collect();
    let (value, fine) = match figure {
        Figure::Named => at_least(tally.share(|o| o.named && o.gave_names), limit),
        Figure::InClass => at_least(Tally(&naming).share(|o| o.in_class), limit),
        Figure::Right => at_least(tally.share(|o| o.right), limit),
        Figure::Reported => at_most(tally.share(|o| o.reported), limit),
        Figure::SureAndWrong => at_most(tally.share(|o| o.certain && !o.named), limit),
        Figure::Failed => at_most(tally.share(|o| o.broken), limit),
        Figure::Seconds => at_most(group.iter().map(|o| o.seconds).fold(0.0, f64::max), limit),
    };
    (!fine || group.is_empty()).then(|| format!("{begin}* {figure:?}: {value:.3}, limit {limit} (n {})", group.len()))
}

fn at_least(value: f64, limit: f64) -> (f64, bool) {
    (value, value >= limit)
}

fn at_most(value: f64, limit: f64) -> (f64, bool) {
    (value, value <= limit)
}

/// A floor that is missed is told, one that is reached is not, and an empty group counts as missed.
#[test]
fn floors_are_floors() {
    let outcome =
        |named: bool| Outcome { group: "g".into(), named, gave_names: true, right: named, ..Outcome::default() };
    let outcomes = [outcome(true), outcome(true), outcome(false)];
    assert!(miss(&outcomes, "g", Figure::Named, 0.6).is_none());
    assert!(miss(&outcomes, "g", Figure::Right, 0.7).is_some());
    assert!(miss(&outcomes, "h", Figure::Named, 0.0).is_some());
    assert!(miss(&outcomes, "g", Figure::Failed, 0.0).is_none());
}
