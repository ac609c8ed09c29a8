//! The outbox without a network: nothing lost, nothing twice, bounded, live before old.

use crate::outputs::fake_sink::{FakeSink, Seen};
use adapters::{ChannelId, Sample, Slot, Value};
use gateway::history::{
    Content, Event, ExtraSeries, ExtraValue, Gap, Item, Options, Outbox, OutboxReader, OutboxSettings, Writer,
};
use gateway::sinks::{Board, Sinks, drive};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const TICK_NS: i64 = 100_000_000;
const BEGIN_NS: i64 = 1_700_000_000_000_000_000;

/// A history that is written, with an outbox for one sink named `plant`.
struct Stand {
    directory: tempfile::TempDir,
    writer: Option<Writer>,
    outbox: Outbox,
    ticks: i64,
}

fn settings() -> OutboxSettings {
    OutboxSettings { refresh: Duration::from_secs(3600), ..OutboxSettings::default() }
}

impl Stand {
    fn new(settings: OutboxSettings) -> Self {
        let outbox = Outbox::new("lathe 1", settings, ["plant".to_owned()]);
        let mut stand = Self { directory: tempfile::tempdir().expect("a directory"), writer: None, outbox, ticks: 0 };
        stand.open();
        stand
    }

    fn path(&self) -> PathBuf {
        self.directory.path().join("history.db")
    }

    fn open(&mut self) {
        let extras = vec![ExtraSeries::new_text("machine_state", "state", "状态")];
        let group_commit = Duration::from_millis(50);
        let outbox = Some(self.outbox.clone());
        let options = Options { extras, group_commit, outbox, ..Options::default() };
        self.writer = Some(Writer::open(&self.path(), options).expect("opens"));
    }

    /// Every tick has another power; every tenth is followed by an event.
    fn write(&mut self, ticks: i64) {
        let writer = self.writer.as_ref().expect("open");
        let power = ChannelId::from_name("spindle_power_w").expect("in the table");
        for tick in self.ticks..self.ticks + ticks {
            let at_ns = BEGIN_NS + tick * TICK_NS;
            let mut sample = Sample::new_empty(at_ns);
            sample.set_slot(power, Slot { value: Ok(Value::Number(tick as f64)), age_ns: 0 });
            writer.queue_sample(&sample, &[ExtraValue::Text("cutting")]);
            if tick % 10 == 9 {
                writer.queue_record(Event { at_ns, kind: "test".to_owned(), ..Event::default() });
            }
        }
        self.ticks += ticks;
        writer.flush().expect("durable");
    }

    fn close(&mut self) {
        if let Some(writer) = self.writer.take() {
            let status = writer.close();
            assert_eq!(status.degraded, None);
        }
    }

    /// The same file, opened by another process later.
    fn reopen(&mut self, settings: OutboxSettings) {
        self.close();
        self.outbox = Outbox::new("lathe 1", settings, ["plant".to_owned()]);
        self.open();
    }

    /// How many items there are by now: ticks and events, the means of minutes, and what a start and an end tell.
    fn items(&self) -> u64 {
        self.outbox.watch_head().borrow().next_sequence - 1
    }

    fn start(&self, sink: FakeSink) -> (Sinks, Board) {
        let board = Board::new(self.outbox.clone(), [("plant".to_owned(), "fake".to_owned())]);
        let path = self.path();
        let sinks = drive::start_with(vec![("plant".to_owned(), Box::new(sink))], &self.outbox, &board, &path);
        (sinks, board)
    }
}

fn fake(seen: &Arc<Mutex<Seen>>) -> FakeSink {
    FakeSink { seen: seen.clone(), batch: 7, takes_history: true }
}

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().expect("threads")
}

fn until(what: &str, mut done: impl FnMut() -> bool) {
    let limit = Instant::now() + Duration::from_secs(20);
    while !done() {
        assert!(Instant::now() < limit, "not within 20 s: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn numbers(seen: &Mutex<Seen>) -> Vec<u64> {
    let mut numbers: Vec<u64> = seen.lock().expect("whole").items.iter().map(|(sequence, _)| *sequence).collect();
    numbers.sort_unstable();
    numbers
}

fn read(path: &Path, from: u64, to: u64) -> Vec<Item> {
    OutboxReader::open(path).expect("a history").read(from, to, usize::MAX).expect("readable").items
}

#[test]
fn items_are_numbered_without_holes_in_the_order_of_time_and_over_restarts() {
    let mut stand = Stand::new(settings());
    stand.write(25);
    let box_id = stand.outbox.box_id();
    assert!(box_id.starts_with("lathe-1-") && box_id.len() == "lathe-1-".len() + 10, "{box_id}");
    stand.reopen(settings());
    assert_eq!(stand.outbox.box_id(), box_id, "the same file is the same box");
    stand.write(25);
    let items = read(&stand.path(), 0, u64::MAX);
    let sequences: Vec<u64> = items.iter().map(|item| item.sequence).collect();
    assert_eq!(sequences, (1..=stand.items()).collect::<Vec<u64>>());
    let live: Vec<&Item> = items.iter().filter(|item| item.is_live()).collect();
    assert!(live.is_sorted_by_key(|item| item.at_ns), "an event follows the tick it belongs to");
    let count = |kind: &str| items.iter().filter(|item| item.kind() == kind).count();
    assert_eq!((count("sample"), count("event")), (50, 5));
    // The end of the first run, and what the second found of the minute, hour and day that were running.
    assert_eq!(count("gap"), 1, "there is no gap of time between the two");
    assert!(
        count("minute") >= 2 && count("hour") >= 2 && count("day") >= 2,
        "{:?}",
        items.iter().map(Item::kind).collect::<Vec<_>>()
    );
}

#[test]
fn every_item_arrives_once_however_the_receiver_comes_and_goes() {
    let (mut stand, seen) = (Stand::new(settings()), Arc::new(Mutex::new(Seen::default())));
    let runtime = runtime();
    let (sinks, board) = runtime.block_on(async { stand.start(fake(&seen)) });
    for round in 0..6 {
        stand.write(40);
        until("all delivered", || numbers(&seen).len() as u64 == stand.items());
        seen.lock().expect("whole").down = true;
        stand.write(30);
        until("the failure is told", || board.list_sinks()[0].failing);
        assert!(board.list_sinks()[0].error.as_ref().is_some_and(|error| error.contains("down")), "round {round}");
        seen.lock().expect("whole").down = false;
    }
    until("all delivered", || numbers(&seen).len() as u64 == stand.items());
    runtime.block_on(sinks.stop());
    assert_eq!(numbers(&seen), (1..=stand.items()).collect::<Vec<u64>>(), "0 lost, 0 twice");
    let status = &board.list_sinks()[0];
    assert_eq!((status.behind_items, status.dropped, status.refused), (0, 0, 0), "{status:?}");
    // What is delivered is not kept: one row is left to number on from.
    std::thread::sleep(Duration::from_secs(5));
    stand.write(1);
    assert!(stand.outbox.figures().bytes < 2_000, "{:?}", stand.outbox.figures());
}

#[test]
fn after_an_outage_live_data_comes_first_and_the_gap_is_history() {
    let (mut stand, seen) = (Stand::new(settings()), Arc::new(Mutex::new(Seen::default())));
    seen.lock().expect("whole").down = true;
    let runtime = runtime();
    let (sinks, _) = runtime.block_on(async { stand.start(fake(&seen)) });
    stand.write(300);
    let outage = stand.items();
    seen.lock().expect("whole").down = false;
    until("history flows", || seen.lock().expect("whole").items.len() > 20);
    stand.write(10);
    until("all delivered", || numbers(&seen).len() as u64 == stand.items());
    runtime.block_on(sinks.stop());
    let items = seen.lock().expect("whole").items.clone();
    assert!(items.iter().all(|(sequence, historical)| (*sequence <= outage) == *historical), "{items:?}");
    let at = |number: u64| items.iter().position(|(sequence, _)| *sequence == number).expect("delivered");
    // The writer commits every 50 ms and a batch is 7 items: the live data overtakes what is left of the gap.
    println!("live item {} came as number {} of {}", outage + 1, at(outage + 1), items.len());
    assert!(numbers(&seen).windows(2).all(|pair| pair[1] == pair[0] + 1), "0 lost, 0 twice");
}

/// The name of a box is made once: a machine that is renamed is the same box, one whose name has no letter is a box of its own.
#[test]
fn a_machine_that_is_renamed_stays_the_same_box() {
    let mut stand = Stand::new(settings());
    stand.write(5);
    let box_id = stand.outbox.box_id();
    stand.close();
    stand.outbox = Outbox::new("车床七号", settings(), ["plant".to_owned()]);
    stand.open();
    assert_eq!((stand.outbox.box_id(), stand.outbox.machine()), (box_id, "车床七号"));
    let other = |name: &str| {
        let directory = tempfile::tempdir().expect("a directory");
        gateway::history::box_id(&directory.path().join("history.db"), name).expect("named")
    };
    let (first, second) = (other("车床一号"), other("车床二号"));
    assert!(first.starts_with("box-") && first != second, "{first} {second}");
}

/// A box that was off, and samples that did not come, leave a gap that says since when and why; the next tick tells everything again.
#[test]
fn a_gap_is_told_with_its_reason() {
    let mut stand = Stand::new(settings());
    stand.write(10);
    stand.ticks += 600;
    stand.write(10);
    stand.close();
    stand.ticks += 3000;
    stand.open();
    stand.write(10);
    let gaps: Vec<(i64, Option<i64>, String)> = read(&stand.path(), 0, u64::MAX)
        .iter()
        .filter_map(|item| match &item.content {
            Content::Gap(Gap { until_ns, reason }) => {
                let tick = |at_ns: i64| (at_ns - BEGIN_NS) / TICK_NS;
                Some((tick(item.at_ns), until_ns.map(tick), reason.to_string()))
            }
            _ => None,
        })
        .collect();
    let expected = [(10, Some(610), "no_samples"), (620, None, "stopped"), (620, Some(3620), "not_running")];
    assert_eq!(gaps, expected.map(|(from, until, reason)| (from, until, reason.to_owned())));
    let after = read(&stand.path(), 0, u64::MAX)
        .into_iter()
        .find(|item| item.at_ns == BEGIN_NS + 3620 * TICK_NS && item.kind() == "sample");
    assert!(
        matches!(after.expect("there").content, Content::Sample(readings) if readings.len() == 2),
        "power and state"
    );
}

#[test]
fn what_was_delivered_is_remembered_over_a_restart() {
    let (mut stand, seen) = (Stand::new(settings()), Arc::new(Mutex::new(Seen::default())));
    let runtime = runtime();
    for _ in 0..3 {
        let (sinks, _) = runtime.block_on(async { stand.start(fake(&seen)) });
        stand.write(50);
        until("all delivered", || numbers(&seen).len() as u64 == stand.items());
        runtime.block_on(sinks.stop());
        stand.write(20);
        stand.reopen(settings());
    }
    // What a start tells are items too; they are durable with the next commit.
    stand.write(0);
    let (sinks, _) = runtime.block_on(async { stand.start(fake(&seen)) });
    until("all delivered", || numbers(&seen).len() as u64 == stand.items());
    runtime.block_on(sinks.stop());
    assert_eq!(numbers(&seen), (1..=stand.items()).collect::<Vec<u64>>(), "0 lost, 0 twice");
}

#[test]
fn an_item_that_nobody_takes_is_left_out_and_counted() {
    let (mut stand, seen) = (Stand::new(settings()), Arc::new(Mutex::new(Seen::default())));
    seen.lock().expect("whole").poison = vec![5, 17];
    let runtime = runtime();
    let (sinks, board) = runtime.block_on(async { stand.start(fake(&seen)) });
    stand.write(40);
    until("the rest is delivered", || numbers(&seen).len() as u64 == stand.items() - 2);
    until("both are counted", || board.list_sinks()[0].refused == 2);
    runtime.block_on(sinks.stop());
    let expected: Vec<u64> = (1..=stand.items()).filter(|number| ![5, 17].contains(number)).collect();
    assert_eq!(numbers(&seen), expected);
    let status = &board.list_sinks()[0];
    assert!(status.refusal.as_ref().is_some_and(|refusal| refusal.contains("too large")), "{status:?}");
    assert_eq!(status.error, None, "nothing is wrong with the receiver");
}

#[test]
fn a_receiver_that_wants_no_history_gets_none() {
    let (mut stand, seen) = (Stand::new(settings()), Arc::new(Mutex::new(Seen::default())));
    stand.write(100);
    let before = stand.items();
    let runtime = runtime();
    let (sinks, board) = runtime.block_on(async { stand.start(FakeSink { takes_history: false, ..fake(&seen) }) });
    until("connected", || board.list_sinks()[0].state == "connected");
    until("the gap is given up", || board.list_sinks()[0].dropped == before);
    stand.write(10);
    until("the new ones", || numbers(&seen).len() as u64 == stand.items() - before);
    runtime.block_on(sinks.stop());
    assert_eq!(numbers(&seen).first(), Some(&(before + 1)));
}

#[test]
fn the_outbox_stays_within_its_bounds_and_tells_what_it_dropped() {
    let bounded = OutboxSettings { max_bytes: 20_000, ..settings() };
    let (mut stand, seen) = (Stand::new(bounded.clone()), Arc::new(Mutex::new(Seen::default())));
    for _ in 0..150 {
        stand.write(20);
    }
    stand.write(1);
    let figures = stand.outbox.figures();
    assert!(figures.bytes <= bounded.max_bytes, "{figures:?}");
    let dropped = stand.outbox.delivery_state("plant").expect("configured").dropped;
    assert!(dropped > 0 && figures.outage_fits_h(&bounded).is_some(), "{dropped} {figures:?}");
    // It is remembered, and what is left arrives.
    stand.reopen(bounded);
    let standing = stand.outbox.delivery_state("plant").expect("configured");
    let (before, dropped, left) = (dropped, standing.dropped, standing.position.count_waiting(stand.items() + 1));
    assert!(dropped >= before, "what the end told has pushed out some more");
    assert_eq!(dropped + left, stand.items());
    let runtime = runtime();
    let (sinks, board) = runtime.block_on(async { stand.start(fake(&seen)) });
    // What the end told stands beyond the bound until the first commit, which may drop some more: every item has arrived or is counted.
    let counted = || stand.outbox.delivery_state("plant").expect("configured").dropped;
    until("what is left", || numbers(&seen).len() as u64 + counted() == stand.items());
    runtime.block_on(sinks.stop());
    let after = board.list_sinks()[0].dropped;
    assert!(after >= dropped && after - dropped <= left, "{after}, {dropped} before the start");
    println!("{dropped} of {} items dropped at 20 kB", stand.items());
}

#[test]
fn what_is_too_old_is_dropped() {
    let aged = OutboxSettings { max_age: Duration::from_secs(10), ..settings() };
    let mut stand = Stand::new(aged);
    (0..20).for_each(|_| stand.write(20));
    let dropped = stand.outbox.delivery_state("plant").expect("configured").dropped;
    let (kept, all) = (stand.items() - dropped, stand.items());
    assert!((110..=160).contains(&kept), "ten seconds are 110 items and what a commit holds: {kept} of {all}");
}
