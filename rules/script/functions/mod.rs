//! The methods that a script can call by name: one table per subject, registered into the interpreter from that table.
//!
//! They are pure: the same arguments give the same answer, whatever ran before. A method that has no number it can stand
//! behind returns `()`, as a word without a value does; `why("name")` then tells the reason, and a script that computes
//! with the missing number waits as it does for a channel.

mod arguments;
mod power_separation;
mod spindle_current;
mod thermal;
mod wear;

pub use arguments::{Arguments, MethodResult};

use super::collect::ScriptResult;
use super::engine::Shared;
use estimators::regression::Refusal;
use rhai::{Dynamic, Engine, ImmutableString, NativeCallContext};
use std::any::TypeId;

/// What a method takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MethodParameter {
    /// Name; ends in the unit where the unit has a short form.
    pub name: &'static str,
    /// Unit symbol; `1` for pure numbers; `[W]` for an array, `[[rpm, W]]` for an array of rows.
    pub unit: &'static str,
}

const fn define_parameter(name: &'static str, unit: &'static str) -> MethodParameter {
    MethodParameter { name, unit }
}

/// A method that a script can call.
pub struct Method {
    /// Name in scripts; ends in the unit of the answer where it is a number with one.
    pub name: &'static str,
    /// What it takes, in order.
    pub parameters: &'static [MethodParameter],
    /// Unit of the answer; for a map its keys with their units.
    pub returns: &'static str,
    /// What it does, in English.
    pub en: &'static str,
    /// What it does, in Chinese.
    pub zh: &'static str,
    run: fn(&Arguments<'_>) -> Result<MethodResult, Refusal>,
}

impl Method {
    /// How it is written: name and parameters.
    #[must_use]
    pub fn signature(&self) -> String {
        let names: Vec<&str> = self.parameters.iter().map(|parameter| parameter.name).collect();
        format!("{}({})", self.name, names.join(", "))
    }
}

/// Methods that belong together.
pub struct Subject {
    /// Heading of the subject in English.
    pub en: &'static str,
    /// Heading of the subject in Chinese.
    pub zh: &'static str,
    /// The methods of the subject.
    pub methods: &'static [Method],
}

/// Every subject, in the order in which they are printed.
pub static SUBJECTS: &[&Subject] =
    &[&power_separation::SUBJECT, &spindle_current::SUBJECT, &thermal::SUBJECT, &wear::SUBJECT];

/// Every method of every subject.
pub fn list_methods() -> impl Iterator<Item = &'static Method> {
    SUBJECTS.iter().flat_map(|subject| subject.methods)
}

/// Makes every method callable; what one refuses goes to `shared`.
pub(super) fn register_methods(engine: &mut Engine, shared: &Shared) {
    for method in list_methods() {
        let types = vec![TypeId::of::<Dynamic>(); method.parameters.len()];
        let to = shared.clone();
        let run = move |_: NativeCallContext<'_>, values: &mut [&mut Dynamic]| call_method(method, values, &to);
        engine.register_raw_fn(method.name, types, run);
    }
    let to = shared.clone();
    engine.register_fn("why", move |name: ImmutableString| to.lock().explain_refusal(&name));
}

fn call_method(method: &Method, values: &mut [&mut Dynamic], to: &Shared) -> ScriptResult<Dynamic> {
    let arguments = Arguments::read(method, values)?;
    let answer = arguments.find_missing().map_or_else(|| (method.run)(&arguments), Err);
    match answer.and_then(MethodResult::check_finite) {
        Ok(answer) => Ok(answer.into_dynamic()),
        Err(refusal) => {
            to.lock().record_refusal(method.name, &refusal.to_string());
            Ok(Dynamic::UNIT)
        }
    }
}
