//! An MTConnect agent by another hand (PyPI mtconnect) as a source.

use adapters::clock::SystemClock;
use adapters::driver::FactValue;
use adapters::{Absence, Address, Reading, Source, Value};
use serde_json::{Value as Json, json};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};
use testkit::port::free_port;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/controllers/mtconnect")
}

struct ForeignAgent {
    child: Child,
    stdin: ChildStdin,
    stdout: BufReader<ChildStdout>,
}

impl ForeignAgent {
    fn start(port: u16, buffer: usize, more: &[&str]) -> Self {
        let mut command = Command::new("python3");
        command.arg(folder().join("foreign_agent.py")).arg(folder().join("devices.xml"));
        command.args([port.to_string(), buffer.to_string()]).args(more);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("python3 starts");
        let stdin = child.stdin.take().expect("piped");
        let mut agent = Self { stdin, stdout: BufReader::new(child.stdout.take().expect("piped")), child };
        assert_eq!(agent.read_line(), "ready", "the agent did not start");
        agent
    }

    fn read_line(&mut self) -> String {
        let mut line = String::new();
        self.stdout.read_line(&mut line).expect("it says something");
        line.trim().to_owned()
    }

    /// Makes observations; gives the number of the newest one.
    fn observe(&mut self, pairs: &[Json]) -> u64 {
        writeln!(self.stdin, "{}", Json::from(pairs.to_vec())).expect("it reads");
        self.read_line().parse().expect("a number")
    }
}

impl Drop for ForeignAgent {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Is the agent installed? Where `CNC_GATEWAY_CI` is set it must be.
fn agent_is_there() -> bool {
    let has = Command::new("python3").args(["-c", "import mtconnect.agent"]).stderr(Stdio::null()).status();
    let has = has.is_ok_and(|status| status.success());
    assert!(has || std::env::var_os("CNC_GATEWAY_CI").is_none(), "the agent is not installed; see .ci/run");
    if !has {
        eprintln!("SKIPPED: the agent is not installed (pip install mtconnect==0.3.3)");
    }
    has
}

fn open(port: u16) -> Box<dyn Source> {
    let address: Address = format!("mtconnect://127.0.0.1:{port}/Lathe?period_ms=20").parse().expect("usable");
    adapters::open::open_address(&address, 0).expect("opens").sources.remove(0)
}

fn count(source: &dyn Source, name: &str) -> u64 {
    let fact = source.collect_facts().into_iter().find(|fact| fact.name == name).expect(name);
    match fact.value {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
        FactValue::Number(number) => number as u64,
        FactValue::Text(text) => panic!("{name} is {text}"),
    }
}

fn poll_until(source: &mut dyn Source, readings: &mut Vec<Reading>, holds: impl Fn(&dyn Source, &[Reading]) -> bool) {
    let (clock, until) = (SystemClock::new(), Instant::now() + Duration::from_secs(60));
    while !holds(source, readings) {
        assert!(Instant::now() < until, "not in time: {:?}; {:?}", source.collect_facts(), source.list_problems());
        // A poll while the agent starts anew fails.
        let _ = source.read(&clock, readings);
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn last(readings: &[Reading], channel: &str) -> Option<Result<Value, Absence>> {
    readings.iter().rev().find(|reading| reading.channel.name() == channel).map(|reading| reading.value.clone())
}

/// Item, what is observed, channel, and what it then says by hand: a number in its unit or a text.
fn list_expected() -> Vec<(&'static str, Json, &'static str, Result<Json, Absence>)> {
    vec![
        ("kw", json!(7.5), "total_power_w", Ok(json!(7500.0))),
        ("ws", json!(3_600_000.0), "total_energy_kwh", Ok(json!(1.0))),
        ("xp", json!(2.0), "x_axis_position_mm", Ok(json!(50.8))),
        ("xv", json!(10.0), "x_axis_velocity_mm_min", Ok(json!(254.0))),
        ("xl", json!(12.5), "x_axis_load_pct", Ok(json!(12.5))),
        ("zp", json!(-3.25), "z_axis_position_mm", Ok(json!(-3.25))),
        ("zv", json!(2.0), "z_axis_velocity_mm_min", Ok(json!(120.0))),
        ("za", json!(150.0), "z_axis_current_a", Ok(json!(1.5))),
        ("sv", json!(25.0), "spindle_speed_rpm", Ok(json!(1500.0))),
        ("sp", json!(1600.0), "spindle_programmed_rpm", Ok(json!(1600.0))),
        ("st", json!(212.0), "temperature_1_c", Ok(json!(100.0))),
        ("sq", json!(3.5), "torque_nm", Ok(json!(3.5))),
        ("sl", json!(40.0), "spindle_load_pct", Err(Absence::UnknownUnit)),
        ("so", json!("90"), "spindle_override_pct", Ok(json!(90.0))),
        ("f", json!(20.0), "feed_mm_min", Ok(json!(1200.0))),
        ("fp", json!(25.0), "feed_programmed_mm_min", Ok(json!(1500.0))),
        ("fov", json!("80"), "feed_override_pct", Ok(json!(80.0))),
        ("exec", json!("PROGRAM_STOPPED"), "execution", Ok(json!("STOPPED"))),
        ("mode", json!("SEMI_AUTOMATIC"), "mode", Ok(json!("SEMI_AUTOMATIC"))),
        ("pgm", json!("O1 & <2> \u{6570}"), "program", Ok(json!("O1 & <2> \u{6570}"))),
        ("line", json!("30"), "block", Ok(json!("N30"))),
        ("tool", json!("7"), "tool", Ok(json!("T7"))),
        ("parts", json!("12"), "part_count", Ok(json!(12.0))),
        ("stop", json!("TRIGGERED"), "emergency_stop", Ok(json!(1.0))),
        ("sys", json!("FAULT"), "alarm", Ok(json!("EMERGENCY STOP; System"))),
        ("avail", json!("AVAILABLE"), "coolant_temperature_c", Err(Absence::NotSupported)),
    ]
}

fn agrees(found: Option<&Result<Value, Absence>>, expected: &Result<Json, Absence>) -> bool {
    match (found, expected) {
        (Some(Ok(Value::Number(number))), Ok(expected)) => {
            expected.as_f64().is_some_and(|wanted| (number - wanted).abs() < 1e-9 * wanted.abs().max(1.0))
        }
        (Some(Ok(Value::Text(text))), Ok(expected)) => expected.as_str() == Some(text),
        (Some(Err(found)), Err(expected)) => found == expected,
        _ => false,
    }
}

#[test]
fn every_channel_says_what_the_foreign_agent_was_told_in_its_unit() {
    if !agent_is_there() {
        return;
    }
    for (more, way) in [(&[][..], "one answer"), (&["bare"], "a question")] {
        let port = free_port();
        let mut agent = ForeignAgent::start(port, 4096, more);
        let (mut source, mut readings) = (open(port), Vec::new());
        source.read(&SystemClock::new(), &mut readings).expect("reads");
        assert_eq!(last(&readings, "feed_mm_min"), Some(Err(Absence::Disconnected)), "nothing was observed yet");
        let expected = list_expected();
        let pairs: Vec<Json> = expected.iter().map(|(item, value, ..)| json!([item, value])).collect();
        agent.observe(&pairs);
        readings.clear();
        let observed = u64::try_from(pairs.len()).expect("few");
        poll_until(source.as_mut(), &mut readings, |source, _| count(source, "observations") >= observed);
        poll_until(source.as_mut(), &mut readings, |_, readings| last(readings, "coolant_temperature_c").is_some());
        for (item, value, channel, expected) in &expected {
            let found = last(&readings, channel);
            assert!(agrees(found.as_ref(), expected), "{item} {value}: {channel} says {found:?} and not {expected:?}");
        }
        let identity = source.query_identity();
        assert!(identity.iter().any(|(name, text)| *name == "way" && text.starts_with(way)), "{identity:?}");
        assert!(
            source.list_problems().iter().any(|problem| problem.what.contains("\"BAR\"")),
            "{:?}",
            source.list_problems()
        );
    }
}

/// Everything that the agent observes between restarts comes once and in order; what it overwrites is counted.
fn read_all_once(observations: u64, restarts: u64) {
    let (port, buffer, block) = (free_port(), 2000_u64, 500_u64);
    let start = || ForeignAgent::start(port, usize::try_from(buffer).expect("small"), &[]);
    let mut agent = start();
    let items = agent.observe(&[]);
    let (mut source, mut readings) = (open(port), Vec::new());
    poll_until(source.as_mut(), &mut readings, |source, _| count(source, "connections") > 0);
    let (mut made, mut values, mut numbers) = (0, 0_u64, Vec::new());
    for round in 0..=restarts {
        while values < observations * (round + 1) / (restarts + 1) {
            let first = values;
            values += block;
            let pairs: Vec<Json> = (first..values).map(|number| json!(["zp", number])).collect();
            agent.observe(&pairs);
            made += block;
            poll_until(source.as_mut(), &mut readings, |source, _| count(source, "observations") >= made);
            numbers.extend(
                readings
                    .drain(..)
                    .filter(|reading| reading.channel.name() == "z_axis_position_mm")
                    .filter_map(|reading| reading.value.ok()?.as_number()),
            );
        }
        if round < restarts {
            drop(agent);
            agent = start();
            // A new start observes of every item that it is unavailable.
            made += items;
        }
    }
    numbers.dedup();
    let wrong = numbers.iter().zip(0_u32..).filter(|(number, place)| **number != f64::from(*place)).count();
    let told = |name| count(source.as_ref(), name);
    println!(
        "{} observations, {values} of them numbered values, {} once and in order, {wrong} wrong, {} restarts told, {} lost",
        told("observations"),
        numbers.len(),
        told("agent_restarts"),
        told("lost_observations")
    );
    assert_eq!((numbers.len(), wrong), (usize::try_from(values).expect("fits"), 0));
    assert_eq!((told("observations"), told("agent_restarts"), told("lost_observations")), (made, restarts, 0));
    // More at once than the buffer holds, while nobody reads.
    let more: Vec<Json> = (0..3 * buffer).map(|number| json!(["zp", number])).collect();
    agent.observe(&more);
    poll_until(source.as_mut(), &mut readings, |source, _| {
        count(source, "observations") + count(source, "lost_observations") >= made + 3 * buffer
    });
    let (lost, read) = (count(source.as_ref(), "lost_observations"), count(source.as_ref(), "observations") - made);
    println!("{} observed at once into a buffer of {buffer}: {read} read, {lost} told as lost", 3 * buffer);
    assert_eq!((lost + read, read), (3 * buffer, buffer));
    let told = source.list_problems();
    assert!(told.iter().any(|problem| problem.what.contains(&format!("{lost} observations"))), "{told:?}");
}

#[test]
fn every_observation_comes_once_through_restarts_and_a_gap_is_told() {
    if agent_is_there() {
        read_all_once(3000, 2);
    }
}

#[test]
#[ignore = "10 seconds: 60,000 observations of a foreign agent through 10 restarts come once each"]
fn sixty_thousand_observations_come_once_through_ten_restarts() {
    assert!(agent_is_there(), "pip install mtconnect==0.3.3");
    read_all_once(60_000, 10);
}

#[test]
fn the_doctor_reads_an_agent_and_says_what_is_wrong_with_the_name() {
    if !agent_is_there() {
        return;
    }
    let port = free_port();
    let mut agent = ForeignAgent::start(port, 4096, &[]);
    agent.observe(&[json!(["avail", "AVAILABLE"]), json!(["sv", 25.0])]);
    let examined = testkit::process::run(&["doctor", &format!("mtconnect://127.0.0.1:{port}/Lathe"), "--all"]);
    let told = testkit::process::stdout(&examined);
    assert!(told.contains("spindle_speed_rpm") && told.contains("1500 rpm"), "{told}");
    assert!(told.contains("25.0 REVOLUTION/SECOND"), "{told}");
    let examined = testkit::process::run(&["doctor", &format!("mtconnect://127.0.0.1:{port}/Lahte")]);
    let told = testkit::process::stdout(&examined);
    assert!(told.contains("no device Lahte") && told.contains("Did you mean Lathe?"), "{told}");
}
