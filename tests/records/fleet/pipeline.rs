//! Histories that are written here and sent as a box sends them: through the sink `nats://`, the stream and `fleet ingest`.

use crate::fleet::postgres::Postgres;
use adapters::{Absence, ChannelId, Sample, Slot, Value};
use gateway::clock::ClockMark;
use gateway::fleet::parse_cluster;
use gateway::history::{ExtraSeries, ExtraValue, Options, Outbox, OutboxSettings, Writer};
use gateway::machine_path::NamedMachine;
use gateway::nats::Connection;
use gateway::sinks::{Board, Sinks, drive};
use std::time::Duration;
use testkit::nats_cluster::Cluster;
use testkit::process::{run, stderr, stdout, wait_for};

/// One stream and one database.
pub(crate) struct Plant {
    _cluster: Cluster,
    pub(crate) postgres: Postgres,
    /// `nats://127.0.0.1:PORT/cnc`.
    pub(crate) address: String,
}

impl Plant {
    /// `None` where a server is not installed.
    pub(crate) fn start() -> Option<Self> {
        Self::with("")
    }

    /// With these lines in the configuration of the NATS server.
    pub(crate) fn with(lines: &str) -> Option<Self> {
        Some(Self::start_servers(lines, &[])?.with_stream())
    }

    /// With these settings of PostgreSQL.
    pub(crate) fn with_database(settings: &[&str]) -> Option<Self> {
        Some(Self::start_servers("", settings)?.with_stream())
    }

    fn with_stream(self) -> Self {
        let made = run(&["fleet", "stream", &self.address, "--max-gb", "4"]);
        assert!(made.status.success(), "{}", stderr(&made));
        self
    }

    /// Without a stream yet.
    pub(crate) fn without_stream() -> Option<Self> {
        Self::start_servers("", &[])
    }

    fn start_servers(lines: &str, settings: &[&str]) -> Option<Self> {
        let cluster = Cluster::with(1, &format!("{{store}}\n{lines}"))?;
        let postgres = Postgres::with(&[], |_| {}, settings)?;
        let address = format!("{}/cnc", cluster.address());
        Some(Self { _cluster: cluster, postgres, address })
    }

    /// Has a running reader written and acknowledged everything that is in the stream?
    pub(crate) fn has_read_everything(&self) -> bool {
        let (target, _) = parse_cluster(&self.address).expect("an address");
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("threads");
        runtime.block_on(async {
            let mut connection = Connection::open(&target, 0, "test").await.expect("connected");
            // Before the reader has begun there is nobody to ask about.
            let backlog = connection.read_backlog("CNC", "fleet").await;
            backlog.is_ok_and(|backlog| backlog.pending == 0 && backlog.under_way == 0)
        })
    }

    /// Everything that waits goes into the database; gives what was said.
    pub(crate) fn ingest(&self) -> String {
        let done =
            run(&["fleet", "ingest", &self.address, "--max-gb", "4", "--once", "--database", &self.postgres.address()]);
        assert!(done.status.success(), "{}", stderr(&done));
        format!("{}{}", stdout(&done), stderr(&done))
    }
}

/// A history with the machine state beside the channels, and its sink.
pub(crate) struct Recorded {
    pub(crate) directory: tempfile::TempDir,
    pub(crate) writer: Option<Writer>,
    board: Board,
    outbox: Outbox,
    sinks: Option<Sinks>,
    runtime: tokio::runtime::Runtime,
}

impl Recorded {
    /// Of a machine whose ticks are so far apart; begins to send.
    pub(crate) fn start(machine: impl Into<NamedMachine>, tick: Duration, address: &str) -> Self {
        let directory = tempfile::tempdir().expect("a directory");
        Self::again(directory, machine, tick, address)
    }

    /// The same history, opened again, perhaps under another name.
    pub(crate) fn again(
        directory: tempfile::TempDir,
        machine: impl Into<NamedMachine>,
        tick: Duration,
        address: &str,
    ) -> Self {
        Self::with_clock(directory, machine, tick, address, Options::default().clock)
    }

    /// The same, with what is thought of the clock.
    pub(crate) fn with_clock(
        directory: tempfile::TempDir,
        machine: impl Into<NamedMachine>,
        tick: Duration,
        address: &str,
        clock: ClockMark,
    ) -> Self {
        let settings = OutboxSettings { tick, drain: Duration::from_secs(60), ..OutboxSettings::default() };
        let outbox = Outbox::new(machine, settings, ["fleet".to_owned()]);
        let extras = vec![ExtraSeries::new_text("machine_state", "state", "状态")];
        let options = Options {
            extras,
            group_commit: Duration::from_millis(100),
            outbox: Some(outbox.clone()),
            clock,
            when_full: gateway::history::WhenFull::Wait,
            ..Options::default()
        };
        let path = directory.path().join("history.db");
        let writer = Writer::open(&path, options).expect("opens");
        let runtime =
            tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().expect("threads");
        let address = address.parse().expect("an address");
        let sink = gateway::config::SinkConfig {
            name: "fleet".to_owned(),
            address,
            allow_requests: false,
            allow_facts: false,
        };
        let board = Board::new(outbox.clone(), [("fleet".to_owned(), "nats".to_owned())]);
        let (post, _inbox) = gateway::control::create_queues();
        let sinks = runtime.block_on(async { drive::start_sinks(&[sink], &post, (&outbox, &board), &path) });
        Self { directory, writer: Some(writer), board, outbox, sinks: Some(sinks), runtime }
    }

    pub(crate) fn writer(&self) -> &Writer {
        self.writer.as_ref().expect("open")
    }

    /// A tick with these values; `Err` is why there is none.
    pub(crate) fn tick(&self, at_ns: i64, values: &[(ChannelId, Result<f64, Absence>)], state: &str) {
        let mut sample = Sample::new_empty(at_ns);
        for (channel, value) in values {
            let slot = match value {
                Ok(number) => Slot { value: Ok(Value::Number(*number)), age_ns: 0 },
                Err(reason) => Slot::from_absence(*reason),
            };
            sample.set_slot(*channel, slot);
        }
        self.writer().queue_sample(&sample, &[ExtraValue::Text(state)]);
    }

    /// Waits until everything is delivered, and gives what was not taken.
    pub(crate) fn refused(&self) -> u64 {
        self.writer().flush().expect("durable");
        wait_for("everything is delivered", Duration::from_secs(30), || {
            (self.board.list_sinks()[0].behind_items == 0).then_some(())
        });
        self.board.list_sinks()[0].refused
    }

    /// The last item that was not taken, and why.
    pub(crate) fn refusal(&self) -> Option<String> {
        self.board.list_sinks()[0].refusal.clone()
    }

    /// Name of the box, epoch and number of the next item.
    pub(crate) fn identity(&self) -> (String, u64, u64) {
        (self.outbox.box_id(), self.outbox.epoch(), self.outbox.watch_head().borrow().next_sequence)
    }

    /// Ends without a word: nothing more is sent, not even that it ends.
    pub(crate) fn abandon(mut self) {
        self.runtime.block_on(self.sinks.take().expect("running").stop());
    }

    /// Ends as a box does: the last commit waits for the sink.
    pub(crate) fn stop(mut self) -> tempfile::TempDir {
        drop(self.writer.take());
        let left = self.board.list_sinks()[0].behind_items;
        self.runtime.block_on(self.sinks.take().expect("running").stop());
        assert_eq!(left, 0, "everything is delivered at a clean end: {:?}", self.board.list_sinks());
        self.directory
    }
}
