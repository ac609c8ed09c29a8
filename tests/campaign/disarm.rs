//! Disarm by every route, under everything that could be in the way.

use crate::armed::{Machine, Plain, arm_by_socket, disarm_by_socket, fill, on_small_disk};
use crate::table::{Row, Scale};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use testkit::process::{request, run, stdout, text, wait_for};

/// The aim: from the order to its answer.
const WITHIN: Duration = Duration::from_millis(100);

fn post(address: &str, head: &str, body: &str) -> u16 {
    post_to(address, "/api/v1/disarm", head, body)
}

fn post_to(address: &str, path: &str, head: &str, body: &str) -> u16 {
    let length = body.len();
    let text = format!("POST {path} HTTP/1.0\r\nHost: {address}\r\n{head}Content-Length: {length}\r\n\r\n{body}");
    request(address, &text).status
}

/// The ways in which a person gives the machine back.
struct Routes {
    address: String,
    socket: PathBuf,
    cookie: String,
    bearer: String,
    form: String,
}

impl Routes {
    fn of(held: &Plain, socket: PathBuf) -> Self {
        let data = socket.parent().expect("the data directory");
        let made = run(&["person", "token", "admin", "--data-dir", text(data)]);
        let token = stdout(&made).trim().rsplit(' ').next().expect("a token").to_owned();
        let named = format!("{{\"name\":\"admin\",\"token\":\"{token}\"}}");
        let head =
            format!("POST /api/v1/login HTTP/1.0\r\nHost: {}\r\nContent-Type: application/json\r\n", held.address);
        let signed = request(&held.address, &format!("{head}Content-Length: {}\r\n\r\n{named}", named.len()));
        let set = signed.head.lines().find_map(|line| line.strip_prefix("set-cookie: "));
        let cookie = set.and_then(|set| set.split(';').next()).expect("a session");
        Self {
            address: held.address.clone(),
            socket,
            cookie: format!("Cookie: {cookie}\r\n"),
            bearer: format!("Authorization: Bearer admin:{token}\r\n"),
            form: format!("name=admin&token={token}"),
        }
    }

    fn disarm(&self, route: &str) -> bool {
        match route {
            "socket" => disarm_by_socket(&self.socket).is_some(),
            "bearer" => post(&self.address, &self.bearer, "") == 200,
            "cookie" => post(&self.address, &self.cookie, "") == 200,
            _ => {
                let head = "Content-Type: application/x-www-form-urlencoded\r\n";
                [200, 303].contains(&post(&self.address, head, &self.form))
            }
        }
    }

    /// Each route so often; gives the greatest time of each.
    fn measure(&self, what: &str, times: usize, row: &mut Row) -> Vec<(String, Duration)> {
        let mut greatest = Vec::new();
        for route in ["socket", "bearer", "cookie", "form"] {
            let mut worst = Duration::ZERO;
            for _ in 0..times {
                let began = Instant::now();
                let done = self.disarm(route);
                worst = worst.max(began.elapsed());
                row.n += 1;
                row.must(done, format!("{what}, {route}: refused"));
            }
            greatest.push((format!("{what}, {route}"), worst));
        }
        greatest
    }
}

/// See the [module](self).
pub(crate) fn disarm(scale: &Scale) -> Row {
    let mut row = Row::new(
        "socket, bearer, cookie, form; while locked out, under 8 floods of wrong tokens, on a full disk, with a dead source; request to answer",
    );
    let machine = Machine::start();
    let Some((held, disk)) = on_small_disk(&machine) else { return Row::skipped(row.how) };
    let (times, socket) = (scale.of(20, 3), disk.join("control.sock"));
    arm_by_socket(&disk, &held.address, &machine);
    let began = Instant::now();
    disarm_by_socket(&socket).expect("disarmed");
    wait_for("the dial", Duration::from_secs(5), || machine.is_at_dial());
    let at_machine = began.elapsed();
    let routes = Routes::of(&held, socket);
    let mut worst = routes.measure("nothing in the way", times, &mut row);
    for _ in 0..6 {
        let wrong = "{\"name\":\"admin\",\"token\":\"aaaa\"}";
        post_to(&held.address, "/api/v1/login", "Content-Type: application/json\r\n", wrong);
    }
    worst.extend(routes.measure("locked out", times, &mut row));
    let stop = Arc::new(AtomicBool::new(false));
    let floods: Vec<_> = (0..8).map(|index| flood(held.address.clone(), index, stop.clone())).collect();
    worst.extend(routes.measure("flood", times, &mut row));
    stop.store(true, Ordering::SeqCst);
    let sent: u64 = floods.into_iter().map(|flood| flood.join().unwrap_or(0)).sum();
    fill(&disk);
    std::thread::sleep(Duration::from_secs(8));
    worst.extend(routes.measure("full disk", times, &mut row));
    machine.dies();
    std::thread::sleep(Duration::from_secs(3));
    worst.extend(routes.measure("dead source", times, &mut row));
    println!("disarm: {worst:?}");
    worst.sort_by_key(|(_, time)| *time);
    let (what, time) = worst.last().cloned().unwrap_or_default();
    row.recovers = Some(time);
    row.must(time <= WITHIN, format!("{what}: {time:?}"));
    let at_machine = at_machine.as_millis();
    row.note = format!("greatest: {what}; dial in force {at_machine} ms after the order; flood of {sent} requests");
    row.out_of_band = Some(machine.outside.load(Ordering::SeqCst));
    row.must(row.out_of_band == Some(0), "something else was in force");
    row
}

fn flood(address: String, index: usize, stop: Arc<AtomicBool>) -> std::thread::JoinHandle<u64> {
    std::thread::spawn(move || {
        let mut sent = 0;
        while !stop.load(Ordering::SeqCst) {
            let body = format!("{{\"name\":\"p{}\",\"token\":\"wrong{sent}\"}}", index + sent as usize % 3);
            if std::net::TcpStream::connect(&address).is_ok() {
                let _refused = std::panic::catch_unwind(|| post(&address, "Content-Type: application/json\r\n", &body));
                sent += 1;
            }
        }
        sent
    })
}
