//! Receivers that are away, restart, or take nothing. Truth: what a client that is not ours has heard, by the numbers that every item
//! carries.

use crate::kills::random;
use crate::line::{Fault, Line};
use crate::table::{Row, Scale};
use rand::Rng;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use testkit::box_under_test::Sending;
use testkit::broker::{Broker, program as installed};
use testkit::host::Host;
use testkit::process::wait_for;

pub(crate) const PATIENCE: Duration = Duration::from_secs(300);

/// `mosquitto_sub` at a broker: ends with it, and is started again by the test, before the box may go on.
struct Subscriber {
    child: Child,
}

/// Every line that any subscriber has printed.
pub(crate) type Heard = Arc<Mutex<Vec<String>>>;

impl Subscriber {
    /// Subscribes, and returns when the broker has said that it is so.
    fn start(port: u16, heard: &Heard) -> Option<Self> {
        let mut command = Command::new(installed("mosquitto_sub")?);
        command.args(["-h", "127.0.0.1", "-p", &port.to_string(), "-t", "works/#", "-q", "1"]);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("mosquitto_sub runs");
        let (output, shared) = (child.stdout.take().expect("piped"), heard.clone());
        std::thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                shared.lock().expect("whole").push(line);
            }
        });
        let subscriber = Self { child };
        let mark = format!("subscribed {}", subscriber.child.id());
        wait_for("the subscription", PATIENCE, || {
            let client = installed("mosquitto_pub").expect("it comes with mosquitto_sub");
            let _sent = Command::new(client)
                .args(["-h", "127.0.0.1", "-p", &port.to_string(), "-t", "works/mark", "-m", &mark])
                .status();
            heard.lock().expect("whole").contains(&mark).then_some(())
        });
        Some(subscriber)
    }
}

impl Drop for Subscriber {
    fn drop(&mut self) {
        let _ended = (self.child.kill(), self.child.wait());
    }
}

/// What has arrived, by number: how often, and at which times of the items.
#[derive(Default)]
pub(crate) struct Arrived {
    times: BTreeMap<u64, u64>,
    /// The furthest that a repeated item lay behind the newest then, s of machine time.
    oldest_repeat_s: f64,
}

impl Arrived {
    pub(crate) fn of(heard: &Heard) -> Self {
        let (mut arrived, mut newest_ns) = (Self::default(), 0);
        for line in heard.lock().expect("whole").iter() {
            let Ok(item) = serde_json::from_str::<Value>(line) else { continue };
            let (Some(number), Some(at_ns)) = (item["sequence"].as_u64(), item["at_ns"].as_i64()) else { continue };
            let times = arrived.times.entry(number).or_default();
            *times += 1;
            if *times > 1 {
                arrived.oldest_repeat_s = arrived.oldest_repeat_s.max((newest_ns - at_ns) as f64 / 1e9);
            }
            newest_ns = newest_ns.max(at_ns);
        }
        arrived
    }

    /// Numbers between the first and the last that never came.
    fn missing(&self) -> u64 {
        self.times.keys().next_back().copied().unwrap_or(0) - self.times.len() as u64
    }

    fn repeats(&self) -> u64 {
        self.times.values().map(|times| times - 1).sum()
    }

    fn most(&self) -> u64 {
        self.times.values().copied().max().unwrap_or(0)
    }

    pub(crate) fn into_row(self, row: &mut Row) {
        let (missing, repeats) = (self.missing(), self.repeats());
        row.lost = Some(missing);
        row.repeated = Some((repeats, 0));
        row.must(missing == 0, format!("{missing} of {} items are missing", self.times.len()));
        row.must(!self.times.is_empty(), "nothing arrived");
        row.note = format!(
            "{} items, one at most {} times; oldest repeat {:.1} s of machine time back{}{}",
            self.times.len(),
            self.most(),
            self.oldest_repeat_s,
            if row.note.is_empty() { "" } else { "; " },
            row.note
        );
    }
}

/// A box, a broker, a subscriber, and a line between the box and the broker.
pub(crate) struct Plant {
    broker: Broker,
    pub(crate) heard: Heard,
    subscriber: Option<Subscriber>,
    line: Line,
}

impl Plant {
    pub(crate) fn start() -> Option<Self> {
        let broker = Broker::with("allow_anonymous true\nmax_inflight_messages 0\nmax_queued_messages 0\n", |_| {})?;
        let heard = Heard::default();
        let subscriber = Some(Subscriber::start(broker.port, &heard)?);
        let line = Line::to(&format!("127.0.0.1:{}", broker.port));
        Some(Self { broker, heard, subscriber, line })
    }

    pub(crate) fn address(&self) -> String {
        format!("mqtt://127.0.0.1:{}/works/lathe", self.line.port)
    }

    /// The broker is killed for so long. The box reaches it again when the subscriber is there.
    fn restart(&mut self, away: Duration) {
        self.line.set(Fault::Cut);
        self.broker.kill();
        self.subscriber = None;
        std::thread::sleep(away);
        self.broker.run();
        self.subscriber = Subscriber::start(self.broker.port, &self.heard);
        self.line.set(Fault::None);
    }
}

fn delivered(sending: &Sending, count: u64) {
    wait_for("items are delivered", PATIENCE, || (sending.sink()["delivered"].as_u64()? >= count).then_some(()));
}

/// Is a sink, as the status tells it, at the newest item?
pub(crate) fn is_caught_up(sink: &Value) -> bool {
    sink["failing"] == false && sink["behind_items"].as_u64() < Some(200)
}

/// The sink is at the newest item again. Gives how long that took.
pub(crate) fn caught_up(sending: &Sending) -> Duration {
    let began = Instant::now();
    wait_for("the gap is closed", PATIENCE, || is_caught_up(&sending.sink()).then_some(()));
    began.elapsed()
}

pub(crate) fn broker_away(scale: &Scale) -> Row {
    let mut row = Row::new("mosquitto away for 60 s at 20 times the pace of a machine; numbers heard by mosquitto_sub");
    let Some(mut plant) = Plant::start() else { return Row::skipped(row.how) };
    let mut sending = Sending::fast(&plant.address());
    delivered(&sending, 200);
    plant.restart(scale.time(Duration::from_secs(60), Duration::from_secs(10)));
    row.recovered(caught_up(&sending));
    sending.stop();
    row.n = 1;
    Arrived::of(&plant.heard).into_row(&mut row);
    row
}

pub(crate) fn broker_restarts(scale: &Scale) -> Row {
    let mut row = Row::new("mosquitto killed and started again at random moments; numbers heard by mosquitto_sub");
    let Some(mut plant) = Plant::start() else { return Row::skipped(row.how) };
    let mut sending = Sending::fast(&plant.address());
    let mut random = random();
    for _ in 0..scale.of(20, 2) {
        delivered(&sending, 50);
        std::thread::sleep(Duration::from_millis(random.random_range(0..3000)));
        plant.restart(Duration::from_millis(random.random_range(0..2000)));
        row.recovered(caught_up(&sending));
        row.n += 1;
    }
    sending.stop();
    Arrived::of(&plant.heard).into_row(&mut row);
    row
}

pub(crate) fn broker_late(_: &Scale) -> Row {
    let mut row = Row::new("mosquitto is started 20 s after the box; numbers heard by mosquitto_sub");
    let Some(mut plant) = Plant::start() else { return Row::skipped(row.how) };
    plant.line.set(Fault::Cut);
    plant.broker.kill();
    let mut sending = Sending::fast(&plant.address());
    let said = sending.wait_sink("it says why", |sink| sink["failing"] == true)["error"].to_string();
    std::thread::sleep(Duration::from_secs(20));
    plant.restart(Duration::ZERO);
    row.recovered(caught_up(&sending));
    row.must(row.recovers < Some(Duration::from_secs(30)), "more than 30 s");
    sending.stop();
    (row.n, row.note) = (1, format!("told: {said}"));
    Arrived::of(&plant.heard).into_row(&mut row);
    row
}

/// Boxes that live for seconds: what comes twice.
pub(crate) fn short_lives(scale: &Scale) -> Row {
    let mut row =
        Row::new("SIGKILL 0.5 to 4 s after the sink has connected, again and again; numbers heard by mosquitto_sub");
    let Some(plant) = Plant::start() else { return Row::skipped(row.how) };
    let mut sending = Sending::fast(&plant.address());
    let mut random = random();
    for _ in 0..scale.of(40, 4) {
        sending.wait_sink("connected", |sink| sink["state"] == "connected");
        std::thread::sleep(Duration::from_millis(random.random_range(500..4000)));
        sending.kill();
        sending.start();
        row.n += 1;
    }
    row.recovered(caught_up(&sending));
    sending.stop();
    let arrived = Arrived::of(&plant.heard);
    row.must(arrived.most() <= 5, format!("an item came {} times", arrived.most()));
    arrived.into_row(&mut row);
    row
}

/// Items above what the broker takes: three alarms of one tick, and the means of each minute. They alone are left out.
pub(crate) fn too_large(_: &Scale) -> Row {
    let mut row = Row::new(
        "max_packet_size 2150 for two minutes, items of up to 6,400 bytes, MQTT 3.1.1, which says nothing but hangs up",
    );
    let lines = "allow_anonymous true\nmax_packet_size 2150\n";
    let Some(broker) = Broker::with(lines, |_| {}) else { return Row::skipped(row.how) };
    let heard = Heard::default();
    let Some(_subscriber) = Subscriber::start(broker.port, &heard) else { return Row::skipped(row.how) };
    // A text of a script may have 1,024 bytes.
    let long = "x".repeat(1000);
    let alarms = ["one", "two", "three"]
        .map(|name| format!("alarm(\"{name}\", \"warning\", \"{long}\", \"{long}\");"))
        .join(" ");
    let script = format!("if clock() > 0 {{ {alarms} }}");
    let address = format!("mqtt://127.0.0.1:{}/works/lathe", broker.port);
    let began = Instant::now();
    let mut sending = Sending::with_script("simulated://lathe?seed=3", "1", &address, "", Some(&script));
    wait_for("one is left out", PATIENCE, || (sending.sink()["refused"].as_u64() > Some(0)).then_some(()));
    row.recovered(began.elapsed());
    wait_for("three are left out", PATIENCE, || (sending.sink()["refused"].as_u64() >= Some(3)).then_some(()));
    caught_up(&sending);
    let sink = sending.sink();
    sending.stop();
    let arrived = Arrived::of(&heard);
    row.n = arrived.missing() as usize;
    row.lost = Some(0);
    row.repeated = Some((arrived.repeats(), 0));
    row.must(
        Some(arrived.missing()) == sink["refused"].as_u64(),
        format!("{} missing, {} told", arrived.missing(), sink["refused"]),
    );
    row.note = format!("{} items; left out and told: {}", arrived.times.len(), sink["refusal"]);
    row
}

/// Births, numbers of births, numbers of messages and items, as another implementation decodes them.
pub(crate) fn sparkplug_restarts(scale: &Scale) -> Row {
    let mut row =
        Row::new("mosquitto and the box restarted in turn; births, bdSeq, seq and items as pysparkplug decodes them");
    let Some(mut broker) =
        Broker::with("allow_anonymous true\nmax_inflight_messages 0\nmax_queued_messages 0\n", |_| {})
    else {
        return Row::skipped(row.how);
    };
    let Some(host) = Host::at(broker.port) else { return Row::skipped(row.how) };
    let line = Line::to(&format!("127.0.0.1:{}", broker.port));
    let mut sending = Sending::fast(&format!("sparkplug://127.0.0.1:{}/plant/line-1/lathe-7", line.port));
    for step in 0..scale.of(20, 2) {
        let births = host.count("DDATA");
        host.wait_more("data", "DDATA", births + 50);
        match step % 2 {
            0 => {
                line.set(Fault::Cut);
                broker.kill();
                let connected = host.count("connected");
                broker.run();
                host.wait_more("the host again", "connected", connected);
                line.set(Fault::None);
            }
            _ => {
                sending.kill();
                sending.start();
            }
        }
        row.recovered(caught_up(&sending));
        row.n += 1;
    }
    sending.stop();
    let heard = host.heard();
    legal(&heard, &mut row);
    row
}

/// Are births numbered from 0 on by one, and messages after a birth likewise? Are all items there?
fn legal(heard: &[Value], row: &mut Row) {
    let named = |message: &Value, name: &str| {
        let metrics = message["metrics"].as_array().map_or(&[][..], Vec::as_slice);
        metrics.iter().find(|metric| metric["name"] == name).cloned().unwrap_or_default()
    };
    let (mut births, mut next, mut alias, mut items) = (Vec::new(), None, None, BTreeMap::<u64, u64>::new());
    for message in heard {
        match message["kind"].as_str().unwrap_or_default() {
            "NBIRTH" => {
                births.push(named(message, "bdSeq")["value"].as_u64().unwrap_or(999));
                row.must(message["seq"] == 0, "a birth does not begin at 0");
                next = Some(1);
            }
            kind @ ("DBIRTH" | "DDATA") => {
                row.must(
                    next.is_none_or(|next| message["seq"] == next),
                    format!("{kind} {} is not {next:?}", message["seq"]),
                );
                next = message["seq"].as_u64().map(|seq| (seq + 1) % 256);
                if kind == "DBIRTH" {
                    alias = named(message, "item/sequence")["alias"].as_u64();
                } else {
                    let metrics = message["metrics"].as_array().map_or(&[][..], Vec::as_slice);
                    let number = metrics.iter().find(|metric| alias.is_some() && metric["alias"].as_u64() == alias);
                    if let Some(number) = number.and_then(|metric| metric["value"].as_u64()) {
                        *items.entry(number).or_default() += 1;
                    }
                }
            }
            _ => next = next.filter(|_| message["kind"] != "NDEATH"),
        }
    }
    // Where the host was away a birth may be missing; those it has heard of one box never go back or stand still.
    let (first, steps) = (births.first().copied(), births.windows(2).map(|pair| (256 + pair[1] - pair[0]) % 256));
    let illegal = steps.filter(|step| ![0, 1, 2].contains(step)).count();
    row.must(first == Some(0) && illegal == 0, format!("numbers of births: {births:?}"));
    let last = items.keys().next_back().copied().unwrap_or(0);
    row.lost = Some(last - items.len() as u64);
    row.repeated = Some((items.values().map(|times| times - 1).sum(), 0));
    row.must(row.lost == Some(0), format!("{:?} of {last} items are missing", row.lost));
    row.note = format!("{} births, numbers {:?} to {:?}; {last} items", births.len(), first, births.last());
}
