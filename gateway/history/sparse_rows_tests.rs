//! Rows that are far apart: each makes a block of its own, and none of them may be lost however many come at once.

use super::{Options, Query, Reader, WhenFull, Writer};
use adapter_core::channel::ChannelId;
use adapter_core::reading::Value;
use adapter_core::sample::{Sample, Slot};
use std::ops::ControlFlow;

const ROWS: i64 = 1_000;
const START_NS: i64 = 1_700_000_000_000_000_000;

/// What a history holds after so many rows, this far apart, were queued as fast as it takes them.
fn count_rows_of(step_ns: i64) -> usize {
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("history.db");
    let writer = Writer::open(&path, Options { when_full: WhenFull::Wait, ..Options::default() }).expect("a writer");
    let channel = ChannelId::from_name("spindle_power_w").expect("in the table");
    for row in 0..ROWS {
        let mut sample = Sample::new_empty(START_NS + row * step_ns);
        sample.set_slot(channel, Slot { value: Ok(Value::Number(row as f64)), age_ns: 0 });
        writer.queue_sample(&sample, &[]);
    }
    writer.flush().expect("durable");
    let reader = Reader::open(&path).expect("a reader");
    let mut values = Vec::new();
    reader
        .for_each_chunk(&Query::between(START_NS, START_NS + ROWS * step_ns), |chunk| {
            let column = chunk.series.iter().position(|series| &*series.name == "spindle_power_w").expect("stored");
            values.extend((0..chunk.at_ns.len()).filter_map(|row| chunk.columns[column].number_at(row)));
            ControlFlow::Continue(())
        })
        .expect("rows");
    assert!(values.iter().zip(0..).all(|(value, row): (&f64, i64)| *value == row as f64), "{step_ns} ns apart");
    values.len()
}

#[test]
fn no_row_is_lost_however_far_apart_they_are() {
    for step_s in [0.1, 1.0, 7.0, 14.0, 15.0, 30.0, 60.0, 599.0, 3_600.0, 86_400.0] {
        let step_ns = (step_s * 1e9) as i64;
        assert_eq!(count_rows_of(step_ns), 1_000, "{step_s} s apart");
    }
}
