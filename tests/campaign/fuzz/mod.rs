//! Every parser that a stranger reaches, with inputs that are nearly right: none may panic, hang, or take a lot of memory.
//!
//! `cargo test --test campaign fuzz::` gives each parser [`SHORT`]; by hand, in minutes for each of them and for the lines:
//!
//! ```sh
//! FUZZ_MINUTES=10 cargo test --release --test campaign fuzz:: -- --ignored --nocapture
//! ```
//!
//! An input that breaks a parser is written to `tests/data/fuzz/PARSER-SUM` and is tried first from then on: keep it with the mend.
//! Inputs follow from `CNC_GATEWAY_SEED`; without it those of the short version are the same in every run, and those of the long
//! version others in each, which prints its seed.

mod lines;
mod mutate;
mod parsers;

use parsers::Parser;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use testkit::process_status::status_figure;

/// For each parser in every run of the tests.
const SHORT: Duration = Duration::from_millis(700);
/// An input that takes longer hangs, whatever comes out: a hundred times what the slowest right one takes in the debug profile.
const SLOW: Duration = Duration::from_secs(20);
/// The whole process, all parsers together, stays below this, bytes.
const MEMORY_MAX: u64 = 1 << 30;

fn kept() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/fuzz")
}

/// Why an input is a finding; `None`: it is none.
fn finding(parser: &Parser, input: &[u8]) -> Option<String> {
    let began = Instant::now();
    let ended = catch_unwind(AssertUnwindSafe(|| (parser.parse)(input)));
    let took = began.elapsed();
    match ended {
        Err(_) => Some("it panics".to_owned()),
        Ok(()) if took > SLOW => Some(format!("it takes {took:?}")),
        Ok(()) => None,
    }
}

/// Keeps an input that is a finding, and says where.
fn keep(parser: &Parser, input: &[u8], what: &str) -> String {
    let path = kept().join(format!("{}-{:08x}", parser.name, crc32fast::hash(input)));
    let written = fs::create_dir_all(kept()).and_then(|()| fs::write(&path, input));
    format!("{}: {what}; {} ({written:?})", parser.name, path.display())
}

/// What was found in the past is tried again.
fn findings_again(parser: &Parser) -> Vec<String> {
    let prefix = format!("{}-", parser.name);
    let files = fs::read_dir(kept()).into_iter().flatten().flatten().map(|entry| entry.path());
    let own = files.filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(&prefix)));
    own.filter_map(|path| {
        let input = fs::read(&path).expect("readable");
        finding(parser, &input).map(|what| format!("{}: {what}", path.display()))
    })
    .collect()
}

/// Greatest memory of this process until now, bytes.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a whole number of kilobytes")]
fn memory_max() -> u64 {
    status_figure("self", "VmHWM:").unwrap_or(0.0) as u64 * 1024
}

/// Runs one parser for so long; gives how many inputs it had, and what was found.
fn run(parser: &Parser, seed: u64, lasts: Duration) -> (u64, Vec<String>) {
    let mut found = findings_again(parser);
    let seeds = (parser.seeds)();
    assert!(!seeds.is_empty(), "{}: nothing to begin with", parser.name);
    for (index, input) in seeds.iter().enumerate() {
        found.extend(finding(parser, input).map(|what| format!("{}: seed {index}: {what}", parser.name)));
    }
    let (began, mut random, mut inputs) = (Instant::now(), Pcg64Mcg::seed_from_u64(seed), seeds.len() as u64);
    while began.elapsed() < lasts && found.len() < 3 {
        let input = mutate::mutated(&seeds, &mut random);
        inputs += 1;
        found.extend(finding(parser, &input).map(|what| keep(parser, &input, &what)));
    }
    (inputs, found)
}

fn seed() -> Option<u64> {
    std::env::var("CNC_GATEWAY_SEED").ok().and_then(|text| text.parse().ok())
}

/// The one that was given, or another one at each run.
fn seed_of_now() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    seed().unwrap_or(u64::from(since.subsec_nanos()) ^ since.as_secs())
}

fn run_all(seed: u64, lasts: Duration) {
    // Panics are findings; their words are of no use a thousand times.
    let (mut all, mut total) = (Vec::new(), 0);
    println!("seed {seed}, {lasts:?} for each parser");
    for parser in parsers::all() {
        let began = Instant::now();
        let (inputs, found) = run(&parser, seed, lasts);
        println!(
            "{:<20} {inputs:>9} inputs in {:>4.0} s, {} findings",
            parser.name,
            began.elapsed().as_secs_f64(),
            found.len()
        );
        total += inputs;
        all.extend(found);
        assert!(memory_max() < MEMORY_MAX, "{}: {} MB of memory", parser.name, memory_max() >> 20);
    }
    println!("{total} inputs, {} findings, at most {} MB of memory", all.len(), memory_max() >> 20);
    assert!(all.is_empty(), "{}", all.join("\n"));
}

#[test]
fn nothing_nearly_right_breaks_a_parser() {
    run_all(seed().unwrap_or(20_261_127), SHORT);
}

#[test]
#[ignore = "10 minutes for each of the parsers unless FUZZ_MINUTES says otherwise: the same with new inputs, in release"]
fn parsers_for_hours() {
    let minutes = std::env::var("FUZZ_MINUTES").ok().and_then(|text| text.parse().ok()).unwrap_or(10.0_f64);
    run_all(seed_of_now(), Duration::from_secs_f64(minutes * 60.0));
}
