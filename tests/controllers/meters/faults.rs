//! A Modbus TCP meter that misbehaves in every way: each has its own error, and none gives a wrong number.

use super::partner::{PROFILES, number, poll, source};
use adapters::SourceError;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::thread;
use std::time::Duration;

/// The gateway waits so long; what is late comes after half as long again.
const TIMEOUT_MS: u64 = 300;

#[derive(Clone, Copy)]
enum Behaviour {
    Good,
    /// After so many ms.
    Slow(u64),
    Silent,
    WrongTransaction,
    WrongUnit,
    WrongLength,
    NotModbus,
    HalfAnAnswer,
    HangUp,
}

/// Answers request k (from 1) with a total power of k W, as `behaviour` of k says. Each connection has a thread of its own.
fn meter(behaviour: impl Fn(u32) -> Behaviour + Send + Sync + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let at = listener.local_addr().expect("an address");
    let behaviour = std::sync::Arc::new(behaviour);
    let asked = std::sync::Arc::new(std::sync::atomic::AtomicU32::new(0));
    thread::spawn(move || {
        for stream in listener.incoming() {
            let (mut stream, behaviour, asked) = (stream.expect("a client"), behaviour.clone(), asked.clone());
            thread::spawn(move || {
                let mut request = [0_u8; 12];
                while stream.read_exact(&mut request).is_ok() {
                    let count = asked.fetch_add(1, std::sync::atomic::Ordering::SeqCst) + 1;
                    if !answered(&mut stream, &request, count, behaviour(count)) {
                        return;
                    }
                }
            });
        }
    });
    format!("modbus-tcp://{at}?profile=one_number&profiles={PROFILES}&timeout_ms={TIMEOUT_MS}")
}

fn answered(stream: &mut std::net::TcpStream, request: &[u8; 12], count: u32, behaviour: Behaviour) -> bool {
    let mut answer = vec![request[0], request[1], 0, 0, 0, 7, request[6], 3, 4];
    answer.extend(count.to_be_bytes());
    match behaviour {
        Behaviour::Good => {}
        Behaviour::Slow(ms) => thread::sleep(Duration::from_millis(ms)),
        Behaviour::Silent => return true,
        Behaviour::WrongTransaction => answer[1] ^= 0x55,
        Behaviour::WrongUnit => answer[6] = 9,
        Behaviour::WrongLength => answer[8] = 2,
        Behaviour::NotModbus => answer = b"HTTP/1.1 400 Bad Request\r\n\r\n".to_vec(),
        Behaviour::HalfAnAnswer => answer.truncate(8),
        Behaviour::HangUp => return false,
    }
    stream.write_all(&answer).is_ok()
}

/// The second of three polls meets the behaviour; the first and the third are good, and the third has its own number.
fn second_meets(behaviour: Behaviour) -> SourceError {
    let address = meter(move |count| if count == 2 { behaviour } else { Behaviour::Good });
    let mut meter = source(&address);
    let first = poll(meter.as_mut()).unwrap_or_else(|error| panic!("{error}"));
    assert!((number(&first, "total_power_w") - 1.0).abs() < 1e-9);
    let error = poll(meter.as_mut()).expect_err("the second one fails");
    let third = poll(meter.as_mut()).unwrap_or_else(|error| panic!("{error}"));
    assert!((number(&third, "total_power_w") - 3.0).abs() < 1e-9, "an answer to another request: {third:?}");
    error
}

#[test]
fn silence_and_half_an_answer_are_timeouts() {
    for behaviour in [Behaviour::Silent, Behaviour::HalfAnAnswer] {
        let error = second_meets(behaviour);
        assert!(matches!(error, SourceError::Timeout { deadline_ms: TIMEOUT_MS, .. }), "{error}");
        assert!(error.to_string().contains("timeout_ms="), "{error}");
    }
}

#[test]
fn garbage_makes_no_sense_and_no_numbers() {
    for behaviour in [Behaviour::WrongUnit, Behaviour::WrongLength, Behaviour::NotModbus, Behaviour::WrongTransaction] {
        let error = second_meets(behaviour);
        assert!(matches!(error, SourceError::Decode { .. }), "{error}");
    }
    // An answer to another request is waited out, and told as what it is.
    let error = second_meets(Behaviour::WrongTransaction);
    assert!(error.to_string().contains("none with the transaction number"), "{error}");
}

#[test]
fn a_meter_that_hangs_up_is_called_again() {
    // Once is the end of an idle connection, which costs no poll; twice in a row is a fault of the line.
    let once = meter(move |count| if count == 2 { Behaviour::HangUp } else { Behaviour::Good });
    let mut meter_once = source(&once);
    for expected in [1.0, 3.0] {
        let readings = poll(meter_once.as_mut()).unwrap_or_else(|error| panic!("{error}"));
        assert!((number(&readings, "total_power_w") - expected).abs() < 1e-9, "{readings:?}");
    }
    let twice = meter(move |count| if (2..=3).contains(&count) { Behaviour::HangUp } else { Behaviour::Good });
    let mut meter_twice = source(&twice);
    poll(meter_twice.as_mut()).unwrap_or_else(|error| panic!("{error}"));
    let error = poll(meter_twice.as_mut()).expect_err("twice");
    assert!(matches!(error, SourceError::Line { .. }), "{error}");
    poll(meter_twice.as_mut()).unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn a_late_answer_is_never_taken_for_the_next_one() {
    let error = second_meets(Behaviour::Slow(TIMEOUT_MS * 3 / 2));
    assert!(matches!(error, SourceError::Timeout { .. }), "{error}");
    let slow = meter(|_| Behaviour::Slow(TIMEOUT_MS / 6));
    let mut slow = source(&slow);
    for count in 1..=5 {
        let readings = poll(slow.as_mut()).unwrap_or_else(|error| panic!("a slow meter is no fault: {error}"));
        assert!((number(&readings, "total_power_w") - f64::from(count)).abs() < 1e-9);
    }
}

#[test]
fn nobody_there_is_told_with_what_to_do() {
    let port = testkit::port::free_port();
    let error = poll(source(&format!("modbus-tcp://127.0.0.1:{port}?profile=pac")).as_mut()).expect_err("nobody");
    assert!(error.to_string().contains("nothing listens on port"), "{error}");
}
