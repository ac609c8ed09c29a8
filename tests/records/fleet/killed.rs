//! Nothing lost and nothing twice while the leader of the stream, the reader, the box and the database are killed.
//!
//! `FLEET_ROWS=20000 FLEET_KILLS=2 cargo test --test records fleet::killed -- --nocapture`

use crate::fleet::postgres::Postgres;
use std::time::{Duration, Instant};
use testkit::box_under_test::Sending;
use testkit::nats_cluster::Cluster;
use testkit::process::{Gateway, program, run, stderr, stdout, wait_for};

const PATIENCE: Duration = Duration::from_secs(240);

fn setting(name: &str, usual: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

/// A reader from the stream into the database.
pub(crate) fn ingest(address: &str, database: &str) -> Gateway {
    let mut command = program();
    command.args(["fleet", "ingest", address, "--database", database, "--replicas", "3", "--max-gb", "1"]);
    Gateway::spawn(command)
}

/// Rows in the database; 0 while it is away.
fn count(postgres: &Postgres) -> u64 {
    postgres.number("SELECT count(*) FROM items")
}

/// Everything between a machine and the tables.
struct Plant {
    cluster: Cluster,
    postgres: Postgres,
    readers: Vec<Gateway>,
    sending: Sending,
}

impl Plant {
    /// Kills one after the other, and starts it again. Gives what it was.
    fn kill(&mut self, number: u64) -> String {
        let away = Duration::from_secs(2);
        match number % 4 {
            0 => {
                let (leader, _) = wait_for("a leader", PATIENCE, || self.cluster.stream());
                self.cluster.kill(leader);
                std::thread::sleep(away);
                self.cluster.run(leader);
                format!("leader n{leader}")
            }
            1 => {
                self.readers.remove(0).kill();
                self.readers.push(ingest(&format!("{}/cnc", self.cluster.address()), &self.postgres.address()));
                "a reader".to_owned()
            }
            2 => {
                self.sending.kill();
                self.sending.start();
                "the box".to_owned()
            }
            _ => {
                self.postgres.crash();
                std::thread::sleep(away);
                self.postgres.run();
                "the database".to_owned()
            }
        }
    }
}

#[test]
fn every_row_is_there_once_although_leader_reader_box_and_database_are_killed() {
    let Some(cluster) = Cluster::start(3) else { return };
    let Some(postgres) = Postgres::start() else { return };
    let (rows, kills) = (setting("FLEET_ROWS", 2500), setting("FLEET_KILLS", 1));
    let address = format!("{}/cnc", cluster.address());
    wait_for("the stream", PATIENCE, || {
        let made = run(&["fleet", "stream", &address, "--replicas", "3", "--max-gb", "1"]);
        made.status.success().then_some(()).or_else(|| {
            eprintln!("{}", stderr(&made));
            None
        })
    });
    let readers = vec![ingest(&address, &postgres.address()), ingest(&address, &postgres.address())];
    let began = Instant::now();
    let sending = Sending::at_speed("40", &address, "");
    let mut plant = Plant { cluster, postgres, readers, sending };
    for kill in 0..4 * kills {
        let due = rows * (kill + 1) / (4 * kills + 1);
        wait_for(&format!("{due} rows before kill {kill}"), PATIENCE, || (count(&plant.postgres) >= due).then_some(()));
        let what = plant.kill(kill);
        println!("{:.1} s: {what} killed at {due} rows", began.elapsed().as_secs_f64());
    }
    let Plant { cluster, postgres, mut sending, .. } = plant;
    wait_for(&format!("{rows} rows"), PATIENCE, || (count(&postgres) >= rows).then_some(()));
    sending.wait_sink("the gap is closed", |sink| sink["behind_items"].as_u64() < Some(100));
    let sink = sending.sink();
    sending.stop();
    // What is left: the reader takes it, and ends when nothing waits.
    let rest = run(&["fleet", "ingest", &address, "--database", &postgres.address(), "--once"]);
    assert!(rest.status.success(), "{}", stderr(&rest));
    let highest = postgres.number("SELECT max(sequence) FROM items");
    let (there, different) = (count(&postgres), postgres.number("SELECT count(DISTINCT sequence) FROM items"));
    let missing = postgres.sql(
        "SELECT number FROM generate_series(1, (SELECT max(sequence) FROM items)) number
         WHERE NOT EXISTS (SELECT 1 FROM items WHERE sequence = number) LIMIT 20",
    );
    let stored = cluster.stream().map(|(_, messages)| messages);
    println!(
        "{there} rows in {:.0} s, numbers 1 to {highest}: {} lost, {} twice; {stored:?} messages in the stream; dropped {}, \
         refused {}; rest: {}",
        began.elapsed().as_secs_f64(),
        highest - different,
        there - different,
        sink["dropped"],
        sink["refused"],
        stdout(&rest).trim()
    );
    assert_eq!((there, different), (highest, highest), "missing: {missing}");
    assert!(highest >= rows && sink["dropped"] == 0 && sink["refused"] == 0, "{sink}");
    assert_eq!(postgres.number("SELECT count(*) FROM refused"), 0);
    assert_eq!(postgres.sql("SELECT box_id, machine FROM boxes"), "1|Lathe 7");
    values_are_those_of_the_history(&sending, &postgres);
}

fn values_are_those_of_the_history(sending: &Sending, postgres: &Postgres) {
    let select = "SELECT floor(extract(epoch FROM valid_from) * 1000)::bigint, number FROM readings WHERE name = 'spindle_power_w' AND number IS NOT NULL";
    let stored = sending.queried("spindle_power_w");
    let mut compared = 0;
    for line in postgres.sql(select).lines() {
        let (at_ms, number) = line.split_once('|').expect("two columns");
        let at_ms: i64 = at_ms.parse().expect("a time");
        let number: f64 = number.parse().expect("a number");
        assert_eq!(stored["spindle_power_w"].get(&at_ms).and_then(serde_json::Value::as_f64), Some(number), "{line}");
        compared += 1;
    }
    println!("{compared} powers equal to `history query`");
    assert!(compared > 100);
}
