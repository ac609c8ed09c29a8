//! Where a machine stands: without a path every output tells what it told before there were paths, with one each of them carries it, and a
//! box that takes the place of another one leaves the machine as it is.

use crate::fleet::pipeline::{Plant, Recorded};
use adapters::ChannelId;
use gateway::fleet::parse_cluster;
use gateway::history::{Part, StateChange};
use gateway::machine_path::NamedMachine;
use gateway::nats::{Connection, FetchLimits};
use serde_json::Value as Json;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;
use std::time::Duration;
use testkit::broker::{Broker, program};
use testkit::process::{Gateway, get, run, stderr, stdout, text, wait_for};

const SECOND_NS: i64 = 1_000_000_000;
const PATH: &str = "acme/shanghai/milling/line-2";

/// What one box has told every receiver.
struct Told {
    box_id: String,
    /// Kinds of documents by topic, and one document of each.
    topics: BTreeMap<String, String>,
    subjects: BTreeSet<String>,
    build_info: String,
    devices: String,
    status: Json,
}

/// Everything that is said on any topic within three seconds: a box repeats nothing for so long, but it sends ten ticks a second. Payloads
/// of Sparkplug are no texts, so all come as hexadecimal digits.
fn hear(port: u16) -> BTreeMap<String, String> {
    let client = program("mosquitto_sub").expect("found before");
    let said = Command::new(client)
        .args(["-h", "localhost", "-p", &port.to_string(), "-t", "#", "-F", "%t %x", "-W", "3"])
        .output()
        .expect("it runs");
    let text = String::from_utf8_lossy(&said.stdout).into_owned();
    let decode = |digits: &str| {
        let byte = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).expect("two digits");
        let bytes: Vec<u8> = (0..digits.len()).step_by(2).map(byte).collect();
        String::from_utf8_lossy(&bytes).into_owned()
    };
    text.lines().filter_map(|line| line.split_once(' ')).map(|(topic, said)| (topic.to_owned(), decode(said))).collect()
}

fn subjects_of(plant: &Plant) -> BTreeSet<String> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("threads");
    let (target, _) = parse_cluster(&plant.address).expect("an address");
    let limits = FetchLimits { messages: 5000, bytes: 16_000_000, patience: Duration::from_secs(1) };
    runtime.block_on(async {
        let mut connection = Connection::open(&target, 0, "test").await.expect("connected");
        connection.create_consumer("CNC", "look").await.expect("made");
        let messages = connection.fetch_messages("CNC", "look", limits).await.expect("given");
        messages.into_iter().map(|message| message.subject).collect()
    })
}

/// Runs a box with these lines under `[gateway]`, and `sinks` besides one to NATS.
fn run_box(plant: &Plant, broker: &Broker, lines: &str, sinks: &[&str]) -> Told {
    let directory = tempfile::tempdir().expect("a directory");
    let config = directory.path().join("gateway.toml");
    let sinks: String = sinks
        .iter()
        .map(|sink| format!("[[sink]]\naddress = \"{}\"\n", sink.replace("{port}", &broker.port.to_string())))
        .collect();
    let written = format!(
        "[gateway]\nname = \"Lathe 7\"\n{lines}[[source]]\naddress = \"simulated://lathe?seed=3\"\n\
         [[sink]]\naddress = \"{}\"\n{sinks}",
        plant.address
    );
    std::fs::write(&config, written).expect("writable");
    let data = directory.path().join("data");
    let mut gateway = Gateway::start(&data, &["--config", text(&config), "--speed", "20"]);
    let page = gateway.address();
    let status = wait_for("every sink has delivered", Duration::from_secs(60), || {
        let status: Json = get(&page, "/api/v1/status").json();
        let sinks = status["sinks"].as_array()?;
        sinks.iter().all(|sink| sink["delivered"].as_u64() > Some(50)).then_some(status)
    });
    let topics = hear(broker.port);
    let metrics = get(&page, "/metrics").body;
    let build_info = metrics.lines().find(|line| line.starts_with("cncgw_build_info")).expect("told").to_owned();
    let mut command = testkit::process::program();
    command.env("CNC_GATEWAY__GATEWAY__DATA_DIR", &data).args(["devices", "--config", text(&config)]);
    let devices = command.output().expect("it runs");
    assert!(devices.status.success(), "{}", stderr(&devices));
    let box_id = topics.values().find_map(|said| {
        let document: Json = serde_json::from_str(said).ok()?;
        document["box"].as_str().map(str::to_owned)
    });
    gateway.stop();
    Told {
        box_id: box_id.expect("every document names its box"),
        subjects: subjects_of(plant),
        topics,
        build_info,
        devices: stdout(&devices),
        status,
    }
}

/// The names of the fields of a document.
fn fields(document: &str) -> Vec<String> {
    let document: Json = serde_json::from_str(document).expect("JSON");
    document.as_object().expect("an object").keys().cloned().collect()
}

#[test]
fn without_a_path_every_output_tells_what_it_told_before() {
    let (Some(plant), Some(broker)) = (Plant::start(), Broker::start()) else { return };
    let sinks = [
        "mqtt://127.0.0.1:{port}",
        "mqtt://127.0.0.1:{port}/flat?layout=flat",
        "sparkplug://127.0.0.1:{port}/plant/line-1/lathe-7",
    ];
    let told = run_box(&plant, &broker, "", &sinks);
    let id = &told.box_id;
    assert!(id.starts_with("Lathe-7-") && id.len() == "Lathe-7-".len() + 10, "{id}");
    for topic in told.topics.keys() {
        let known =
            topic.starts_with(&format!("{id}/")) || topic.starts_with("flat/") || topic.starts_with("spBv1.0/plant/");
        assert!(known, "{topic}");
    }
    let expected =
        ["box", "epoch", "at_ns", "historical", "kind", "machine", "schema", "sequence", "time_utc", "values"];
    let found: BTreeSet<String> = fields(&told.topics[&format!("{id}/sample")]).into_iter().collect();
    assert_eq!(found, expected.iter().map(|name| (*name).to_owned()).collect(), "the document of a sample");
    let flat = fields(&told.topics["flat/state"]);
    assert!(!flat.contains(&"path".to_owned()) && flat.contains(&"box".to_owned()), "{flat:?}");
    assert_eq!(
        told.topics[&format!("{id}/online")],
        format!("{{\"machine\":\"Lathe 7\",\"box\":\"{id}\",\"online\":true}}")
    );
    assert!(told.topics.contains_key("spBv1.0/plant/DDATA/line-1/lathe-7"), "{:?}", told.topics.keys());
    let subject = |kind: &str| format!("cnc.{id}.{kind}");
    assert!(
        told.subjects.contains(&subject("sample")) && told.subjects.iter().all(|it| it.starts_with(&subject(""))),
        "{:?}",
        told.subjects
    );
    let version = env!("CARGO_PKG_VERSION");
    assert_eq!(told.build_info, format!("cncgw_build_info{{version=\"{version}\",machine=\"Lathe 7\"}} 1"));
    let digits = id.rsplit('-').next().expect("digits");
    assert!(
        told.devices.contains(&format!("<Device id=\"m{digits}_machine\" name=\"{id}\" uuid=\"{id}\">")),
        "{}",
        told.devices
    );
    assert!(told.status["path"].is_null() && told.status["machine"] == "Lathe 7");
    plant.ingest();
    assert_eq!(plant.postgres.sql("SELECT count(*) FROM machines"), "0");
    assert_eq!(plant.postgres.sql("SELECT label FROM labels"), "Lathe 7");
    assert_eq!(plant.postgres.sql("SELECT machine, path FROM machines_now"), "Lathe 7|");
}

#[test]
fn with_a_path_every_output_carries_it() {
    let (Some(plant), Some(broker)) = (Plant::start(), Broker::start()) else { return };
    let sinks = [
        "mqtt://127.0.0.1:{port}",
        "mqtt://127.0.0.1:{port}/uns?layout=uns&discovery=homeassistant",
        "mqtt://127.0.0.1:{port}/flat?layout=flat",
        "sparkplug://127.0.0.1:{port}",
    ];
    let told = run_box(&plant, &broker, &format!("path = \"{PATH}\"\n"), &sinks);
    let (id, path) = (&told.box_id, format!("{PATH}/Lathe-7"));
    let dotted = path.replace('/', ".");
    let sensors = format!("homeassistant/sensor/{}", path.replace('/', "_"));
    let group = PATH.replace('/', ".");
    for topic in told.topics.keys() {
        let own = [format!("{path}/"), format!("uns/{path}/"), format!("spBv1.0/{group}/"), format!("{sensors}/")];
        assert!(topic.starts_with("flat/") || own.iter().any(|place| topic.starts_with(place)), "{topic}");
    }
    let sensor: Json = serde_json::from_str(&told.topics[&format!("{sensors}/spindle_power_w/config")]).expect("JSON");
    assert_eq!(sensor["state_topic"], format!("uns/{path}/spindle_power_w"));
    assert_eq!(sensor["device"]["identifiers"], serde_json::json!([path.replace('/', "_")]));
    let power: f64 = told.topics[&format!("uns/{path}/spindle_power_w")].parse().expect("a value alone");
    assert!(power.is_finite());
    for topic in [
        format!("{path}/sample"),
        format!("{path}/online"),
        format!("{path}/latest"),
        "flat/state".to_owned(),
        format!("uns/{path}/state"),
    ] {
        let document: Json = serde_json::from_str(&told.topics[&topic]).expect("JSON");
        assert_eq!(
            (document["path"].as_str(), document["box"].as_str()),
            (Some(path.as_str()), Some(id.as_str())),
            "{topic}"
        );
    }
    assert!(told.topics.contains_key(&format!("spBv1.0/{group}/NDATA/Lathe-7")), "{:?}", told.topics.keys());
    let subject = |kind: &str| format!("cnc.{dotted}.{id}.{kind}");
    assert!(
        told.subjects.contains(&subject("sample")) && told.subjects.iter().all(|it| it.starts_with(&subject(""))),
        "{:?}",
        told.subjects
    );
    let version = env!("CARGO_PKG_VERSION");
    let labels = format!(
        "version=\"{version}\",machine=\"Lathe 7\",path=\"{path}\",enterprise=\"acme\",site=\"shanghai\",area=\"milling\",line=\"line-2\",machine_id=\"Lathe-7\""
    );
    assert_eq!(told.build_info, format!("cncgw_build_info{{{labels}}} 1"));
    assert!(
        told.devices.contains(&format!("<Device id=\"m_{dotted}_machine\" name=\"{dotted}\" uuid=\"{dotted}\">")),
        "{}",
        told.devices
    );
    assert_eq!(told.status["path"], path);
    plant.ingest();
    let row = "SELECT path, enterprise, site, area, line, machine FROM machines";
    assert_eq!(plant.postgres.sql(row), format!("{path}|acme|shanghai|milling|line-2|Lathe-7"));
    assert_eq!(plant.postgres.sql("SELECT label FROM labels"), path);
    assert_eq!(plant.postgres.sql("SELECT machine, box, path FROM machines_now"), format!("Lathe 7|{id}|{path}"));
    assert_eq!(plant.postgres.sql("SELECT DISTINCT path FROM readings"), path);
    assert_eq!(plant.postgres.sql("SELECT count(*) FROM refused"), "0");
}

/// An hour at work with a part in each quarter; the box ends cleanly.
fn work(machine: NamedMachine, first_ns: i64, plant: &Plant) {
    let recorded = Recorded::start(machine, Duration::from_secs(1), &plant.address);
    let power = ChannelId::from_name("spindle_power_w").expect("in the table");
    let (state, program) = ("cutting".to_owned(), "O1".to_owned());
    recorded.writer().queue_record(StateChange {
        at_ns: first_ns,
        state,
        program: program.clone(),
        tool: String::new(),
    });
    for second in 0..3600 {
        let at_ns = first_ns + second * SECOND_NS;
        recorded.tick(at_ns, &[(power, Ok(1000.0))], "cutting");
        if second % 900 == 899 {
            let began_ns = at_ns - 899 * SECOND_NS;
            let part = Part {
                began_ns,
                ended_ns: at_ns,
                program: program.clone(),
                count: 1,
                energy_j: Some(9e5),
                ..Part::default()
            };
            recorded.writer().queue_record(part);
        }
    }
    recorded.stop();
}

fn ask(plant: &Plant, name: &str) -> Vec<Vec<String>> {
    let question = stdout(&run(&["fleet", "sql", name]));
    let rows = plant.postgres.sql(question.trim_end().trim_end_matches(';'));
    rows.lines().map(|row| row.split('|').map(str::to_owned).collect()).collect()
}

#[test]
fn a_box_that_takes_the_place_of_another_one_leaves_the_machine_as_it_is() {
    let Some(plant) = Plant::start() else { return };
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970");
    let now_ns = i64::try_from(now.as_secs()).expect("small") * SECOND_NS;
    let named = |machine: &str| NamedMachine {
        name: "Lathe 7".to_owned(),
        path: Some(format!("{PATH}/{machine}").parse().expect("a path")),
    };
    // The first box stands at the machine for an hour, the second follows; a third stands beside them the whole time.
    work(named("lathe-7"), now_ns - 7400 * SECOND_NS, &plant);
    work(named("lathe-7"), now_ns - 3700 * SECOND_NS, &plant);
    work(named("lathe-8"), now_ns - 3700 * SECOND_NS, &plant);
    plant.ingest();
    let sql = |statement: &str| plant.postgres.sql(statement);
    let (seven, eight) = (format!("{PATH}/lathe-7"), format!("{PATH}/lathe-8"));
    assert_eq!(sql("SELECT count(*), count(DISTINCT machine) FROM boxes"), "3|1", "boxes are known apart");
    assert_eq!(sql("SELECT path FROM machines ORDER BY path"), format!("{seven}\n{eight}"));
    assert_eq!(
        sql("SELECT path, count(*) FROM box_machines JOIN machines USING (machine_id) GROUP BY path ORDER BY path"),
        format!("{seven}|2\n{eight}|1")
    );
    let now = ask(&plant, "machines-now");
    assert_eq!(now.iter().map(|row| row[0].as_str()).collect::<Vec<_>>(), [&*seven, &*eight], "a row for each machine");
    let parts: Vec<_> = ask(&plant, "energy-per-part")
        .into_iter()
        .map(|row| (row[0].clone(), row[2].clone(), row[4].clone()))
        .collect();
    let row = |machine: &str, parts: &str| (machine.to_owned(), parts.to_owned(), "250".to_owned());
    assert_eq!(parts.iter().cloned().collect::<BTreeSet<_>>(), BTreeSet::from([row(&seven, "8"), row(&eight, "4")]));
    let made: f64 = ask(&plant, "oee-per-shift")
        .iter()
        .filter(|row| row[0] == seven)
        .filter_map(|row| row[3].parse::<f64>().ok())
        .sum();
    assert_eq!(made, 8.0, "the parts of both boxes are of one machine");
    let shifts: BTreeSet<_> = ask(&plant, "oee-per-shift").into_iter().map(|row| row[..3].join(" ")).collect();
    assert_eq!(shifts.len(), ask(&plant, "oee-per-shift").len(), "one row for each machine and shift");
    // The second box goes to the other machine: what it has made before stays where it was made.
    let second = sql("SELECT box FROM machines_now WHERE path LIKE '%lathe-7'");
    sql(&format!(
        "INSERT INTO box_machines SELECT box_id, now(), machine_id FROM boxes, machines WHERE box = '{second}' AND path = '{eight}'"
    ));
    let moved: Vec<_> = ask(&plant, "energy-per-part")
        .into_iter()
        .map(|row| (row[0].clone(), row[2].clone(), row[4].clone()))
        .collect();
    assert_eq!(moved.into_iter().collect::<BTreeSet<_>>(), BTreeSet::from([row(&seven, "8"), row(&eight, "4")]));
}
