//! A control whose line is cut, hangs, or brings garbage: a served FANUC machine in a process of its own behind the line.

use crate::kills::{queried, status};
use crate::line::{Fault, Line};
use crate::process::{Gateway, program, text, wait_for};
use crate::table::{Row, Scale};
use serde_json::Value;
use std::path::Path;
use std::time::{Duration, Instant};

/// A value is not shown and not stored as fresh when it is older than this, and one poll.
const FRESH: Duration = Duration::from_secs(3);

struct Polled {
    directory: tempfile::TempDir,
    gateway: Gateway,
    address: String,
    line: Line,
    _control: Gateway,
}

impl Polled {
    fn start() -> Self {
        let mut command = program();
        command.args(["serve", "fanuc", "--listen", "127.0.0.1:0", "--machine", "simulated://lathe?seed=7"]);
        let mut control = Gateway::spawn(command);
        let said = control.wait_said("fanuc://");
        let target = said.split_whitespace().next().and_then(|word| word.strip_prefix("fanuc://")).expect("an address");
        let line = Line::to(target.split(['/', '?']).next().unwrap_or(target));
        let directory = tempfile::tempdir().expect("a directory");
        let config = directory.path().join("box.toml");
        let lines = format!("[[source]]\nname = \"lathe\"\naddress = \"fanuc://127.0.0.1:{}\"\n", line.port);
        std::fs::write(&config, lines).expect("a configuration");
        let mut gateway = Gateway::start(&directory.path().join("data"), &["--config", text(&config)]);
        let address = gateway.address();
        let polled = Self { directory, gateway, address, line, _control: control };
        wait_for("values", Duration::from_secs(120), || polled.has_value().then_some(()));
        polled
    }

    fn channel(&self) -> Option<Value> {
        let status = status(&self.address)?;
        status["channels"].as_array()?.iter().find(|row| row["name"] == "feed_override_pct").cloned()
    }

    fn has_value(&self) -> bool {
        self.channel().is_some_and(|channel| channel["value"].is_number())
    }

    fn ticks(&self) -> u64 {
        status(&self.address).and_then(|status| status["tick"]["count"].as_u64()).unwrap_or(0)
    }
}

/// One fault on the line several times, and what was shown and stored while it lasted.
fn repeat(how: &'static str, fault: Fault, count: usize, lasts: &[Duration]) -> Row {
    let mut row = Row::new(how);
    let polled = Polled::start();
    let mut times = Vec::new();
    for step in 0..count {
        let lasts = lasts[step % lasts.len()];
        let (began, ticks) = (Instant::now(), polled.ticks());
        polled.line.set(fault);
        while began.elapsed() < lasts {
            let shown = polled.has_value();
            row.must(
                !shown || began.elapsed() < FRESH,
                format!("a value is shown {:?} after the line had gone", began.elapsed()),
            );
            std::thread::sleep(Duration::from_millis(50));
        }
        let ticked = polled.ticks() - ticks;
        row.must(ticked as f64 > lasts.as_secs_f64() * 5.0, format!("{ticked} ticks in {lasts:?}"));
        // Hung connections are not taken up again; what was in them is lost with them.
        polled.line.set(if fault == Fault::Hang { Fault::Cut } else { fault });
        let over = Instant::now();
        polled.line.set(Fault::None);
        wait_for("values again", Duration::from_secs(60), || polled.has_value().then_some(()));
        times.push(over.elapsed());
        std::thread::sleep(Duration::from_millis(500));
        row.n += 1;
    }
    times.sort_unstable();
    row.recovers = times.last().copied();
    row.note = format!("recovers, median: {:.1} s", times[times.len() / 2].as_secs_f64());
    let database = polled.directory.path().join("data/history.db");
    let said = polled.gateway.stop();
    row.must(!said.contains("panicked"), "a thread panicked");
    (row.lost, row.wrong) = (Some(0), Some(wrong(&database, &mut row)));
    row
}

/// Stored values that the served machine cannot have had, which stands in its automatic mode with its dial at 100 %.
fn wrong(database: &Path, row: &mut Row) -> u64 {
    let sql = "SELECT count(*) AS n, coalesce(sum(feed_override_pct <> 100 OR spindle_speed_rpm NOT BETWEEN -1 AND 6000), 0) AS wrong FROM samples \
               WHERE feed_override_pct IS NOT NULL";
    let document = queried(database, sql);
    let (count, wrong) = (&document[0]["n"], &document[0]["wrong"]);
    row.must(count.as_u64() > Some(10), format!("{count} rows with values"));
    row.must(wrong == 0, format!("{wrong} of {count} rows are none of the machine's"));
    wrong.as_u64().unwrap_or(0)
}

pub(crate) fn cut(scale: &Scale) -> Row {
    let lasts = [Duration::from_secs(1), Duration::from_secs(5), Duration::from_millis(200)];
    repeat(
        "connections to a served FANUC cut for 0.2 to 5 s; shown and stored values, ticks",
        Fault::Cut,
        scale.of(30, 3),
        &lasts,
    )
}

pub(crate) fn hangs(scale: &Scale) -> Row {
    let lasts = [1, 10, 60].map(Duration::from_secs);
    repeat("nothing passes for 1, 10, 60 s while the connections stay", Fault::Hang, scale.of(6, 2), &lasts)
}

pub(crate) fn garbage(scale: &Scale) -> Row {
    let lasts = [Duration::from_secs(4)];
    repeat("answers replaced by random bytes for 4 s", Fault::Garbage, scale.of(20, 3), &lasts)
}
