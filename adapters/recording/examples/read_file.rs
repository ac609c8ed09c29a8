//! How long a file takes to be read: the least processor time of five readings, and of five looks at it as `recording map` takes them.
//!
//! `cargo run --release -p recording --example read_file -- FILE`

use recording::Mapping;
use recording::read::preview_recording;
use std::path::Path;

/// Processor time of this thread, s (Linux).
fn processor_time_s() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split(' ').next()?.parse::<f64>().ok()? / 1e9)
}

fn main() {
    let Some(file) = std::env::args().nth(1) else { return eprintln!("read_file FILE") };
    let path = Path::new(&file);
    let (mut reading_s, mut mapping_s) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..5 {
        let before_s = processor_time_s().unwrap_or(f64::NAN);
        let read = match recording::read_path_as(path, &Mapping::default()) {
            Ok(read) => read,
            Err(error) => return eprintln!("{error}"),
        };
        let between_s = processor_time_s().unwrap_or(f64::NAN);
        reading_s = reading_s.min(between_s - before_s);
        println!(
            "{} rows, {} columns, {} refused",
            read.recording.count_rows(),
            read.recording.columns().len(),
            read.refused
        );
        drop(read);
        let before_s = processor_time_s().unwrap_or(f64::NAN);
        // Once as it is, once as the map says.
        let looks = [preview_recording(path, &Mapping::default()), preview_recording(path, &Mapping::default())];
        mapping_s = mapping_s.min(processor_time_s().unwrap_or(f64::NAN) - before_s);
        drop(looks);
    }
    println!(
        "reading: {reading_s:.3} s of processor time; reading twice, for a map: {mapping_s:.3} s (the least of 5)"
    );
}
