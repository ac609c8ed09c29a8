//! Databases that are ended and started again. Truth: the numbers of the rows in PostgreSQL.

use crate::box_under_test::Sending;
use crate::cluster::Cluster;
use crate::partners::{PATIENCE, caught_up};
use crate::postgres::Postgres;
use crate::process::{Gateway, program, run, stderr, wait_for};
use crate::table::{Row, Scale};
use std::time::{Duration, Instant};

/// Truth in a database: every row once.
struct Database {
    cluster: Cluster,
    postgres: Postgres,
    readers: Vec<Gateway>,
    sending: Sending,
    address: String,
}

impl Database {
    fn start(servers: usize) -> Option<Self> {
        let (cluster, postgres) = (Cluster::start(servers)?, Postgres::start()?);
        let (address, replicas) = (format!("{}/cnc", cluster.address()), servers.to_string());
        let settings = ["--replicas", &replicas, "--max-gb", "1"];
        wait_for("the stream", PATIENCE, || {
            let made = run(&[&["fleet", "stream", &address][..], &settings].concat());
            made.status.success().then_some(())
        });
        let ingest = || {
            let mut command = program();
            command.args(["fleet", "ingest", &address, "--database", &postgres.address()]).args(settings);
            Gateway::spawn(command)
        };
        let readers = vec![ingest(), ingest()];
        let sending = Sending::fast(&address);
        Some(Self { cluster, postgres, readers, sending, address })
    }

    fn count(&self) -> u64 {
        self.postgres.number("SELECT count(*) FROM items")
    }

    fn wait_rows(&self, count: u64) {
        let due = self.count() + count;
        wait_for("rows", PATIENCE, || (self.count() >= due).then_some(()));
    }

    fn into_row(mut self, row: &mut Row) {
        caught_up(&self.sending);
        let sink = self.sending.sink();
        self.sending.stop();
        self.readers.clear();
        let rest = run(&["fleet", "ingest", &self.address, "--database", &self.postgres.address(), "--once"]);
        row.must(rest.status.success(), stderr(&rest));
        let highest = self.postgres.number("SELECT max(sequence) FROM items");
        let (there, different) = (self.count(), self.postgres.number("SELECT count(DISTINCT sequence) FROM items"));
        let stored = self.cluster.stream().map_or(0, |(_, messages)| messages);
        row.lost = Some(highest - different);
        row.repeated = Some((stored.saturating_sub(highest), there - different));
        row.must(highest == different, format!("{} rows are missing", highest - different));
        row.must(there == different, format!("{} rows are there twice", there - different));
        row.must(sink["dropped"] == 0 && sink["refused"] == 0, sink.to_string());
        row.note = format!("{there} rows in PostgreSQL");
    }
}

pub(crate) fn nats_restarts(scale: &Scale) -> Row {
    let mut row =
        Row::new("the leader of three NATS servers killed and started again; numbers of the rows in PostgreSQL");
    let Some(mut database) = Database::start(3) else { return Row::skipped(row.how) };
    for _ in 0..scale.of(20, 1) {
        database.wait_rows(100);
        let (leader, _) = wait_for("a leader", PATIENCE, || database.cluster.stream());
        database.cluster.kill(leader);
        std::thread::sleep(Duration::from_secs(1));
        let began = Instant::now();
        database.cluster.run(leader);
        database.wait_rows(50);
        row.recovered(began.elapsed());
        row.n += 1;
    }
    database.into_row(&mut row);
    row
}

pub(crate) fn postgres_restarts(scale: &Scale) -> Row {
    let mut row = Row::new("PostgreSQL ended at once (SIGQUIT) and started again; numbers of its rows");
    let Some(mut database) = Database::start(1) else { return Row::skipped(row.how) };
    for _ in 0..scale.of(20, 1) {
        database.wait_rows(100);
        database.postgres.kill();
        std::thread::sleep(Duration::from_secs(1));
        let began = Instant::now();
        database.postgres.run();
        database.wait_rows(50);
        row.recovered(began.elapsed());
        row.n += 1;
    }
    database.into_row(&mut row);
    row
}
