//! Files of strangers on the page: mutated, packed, repeated. The gateway lives on and stays small, whatever they are; children that read
//! them have their limits.

use super::editing::person;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::Value;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use testkit::process::{Gateway, get, wait_for};
use testkit::process_status::status_figure;

/// Resident memory that the gateway may come to, MB.
pub(super) const GATEWAY_MB: f64 = 120.0;
/// The same of a child.
pub(super) const CHILD_MB: f64 = 512.0;
/// 20 s of the processor, which a computer with other work shares.
const CHILD_WITHIN: Duration = Duration::from_secs(60);

/// A box with somebody who may bring files.
pub(super) struct PageBox {
    pub(super) gateway: Gateway,
    pub(super) address: String,
    pub(super) token: String,
    pub(super) data: PathBuf,
    _directory: tempfile::TempDir,
}

impl PageBox {
    pub(super) fn start() -> Self {
        let directory = tempfile::tempdir().expect("a directory");
        let data = directory.path().join("data");
        let gateway = Gateway::start(&data, &[]);
        Self::of_gateway(directory, gateway, data)
    }

    pub(super) fn of_gateway(directory: tempfile::TempDir, mut gateway: Gateway, data: PathBuf) -> Self {
        let address = gateway.address();
        let token = person(&data, "Li", "setter");
        wait_for("the status", Duration::from_secs(30), || {
            (get(&address, "/api/v1/status").status == 200).then_some(())
        });
        Self { gateway, address, token, data, _directory: directory }
    }

    /// Brings a file; status and document, when it is read.
    fn bring(&self, name: &str, bytes: &[u8]) -> (u16, Value) {
        let (status, told) = bring(&self.address, &self.token, name, bytes);
        (status, wait_until_read(&self.address, told))
    }

    pub(super) fn peak_mb(&self) -> f64 {
        find_peak_mb(&self.gateway.pid().to_string()).expect("it lives")
    }
}

fn bring(address: &str, token: &str, name: &str, bytes: &[u8]) -> (u16, Value) {
    let mut stream = begin(address, token, name, &format!("Content-Length: {}", bytes.len()));
    stream.write_all(bytes).expect("sent");
    read_answer(stream)
}

/// The head of a request that brings a file.
pub(super) fn begin(address: &str, token: &str, name: &str, length: &str) -> TcpStream {
    let mut stream = TcpStream::connect(address).expect("it listens");
    stream.set_read_timeout(Some(Duration::from_secs(90))).expect("a limit");
    let head = format!(
        "POST /api/v1/files?name={name} HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer Li:{token}\r\n\
         Content-Type: application/octet-stream\r\n{length}\r\nConnection: close\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).expect("sent");
    stream
}

/// Status and document.
pub(super) fn read_answer(mut stream: TcpStream) -> (u16, Value) {
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).expect("an answer");
    let answer = String::from_utf8_lossy(&answer).into_owned();
    let status = answer.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0);
    let body = answer.split_once("\r\n\r\n").map_or("", |(_, body)| body);
    let json = body.find('{').and_then(|from| body.rfind('}').map(|to| &body[from..=to]));
    (status, json.and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default())
}

/// Asks until the file is read.
pub(super) fn wait_until_read(address: &str, mut told: Value) -> Value {
    while told["reading"] == true {
        let key = told["key"].as_str().expect("a key").to_owned();
        std::thread::sleep(Duration::from_secs(1));
        told = get(address, &format!("/api/v1/files/{key}")).json();
    }
    told
}

/// The foreign files of the tests, as they are.
fn seeds() -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/foreign");
    let files = std::fs::read_dir(folder).expect("a folder").flatten().filter(|file| file.path().is_file());
    let mut seeds: Vec<(String, Vec<u8>)> = files
        .map(|file| (file.file_name().to_string_lossy().into_owned(), std::fs::read(file.path()).expect("readable")))
        .filter(|(name, bytes)| !name.ends_with(".toml") && bytes.len() < 1 << 20)
        .collect();
    seeds.sort();
    seeds
}

/// Bytes changed, cut, doubled or repeated.
fn mutate(bytes: &[u8], random: &mut Pcg64Mcg) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..random.random_range(1..6) {
        let (at, other) = (random.random_range(0..bytes.len()), random.random_range(0..bytes.len()));
        match random.random_range(0..5) {
            0 => bytes[at] = random.random(),
            1 => bytes.truncate(at.max(1)),
            2 => bytes.extend_from_within(at.min(other)..at.max(other)),
            3 => bytes[at..].iter_mut().take(8).for_each(|byte| *byte = 0xff),
            _ => bytes.swap(at, other),
        }
    }
    bytes
}

/// Brings so many mutated files, and watches the gateway and its children meanwhile.
fn campaign(files: usize, seed: u64) {
    let held = PageBox::start();
    let (over, pid) = (Arc::new(AtomicBool::new(false)), held.gateway.pid());
    let watched = over.clone();
    let watch = std::thread::spawn(move || watch_children(pid, &watched));
    let (seeds, mut random) = (seeds(), Pcg64Mcg::seed_from_u64(seed));
    let (mut understood, mut refused, mut longest) = (0, 0, Duration::ZERO);
    for index in 0..files {
        let (name, bytes) = &seeds[(index * 7) % seeds.len()];
        let began = Instant::now();
        let (status, told) = held.bring(name, &mutate(bytes, &mut random));
        longest = longest.max(began.elapsed());
        assert_eq!(status, 200, "{name}: {told}");
        if told["error"].is_object() { refused += 1 } else { understood += 1 }
    }
    assert_eq!(get(&held.address, "/healthz").status, 200);
    over.store(true, Ordering::SeqCst);
    let (child_mb, seen) = watch.join().expect("no panic");
    let peak_mb = held.peak_mb();
    println!(
        "{files} files: {understood} understood, {refused} refused; gateway at most {peak_mb:.0} MB; children at most {child_mb:.0} MB ({seen} \
         looks); the longest answer {} ms",
        longest.as_millis()
    );
    assert!(seen > 0, "no child was seen");
    assert!(peak_mb <= GATEWAY_MB && child_mb <= CHILD_MB && longest < CHILD_WITHIN);
    held.gateway.stop();
}

/// The greatest memory of any child until it is over, MB, and how often one was looked at.
pub(super) fn watch_children(pid: u32, over: &AtomicBool) -> (f64, usize) {
    let (mut most_mb, mut seen) = (0.0_f64, 0);
    while !over.load(Ordering::SeqCst) {
        let tasks = std::fs::read_dir(format!("/proc/{pid}/task")).expect("it lives").flatten();
        for task in tasks {
            let children = std::fs::read_to_string(task.path().join("children")).unwrap_or_default();
            for child in children.split_whitespace() {
                if let Some(mb) = find_peak_mb(child) {
                    (most_mb, seen) = (most_mb.max(mb), seen + 1);
                }
            }
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    (most_mb, seen)
}

/// The most memory that a process has had, MB.
fn find_peak_mb(pid: &str) -> Option<f64> {
    status_figure(pid, "VmHWM:").map(|kilobytes| kilobytes / 1024.0)
}

#[test]
fn a_dozen_mutated_files_leave_the_gateway_as_it_was() {
    campaign(12, 1);
}

#[test]
#[ignore = "5 minutes: 300 mutated files, each read by a process of its own, leave the gateway as it was"]
fn three_hundred_mutated_files_leave_the_gateway_as_it_was() {
    campaign(300, 2);
}

#[test]
fn files_brought_at_once_are_all_listed_and_large_ones_are_taken() {
    let held = PageBox::start();
    let large =
        format!("time_s,spindle_power_w\n{}", (0..250_000).map(|row| format!("{row},100\n")).collect::<String>());
    assert!(large.len() > 2 << 20, "longer than the library's own limit");
    let (status, told) = held.bring("large.csv", large.as_bytes());
    assert_eq!((status, &told["rows"]), (200, &Value::from(250_000)), "{told}");
    std::thread::scope(|scope| {
        for number in 0..12 {
            let held = &held;
            scope.spawn(move || {
                let text = format!("time_s,spindle_power_w\n0,{number}\n1,5\n2,6\n");
                assert_eq!(held.bring(&format!("f{number}.csv"), text.as_bytes()).0, 200);
            });
        }
    });
    let listed = get(&held.address, "/api/v1/files").json();
    assert_eq!(listed["files"].as_array().map(Vec::len), Some(13), "{}", listed["files"]);
    held.gateway.stop();
}

#[test]
fn a_file_that_breaks_its_child_is_set_aside_and_not_read_again() {
    let held = PageBox::start();
    // 800 MB of different words in one column, packed.
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    packer.write_all(b"time_s,program\n").expect("packed");
    for row in 0..400_u32 {
        packer.write_all(format!("{row},{row:04}").as_bytes()).expect("packed");
        packer.write_all(&vec![b'x'; 2 << 20]).expect("packed");
        packer.write_all(b"\n").expect("packed");
    }
    let packed = packer.finish().expect("packed");
    let (status, told) = held.bring("bomb.csv.gz", &packed);
    assert!(status == 200 && told["error"]["en"].is_string(), "{status} {told}");
    let began = Instant::now();
    let key = told["key"].as_str().expect("a key");
    let again = get(&held.address, &format!("/api/v1/files/{key}")).json();
    assert_eq!(again["error"], told["error"]);
    assert!(began.elapsed() < Duration::from_secs(2), "it was read again: {:?}", began.elapsed());
    assert!(held.peak_mb() <= GATEWAY_MB, "{} MB", held.peak_mb());
    held.gateway.stop();
}
