//! Inputs that are nearly right: one that is right, with a few things done to it that faults and strangers do.

use rand::Rng;
use rand::seq::IndexedRandom;
use rand_pcg::Pcg64Mcg;

/// No input grows beyond this, unless what it was made of is longer, bytes.
const LONGEST: usize = 200_000;
/// Numbers at which lengths and counts go wrong, in both orders of bytes.
const EDGES: [u32; 8] = [0, 1, 0x7f, 0xff, 0x7fff, 0xffff, 0x7fff_ffff, 0xffff_ffff];
/// Texts that end, open or repeat something in one of the formats.
const WORDS: [&str; 22] = [
    "\"",
    "\\",
    "{",
    "}",
    "[",
    "]",
    "(",
    ")",
    ",",
    ";",
    "\n",
    "\r\n",
    "\0",
    "-",
    "1e999",
    "NaN",
    "9223372036854775808",
    "=",
    "\u{feff}",
    "é",
    "中",
    "../",
];

/// One of the seeds with one to eight changes.
pub(crate) fn mutated(seeds: &[Vec<u8>], random: &mut Pcg64Mcg) -> Vec<u8> {
    let mut bytes = seeds.choose(random).cloned().unwrap_or_default();
    let longest = LONGEST.max(bytes.len());
    for _ in 0..random.random_range(1..=8) {
        change(&mut bytes, seeds, random);
        bytes.truncate(longest);
    }
    bytes
}

/// A stretch of `bytes`, short more often than long.
fn stretch(length: usize, random: &mut Pcg64Mcg) -> std::ops::Range<usize> {
    let start = random.random_range(0..=length);
    let most = [4, 64, length].choose(random).copied().unwrap_or(4).min(length - start);
    start..start + random.random_range(0..=most)
}

fn change(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], random: &mut Pcg64Mcg) {
    let at = random.random_range(0..=bytes.len());
    match random.random_range(0..9) {
        0 if at < bytes.len() => bytes[at] ^= 1 << random.random_range(0..8),
        1 if at < bytes.len() => bytes[at] = random.random(),
        2 => bytes.truncate(at),
        3 => drop(bytes.drain(stretch(bytes.len(), random))),
        4 => {
            let copied = bytes[stretch(bytes.len(), random)].to_vec();
            let times = [1, 2, 50].choose(random).copied().unwrap_or(1);
            let again = copied.repeat(times.min(LONGEST / copied.len().max(1)));
            drop(bytes.splice(at..at, again));
        }
        5 => {
            let other = seeds.choose(random).map_or(&[][..], |seed| &seed[stretch(seed.len(), random)]);
            drop(bytes.splice(at..at, other.iter().copied()));
        }
        6 => {
            let edge = EDGES.choose(random).copied().unwrap_or(0);
            let number = if random.random() { edge.to_be_bytes() } else { edge.to_le_bytes() };
            let number = &number[..[1, 2, 4].choose(random).copied().unwrap_or(4)];
            let end = (at + number.len()).min(bytes.len());
            drop(bytes.splice(at..end, number.iter().copied()));
        }
        7 => {
            let word = WORDS.choose(random).copied().unwrap_or("\"");
            let times = [1, 1, 1, 3, 2000].choose(random).copied().unwrap_or(1);
            drop(bytes.splice(at..at, word.repeat(times).into_bytes()));
        }
        _ => another_number(bytes, random),
    }
}

/// Another number in the place of one that is written in digits.
fn another_number(bytes: &mut Vec<u8>, random: &mut Pcg64Mcg) {
    let from = random.random_range(0..=bytes.len());
    let Some(start) = bytes[from..].iter().position(u8::is_ascii_digit).map(|index| from + index) else { return };
    let end =
        bytes[start..].iter().position(|byte| !byte.is_ascii_digit()).map_or(bytes.len(), |length| start + length);
    let number = match random.random_range(0..3) {
        0 => random.random::<i64>().to_string(),
        1 => random.random_range(-3..300).to_string(),
        _ => EDGES.choose(random).copied().unwrap_or(0).to_string(),
    };
    drop(bytes.splice(start..end, number.into_bytes()));
}
