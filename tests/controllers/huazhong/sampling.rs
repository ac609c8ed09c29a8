//! Sample channels: every millisecond arrives once, and with the value that the machine had then.

use crate::huazhong::stand::{SERIAL, Stand};
use adapters::nclink::sample::SampleBlock;
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// Reads at its pace for so long and gives the blocks of the fast channel.
fn sampled(stand: &Stand, duration: Duration) -> (Vec<(SampleBlock, Instant)>, String) {
    let mut source = stand.source();
    let (sender, blocks) = mpsc::channel();
    source.on_block(Box::new(move |block, arrived| {
        if block.channel == "sample_channel1" {
            sender.send((block.clone(), arrived)).expect("the test listens");
        }
    }));
    let end = Instant::now() + duration;
    let mut polls = 0;
    while Instant::now() < end {
        stand.read(&mut source).expect("read");
        polls += 1;
        std::thread::sleep(Duration::from_millis(80));
    }
    let (_, track) = source.track().channels().find(|(name, _)| *name == "sample_channel1").expect("it was sampled");
    assert_eq!((track.missing, track.overlapping, source.track().unusable_messages().0), (0, 0, 0));
    let said =
        format!("{polls} polls, {} messages, {} instants, {} missing", track.messages, track.instants, track.missing);
    (blocks.try_iter().collect(), said)
}

fn check(stand: &Stand, duration: Duration) {
    let (blocks, said) = sampled(stand, duration);
    let (first, last) = (&blocks[0].0, &blocks[blocks.len() - 1].0);
    let instants: usize = blocks.iter().map(|(block, _)| block.instants).sum();
    let span_ms = last.begin_ms - first.begin_ms + 200;
    assert_eq!(i64::try_from(instants).expect("fits"), span_ms, "every millisecond once");
    assert!(span_ms as f64 > duration.as_secs_f64() * 1000.0 - 800.0, "{span_ms} ms of {duration:?}");
    for pair in blocks.windows(2) {
        assert_eq!(pair[1].0.begin_ms, pair[0].0.begin_ms + 200);
    }
    // The machine remembers four seconds: compare the newest block with it, value by value.
    let column = last.columns.iter().find(|column| column.path == "AXIS@5/MOTOR/SPEED").expect("the spindle");
    for (k, value) in column.values.iter().enumerate() {
        let at_ms = last.begin_ms + i64::try_from(k).expect("fits");
        let truth = stand.machine.moment(at_ms * 1_000_000).panel.spindle_speed_rpm;
        let found = value.expect("a number");
        assert!((found - truth).abs() <= 0.0501, "ms {k}: {found} and not {truth}");
    }
    println!("1 ms sampling of {SERIAL} for {:.0} s: {said}, {} columns", duration.as_secs_f64(), last.columns.len());
}

#[test]
fn every_millisecond_arrives_once() {
    let Some(stand) = Stand::start() else { return };
    check(&stand, Duration::from_secs(6));
}

/// `cargo test --test controllers -- --ignored --nocapture a_minute`
#[test]
#[ignore = "1 minute: a minute of 1 ms samples through a broker"]
fn a_minute_of_milliseconds_without_loss() {
    let Some(stand) = Stand::start() else { return };
    check(&stand, Duration::from_secs(60));
}

#[test]
fn milliseconds_that_a_dead_broker_swallowed_are_counted() {
    let Some(mut stand) = Stand::start() else { return };
    let mut source = stand.source();
    let mut read_for = |stand: &Stand, duration: Duration| {
        let end = Instant::now() + duration;
        while Instant::now() < end {
            // While the broker is away every poll fails; that is what is wanted.
            let _failed = stand.read(&mut source);
            std::thread::sleep(Duration::from_millis(50));
        }
        source.track().channels().find(|(name, _)| *name == "sample_channel1").map(|(_, track)| track.clone())
    };
    let before = read_for(&stand, Duration::from_secs(1)).expect("sampled");
    assert_eq!(before.missing, 0);
    stand.broker.kill();
    read_for(&stand, Duration::from_millis(500));
    stand.broker.run();
    stand.device.wait(2);
    let after = read_for(&stand, Duration::from_millis(1500)).expect("sampled");
    assert!(after.instants > before.instants && after.overlapping == 0, "{after:?}");
    assert!(after.missing > 300 && after.missing < 15_000, "{after:?}");
    println!("{} ms were lost with the broker and counted", after.missing);
}
