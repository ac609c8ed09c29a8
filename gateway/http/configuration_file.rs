//! The configuration as a text to be edited on the page: read with its digest, checked as `check` does, put back whole when
//! all of it is right, and the box started anew, where a service manager starts it again.
//!
//! A new source is tried before it is written: [`serve_address_findings`] opens any address that an administrator names.
//!
//! What decides whether the box may write to the machine is changed at the box only, not from the page ([`find_widened`]): the gate, the
//! right to arm from the page, what sinks may ask for, and the parts of an address that name a way of writing, a library to load, or a
//! file whose content is sent as a password: who may edit the page may not read every file of the box.

use super::ServerState;
use super::blocking::run_blocking;
use super::check_child::{check_saved_file, check_text as check_text_in_child};
use super::guard::with_audit_note;
use super::person::{JsonBody, SignedIn};
use super::problem::ApiProblem;
use super::route::Route;
use axum::Json;
use axum::extract::State;
use axum::response::Response;
use axum::routing::{get, post, put};
use gateway_access::Role;
use gateway_base::files::{advise_on_read_error, read_text, replace_durably};
use gateway_config::{self as config, Config, Problem};
use gateway_scripts::drafts::digest_of;
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A configuration of twenty sources has some ten kilobytes.
const TEXT_MAX: usize = 256 << 10;

pub(super) const ROUTES: &[Route] = &[
    Route::read_by(Role::Admin, "/api/v1/configuration/file", || get(read_file)),
    Route::post(Role::Admin, "/api/v1/configuration/check", 2 * TEXT_MAX, || post(check_text)),
    Route::put(Role::Admin, "/api/v1/configuration/file", 2 * TEXT_MAX, || put(replace_file)),
    Route::post(Role::Admin, "/api/v1/restart", 64, || post(restart_box)),
    Route::post(Role::Admin, "/api/v1/doctor/address", 4096, || post(serve_address_findings)),
];

/// A text to be checked.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ConfigurationText {
    text: String,
}

/// Another text, and the digest of the one that was edited.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct EditedConfiguration {
    text: String,
    digest: String,
}

/// An address to be tried.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct AddressQuery {
    address: String,
}

fn file_path(shared: &ServerState) -> Result<PathBuf, ApiProblem> {
    let none = || {
        let hint = "cnc-gateway setup --out cnc-gateway.toml writes one; start the box with --config cnc-gateway.toml";
        ApiProblem::conflict("this box runs the built-in configuration, which stands in no file", hint)
    };
    shared.configured.file.clone().ok_or_else(none)
}

fn read_limited(path: &Path) -> Result<String, ApiProblem> {
    read_text(path, TEXT_MAX)
        .map_err(|error| ApiProblem::unavailable(format!("{}: {error}", path.display()), advise_on_read_error(&error)))
}

/// The configuration of a text, or everything that `check` would refuse.
fn parse_text(path: &Path, text: &str) -> Result<Config, Vec<Problem>> {
    let base = path.parent().unwrap_or(Path::new(""));
    config::parse(&path.display().to_string(), text, base, [])
}

/// Everything that `check` finds in the text and in what it names.
fn find_problems(path: &Path, text: &str) -> Vec<Problem> {
    parse_text(path, text).err().unwrap_or_else(|| check_text_in_child(path, text))
}

/// Parts of an address that open a way to write, or name a file to load into a process or to send to a receiver.
const PARTS_AT_THE_BOX: [&str; 6] = ["write=", "allow=", "offset=", "library=", "password_file=", "token_file="];

fn needs_the_box(address: &str) -> Option<&'static str> {
    PARTS_AT_THE_BOX.into_iter().find(|part| address.contains(part))
}

/// What the new configuration allows beyond the one in force and nobody may allow from afar; empty when nothing.
fn find_widened(before: &Config, after: &Config) -> Vec<String> {
    let mut widened = Vec::new();
    if after.gate != before.gate {
        widened.push("[gate] is changed".to_owned());
    }
    if after.http.allow_arming && !before.http.allow_arming {
        widened.push("allow_arming under [http] is set".to_owned());
    }
    for sink in after.sinks.iter().filter(|sink| sink.allow_requests) {
        let had = |it: &&config::SinkConfig| it.allow_requests && it.address == sink.address;
        if !before.sinks.iter().any(|it| had(&it)) {
            widened.push(format!("allow_requests of sink {} is set", sink.name));
        }
    }
    let known: Vec<&str> = addresses_of(before).map(|(_, _, address)| address).collect();
    for (kind, name, address) in addresses_of(after) {
        if let Some(part) = needs_the_box(address).filter(|_| !known.contains(&address)) {
            widened.push(format!("the address of {kind} {name} has {part}"));
        }
    }
    widened
}

/// What the box connects to: "source" or "sink", its name, its address.
fn addresses_of(config: &Config) -> impl Iterator<Item = (&'static str, &str, &str)> {
    let sources = config.sources.iter().map(|it| ("source", it.name.as_str(), it.address.text()));
    sources.chain(config.sinks.iter().map(|it| ("sink", it.name.as_str(), it.address.text())))
}

fn problems_json(problems: &[Problem]) -> Value {
    let rows = problems.iter().map(
        |problem| json!({ "line": problem.line, "column": problem.column, "what": problem.what, "next": problem.next }),
    );
    Value::Array(rows.collect())
}

fn refuse_widened(before: &Config, path: &Path, after: &Config) -> Result<(), ApiProblem> {
    let widened = find_widened(before, after);
    match widened.is_empty() {
        true => Ok(()),
        false => {
            let hint = format!(
                "what may write to the machine, and which files are loaded or sent, is changed at the box: edit {} there",
                path.display()
            );
            Err(ApiProblem::bad_request(widened.join("; "), hint))
        }
    }
}

/// Does somebody start this process again when it ends?
fn is_started_by_service_manager() -> bool {
    std::env::var_os("INVOCATION_ID").is_some() || std::env::var_os("NOTIFY_SOCKET").is_some()
}

/// `GET /api/v1/configuration/file`: text and digest of the file, with what is wrong in it.
async fn read_file(State(shared): State<ServerState>) -> Result<Json<Value>, ApiProblem> {
    run_blocking(move || {
        let path = file_path(&shared)?;
        let text = read_limited(&path)?;
        let problems = problems_json(&parse_text(&path, &text).err().unwrap_or_else(|| check_saved_file(&path)));
        Ok(Json(json!({ "schema": "configuration-file/1", "path": path.display().to_string(), "text": text,
            "digest": digest_of(&text), "problems": problems, "restarts": is_started_by_service_manager() })))
    })
    .await
}

/// `POST /api/v1/configuration/check`: what is wrong with a text that is not saved.
async fn check_text(
    State(shared): State<ServerState>,
    JsonBody(asked): JsonBody<ConfigurationText>,
) -> Result<Json<Value>, ApiProblem> {
    run_blocking(move || {
        let problems = find_problems(&file_path(&shared)?, &asked.text);
        Ok(Json(json!({ "schema": "check/1", "fine": problems.is_empty(), "problems": problems_json(&problems) })))
    })
    .await
}

/// `PUT /api/v1/configuration/file`: what was there before is kept beside it.
async fn replace_file(
    State(shared): State<ServerState>,
    SignedIn(person): SignedIn,
    JsonBody(edited): JsonBody<EditedConfiguration>,
) -> Result<Response, ApiProblem> {
    let done = run_blocking(move || {
        let path = file_path(&shared)?;
        let now = read_limited(&path)?;
        if digest_of(&now) != edited.digest {
            let hint =
                "nothing of yours was stored and nothing of theirs is lost: load it again, then make your change";
            return Err(ApiProblem::conflict("somebody else has changed the configuration meanwhile", hint));
        }
        let after = parse_text(&path, &edited.text).map_err(|problems| {
            let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
            ApiProblem::bad_request(lines.join("\n"), "mend it; the configuration in force stays")
        })?;
        refuse_widened(&shared.configured.config, &path, &after)?;
        let write = |path: &Path, text: &str| {
            replace_durably(path, text).map_err(|error| {
                ApiProblem::unavailable(format!("{}: {error}", path.display()), advise_on_read_error(&error))
            })
        };
        write(&path.with_extension("before.toml"), &now)?;
        write(&path, &edited.text)?;
        Ok(format!("{} was written by {}; it is in force after the next start", path.display(), person.name))
    });
    let done = done.await?;
    Ok(with_audit_note(Json(json!({ "schema": "order/1", "done": true, "text": done })), done))
}

/// `POST /api/v1/restart`: ends as a SIGTERM does, where somebody starts the box again.
async fn restart_box(SignedIn(person): SignedIn) -> Result<Response, ApiProblem> {
    if !is_started_by_service_manager() {
        let hint = "start it again at the box, where it was started";
        return Err(ApiProblem::conflict("no service manager has started this box; it would not come back", hint));
    }
    let own = rustix::process::getpid();
    rustix::process::kill_process(own, rustix::process::Signal::TERM)
        .map_err(|error| ApiProblem::unavailable(format!("the box cannot be stopped: {error}"), "systemctl restart"))?;
    let text = format!("{} starts the box anew; arming has ended", person.name);
    Ok(with_audit_note(Json(json!({ "schema": "order/1", "done": true, "text": text })), text))
}

/// `POST /api/v1/doctor/address`: what `doctor ADDRESS` finds.
async fn serve_address_findings(
    State(shared): State<ServerState>,
    JsonBody(asked): JsonBody<AddressQuery>,
) -> Result<Response, ApiProblem> {
    if let Some(part) = needs_the_box(&asked.address) {
        let what = format!("an address with {part} is not opened from the page");
        return Err(ApiProblem::bad_request(what, "cnc-gateway doctor ADDRESS at the box"));
    }
    let busy = || ApiProblem::conflict("a source is being looked at already", "wait a few seconds");
    let place = shared.doctor.clone().try_acquire_owned().map_err(|_| busy())?;
    let report = run_blocking(move || {
        let _place = place;
        gateway_sources::doctor::examine_text(&asked.address)
            .map_err(|error| ApiProblem::bad_request(error.to_string(), "look at the address"))
    });
    let report = report.await?;
    let mut document = report.to_json();
    document["schema"] = json!("doctor/1");
    document["address"] = json!(adapters::address::mask_secrets(&report.address));
    Ok(with_audit_note(Json(document), "looked at an address that is not configured".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Config {
        config::parse("test", text, Path::new(""), []).expect("a configuration")
    }

    #[test]
    fn what_may_write_is_not_widened_from_the_page() {
        let plain = "[[source]]\naddress = \"fanuc://10.0.0.5\"\nname = \"control\"\n";
        let before = parsed(plain);
        let harmless = format!("{plain}\n[[source]]\naddress = \"modbus-tcp://10.0.0.6?profile=sdm630\"\n");
        assert!(find_widened(&before, &parsed(&harmless)).is_empty());
        let armed = format!("{plain}[gate]\nmin_pct = 20.0\n");
        let arming = format!("{plain}[http]\nallow_arming = true\n");
        let library =
            "[[source]]\naddress = \"fanuc://10.0.0.5?backend=vendor&library=/tmp/a.so\"\nname = \"control\"\n";
        let reading = format!(
            "{plain}[[sink]]\nname = \"own\"\naddress = \"mqtts://a.example/p?user=u&password_file=/etc/shadow\"\n"
        );
        for text in [armed.as_str(), arming.as_str(), library, reading.as_str()] {
            assert_eq!(find_widened(&before, &parsed(text)).len(), 1, "{text}");
        }
        let own = parsed(library);
        assert!(find_widened(&own, &own).is_empty(), "what stands there stays");
    }
}
