//! Trials: given and expected, written in the script file itself.
//!
//! ```text
//! fn trial_a_heavy_cut_is_slowed_down() {
//!     given(#{ state: "cutting", spindle_load_pct: 95.0 });
//!     after_s(10.0);
//!     expect_override(60.0, 90.0);
//! }
//! ```
//!
//! A trial is a function whose name begins with `trial_`. It sets what the script sees, lets time pass, and says what must
//! have come of it. Nothing else runs: one script, from empty memory, on a clock that begins anew. New scripts come into
//! charge only when all their trials pass.
//!
//! | file | what |
//! |---|---|
//! | `functions` | what a trial can call |
//! | `smoke` | a script without trials: does it run at all? |
//! | `trial_context` | the script, its inputs, its clock |

mod functions;
mod smoke;
mod trial_context;

pub use functions::TRIAL_FUNCTIONS;

use super::compile::compile_variant;
use super::declared::{DeclarationPlace, SettingValues};
use super::engine::{OPERATIONS_MAX, Shared, build_engine};
use super::problem::{self, ScriptProblem};
use super::running::RunningScript;
use super::script_set::{Script, ScriptSet};
use rhai::{AST, Engine, Position, Scope};
use std::sync::Arc;
use trial_context::{Theatre, TrialContext};

/// Tools and operations with values of their own whose trials are run; more of them take the same path through the script.
const PLACES_MAX: usize = 16;

/// How the name of a trial begins.
pub(super) const PREFIX: &str = "trial_";

/// A trial as it stands in a file.
pub(super) struct Trial {
    pub(super) name: String,
    pub(super) at: Position,
    /// As written, to look through.
    pub(super) plain: AST,
    pub(super) ast: AST,
}

/// How a trial went.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialResult {
    /// File name of the script that holds the trial.
    pub file: Arc<str>,
    /// Its name in words: `a heavy cut is slowed down`.
    pub name: String,
    /// Where it begins, line from 1.
    pub line: usize,
    /// How many expectations were met.
    pub met: usize,
    /// How much time passed in it, s.
    pub passed_s: f64,
    /// What was not as expected; `None`: it passed.
    pub problem: Option<ScriptProblem>,
}

/// Every trial of every script, in the order of files and lines: with the values of the settings that are in force, and where
/// values were chosen also with the defaults and with the values of each tool and operation. A script without a trial is run for
/// a few seconds with and without values: it must come to an end and not fail.
#[must_use]
pub fn run_trials(set: &ScriptSet) -> Vec<TrialResult> {
    set.scripts.iter().flat_map(|script| of_script(set, script)).collect()
}

/// May these scripts come into charge?
///
/// # Errors
/// What the trials found.
pub fn prove_scripts(set: ScriptSet) -> Result<ScriptSet, Vec<ScriptProblem>> {
    let problems: Vec<ScriptProblem> = run_trials(&set).into_iter().filter_map(|result| result.problem).collect();
    if problems.is_empty() { Ok(set) } else { Err(problems) }
}

/// A script with other values of its settings, and which they are.
type ScriptVariant = (Option<String>, Arc<Script>);

fn build_variants(set: &ScriptSet, script: &Arc<Script>) -> Vec<ScriptVariant> {
    let section = script.file.strip_suffix(".rhai").unwrap_or(&script.file);
    let own = |place: &DeclarationPlace| {
        let all = set.values.list_values().filter(|(its, _, at, _)| *its == section && *at == place);
        all.map(|(_, name, _, value)| format!("{name} = {value}")).collect::<Vec<_>>().join(", ")
    };
    let places = set.values.list_places(section);
    if own(&DeclarationPlace::Machine).is_empty() && places.is_empty() {
        return vec![(None, script.clone())];
    }
    let machine = format!("with {} in force", own(&DeclarationPlace::Machine));
    let mut wanted = vec![
        ("with the defaults".to_owned(), SettingValues::default(), DeclarationPlace::Machine),
        (machine, (*set.values).clone(), DeclarationPlace::Machine),
    ];
    let special =
        |place: &DeclarationPlace| (format!("with {} for {place}", own(place)), (*set.values).clone(), place.clone());
    wanted.extend(places.iter().take(PLACES_MAX).map(special));
    let ready = |(told, values, place): &(String, SettingValues, DeclarationPlace)| {
        // It has compiled with these values already; a set without texts is tried as it is.
        compile_variant(set, script, values, place).ok().map(|script| (Some(told.clone()), script))
    };
    let found: Vec<ScriptVariant> = wanted.iter().filter_map(ready).collect();
    if found.is_empty() { vec![(None, script.clone())] } else { found }
}

fn of_script(set: &ScriptSet, script: &Arc<Script>) -> Vec<TrialResult> {
    build_variants(set, script).into_iter().flat_map(|(with, script)| of_variant(&script, with.as_deref())).collect()
}

fn of_variant(script: &Arc<Script>, with: Option<&str>) -> Vec<TrialResult> {
    if script.trials.is_empty() {
        return smoke::run_smoke_trial(script).into_iter().collect();
    }
    let theatre = Theatre::default();
    let mut engine = build_engine(&Shared::default(), false);
    functions::register_trial_functions(&mut engine, &theatre);
    let mut results: Vec<TrialResult> =
        script.trials.iter().map(|trial| run_trial(&engine, &theatre, script, trial)).collect();
    for result in &mut results {
        if let (Some(with), Some(problem)) = (with, &mut result.problem) {
            problem.what = format!("{with}: {}", problem.what);
        }
        if let Some(with) = with {
            result.name = format!("{} ({with})", result.name);
        }
    }
    results.sort_by_key(|result| result.line);
    results
}

fn run_trial(engine: &Engine, theatre: &Theatre, script: &Arc<Script>, trial: &Trial) -> TrialResult {
    theatre.open_stage(TrialContext::new(script));
    let mut scope = Scope::new();
    for (name, value) in &script.constants {
        scope.push_constant_dynamic(name.clone(), value.clone());
    }
    let outcome = RunningScript::new().run_within(engine, &mut scope, &trial.ast, &script.ast);
    let stage = theatre.close_stage();
    let name = trial.name.trim_start_matches(PREFIX).replace('_', " ");
    let problem = match outcome {
        Err(error) => {
            Some(stage.failure.clone().unwrap_or_else(|| problem::of_run(&script.file, &error, OPERATIONS_MAX)))
        }
        Ok(()) if stage.met == 0 => {
            let next = "end it with what must have come of it, such as expect_no_override()";
            Some(ScriptProblem::new(&script.file, trial.at, "it expects nothing", next))
        }
        Ok(()) => None,
    };
    let problem = problem.map(|problem| attribute_to_trial(problem, &name));
    let line = trial.at.line().unwrap_or_default();
    TrialResult { file: script.file.clone(), name, line, met: stage.met, passed_s: stage.passed_s(), problem }
}

fn attribute_to_trial(mut problem: ScriptProblem, name: &str) -> ScriptProblem {
    problem.what = format!("trial \"{name}\": {}", problem.what);
    if problem.next.is_empty() {
        "mend the script, or the trial where it asks for the wrong thing".clone_into(&mut problem.next);
    }
    problem
}
