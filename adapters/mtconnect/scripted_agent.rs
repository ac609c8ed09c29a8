//! A small agent on a real socket, for tests: a buffer of observations, answers in parts, and whatever bytes a test wants instead.

use std::collections::VecDeque;
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

/// One observation, as an element with its attributes but without its number.
#[derive(Debug, Clone)]
struct BufferedObservation {
    sequence: u64,
    container: &'static str,
    element: String,
    attributes: String,
    text: String,
}

/// What the agent knows.
pub(crate) struct AgentState {
    pub(crate) instance: u64,
    pub(crate) devices: String,
    next: u64,
    buffer: VecDeque<BufferedObservation>,
    pub(crate) buffer_size: usize,
    /// Does it answer in parts, where it is asked to?
    pub(crate) streams: bool,
    /// Bytes that are sent for a request whose path contains this word, instead of an answer.
    pub(crate) instead: Option<(&'static str, Vec<u8>)>,
    /// Sends nothing for requests whose path contains this word.
    pub(crate) silent: Option<&'static str>,
    /// Sends its answers to requests whose path contains this word byte by byte.
    pub(crate) slow: Option<&'static str>,
    /// Sends a part also when nothing has changed?
    pub(crate) has_heartbeat: bool,
    /// Takes the name of a device before a request?
    pub(crate) takes_names: bool,
    /// Sends parts not more often than this.
    pub(crate) least_interval_ms: u64,
    /// Ends every answer in parts.
    pub(crate) ends_streams: bool,
    pub(crate) requests: Vec<String>,
}

impl AgentState {
    /// An observation of a data item now.
    pub(crate) fn observe(&mut self, element: &str, item: &str, text: &str) {
        self.push("Samples", element, item, "", text);
    }

    /// A condition of a data item now.
    pub(crate) fn observe_condition(&mut self, level: &str, item: &str, code: &str, text: &str) {
        let code = if code.is_empty() { String::new() } else { format!(" nativeCode=\"{code}\"") };
        self.push("Condition", level, item, &format!(" type=\"SYSTEM\"{code}"), text);
    }

    fn push(&mut self, container: &'static str, element: &str, item: &str, more: &str, text: &str) {
        let now = jiff::Timestamp::now();
        let observation = BufferedObservation {
            sequence: self.next,
            container,
            element: element.to_owned(),
            attributes: format!("dataItemId=\"{item}\" timestamp=\"{now}\"{more}"),
            text: text.to_owned(),
        };
        self.next += 1;
        self.buffer.push_back(observation);
        while self.buffer.len() > self.buffer_size {
            self.buffer.pop_front();
        }
    }

    /// Starts anew: other numbers, nothing of before.
    pub(crate) fn restart(&mut self) {
        (self.instance, self.next) = (self.instance + 1, 1);
        self.buffer.clear();
    }

    fn first(&self) -> u64 {
        self.buffer.front().map_or(self.next, |observation| observation.sequence)
    }

    fn format_streams(&self, observations: &[&BufferedObservation], next: u64) -> String {
        let mut body = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?><MTConnectStreams><Header instanceId=\"{}\" firstSequence=\"{}\" lastSequence=\"{}\" nextSequence=\"{next}\" bufferSize=\"{}\"/><Streams><DeviceStream name=\"M1\" uuid=\"u1\"><ComponentStream component=\"Path\" name=\"p\">",
            self.instance,
            self.first(),
            self.next.saturating_sub(1),
            self.buffer_size
        );
        // Agents group by data item, so that numbers are not in order.
        for observation in observations.iter().rev() {
            let BufferedObservation { sequence, container, element, attributes, text } = observation;
            let _ = write!(
                body,
                "<{container}><{element} {attributes} sequence=\"{sequence}\">{text}</{element}></{container}>"
            );
        }
        body + "</ComponentStream></DeviceStream></Streams></MTConnectStreams>"
    }

    /// Observations from a number on, at most so many; and where the next question begins.
    fn take_sample(&self, from: u64, count: usize) -> (String, u64) {
        let found: Vec<&BufferedObservation> =
            self.buffer.iter().filter(|other| other.sequence >= from).take(count).collect();
        let next = found.last().map_or(from.max(self.first()), |last| last.sequence + 1);
        (self.format_streams(&found, next), next)
    }

    fn take_current(&self) -> String {
        let mut newest: Vec<&BufferedObservation> = Vec::new();
        for observation in self.buffer.iter().rev() {
            let item = |other: &BufferedObservation| other.attributes.split('"').nth(1).map(str::to_owned);
            if observation.container == "Condition" || !newest.iter().any(|known| item(known) == item(observation)) {
                newest.push(observation);
            }
        }
        self.format_streams(&newest, self.next)
    }
}

/// The agent; it ends with the test.
pub(crate) struct ScriptedAgent {
    pub(crate) port: u16,
    state: Arc<Mutex<AgentState>>,
    is_stopped: Arc<AtomicBool>,
}

impl ScriptedAgent {
    pub(crate) fn start(devices: &str) -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a port");
        let port = listener.local_addr().expect("bound").port();
        let state = AgentState {
            instance: 1,
            devices: devices.to_owned(),
            next: 1,
            buffer: VecDeque::new(),
            buffer_size: 4096,
            streams: true,
            instead: None,
            silent: None,
            slow: None,
            has_heartbeat: true,
            takes_names: true,
            least_interval_ms: 0,
            ends_streams: false,
            requests: Vec::new(),
        };
        let (state, stopped) = (Arc::new(Mutex::new(state)), Arc::new(AtomicBool::new(false)));
        let (of_thread, stop) = (state.clone(), stopped.clone());
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                if stop.load(Ordering::SeqCst) {
                    return;
                }
                let (state, stop) = (of_thread.clone(), stop.clone());
                std::thread::spawn(move || answer(stream, &state, &stop));
            }
        });
        Self { port, state, is_stopped: stopped }
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, AgentState> {
        self.state.lock().expect("no panic in the agent")
    }
}

impl Drop for ScriptedAgent {
    fn drop(&mut self) {
        self.is_stopped.store(true, Ordering::SeqCst);
        let _ = TcpStream::connect(("127.0.0.1", self.port));
    }
}

fn find_number(path: &str, key: &str) -> Option<u64> {
    let query = path.split_once('?')?.1;
    query.split('&').find_map(|pair| pair.strip_prefix(key)?.strip_prefix('=')?.parse().ok())
}

fn send_document(stream: &mut TcpStream, status: &str, body: &str) {
    // In chunks, as newer agents do.
    let _ = write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: text/xml\r\nTransfer-Encoding: chunked\r\n\r\n{:x}\r\n{body}\r\n0\r\n\r\n",
        body.len()
    );
}

fn answer(mut stream: TcpStream, state: &Mutex<AgentState>, stopped: &AtomicBool) {
    let mut lines = BufReader::new(stream.try_clone().expect("a copy")).lines().map_while(Result::ok);
    let path = lines.next().and_then(|line| line.split(' ').nth(1).map(str::to_owned)).unwrap_or_default();
    lines.find(String::is_empty);
    let mut known = state.lock().expect("no panic");
    known.requests.push(path.clone());
    if let Some((_, bytes)) = known.instead.as_ref().filter(|(word, _)| path.contains(word)) {
        let bytes = bytes.clone();
        drop(known);
        let _ = stream.write_all(&bytes);
        return;
    }
    if known.silent.is_some_and(|word| path.contains(word)) {
        drop(known);
        while !stopped.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(20));
        }
        return;
    }
    let device = path.trim_start_matches('/').split('/').next().unwrap_or_default();
    let refusal = |code: &str| {
        format!(
            "<MTConnectError><Header instanceId=\"1\"/><Errors><Error errorCode=\"{code}\">refused</Error></Errors></MTConnectError>"
        )
    };
    if path.contains("probe") {
        let is_known = device == "probe" || known.takes_names && known.devices.contains(&format!("name=\"{device}\""));
        let body = if is_known { known.devices.clone() } else { refusal("NO_DEVICE") };
        drop(known);
        return send_document(&mut stream, if is_known { "200 OK" } else { "404 Not Found" }, &body);
    }
    if known.slow.is_some_and(|word| path.contains(word)) {
        drop(known);
        let _ = stream.write_all(b"HTTP/1.1 200 OK\r\n\r\n");
        while !stopped.load(Ordering::SeqCst) && stream.write_all(b" ").is_ok() {
            std::thread::sleep(Duration::from_millis(100));
        }
        return;
    }
    if path.contains("current") {
        let body = known.take_current();
        drop(known);
        return send_document(&mut stream, "200 OK", &body);
    }
    let (from, count) =
        (find_number(&path, "from").unwrap_or(known.first()), find_number(&path, "count").unwrap_or(100));
    let least_ms = known.least_interval_ms;
    let interval =
        find_number(&path, "interval").filter(|_| known.streams).map(|interval_ms| interval_ms.max(least_ms));
    if from < known.first() {
        drop(known);
        return send_document(&mut stream, "404 Not Found", &refusal("OUT_OF_RANGE"));
    }
    let count = usize::try_from(count).expect("small");
    let Some(interval_ms) = interval else {
        let (body, _) = known.take_sample(from, count);
        drop(known);
        return send_document(&mut stream, "200 OK", &body);
    };
    drop(known);
    let _ = stream.write_all(b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=edge\r\n\r\n");
    stream_parts(&mut stream, state, stopped, from, count, Duration::from_millis(interval_ms));
}

fn stream_parts(
    stream: &mut TcpStream,
    state: &Mutex<AgentState>,
    stopped: &AtomicBool,
    mut from: u64,
    count: usize,
    interval: Duration,
) {
    while !stopped.load(Ordering::SeqCst) {
        let known = state.lock().expect("no panic");
        if known.silent.is_some_and(|word| "sample".contains(word)) {
            drop(known);
            std::thread::sleep(interval);
            continue;
        }
        let (body, next) = known.take_sample(from, count);
        let (ends, has_heartbeat) = (known.ends_streams, known.has_heartbeat);
        drop(known);
        let is_quiet = next == from && !has_heartbeat;
        from = next;
        if is_quiet {
            std::thread::sleep(interval);
            continue;
        }
        let part = format!("\r\n--edge\r\nContent-type: text/xml\r\nContent-length: {}\r\n\r\n{body}\r\n", body.len());
        if stream.write_all(part.as_bytes()).is_err() || ends {
            return;
        }
        std::thread::sleep(interval);
    }
}
