//! Persons, tokens, sessions, and what they may do: as a user does it, and as it stands in the audit.

use super::client::{rows, started, testbed};
use serde_json::{Value, json};
use std::os::unix::fs::PermissionsExt;
use std::time::{Duration, Instant};
use testkit::process::wait_for;

#[test]
fn a_token_signs_in_and_persons_come_and_go() {
    let mut testbed = testbed("session_s = 12.0\n");
    let file = testbed.directory.path().join("data/persons.json");
    let kept = std::fs::read_to_string(&file).expect("persons");
    assert!(kept.contains("sha256$") && !kept.contains(&testbed.token), "{kept}");
    assert_eq!(std::fs::metadata(&file).expect("there").permissions().mode() & 0o777, 0o600);
    let mut admin = testbed.client();
    assert_eq!(admin.get("/api/v1/session").json()["person"], Value::Null);
    let answer = admin.sign_in("admin", &testbed.token.to_uppercase().replace('-', " "));
    let session = answer.json();
    assert_eq!((answer.status, &session["person"]["role"]), (200, &json!("admin")), "{}", answer.body);
    assert_eq!(session["may"], json!({ "edit": true, "arm": false, "disarm": true, "manage": true }));
    let set = answer.head.lines().find(|line| line.starts_with("set-cookie")).expect("a cookie").to_owned();
    assert!(set.contains("HttpOnly") && set.contains("SameSite=Strict") && set.contains("Max-Age=12"), "{set}");
    // A person made on the page, one made at the box.
    let made = admin.json("POST", "/api/v1/persons", &json!({ "name": "李伟", "role": "setter" }));
    assert_eq!(made.status, 201, "{}", made.body);
    let token = made.json()["token"].as_str().expect("a token").to_owned();
    assert_eq!(admin.json("POST", "/api/v1/persons", &json!({ "name": "李伟", "role": "viewer" })).status, 409);
    assert_eq!(admin.json("PUT", "/api/v1/persons/admin", &json!({ "role": "viewer" })).status, 409, "the last one");
    let mut li = testbed.client();
    assert_eq!(li.sign_in("李伟", &token).status, 200);
    assert_eq!(li.get("/api/v1/persons").status, 403);
    // A new token ends the session, and so does time.
    let (code, said) = testbed.command(&["person", "token", "李伟", "--by", "foreman"]);
    assert_eq!(code, Some(0), "{said}");
    wait_for("the end of the session", Duration::from_secs(5), || {
        (li.get("/api/v1/session").json()["person"].is_null()).then_some(())
    });
    wait_for("the end of time", Duration::from_secs(20), || {
        (admin.get("/api/v1/session").json()["person"].is_null()).then_some(())
    });
    assert_eq!(admin.json("POST", "/api/v1/persons", &json!({ "name": "late", "role": "admin" })).status, 401);
    assert_eq!(li.sign_in("李伟", &token).status, 401, "the old token is worth nothing");
    // A request that brings name and token itself.
    let bearer = format!("Authorization: Bearer admin:{}\r\n", testbed.token);
    assert_eq!(testbed.client().send("GET", "/api/v1/persons", &bearer, "").status, 200);
    let removed = testbed.client().send("DELETE", "/api/v1/persons/%E6%9D%8E%E4%BC%9F", &bearer, "");
    assert_eq!(removed.status, 200, "{}", removed.body);
    testbed.gateway.signal("TERM");
    assert!(testbed.gateway.wait().success());
    let (mut again, _) = started(&testbed.config);
    again.wait_said("live page");
    assert!(!again.stop().contains("with the token"), "nobody is made where there is somebody");
    let audit = testbed.audit();
    for (kind, outcome, about, count) in [
        ("persons", "known", "admin: admin", 2),
        ("login", "done", "admin from 127.0.0.1", 1),
        ("login", "done", "setter from 127.0.0.1", 1),
        ("login", "refused", "wrong name or token", 1),
        ("persons", "added", "李伟 is setter", 1),
        ("persons", "token", "李伟 has a new token", 1),
        ("persons", "removed", "李伟", 1),
        ("change", "done", "POST /api/v1/persons (201): 李伟 is setter", 1),
        ("change", "refused", "(409)", 2),
    ] {
        assert_eq!(rows(&audit, kind, outcome, about), count, "{kind} {outcome} {about}: {audit:#?}");
    }
    assert!(
        audit.iter().any(|row| row["kind"] == "persons" && row["outcome"] == "token" && row["person"] == "foreman")
    );
    assert!(!serde_json::to_string(&audit).expect("text").contains(&testbed.token), "no token stands in the audit");
}

#[test]
fn five_wrong_tokens_and_the_sixth_is_not_even_tried() {
    let testbed = testbed("");
    let mut client = testbed.client();
    let codes: Vec<u16> = (0..6).map(|_| client.sign_in("admin", "aaaa-bbbb").status).collect();
    assert_eq!(codes, [401, 401, 401, 401, 429, 429]);
    let right = client.sign_in("admin", &testbed.token);
    assert_eq!(right.status, 429, "the right one comes too late: {}", right.body);
    assert!(
        right.head.contains("retry-after: ") && right.json()["retry_after_s"].as_u64() > Some(800),
        "{}",
        right.head
    );
    let (code, said) = testbed.command(&["disarm", "--by", "foreman"]);
    assert_eq!(code, Some(0), "orders at the box go on: {said}");
    // Giving the machine back is never locked out: with the token in the head, in the body, or in the form that is shown.
    let form = "Content-Type: application/x-www-form-urlencoded\r\nAccept: text/html\r\n";
    let refused = client.send("POST", "/api/v1/login", form, "name=admin&token=aaaa");
    assert!(refused.status == 429 && refused.body.contains("action=\"/api/v1/disarm\""), "{}", refused.body);
    for (wrong, code) in [
        (json!({ "name": "admin", "token": "aaaa" }), 429),
        (json!({ "name": "admin", "token": "" }), 429),
        (json!({}), 401),
    ] {
        assert_eq!(testbed.client().json("POST", "/api/v1/disarm", &wrong).status, code, "{wrong}");
    }
    let bearer = format!("Authorization: Bearer admin:{}\r\n", testbed.token);
    let began = Instant::now();
    let given = testbed.client().send("POST", "/api/v1/disarm", &bearer, "");
    println!("disarm while locked out: {:?}", began.elapsed());
    assert_eq!(given.status, 200, "{}", given.body);
    for _ in 0..5 {
        client.sign_in("admin", "aaaa-bbbb");
    }
    let named = json!({ "name": "admin", "token": testbed.token });
    assert_eq!(testbed.client().json("POST", "/api/v1/disarm", &named).status, 200, "locked out again, by JSON");
    for _ in 0..5 {
        client.sign_in("admin", "aaaa-bbbb");
    }
    let body = format!("name=admin&token={}", testbed.token);
    assert_eq!(testbed.client().send("POST", "/api/v1/disarm", form, &body).status, 303, "by the form");
    assert_eq!(testbed.client().get("/api/v1/status").status, 200, "and so does reading");
    testbed.gateway.stop();
}

#[test]
fn arming_from_the_page_needs_leave_and_the_token_once_more() {
    let testbed = testbed("allow_arming = true\n");
    let token = testbed.person("Wang", "armer");
    let (mut wang, mut watch) = (testbed.client(), testbed.client());
    assert_eq!(watch.sign_in("Watch", &testbed.person("Watch", "viewer")).status, 200);
    assert_eq!(wang.sign_in("Wang", &token).status, 200);
    wait_for("a decision", Duration::from_secs(60), || {
        (wang.get("/api/v1/status").json()["gate"]["permitted_pct"].is_number()).then_some(())
    });
    let arm = |token: &str| wang.json("POST", "/api/v1/arm", &json!({ "token": token, "for_s": 600 }));
    assert_eq!(wang.json("POST", "/api/v1/arm", &json!({})).status, 400, "no token");
    assert_eq!(arm("aaaa").status, 401, "a wrong token");
    assert_eq!(wang.json("POST", "/api/v1/arm", &json!({ "token": token, "for_s": 1e9 })).status, 409, "too long");
    let armed = arm(&token);
    assert!(armed.status == 200 && armed.body.contains("armed by Wang (from 127.0.0.1) for 600 s"), "{}", armed.body);
    let (mut latencies, status) = (Vec::new(), || watch.get("/api/v1/status").json());
    for _ in 0..10 {
        wait_for("armed", Duration::from_secs(10), || status()["gate"]["armed_by"].is_string().then_some(()));
        let began = Instant::now();
        let disarmed = watch.json("POST", "/api/v1/disarm", &json!({}));
        latencies.push(began.elapsed());
        assert_eq!(disarmed.status, 200, "a viewer gives the machine back: {}", disarmed.body);
        wait_for("disarmed", Duration::from_secs(10), || status()["gate"]["armed_by"].is_null().then_some(()));
        assert_eq!(arm(&token).status, 200);
    }
    latencies.sort_unstable();
    println!("disarm from the page, n = 10: median {:?}, greatest {:?}", latencies[5], latencies[9]);
    assert!(latencies[5] < Duration::from_millis(100), "{latencies:?}");
    assert_eq!(wang.json("POST", "/api/v1/alarms/acknowledge", &json!({ "code": "none" })).status, 409);
    assert_eq!(wang.json("POST", "/api/v1/alarms/acknowledge", &json!({})).status, 200);
    let mut testbed = testbed;
    testbed.gateway.signal("TERM");
    assert!(testbed.gateway.wait().success());
    let audit = testbed.audit();
    assert_eq!(rows(&audit, "armed", "armed", "600 s"), 11);
    assert_eq!(rows(&audit, "armed", "refused", "wrong name or token"), 1);
    assert_eq!(rows(&audit, "disarmed", "person", ""), 10);
    assert!(
        audit.iter().any(|row| row["kind"] == "disarmed" && row["person"] == "Watch (from 127.0.0.1)"),
        "{audit:#?}"
    );
}

#[test]
fn without_leave_the_gate_is_armed_at_the_box_only() {
    let testbed = testbed("");
    let admin = testbed.admin();
    let refused = admin.json("POST", "/api/v1/arm", &json!({ "token": testbed.token }));
    assert!(refused.status == 403 && refused.body.contains("allow_arming"), "{}", refused.body);
    assert_eq!(admin.get("/api/v1/session").json()["arming_allowed"], false);
    assert_eq!(testbed.command(&["arm", "--by", "fitter"]).0, Some(0));
    testbed.gateway.stop();
}

#[test]
fn a_browser_without_scripts_reads_signs_in_and_gives_the_machine_back() {
    let testbed = testbed("");
    let mut client = testbed.client();
    let read = |client: &super::client::Client, path: &str| client.send("GET", path, "Accept: text/html\r\n", "");
    wait_for("the machine", Duration::from_secs(20), || {
        read(&client, "/plain").body.contains("class=\"state\"").then_some(())
    });
    let page = read(&client, "/plain?lang=zh");
    assert!(page.body.contains("lang=\"zh-CN\"") && page.body.contains("主轴"), "{}", page.body);
    assert!(!page.body.contains("<script") && !page.body.contains("style=\""), "{}", page.body);
    assert!(read(&client, "/sign-in").body.contains("name=\"token\""));
    let form = "Content-Type: application/x-www-form-urlencoded\r\nAccept: text/html\r\n";
    let wrong = client.send("POST", "/api/v1/login", form, "name=admin&token=x&next=//evil.example");
    assert!(wrong.status == 401 && wrong.body.contains("wrong") && !wrong.body.contains("evil"), "{}", wrong.body);
    let body = format!("name=admin&token={}&next=/plain", testbed.token);
    let signed = client.send("POST", "/api/v1/login", form, &body);
    assert!(signed.status == 303 && signed.head.contains("location: /plain"), "{}", signed.head);
    let set = signed.head.lines().find_map(|line| line.strip_prefix("set-cookie: ")).expect("a cookie");
    client.cookie = set.split(';').next().expect("a pair").to_owned();
    assert!(read(&client, "/plain").body.contains("admin (admin)"));
    assert_eq!(testbed.command(&["arm", "--by", "fitter"]).0, Some(0));
    wait_for("the button", Duration::from_secs(10), || {
        read(&client, "/plain").body.contains("Back to the dial").then_some(())
    });
    let back = client.send("POST", "/api/v1/disarm", form, "");
    assert_eq!(back.status, 303, "{}", back.body);
    wait_for("given back", Duration::from_secs(10), || {
        client.get("/api/v1/status").json()["gate"]["armed_by"].is_null().then_some(())
    });
    testbed.gateway.stop();
}
