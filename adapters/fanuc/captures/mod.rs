//! Questions of the vendor's own client, and answers of which it made the values that stand beside them, for three generations
//! (version words 2, 3 and 4): our client must write the same questions and read the same values, our server must give the
//! same answers. The answers are those of a simulator, not of a control: they show what the library accepts and how it reads
//! it, and nothing of what a machine sends. That of the modal words (1/22) is our own: the simulator's had its flag in a byte
//! that the library does not read; what it does read is tested byte by byte in `tests/fanuc/layouts.rs`.
//!
//! The frames are written here in a short notation, block by block, and put together by an independent few lines
//! below, so that a mistake of the codec cannot hide. Questions: `device/function argument ...` in hexadecimal, with
//! what is written after an equals sign. Answers: their data in hexadecimal, `!code.detail` for a refusal, and
//! `..8x5` for five times the eight bytes of an empty place. Source: captured frames of the FANUC reference notes.

mod fixture;
mod rows;
mod values;

use super::answer::FocasItemResult;
use super::decode;
use super::item::{FocasItem, Write};
use super::opening::Generation;
use super::request;
use super::server::{Controller, answer_body};
use super::wire::{FocasFrame, FrameKind, Request, frame, replies, request_body, requests};
use rows::{CapturedCall, Says};

const VERSIONS: [u16; 3] = [2, 3, 4];

fn bytes(hex: &str) -> Vec<u8> {
    let digits: Vec<u32> = hex.chars().filter_map(|digit| digit.to_digit(16)).collect();
    digits.chunks(2).map(|pair| u8::try_from(pair[0] * 16 + pair[1]).expect("two digits")).collect()
}

fn word(number: usize) -> [u8; 2] {
    u16::try_from(number).expect("a word").to_be_bytes()
}

fn hex(text: &str) -> u32 {
    u32::from_str_radix(text.trim_start_matches('-'), 16).expect("hexadecimal")
}

/// `1/40 4 -1` as the 28 bytes and more of a question.
fn question(text: &str) -> (Vec<u8>, Vec<u8>) {
    let (head, written) = text.split_once('=').unwrap_or((text, ""));
    let written = bytes(written);
    let mut parts = head.split_whitespace();
    let (device, function) = parts.next().expect("a function").split_once('/').expect("device/function");
    let head = [&word(hex(device) as usize)[..], &[0, 1], &word(hex(function) as usize)].concat();
    let mut block = [&word(28 + written.len())[..], &head].concat();
    let mut arguments: Vec<u32> = parts.map(|text| if text == "-1" { u32::MAX } else { hex(text) }).collect();
    arguments.resize(5, 0);
    if !written.is_empty() {
        arguments[4] = u32::try_from(written.len()).expect("short");
    }
    arguments.iter().for_each(|argument| block.extend(argument.to_be_bytes()));
    block.extend(written);
    (block, head)
}

/// The data of an answer from its notation.
fn data(text: &str) -> Vec<u8> {
    let mut data = Vec::new();
    for part in text.split_whitespace() {
        match part.strip_prefix("..").and_then(|fill| fill.split_once('x')) {
            Some(("8", count)) => {
                (0..count.parse().expect("a count")).for_each(|_| data.extend([0, 0, 0, 0, 0, 10, 0, 0]))
            }
            Some((zeros, count)) => {
                let zeros: usize = zeros.parse().expect("bytes");
                data.resize(data.len() + zeros * count.parse::<usize>().expect("a count"), 0);
            }
            None => data.extend(bytes(part)),
        }
    }
    data
}

fn answer(text: &str, head: &[u8]) -> Vec<u8> {
    let (code, detail, data) = match text.strip_prefix('!').and_then(|refusal| refusal.split_once('.')) {
        Some((code, detail)) => (hex(code), hex(detail), Vec::new()),
        None => (0, 0, data(text)),
    };
    let codes = [word(code as usize), word(detail as usize), [0, 0], word(data.len())].concat();
    [&word(16 + data.len())[..], head, &codes, &data].concat()
}

fn whole(version: u16, kind: &str, blocks: &[Vec<u8>]) -> Vec<u8> {
    let body = [&word(blocks.len())[..], &blocks.concat()].concat();
    [&[0xA0; 4][..], &version.to_be_bytes(), &bytes(kind), &word(body.len()), &body].concat()
}

/// The two captured frames of a row.
fn captured(row: &CapturedCall, version: u16) -> (Vec<u8>, Vec<u8>) {
    let questions: Vec<(Vec<u8>, Vec<u8>)> = row.asked.split('|').map(|text| question(text.trim())).collect();
    let answers: Vec<&str> = row.answered.split('|').collect();
    assert_eq!(questions.len(), answers.len(), "{}", row.call);
    let answers = questions.iter().zip(answers).map(|((_, head), text)| answer(text.trim(), head)).collect::<Vec<_>>();
    let questions: Vec<Vec<u8>> = questions.into_iter().map(|(block, _)| block).collect();
    (whole(1, "2101", &questions), whole(version, "2102", &answers))
}

fn asked(row: &CapturedCall, generation: Generation) -> Vec<Request> {
    match &row.says {
        Says::Written(write) => vec![request::writing(write, generation)],
        Says::Read(items, _) => items.iter().map(|item| request::reading(*item, generation)).collect(),
    }
}

fn rows(version: u16) -> impl Iterator<Item = CapturedCall> {
    rows::all().into_iter().filter(move |row| row.versions.contains(&version))
}

#[test]
fn the_client_asks_as_the_vendors_client() {
    for version in VERSIONS {
        for row in rows(version) {
            let ours = frame(1, FrameKind::Request, &request_body(&asked(&row, Generation::of(version))));
            assert_eq!(ours, captured(&row, version).0, "{} of generation {version}", row.call);
        }
    }
}

#[test]
fn the_client_reads_the_same_values() {
    for version in VERSIONS {
        for row in rows(version) {
            let Says::Read(items, expected) = &row.says else { continue };
            let found = decoded(items, Generation::of(version), &captured(&row, version).1);
            assert_eq!(&found, expected, "{} of generation {version}", row.call);
        }
    }
}

fn decoded(items: &[FocasItem], generation: Generation, bytes: &[u8]) -> Vec<FocasItemResult> {
    let frame = FocasFrame::of(bytes).expect("a frame");
    assert_eq!((frame.kind, Generation::of(frame.version)), (FrameKind::Answer, generation));
    let replies = replies(&frame.body).expect("blocks");
    let one = |(item, reply): (&FocasItem, &super::wire::Reply<'_>)| {
        reply.answers(&request::reading(*item, generation)).expect("the answer to the question");
        match reply.code {
            0 => decode::answer(*item, generation, reply.data)
                .map_err(|error| super::answer::FocasItemError::Malformed(error.to_string())),
            code => Err(super::answer::FocasItemError::Refused(super::answer::Refusal {
                code: super::code::FocasReturnCode(code),
                detail: reply.detail,
            })),
        }
    };
    assert_eq!(items.len(), replies.len());
    items.iter().zip(&replies).map(one).collect()
}

fn served(controller: &mut Controller, version: u16, bytes: &[u8]) -> Vec<u8> {
    let request = FocasFrame::of(bytes).expect("a frame");
    let asked = requests(&request.body).expect("blocks");
    frame(version, FrameKind::Answer, &answer_body(controller, &asked))
}

#[test]
fn the_server_answers_as_the_captured_one() {
    for version in VERSIONS {
        let mut controller = fixture::controller(version);
        for row in rows(version) {
            fixture::before(row.call, &mut controller);
            let (question, answer) = captured(&row, version);
            let ours = served(&mut controller, version, &question);
            assert_eq!(ours, answer, "{} of generation {version}", row.call);
        }
        fixture::written(&controller);
    }
}

#[test]
fn a_write_and_its_reading_agree_in_every_generation() {
    for version in VERSIONS {
        let generation = Generation::of(version);
        let mut controller = fixture::controller(version);
        let write = Write::Macro { number: 512, mantissa: -25, places: 1 };
        let body = request_body(&[request::writing(&write, generation)]);
        served(&mut controller, version, &frame(1, FrameKind::Request, &body));
        let items = [FocasItem::Macro(512)];
        let body = request_body(&[request::reading(items[0], generation)]);
        let answer = served(&mut controller, version, &frame(1, FrameKind::Request, &body));
        assert_eq!(decoded(&items, generation, &answer), [Ok(super::answer::FocasAnswer::Number(Some(-2.5)))]);
    }
}
