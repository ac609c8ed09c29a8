//! pyfanuc, an independent client, against our server. `CNC_GATEWAY_PYFANUC` names its file.

use crate::fanuc::interop::{machine, partner, python};
use crate::fanuc::support::serve;
use adapters::fanuc_server::ServerSettings;
use serde_json::{Value, json};

#[test]
fn interop_pyfanuc_reads_every_value_from_our_server() {
    let Some(file) = partner("CNC_GATEWAY_PYFANUC") else { return };
    for version in [4, 2] {
        let server = serve(machine(version), ServerSettings::default());
        let port = server.address().port().to_string();
        let found = python("pyfanuc_client.py", &[&file.display().to_string(), "127.0.0.1", &port], &Value::Null);
        let expected = pyfanuc_values(version);
        let rows = expected.as_object().expect("an object");
        let wrong: Vec<String> = rows
            .iter()
            .filter(|(name, value)| found[name.as_str()] != **value)
            .map(|(name, value)| format!("{name}: expected {value}, found {}", found[name.as_str()]))
            .collect();
        assert!(wrong.is_empty(), "generation {version}:\n{}", wrong.join("\n"));
        println!("generation {version}: {} readings of pyfanuc", rows.len());
    }
}

/// What pyfanuc must read, by hand.
fn pyfanuc_values(version: u16) -> Value {
    let mut values = json!({
        "statinfo": [1, 3, 1, 0, 0, 0, 0],
        "date": [2026, 11, 24],
        "time": [21, 5, 9],
        "datetime": [2026, 11, 24, 21, 5, 9],
        "axes": {"ABS": [123.456, -98.765, 10.5], "REL": [1.0, 2.0, -3.0], "REF": [223.456, -198.765, -10.5], "DIST": [0.5, 0.0, -0.25]},
        "figures": {"count": 3, "decinput": 3},
        "macro": {"501": null, "502": -3.25},
        "pmc": {"12": 155},
        "executed": "N120 G01 X10.5 F1200\nN130 Z-2.\nM30\n%",
        "prognum": {"run": 1234, "main": 1000},
        "progname": "//CNC_MEM/USER/PATH1/O1234",
        "alarm": 72,
        "alarms": [[100, 3, 0, "PARAMETER ENABLE SWITCH ON"], [417, 6, 2, "SERVO ALARM"]],
        "programs": {"1000": [2048, "MAIN"], "1234": [512, "POCKET"]},
        "feed": 1200.0,
        "spindle": 8000.0,
    });
    let more = if version == 2 {
        json!({"param": {"6711": 456}, "diagnosis": {"308": 41}})
    } else {
        json!({
            "folder": "//CNC_MEM/USER/PATH1/",
            "folder_counts": {"dirs": 0, "files": 2},
            "files": [["O1000", 2048, "MAIN"], ["O1234", 512, "POCKET"]],
        })
    };
    let (Some(values_of), Value::Object(more)) = (values.as_object_mut(), more) else { unreachable!("objects") };
    values_of.extend(more);
    values
}
