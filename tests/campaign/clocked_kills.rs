//! SIGKILL at random moments of a box that sends to MQTT and to NATS, while the clock of the computer is wrong in some of its lives.
//! Truth: the numbers of the items as `mosquitto_sub` has heard them and as the stream of a NATS server holds them.

use crate::clocks::{Clocked, LEAPS};
use crate::kills::{random, status};
use crate::partners::{Arrived, Plant, is_caught_up};
use crate::table::{Row, Scale};
use rand::Rng;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;
use std::time::{Duration, Instant};
use testkit::nats_cluster::Cluster;
use testkit::process::{run, stderr, wait_for};

const PATIENCE: Duration = Duration::from_secs(300);
/// A clock of the computer that is wrong by less than this is no reason to date rows anew, ns.
const WRONG_NS: i64 = 1_000_000_000;

/// Prints a line `EPOCH SEQUENCE` for each message of the stream.
const LIST_STREAM: &str = "\
import asyncio, json, sys, nats
async def main():
    connection = await nats.connect(sys.argv[1])
    stream = connection.jetstream()
    reader = await stream.pull_subscribe('', durable='count', stream='CNC')
    left = (await stream.stream_info('CNC')).state.messages
    while left > 0:
        for message in await reader.fetch(min(left, 500), timeout=20):
            item = json.loads(message.data)
            print(item['epoch'], item['sequence'])
            left -= 1
            await message.ack()
asyncio.run(main())
";

/// How wrong the clock of the computer is in some lives.
#[derive(Clone, Copy, PartialEq)]
enum ClockError {
    /// By what every computer runs ahead or behind between two visits of a time server.
    Small,
    Leap,
}

impl ClockError {
    fn choose_offset(self, random: &mut impl Rng) -> String {
        match self {
            Self::Small => format!("{:+.3}s", random.random_range(-0.45..0.45)),
            Self::Leap => LEAPS[random.random_range(0..LEAPS.len())].to_owned(),
        }
    }
}

pub(crate) fn with_small_errors(scale: &Scale) -> Row {
    let row = Row::new(
        "SIGKILL with MQTT and NATS, the clock off by up to 0.45 s in each second life; numbers heard by mosquitto_sub and in the stream",
    );
    kill_often(row, scale.of(100, 3), ClockError::Small)
}

pub(crate) fn with_leaps(scale: &Scale) -> Row {
    let row = Row::new(
        "the same, the clock wrong by +405 d, +11 y, -1 h, -10 y or of 1970 at each second start and set right 0.2 to 3 s later",
    );
    kill_often(row, scale.of(100, 3), ClockError::Leap)
}

fn kill_often(mut row: Row, count: usize, error: ClockError) -> Row {
    let (Some(plant), Some(nats)) = (Plant::start(), Cluster::start(1)) else { return Row::skipped(row.how) };
    let made = run(&["fleet", "stream", &format!("{}/cnc", nats.address()), "--max-gb", "1"]);
    row.must(made.status.success(), stderr(&made));
    let lines = format!(
        "[[source]]\naddress = \"simulated://lathe?seed=3\"\n[[sink]]\nname = \"mqtt\"\naddress = \"{}\"\n\
         [[sink]]\nname = \"nats\"\naddress = \"{}/cnc\"\n",
        plant.address(),
        nats.address()
    );
    let Some(clocked) = Clocked::new(10.0, &lines) else { return Row::skipped(row.how) };
    let mut random = random();
    for life in 0..count {
        let is_wrong = life % 2 == 1;
        clocked.set(&if is_wrong { error.choose_offset(&mut random) } else { "+0s".to_owned() });
        let (gateway, address) = clocked.start();
        wait_for("the page", PATIENCE, || status(&address));
        std::thread::sleep(Duration::from_millis(random.random_range(200..3000)));
        if is_wrong {
            clocked.set("+0s");
            std::thread::sleep(Duration::from_millis(random.random_range(0..14000)));
        }
        gateway.kill();
        row.n += 1;
    }
    clocked.set("+0s");
    let (gateway, _) = clocked.start();
    let began = Instant::now();
    wait_for("both outputs are at the newest item", PATIENCE, || {
        // A box whose clock is set right begins a new run, on another port.
        are_caught_up(&gateway.list_pages().pop()?).then_some(())
    });
    row.recovered(began.elapsed());
    gateway.stop();
    check_redating(&clocked, error, &mut row);
    check_stream(&nats, &mut row);
    Arrived::of(&plant.heard).into_row(&mut row);
    row
}

fn are_caught_up(address: &str) -> bool {
    status(address).is_some_and(|status| status["sinks"].as_array().is_some_and(|all| all.iter().all(is_caught_up)))
}

/// Rows were dated anew only where the clock was wrong by more than a second: never for small errors.
fn check_redating(clocked: &Clocked, error: ClockError, row: &mut Row) {
    let sql = "SELECT json_extract(detail, '$.by_ns[0]') AS least, json_extract(detail, '$.by_ns[1]') AS most \
               FROM events WHERE kind = 'clock_redated'";
    let events = clocked.query(sql);
    let events = events.as_array().cloned().unwrap_or_default();
    for event in &events {
        let small = ["least", "most"].iter().any(|name| event[*name].as_i64().is_none_or(|by| by.abs() <= WRONG_NS));
        row.must(!small, format!("rows were dated anew by {event}"));
    }
    row.must(error == ClockError::Leap || events.is_empty(), format!("a right clock dated rows anew: {events:?}"));
    row.note = format!("rows dated anew {} times", events.len());
}

/// Every number is in the stream, and once.
fn check_stream(nats: &Cluster, row: &mut Row) {
    let listed = Command::new("python3").args(["-c", LIST_STREAM, &nats.address()]).output().expect("python3 runs");
    row.must(listed.status.success(), String::from_utf8_lossy(&listed.stderr));
    let mut times: BTreeMap<(i64, u64), u64> = BTreeMap::new();
    for line in String::from_utf8_lossy(&listed.stdout).lines() {
        let key = line.split_once(' ').and_then(|(epoch, number)| Some((epoch.parse().ok()?, number.parse().ok()?)));
        *times.entry(key.expect("two numbers")).or_default() += 1;
    }
    let epochs = times.keys().map(|(epoch, _)| epoch).collect::<BTreeSet<_>>().len();
    let numbers: BTreeSet<u64> = times.keys().map(|(_, number)| *number).collect();
    let last = numbers.last().copied().unwrap_or(0);
    let missing = last - numbers.len() as u64;
    let repeats = times.values().filter(|times| **times > 1).count();
    row.must(last > 0 && missing == 0, format!("{missing} of {last} items are missing in the stream"));
    row.must(repeats == 0, format!("{repeats} items are in the stream more than once"));
    row.note = format!("{}; stream: {last} items, {missing} missing, {repeats} twice, {epochs} epochs", row.note);
}
