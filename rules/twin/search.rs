//! The search: singles, then pairs and triples on top of the leaders, each accepted only through the gate.

use super::designs::{AT_EDGES, Design, excludes};
use super::drift::stands_out;
use super::fit::{Data, Fit, fit};
use super::gate::p_value;
use super::model::Part;
use super::scan::{HypothesisBank, best_of_each_law, price_of};
use crate::physics::catalogue::dry_friction::slips;
use crate::physics::catalogue::meter_window::LATE;
use crate::physics::drive::{is_axis_output, is_power, motion, turns};
use crate::physics::{OutputKind, Role, Scene};
use crate::statistics::count;

/// Effects that may be found at once.
const EFFECTS_MAX: usize = 4;
/// Kinds that are fitted in full after a scan.
const FITTED_SINGLES: usize = 6;
/// Leaders on top of which the whole catalogue is scanned again.
const LEADERS: usize = 3;
/// Partners fitted in full per leader.
const PARTNERS: usize = 2;
/// Information the first effect must bring.
pub(super) const FIRST_INFORMATION: f64 = 10.0;
/// Information a further effect must bring.
const STEP_INFORMATION: f64 = 6.0;
/// The same as a share of what is already explained: below it a further effect more likely mends the form of another.
const STEP_SHARE: f64 = 0.05;
/// The p-value that a finding must not exceed: by this test alone, two in a hundred recordings of noise and nothing else
/// would be reported.
pub const P_MAX: f64 = 0.02;
/// Faults of a meter.
pub(super) const METER: [&str; 6] = ["sensor_gain", "zero_drift", "offset", "clock_lag", "meter_window", "saturation"];

/// A set of effects on top of the baseline, fitted together with it.
#[derive(Clone)]
pub struct Hypothesis {
    /// Indices of the designs.
    pub members: Vec<usize>,
    /// The joint fit; the members are its last parts, in order.
    pub fit: Fit,
    /// Gain over the baseline in information units, freedom paid for.
    pub information: f64,
}

impl Hypothesis {
    /// Where the first member stands among the parts of the fit.
    #[must_use]
    pub(super) fn first_part(&self) -> usize {
        self.fit.parts.len() - self.members.len()
    }

    /// Is this member the dry friction that a Stribeck friction beside it exceeds? Of the two the excess goes first.
    #[must_use]
    pub(super) fn is_exceeded(&self, position: usize, designs: &[Design]) -> bool {
        let is = |member: usize, kind: &str| designs[member].kind == kind;
        is(self.members[position], "dry_friction") && self.members.iter().any(|member| is(*member, "stribeck"))
    }

    /// Members and parts with one member taken out.
    #[must_use]
    pub(super) fn taken_out(&self, position: usize) -> (Vec<usize>, Vec<Part>) {
        let (mut members, mut parts) = (self.members.clone(), self.fit.parts.clone());
        members.remove(position);
        parts.remove(self.first_part() + position);
        (members, parts)
    }
}

/// What a search found.
pub struct SearchResult {
    /// The accepted hypothesis; no members when nothing passed the gate.
    pub best: Hypothesis,
    /// The p-value of each member, in order of acceptance.
    pub p_values: Vec<f64>,
    /// Other hypotheses that were fitted in full, best first.
    pub others: Vec<Hypothesis>,
    /// The p-value of the best hypothesis that was refused, when nothing was accepted.
    pub refused_p: Option<f64>,
}

/// A search in progress.
pub struct EffectSearch<'a, 'b> {
    /// The recording.
    pub data: &'a mut Data<'b>,
    /// The baseline fitted alone.
    pub base: &'a Fit,
    /// Every hypothesis.
    pub bank: &'a HypothesisBank<'a>,
    /// Logarithm of the number of independent rows.
    pub ln_rows: f64,
    /// Seed of the resampling.
    pub seed: u64,
    tried: Vec<Hypothesis>,
    /// How many of the first members stand already.
    standing: usize,
    /// The baseline beside an effect at the edges, where that effect bends it: another place to start from.
    unbent: Option<Vec<Part>>,
}

impl<'a, 'b> EffectSearch<'a, 'b> {
    /// A search that has not begun.
    #[must_use]
    pub fn new(data: &'a mut Data<'b>, base: &'a Fit, bank: &'a HypothesisBank<'a>, seed: u64) -> Self {
        let rows = count(data.frame.len());
        let ln_rows = (rows / base.noise.inflation()).max(20.0).ln();
        Self { data, base, bank, ln_rows, seed, tried: Vec::new(), standing: 0, unbent: None }
    }

    /// The same search, with another baseline to start from: the one beside an effect at the edges that bends it.
    #[must_use]
    pub fn beside(mut self, unbent: Option<Vec<Part>>) -> Self {
        self.unbent = unbent;
        self
    }

    /// Runs the search: grows as far as information is gained, then lets the gate decide how much of it is real.
    ///
    /// The gate resamples the innovations of the deepest hypothesis: what a later member explains must not count as
    /// noise against an earlier one.
    #[must_use]
    pub fn run(mut self) -> SearchResult {
        let nothing = Hypothesis { members: Vec::new(), fit: self.base.clone(), information: 0.0 };
        let (first, mut p_values) = self.corroborated(&nothing).unwrap_or((nothing, Vec::new()));
        self.standing = first.members.len();
        let mut path = vec![first];
        while let Some(next) = self.next_step(&path[path.len() - 1]) {
            path.push(next);
        }
        let deepest = path[path.len() - 1].clone();
        let mut refused_p = None;
        let mut best = path[0].clone();
        for next in path.drain(1..) {
            let first = best.members.is_empty();
            let paid = self.price_of(&next.members) - self.price_of(&best.members);
            let tested = Some((&next.fit, paid));
            let p = p_value(self.bank, &best.fit, &deepest.fit, tested, self.ln_rows, self.seed, first);
            if p > P_MAX {
                refused_p = best.members.is_empty().then_some(p);
                break;
            }
            p_values.resize(next.members.len(), p);
            best = next;
        }
        let best = self.pruned(best);
        self.tried.sort_by(|a, b| b.information.total_cmp(&a.information));
        p_values.truncate(best.members.len());
        SearchResult { best, p_values, others: self.tried, refused_p }
    }

    /// The next hypothesis on the path, when it brings enough.
    fn next_step(&mut self, from: &Hypothesis) -> Option<Hypothesis> {
        if from.members.len() >= EFFECTS_MAX {
            return None;
        }
        let next = self.grow(from)?;
        let needed = if from.members.is_empty() {
            FIRST_INFORMATION
        } else {
            STEP_INFORMATION.max(STEP_SHARE * from.information)
        };
        (next.information > from.information + needed).then_some(next)
    }

    /// The best hypothesis with one more member, or two where two are better than one.
    fn grow(&mut self, from: &Hypothesis) -> Option<Hypothesis> {
        let singles = self.extend(from, FITTED_SINGLES);
        let mut best = singles.first()?.clone();
        if from.members.len() + 2 <= EFFECTS_MAX {
            for leader in singles.iter().take(LEADERS) {
                for pair in self.extend(leader, PARTNERS) {
                    if pair.information > best.information.max(singles[0].information + STEP_INFORMATION) {
                        best = pair;
                    }
                }
            }
        }
        Some(best)
    }

    /// The fully fitted extensions of a hypothesis by one design, best first: the best form of each of the `most`
    /// likeliest kinds.
    fn extend(&mut self, from: &Hypothesis, most: usize) -> Vec<Hypothesis> {
        let mut scores = self.bank.scan(&from.fit, self.ln_rows);
        let present: Vec<&str> = from.members.iter().map(|member| self.bank.designs[*member].kind.as_str()).collect();
        scores.retain(|score| {
            let kind = self.bank.designs[score.design].kind.as_str();
            score.gain.is_finite() && !present.iter().any(|present| excludes(present, kind))
        });
        let chosen = best_of_each_law(&scores, self.bank.designs, most);
        let mut fitted: Vec<Hypothesis> = chosen.iter().filter_map(|score| self.with(from, score.design)).collect();
        fitted.sort_by(|a, b| b.information.total_cmp(&a.information));
        fitted
    }

    /// A hypothesis with one design more, fitted; one that has been tried before is not fitted again.
    pub(super) fn with(&mut self, from: &Hypothesis, design: usize) -> Option<Hypothesis> {
        let mut members = from.members.clone();
        members.push(design);
        if let Some(known) = self.tried.iter().find(|tried| are_the_same(&tried.members, &members)) {
            return Some(known.clone());
        }
        let noise = self.bank.designs[design].noise.unwrap_or(from.fit.noise);
        let added = std::slice::from_ref(&self.bank.designs[design].part);
        let beside = &from.fit.parts[self.base.parts.len()..];
        let known = self.fitted(members.clone(), &[&from.fit.parts, added].concat(), noise);
        let at_edges = AT_EDGES.contains(&self.bank.designs[design].kind.as_str());
        let unbent = self.unbent.as_ref().filter(|_| at_edges);
        let unbent = unbent.map(|baseline| [baseline.as_slice(), beside, added].concat());
        let other = unbent.and_then(|parts| self.fitted(members, &parts, noise));
        let better = |a: &Hypothesis, b: &Hypothesis| a.information.total_cmp(&b.information);
        let best = known.into_iter().chain(other).max_by(better);
        self.tried.extend(best.clone());
        best
    }

    fn fitted(&mut self, members: Vec<usize>, parts: &[Part], noise: super::noise::Arma) -> Option<Hypothesis> {
        let fit = fit(self.data, parts, noise)?;
        let added = &fit.parts[self.base.parts.len()..];
        if !added.iter().all(|part| plausible(part, &fit, self.data)) {
            return None;
        }
        let information = 2.0 * (fit.log_likelihood - self.base.log_likelihood) - self.price_of(&members);
        information.is_finite().then_some(Hypothesis { members, fit, information })
    }

    fn price_of(&self, members: &[usize]) -> f64 {
        price_of(self.bank.designs, members, self.ln_rows)
    }

    fn without(&mut self, from: &Hypothesis, position: usize) -> Option<Hypothesis> {
        let (members, parts) = from.taken_out(position);
        self.fitted(members, &parts, from.fit.noise)
    }

    /// Drops members that have become superfluous.
    fn pruned(&mut self, mut best: Hypothesis) -> Hypothesis {
        let mut position = self.standing;
        while best.members.len() > 1 && position < best.members.len() {
            match self.without(&best, position) {
                Some(less) if less.information + STEP_INFORMATION > best.information => {
                    best = less;
                    position = self.standing;
                }
                _ => position += 1,
            }
        }
        best
    }
}

/// The same designs, in whatever order?
fn are_the_same(some: &[usize], others: &[usize]) -> bool {
    some.len() == others.len() && some.iter().all(|member| others.contains(member))
}

/// Sampling periods below which a lag cannot be resolved.
pub(super) const RESOLVED: f64 = 0.1;

/// Could this part of a fit be what its name says? A lag far below the sampling period cannot be resolved; a lag, window
/// or ceiling that acts by less than a fifth is something else; a drift is more than slow noise; Stribeck friction is an
/// excess over dry friction at creep speed.
fn plausible(part: &Part, fit: &Fit, data: &Data<'_>) -> bool {
    let scene = &*data.scene;
    let value = |name: &str| part.parameter(name).map(|parameter| parameter.value);
    let resolved = |name: &str| value(name).is_none_or(|seconds| seconds.abs() >= RESOLVED * scene.period_s());
    let acts = value("share").is_none_or(|share| share.abs() >= 0.2);
    match part.kind.as_str() {
        "clock_lag" | "engagement_timing" | "override_delay" => resolved("delay_s") && acts,
        "meter_window" if part.has_form(LATE) => {
            resolved("window_s") && value("share").is_some_and(|share| share >= LATE_SHARE_MIN)
        }
        "meter_window" => resolved("window_s") && acts,
        "copper_loss" => value("base_speed_rpm").is_none_or(|base_rpm| is_often_below(scene, base_rpm)),
        "saturation" => acts,
        "zero_drift" => stands_out(part, fit, data),
        "dry_friction" => value("presliding_way").is_none_or(|way| slips(scene, way)),
        "stribeck" if turns(scene) && is_power(scene) => {
            let top = motion(scene).map_or(0.0, |velocity| velocity.iter().fold(0.0_f64, |top, v| top.max(v.abs())));
            value("stribeck_speed").is_none_or(|speed| speed <= CREEP_SHARE * top)
        }
        "stribeck" if scene.output_kind() == OutputKind::Force || is_axis_output(scene) => {
            value("level").is_some_and(|level| level.abs() <= most_excess(&fit.parts))
        }
        _ => true,
    }
}

/// Share of the output that a late echo has at least: less is within what a law in the edges may be wrong.
const LATE_SHARE_MIN: f64 = 0.02;
/// Share of the cutting rows that must lie below the speed from which the field is weakened: above it copper loss follows
/// the power, and is a load loss.
const BELOW_BASE_MIN: f64 = 0.25;

/// Does the spindle often cut below this speed?
fn is_often_below(scene: &Scene, base_rpm: f64) -> bool {
    let (Some(speed), Some(load)) = (scene.role(Role::Speed), scene.load()) else { return true };
    let cutting: Vec<f64> = speed.iter().zip(load).filter(|(_, load)| **load > 0.0).map(|(n, _)| n.abs()).collect();
    let below = cutting.iter().filter(|n| **n < base_rpm).count();
    count(below) >= BELOW_BASE_MIN * count(cutting.len())
}

/// Share of the greatest speed up to which a spindle creeps: an excess of friction that reaches further is any bend of the
/// no-load power, such as a windage of another sign. The search begins at a fifth at most.
const CREEP_SHARE: f64 = 0.35;
/// Times the dry friction beside it that friction at creep speed may exceed it by: bodies that start to move meet up to two
/// or three times the friction of bodies that do.
const EXCESS_MAX: f64 = 3.0;

/// The greatest excess of Stribeck friction that these parts allow, in the output's unit: nothing without dry friction,
/// anything beside that of the model, which was not looked for together with it.
fn most_excess(parts: &[Part]) -> f64 {
    let sign = |part: &Part| part.parameters.iter().any(|parameter| parameter.name.starts_with("sign("));
    let level = |part: &Part| part.parameter("level").map_or(0.0, |level| level.value.abs());
    let dry = parts.iter().filter(|part| part.kind == "dry_friction").map(level).sum::<f64>();
    if parts.iter().any(sign) { f64::INFINITY } else { EXCESS_MAX * dry }
}
