//! The variables of one script: made once, filled before every run.

use super::compile::Script;
use super::vocabulary::{Seen, View};
use rhai::{Dynamic, ImmutableString, Map, Scope};

/// Only what the script reads; a variable that nobody looks at costs nothing. Its constants stand here too, for handlers.
pub(super) fn scope_of(script: &Script, memory: Map) -> Scope<'static> {
    let mut scope = Scope::with_capacity(8 + script.reads.len());
    scope.push("memory", memory);
    for (name, value) in &script.constants {
        scope.push_constant_dynamic(name.clone(), value.clone());
    }
    for word in script.reads.iter().filter(|word| !word.writable()) {
        scope.push_dynamic(word.name, Dynamic::UNIT);
    }
    for record in super::fields::RECORDS {
        let fields = script.fields.iter().filter(|field| field.record.name == record.name);
        let map: Map = fields.map(|field| (field.word.name.into(), Dynamic::UNIT)).collect();
        if !map.is_empty() {
            scope.push(record.name, map);
        }
    }
    scope
}

/// Sets every variable to what is seen now.
pub(super) fn fill(scope: &mut Scope<'static>, script: &Script, view: &View<'_>) {
    for word in script.reads.iter().filter(|word| !word.writable()) {
        if let Some(place) = scope.get_mut(word.name) {
            set(place, &word.see(view));
        }
    }
    for field in &script.fields {
        let Some(record) = scope.get_mut(field.record.name) else { continue };
        let Some(mut map) = record.write_lock::<Map>() else { continue };
        if let Some(place) = map.get_mut(field.word.name) {
            set(place, &field.see(view));
        }
    }
}

fn set(place: &mut Dynamic, seen: &Seen<'_>) {
    match seen {
        Seen::Number(number) => *place = Dynamic::from_float(*number),
        Seen::Absent => *place = Dynamic::UNIT,
        Seen::Text(text) => set_text(place, text),
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
    let absent = |name| scope.get(name).is_some_and(Dynamic::is_unit);
    let field = |record, name| {
        let map = scope.get(record).and_then(|record| record.read_lock::<Map>());
        map.is_some_and(|map| map.get(name).is_some_and(Dynamic::is_unit))
    };
    script.reads.iter().any(|word| !word.writable() && absent(word.name))
        || script.fields.iter().any(|it| field(it.record.name, it.word.name))
}

/// Everything that the script reads and that has no value, with the reason.
pub(super) fn why_absent<'a>(script: &'a Script, view: &'a View<'_>) -> impl Iterator<Item = String> {
    let fields = script.fields.iter().map(|field| field.word);
    let mut told: Vec<&str> = Vec::new();
    script.reads.iter().copied().chain(fields).filter_map(move |word| {
        let why = word.why_absent(view).filter(|_| !told.contains(&word.name))?;
        told.push(word.name);
        Some(format!("{} has no value ({why})", word.name))
    })
}
