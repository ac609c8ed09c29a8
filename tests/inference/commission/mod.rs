//! Commissioning of a machine whose coefficients are not the defaults, through the command line only: from an empty data directory
//! to a wear alarm. `simulate --machine` is the machine with a person at it; each thing that the person does by hand is counted.

mod thermal;

use adapters::address::{Address, Target};
use adapters::clock::{SECOND_NS, TimeNs};
use adapters::simulated::{Simulated, SimulatedSettings};
use serde_json::Value;
use std::path::Path;
use testkit::command::gateway;

/// Machines whose cuts and friction are other shares of the built-in machine's; each has a seed of its own.
const MACHINES: [&str; 5] = [
    "lathe?seed=7&change_h=0&change_cut_pct=120&change_friction_pct=112&dropouts_per_h=0",
    "lathe?seed=11&change_h=0&change_cut_pct=80&change_friction_pct=90&dropouts_per_h=0",
    "lathe?seed=12&change_h=0&change_cut_pct=100&change_friction_pct=130&dropouts_per_h=0",
    "lathe?seed=13&change_h=0&change_cut_pct=135&change_friction_pct=80&dropouts_per_h=0",
    "lathe?seed=14&change_h=0&change_cut_pct=110&change_friction_pct=100&dropouts_per_h=2",
];

/// Three more, chosen before the law over the speed was tried on them.
const MORE: [&str; 3] = [
    "lathe?seed=21&change_h=0&change_cut_pct=90&change_friction_pct=120&dropouts_per_h=0",
    "lathe?seed=22&change_h=0&change_cut_pct=125&change_friction_pct=95&dropouts_per_h=1",
    "lathe?seed=23&change_h=0&change_cut_pct=105&change_friction_pct=85&dropouts_per_h=0",
];

/// What the shop cuts, and what its gear stage allows.
const LEVELS: [&str; 8] = [
    "--cutting-speeds-m-min",
    "120,160,200",
    "--feeds-mm",
    "0.15,0.2,0.25",
    "--depths-mm",
    "0.5,1.4,2.3",
    "--diameter-mm",
    "80",
];

/// A person at a machine, and what was done by hand.
pub(crate) struct Person<'a> {
    pub(crate) directory: &'a Path,
    pub(crate) machine: &'static str,
    pub(crate) did: Vec<String>,
}

impl Person<'_> {
    fn does(&mut self, what: &str) {
        self.did.push(what.to_owned());
    }

    /// Runs the program; its standard output and error, where it ends as expected.
    pub(crate) fn runs(&self, arguments: &[&str], code: i32) -> (String, String) {
        let told = gateway(self.directory, arguments);
        let (out, error) =
            (String::from_utf8_lossy(&told.stdout).into_owned(), String::from_utf8_lossy(&told.stderr).into_owned());
        assert_eq!(told.status.code(), Some(code), "{arguments:?}\n{out}\n{error}");
        (out, error)
    }

    fn commission(&self, more: &[&str], code: i32) -> Value {
        let arguments = [&["commission", "--config", "box.toml", "--json"], more].concat();
        serde_json::from_str(&self.runs(&arguments, code).0).expect("JSON")
    }

    /// Makes a list: the machine carries it out while the box records it. Returns the flank wear before and after.
    fn makes(&mut self, list: &str, wear_mm: f64, torque: bool) -> (f64, f64) {
        self.does(&format!("makes the list {list}"));
        self.runs(&[&["commission", "--plan", list, "--out", "plan.csv"], &LEVELS[..]].concat(), 0);
        let machine = format!("{}&wear_mm={wear_mm}", self.machine);
        let mut arguments =
            vec!["simulate", "--machine", &machine, "--plan", "plan.csv", "--out", "step.csv", "--rate", "10"];
        if torque {
            arguments.extend(["--torque", "sensor.csv"]);
        }
        let (_, said) = self.runs(&arguments, 0);
        self.runs(&["run", "--config", "box.toml", "--speed", "max"], 0);
        let line = said.lines().find(|line| line.contains("microscope")).expect("a microscope");
        let numbers: Vec<f64> = line.split(' ').filter_map(|word| word.parse().ok()).collect();
        (numbers[0], numbers[1])
    }

    /// The three lists with three edges, each looked at before and after.
    fn wears(&mut self) {
        for (list, wear_mm) in [("wear-1", 0.02), ("wear-2", 0.14), ("wear-3", 0.29)] {
            self.does(&format!("puts in an edge with about {wear_mm} mm"));
            let began = self.commission(&[], 1)["to"].as_str().expect("a time").to_owned();
            let (before, after) = self.makes(list, wear_mm, false);
            for (value, at) in [(before, began.as_str()), (after, "now")] {
                self.does(&format!("reads {value} mm under the microscope and notes it"));
                let value = value.to_string();
                self.runs(
                    &[
                        "annotate",
                        "flank-wear",
                        &value,
                        "--unit",
                        "mm",
                        "--at",
                        at,
                        "--of",
                        list,
                        "--config",
                        "box.toml",
                    ],
                    0,
                );
            }
        }
    }
}

const CONFIGURATION: &str =
    "[gateway]\nname = \"Lathe 7\"\ndata_dir = \"data\"\n\n[http]\nenabled = false\n\n[[source]]\naddress = ";

fn part<'a>(told: &'a Value, name: &str) -> &'a Value {
    told["parts"].as_array().expect("parts").iter().find(|it| it["part"] == name).expect("there")
}

#[test]
fn a_new_machine_is_commissioned_from_nothing_to_a_wear_alarm() {
    let share = commissioned(MACHINES[0]);
    assert!((share - 1.0).abs() <= 0.1, "true wear at the alarm over the criterion: {share}");
}

/// Commissions each; so many must alarm within 10 % of the criterion.
fn within_a_tenth<const N: usize>(machines: [&'static str; N], least: usize) {
    let off = machines.map(commissioned);
    let near = off.iter().filter(|share| (**share - 1.0).abs() <= 0.1).count();
    println!("true wear at the alarm over the criterion: {off:.3?}, {near} of {N} within 10 %");
    assert!(near >= least, "fewer than measured: {off:?}");
}

/// `cargo test --test inference commission::five_machines -- --ignored --nocapture`
#[test]
#[ignore = "5 minutes: the same with five machines of other coefficients"]
fn five_machines_are_commissioned() {
    // Measured: 4 of 5. The aim is all of them (chapter `not-proven`).
    within_a_tenth(MACHINES, 4);
}

/// `cargo test --test inference commission::three_more -- --ignored --nocapture`
#[test]
#[ignore = "4 minutes: the same with three machines that the method was not made on"]
fn three_more_machines_are_commissioned() {
    within_a_tenth(MORE, 3);
}

/// From an empty data directory to the first wear alarm in production; true wear at the alarm over the criterion.
fn commissioned(machine: &'static str) -> f64 {
    let directory = tempfile::tempdir().expect("a directory");
    let mut person = Person { directory: directory.path(), machine, did: Vec::new() };
    person.does("writes a configuration of one source");
    std::fs::write(directory.path().join("box.toml"), format!("{CONFIGURATION}\"replay:step.csv?speed=max\"\n"))
        .expect("written");
    assert!(person.commission(&[], 1)["next"].as_str().expect("a text").contains("start the box"));

    person.makes("no-load", 0.01, false);
    let told = person.commission(&[], 1);
    assert!(part(&told, "no-load")["known"].is_string(), "{told:#}");
    assert!(told["next"].as_str().expect("a text").contains("torque"), "{told:#}");

    person.does("mounts a torque sensor");
    person.makes("load-loss", 0.01, true);
    person.does("gives the file of the sensor");
    person.runs(&["annotate", "torque", "--file", "sensor.csv", "--unit", "Nm", "--config", "box.toml"], 0);
    let told = person.commission(&[], 1);
    let loss = &told["load_loss"]["stages"][0];
    let fixed = loss["accuracy"]["mean_fixed"].as_array().expect("two");
    let mean = loss["accuracy"]["mean"].as_f64().expect("a number");
    println!(
        "torque {:#}\na0 {} a1 {} at {} rpm, residuals {}, own by speed {}\nE {mean}, with 0.15 {}, with 0.25 {}",
        told["torque"],
        loss["linear"]["value"],
        loss["quadratic_per_w"]["value"],
        loss["speed_rpm"],
        loss["form_residuals"],
        loss["by_speed"],
        fixed[0],
        fixed[1]
    );
    assert!(mean < 0.02 && fixed.iter().all(|it| it.as_f64().expect("a number") > mean), "{loss:#}");

    person.wears();
    let told = person.commission(&["--write", "--criterion-mm", CRITERION], 1);
    assert!(part(&told, "wear")["known"].is_string(), "{told:#}");
    assert!(told["next"].as_str().expect("a text").contains("warm the machine up"), "thermal is left: {told:#}");
    let page = std::fs::read_to_string(directory.path().join("data/commission.html")).expect("a page");
    assert!(page.matches("<svg").count() >= 3);
    let found = std::fs::read_to_string(directory.path().join("data/identified/tool-wear.json")).expect("for the page");
    let found: Value = serde_json::from_str(&found).expect("JSON");
    assert!(found["learned"]["surface"]["anova"]["sources"].is_array(), "{found:#}");

    let (alarm_s, text) = alarm(&mut person);
    let true_mm = true_wear_mm(machine, alarm_s);
    println!("{machine}: alarm after {alarm_s:.0} s: {text}; true wear then {true_mm:.3} mm");
    person.did.iter().enumerate().for_each(|(index, what)| println!("{:>3}. {what}", index + 1));
    let criterion_mm: f64 = CRITERION.parse().expect("a number");
    true_mm / criterion_mm
}

/// Flank wear at which this shop changes an edge, mm; the simulated machine puts in edges of 0.29 mm at most.
const CRITERION: &str = "0.28";

/// How the machine is when it works: an edge that is half worn, in production.
const WORKING: &str = "&wear_mm=0.2";
/// How long it works, s.
const WORKS_S: f64 = 4.0 * 3600.0;

/// The box beside the working machine until its first wear alarm: seconds since it began.
fn alarm(person: &mut Person<'_>) -> (f64, String) {
    person.does("puts the real source into the configuration and starts production");
    let began_ns = newest_ns(person);
    let configuration = format!("{CONFIGURATION}\"simulated://{}{WORKING}\"\n", person.machine);
    std::fs::write(person.directory.join("box.toml"), configuration).expect("written");
    person.runs(&["run", "--config", "box.toml", "--speed", "max", "--for", &WORKS_S.to_string()], 0);
    let question = format!(
        "SELECT raised_ns, code, en FROM alarms WHERE code LIKE 'tool_worn%' AND raised_ns > {began_ns} ORDER BY raised_ns LIMIT 1"
    );
    let (out, _) =
        person.runs(&["history", "query", "--history", "data/history.db", "--sql", &question, "--format", "json"], 0);
    let rows: Value = serde_json::from_str(&out).expect("JSON");
    let row = rows["rows"][0].clone();
    let at_ns = row["raised_ns"].as_i64().unwrap_or_else(|| panic!("no wear alarm: {out}"));
    // The accelerated machine begins one second after what the history holds.
    ((at_ns - began_ns - SECOND_NS) as f64 / SECOND_NS as f64, row["en"].to_string())
}

fn newest_ns(person: &Person<'_>) -> TimeNs {
    let (out, _) = person.runs(
        &[
            "history",
            "query",
            "--history",
            "data/history.db",
            "--sql",
            "SELECT max(at_ns) AS newest FROM samples",
            "--format",
            "json",
        ],
        0,
    );
    let rows: Value = serde_json::from_str(&out).expect("JSON");
    rows["rows"][0]["newest"].as_i64().unwrap_or_else(|| panic!("{out}"))
}

/// What the machine's tool in use truly is worn by, so many seconds after it began.
fn true_wear_mm(machine: &str, seconds: f64) -> f64 {
    let address: Address = format!("simulated://{machine}{WORKING}").parse().expect("an address");
    let Target::Simulated(target) = address.target() else { panic!("a simulated machine") };
    let machine = Simulated::new("simulated://lathe", SimulatedSettings::from_target(target), 0);
    machine.truth((seconds * SECOND_NS as f64) as i64).flank_wear_mm
}

#[test]
fn a_reading_without_unit_or_time_is_refused_in_words() {
    let directory = tempfile::tempdir().expect("a directory");
    let person = Person { directory: directory.path(), machine: MACHINES[0], did: Vec::new() };
    std::fs::write(directory.path().join("box.toml"), format!("{CONFIGURATION}\"simulated://lathe\"\n"))
        .expect("written");
    let refused =
        |arguments: &[&str]| person.runs(&[&["annotate"], arguments, &["--config", "box.toml"]].concat(), 1).0;
    assert!(refused(&["gauge", "12", "--at", "now"]).contains("the unit is missing"));
    assert!(refused(&["gauge", "12", "--unit", "um"]).contains("the time is missing"));
    assert!(refused(&["flank-wear", "120", "--unit", "mm", "--at", "now"]).contains("is the unit right?"));
    assert!(refused(&["torque", "--unit", "Nm"]).contains("the file is missing"));
    assert!(!directory.path().join("data/annotations.jsonl").exists());
    let noted = person
        .runs(&["annotate", "probe", "-4", "--unit", "um", "--at", "2026-01-31T08:15:00Z", "--config", "box.toml"], 0)
        .0;
    assert!(noted.contains("-4 um at 2026-01-31T08:15:00"), "{noted}");
}

#[test]
fn pulses_are_inserted_with_proof_and_vectors_come_out_again() {
    let directory = tempfile::tempdir().expect("a directory");
    let person = Person { directory: directory.path(), machine: MACHINES[0], did: Vec::new() };
    person.runs(&["pulses", "--vectors", "vectors"], 0);
    let list = std::fs::read_to_string(directory.path().join("vectors/vectors.json")).expect("a list");
    let list: Value = serde_json::from_str(&list).expect("JSON");
    for vector in list["vectors"].as_array().expect("vectors") {
        let name = vector["name"].as_str().expect("a name");
        let spacing = vector["spacing_ns"].to_string();
        let input = format!("vectors/{name}.in.csv");
        let (_, proof) = person.runs(&["pulses", "--input", &input, "--out", "out.csv", "--spacing-ns", &spacing], 0);
        assert!(proof.contains("proof: holds"), "{name}: {proof}");
        let read = |path: &str| std::fs::read_to_string(directory.path().join(path)).expect("written");
        assert_eq!(read("out.csv"), read(&format!("vectors/{name}.out.csv")), "{name}");
    }
    let moved = Path::new("vectors/forward.in.csv").to_str().expect("a path").to_owned();
    let (lines, proof) = person.runs(&["pulses", "--input", &moved, "--insert", "2"], 0);
    assert!(lines.starts_with("time_ns,a,b\n") && proof.contains("inserted 6"), "{proof}");
}
