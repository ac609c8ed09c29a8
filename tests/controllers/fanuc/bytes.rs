//! A control that is made of bytes: it knows what a frame is, and answers every question with the bytes that it was given. It
//! shares nothing with the program but the socket: no table, no codec, no number of a function. What the bytes mean stands
//! beside them in the tests, as the vendor's library told it.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

/// The three generations, by their version words.
pub(crate) const VERSIONS: [u16; 3] = [2, 3, 4];

/// Bytes from hexadecimal; blanks do not count.
pub(crate) fn bytes(hex: &str) -> Vec<u8> {
    let digits: Vec<u8> = hex.chars().filter_map(|digit| digit.to_digit(16)).map(|digit| digit as u8).collect();
    digits.chunks(2).map(|pair| pair[0] * 16 + pair[1]).collect()
}

/// An answer: to a device and function (`1/22`), or to those with this first argument only (`1/22 5`, hexadecimal).
pub(crate) type Answer = (&'static str, Vec<u8>);

/// The control, until it is dropped.
pub(crate) struct ByteControl {
    pub(crate) address: SocketAddr,
    stop: Arc<AtomicBool>,
}

impl Drop for ByteControl {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        let _wakes_the_listener = TcpStream::connect(self.address);
    }
}

/// What stands in the answer to the opening of a connection: families, counts and paths, as the vendor's library accepts them.
fn opening(version: u16) -> Vec<u8> {
    let words: Vec<u16> = if version <= 2 {
        vec![7, 3, 8, 4, 1, 1, 0, 0, 0x204D, 1, 3, 1]
    } else {
        let head = [6, 5, 1, 32, 8, 10, 3, 3, 3, 3, 1, 1, 1, 0, 1, 0, 0, 0, 0, 0];
        let path = [0x204D, 1, 0, 3, 3, 1, 1, 1];
        [&head[..], &path, &[0; 152]].concat()
    };
    words.iter().flat_map(|word| word.to_be_bytes()).collect()
}

fn frame(version: u16, kind: u16, body: &[u8]) -> Vec<u8> {
    let head: Vec<u8> = [version, kind, body.len() as u16].iter().flat_map(|word| word.to_be_bytes()).collect();
    [&[0xA0; 4][..], &head, body].concat()
}

fn word(bytes: &[u8], at: usize) -> u16 {
    u16::from_be_bytes([bytes[at], bytes[at + 1]])
}

fn reply(body: &[u8], answers: &[Answer]) -> Vec<u8> {
    let count = word(body, 0);
    let (mut out, mut at) = (count.to_be_bytes().to_vec(), 2);
    for _ in 0..count {
        let (device, path, function) = (word(body, at + 2), word(body, at + 4), word(body, at + 6));
        let argument = i32::from_be_bytes([body[at + 8], body[at + 9], body[at + 10], body[at + 11]]);
        let (exact, any) = (format!("{device}/{function:x} {argument:x}"), format!("{device}/{function:x}"));
        let found =
            answers.iter().find(|(key, _)| *key == exact).or_else(|| answers.iter().find(|(key, _)| *key == any));
        // A function that is not there is refused with 1; the library wants to know the control in any case.
        let system = ("1/18", bytes("0402 0020 2030 204d 44344631 32372e30 3033"));
        let found = found.or((any == "1/18").then_some(&system));
        let (code, data) = found.map_or((1, Vec::new()), |(_, data)| (0, data.clone()));
        let head = [16 + data.len() as u16, device, path, function, code, 0, 0, data.len() as u16];
        out.extend(head.iter().flat_map(|word| word.to_be_bytes()));
        out.extend(data);
        at += usize::from(word(body, at));
    }
    out
}

fn talk(mut stream: TcpStream, version: u16, answers: &Mutex<Vec<Answer>>) -> std::io::Result<()> {
    loop {
        let mut head = [0; 10];
        stream.read_exact(&mut head)?;
        let mut body = vec![0; usize::from(word(&head, 8))];
        stream.read_exact(&mut body)?;
        let answer = match word(&head, 6) {
            0x0101 => frame(version, 0x0102, &opening(version)),
            0x0201 => frame(version, 0x0202, &[]),
            _ => frame(version, 0x2102, &reply(&body, &answers.lock().expect("sound"))),
        };
        stream.write_all(&answer)?;
    }
}

/// A control of this version word that gives these answers and refuses everything else.
pub(crate) fn serve(version: u16, answers: Vec<Answer>) -> ByteControl {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("bound");
    let (stop, answers) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(answers)));
    let stopped = stop.clone();
    std::thread::spawn(move || {
        for stream in listener.incoming().flatten().take_while(|_| !stopped.load(Ordering::SeqCst)) {
            let answers = answers.clone();
            std::thread::spawn(move || talk(stream, version, &answers));
        }
    });
    ByteControl { address, stop }
}

/// The data of the only block of an answer of whoever listens there to one question.
pub(crate) fn ask(at: SocketAddr, device: u16, function: u16, argument: i32) -> Vec<u8> {
    let mut stream = TcpStream::connect(at).expect("listens");
    let mut exchange = |request: &[u8]| {
        stream.write_all(request).expect("sent");
        let mut head = [0; 10];
        stream.read_exact(&mut head).expect("a head");
        let mut body = vec![0; usize::from(word(&head, 8))];
        stream.read_exact(&mut body).expect("a body");
        body
    };
    exchange(&frame(1, 0x0101, &[0, 2]));
    let block: Vec<u8> = [1, 28, device, 1, function].iter().flat_map(|word: &u16| word.to_be_bytes()).collect();
    let body = exchange(&frame(1, 0x2101, &[&block[..], &argument.to_be_bytes(), &[0; 16]].concat()));
    assert_eq!(word(&body, 10), 0, "the code of {device}/{function:x} {argument}");
    body[18..].to_vec()
}
