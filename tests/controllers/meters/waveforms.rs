//! Streams of samples over real sockets: gaps, clipping, garbage, a file played, and what 1 kHz costs.

use super::partner::{number, poll};
use adapters::address::Endpoint;
use adapters::clock::{Clock, SystemClock};
use adapters::waveform::{Producer, Receiver, Recorded, Sampler, WaveformFrame, WaveformHeader};
use adapters::{Source, SourceError};
use gateway::waveform::SpindleCurrent;
use std::f64::consts::TAU;
use std::io::Write;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread;
use std::time::Instant;

fn anywhere() -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], 0))
}

fn endpoint(at: SocketAddr) -> Endpoint {
    Endpoint { host: at.ip().to_string(), port: at.port() }
}

fn header() -> WaveformHeader {
    WaveformHeader::with_currents(1000.0, &["i_u", "i_v", "i_w"], 0.01, 32767)
}

/// Three phases of 10 A rms at 47 Hz, from sample `from` on.
fn sine(from: i32, count: i32) -> Vec<i16> {
    let sample = |k: i32, phase: i32| {
        let angle = TAU * (47.0 * f64::from(k) / 1000.0 - f64::from(phase) / 3.0);
        #[expect(clippy::cast_possible_truncation, reason = "within sixteen bits")]
        let counts = (1000.0 * 2.0_f64.sqrt() * angle.sin()).round() as i16;
        counts
    };
    (from..from + count).flat_map(|k| [sample(k, 0), sample(k, 1), sample(k, 2)]).collect()
}

/// Sends these bytes to whoever connects.
fn sends(bytes: Vec<u8>) -> Endpoint {
    let listener = TcpListener::bind(anywhere()).expect("a port");
    let at = listener.local_addr().expect("an address");
    thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a client");
        stream.write_all(&bytes).expect("sent");
        thread::sleep(std::time::Duration::from_secs(1));
    });
    endpoint(at)
}

#[test]
fn gaps_and_clipped_samples_are_counted() {
    let frame = |sequence: u32, from: i32, samples: Vec<i16>| {
        WaveformFrame { sequence, first_ns: i64::from(from) * 1_000_000 + 1_000_000_000, samples }.to_bytes(3)
    };
    let mut clipped = sine(60, 20);
    (clipped[0], clipped[4]) = (32767, -32768);
    // Frame 2, samples 40 to 59, never comes.
    let bytes = [
        header().encode_line().into_bytes(),
        frame(0, 0, sine(0, 20)),
        frame(1, 20, sine(20, 20)),
        frame(3, 60, clipped),
        frame(4, 80, sine(80, 20)),
    ]
    .concat();
    let (mut receiver, clock) = (Receiver::new("waveform:test", &sends(bytes)), SystemClock::new());
    let blocks: Vec<_> = (0..4).map(|_| receiver.read(&clock).unwrap_or_else(|error| panic!("{error}"))).collect();
    assert_eq!(blocks.iter().map(|block| block.gap).collect::<Vec<_>>(), [0, 0, 20, 0]);
    assert_eq!(blocks.iter().map(|block| block.clipped).collect::<Vec<_>>(), [0, 0, 2, 0]);
    let counts = receiver.intake().counts();
    assert_eq!((counts.gaps, counts.missing, counts.samples, counts.clipped), (1, 20, 80, 2));
}

#[test]
fn what_is_no_stream_is_told() {
    let clock = SystemClock::new();
    let http = sends(b"HTTP/1.1 200 OK\r\n\r\n".to_vec());
    let error = Receiver::new("waveform:test", &http).read(&clock).expect_err("no stream");
    assert!(matches!(error, SourceError::Decode { .. }), "{error}");
    let derailed = sends([header().encode_line().into_bytes(), vec![0x55; 64]].concat());
    let error = Receiver::new("waveform:test", &derailed).read(&clock).expect_err("no frame");
    assert!(matches!(error, SourceError::Decode { .. }), "{error}");
    let port = testkit::port::free_port();
    let nobody = Endpoint { host: "127.0.0.1".to_owned(), port };
    let error = Receiver::new("waveform:test", &nobody).read(&clock).expect_err("nobody");
    assert!(error.to_string().contains("serve waveform"), "{error}");
}

#[test]
fn a_file_is_played_and_its_feature_is_read() {
    let directory = tempfile::tempdir().expect("a directory");
    let file = directory.path().join("current.csv");
    let mut text = String::from("time_s,i_u,i_v,i_w\n");
    for (k, instant) in sine(0, 3000).chunks_exact(3).enumerate() {
        let ampere: Vec<String> = instant.iter().map(|counts| format!("{:.2}", f64::from(*counts) * 0.01)).collect();
        text += &format!("{},{}\n", 0.001 * f64::from(u32::try_from(k).expect("small")), ampere.join(","));
    }
    std::fs::write(&file, text).expect("written");
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let sampler = Recorded::open(&file, 1000.0, 100.0, clock).expect("opens");
    let producer = Producer::start(anywhere(), Box::new(sampler)).expect("serves");
    let mut source = SpindleCurrent::new("waveform:test", &endpoint(producer.listen_address()), None);
    let mut found = Vec::new();
    while found.len() < 5 {
        let readings = poll(&mut source).unwrap_or_else(|error| panic!("{error}"));
        found.extend(readings.first().map(|_| number(&readings, "spindle_current_a")));
    }
    // The first period settles the filter.
    assert!(found[1..].iter().all(|current_a| (current_a - 10.0).abs() < 0.1), "{found:?}");
}

/// Gives its samples as fast as they are taken.
struct Fast {
    left: i32,
}

impl Sampler for Fast {
    fn header(&self) -> WaveformHeader {
        header()
    }

    fn next(&mut self) -> std::io::Result<Option<(i64, Vec<i16>)>> {
        self.left -= 1;
        // The listener needs a moment to connect; frames are counted as they are taken.
        let first_ns = i64::from(30_000 - self.left) * 20_000_000;
        Ok((self.left > 0).then(|| (first_ns, sine(20 * (30_000 - self.left) % 100_000, 20))))
    }
}

/// What three phases at 1 kHz cost: socket, frame, filter and feature on one thread, in stream time.
/// `cargo test --release --test controllers what_three_phases -- --nocapture` prints the figure of the README.
#[test]
fn what_three_phases_at_1_khz_cost() {
    let producer = Producer::start(anywhere(), Box::new(Fast { left: 30_000 })).expect("serves");
    let mut source = SpindleCurrent::new("waveform:test", &endpoint(producer.listen_address()), None);
    poll(&mut source).unwrap_or_else(|error| panic!("{error}"));
    let (samples, began) = (samples(&source), Instant::now());
    while poll(&mut source).is_ok() {}
    let stream_s = (self::samples(&source) - samples) / 1000.0;
    let share = began.elapsed().as_secs_f64() / stream_s;
    println!(
        "three phases at 1 kHz, from the socket to the feature: {:.3} % of one core ({stream_s:.0} s of samples)",
        100.0 * share
    );
    assert!(stream_s > 60.0 && share < 0.2, "{share} over {stream_s} s");
}

fn samples(source: &SpindleCurrent) -> f64 {
    let facts = source.collect_facts();
    let fact = facts.iter().find(|fact| fact.name == "waveform_samples").expect("counted");
    match fact.value {
        adapters::FactValue::Number(number) => number,
        adapters::FactValue::Text(_) => panic!("{fact:?}"),
    }
}
