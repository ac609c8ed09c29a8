//! The variables of one script: made once, filled before every run.
//!
//! The names that a script finds are known before it runs, so its text is compiled behind declarations of them: each variable is
//! then a place that the interpreter knows, and no name is searched at run time. The declarations themselves are never run, nor
//! are the constants at the head of the script, whose values stand in the scope once and for all.

use super::declared::LiveValues;
use super::examine::Findings;
use super::script_set::Script;
use super::vocabulary::{View, WordValue};
use rhai::{AST, ASTFlags, Dynamic, Engine, ImmutableString, Map, ParseError, Scope, Stmt};

/// The variables that the body and every handler find, in the order of [`scope_of`]: what never changes first. The interpreter looks
/// a name up from the last one, so that those which are set before every run are found at once.
pub(super) fn list_variables(found: &Findings, constants: &[(String, Dynamic)], live: &LiveValues) -> Vec<String> {
    let mut names: Vec<String> = constants.iter().map(|(name, _)| name.clone()).collect();
    names.extend(live.constants.iter().map(|(name, _)| name.clone()));
    names.extend(found.foreign.iter().map(ToString::to_string));
    let records = super::fields::RECORDS.iter().map(|record| record.name);
    names.extend(records.filter(|name| found.fields.iter().any(|it| it.record.name == *name)).map(str::to_owned));
    names.extend(found.reads.iter().filter(|word| !word.is_writable()).map(|word| word.name.to_owned()));
    names.push("memory".to_owned());
    names
}

/// Statements that run with the variables of [`list_variables`] in the scope.
pub(super) struct ScriptBody {
    ast: AST,
    /// Declarations before the first statement of the script.
    skip: usize,
    /// Lines before its first line.
    pub(super) lines: usize,
}

impl ScriptBody {
    /// Compiles a text behind declarations of these names.
    pub(super) fn compile_behind_names(engine: &Engine, text: &str, names: &[String]) -> Result<Self, ParseError> {
        let head: String = names.iter().map(|name| format!("let {name};")).collect();
        let ast = engine.compile(format!("{head}\n{text}"))?;
        let declared = |(stmt, name): (&Stmt, &String)| matches!(stmt, Stmt::Var(it, ..) if it.0.name == *name);
        let (heads, rest) = ast.statements().split_at(names.len().min(ast.statements().len()));
        let behind = heads.len() == names.len() && heads.iter().zip(names).all(declared);
        // A name that is declared again at the top takes the place of the first one, and would be left there for the next run.
        let again = |stmt: &Stmt| matches!(stmt, Stmt::Var(it, ..) if names.iter().any(|name| it.0.name == *name));
        if behind && !rest.iter().any(|stmt| again(stmt) && !is_constant(stmt)) {
            let constants = rest.iter().take_while(|stmt| again(stmt) && is_constant(stmt)).count();
            return Ok(Self { skip: names.len() + constants, ast, lines: 1 });
        }
        Ok(Self { ast: engine.compile(text)?, skip: 0, lines: 0 })
    }

    pub(super) fn statements(&self) -> &[Stmt] {
        &self.ast.statements()[self.skip.min(self.ast.statements().len())..]
    }
}

/// A constant that is written as a plain value; the scope has it already.
fn is_constant(stmt: &Stmt) -> bool {
    matches!(stmt, Stmt::Var(it, flags, _) if flags.contains(ASTFlags::CONSTANT) && it.1.is_constant())
}

/// Only what the script reads; a variable that nobody looks at costs nothing. Its constants stand here too, for handlers.
pub(super) fn scope_of(script: &Script, memory: Map) -> Scope<'static> {
    let mut scope = Scope::with_capacity(16 + script.reads.len() + script.constants.len());
    for (name, value) in &script.constants {
        scope.push_constant_dynamic(name.clone(), value.clone());
    }
    for (name, _) in &script.live.constants {
        scope.push_dynamic(name.clone(), Dynamic::UNIT);
    }
    for name in &script.foreign {
        scope.push_dynamic(name.clone(), Dynamic::UNIT);
    }
    for record in super::fields::RECORDS {
        let fields = script.fields.iter().filter(|field| field.record.name == record.name);
        let map: Map = fields.map(|field| (field.word.name.into(), Dynamic::UNIT)).collect();
        if !map.is_empty() {
            scope.push(record.name, map);
        }
    }
    for word in script.reads.iter().filter(|word| !word.is_writable()) {
        scope.push_dynamic(word.name, Dynamic::UNIT);
    }
    scope.push("memory", memory);
    scope
}

/// Sets every variable to what is seen now. `foreign` are the channels of other scripts, `live` the settings of this tool.
pub(super) fn fill_scope(
    scope: &mut Scope<'static>,
    script: &Script,
    view: &View<'_>,
    (foreign, live): (&[Option<f64>], &[Dynamic]),
) {
    for word in script.reads.iter().filter(|word| !word.is_writable()) {
        if let Some(place) = scope.get_mut(word.name) {
            set_variable(place, &word.read_value(view));
        }
    }
    for field in &script.fields {
        let Some(record) = scope.get_mut(field.record.name) else { continue };
        let Some(mut map) = record.write_lock::<Map>() else { continue };
        if let Some(place) = map.get_mut(field.word.name) {
            set_variable(place, &field.read_value(view));
        }
    }
    for (name, value) in script.foreign.iter().zip(foreign) {
        if let Some(place) = scope.get_mut(name) {
            set_variable(place, &value.map_or(WordValue::Absent, WordValue::Number));
        }
    }
    for (name, index) in &script.live.constants {
        if let (Some(place), Some(value)) = (scope.get_mut(name), live.get(*index)) {
            place.clone_from(value);
        }
    }
}

fn set_variable(place: &mut Dynamic, seen: &WordValue<'_>) {
    match seen {
        WordValue::Number(number) => *place = Dynamic::from_float(*number),
        WordValue::Absent => *place = Dynamic::UNIT,
        WordValue::Text(text) => set_text(place, text),
    }
}

/// Keeps the string that is there when it says the same.
fn set_text(place: &mut Dynamic, text: &str) {
    if place.read_lock::<ImmutableString>().is_none_or(|old| old.as_str() != text) {
        *place = Dynamic::from(ImmutableString::from(text));
    }
}

/// Is anything that the script reads without a value?
pub(super) fn has_absent(scope: &Scope<'_>, script: &Script) -> bool {
    let absent = |name: &str| scope.get(name).is_some_and(Dynamic::is_unit);
    let field = |record, name| {
        let map = scope.get(record).and_then(|record| record.read_lock::<Map>());
        map.is_some_and(|map| map.get(name).is_some_and(Dynamic::is_unit))
    };
    script.reads.iter().any(|word| !word.is_writable() && absent(word.name))
        || script.foreign.iter().any(|name| absent(name))
        || script.fields.iter().any(|it| field(it.record.name, it.word.name))
}

/// Everything that the script reads and that has no value, with the reason.
pub(super) fn why_absent<'a>(
    script: &'a Script,
    view: &'a View<'_>,
    foreign: &'a [Option<f64>],
) -> impl Iterator<Item = String> {
    let fields = script.fields.iter().map(|field| field.word);
    let mut told: Vec<&str> = Vec::new();
    let of_others = script.foreign.iter().zip(foreign).filter(|(_, value)| value.is_none());
    let of_others = of_others.map(|(name, _)| format!("{name} has no value (its script publishes none now)"));
    let own = script.reads.iter().copied().chain(fields).filter_map(move |word| {
        let why = word.why_absent(view).filter(|_| !told.contains(&word.name))?;
        told.push(word.name);
        Some(format!("{} has no value ({why})", word.name))
    });
    own.chain(of_others)
}
