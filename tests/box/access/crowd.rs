//! A crowd of clients that ask for nothing, ask without end, or read nothing: the tick, the orders at the box and the page must
//! not suffer.

use super::client::{Testbed, testbed};
use gateway::control::{Order, Reply, send_order};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use serde_json::Value;
use std::io::Write;
use std::net::{SocketAddr, TcpStream};
use std::thread;
use std::time::{Duration, Instant};
use testkit::process::{get, wait_for};

/// Half-open connections, connections that ask and read nothing, and how often the gate is armed and disarmed meanwhile.
struct Crowd {
    half_open: usize,
    reading: usize,
    orders: usize,
}

/// In every run. The time to disarm is not held to its limit here: other tests have the processor too.
#[test]
fn a_crowd_of_bad_clients_keeps_nobody_from_the_machine() {
    let crowd = Crowd { half_open: 700, reading: 100, orders: 10 };
    let latencies = withstood(&crowd);
    assert!(latencies[latencies.len() / 2] < Duration::from_millis(100), "{latencies:?}");
}

/// `cargo test --test box access::crowd -- --ignored --nocapture`, alone on the machine.
#[test]
#[ignore = "1 minute: 10,000 half-open and 1,000 reading sockets, alone on the machine"]
fn ten_thousand_half_open_and_a_thousand_reading_sockets() {
    let limit = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, maximum: limit.maximum })
        .expect("as many files as there may be");
    let latencies = withstood(&Crowd { half_open: 10_000, reading: 1_000, orders: 100 });
    assert!(latencies[latencies.len() - 1] <= Duration::from_millis(100), "{:?}", latencies[latencies.len() - 1]);
}

fn skipped(address: &str) -> (u64, u64, f64) {
    let status = get(address, "/api/v1/status").json();
    let number = |key: &str| status["tick"][key].as_u64().expect("a number");
    (number("count"), number("skipped"), status["tick"]["late_p99_ms"].as_f64().expect("a number"))
}

/// Lets the crowd in; gives how long each order to disarm took, sorted.
fn withstood(crowd: &Crowd) -> Vec<Duration> {
    let testbed = testbed("");
    wait_for("ticks", Duration::from_secs(60), || {
        let status = get(&testbed.address, "/api/v1/status").json();
        (status["gate"]["permitted_pct"].is_number() && status["tick"]["count"].as_u64() > Some(20)).then_some(())
    });
    let before = skipped(&testbed.address);
    let address: SocketAddr = testbed.address.parse().expect("an address");
    let began = Instant::now();
    let (half_open, reading) = (crowd.half_open, crowd.reading);
    let comes = thread::spawn(move || flood(address, half_open, reading));
    let mut disarmed = orders(&testbed, crowd.orders, Duration::from_millis(20));
    let sockets = comes.join().expect("no panic");
    let came = began.elapsed();
    disarmed.extend(orders(&testbed, crowd.orders, Duration::from_millis(20)));
    let page_within = page(&testbed.address);
    let files = std::fs::read_dir(format!("/proc/{}/fd", testbed.gateway.pid())).expect("a process").count();
    let crowded = sockets.len();
    drop(sockets);
    let page_after = page(&testbed.address);
    let after = skipped(&testbed.address);
    disarmed.sort_unstable();
    println!(
        "{crowded} sockets within {came:?}, {files} files open: disarm n = {}, median {:?}, greatest {:?}; page within the crowd \
         {page_within:?}, after it {page_after:?}; ticks {} to {}, skipped {} to {}, late p99 {:.1} to {:.1} ms",
        disarmed.len(),
        disarmed[disarmed.len() / 2],
        disarmed[disarmed.len() - 1],
        before.0,
        after.0,
        before.1,
        after.1,
        before.2,
        after.2,
    );
    assert_eq!(before.1, after.1, "no tick is skipped");
    assert!(after.0 > before.0 && files < 600, "{files} files");
    assert!(
        page_within < Duration::from_secs(2) && page_after < Duration::from_secs(2),
        "{page_within:?} {page_after:?}"
    );
    assert!(crowded > (half_open + reading) / 2, "{crowded} connections were made");
    testbed.gateway.stop();
    disarmed
}

/// From asking for the page to its whole answer. A client whose connection is closed for another asks again.
fn page(address: &str) -> Duration {
    let began = Instant::now();
    wait_for("the page", Duration::from_secs(10), || {
        let mut stream = TcpStream::connect(address).ok()?;
        stream.set_read_timeout(Some(Duration::from_secs(5))).ok()?;
        write!(stream, "GET / HTTP/1.0\r\nHost: {address}\r\n\r\n").ok()?;
        let mut answer = String::new();
        std::io::Read::read_to_string(&mut stream, &mut answer).ok()?;
        (answer.starts_with("HTTP/1.0 200") && answer.ends_with("</html>\n")).then_some(())
    });
    began.elapsed()
}

/// Arms and disarms at the box; gives how long each disarming took.
fn orders(testbed: &Testbed, count: usize, pause: Duration) -> Vec<Duration> {
    let data_dir = testbed.directory.path().join("data");
    let mut disarmed = Vec::new();
    for _ in 0..count {
        let by = || "test".to_owned();
        let armed: Reply =
            send_order(&data_dir, &Order::Arm { by: by(), for_s: Some(60.0) }).expect("the socket answers");
        assert!(armed.done, "{}", armed.text);
        thread::sleep(pause);
        let began = Instant::now();
        let reply = send_order(&data_dir, &Order::Disarm { by: by() }).expect("the socket answers");
        disarmed.push(began.elapsed());
        assert!(reply.done && reply.text.contains("given back"), "{}", reply.text);
    }
    disarmed
}

/// Connections that send half a head, and such that ask for a stream or for the history and read nothing.
fn flood(address: SocketAddr, half_open: usize, reading: usize) -> Vec<TcpStream> {
    let asks = |index: usize| match index {
        index if index >= reading => "GET / HTTP/1.1\r\nHost:".to_owned(),
        index if index % 2 == 0 => format!("GET /api/v1/live HTTP/1.1\r\nHost: {address}\r\n\r\n"),
        _ => format!("GET /api/v1/samples?resolution_s=0 HTTP/1.1\r\nHost: {address}\r\n\r\n"),
    };
    let mut sockets = Vec::new();
    for index in 0..half_open + reading {
        let Ok(mut stream) = TcpStream::connect_timeout(&address, Duration::from_secs(5)) else { continue };
        if stream.write_all(asks(index).as_bytes()).is_ok() {
            sockets.push(stream);
        }
    }
    sockets
}

/// A few clients that do not read keep the others from nothing, and the streams of one address are limited.
#[test]
fn the_streams_of_one_client_are_limited_and_free_again_when_it_has_gone() {
    let testbed = testbed("");
    wait_for("ticks", Duration::from_secs(60), || (get(&testbed.address, "/healthz").status == 200).then_some(()));
    let listen = || {
        let mut stream = TcpStream::connect(&testbed.address).expect("it listens");
        stream.set_read_timeout(Some(Duration::from_secs(10))).expect("a limit");
        write!(stream, "GET /api/v1/live HTTP/1.1\r\nHost: {}\r\n\r\n", testbed.address).expect("sent");
        let mut first = [0; 12];
        std::io::Read::read_exact(&mut stream, &mut first).expect("answered");
        (String::from_utf8_lossy(&first).into_owned(), stream)
    };
    let streams: Vec<_> = (0..12).map(|_| listen()).collect();
    let taken = streams.iter().filter(|(first, _)| first == "HTTP/1.1 200").count();
    let refused = streams.iter().filter(|(first, _)| first == "HTTP/1.1 503").count();
    assert_eq!((taken, refused), (8, 4));
    drop(streams);
    wait_for("a free one", Duration::from_secs(5), || (listen().0 == "HTTP/1.1 200").then_some(()));
    let status: Value = get(&testbed.address, "/api/v1/status").json();
    assert_eq!(status["tick"]["skipped"], 0);
    testbed.gateway.stop();
}
