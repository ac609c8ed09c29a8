//! What a poll costs, against a served machine in another process.

use crate::fanuc::vendor::{library, settings};
use adapters::address::{Address, Target};
use adapters::fanuc::focas::Focas;
use adapters::fanuc::native::{Native, NativeSettings};
use adapters::fanuc::poll;
use adapters::fanuc::vendor::Vendor;
use std::time::{Duration, Instant};
use testkit::served::Serving;

fn median(mut times: Vec<Duration>) -> (Duration, Duration) {
    times.sort();
    (times[times.len() / 2], times[times.len() * 99 / 100])
}

fn polls(focas: &mut dyn Focas, count: usize) -> Vec<Duration> {
    let items = [poll::list_fast_questions(1), adapters::fanuc::list_slow_questions(1)].concat();
    let one = |_| {
        let (began, mut out) = (Instant::now(), Vec::new());
        focas.ask_questions(&items, &mut out).expect("answers");
        assert_eq!(out.len(), items.len());
        began.elapsed()
    };
    (0..count).map(one).collect()
}

/// `cargo test --test controllers the_whole_poll -- --nocapture` prints the figures.
#[test]
fn the_whole_poll_set_is_one_round_trip() {
    for generation in ["30i", "16i"] {
        let serving = Serving::start(&["--generation", generation, "--machine", "simulated://mill?begun_s=600"]);
        let address: Address = serving.address.parse().expect("usable");
        let Target::Fanuc { at, .. } = address.target() else { panic!("{address}") };
        let encoding = adapters::text::TextEncoding::default();
        let settings = NativeSettings { endpoint: at.clone(), path: 1, timeout: Duration::from_secs(2), encoding };
        let mut native = Native::connect(settings).expect("on");
        let (half, most) = median(polls(&mut native, 300));
        let seen = native.statistics();
        println!(
            "native, {generation}: {} questions in 1 round trip of {} bytes there and {} back; p50 {} us, p99 {} us",
            seen.blocks / seen.frames,
            seen.sent_bytes / seen.frames,
            seen.received_bytes / seen.frames,
            half.as_micros(),
            most.as_micros()
        );
        assert_eq!(seen.frames, 300, "one frame per poll");
        assert!(seen.percentile(50) <= seen.longest);
    }
}

#[test]
fn the_whole_poll_set_through_a_library_in_its_child() {
    let library = library(&[]);
    let mut vendor = Vendor::connect(settings(&library)).expect("connects");
    let (half, most) = median(polls(&mut vendor, 100));
    let counts = vendor.counts();
    println!(
        "through the child (a library without a wire): {} answers to {} request per poll; p50 {} us, p99 {} us",
        counts.answers / 100,
        counts.requests / 100,
        half.as_micros(),
        most.as_micros()
    );
    assert_eq!(vendor.counts().starts, 1);
    // As over a wire to a control that needs 10 ms for every call.
    library.fault("wait any 10");
    let (half, _) = median(polls(&mut vendor, 5));
    println!("with 10 ms for every call of the library: {} ms for the whole poll", half.as_millis());
    library.well();
}
