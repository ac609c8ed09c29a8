//! Alarms to a webhook: each once, signed, over a receiver that is away, refuses, and takes without an answer.

use adapters::{ChannelId, Sample, Slot, Value};
use gateway::history::{Alarm, Options, Outbox, OutboxSettings, Writer};
use gateway::sinks::{Board, Requests, SinkAddress, drive, open_sink};
use serde_json::Value as Json;
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use testkit::port::free_port;
use testkit::process::wait_for;

const SECRET: &str = "9f86d081884c7d659a2feaa0c55ad015";
const BEGIN_NS: i64 = 1_700_000_000_000_000_000;
const PATIENCE: Duration = Duration::from_secs(60);

/// A request as it came.
#[derive(Debug, Clone)]
struct Posted {
    line: String,
    headers: BTreeMap<String, String>,
    body: Vec<u8>,
}

/// What the receiver does with the next requests, the first one first; after the last it takes everything.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Behaviour {
    Refuses(u16),
    TakesAndHangsUp,
}

#[derive(Debug, Default)]
struct Seen {
    taken: Vec<Posted>,
    refused: usize,
    next: Vec<Behaviour>,
}

/// An HTTP server of the test, at a port that nobody listens at before [`Receiver::listen`].
struct Receiver {
    port: u16,
    seen: Arc<Mutex<Seen>>,
}

impl Receiver {
    fn listen(&self) {
        let listener = TcpListener::bind(("127.0.0.1", self.port)).expect("the port is free");
        let seen = self.seen.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming().map_while(Result::ok) {
                let seen = seen.clone();
                std::thread::spawn(move || serve(&stream, &seen));
            }
        });
    }

    fn taken(&self) -> Vec<Posted> {
        self.seen.lock().expect("whole").taken.clone()
    }
}

/// Reads requests and answers them until the connection ends.
fn serve(stream: &TcpStream, seen: &Mutex<Seen>) {
    let mut reader = BufReader::new(stream.try_clone().expect("a second handle"));
    while let Some(posted) = read_request(&mut reader) {
        let mut seen = seen.lock().expect("whole");
        let behaviour = if seen.next.is_empty() { None } else { Some(seen.next.remove(0)) };
        let status = match behaviour {
            Some(Behaviour::Refuses(status)) => {
                seen.refused += 1;
                status
            }
            Some(Behaviour::TakesAndHangsUp) => return seen.taken.push(posted),
            None => {
                seen.taken.push(posted);
                202
            }
        };
        drop(seen);
        let answer = format!("HTTP/1.1 {status} Told\r\nContent-Length: 2\r\n\r\nok");
        if (&*stream).write_all(answer.as_bytes()).is_err() {
            return;
        }
    }
}

fn read_request(reader: &mut impl BufRead) -> Option<Posted> {
    let mut line = String::new();
    reader.read_line(&mut line).ok().filter(|count| *count > 0)?;
    let mut headers = BTreeMap::new();
    loop {
        let mut header = String::new();
        reader.read_line(&mut header).ok()?;
        let Some((name, value)) = header.trim().split_once(':') else { break };
        headers.insert(name.to_lowercase(), value.trim().to_owned());
    }
    let mut body = vec![0; headers.get("content-length")?.parse().ok()?];
    reader.read_exact(&mut body).ok()?;
    Some(Posted { line: line.trim().to_owned(), headers, body })
}

/// HMAC-SHA256 as RFC 2104 writes it, for a key of less than 64 bytes.
fn sign(body: &[u8]) -> String {
    let pad = |with: u8| {
        let mut key = [0_u8; 64];
        key[..SECRET.len()].copy_from_slice(SECRET.as_bytes());
        key.map(|byte| byte ^ with)
    };
    let inner = Sha256::new().chain_update(pad(0x36)).chain_update(body).finalize();
    let outer = Sha256::new().chain_update(pad(0x5c)).chain_update(inner).finalize();
    outer.iter().map(|byte| format!("{byte:02x}")).collect()
}

struct Stand {
    writer: Writer,
    alarms: i64,
}

impl Stand {
    /// So many alarms of this severity, each between samples.
    fn raise(&mut self, count: i64, severity: &str) {
        let power = ChannelId::from_name("spindle_power_w").expect("in the table");
        for _ in 0..count {
            let at_ns = BEGIN_NS + self.alarms * 1_000_000_000;
            let mut sample = Sample::new_empty(at_ns);
            sample.set_slot(power, Slot { value: Ok(Value::Number(self.alarms as f64)), age_ns: 0 });
            self.writer.queue_sample(&sample, &[]);
            let (code, source) = (format!("{severity}_{}", self.alarms), "test".to_owned());
            let (en, zh) = ("the tool is worn".to_owned(), "刀具磨损".to_owned());
            self.writer.queue_record(Alarm { at_ns, code, source, severity: severity.to_owned(), en, zh });
            self.alarms += 1;
            if self.alarms % 7 == 0 {
                self.writer.flush().expect("durable");
            }
        }
        self.writer.flush().expect("durable");
    }
}

/// An address with hours that are quiet now: from the hour before to the hour after this one.
fn quiet_now() -> String {
    let now_s = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970").as_secs();
    let hour = (now_s / 3600) % 24;
    format!("quiet={:02}:00-{:02}:00&zone=UTC", (hour + 23) % 24, (hour + 2) % 24)
}

#[test]
fn two_hundred_alarms_arrive_each_once_over_a_receiver_that_fails_in_every_way() {
    let directory = tempfile::tempdir().expect("a directory");
    let (path, secret) = (directory.path().join("history.db"), directory.path().join("secret"));
    std::fs::write(&secret, format!("{SECRET}\n")).expect("writable");
    let names = ["hook", "night"].map(str::to_owned);
    let outbox = Outbox::new("lathe 1", OutboxSettings::default(), names.clone());
    let options =
        Options { group_commit: Duration::from_millis(50), outbox: Some(outbox.clone()), ..Options::default() };
    let mut stand = Stand { writer: Writer::open(&path, options).expect("opens"), alarms: 0 };
    let receiver = Receiver { port: free_port(), seen: Arc::default() };
    let night = Receiver { port: free_port(), seen: Arc::default() };
    night.listen();
    let address = |receiver: &Receiver, more: &str| -> SinkAddress {
        let text = format!("webhook://127.0.0.1:{}/cnc/alarms?secret_file={}&{more}", receiver.port, secret.display());
        text.parse().expect("an address")
    };
    let addresses = [address(&receiver, "severity=warning"), address(&night, &quiet_now())];
    let board = Board::new(outbox.clone(), names.iter().cloned().zip(addresses.iter().map(ToString::to_string)));
    let open = |(name, address): (&String, &SinkAddress)| {
        (name.clone(), open_sink(address, (name, Requests::without_gate()), &outbox, Path::new("")))
    };
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().expect("threads");
    let sinks = names.iter().zip(&addresses).map(open).collect();
    let sinks = runtime.block_on(async { drive::start_with(sinks, &outbox, &board, &path) });
    // Nobody listens.
    stand.raise(100, "warning");
    wait_for("the failure is told", PATIENCE, || board.list_sinks()[0].failing.then_some(()));
    // Then it is there and takes nothing; then it takes and does not say so.
    let refuses = [503, 404].map(Behaviour::Refuses);
    receiver.seen.lock().expect("whole").next = [&refuses[..], &[Behaviour::TakesAndHangsUp]].concat();
    let began = Instant::now();
    receiver.listen();
    stand.raise(20, "info");
    stand.raise(100, "critical");
    let keys = || receiver.taken().iter().map(|it| it.headers["idempotency-key"].clone()).collect::<BTreeSet<_>>();
    wait_for("all have arrived", PATIENCE, || (keys().len() >= 200).then_some(()));
    wait_for("nothing waits", PATIENCE, || (board.list_sinks()[0].behind_items == 0).then_some(()));
    println!("200 alarms {:.1} s after the receiver was there again", began.elapsed().as_secs_f64());
    runtime.block_on(sinks.stop());
    let status = &board.list_sinks();
    assert_eq!((status[0].refused, status[0].dropped), (0, 0), "{:?}", status[0]);
    assert_eq!(receiver.seen.lock().expect("whole").refused, 2);
    each_once(&receiver.taken());
    assert_eq!((night.taken().len(), status[1].delivered), (0, 0), "it is quiet there");
    assert!(status[1].behind_items >= 440 && !status[1].failing, "it waits: {:?}", status[1]);
}

fn each_once(taken: &[Posted]) {
    let mut codes: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for posted in taken {
        assert_eq!(posted.line, "POST /cnc/alarms HTTP/1.1");
        assert_eq!(posted.headers["x-signature-256"], format!("sha256={}", sign(&posted.body)));
        let document: Json = serde_json::from_slice(&posted.body).expect("JSON");
        assert_eq!((&document["kind"], &document["machine"]), (&Json::from("alarm"), &Json::from("lathe 1")));
        let code = document["record"]["code"].as_str().expect("a code").to_owned();
        codes.entry(code).or_default().insert(posted.headers["idempotency-key"].clone());
    }
    assert_eq!(taken.len(), 201, "the one that was taken without an answer comes again, under its key");
    assert_eq!(codes.len(), 200);
    assert!(codes.keys().all(|code| !code.starts_with("info")), "too little for this receiver");
    assert!(codes.values().all(|keys| keys.len() == 1), "one key for each");
    let keys: BTreeSet<&String> = codes.values().flatten().collect();
    assert_eq!(keys.len(), 200, "and no key for two");
}
