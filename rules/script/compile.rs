//! From texts to a set of scripts that can run, or everything that is wrong with them.

use super::engine::{self, OPERATIONS_MAX, Shared, TEXT_MAX};
use super::events::Event;
use super::examine::{Findings, Place, Walk};
use super::fields::Field;
use super::handlers::{Called, Handling, called};
use super::problem::{self, Problem};
use super::settings::{Choice, merge, read_choices};
use super::trials::{Trial, prove};
use super::vocabulary::Word;
use crate::estimators::Settings;
use adapters::clock::SECOND_NS;
use rhai::{AST, CallFnOptions, Dynamic, Engine, ImmutableString, Map, Position, Scope};
use std::collections::BTreeMap;
use std::sync::Arc;

/// At most this many scripts in one set.
const SCRIPTS_MAX: usize = 64;

/// The text of a script and the name it has in messages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScriptFile {
    /// File name, `alarms.rhai`.
    pub name: String,
    /// The whole text.
    pub text: String,
}

/// A compiled script.
pub(super) struct Script {
    pub(super) file: Arc<str>,
    pub(super) version: u64,
    pub(super) ast: AST,
    pub(super) reads: Vec<&'static Word>,
    pub(super) fields: Vec<Field>,
    /// Channels of its own: name and unit.
    pub(super) channels: Vec<(ImmutableString, ImmutableString)>,
    pub(super) handlers: Vec<Handling>,
    pub(super) trials: Vec<Trial>,
    /// Constants that are written as plain values: what handlers see of the body.
    pub(super) constants: Vec<(String, Dynamic)>,
    /// 0: at every tick.
    pub(super) every_ns: i64,
    /// Nothing to run: the file only has settings.
    pub(super) passive: bool,
    pub(super) choices: Vec<Choice>,
    pub(super) thresholds: Vec<(String, String)>,
}

impl Script {
    /// Has it a handler for this?
    pub(super) fn hears(&self, event: &Event) -> bool {
        self.handlers.iter().any(|handler| handler.kind == event.kind())
    }
}

/// Scripts that belong together; all of them compile and their settings agree.
#[derive(Clone, Default)]
pub struct ScriptSet {
    pub(super) scripts: Vec<Arc<Script>>,
    pub(super) settings: Settings,
    pub(super) files: Arc<[ScriptFile]>,
}

impl ScriptSet {
    /// The settings of the estimators that these scripts ask for.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The texts that it was made from.
    #[must_use]
    pub fn files(&self) -> &[ScriptFile] {
        &self.files
    }

    /// Every script with its version, which is another one for another text.
    pub fn versions(&self) -> impl Iterator<Item = (&str, u64)> {
        self.scripts.iter().map(|script| (&*script.file, script.version))
    }

    /// How many scripts there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.scripts.len()
    }

    /// What this set and another have in common, what only this one has, and what only the other has. A script sees nothing of
    /// the others, so the parts together decide what the whole does. Each part keeps the settings of its set; the common one
    /// those of this set.
    #[must_use]
    pub fn split(self, other: Self) -> (Self, Self, Self) {
        let has = |set: &Self, script: &Script| {
            set.scripts.iter().any(|its| its.file == script.file && its.version == script.version)
        };
        let part = |set: &Self, which: &dyn Fn(&Script) -> bool| {
            let scripts = set.scripts.iter().filter(|script| which(script)).cloned().collect();
            Self { scripts, settings: set.settings.clone(), files: set.files.clone() }
        };
        let common = part(&self, &|script| has(&other, script));
        (common, part(&self, &|script| !has(&other, script)), part(&other, &|script| !has(&self, script)))
    }

    /// No script at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.scripts.is_empty()
    }
}

/// Compiles all files, or none: a set in which one script is broken is refused as a whole.
///
/// # Errors
/// Everything that is wrong in any of the files.
pub fn compile(files: &[ScriptFile]) -> Result<ScriptSet, Vec<Problem>> {
    let compiler = Compiler::new();
    let mut problems = Vec::new();
    let mut scripts: BTreeMap<&str, Arc<Script>> = BTreeMap::new();
    for file in files {
        match compiler.script(file) {
            Ok(script) => drop(scripts.insert(&file.name, Arc::new(script))),
            Err(found) => problems.extend(found),
        }
    }
    if files.len() > SCRIPTS_MAX {
        let what = format!("{} scripts; at most {SCRIPTS_MAX} can run together", files.len());
        problems.push(Problem::new("scripts", Position::NONE, what, "join some of them"));
    }
    let scripts: Vec<_> = scripts.into_values().collect();
    let settings = merge(&scripts, &mut problems);
    one_publisher(&scripts, &mut problems);
    if problems.is_empty() { Ok(ScriptSet { scripts, settings, files: files.into() }) } else { Err(problems) }
}

/// Compiles all files and runs their trials: what has to be well before scripts come into charge.
///
/// # Errors
/// Everything that is wrong in any of the files, or else everything that their trials found.
pub fn prepare(files: &[ScriptFile]) -> Result<ScriptSet, Vec<Problem>> {
    compile(files).and_then(prove)
}

/// A channel has one publisher.
fn one_publisher(scripts: &[Arc<Script>], problems: &mut Vec<Problem>) {
    let mut taken: BTreeMap<&str, &str> = BTreeMap::new();
    for script in scripts {
        for (name, _) in &script.channels {
            if let Some(other) = taken.insert(name, &script.file) {
                let what = format!("the channel {name} is also published in {other}");
                problems.push(Problem::new(&script.file, Position::NONE, what, "keep one of the two"));
            }
        }
    }
}

struct Compiler {
    checking: Engine,
    running: Engine,
    callable: Vec<(String, usize)>,
}

impl Compiler {
    fn new() -> Self {
        let shared = Shared::default();
        let checking = engine::engine(&shared, false);
        let callable = engine::callable(&checking);
        Self { running: engine::engine(&shared, true), checking, callable }
    }

    fn script(&self, file: &ScriptFile) -> Result<Script, Vec<Problem>> {
        let name = file.name.as_str();
        if file.text.len() > TEXT_MAX {
            let what = format!("{} bytes; a script has at most {TEXT_MAX}", file.text.len());
            return Err(vec![Problem::new(name, Position::NONE, what, "split it into several files")]);
        }
        let parse = |engine: &Engine| engine.compile(&file.text).map_err(|error| vec![problem::of_parse(name, &error)]);
        let plain = parse(&self.checking)?;
        let constants = constants(&plain);
        let mut problems = Vec::new();
        let called = called(file, &plain, (&self.checking, &self.running), &mut problems);
        let mut found = self.examine(name, &plain, &called, &constants);
        found.problems.append(&mut problems);
        let every_ns = every_ns(file, &plain).unwrap_or_else(|problem| {
            found.problems.push(problem);
            0
        });
        if !found.problems.is_empty() {
            return Err(found.problems);
        }
        let ast = parse(&self.running)?;
        Ok(Script {
            file: file.name.as_str().into(),
            version: version(&file.text),
            every_ns,
            passive: plain.statements().is_empty(),
            choices: self.choices(file, &ast)?,
            thresholds: constants.iter().map(|(name, value)| (name.clone(), value.to_string())).collect(),
            reads: found.reads,
            fields: found.fields,
            channels: found.channels,
            handlers: called.handlers,
            trials: called.trials,
            constants,
            ast,
        })
    }

    fn examine(&self, file: &str, plain: &AST, called: &Called, constants: &[(String, Dynamic)]) -> Findings {
        let mut walk = Walk::new(file, plain, &self.callable);
        let mut body = plain.clone();
        body.clear_functions();
        walk.read(&body, Place::Body);
        walk.read(&called.others(plain), Place::Function);
        let constants: Vec<ImmutableString> = constants.iter().map(|(name, _)| name.as_str().into()).collect();
        for handler in &called.handlers {
            let seen: Vec<ImmutableString> = handler.parameters.iter().chain(&constants).cloned().collect();
            walk.read(&handler.plain, Place::Handler(&seen));
        }
        for trial in &called.trials {
            walk.read(&trial.plain, Place::Trial(&constants));
        }
        walk.finish()
    }

    /// Calls `fn settings()` once.
    fn choices(&self, file: &ScriptFile, ast: &AST) -> Result<Vec<Choice>, Vec<Problem>> {
        if !ast.iter_functions().any(|it| it.name == "settings" && it.params.is_empty()) {
            return Ok(Vec::new());
        }
        let options = CallFnOptions::new().eval_ast(false);
        let result = self.running.call_fn_with_options::<Map>(options, &mut Scope::new(), ast, "settings", ());
        match result {
            Ok(map) => read_choices(file, &map),
            Err(error) => Err(vec![problem::of_run(&file.name, &error, OPERATIONS_MAX)]),
        }
    }
}

/// `const EVERY_S = 1.0;` as nanoseconds; 0 when there is none.
fn every_ns(file: &ScriptFile, ast: &AST) -> Result<i64, Problem> {
    let Some((.., value)) = ast.iter_literal_variables(true, true).find(|(name, ..)| *name == "EVERY_S") else {
        return Ok(0);
    };
    let seconds = value.as_float().or_else(|_| value.as_int().map(|whole| whole as f64)).unwrap_or(f64::NAN);
    if (0.001..=3600.0).contains(&seconds) {
        return Ok((seconds * SECOND_NS as f64) as i64);
    }
    let what = format!("EVERY_S = {value} is outside 0.001 to 3600");
    let next = "EVERY_S is the time between two runs of this script in seconds; without it, it runs at every tick";
    Err(Problem::new(&file.name, position_of(&file.text, "EVERY_S"), what, next))
}

/// The constants at the top of the script that are plain values: what a page shows as thresholds.
fn constants(ast: &AST) -> Vec<(String, Dynamic)> {
    ast.iter_literal_variables(true, false).map(|(name, _, value)| (name.to_owned(), value)).collect()
}

/// Where `word` first stands in `text` as a word of its own.
pub(super) fn position_of(text: &str, word: &str) -> Position {
    let part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    for (number, line) in text.lines().enumerate() {
        let code = line.split("//").next().unwrap_or_default();
        let stands = code
            .match_indices(word)
            .find(|(at, _)| !code[..*at].ends_with(part) && !code[at + word.len()..].starts_with(part));
        if let Some((at, _)) = stands {
            let column = code[..at].chars().count() + 1;
            let number = u16::try_from(number + 1).unwrap_or(u16::MAX);
            return Position::new(number, u16::try_from(column).unwrap_or(u16::MAX));
        }
    }
    Position::NONE
}

/// FNV-1a over the text: the version that decisions are recorded with.
pub(super) fn version(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}
