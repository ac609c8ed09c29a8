//! Every command line of a code block is run, as a reader would: one after the other, in one directory, with the real
//! program. What one command writes is there for the next.
//!
//! Addresses of a shop (a controller, a lake) become those of a served machine and of this directory. What runs until it is
//! stopped is stopped when it has said where it listens.

use crate::commands::{arguments, is_a_pattern, lines, words};
use crate::documents::{Document, documents};
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use testkit::process::{Gateway, program, stderr, stdout};

/// The documents in the order of somebody who begins: a history must be there before it is asked.
const ORDER: [&str; 10] = [
    "README.md",
    "gateway/handbook/start.md",
    "gateway/handbook/configuration.md",
    "gateway/handbook/history.md",
    "gateway/handbook/rules.md",
    "gateway/handbook/outputs.md",
    "gateway/handbook/sources.md",
    "gateway/handbook/contracts.md",
    "gateway/handbook/mismatch.md",
    "gateway/handbook/fleet.md",
];
/// Commands that end with another code than zero here, and why.
const OTHER_CODES: [(&str, i32, &str); 1] =
    [("commission --config", 1, "parts of the commissioning are still missing, which the code tells")];
/// Commands that are not run here, and where they are.
const ELSEWHERE: [(&str, &str); 6] = [
    ("fleet stream", "tests/records/fleet: needs a NATS server"),
    ("fleet ingest", "tests/records/fleet: needs NATS and PostgreSQL"),
    ("fleet retain", "tests/records/fleet: needs PostgreSQL"),
    ("setup", "tests/box/whole: writes where a service is configured"),
    ("update", "tests/box/whole: needs the folders of the package"),
    ("doctor --box", "gateway/sources/doctor/computer.rs: its answer is that of the computer"),
];
/// What a command that runs until it is stopped says when it serves; others name the address of their page.
const SERVES: [(&str, &str); 3] = [("fanuc", "fanuc://"), ("modbus", "modbus-tcp://"), ("machine", "modbus-tcp://")];

/// A command of a document.
struct Step {
    place: String,
    given: Vec<String>,
    /// The file into which its output is written.
    into: Option<String>,
}

fn steps(document: &Document) -> Vec<Step> {
    let of_block = lines(document).into_iter().filter(|line| !line.mentioned);
    let step = |line: crate::commands::Line| {
        let text = line.text.trim_start_matches("$ ").to_owned();
        let all = words(&text);
        let given = arguments(&all, "cnc-gateway").filter(|given| !given.is_empty() && !is_a_pattern(&text))?.to_vec();
        let into = text.split_once(" > ").and_then(|(_, file)| file.split_whitespace().next()).map(str::to_owned);
        Some(Step { place: format!("{}:{}: {text}", document.name, line.number), given, into })
    };
    of_block.filter_map(step).collect()
}

/// A served device: the process, the address of the shop in whose place it stands, and its own.
struct Served {
    _process: Gateway,
    of_the_shop: &'static str,
    own: String,
}

impl Served {
    fn start(arguments: &[&str], of_the_shop: &'static str) -> Self {
        let mut command = program();
        command.arg("serve").args(arguments).args(["--listen", "127.0.0.1:0"]);
        let (process, said) = serving(command, arguments[0]);
        let own = said.split_whitespace().find(|word| word.contains("://")).expect("its address").to_owned();
        Self { _process: process, of_the_shop, own }
    }
}

/// The program in this directory, with the addresses of the shop replaced.
fn command(directory: &Path, step: &Step, served: &[Served]) -> Command {
    let mut command = program();
    command.current_dir(directory).stdin(Stdio::null());
    for word in &step.given {
        let here = word.replace("/var/lib/cnc-gateway/", "./");
        let word = served.iter().fold(here, |word, served| word.replace(served.of_the_shop, &served.own));
        let listens = ["127.0.0.1:8193", "127.0.0.1:5020"].contains(&word.as_str());
        command.arg(if listens { "127.0.0.1:0".to_owned() } else { word });
    }
    if step.given[0] == "run" {
        command.args(["--listen", "127.0.0.1:0"]);
    }
    command
}

/// Does it run until it is stopped?
fn goes_on(step: &Step) -> bool {
    step.given[0] == "serve" || step.given[0] == "run" && !step.given.iter().any(|word| word == "--for")
}

/// Starts what goes on, and waits until it says where it serves; the line.
fn serving(command: Command, what: &str) -> (Gateway, String) {
    let mark = SERVES.iter().find(|(of, _)| *of == what).map_or("http://", |(_, mark)| mark);
    let mut process = Gateway::spawn(command);
    let said = process.wait_said(mark);
    (process, said)
}

fn tried(directory: &Path, step: &Step, served: &[Served]) -> Result<(), String> {
    let mut command = command(directory, step, served);
    if goes_on(step) {
        serving(command, step.given.get(1).map_or("", String::as_str));
        return Ok(());
    }
    let output = command.output().map_err(|error| error.to_string())?;
    if let Some(into) = &step.into {
        fs::write(directory.join(into), &output.stdout).map_err(|error| error.to_string())?;
    }
    let line = step.given.join(" ");
    let wanted = OTHER_CODES.iter().find(|(begin, ..)| line.starts_with(begin)).map_or(0, |(_, code, _)| *code);
    if output.status.code() == Some(wanted) {
        return Ok(());
    }
    Err(format!("{} instead of {wanted}: {}{}", output.status, stdout(&output), stderr(&output)))
}

/// What a reader has who comes with a model, recordings and own scripts.
fn brought(directory: &Path) {
    const MODEL: &str = "schema = \"model/1\"\noutput = \"force_n\"\n[[effect]]\nkind = \"linear\"\n\
                         columns = { acceleration_m_s2 = 90.0, velocity_m_s = 200.0, one = 0.0 }\n\
                         [roles]\nvelocity = \"velocity_m_s\"\nacceleration = \"acceleration_m_s2\"\n";
    let mut recording = String::from("time_s,run,velocity_m_s,acceleration_m_s2,force_n\n");
    for row in 0..1_200_u32 {
        let t = f64::from(row) * 0.01;
        let (velocity, acceleration) = (0.1 * (1.3 * t).sin(), 0.13 * (1.3 * t).cos());
        let noise = 2.0 * (f64::from(row) * 78.233).sin();
        let force = 95.0 * acceleration + 215.0 * velocity + 20.0 * (velocity / 0.001).tanh() + noise;
        recording.push_str(&format!("{t},{},{velocity},{acceleration},{force}\n", row / 150));
    }
    for (model, rows) in [("lathe.toml", "week.csv"), ("model.toml", "recording.csv")] {
        fs::write(directory.join(model), MODEL).expect("written");
        fs::write(directory.join(rows), &recording).expect("written");
    }
    fs::create_dir(directory.join("edited")).expect("a directory");
    let workbook = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/foreign/excel_de.xlsx");
    fs::copy(workbook, directory.join("week.xlsx")).expect("copied");
    // What a CAM system says of the same cuts: 20 s each, of which 14 s in the material.
    let mut series = String::from("time_s,Fc_power\n");
    for row in 0..640_u32 {
        let speed = [800.0, 1200.0, 1600.0, 2000.0][(row / 20 % 4) as usize];
        let power = if row % 20 >= 6 { 1.0 * speed } else { 0.0 };
        series.push_str(&format!("{row},{}\n", 120.0 + 0.25 * speed + power));
    }
    fs::write(directory.join("cam.csv"), series).expect("written");
}

#[test]
fn every_command_of_a_code_block_runs() {
    let directory = tempfile::tempdir().expect("a directory");
    brought(directory.path());
    let all = documents();
    let first = ORDER.iter().filter_map(|name| all.iter().find(|document| document.name == *name));
    let rest = all.iter().filter(|document| !ORDER.contains(&document.name.as_str()));
    let steps: Vec<Step> = first.chain(rest).flat_map(steps).collect();
    let served = [
        Served::start(&["fanuc", "--machine", "lathe"], "fanuc://192.168.1.10:8193"),
        Served::start(&["modbus"], "modbus-tcp://192.168.1.20:502?profile=sdm630"),
    ];
    let is_elsewhere = |step: &&Step| ELSEWHERE.iter().any(|(begin, _)| step.given.join(" ").starts_with(begin));
    let (left, here): (Vec<&Step>, Vec<&Step>) = steps.iter().partition(is_elsewhere);
    // A command may need a file that a later one of the same chapter writes: such a one is tried again at the end.
    let failed: Vec<&Step> =
        here.iter().copied().filter(|step| tried(directory.path(), step, &served).is_err()).collect();
    let again = failed.iter().filter_map(|step| {
        let error = tried(directory.path(), step, &served).err()?;
        Some(format!("{}\n    {error}", step.place))
    });
    let wrong: Vec<String> = again.collect();
    assert!(wrong.is_empty(), "these commands do not run:\n  {}", wrong.join("\n  "));
    assert!(here.len() > 35, "only {} commands were found", here.len());
    assert_eq!(left.len(), ELSEWHERE.len(), "what is run elsewhere stands in the list, and no more");
}
