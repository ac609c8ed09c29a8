//! From texts to a set of scripts that can run, or everything that is wrong with them.

use super::declared::{self, DeclarationPlace as Where, Declared, Force, FoundDeclaration, LiveValues, SettingValues};
use super::engine::{self, OPERATIONS_MAX, Shared, TEXT_MAX};
use super::examine::{Findings, ScriptPlace, Walk};
use super::handlers::{Called, find_called_functions};
use super::order::{self, PublishedChannels};
use super::problem::{self, ScriptProblem};
use super::script_set::{Script, ScriptSet};
use super::settings::{ChosenSetting, merge_settings, read_choices};
use super::trials::prove_scripts;
use super::variables::{self, ScriptBody};
use super::vocabulary::find_word;
use adapter_core::clock::SECOND_NS;
use rhai::{AST, Dynamic, Engine, ImmutableString, Map, Position, Scope};
use std::collections::BTreeMap;
use std::sync::Arc;

/// At most this many scripts in one set.
const SCRIPTS_MAX: usize = 64;

/// The text of a script and the name it has in messages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScriptFile {
    /// File name with its ending, `alarms.rhai`; stands in messages.
    pub name: String,
    /// The text as saved, before values of settings are put in.
    pub text: String,
}

/// Compiles all files, or none: a set in which one script is broken is refused as a whole. Every setting has its default.
///
/// # Errors
/// Everything that is wrong in any of the files.
pub fn compile_scripts(files: &[ScriptFile]) -> Result<ScriptSet, Vec<ScriptProblem>> {
    compile_with(files, &SettingValues::default())
}

/// Compiles all files with these values of their settings.
///
/// # Errors
/// Everything that is wrong in any of the files, and every value that no script declares or that lies outside its range.
pub fn compile_with(files: &[ScriptFile], values: &SettingValues) -> Result<ScriptSet, Vec<ScriptProblem>> {
    let compiler = Compiler::new(files);
    let mut problems = Vec::new();
    let mut scripts: BTreeMap<&str, Arc<Script>> = BTreeMap::new();
    for file in files {
        match compiler.compile_script(file, |found| Force::from_values(found, values)) {
            Ok(script) => drop(scripts.insert(&file.name, Arc::new(script))),
            Err(found) => problems.extend(found),
        }
    }
    if files.len() > SCRIPTS_MAX {
        let what = format!("{} scripts; at most {SCRIPTS_MAX} can run together", files.len());
        problems.push(ScriptProblem::new("scripts", Position::NONE, what, "join some of them"));
    }
    // Where a script is broken its settings are not known, and a value of the file may be right.
    if problems.is_empty() {
        let declared: Vec<&Declared> = scripts.values().flat_map(|script| &script.declared).collect();
        let names: Vec<&str> = files.iter().map(|file| file.name.as_str()).collect();
        problems.extend(values.list_problems(&declared, &names));
    }
    let scripts: Vec<_> = scripts.into_values().collect();
    let settings = merge_settings(&scripts, &mut problems);
    order::one_publisher(&scripts, &mut problems);
    let scripts = order::order_by_dependency(scripts, &mut problems);
    let set = ScriptSet { scripts, settings, files: files.into(), values: Arc::new(values.clone()) };
    if problems.is_empty() { Ok(set) } else { Err(problems) }
}

/// Compiles one file beside the others, which may be broken: for its trials alone.
///
/// # Errors
/// Everything that is wrong in this file.
pub fn compile_one(
    file: &ScriptFile,
    files: &[ScriptFile],
    values: &SettingValues,
) -> Result<ScriptSet, Vec<ScriptProblem>> {
    let script = Compiler::new(files).compile_script(file, |found| Force::from_values(found, values))?;
    let scripts = vec![Arc::new(script)];
    let mut problems = Vec::new();
    let settings = merge_settings(&scripts, &mut problems);
    let set = ScriptSet { scripts, settings, files: files.into(), values: Arc::new(values.clone()) };
    if problems.is_empty() { Ok(set) } else { Err(problems) }
}

/// The script of this file with other values of its settings, all of them in the text: what its trials are run with.
pub(super) fn compile_variant(
    set: &ScriptSet,
    script: &Script,
    values: &SettingValues,
    place: &Where,
) -> Result<Arc<Script>, Vec<ScriptProblem>> {
    let Some(file) = set.files.iter().find(|file| file.name == *script.file) else { return Err(Vec::new()) };
    Compiler::new(&set.files).compile_script(file, |found| Force::with_fixed_values(found, values, place)).map(Arc::new)
}

/// Every setting that these files declare.
///
/// # Errors
/// Every declaration that cannot be read.
pub fn list_declarations(files: &[ScriptFile]) -> Result<Vec<Declared>, Vec<ScriptProblem>> {
    let engine = engine::build_engine(&Shared::default(), false);
    let (mut all, mut problems) = (Vec::new(), Vec::new());
    for file in files.iter().filter(|file| file.text.len() <= TEXT_MAX) {
        match declared::find_declarations(file, &engine) {
            Ok(found) => all.extend(found.into_iter().map(|it| it.declared)),
            Err(found) => problems.extend(found),
        }
    }
    if problems.is_empty() { Ok(all) } else { Err(problems) }
}

/// Compiles all files and runs their trials: what has to be well before scripts come into charge.
///
/// # Errors
/// Everything that is wrong in any of the files, or else everything that their trials found.
pub fn prepare_scripts(files: &[ScriptFile]) -> Result<ScriptSet, Vec<ScriptProblem>> {
    compile_scripts(files).and_then(prove_scripts)
}

/// The same with these values of the settings. The trials run with the defaults, with the values of the machine, and with those of
/// each tool and operation.
///
/// # Errors
/// As [`prepare_scripts`], and every value that cannot be used.
pub fn prepare_with(files: &[ScriptFile], values: &SettingValues) -> Result<ScriptSet, Vec<ScriptProblem>> {
    compile_with(files, values).and_then(prove_scripts)
}

struct Compiler {
    shared: Shared,
    checking_engine: Engine,
    running_engine: Engine,
    callable: Vec<(String, usize)>,
    /// The channels that any of the files publishes.
    channels: PublishedChannels,
}

impl Compiler {
    fn new(files: &[ScriptFile]) -> Self {
        let shared = Shared::default();
        let checking = engine::build_engine(&shared, false);
        let callable = engine::list_callables(&checking);
        let running = engine::build_engine(&shared, true);
        Self {
            shared,
            running_engine: running,
            checking_engine: checking,
            callable,
            channels: PublishedChannels::from_files(files),
        }
    }

    fn compile_script(
        &self,
        file: &ScriptFile,
        force: impl Fn(&[FoundDeclaration]) -> Force,
    ) -> Result<Script, Vec<ScriptProblem>> {
        let name = file.name.as_str();
        if file.text.len() > TEXT_MAX {
            let what = format!("{} bytes; a script has at most {TEXT_MAX}", file.text.len());
            return Err(vec![ScriptProblem::new(name, Position::NONE, what, "split it into several files")]);
        }
        let parse =
            |engine: &Engine, text: &str| engine.compile(text).map_err(|error| vec![problem::of_parse(name, &error)]);
        // As written first: an error is told before any value stands in the text.
        parse(&self.checking_engine, &file.text)?;
        let declarations = declared::find_declarations(file, &self.checking_engine)?;
        let force = force(&declarations);
        let filled = ScriptFile {
            name: file.name.clone(),
            text: declared::with_values(&file.text, &declarations, &force.texts),
        };
        let plain = parse(&self.checking_engine, &filled.text)?;
        let constants = list_constants(&plain);
        let mut problems = Vec::new();
        let called = find_called_functions(&filled, &plain, &self.checking_engine, &mut problems);
        let live: Vec<&str> = force.live.constants.iter().map(|(name, _)| name.as_str()).collect();
        let mut found = self.examine_script(
            (name, &filled.text),
            &plain,
            &called,
            constants.iter().map(|(name, _)| name.as_str()).chain(live),
        );
        found.problems.append(&mut problems);
        let every_ns = every_ns(&filled, &plain).unwrap_or_else(|problem| {
            found.problems.push(problem);
            0
        });
        if !found.problems.is_empty() {
            return Err(found.problems);
        }
        let ast = parse(&self.running_engine, &filled.text)?;
        let choices = match &called.settings {
            Some(settings) => self.evaluate_settings(&filled, (settings, &ast), &constants, &force.live)?,
            None => Vec::new(),
        };
        let names = variables::list_variables(&found, &constants, &force.live);
        let body = ScriptBody::compile_behind_names(&self.running_engine, &filled.text, &names)
            .map_err(|error| vec![problem::of_parse(name, &error)])?;
        let handlers = called
            .compile_handlers(&self.running_engine, &names)
            .map_err(|error| vec![problem::of_parse(name, &error)])?;
        Ok(Script {
            file: file.name.as_str().into(),
            version: if force.chosen {
                compute_version(&format!("{}\n{:?}", file.text, force.texts))
            } else {
                compute_version(&file.text)
            },
            every_ns,
            passive: plain.statements().is_empty(),
            choices,
            thresholds: constants.iter().map(|(name, value)| (name.clone(), value.to_string())).collect(),
            reads: found.reads,
            fields: found.fields,
            channels: found.channels,
            foreign: found.foreign,
            handlers,
            trials: called.trials,
            declared: declarations.into_iter().map(|it| it.declared).collect(),
            live: force.live,
            constants,
            body,
            ast,
        })
    }

    fn examine_script<'c>(
        &self,
        (file, text): (&str, &str),
        plain: &AST,
        called: &Called,
        constants: impl Iterator<Item = &'c str>,
    ) -> Findings {
        let mut walk = Walk::new((file, text), plain, &self.callable, &self.channels);
        let mut body = plain.clone();
        body.clear_functions();
        walk.read(&body, ScriptPlace::Body);
        walk.read(&called.extract_own_functions(plain), ScriptPlace::Function);
        let constants: Vec<ImmutableString> = constants.map(ImmutableString::from).collect();
        for handler in &called.handlers {
            let seen: Vec<ImmutableString> = handler.parameters.iter().chain(&constants).cloned().collect();
            let like = find_word(handler.kind.vocabulary_word());
            let like: Vec<(&str, _)> =
                like.iter().flat_map(|word| handler.parameters.iter().map(|name| (name.as_str(), *word))).collect();
            walk.read(&handler.plain, ScriptPlace::Handler(&seen, &like));
        }
        if let Some(settings) = &called.settings {
            walk.read(settings, ScriptPlace::Settings(&constants));
        }
        for trial in &called.trials {
            walk.read(&trial.plain, ScriptPlace::Trial(&constants));
        }
        walk.into_findings()
    }

    /// Runs `fn settings()` once, and once more for each tool and operation with values of its own.
    fn evaluate_settings(
        &self,
        file: &ScriptFile,
        (settings, functions): (&AST, &AST),
        constants: &[(String, Dynamic)],
        live: &LiveValues,
    ) -> Result<Vec<ChosenSetting>, Vec<ScriptProblem>> {
        let mut whole = functions.clone();
        whole.clear_statements();
        let ast = whole.merge(settings);
        let one = |place: &Where| {
            let values = live.values_for_place(place);
            let mut scope = Scope::new();
            for (name, value) in constants {
                scope.push_constant_dynamic(name.clone(), value.clone());
            }
            for (name, index) in &live.constants {
                scope.push_constant_dynamic(name.clone(), values.get(*index).cloned().unwrap_or_default());
            }
            self.shared.lock().live = Some(values);
            let result = self.running_engine.eval_ast_with_scope::<Map>(&mut scope, &ast);
            let map = result.map_err(|error| vec![problem::of_run(&file.name, &error, OPERATIONS_MAX)])?;
            read_choices(file, &map, place)
        };
        let mut choices = one(&Where::Machine)?;
        let of_machine = choices.len();
        for place in live.places() {
            let mut special = one(place)?;
            // What a place says otherwise than the machine; two tools may say the same.
            special.retain(|it| !choices[..of_machine].iter().any(|known| known.says_the_same(it)));
            choices.extend(special);
        }
        Ok(choices)
    }
}

/// `const EVERY_S = 1.0;` as nanoseconds; 0 when there is none.
fn every_ns(file: &ScriptFile, ast: &AST) -> Result<i64, ScriptProblem> {
    let Some((.., value)) = ast.iter_literal_variables(true, true).find(|(name, ..)| *name == "EVERY_S") else {
        return Ok(0);
    };
    let seconds = value.as_float().or_else(|_| value.as_int().map(|whole| whole as f64)).unwrap_or(f64::NAN);
    if (0.001..=3600.0).contains(&seconds) {
        return Ok((seconds * SECOND_NS as f64) as i64);
    }
    let what = format!("EVERY_S = {value} is outside 0.001 to 3600");
    let next = "EVERY_S is the time between two runs of this script in seconds; without it, it runs at every tick";
    Err(ScriptProblem::new(&file.name, position_of(&file.text, "EVERY_S"), what, next))
}

/// The constants at the top of the script that are plain values: what a page shows as thresholds.
fn list_constants(ast: &AST) -> Vec<(String, Dynamic)> {
    ast.iter_literal_variables(true, false).map(|(name, _, value)| (name.to_owned(), value)).collect()
}

/// Where `word` first stands in `text` as a word of its own.
pub(super) fn position_of(text: &str, word: &str) -> Position {
    let part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut begin = 0;
    for line in text.split_inclusive('\n') {
        let code = line.split("//").next().unwrap_or_default();
        let stands = code
            .match_indices(word)
            .find(|(at, _)| !code[..*at].ends_with(part) && !code[at + word.len()..].starts_with(part));
        if let Some((at, _)) = stands {
            return declared::scan::to_position(text, begin + at);
        }
        begin += line.len();
    }
    Position::NONE
}

/// FNV-1a over the text: the version that decisions are recorded with.
pub(super) fn compute_version(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}
