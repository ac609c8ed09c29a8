//! `cnc-gateway check` as a user runs it: the real binary, real files, exit codes.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn check(directory: &Path, arguments: &[&str]) -> Output {
    check_with(directory, arguments, &[])
}

fn check_with(directory: &Path, arguments: &[&str], environment: &[(&str, &str)]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cnc-gateway"))
        .arg("check")
        .args(arguments)
        .current_dir(directory)
        .envs(environment.iter().copied())
        .output()
        .expect("it runs")
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A configuration with one mistake in everything it names.
fn furnish(directory: &Path) {
    let config = "[[source]]\naddress = \"replay:run.csv\"\n[[source]]\naddress = \"fanuc://10.0.0.5?backend=vendor&library=missing.so\"\n\
                  [gateway]\ndata_dir = \"data\"\n[operations]\npath = \"operations.toml\"\n[twin]\nmodel = \"model.toml\"\n";
    fs::write(directory.join("cnc-gateway.toml"), config).expect("written");
    fs::write(directory.join("run.csv"), "time_s,spindle_speed_rpm\n0,100\n1,fast\n2,300\n").expect("written");
    let model =
        "schema = \"model/1\"\nname = \"m\"\noutput = \"spindle_power_w\"\n[[effect]]\nkind = \"no_load_powr\"\n";
    fs::write(directory.join("model.toml"), model).expect("written");
    let recipe =
        "schema = \"operations/1\"\n[[operation]]\nprogram = \"O1\"\nname = \"rough\"\ndepth_of_cut_um = 1500\n";
    fs::write(directory.join("operations.toml"), recipe).expect("written");
    fs::create_dir_all(directory.join("data/scripts")).expect("created");
    fs::write(directory.join("data/scripts/mine.rhai"), "alarn(\"a\", \"b\");\n").expect("written");
}

#[test]
fn everything_that_is_wrong_is_told_at_once() {
    let directory = tempfile::tempdir().expect("a directory");
    furnish(directory.path());
    let output = check(directory.path(), &["--config", "cnc-gateway.toml"]);
    let text = text(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    for part in [
        "data/scripts/mine.rhai:1:1: there is no function `alarn`",
        "did you mean `alarm`?",
        "operations.toml:5:1: an operation has no `depth_of_cut_um`",
        "write depth_of_cut_mm = 1.5",
        "model.toml:5: ",
        "run.csv:3: ",
        "missing.so: the vendor library is not there",
        "5 problems",
    ] {
        assert!(text.contains(part), "{part}\n---\n{text}");
    }
}

#[test]
fn the_result_as_json_names_every_place() {
    let directory = tempfile::tempdir().expect("a directory");
    furnish(directory.path());
    let output = check(directory.path(), &["--config", "cnc-gateway.toml", "--json"]);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((output.status.code(), &json["fine"]), (Some(1), &serde_json::json!(false)));
    let problems = json["problems"].as_array().expect("a list");
    assert_eq!(problems.len(), 5);
    assert_eq!(problems[0]["line"], 1);
}

#[test]
fn exit_codes_tell_fine_wrong_and_could_not_run() {
    let directory = tempfile::tempdir().expect("a directory");
    assert_eq!(check(directory.path(), &[]).status.code(), Some(0), "the built-in configuration");
    let missing = check(directory.path(), &["--config", "nothing.toml"]);
    assert_eq!(missing.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&missing.stderr).contains("check --example"));
    let far = ("CNC_GATEWAY__HTTP__LISTEN", "0.0.0.0:8080");
    let open = text(&check_with(directory.path(), &[], &[far]));
    assert!(open.contains("needs TLS and tokens") && open.contains("tls = true"), "{open}");
    let safe = [far, ("CNC_GATEWAY__HTTP__TLS", "true"), ("CNC_GATEWAY__HTTP__TOKENS", "always")];
    let safe = text(&check_with(directory.path(), &[], &safe));
    assert!(safe.contains("over TLS, and asks everybody for a token"), "{safe}");
    let example = text(&check(directory.path(), &["--example"]));
    fs::write(directory.path().join("new.toml"), example).expect("written");
    let output = check(directory.path(), &["--config", "new.toml"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output));
    assert!(text(&output).contains("writes nothing") && text(&output).contains("nothing is wrong"));
}

#[test]
fn the_tables_are_printed() {
    let directory = tempfile::tempdir().expect("a directory");
    assert!(text(&check(directory.path(), &["--keys"])).contains("| `gateway.tick_hz` | 10.0 |"));
    assert!(text(&check(directory.path(), &["--vocabulary"])).contains("| `spindle_power_w` | W |"));
    assert!(text(&check(directory.path(), &["--vocabulary", "--lang", "zh"])).contains("主轴驱动功率"));
}

/// What the state follows from is told before a machine is involved, and nothing is armed without a known dial.
#[test]
fn the_basis_of_the_state_and_a_missing_dial_are_told() {
    let directory = tempfile::tempdir().expect("a directory");
    let told = |address: &str, gate: &str| {
        let config = format!("[[source]]\naddress = \"{address}\"\nname = \"cnc\"\n{gate}");
        fs::write(directory.path().join("cnc-gateway.toml"), config).expect("written");
        let output = check(directory.path(), &["--config", "cnc-gateway.toml"]);
        (output.status.code(), text(&output))
    };
    let armed = "[gate]\nmode = \"armed\"\nsource = \"cnc\"\n";
    let (code, said) = told("fanuc://10.0.0.5", "");
    assert!(code == Some(0) && said.contains("follows from the load meter of the spindle"), "{said}");
    let (code, said) = told("fanuc://10.0.0.5?power_diagnosis=4902", "");
    assert!(code == Some(0) && said.contains("follows from spindle power"), "{said}");
    let (code, said) = told("fanuc://10.0.0.5?write=mailbox", armed);
    assert!(code == Some(1) && said.contains("cnc-gateway.toml:2:") && said.contains("add dial=R907"), "{said}");
    let (code, said) = told("fanuc://10.0.0.5?write=mailbox&dial=R907", armed);
    assert_eq!(code, Some(0), "{said}");
}
