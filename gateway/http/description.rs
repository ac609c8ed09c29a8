//! The description of the API (OpenAPI 3.1): written by hand for what a request and an answer hold, completed from the table of
//! routes for what stands before every route - who may ask, and how a request is refused.

use super::list_routes;
use super::route::{Needs, Route};
use serde_json::{Map, Value, json};
use std::sync::LazyLock;

/// The parts that are written by hand: paths and schemas, by subject.
const WRITTEN: [&str; 8] = [
    include_str!("openapi.json"),
    include_str!("openapi_access.json"),
    include_str!("openapi_page.json"),
    include_str!("openapi_maintenance.json"),
    include_str!("openapi_settings.json"),
    include_str!("openapi_configuration.json"),
    include_str!("openapi_files.json"),
    include_str!("openapi_facts.json"),
];

static DESCRIPTION: LazyLock<String> = LazyLock::new(|| build_document().to_string());

/// The whole document as text.
#[must_use]
pub fn description() -> &'static str {
    &DESCRIPTION
}

fn build_document() -> Value {
    let mut parts = WRITTEN.iter().map(|text| serde_json::from_str::<Value>(text).unwrap_or(Value::Null));
    let mut document = parts.next().unwrap_or(Value::Null);
    for part in parts {
        merge_objects(&mut document["paths"], &part["paths"]);
        merge_objects(&mut document["components"]["schemas"], &part["schemas"]);
    }
    document["components"]["securitySchemes"] = json!({
        "session": { "type": "apiKey", "in": "cookie", "name": "cnc_gateway",
                     "description": "Set by POST /api/v1/login; named __Host-cnc_gateway over TLS" },
        "token": { "type": "http", "scheme": "bearer", "description": "NAME:TOKEN" },
    });
    list_routes().for_each(|route| complete_operation(&mut document, route));
    document
}

/// Takes over the entries of another object, deeply where both have one.
fn merge_objects(into: &mut Value, from: &Value) {
    let (Some(into), Some(from)) = (into.as_object_mut(), from.as_object()) else { return };
    for (key, value) in from {
        match into.get_mut(key) {
            Some(known) if known.is_object() => merge_objects(known, value),
            _ => drop(into.insert(key.clone(), value.clone())),
        }
    }
}

/// What the guard of this route demands and how it refuses.
fn complete_operation(document: &mut Value, route: &Route) {
    let verb = route.verb().word().to_ascii_lowercase();
    let Some(operation) = document["paths"][route.path()].get_mut(verb.as_str()).filter(|it| it.is_object()) else {
        return;
    };
    let role = match route.needs() {
        Needs::Nothing => json!("none"),
        Needs::Reading => json!("viewer where tokens = \"always\", otherwise none"),
        Needs::Role(role) => json!(role),
    };
    operation["x-role"] = role;
    if matches!(route.needs(), Needs::Role(_)) {
        operation["security"] = json!([{ "session": [] }, { "token": [] }]);
    }
    for (code, why) in list_refusals(route) {
        let responses = operation["responses"].as_object_mut();
        let Some(responses) = responses.filter(|known| !known.contains_key(code)) else { continue };
        responses.insert(code.to_owned(), build_problem_response(why));
    }
    if route.changes_state() {
        operation["x-body-max-bytes"] = json!(route.body_max());
    }
}

/// The refusals that any request to this route may meet before its handler is asked.
fn list_refusals(route: &Route) -> Vec<(&'static str, &'static str)> {
    let mut refusals = vec![
        ("400", "The request cannot be understood"),
        ("421", "The request is meant for another host"),
        ("503", "The box cannot answer now"),
    ];
    if route.needs() != Needs::Nothing {
        refusals.extend([
            ("401", "Nobody is signed in"),
            ("403", "The role does not allow it"),
            ("429", "Too many wrong tokens"),
        ]);
    }
    if route.changes_state() {
        refusals.extend([
            ("403", "The request comes from another site"),
            ("408", "The request came too slowly"),
            ("413", "The body is too long"),
            ("415", "The body is of another kind"),
        ]);
    }
    refusals
}

fn build_problem_response(why: &str) -> Value {
    json!({
        "description": why,
        "content": { "application/problem+json": { "schema": { "$ref": "#/components/schemas/Problem" } } },
    })
}

/// The paths of the document with their methods, for whoever holds them against the table.
#[must_use]
pub fn list_operations(document: &Value) -> Vec<(String, String)> {
    let none = Map::new();
    let paths = document["paths"].as_object().unwrap_or(&none);
    let pairs = paths.iter().flat_map(|(path, item)| {
        item.as_object()
            .unwrap_or(&none)
            .keys()
            .map(move |verb| (verb.to_ascii_uppercase(), path.clone()))
            .collect::<Vec<_>>()
    });
    pairs.collect()
}
