//! Questions of the vendor's own client, and answers of which it made the values that stand beside them, for three generations
//! (version words 2, 3 and 4): our client must write the same questions and read the same values, our server must give the
//! same answers. The answers are those of a simulator, not of a control: they show what the library accepts and how it reads
//! it, and nothing of what a machine sends. That of the modal words (1/22) is our own: the simulator's had its flag in a byte
//! that the library does not read; what it does read is tested byte by byte in `tests/controllers/fanuc/layouts.rs`.
//!
//! The frames are written here in a short notation, block by block, and put together by an independent few lines
//! below, so that a mistake of the codec cannot hide. Questions: `device/function argument ...` in hexadecimal, with
//! what is written after an equals sign. Answers: their data in hexadecimal, `!code.detail` for a refusal, and
//! `..8x5` for five times the eight bytes of an empty place. Source: captured frames of the FANUC reference notes.

mod fixture;
mod rows;
mod values;

use crate::{Controller, answer_body};
use fanuc::answer::FocasItemResult;
use fanuc::decode;
use fanuc::generation::Generation;
use fanuc::item::{FocasItem, Write};
use fanuc::request;
use fanuc::wire::{FocasFrame, FrameKind, Request, encode_frame, parse_replies, parse_requests, request_body};
use rows::{CapturedCall, CapturedMeaning};

const VERSIONS: [u16; 3] = [2, 3, 4];

fn parse_hex_bytes(hex: &str) -> Vec<u8> {
    let digits: Vec<u32> = hex.chars().filter_map(|digit| digit.to_digit(16)).collect();
    digits.chunks(2).map(|pair| u8::try_from(pair[0] * 16 + pair[1]).expect("two digits")).collect()
}

fn encode_word(number: usize) -> [u8; 2] {
    u16::try_from(number).expect("a word").to_be_bytes()
}

fn parse_hex(text: &str) -> u32 {
    u32::from_str_radix(text.trim_start_matches('-'), 16).expect("hexadecimal")
}

/// `1/40 4 -1` as the 28 bytes and more of a question.
fn parse_question(text: &str) -> (Vec<u8>, Vec<u8>) {
    let (head, written) = text.split_once('=').unwrap_or((text, ""));
    let written = parse_hex_bytes(written);
    let mut parts = head.split_whitespace();
    let (device, function) = parts.next().expect("a function").split_once('/').expect("device/function");
    let head =
        [&encode_word(parse_hex(device) as usize)[..], &[0, 1], &encode_word(parse_hex(function) as usize)].concat();
    let mut block = [&encode_word(28 + written.len())[..], &head].concat();
    let mut arguments: Vec<u32> = parts.map(|text| if text == "-1" { u32::MAX } else { parse_hex(text) }).collect();
    arguments.resize(5, 0);
    if !written.is_empty() {
        arguments[4] = u32::try_from(written.len()).expect("short");
    }
    arguments.iter().for_each(|argument| block.extend(argument.to_be_bytes()));
    block.extend(written);
    (block, head)
}

/// The data of an answer from its notation.
fn parse_data(text: &str) -> Vec<u8> {
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
            None => data.extend(parse_hex_bytes(part)),
        }
    }
    data
}

fn build_answer(text: &str, head: &[u8]) -> Vec<u8> {
    let (code, detail, data) = match text.strip_prefix('!').and_then(|refusal| refusal.split_once('.')) {
        Some((code, detail)) => (parse_hex(code), parse_hex(detail), Vec::new()),
        None => (0, 0, parse_data(text)),
    };
    let codes = [encode_word(code as usize), encode_word(detail as usize), [0, 0], encode_word(data.len())].concat();
    [&encode_word(16 + data.len())[..], head, &codes, &data].concat()
}

fn build_frame(version: u16, kind: &str, blocks: &[Vec<u8>]) -> Vec<u8> {
    let body = [&encode_word(blocks.len())[..], &blocks.concat()].concat();
    [&[0xA0; 4][..], &version.to_be_bytes(), &parse_hex_bytes(kind), &encode_word(body.len()), &body].concat()
}

/// The two captured frames of a row.
fn build_captured_frames(row: &CapturedCall, version: u16) -> (Vec<u8>, Vec<u8>) {
    let questions: Vec<(Vec<u8>, Vec<u8>)> = row.asked.split('|').map(|text| parse_question(text.trim())).collect();
    let answers: Vec<&str> = row.answered.split('|').collect();
    assert_eq!(questions.len(), answers.len(), "{}", row.call);
    let answers =
        questions.iter().zip(answers).map(|((_, head), text)| build_answer(text.trim(), head)).collect::<Vec<_>>();
    let questions: Vec<Vec<u8>> = questions.into_iter().map(|(block, _)| block).collect();
    (build_frame(1, "2101", &questions), build_frame(version, "2102", &answers))
}

fn build_requests(row: &CapturedCall, generation: Generation) -> Vec<Request> {
    match &row.says {
        CapturedMeaning::Written(write) => vec![request::build_write_request(write, generation)],
        CapturedMeaning::Read(items, _) => {
            items.iter().map(|item| request::build_read_request(*item, generation)).collect()
        }
    }
}

fn list_rows(version: u16) -> impl Iterator<Item = CapturedCall> {
    rows::list_calls().into_iter().chain(values::list_calls()).filter(move |row| row.versions.contains(&version))
}

#[test]
fn the_client_asks_as_the_vendors_client() {
    for version in VERSIONS {
        for row in list_rows(version) {
            let ours = encode_frame(
                1,
                FrameKind::Request,
                &request_body(&build_requests(&row, Generation::from_version(version))),
            );
            assert_eq!(ours, build_captured_frames(&row, version).0, "{} of generation {version}", row.call);
        }
    }
}

#[test]
fn the_client_reads_the_same_values() {
    for version in VERSIONS {
        for row in list_rows(version) {
            let CapturedMeaning::Read(items, expected) = &row.says else { continue };
            let found =
                decode_answers(items, Generation::from_version(version), &build_captured_frames(&row, version).1);
            assert_eq!(&found, expected, "{} of generation {version}", row.call);
        }
    }
}

fn decode_answers(items: &[FocasItem], generation: Generation, bytes: &[u8]) -> Vec<FocasItemResult> {
    let frame = FocasFrame::from_bytes(bytes).expect("a frame");
    assert_eq!((frame.kind, Generation::from_version(frame.version)), (FrameKind::Answer, generation));
    let replies = parse_replies(&frame.body).expect("blocks");
    let one = |(item, reply): (&FocasItem, &fanuc::wire::Reply<'_>)| {
        reply.check_request(&request::build_read_request(*item, generation)).expect("the answer to the question");
        match reply.code {
            0 => decode::read_answer(*item, generation, reply.data)
                .map_err(|error| fanuc::answer::FocasItemError::Malformed(error.to_string())),
            code => Err(fanuc::answer::FocasItemError::Refused(fanuc::answer::Refusal {
                code: fanuc::code::FocasReturnCode(code),
                detail: reply.detail,
            })),
        }
    };
    assert_eq!(items.len(), replies.len());
    items.iter().zip(&replies).map(one).collect()
}

fn serve_request(controller: &mut Controller, version: u16, bytes: &[u8]) -> Vec<u8> {
    let request = FocasFrame::from_bytes(bytes).expect("a frame");
    let asked = parse_requests(&request.body).expect("blocks");
    encode_frame(version, FrameKind::Answer, &answer_body(controller, &asked))
}

#[test]
fn the_server_answers_as_the_captured_one() {
    for version in VERSIONS {
        let mut controller = fixture::build_controller(version);
        for row in list_rows(version) {
            fixture::prepare_call(row.call, &mut controller);
            let (question, answer) = build_captured_frames(&row, version);
            let ours = serve_request(&mut controller, version, &question);
            assert_eq!(ours, answer, "{} of generation {version}", row.call);
        }
        fixture::assert_written(&controller);
    }
}

#[test]
fn a_write_and_its_reading_agree_in_every_generation() {
    for version in VERSIONS {
        let generation = Generation::from_version(version);
        let mut controller = fixture::build_controller(version);
        let write = Write::Macro { number: 512, mantissa: -25, places: 1 };
        let body = request_body(&[request::build_write_request(&write, generation)]);
        serve_request(&mut controller, version, &encode_frame(1, FrameKind::Request, &body));
        let items = [FocasItem::Macro(512)];
        let body = request_body(&[request::build_read_request(items[0], generation)]);
        let answer = serve_request(&mut controller, version, &encode_frame(1, FrameKind::Request, &body));
        assert_eq!(decode_answers(&items, generation, &answer), [Ok(fanuc::answer::FocasAnswer::Number(Some(-2.5)))]);
    }
}
