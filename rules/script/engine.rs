//! The interpreter: what a script may use, and the limits on everything it does.

use super::collect::{RunOutput, ScriptResult};
use super::functions;
use super::outcomes;
use rhai::packages::{
    ArithmeticPackage, BasicArrayPackage, BasicFnPackage, BasicIteratorPackage, BasicMapPackage, BasicMathPackage,
    BasicStringPackage, LanguageCorePackage, LogicPackage, MoreStringPackage, Package,
};
use rhai::{Engine, OptimizationLevel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Operations in one run; a shipped script takes one or two hundred. The interpreter copies a whole map or list in a single
/// operation, so that this and the sizes below bound the time of a run together: the worst that is known, copying full maps
/// in a loop, is measured in `tests/box/scripts/mad.rs`.
pub const OPERATIONS_MAX: u64 = 3_000;
/// Bytes of one script file.
pub const TEXT_MAX: usize = 64 * 1024;
/// Bytes of one string, also of all strings in one map or array together.
const STRING_MAX: usize = 1024;
/// Elements of one array, those of arrays in it included.
const ELEMENTS_MAX: usize = 128;
/// Entries of one map, `memory` among them, those of maps in it included.
const ENTRIES_MAX: usize = 128;
const VARIABLES_MAX: usize = 256;
const FUNCTIONS_MAX: usize = 64;
const CALLS_MAX: usize = 32;
const DEPTH_MAX: usize = 48;

/// Words of the language that a script has no use for: output, and evaluating text.
const DISABLED: [&str; 3] = ["print", "debug", "eval"];
/// Functions of the language that a script may not call, not even by their name as text.
const FORBIDDEN: [&str; 6] = ["sleep", "get_fn_metadata_list", "parse_json", "Fn", "call", "curry"];

/// What the running script leaves behind; one script runs at a time.
#[derive(Clone, Default)]
pub(super) struct Shared(Arc<Mutex<RunOutput>>);

impl Shared {
    pub(super) fn lock(&self) -> MutexGuard<'_, RunOutput> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An interpreter whose functions leave their effects in `shared`.
pub(super) fn build_engine(shared: &Shared, optimize: bool) -> Engine {
    let mut engine = Engine::new_raw();
    register_packages(&mut engine);
    set_limits(&mut engine);
    for word in DISABLED {
        engine.disable_symbol(word);
    }
    engine.set_optimization_level(if optimize { OptimizationLevel::Simple } else { OptimizationLevel::None });
    outcomes::register_outcomes(&mut engine, shared);
    functions::register_methods(&mut engine, shared);
    // Registered functions go before those of the language.
    let asleep = || -> ScriptResult<()> { Err("a script may not sleep".into()) };
    engine.register_fn("sleep", move |_: i64| asleep());
    engine.register_fn("sleep", move |_: f64| asleep());
    engine
}

fn register_packages(engine: &mut Engine) {
    LanguageCorePackage::new().register_into_engine(engine);
    ArithmeticPackage::new().register_into_engine(engine);
    LogicPackage::new().register_into_engine(engine);
    BasicMathPackage::new().register_into_engine(engine);
    BasicStringPackage::new().register_into_engine(engine);
    MoreStringPackage::new().register_into_engine(engine);
    BasicArrayPackage::new().register_into_engine(engine);
    BasicMapPackage::new().register_into_engine(engine);
    BasicIteratorPackage::new().register_into_engine(engine);
    BasicFnPackage::new().register_into_engine(engine);
}

fn set_limits(engine: &mut Engine) {
    engine.set_max_operations(OPERATIONS_MAX);
    engine.set_max_call_levels(CALLS_MAX);
    engine.set_max_expr_depths(DEPTH_MAX, DEPTH_MAX);
    engine.set_max_string_size(STRING_MAX);
    engine.set_max_array_size(ELEMENTS_MAX);
    engine.set_max_map_size(ENTRIES_MAX);
    engine.set_max_variables(VARIABLES_MAX);
    engine.set_max_functions(FUNCTIONS_MAX);
}

/// Every function that can be called, by name and number of arguments.
pub(super) fn list_callables(engine: &Engine) -> Vec<(String, usize)> {
    let pair = |it: rhai::FuncInfo<'_>| Some((it.metadata.name.to_string(), it.metadata.num_params));
    let mut known = engine.collect_fn_metadata(None, pair, true);
    known.retain(|(name, _)| !FORBIDDEN.contains(&name.as_str()));
    known.push(("type_of".to_owned(), 1));
    known.sort();
    known.dedup();
    known
}
