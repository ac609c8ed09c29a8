//! `cargo bench`: ticks per second, the share of each stage, and allocations per tick.

mod ffi;

use gateway::bench;

#[global_allocator]
static COUNTING: ffi::Counting = ffi::Counting;

fn main() {
    // `cargo test` runs benchmarks too, with this argument: then only that it runs is of interest.
    let short = !std::env::args().any(|argument| argument == "--bench");
    let ticks = if short { bench::TICKS_MIN } else { 100_000 };
    let directory = tempfile::tempdir().expect("a temporary directory");
    let figures = bench::measure_ticks(ticks, directory.path(), Some(ffi::allocations)).expect("the benchmark runs");
    println!("{figures}");
}
