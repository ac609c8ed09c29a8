//! The verdict: names, intervals, alternatives, regions, the next experiment, and the sentence for the machinist.

use super::diagnose::Case;
use super::diagnosis::{Alternative, Diagnosis, Experiment, Missing, ParameterEstimate, Rows, Shift, UNKNOWN, Verdict};
use super::estimate::estimates;
use super::fit::Fit;
use super::locate::{Region, region};
use super::model::{Model, Part, PartFunction, simulate};
use super::next_step::alternative;
use super::outcome::Outcome;
use super::search::{Hypothesis, METER, RESOLVED};
use adapters::channel::quantity;

/// Information within which two explanations cannot be told apart.
pub(super) const CLASS_INFORMATION: f64 = 6.0;
/// What is said of a name that is in doubt where no other name is near.
const NOT_RULED_OUT: &str = "; something without a name explains nearly as much, or rows held out show less of it: another cause is not ruled out";
/// Classes within which a name that is in doubt is compared with the next: beyond, no other name is an explanation.
const FURTHER: f64 = 5.0;
/// The kind whose mean delay may be too short to be told from a lag.
const WINDOW: &str = "meter_window";

/// The diagnosis of a recording that does not suffice.
#[must_use]
pub fn cannot_tell(case: &Case<'_>, needed: String) -> Diagnosis {
    Diagnosis {
        output: case.model.output.clone(),
        unit: unit_of(&case.model.output).to_owned(),
        verdict: Verdict::CannotTell,
        summary: format!("Cannot tell: this needs {needed}."),
        fit: None,
        mismatch: Vec::new(),
        missing: Vec::new(),
        alternatives: Vec::new(),
        withdrawn: Vec::new(),
        baseline_shift: Vec::new(),
        data_quality: case.faults.clone(),
        next_experiment: Some(Experiment {
            statement: format!("Record {needed}."),
            minutes: 10.0,
            expected_delta_ic: 0.0,
            effect: String::new(),
        }),
        rows: Rows::default(),
        model: case.model.clone(),
        debug: String::new(),
    }
}

/// The diagnosis of a completed search.
#[must_use]
pub fn judge(case: &mut Case<'_>, outcome: Outcome) -> Diagnosis {
    let mut missing = missing(case, &outcome);
    let mut alternatives = alternatives(case, &outcome);
    // Not after all names were found too small to be worth claiming.
    if let Some(nameless) = outcome.nameless.as_ref().filter(|_| !missing.is_empty()) {
        alternatives.push(alternative(UNKNOWN, &nameless.instead_of, nameless.delta_ic));
    }
    if alternatives.is_empty() && outcome.unknown.is_none() && outcome.fits.carries_little() {
        alternatives.extend(missing.first().map(|first| alternative(UNKNOWN, &first.effect, 0.0)));
    }
    if missing.iter().any(|named| is_hardly_a_window(named, case.scene.period_s())) {
        let lag = "clock_lag";
        alternatives.retain(|other| other.effect != lag);
        alternatives.push(alternative(lag, WINDOW, 0.0));
    }
    if !alternatives.is_empty() && outcome.unknown.is_none() && alternatives.iter().all(is_nameless) {
        // Doubt about a name is told by the name that comes next, or there is none.
        match alternatives_within(case, &outcome, FURTHER * CLASS_INFORMATION).into_iter().next() {
            Some(nearest) => alternatives.insert(0, nearest),
            None => {
                let doubted = |named: &&mut Missing| alternatives.iter().any(|other| other.instead_of == named.effect);
                missing.iter_mut().filter(doubted).for_each(|named| named.statement.push_str(NOT_RULED_OUT));
                alternatives.clear();
            }
        }
    }
    let verdict = outcome.verdict(!alternatives.is_empty());
    let mismatch = regions(case, &outcome);
    let unit = unit_of(&case.model.output).to_owned();
    let mut diagnosis = Diagnosis {
        output: case.model.output.clone(),
        verdict,
        summary: String::new(),
        fit: Some(outcome.fits.clone()),
        mismatch,
        baseline_shift: if missing.is_empty() { Vec::new() } else { shifts(case, &outcome) },
        missing,
        next_experiment: super::next_step::next_step(&outcome, verdict, &alternatives),
        alternatives,
        data_quality: case.faults.clone(),
        model: extended(case, outcome.last()),
        withdrawn: outcome.withdrawn.as_ref().map_or_else(Vec::new, |withdrawn| withdrawn.found.clone()),
        debug: debug(case, &outcome),
        rows: outcome.rows.clone(),
        unit,
    };
    diagnosis.summary = match &outcome.withdrawn {
        Some(withdrawn) => super::words::withdrawn(withdrawn, &diagnosis.unit),
        None => super::words::summary(&diagnosis),
    };
    diagnosis
}

/// Is what a meter averages over, on average, no older than a lag that cannot be resolved?
fn is_hardly_a_window(named: &Missing, period_s: f64) -> bool {
    let window = named.parameters.iter().find(|parameter| parameter.name == "window_s");
    named.effect == WINDOW && window.is_some_and(|window| window.value / 2.0 < RESOLVED * period_s)
}

/// Is it a cause without a name?
fn is_nameless(other: &Alternative) -> bool {
    other.effect == UNKNOWN
}

/// The unit at the end of a channel's name, as a symbol.
#[must_use]
pub fn unit_of(output: &str) -> &'static str {
    quantity::unit_of(output).unwrap_or("1")
}

fn missing(case: &mut Case<'_>, outcome: &Outcome) -> Vec<Missing> {
    // Parts that act on load or output find both as the reported fit simulates them.
    let _ = simulate(&outcome.last().parts, &mut case.scene);
    if let Some(unknown) = &outcome.unknown {
        let fit = outcome.last();
        let part = &fit.parts[case.parts.len()];
        let mut found = vec![described(case, outcome, fit, part, case.parts.len())];
        for (number, part) in fit.parts.iter().enumerate().skip(case.parts.len() + 1) {
            let more = described(case, outcome, fit, part, number);
            found[0].equation = format!("{}; {}", found[0].equation, more.equation);
            let named = |e: ParameterEstimate| ParameterEstimate { name: format!("{}.{}", part.label(), e.name), ..e };
            found[0].parameters.extend(more.parameters.into_iter().map(named));
        }
        if let Some(excluded) = &unknown.excluded {
            let statement = &found[0].statement;
            found[0].statement =
                format!("{statement}; of what the model file excludes, {excluded} would explain it better");
        }
        found[0].delta_ic = unknown.information;
        found[0].p_value = unknown.p_value;
        found[0].held_out_rmse_before = outcome.fits.before.held_out_rmse;
        found[0].held_out_rmse_after = outcome.fits.after.held_out_rmse;
        return found;
    }
    let best = outcome.found.best.clone();
    let first = case.parts.len();
    let mut found: Vec<(f64, Missing)> = Vec::new();
    for position in 0..best.members.len() {
        let told = outcome.last();
        let mut missing = described(case, outcome, told, &told.parts[first + position], first + position);
        missing.p_value = outcome.found.p_values.get(position).copied().unwrap_or(super::search::P_MAX);
        let without = if best.members.len() == 1 { None } else { case.without(&best, position) };
        let fit = without.map_or_else(|| outcome.base.clone(), |without| without.fit);
        missing.delta_ic = 2.0 * (best.fit.log_likelihood - fit.log_likelihood)
            - super::scan::price(&outcome.designs[best.members[position]], case.ln_rows(&outcome.base));
        missing.held_out_rmse_before = if best.members.len() == 1 {
            outcome.fits.before.held_out_rmse
        } else {
            case.predict(&fit).and_then(|prediction| case.quality(&prediction).held_out_rmse)
        };
        missing.held_out_rmse_after = outcome.fits.after.held_out_rmse;
        found.push((fit.left_in(&case.frame, best.fit.noise), missing));
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.into_iter().map(|(_, missing)| missing).collect()
}

/// A missing effect with its texts and parameters.
fn described(case: &Case<'_>, outcome: &Outcome, fit: &Fit, part: &Part, index: usize) -> Missing {
    let (statement, equation) = texts(part);
    Missing {
        effect: part.label().to_owned(),
        statement,
        equation,
        parameters: estimates(case, fit, index),
        delta_ic: 0.0,
        p_value: 1.0,
        held_out_rmse_before: None,
        held_out_rmse_after: None,
        absorbed_share: absorbed(case, outcome, part),
    }
}

fn texts(part: &Part) -> (String, String) {
    match &part.body {
        PartFunction::Empirical(form) => (
            "Something real that no effect of the catalogue explains; described by its shape only".to_owned(),
            form.equation(),
        ),
        PartFunction::Expression(expression) => ("The user's hypothesis".to_owned(), expression.text().to_owned()),
        PartFunction::Effect(effect, form) => {
            let place = form.place.as_ref().map(|(column, word)| format!(" ({column} {word})")).unwrap_or_default();
            (format!("{}{place}", effect.doc().en.statement), effect.doc().law.to_owned())
        }
        PartFunction::Linear(_) | PartFunction::Table(_) => (part.kind.clone(), part.kind.clone()),
    }
}

/// Share of a contribution's variance that the baseline can imitate.
fn absorbed(case: &Case<'_>, outcome: &Outcome, part: &Part) -> f64 {
    let Some(contribution) = part.contribution(&case.scene) else { return 0.0 };
    let reduced = case.frame.reduce(&contribution);
    let whole = super::linear::dot(&reduced, &reduced);
    let left = super::linear::least_squares(&outcome.reported_base.tangent, &reduced).rss;
    if whole > 0.0 { (1.0 - left / whole).clamp(0.0, 1.0) } else { 0.0 }
}

/// Explanations within the class of the best: one member replaced by another kind.
fn alternatives(case: &Case<'_>, outcome: &Outcome) -> Vec<Alternative> {
    alternatives_within(case, outcome, CLASS_INFORMATION)
}

/// The same within so many units of information, the nearest first.
fn alternatives_within(case: &Case<'_>, outcome: &Outcome, class: f64) -> Vec<Alternative> {
    let best = &outcome.found.best;
    let kind = |member: &usize| outcome.designs[*member].kind.as_str();
    let kinds: Vec<&str> = best.members.iter().map(kind).collect();
    if outcome.unknown.is_some() {
        return kinds.iter().map(|name| alternative(name, UNKNOWN, 0.0)).collect();
    }
    // Where a fit leaves more than noise, likelihoods mean that much less.
    let within = class * best.fit.dispersion(&case.frame);
    let mut all: Vec<Alternative> = Vec::new();
    for other in &outcome.found.others {
        let delta = best.information - other.information - forgiven(outcome, other);
        if other.members.len() != best.members.len() || delta > within {
            continue;
        }
        let theirs: Vec<&str> = other.members.iter().map(kind).collect();
        let gone: Vec<&str> = kinds.iter().copied().filter(|name| !theirs.contains(name)).collect();
        let new: Vec<&str> = theirs.iter().copied().filter(|name| !kinds.contains(name)).collect();
        if let ([gone], [new]) = (gone.as_slice(), new.as_slice())
            && !all.iter().any(|known| known.effect == *new && known.instead_of == *gone)
        {
            all.push(alternative(new, gone, delta.max(0.0)));
        }
    }
    all.sort_by(|a, b| a.delta_ic.total_cmp(&b.delta_ic));
    all
}

/// Reluctance to name a fault of a meter, where one stands in the place of something else: it guards against false alarms
/// and is no evidence between two explanations of what is there.
fn forgiven(outcome: &Outcome, other: &Hypothesis) -> f64 {
    let new = other.members.iter().filter(|member| !outcome.found.best.members.contains(member));
    let designs = new.map(|member| &outcome.designs[*member]);
    designs.filter(|design| METER.contains(&design.kind.as_str())).map(|design| design.reluctance).sum()
}

/// One region per added effect, the largest share first.
fn regions(case: &Case<'_>, outcome: &Outcome) -> Vec<Region> {
    let added = outcome.withdrawn.as_ref().map_or(&outcome.added, |withdrawn| &withdrawn.added);
    let squares: f64 = added.iter().flat_map(|(_, values)| values).map(|x| x * x).sum();
    let mut regions: Vec<Region> =
        added.iter().map(|(effect, values)| region(&case.told().scene, effect, values, squares)).collect();
    regions.retain(|region| !region.spans.is_empty());
    regions.sort_by(|a, b| b.share.total_cmp(&a.share));
    regions
}

fn shifts(case: &Case<'_>, outcome: &Outcome) -> Vec<Shift> {
    let after = outcome.last();
    let pairs = outcome.reported_base.parts.iter().zip(&after.parts).take(case.parts.len());
    pairs
        .flat_map(|(before, after)| {
            before.parameters.iter().zip(&after.parameters).filter(|(before, _)| !before.fixed).map(|(b, a)| Shift {
                parameter: format!("{}.{}", before.label(), b.name),
                before: b.value,
                after: a.value,
            })
        })
        .collect()
}

/// The model with what was found, refitted.
fn extended(case: &Case<'_>, fit: &Fit) -> Model {
    Model { parts: fit.parts.clone(), ..case.model.clone() }
}

/// The leading hypotheses with their information.
fn debug(case: &Case<'_>, outcome: &Outcome) -> String {
    let name =
        |members: &[usize]| members.iter().map(|m| outcome.designs[*m].kind.as_str()).collect::<Vec<_>>().join("+");
    let best = &outcome.found.best;
    let others = outcome.found.others.iter().take(8).map(|h| format!("{} {:.1}", name(&h.members), h.information));
    let others: Vec<String> = others.collect();
    let unknown =
        outcome.unknown.as_ref().map(|u| format!("; unknown {:.1} p {}", u.information, u.p_value)).unwrap_or_default();
    let noise = (outcome.base.noise, best.fit.noise);
    let refused = outcome.found.refused_p;
    let c = outcome.last().dispersion(&case.frame);
    let held_out = outcome.fits.held_out_share();
    let inner = outcome.inner.map(|(before, after)| after.error() / before.error());
    let withdrawn =
        outcome.withdrawn.as_ref().map(|withdrawn| (&withdrawn.kinds, withdrawn.among_fitted, withdrawn.errors));
    format!(
        "dispersion {c:.2} held-out {held_out:.3?} inner {inner:.3?} withdrawn {withdrawn:?} {} {:.1} p {:?} refused {refused:?} noise {:.2}/{:.2} -> {:.2}/{:.2}{unknown} | {}",
        name(&best.members),
        best.information,
        outcome.found.p_values,
        noise.0.phi,
        noise.0.theta,
        noise.1.phi,
        noise.1.theta,
        others.join(", ")
    )
}
