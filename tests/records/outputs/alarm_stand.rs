//! A box that raises alarms, with sinks of alarms: what the tests of webhook and mail share.

use adapters::{ChannelId, Sample, Slot, Value};
use gateway::history::{Alarm, Options, Outbox, OutboxSettings, Writer};
use gateway::sinks::{Board, Requests, SinkAddress, SinkStatus, Sinks, drive, open_sink};
use std::path::{Path, PathBuf};
use std::time::Duration;
use testkit::process::wait_for;
use tokio::runtime::Runtime;

const BEGIN_NS: i64 = 1_700_000_000_000_000_000;
/// On a machine that does other things.
pub(super) const PATIENCE: Duration = Duration::from_secs(60);

/// The box.
pub(super) struct Stand {
    directory: tempfile::TempDir,
    names: Vec<String>,
    addresses: Vec<SinkAddress>,
    runtime: Runtime,
    running: Option<Running>,
    alarms: i64,
}

struct Running {
    writer: Writer,
    board: Board,
    sinks: Sinks,
}

impl Stand {
    /// A box with sinks of these names and addresses, which runs.
    pub(super) fn start(directory: tempfile::TempDir, sinks: &[(&str, String)]) -> Self {
        let names = sinks.iter().map(|(name, _)| (*name).to_owned()).collect();
        let addresses = sinks.iter().map(|(_, address)| address.parse().expect("an address")).collect();
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build();
        let mut stand =
            Self { directory, names, addresses, runtime: runtime.expect("threads"), running: None, alarms: 0 };
        stand.run();
        stand
    }

    fn history(&self) -> PathBuf {
        self.directory.path().join("history.db")
    }

    fn run(&mut self) {
        let outbox = Outbox::new("lathe 1", OutboxSettings::default(), self.names.clone());
        let options =
            Options { group_commit: Duration::from_millis(50), outbox: Some(outbox.clone()), ..Options::default() };
        let path = self.history();
        let writer = Writer::open(&path, options).expect("opens");
        let named = self.names.iter().cloned().zip(self.addresses.iter().map(ToString::to_string));
        let board = Board::new(outbox.clone(), named);
        let open = |(name, address): (&String, &SinkAddress)| {
            (name.clone(), open_sink(address, (name, Requests::without_gate()), &outbox, Path::new("")))
        };
        let opened = self.names.iter().zip(&self.addresses).map(open).collect();
        let sinks = self.runtime.block_on(async { drive::start_with(opened, &outbox, &board, &path) });
        self.running = Some(Running { writer, board, sinks });
    }

    /// Stops the box and starts it again, with an address that is another now.
    pub(super) fn restart_with(&mut self, index: usize, address: &str) {
        self.stop();
        self.addresses[index] = address.parse().expect("an address");
        self.run();
    }

    /// Stops the box.
    pub(super) fn stop(&mut self) {
        let running = self.running.take().expect("it runs");
        self.runtime.block_on(running.sinks.stop());
        let _figures = running.writer.close();
    }

    /// So many alarms of this severity, each between samples.
    pub(super) fn raise(&mut self, count: i64, severity: &str) {
        let power = ChannelId::from_name("spindle_power_w").expect("in the table");
        let writer = &self.running.as_ref().expect("it runs").writer;
        for _ in 0..count {
            let at_ns = BEGIN_NS + self.alarms * 1_000_000_000;
            let mut sample = Sample::new_empty(at_ns);
            sample.set_slot(power, Slot { value: Ok(Value::Number(self.alarms as f64)), age_ns: 0 });
            writer.queue_sample(&sample, &[]);
            let (code, source) = (format!("{severity}_{}", self.alarms), "test".to_owned());
            let (en, zh) = ("the tool is worn".to_owned(), "刀具磨损".to_owned());
            writer.queue_record(Alarm { at_ns, code, source, severity: severity.to_owned(), en, zh });
            self.alarms += 1;
            if self.alarms % 7 == 0 {
                writer.flush().expect("durable");
            }
        }
        writer.flush().expect("durable");
    }

    fn board(&self) -> &Board {
        &self.running.as_ref().expect("it runs").board
    }

    /// How the sink of this number is doing.
    pub(super) fn status(&self, index: usize) -> SinkStatus {
        self.board().list_sinks().swap_remove(index)
    }

    /// What is told of the sinks.
    pub(super) fn problems(&self) -> Vec<String> {
        self.board().list_problems().into_iter().map(|problem| format!("{}; {}", problem.what, problem.next)).collect()
    }

    /// Until the sink has told that it fails.
    pub(super) fn wait_failing(&self, index: usize) {
        wait_for("the failure is told", PATIENCE, || self.status(index).failing.then_some(()));
    }

    /// Until so many items wait for the sink.
    pub(super) fn wait_behind(&self, index: usize, items: u64) {
        wait_for("what is to wait waits", PATIENCE, || (self.status(index).behind_items == items).then_some(()));
    }
}

/// Keys of an address with hours that are quiet now: from the hour before to the hour after this one.
pub(super) fn quiet_now() -> String {
    let now_s = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970").as_secs();
    let hour = (now_s / 3600) % 24;
    format!("quiet={:02}:00-{:02}:00&zone=UTC", (hour + 23) % 24, (hour + 2) % 24)
}

/// How long the receiver is away: shortly, or as long as `RECEIVER_DOWN_S` says.
pub(super) fn down() -> Duration {
    let given = std::env::var("RECEIVER_DOWN_S").ok().and_then(|text| text.parse().ok());
    Duration::from_secs(given.unwrap_or(600))
}
