//! A meter on a serial line that misbehaves: the line has no transaction numbers, so silence is the only order there is.

use super::partner::{Cable, PROFILES, cable, number, poll, socat_is_there, source};
use adapters::SourceError;
use adapters::modbus::{MeterError, ModbusMeter};
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::thread;
use std::time::Duration;

const TIMEOUT_MS: u64 = 300;

#[derive(Clone, Copy)]
enum Behaviour {
    Good,
    Silent,
    Late,
    Garbled,
    /// Noise in front, and the request's own echo.
    BehindNoise,
    /// In two pieces with a pause.
    InPieces,
    OtherUnit,
}

/// CRC-16 of an RTU frame, written down here a second time.
fn sealed(mut frame: Vec<u8>) -> Vec<u8> {
    let crc = frame.iter().fold(0xFFFF_u16, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte), |crc, _| (crc >> 1) ^ if crc & 1 == 1 { 0xA001 } else { 0 })
    });
    frame.extend(crc.to_le_bytes());
    frame
}

/// Answers request k (from 1) with k W, as `behaviours[k - 1]` says; good beyond them.
fn meter(cable: &Cable, behaviours: &'static [Behaviour]) {
    let mut line: File = OpenOptions::new().read(true).write(true).open(&cable.theirs).expect("the other end");
    thread::spawn(move || {
        let mut request = [0_u8; 8];
        for count in 1_u32.. {
            if line.read_exact(&mut request).is_err() {
                return;
            }
            let index = usize::try_from(count - 1).expect("small");
            answer(&mut line, &request, count, behaviours.get(index).copied().unwrap_or(Behaviour::Good));
        }
    });
}

fn answer(line: &mut File, request: &[u8; 8], count: u32, behaviour: Behaviour) {
    let good = sealed([&[request[0], request[1], 4][..], &count.to_be_bytes()].concat());
    let mut say = |bytes: &[u8]| line.write_all(bytes).expect("the line holds");
    match behaviour {
        Behaviour::Good => say(&good),
        Behaviour::Silent => {}
        Behaviour::Late => {
            thread::sleep(Duration::from_millis(TIMEOUT_MS * 3 / 2));
            say(&good);
        }
        Behaviour::Garbled => {
            let mut broken = good;
            broken[5] ^= 0x40;
            say(&broken);
        }
        Behaviour::BehindNoise => say(&[&[0x00, 0xFF, 0x55][..], request, &good].concat()),
        Behaviour::InPieces => {
            say(&good[..4]);
            thread::sleep(Duration::from_millis(40));
            say(&good[4..]);
        }
        Behaviour::OtherUnit => say(&sealed([&[9, request[1], 4][..], &count.to_be_bytes()].concat())),
    }
}

#[test]
fn no_answer_is_taken_for_that_to_another_request() {
    if !socat_is_there() {
        return;
    }
    use Behaviour::{BehindNoise, Garbled, Good, InPieces, Late, OtherUnit, Silent};
    const BEHAVIOURS: &[Behaviour] = &[Good, Late, Good, Silent, Good, Garbled, BehindNoise, InPieces, OtherUnit, Good];
    let directory = tempfile::tempdir().expect("a directory");
    let cable = cable(directory.path());
    meter(&cable, BEHAVIOURS);
    let line = cable.ours.display();
    let mut meter = source(&format!(
        "modbus-rtu://{line}?baud=19200&profile=one_number&profiles={PROFILES}&timeout_ms={TIMEOUT_MS}"
    ));
    for (index, behaviour) in BEHAVIOURS.iter().enumerate() {
        let polled = poll(meter.as_mut());
        let own = u32::try_from(index + 1).map(f64::from).expect("small");
        match behaviour {
            Silent | Late => assert!(matches!(polled, Err(SourceError::Timeout { .. })), "{index}: {polled:?}"),
            Garbled | OtherUnit => assert!(matches!(polled, Err(SourceError::Decode { .. })), "{index}: {polled:?}"),
            _ => {
                let readings = polled.unwrap_or_else(|error| panic!("{index}: {error}"));
                assert!((number(&readings, "total_power_w") - own).abs() < 1e-9, "{index}: {readings:?}");
            }
        }
    }
    let facts = format!("{:?}", meter.collect_facts());
    assert!(facts.contains("late_answers\", value: Number(1.0)") && facts.contains("wire_time_ms"), "{facts}");
}

#[test]
fn two_meters_share_one_line() {
    if !socat_is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let cable = cable(directory.path());
    meter(&cable, &[]);
    let line = cable.ours.display();
    let address = |unit: u8, circuit: &str| {
        format!(
            "modbus-rtu://{line}?baud=19200&profile=one_number&profiles={PROFILES}&unit={unit}&circuit={circuit}&timeout_ms=3000"
        )
    };
    let polls = |address: String, channel: &'static str| {
        thread::spawn(move || {
            let mut meter = source(&address);
            let read = |_| number(&poll(meter.as_mut()).unwrap_or_else(|error| panic!("{error}")), channel);
            (0..20).map(read).collect::<Vec<f64>>()
        })
    };
    let (one, two) = (polls(address(1, "machine"), "total_power_w"), polls(address(2, "spindle"), "spindle_power_w"));
    let mut all = [one.join().expect("no panic"), two.join().expect("no panic")].concat();
    all.sort_by(f64::total_cmp);
    let each: Vec<f64> = (1..=40).map(f64::from).collect();
    assert_eq!(all, each, "every answer went to the one who had asked");
}

#[test]
fn one_line_has_one_speed() {
    let parse = |text: &str| text.parse::<adapters::Address>().unwrap_or_else(|error| panic!("{error}"));
    let slow = parse("modbus-rtu:///dev/no-such-line?baud=9600&profile=pac");
    let fast = parse("modbus-rtu:///dev/no-such-line?baud=19200&profile=pac&unit=2");
    let first = adapters::open::open_address(&slow, 0).expect("opens; the line is looked for at the first poll");
    let error = adapters::open::open_address(&fast, 0).err().expect("another speed").to_string();
    assert!(error.contains("baud"), "{error}");
    drop(first);
    let _meter: fn(&str, _, _) -> Result<ModbusMeter, MeterError> = ModbusMeter::with_tcp_line;
}
