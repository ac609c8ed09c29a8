//! Memory, descriptors, threads and the files of boxes that run long: hours of a machine that passes quickly, and minutes of a box at the
//! pace of a machine with many readers. Looked at from outside, in `/proc`.

use crate::kills::status;
use crate::table::{Row, Scale};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use testkit::box_under_test::Sending;
use testkit::broker::Broker;
use testkit::process::{get, wait_for};
use testkit::process_status::status_figure;

/// Machine hours that pass in the time of one: 72 h in 20 minutes.
const PACE: &str = "216";
const HOURS: f64 = 72.0;
const TICKS_PER_H: f64 = 36_000.0;
/// How often the figures are taken. Of these the second quarter is held against the last: the first fills caches.
const LOOKS: usize = 24;
/// What memory may grow by from the second quarter to the last, MB. A leak of one small allocation per tick is 100 MB in 72 h; the allocator
/// keeps what a day's housekeeping has touched.
const MEMORY_MB: f64 = 24.0;
/// Connections come and go between two looks.
const DESCRIPTORS: f64 = 8.0;
/// Bytes per tick of the file over the second half of some hours. A lathe that cuts takes 21 (chapter `measured`).
const FILE_BYTES_PER_TICK: f64 = 30.0;
/// In less time the file is mostly what it begins with.
const FILE_TICKS: f64 = 4.0 * TICKS_PER_H;

/// What a process holds, as `/proc` tells it.
#[derive(Debug, Clone, Copy)]
struct Held {
    ticks: f64,
    memory_mb: f64,
    descriptors: f64,
    threads: f64,
    file_mb: f64,
    log_mb: f64,
}

impl Held {
    fn by(sending: &Sending, address: &str) -> Option<Self> {
        let pid = sending.gateway.as_ref()?.pid();
        let number = |name: &str| status_figure(&pid.to_string(), name);
        let database = sending.database();
        let size_mb = |path: &Path| std::fs::metadata(path).map_or(0.0, |file| file.len() as f64 / 1e6);
        Some(Self {
            ticks: status(address)?["tick"]["count"].as_f64()?,
            memory_mb: number("VmRSS:")? / 1000.0,
            descriptors: std::fs::read_dir(format!("/proc/{pid}/fd")).ok()?.count() as f64,
            threads: number("Threads:")?,
            file_mb: size_mb(&database),
            log_mb: size_mb(&database.with_file_name("history.db-wal")),
        })
    }
}

/// The second quarter against the last, and the halves of the file.
fn judge(name: &str, held: &[Held], row: &mut Row) {
    let quarter = held.len() / 4;
    let most = |looks: &[Held], of: fn(&Held) -> f64| looks.iter().map(of).fold(0.0, f64::max);
    let (early, late) = (&held[quarter..2 * quarter], &held[held.len() - quarter..]);
    let grown = |of: fn(&Held) -> f64| most(late, of) - most(early, of);
    let (memory, descriptors, threads) =
        (grown(|held| held.memory_mb), grown(|held| held.descriptors), grown(|held| held.threads));
    row.must(memory <= MEMORY_MB, format!("{name}: memory grew by {memory:.1} MB"));
    row.must(descriptors <= DESCRIPTORS, format!("{name}: {descriptors} more descriptors"));
    row.must(threads <= DESCRIPTORS, format!("{name}: {threads} more threads"));
    let (first, middle, last) = (held[0], held[held.len() / 2], held[held.len() - 1]);
    let per_tick = |from: Held, to: Held| 1e6 * (to.file_mb - from.file_mb) / (to.ticks - from.ticks).max(1.0);
    let (before, after) = (per_tick(first, middle), per_tick(middle, last));
    let too_large = last.ticks - middle.ticks >= FILE_TICKS && after > FILE_BYTES_PER_TICK;
    row.must(!too_large, format!("{name}: {before:.1} and then {after:.1} bytes per tick"));
    row.note += &format!(
        "{}{name}: {:.1} h of ticks; memory {:.0} MB early, {:.0} MB late; descriptors {:.0}, {:.0}; threads {:.0}, {:.0}; file {:.1} MB, {before:.1} and then {after:.1} B per tick; log at most {:.1} MB",
        if row.note.is_empty() { "" } else { "; " },
        last.ticks / TICKS_PER_H,
        most(early, |held| held.memory_mb),
        most(late, |held| held.memory_mb),
        most(early, |held| held.descriptors),
        most(late, |held| held.descriptors),
        most(early, |held| held.threads),
        most(late, |held| held.threads),
        last.file_mb,
        most(held, |held| held.log_mb),
    );
}

/// Readers of the page as a shop has them: streams of live values that are left open and begun again, and questions.
fn read_page(address: &str, stop: &Arc<AtomicBool>, answers: &Arc<AtomicU64>) -> Vec<JoinHandle<()>> {
    let begin = |reader: u32| {
        let (address, stop, answers) = (address.to_owned(), stop.clone(), answers.clone());
        std::thread::spawn(move || {
            while !stop.load(Ordering::SeqCst) {
                if reader.is_multiple_of(3) {
                    read_stream(&address, &stop);
                } else {
                    let path = ["/", "/api/v1/status", "/metrics", "/api/v1/events"][reader as usize % 4];
                    // 503: the box is asked for more at once than it answers, and says so.
                    let answer = get(&address, path).status;
                    assert!([200, 503].contains(&answer), "{path}: {answer}");
                    answers.fetch_add(u64::from(answer == 200), Ordering::SeqCst);
                    std::thread::sleep(Duration::from_millis(200));
                }
            }
        })
    };
    (0..12).map(begin).collect()
}

/// Ten seconds of a stream of live values, then the reader goes without a word.
fn read_stream(address: &str, stop: &AtomicBool) {
    let Ok(mut stream) = TcpStream::connect(address) else { return };
    let _short = stream.set_read_timeout(Some(Duration::from_millis(500)));
    let _sent = write!(stream, "GET /api/v1/live HTTP/1.1\r\nHost: {address}\r\nAccept: text/event-stream\r\n\r\n");
    let (until, mut buffer) = (Instant::now() + Duration::from_secs(10), [0; 4096]);
    while Instant::now() < until && !stop.load(Ordering::SeqCst) {
        let _some = stream.read(&mut buffer);
    }
}

/// 72 hours of a machine with a sink, and beside it a box at the pace of its machine with many readers for as long.
pub(crate) fn long_runs(scale: &Scale) -> Row {
    let mut row = Row::new(
        "72 h of a lathe at 216 times its pace with a sink, and beside it a box at the pace of its machine with 12 readers; /proc and files",
    );
    let Some(broker) = Broker::with("allow_anonymous true\nmax_queued_messages 0\n", |_| {}) else {
        return Row::skipped(row.how);
    };
    let address = |name: &str| format!("mqtt://127.0.0.1:{}/works/{name}", broker.port);
    let mut quick = Sending::at_speed(PACE, &address("quick"), "");
    let mut read = Sending::at_speed("1", &address("read"), "");
    let (stop, answers) = (Arc::<AtomicBool>::default(), Arc::<AtomicU64>::default());
    let readers = read_page(read.page(), &stop, &answers);
    let time = scale.time(Duration::from_secs(1200), Duration::from_secs(60));
    let due_ticks = HOURS * TICKS_PER_H * time.as_secs_f64() / 1200.0;
    let (began, mut of_quick, mut of_read) = (Instant::now(), Vec::new(), Vec::new());
    for look in 1..=LOOKS {
        // A computer that is too slow for the pace takes longer; twice as long is too long.
        let due = due_ticks * look as f64 / LOOKS as f64;
        let quick_page = quick.page().to_owned();
        wait_for("hours of the machine", 2 * time, || {
            status(&quick_page)?["tick"]["count"].as_f64().filter(|count| *count >= due)
        });
        std::thread::sleep((time * look as u32 / LOOKS as u32).saturating_sub(began.elapsed()));
        of_quick.extend(Held::by(&quick, &quick_page));
        of_read.extend(Held::by(&read, read.page()));
    }
    stop.store(true, Ordering::SeqCst);
    let ended = readers.into_iter().filter_map(|reader| reader.join().err()).count();
    row.must(ended == 0, format!("{ended} of 12 readers got something else than an answer"));
    row.n = LOOKS;
    row.must(of_quick.len() == LOOKS && of_read.len() == LOOKS, "a box did not answer");
    judge("quick", &of_quick, &mut row);
    judge("read", &of_read, &mut row);
    let answers = answers.load(Ordering::SeqCst);
    row.must(answers > 0, "no page was answered");
    row.note += &format!("; {answers} answers in {:.0} s", began.elapsed().as_secs_f64());
    let sink = quick.sink();
    row.must(sink["dropped"] == 0 && sink["refused"] == 0, format!("{sink}"));
    quick.stop();
    read.stop();
    row
}
