//! Faults while the gate is armed: the machine is another process than the gateway, and what is in force there is looked at every
//! few milliseconds.

use crate::clocks::{Clocked, LEAPS};
use crate::kills::status;
use crate::table::{Row, Scale};
use adapters::address::SimulatedMachine;
use adapters::clock::{Clock, SystemClock};
use adapters::fanuc::item::Area;
use adapters::fanuc_server::{Server, ServerSettings, SimulatedControl};
use adapters::simulated::{Simulated, SimulatedSettings};
use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use testkit::process::{Gateway, program, run, stderr, stdout, text, wait_for};

/// How long the control has been on: its spindle has just turned free, so that the gate knows the state of the machine soon.
const ON_NS: i64 = 260_000_000_000;
/// What the script asks for, and the band of the gate: nothing else may ever be in force.
const ASKED: u8 = 70;
const BAND: std::ops::RangeInclusive<u8> = 50..=100;
/// The ladder's patience with the sign of life, and a few scans.
const HEARTBEAT: Duration = Duration::from_millis(1500);

/// The machine, and what is in force there.
pub(crate) struct Machine {
    server: Arc<Mutex<Option<Server>>>,
    address: String,
    in_force: Arc<AtomicU8>,
    pub(crate) outside: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
}

impl Machine {
    pub(crate) fn start() -> Self {
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        let settings = SimulatedSettings { machine: SimulatedMachine::Lathe, ..SimulatedSettings::default() };
        let machine = Simulated::new("simulated://lathe", settings, clock.now_ns() - ON_NS);
        let control = SimulatedControl::new(machine, clock, 4);
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let server = Server::start(listener, Box::new(control), ServerSettings::default()).expect("threads");
        let machine = Self {
            address: server.address().to_string(),
            server: Arc::new(Mutex::new(Some(server))),
            in_force: Arc::new(AtomicU8::new(100)),
            outside: Arc::default(),
            stop: Arc::default(),
        };
        machine.watch();
        machine
    }

    fn watch(&self) {
        let (server, in_force) = (self.server.clone(), self.in_force.clone());
        let (outside, stop) = (self.outside.clone(), self.stop.clone());
        std::thread::spawn(move || {
            // Before the first scan of the ladder the memory is empty.
            let mut scanned = false;
            while !stop.load(Ordering::SeqCst) {
                let held = server.lock().expect("whole");
                let pct = held.as_ref().and_then(|server| {
                    server.with(|control| control.map(|control| 255 - control.memory.read_byte(Area::G, 12)))
                });
                drop(held);
                scanned |= pct.is_some_and(|pct| BAND.contains(&pct));
                if let Some(pct) = pct.filter(|_| scanned) {
                    in_force.store(pct, Ordering::SeqCst);
                    outside.fetch_add(u64::from(!BAND.contains(&pct)), Ordering::SeqCst);
                }
                std::thread::sleep(Duration::from_millis(4));
            }
        });
    }

    fn in_force(&self) -> u8 {
        self.in_force.load(Ordering::SeqCst)
    }

    pub(crate) fn is_at_dial(&self) -> Option<()> {
        (self.in_force() == 100).then_some(())
    }

    /// The control is switched off.
    pub(crate) fn dies(&self) {
        drop(self.server.lock().expect("whole").take());
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
    }
}

const SCRIPT: &str = "request_feed_override(70, \"campaign\");";

fn sections(machine: &Machine) -> String {
    format!(
        "allow_arming = true\n[[source]]\naddress = \"fanuc://{}?write=mailbox&dial=R907\"\nname = \"lathe\"\n\
         [gate]\nmode = \"armed\"\nsource = \"lathe\"\nabove_dial = true\nstale_s = 2.0\n",
        machine.address
    )
}

fn put_script(directory: &Path) {
    let scripts = directory.join("data/scripts");
    std::fs::create_dir_all(&scripts).expect("a directory");
    std::fs::write(scripts.join("own.rhai"), SCRIPT).expect("a script");
}

fn arm(config: &Path) {
    let told = run(&["arm", "--for", "30m", "--by", "fitter", "--config", text(config)]);
    assert!(told.status.success(), "{}{}", stdout(&told), stderr(&told));
}

/// Armed, and the override of the script in force at the machine.
fn armed(config: &Path, address: &str, machine: &Machine) {
    wait_for("a decision", Duration::from_secs(120), || {
        status(address)?["gate"]["permitted_pct"].is_number().then_some(())
    });
    arm(config);
    wait_for("the override in force", Duration::from_secs(180), || (machine.in_force() <= ASKED + 10).then_some(()));
}

fn is_armed(address: &str) -> bool {
    status(address).is_some_and(|status| status["gate"]["armed_by"].is_string())
}

fn disarmed_because(address: &str) -> String {
    status(address)
        .map_or_else(String::new, |status| status["gate"]["disarmed"].as_str().unwrap_or_default().to_owned())
}

/// A box without a clock of its own choice.
pub(crate) struct Plain {
    directory: tempfile::TempDir,
    pub(crate) gateway: Gateway,
    pub(crate) address: String,
}

impl Plain {
    fn start(machine: &Machine) -> Self {
        let directory = tempfile::tempdir().expect("a directory");
        put_script(directory.path());
        let config = directory.path().join("box.toml");
        let written =
            format!("[gateway]\ndata_dir = \"data\"\n[http]\nlisten = \"127.0.0.1:0\"\n{}", sections(machine));
        std::fs::write(&config, written).expect("a configuration");
        let mut command = program();
        command.args(["run", "--config", text(&config)]);
        let mut gateway = Gateway::spawn(command);
        let address = gateway.address();
        Self { directory, gateway, address }
    }

    fn config(&self) -> std::path::PathBuf {
        self.directory.path().join("box.toml")
    }
}

/// The leaps of the clock, with the gate armed and an override in force: nothing changes at the machine.
pub(crate) fn clock_leaps(scale: &Scale) -> Row {
    let mut row = Row::new("each leap for 4 s while an override is in force; the override at the machine, every 4 ms");
    let machine = Machine::start();
    let Some(clocked) = Clocked::new(60.0, &sections(&machine)) else { return Row::skipped(row.how) };
    put_script(clocked.directory.path());
    let (gateway, address) = clocked.start();
    armed(&clocked.config(), &address, &machine);
    let until = status(&address).map(|status| status["gate"]["armed_until_ms"].clone());
    for _ in 0..scale.of(2, 1) {
        for leap in LEAPS {
            clocked.set(leap);
            std::thread::sleep(Duration::from_secs(4));
            row.must(is_armed(&address), format!("{leap}: disarmed, {}", disarmed_because(&address)));
            let now = status(&address).map(|status| status["gate"]["armed_until_ms"].clone());
            row.must(now == until, format!("{leap}: the arming lasts until {now:?}, not {until:?}"));
            clocked.set("+0s");
            std::thread::sleep(Duration::from_secs(1));
            row.n += 1;
        }
    }
    row.out_of_band = Some(machine.outside.load(Ordering::SeqCst));
    row.must(row.out_of_band == Some(0), "something else was in force");
    // A reading that has stood long enough is followed, and then nobody has armed the gate.
    clocked.set("-3600s");
    let again = clocked.again(&gateway, 2);
    wait_for("the dial", Duration::from_secs(20), || machine.is_at_dial());
    wait_for("a status", Duration::from_secs(60), || status(&again));
    row.must(!is_armed(&again), "armed after another clock was followed");
    row.must(gateway.said().contains("the clock of the box was set"), "the end of the arming was not told");
    row.note = "followed at last: disarmed, told, at the dial".to_owned();
    gateway.stop();
    row
}

/// SIGSTOP for 20 s: the ladder falls back, and afterwards the gate is not armed.
pub(crate) fn stopped(scale: &Scale) -> Row {
    let mut row = Row::new("SIGSTOP for 20 s while an override is in force, then SIGCONT; the override at the machine");
    let machine = Machine::start();
    let held = Plain::start(&machine);
    for _ in 0..scale.of(3, 1) {
        armed(&held.config(), &held.address, &machine);
        held.gateway.signal("STOP");
        let began = Instant::now();
        wait_for("the dial, by the ladder", Duration::from_secs(19), || machine.is_at_dial());
        row.recovered(began.elapsed());
        std::thread::sleep(Duration::from_secs(20).saturating_sub(began.elapsed()));
        held.gateway.signal("CONT");
        // The override must not come back by itself, not even for a scan.
        let until = Instant::now() + Duration::from_secs(8);
        let mut back = 0;
        while Instant::now() < until {
            back += u64::from(machine.in_force() != 100);
            std::thread::sleep(Duration::from_millis(4));
        }
        row.out_of_band = Some(row.out_of_band.unwrap_or(0) + back);
        let why = disarmed_because(&held.address);
        row.must(!is_armed(&held.address) && !why.is_empty(), format!("armed after 20 s without a tick: {why}"));
        row.note = format!("disarmed: {why}");
        row.n += 1;
    }
    row.must(row.out_of_band == Some(0), "an override was in force again");
    row
}

/// kill -9: the ladder falls back, and the next start withdraws what was left enabled.
pub(crate) fn killed(scale: &Scale) -> Row {
    let mut row = Row::new("SIGKILL while an override is in force; time until the dial counts");
    for _ in 0..scale.of(5, 1) {
        let machine = Machine::start();
        let held = Plain::start(&machine);
        armed(&held.config(), &held.address, &machine);
        held.gateway.kill();
        let began = Instant::now();
        wait_for("the dial", Duration::from_secs(20), || machine.is_at_dial());
        row.recovered(began.elapsed());
        row.must(began.elapsed() < HEARTBEAT + Duration::from_secs(2), format!("{:?}", began.elapsed()));
        row.out_of_band = Some(row.out_of_band.unwrap_or(0) + machine.outside.load(Ordering::SeqCst));
        row.n += 1;
    }
    row.must(row.out_of_band == Some(0), "something else was in force");
    row
}

/// The control goes off while an override is in force: the arming ends.
pub(crate) fn control_dies(scale: &Scale) -> Row {
    let mut row = Row::new("the control ends while an override is in force; time until the gate is not armed any more");
    for _ in 0..scale.of(3, 1) {
        let machine = Machine::start();
        let held = Plain::start(&machine);
        armed(&held.config(), &held.address, &machine);
        machine.dies();
        let began = Instant::now();
        wait_for("the end of the arming", Duration::from_secs(40), || (!is_armed(&held.address)).then_some(()));
        row.recovered(began.elapsed());
        row.note = format!("disarmed: {}", disarmed_because(&held.address));
        row.out_of_band = Some(row.out_of_band.unwrap_or(0) + machine.outside.load(Ordering::SeqCst));
        row.n += 1;
    }
    row.must(row.out_of_band == Some(0), "something else was in force");
    row
}

/// A box on a disk of its own that can be filled.
pub(crate) fn on_small_disk(machine: &Machine) -> Option<(Plain, std::path::PathBuf)> {
    let possible =
        std::process::Command::new("unshare").args(["-rm", "sh", "-c", "mount -t tmpfs tmpfs /mnt"]).status();
    if !possible.is_ok_and(|status| status.success()) {
        return None;
    }
    let directory = tempfile::tempdir().expect("a directory");
    let disk = directory.path().join("data");
    std::fs::create_dir(&disk).expect("a directory");
    std::fs::write(directory.path().join("own.rhai"), SCRIPT).expect("a script");
    let config = directory.path().join("box.toml");
    let written = format!("[gateway]\ndata_dir = \"data\"\n[http]\nlisten = \"127.0.0.1:0\"\n{}", sections(machine));
    std::fs::write(&config, written).expect("a configuration");
    let script = "mount -t tmpfs -o size=24m tmpfs \"$1\" && mkdir \"$1/scripts\" && cp \"$3\" \"$1/scripts/\" && exec \"$2\" run --config \"$4\"";
    let mut command = std::process::Command::new("unshare");
    command.args(["-rm", "sh", "-c", script, "sh"]).arg(&disk).arg(env!("CARGO_BIN_EXE_cnc-gateway"));
    command.arg(directory.path().join("own.rhai")).arg(&config);
    let mut gateway = Gateway::spawn(command);
    let address = gateway.address();
    // The disk is in a name space of its own; this is the way to it.
    let inside = Path::new("/proc").join(gateway.pid().to_string()).join("root");
    let inside = inside.join(disk.strip_prefix("/").expect("absolute"));
    Some((Plain { directory, gateway, address }, inside))
}

pub(crate) fn fill(disk: &Path) {
    let mut file = std::fs::File::create(disk.join("hog")).expect("created");
    while file.write_all(&[1; 4096]).is_ok() {}
}

/// The disk fills up while an override is in force: nothing is written that cannot be accounted for.
pub(crate) fn disk_full(_: &Scale) -> Row {
    let mut row = Row::new(
        "a tmpfs of 24 MB filled while an override is in force; the override at the machine, rows of the audit",
    );
    let machine = Machine::start();
    let Some((held, disk)) = on_small_disk(&machine) else { return Row::skipped(row.how) };
    arm_by_socket(&disk, &held.address, &machine);
    fill(&disk);
    std::thread::sleep(Duration::from_secs(20));
    let (armed, told) =
        (is_armed(&held.address), status(&held.address).map(|status| status["history"]["error"].clone()));
    row.out_of_band = Some(machine.outside.load(Ordering::SeqCst));
    row.must(row.out_of_band == Some(0), "something else was in force");
    // Armed with a history that takes rows at the cost of the oldest samples, or not armed.
    row.note = format!("armed: {armed}; told: {}", told.as_ref().map_or("nothing".to_owned(), ToString::to_string));
    let by_socket = disarm_by_socket(&disk.join("control.sock"));
    row.must(by_socket.is_some(), "nobody answers on a full disk");
    wait_for("the dial", Duration::from_secs(5), || machine.is_at_dial());
    row.n = 1;
    row
}

pub(crate) fn arm_by_socket(disk: &Path, address: &str, machine: &Machine) {
    wait_for("a decision", Duration::from_secs(120), || {
        status(address)?["gate"]["permitted_pct"].is_number().then_some(())
    });
    order(&disk.join("control.sock"), "{\"order\":\"arm\",\"by\":\"fitter\",\"for_s\":1800}").expect("armed");
    wait_for("the override in force", Duration::from_secs(180), || (machine.in_force() <= ASKED + 10).then_some(()));
}

fn order(socket: &Path, line: &str) -> Option<String> {
    let mut stream = UnixStream::connect(socket).ok()?;
    stream.set_read_timeout(Some(Duration::from_secs(20))).ok()?;
    writeln!(stream, "{line}").ok()?;
    let mut answer = String::new();
    BufReader::new(stream).read_line(&mut answer).ok()?;
    answer.contains("\"done\":true").then_some(answer)
}

pub(crate) fn disarm_by_socket(socket: &Path) -> Option<Duration> {
    let began = Instant::now();
    order(socket, "{\"order\":\"disarm\",\"by\":\"fitter\"}").map(|_| began.elapsed())
}
