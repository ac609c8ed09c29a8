//! Every route of the table, one after another: whatever changes something refuses whoever is not signed in or may not, what is
//! malformed, too long, too slow, and what is meant for another host.

use super::client::{Client, Testbed, testbed};
use gateway::access::Role;
use gateway::http::{Needs, Route, description, list_operations, list_routes};
use serde_json::Value;
use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Longer bodies are only announced: they do not fit into the buffers of a connection.
const SENT_WHOLE_MAX: usize = 1 << 20;
const JSON: &str = "Content-Type: application/json\r\n";

fn path(route: &Route) -> String {
    let parts = route.path().split('/').map(|part| if part.starts_with('{') { "x" } else { part });
    parts.collect::<Vec<_>>().join("/")
}

/// Does the description say that this route takes a body of JSON?
fn takes_json(document: &Value, route: &Route) -> bool {
    let operation = &document["paths"][route.path()][route.verb().word().to_ascii_lowercase()];
    operation["requestBody"]["content"]["application/json"].is_object()
}

#[test]
fn the_description_and_the_table_tell_the_same_routes() {
    let document: Value = serde_json::from_str(description()).expect("JSON");
    let in_document: BTreeSet<(String, String)> = list_operations(&document).into_iter().collect();
    let in_table: BTreeSet<(String, String)> =
        list_routes().map(|route| (route.verb().word().to_owned(), route.path().to_owned())).collect();
    assert_eq!(in_document, in_table);
    assert_eq!(in_table.len(), list_routes().count(), "no row stands twice");
    let open: Vec<&str> = list_routes()
        .filter(|it| it.changes_state() && !matches!(it.needs(), Needs::Role(_)))
        .map(Route::path)
        .collect();
    assert_eq!(
        open,
        ["/api/v1/login"],
        "nobody can be signed in to sign in; everything else that changes something needs a role"
    );
    for (references, schemas) in [(description(), &document["components"]["schemas"])] {
        let names = references.split("#/components/schemas/").skip(1);
        for name in names.map(|rest| rest.split('"').next().unwrap_or_default()) {
            assert!(schemas[name].is_object(), "no schema {name}");
        }
    }
    for route in list_routes().filter(|route| route.changes_state()) {
        let operation = &document["paths"][route.path()][route.verb().word().to_ascii_lowercase()];
        for code in ["400", "403", "408", "413", "421"] {
            assert!(operation["responses"][code].is_object(), "{}: {code} is not described", route.path());
        }
    }
}

#[test]
fn every_route_refuses_what_it_must() {
    let testbed = testbed("allow_arming = true\n");
    let document: Value = serde_json::from_str(description()).expect("JSON");
    let (nobody, admin) = (testbed.client(), testbed.admin());
    let mut viewer = testbed.client();
    assert_eq!(viewer.sign_in("Watch", &testbed.person("Watch", "viewer")).status, 200);
    for route in list_routes() {
        refuses(route, &document, [&nobody, &viewer, &admin]);
    }
    slow(&admin, &nobody);
    let before = admin.get("/api/v1/session").json();
    assert_eq!(before["person"]["name"], "admin", "nothing of this has signed anybody out: {before}");
    walked(testbed);
}

fn refuses(route: &Route, document: &Value, [nobody, viewer, admin]: [&Client; 3]) {
    let (verb, path) = (route.verb().word(), path(route));
    let told = |what: &str, answer: &testkit::process::Answer, wanted: u16| {
        assert_eq!(answer.status, wanted, "{verb} {path}, {what}: {}\n{}", answer.head, answer.body);
        assert!(answer.json()["hint"].is_string() && answer.json()["title"].is_string(), "{path}: {}", answer.body);
        assert!(answer.head.contains("content-security-policy: default-src 'none'"), "{path}: {}", answer.head);
    };
    told("for another host", &admin.send(verb, &path, "Host: evil.example\r\n", ""), 421);
    told("another method", &admin.send("PATCH", &path, JSON, "{}"), 405);
    if !route.changes_state() {
        return;
    }
    let at_length = |client: &Client| match route.body_max() {
        most if most > SENT_WHOLE_MAX => client.announce(verb, &path, JSON, most + 1),
        most => client.send(verb, &path, JSON, &"x".repeat(most + 1)),
    };
    match route.needs() {
        Needs::Role(role) => {
            told("by nobody", &nobody.send(verb, &path, JSON, "{}"), 401);
            told("by nobody, at length", &at_length(nobody), 401);
            if role > Role::Viewer {
                told("by a viewer", &viewer.send(verb, &path, JSON, "{}"), 403);
            }
        }
        Needs::Nothing | Needs::Reading => {}
    }
    let foreign = format!("{JSON}Origin: https://evil.example\r\n");
    told("from another site", &admin.send(verb, &path, &foreign, "{}"), 403);
    told("from another site", &admin.send(verb, &path, "Sec-Fetch-Site: cross-site\r\n", ""), 403);
    told("too long", &at_length(admin), 413);
    // The machine is given back whatever the body holds.
    if takes_json(document, route) && path != "/api/v1/disarm" {
        for malformed in ["", "{", "[]", "{\"no_such_key\":1}", "\u{0}", "null"] {
            told("malformed", &admin.send(verb, &path, JSON, malformed), 400);
        }
        told("of another kind", &admin.send(verb, &path, "Content-Type: text/plain\r\n", "{}"), 415);
    }
}

/// A body that never comes, a head that never ends: told so within about ten seconds, and closed. All at the same time.
fn slow(admin: &Client, nobody: &Client) {
    let began = Instant::now();
    let mut waiting: Vec<(String, TcpStream)> = Vec::new();
    for route in list_routes().filter(|route| route.changes_state() && route.body_max() > 0) {
        let (verb, path, host, cookie) = (route.verb().word(), path(route), &admin.address, &admin.cookie);
        let head =
            format!("{verb} {path} HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\n{JSON}Content-Length: 20\r\n\r\n{{");
        waiting.push((format!("{verb} {path}"), begun(&admin.address, &head)));
    }
    for head in ["GET / HTTP/1.1\r\nHost: x", "POST /api/v1/login HTTP/1.1\r\n", "G"] {
        waiting.push((head.to_owned(), begun(&nobody.address, head)));
    }
    for (what, mut stream) in waiting {
        let mut answer = String::new();
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a limit");
        stream.read_to_string(&mut answer).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert!(answer.starts_with("HTTP/1.1 408"), "{what}: {answer}");
        assert!(answer.contains("not complete within 10 s"), "{what}: {answer}");
    }
    let took = began.elapsed();
    assert!(took > Duration::from_secs(9) && took < Duration::from_secs(16), "{took:?}");
}

fn begun(address: &str, text: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).expect("it listens");
    stream.write_all(text.as_bytes()).expect("sent");
    stream
}

/// What was refused stands in the audit, and no more of it than is of use.
fn walked(mut testbed: Testbed) {
    testbed.gateway.signal("TERM");
    assert!(testbed.gateway.wait().success(), "{}", testbed.gateway.said());
    let audit = testbed.audit();
    let refused = super::client::rows(&audit, "request_refused", "refused", "");
    let changes = list_routes().filter(|route| route.changes_state()).count();
    assert!(refused >= changes.min(50), "{refused} refusals of {changes} routes");
    assert!(refused <= 180, "{refused} refusals have a row of their own");
    assert!(super::client::rows(&audit, "request_refused", "refused", "evil.example") > 0);
    assert!(super::client::rows(&audit, "change", "refused", "(400)") > 0);
    assert!(super::client::rows(&audit, "persons", "added", "Watch is viewer") == 1, "{audit:?}");
}
