//! Lines that change bytes: a whole box whose control, meter and broker are reached through relays that turn bits, and whose page is
//! asked by clients that are not in order. It may say that nothing works; it may not end, panic or grow.

use crate::fuzz::mutate;
use crate::line::{Fault, Line};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use testkit::broker::Broker;
use testkit::port::free_port;
use testkit::process::{Gateway, get, program, text, wait_for};
use testkit::process_status::status_figure;

/// What the box may hold at the end, MB: several times what it holds without faults.
const RESIDENT_MAX_MB: f64 = 200.0;

/// A served machine and how to reach it through a relay.
fn served(arguments: &[&str], scheme: &str) -> (Gateway, Line) {
    let at = format!("127.0.0.1:{}", free_port());
    let mut command = program();
    command.args(arguments).args(["--listen", &at]);
    let gateway = Gateway::spawn(command);
    wait_for(scheme, Duration::from_secs(60), || TcpStream::connect(&at).ok());
    (gateway, Line::to(&at))
}

fn resident_mb(pid: u32) -> f64 {
    status_figure(&pid.to_string(), "VmRSS:").unwrap_or(0.0) / 1024.0
}

/// Requests that are nearly right, each on a connection of its own; how many.
fn ask(address: &str, random: &mut Pcg64Mcg, until: Instant) -> u64 {
    let body = "{\"name\":\"admin\",\"token\":\"wrong\"}";
    let head = |rest: &str| format!("{rest} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n");
    let seeds: Vec<Vec<u8>> = [
        head("GET /api/v1/status") + "\r\n",
        head("GET /api/v1/history?channels=spindle_power_w&from=-5m")
            + "Cookie: session=abc\r\nAccept-Language: zh\r\n\r\n",
        head("POST /api/v1/login") + "Content-Type: application/json\r\nContent-Length: 33\r\n\r\n" + body,
        head("POST /api/v1/disarm") + "Transfer-Encoding: chunked\r\n\r\n5\r\nname=\r\n0\r\n\r\n",
        head("PUT /api/v1/scripts/own.rhai") + "Authorization: Bearer admin:x\r\nContent-Length: 3\r\n\r\nabc",
    ]
    .map(String::into_bytes)
    .to_vec();
    let mut asked = 0;
    while Instant::now() < until {
        let Ok(mut stream) = TcpStream::connect(address) else { continue };
        let _limits = stream.set_read_timeout(Some(Duration::from_millis(200)));
        let _sent = stream.write_all(&mutate::mutated(&seeds, random));
        let _answered = stream.read(&mut [0; 512]);
        asked += 1;
    }
    asked
}

fn run(lasts: Duration, seed: u64) {
    let (_control, fanuc) = served(&["serve", "fanuc", "--machine", "simulated://lathe?seed=7"], "FANUC");
    let (_meter, modbus) =
        served(&["serve", "modbus", "--machine", "simulated://lathe", "--profile", "iem3000"], "Modbus");
    let broker = Broker::start();
    let mqtt = broker.as_ref().map(|broker| Line::to(&format!("127.0.0.1:{}", broker.port)));
    let directory = tempfile::tempdir().expect("a directory");
    let mut lines = format!(
        "[[source]]\nname = \"lathe\"\naddress = \"fanuc://127.0.0.1:{}\"\n\
         [[source]]\nname = \"meter\"\naddress = \"modbus-tcp://127.0.0.1:{}?unit=1&profile=iem3000\"\n",
        fanuc.port, modbus.port
    );
    if let Some(line) = &mqtt {
        lines += &format!(
            "[[sink]]\nname = \"plain\"\naddress = \"mqtt://127.0.0.1:{0}/works/lathe\"\n\
             [[sink]]\nname = \"plug\"\naddress = \"sparkplug://127.0.0.1:{0}/plant/line/lathe\"\nallow_requests = true\n",
            line.port
        );
    }
    let config = directory.path().join("box.toml");
    fs::write(&config, lines).expect("written");
    let mut gateway = Gateway::start(&directory.path().join("data"), &["--config", text(&config)]);
    let address = gateway.address();
    let ticks = || get(&address, "/api/v1/status").json()["tick"]["count"].as_u64().unwrap_or(0);
    wait_for("ticks", Duration::from_secs(60), || (ticks() > 20).then_some(()));
    let all: Vec<&Line> = [Some(&fanuc), Some(&modbus), mqtt.as_ref()].into_iter().flatten().collect();
    all.iter().for_each(|line| line.set(Fault::Change));
    let asked = ask(&address, &mut Pcg64Mcg::seed_from_u64(seed), Instant::now() + lasts);
    let (changed, connections): (u64, u64) =
        all.iter().map(|line| (line.changed(), line.connections())).fold((0, 0), |(a, b), (c, d)| (a + c, b + d));
    all.iter().for_each(|line| line.set(Fault::None));
    let before = ticks();
    wait_for("further ticks", Duration::from_secs(20), || (ticks() > before + 5).then_some(()));
    wait_for("the control again", Duration::from_secs(90), || {
        let status = get(&address, "/api/v1/status").json();
        let channels = status["channels"].as_array()?;
        channels.iter().find(|row| row["name"] == "feed_override_pct")?["value"].is_number().then_some(())
    });
    let resident = resident_mb(gateway.pid());
    let said = gateway.stop();
    println!(
        "lines: {changed} changes on {connections} connections, {asked} requests, {resident:.0} MB at the end, {:.0} s",
        lasts.as_secs_f64()
    );
    assert!(!said.contains("panicked"), "{said}");
    assert!(resident < RESIDENT_MAX_MB, "{resident} MB");
    assert!(changed > 20 && asked > 20, "nothing was tried");
}

#[test]
fn lines_that_change_bytes_break_nothing() {
    run(Duration::from_secs(12), 20_261_127);
}

#[test]
#[ignore = "10 minutes unless FUZZ_MINUTES says otherwise: the same for longer"]
fn lines_for_hours() {
    let minutes = std::env::var("FUZZ_MINUTES").ok().and_then(|text| text.parse().ok()).unwrap_or(10.0_f64);
    run(Duration::from_secs_f64(minutes * 60.0), crate::fuzz::seed_of_now());
}
