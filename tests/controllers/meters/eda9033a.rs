//! The EDA9033A's native protocol over a pseudo terminal, the meter's bytes put together by hand.

use super::partner::{cable, near, poll, socat_is_there, source};
use adapters::SourceError;
use std::fs::OpenOptions;
use std::io::{Read, Write};
use std::thread;

#[test]
fn the_native_protocol_over_a_serial_line() {
    if !socat_is_there() {
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let cable = cable(directory.path());
    let mut line = OpenOptions::new().read(true).write(true).open(&cable.theirs).expect("the other end");
    thread::spawn(move || {
        for count in 0_u8.. {
            let mut request = [0_u8; 7];
            if line.read_exact(&mut request).is_err() {
                return;
            }
            assert_eq!(request, [0x4C, 0x57, 0x01, 0x30, 0x0E, 0x3F, 0x0D]);
            let mut answer = vec![0x4C, 0x57, 0x01, 0x30, 0x0E];
            // 9200 is 230 V, 4000 is 2 A before the transformers, 8190 hex is 400 counts of power that comes back.
            answer.extend([0x23, 0xF0, 0x0F, 0xA0, 0x23, 0xF0, 0x0F, 0xA0, 0x23, 0xF0, 0x0F, 0xA0, 0x81, 0x90]);
            answer.resize(43, 0);
            let sum = answer[2..].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
            answer.extend([if count == 1 { sum ^ 1 } else { sum }, 0x0D]);
            line.write_all(&answer).expect("sent");
        }
    });
    let address = format!("eda9033a://{}?ct=20&circuit=spindle&timeout_ms=300", cable.ours.display());
    let mut meter = source(&address);
    for poll_number in 0..4 {
        let polled = poll(meter.as_mut());
        if poll_number == 1 {
            assert!(matches!(polled, Err(SourceError::Decode { .. })), "{polled:?}");
            continue;
        }
        let readings = polled.unwrap_or_else(|error| panic!("{error}"));
        near(&readings, "spindle_power_w", -3000.0);
        near(&readings, "spindle_current_a", 40.0);
        near(&readings, "supply_voltage_v", 3.0_f64.sqrt() * 230.0);
    }
}
