//! The least that every build must reach, on a sample that takes about a minute.

use crate::groups::{Order, orders};
use crate::score::outcome::Outcome;
use crate::score::tally::Tally;

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
    let mut sample = Vec::new();
    for (begin, count) in SAMPLE {
        let group: Vec<Order> = orders(1).into_iter().filter(|o| o.group().starts_with(begin)).collect();
        let step = group.len().div_ceil(count).max(1);
        sample.extend(group.into_iter().step_by(step));
    }
    sample
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
