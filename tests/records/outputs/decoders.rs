//! What one decoder of others reads of a Sparkplug payload, another one reads too.

use serde_json::Value as Json;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// The second decoder, where it is installed: what it reads of these messages.
fn read_by_tahu(heard: &[&Json]) -> Option<Vec<Json>> {
    let root = Command::new("npm").args(["root", "--global"]).output().ok()?;
    let modules = String::from_utf8_lossy(&root.stdout).trim().to_owned();
    if !Path::new(&modules).join("sparkplug-payload").is_dir() {
        assert!(std::env::var_os("CNC_GATEWAY_CI").is_none(), "sparkplug-payload is not installed");
        eprintln!("SKIPPED: sparkplug-payload is not installed (npm install --global sparkplug-payload@1.0.3)");
        return None;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/records/outputs/decode.js");
    let mut command = Command::new("node");
    command.arg(script).env("NODE_PATH", modules).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = command.spawn().expect("node runs");
    let payloads: Vec<&str> = heard.iter().map(|message| message["payload"].as_str().expect("digits")).collect();
    let mut input = child.stdin.take().expect("piped");
    let writer = std::thread::spawn({
        let text = payloads.join("\n");
        move || input.write_all(text.as_bytes())
    });
    let output = child.wait_with_output().expect("it ends");
    writer.join().expect("it writes").expect("it reads");
    assert!(output.status.success(), "it decodes every payload");
    let lines = String::from_utf8(output.stdout).expect("UTF-8");
    Some(lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect())
}

/// Both decoders read the same numbers, times, names, types, values and properties.
pub(crate) fn assert_both_read_the_same(heard: &[Json]) {
    let heard: Vec<&Json> = heard.iter().filter(|message| message["payload"].is_string()).collect();
    let Some(others) = read_by_tahu(&heard) else { return };
    assert_eq!(others.len(), heard.len());
    let (mut metrics, mut values) = (0, 0);
    for (message, other) in heard.iter().zip(&others) {
        for field in ["seq", "timestamp"] {
            assert_eq!(message[field], other[field], "{field} of {message}");
        }
        let (ours, theirs) =
            (message["metrics"].as_array().expect("metrics"), other["metrics"].as_array().expect("metrics"));
        assert_eq!(ours.len(), theirs.len(), "{message}");
        for (one, another) in ours.iter().zip(theirs) {
            for field in ["name", "alias", "timestamp"] {
                assert_eq!(one[field], another[field], "{field} of {one}");
            }
            for (name, value) in one["properties"].as_object().expect("properties") {
                let other = &another["properties"][name];
                // One library writes a whole number without a point.
                let equal = value == other || value.as_f64().is_some_and(|number| other.as_f64() == Some(number));
                assert!(equal, "{name} of {one}: {value}, {other}");
            }
            metrics += 1;
            if one["typed"] == true {
                assert_eq!(one["datatype"], another["type"], "{one}");
                assert!(equal(&one["value"], &another["value"]), "{one} is not {another}");
                values += 1;
            }
        }
    }
    println!(
        "two decoders: {} messages, {metrics} metrics, {values} values with their types are the same",
        heard.len()
    );
    assert!(values > 50, "{values}");
}

/// JavaScript has one kind of number.
fn equal(one: &Json, another: &Json) -> bool {
    one == another
        || matches!((one.as_f64(), another.as_f64()), (Some(one), Some(another)) if one.to_bits() == another.to_bits())
}
