//! One machine behind three partners with their own lines and clocks: an NC-Link controller at a real broker, two Modbus
//! meters, and three phases of current at 1 kHz. The box's own assembly reads them all, and what it merged is compared with
//! what was true, channel by channel.

use adapters::address::{Address, Target};
use adapters::clock::{Clock, SECOND_NS, ScaledClock};
use adapters::modbus::profile;
use adapters::modbus_server::ModbusServer;
use adapters::mqtt::Options;
use adapters::nclink_device::NcLinkDevice;
use adapters::simulated::{Moment, Simulated, SimulatedSettings};
use adapters::waveform::{Producer, SimulatedCurrent};
use adapters::{ChannelId, Sample};
use gateway::sources::open::{MachineSpeed, open_sources};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use testkit::port::free_port;

/// mosquitto, killed when dropped.
struct Broker(Child, u16);

impl Drop for Broker {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn mosquitto() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let places = std::env::split_paths(&path).chain([PathBuf::from("/usr/sbin")]);
    let found = places.map(|place| place.join("mosquitto")).find(|file| file.is_file());
    assert!(found.is_some() || std::env::var_os("CNC_GATEWAY_CI").is_none(), "no mosquitto; see .ci/run");
    if found.is_none() {
        eprintln!("SKIPPED: mosquitto is not installed; .ci/run installs it");
    }
    found
}

fn broker(directory: &Path) -> Option<Broker> {
    let (program, port) = (mosquitto()?, free_port());
    let text = format!(
        "listener {port} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\npersistence false\nlog_type none\n"
    );
    std::fs::write(directory.join("conf"), text).expect("written");
    let mut command = Command::new(program);
    command.arg("-c").arg(directory.join("conf")).stdout(Stdio::null()).stderr(Stdio::null());
    let broker = Broker(command.spawn().expect("mosquitto starts"), port);
    let until = Instant::now() + Duration::from_secs(10);
    while TcpStream::connect(("127.0.0.1", port)).is_err() {
        assert!(Instant::now() < until, "mosquitto does not listen");
        thread::sleep(Duration::from_millis(10));
    }
    Some(broker)
}

/// What is true of a channel at one moment.
type Truth = fn(&Moment) -> f64;

/// What is compared, and what is true.
const COMPARED: [(&str, Truth); 8] = [
    ("spindle_speed_rpm", |moment| moment.truth.spindle_speed_rpm),
    ("feed_mm_min", |moment| moment.panel.feed_mm_min),
    ("feed_override_pct", |moment| f64::from(moment.panel.feed_override_pct)),
    ("z_axis_position_mm", |moment| moment.panel.position_mm[2]),
    ("spindle_power_w", |moment| moment.truth.spindle_power_w),
    ("total_power_w", |moment| moment.truth.total_power_w),
    ("spindle_current_a", |moment| moment.electric.spindle_current_a),
    ("supply_voltage_v", |moment| moment.electric.supply_voltage_v),
];

#[derive(Default)]
struct Errors {
    sizes: Vec<f64>,
    absent: u32,
    greatest_truth: f64,
}

impl Errors {
    fn at(&self, share: f64) -> f64 {
        let mut sorted = self.sizes.clone();
        sorted.sort_by(f64::total_cmp);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "a rank"
        )]
        let rank = (share * (sorted.len().saturating_sub(1)) as f64) as usize;
        sorted.get(rank).copied().unwrap_or(f64::INFINITY)
    }
}

/// Runs so many seconds of machine time; errors in the order of [`COMPARED`].
fn compared(speed: f64, machine_s: i64) -> Option<Vec<Errors>> {
    let directory = tempfile::tempdir().expect("a directory");
    let broker = broker(directory.path())?;
    let clock: Arc<dyn Clock> = Arc::new(ScaledClock::new(speed));
    let address: Address = "simulated://lathe?dropouts_per_h=0&begun_s=1500".parse().expect("an address");
    let Target::Simulated(target) = address.target() else { panic!("simulated") };
    let machine = Simulated::new(address.text(), SimulatedSettings::from_target(target), clock.now_ns());
    let stop = Arc::new(AtomicBool::new(false));
    let (mut device, stopping) = (NcLinkDevice::new("SIM1", &machine, clock.clone()), stop.clone());
    let options = Options::new("127.0.0.1", broker.1, "joint-device");
    let device = thread::spawn(move || device.run(&options, &stopping, |_| {}));
    let anywhere = SocketAddr::from(([127, 0, 0, 1], 0));
    let map = profile::find_profile("sdm630", None).expect("shipped");
    let meter = ModbusServer::start(anywhere, &machine, clock.clone(), map).expect("serves");
    let current = SimulatedCurrent::new(&machine, clock.clone(), 1000.0, 20);
    let current = Producer::start(anywhere, Box::new(current)).expect("serves");
    thread::sleep(Duration::from_millis(300));
    let text = format!(
        "[http]\nenabled = false\n\
         [[source]]\naddress = \"nclink://127.0.0.1:{}/SIM1\"\n\
         [[source]]\naddress = \"waveform://{}\"\n\
         [[source]]\naddress = \"modbus-tcp://{meter}?unit=2&profile=sdm630&circuit=spindle\"\n\
         [[source]]\naddress = \"modbus-tcp://{meter}?unit=1&profile=sdm630\"\n",
        broker.1,
        current.listen_address(),
        meter = meter.listen_address(),
    );
    let config = gateway::config::parse("joint.toml", &text, directory.path(), []).expect("a configuration");
    let mut opened = open_sources(&config, MachineSpeed::Real, &clock, 0).expect("opens");
    let (mut sample, began_ns) = (Sample::new_empty(0), clock.now_ns());
    let mut errors: Vec<Errors> = COMPARED.iter().map(|_| Errors::default()).collect();
    while let Some(now_ns) = opened.schedule.next_tick(&stop) {
        opened.feed.sample_into(&mut sample, now_ns);
        if now_ns - began_ns > machine_s * SECOND_NS {
            stop.store(true, Ordering::SeqCst);
        }
        // Sources need their first seconds.
        if now_ns - began_ns > 15 * SECOND_NS {
            compare(&machine, &sample, &mut errors);
        }
    }
    for status in opened.feed.list_sources(clock.now_ns()) {
        println!(
            "{}: {} readings, {} failures, error {:?}",
            status.name, status.readings, status.failures, status.error
        );
    }
    opened.feed.stop();
    device.join().expect("no panic");
    Some(errors)
}

fn compare(machine: &Simulated, sample: &Sample, errors: &mut [Errors]) {
    let moment = machine.moment(sample.at_ns);
    for ((name, truth), errors) in COMPARED.iter().zip(errors) {
        let (id, truth) = (ChannelId::from_name(name).expect("a channel"), truth(&moment));
        errors.greatest_truth = errors.greatest_truth.max(truth.abs());
        match sample.number(id) {
            Ok(number) => errors.sizes.push((number - truth).abs()),
            Err(_) => errors.absent += 1,
        }
    }
}

fn told(errors: &[Errors]) {
    println!("channel: samples, absent, error in the middle, at 95 %, greatest truth");
    for ((name, _), errors) in COMPARED.iter().zip(errors) {
        let (count, absent) = (errors.sizes.len(), errors.absent);
        println!(
            "{name}: {count}, {absent}, {:.3}, {:.3}, {:.1}",
            errors.at(0.5),
            errors.at(0.95),
            errors.greatest_truth
        );
    }
}

fn good(errors: &[Errors]) {
    for ((name, _), errors) in COMPARED.iter().zip(errors) {
        let all = errors.sizes.len() + usize::try_from(errors.absent).expect("small");
        assert!(errors.sizes.len() * 10 > all * 8, "{name}: {} of {all} samples", errors.sizes.len());
        let limit = 0.02 * errors.greatest_truth.max(1.0);
        assert!(errors.at(0.5) <= limit, "{name}: {} in the middle, limit {limit}", errors.at(0.5));
    }
}

#[test]
fn merged_samples_are_near_the_truth() {
    if let Some(errors) = compared(8.0, 100) {
        told(&errors);
        good(&errors);
    }
}

/// An hour of machine time in four minutes: `cargo test --release --test controllers an_hour -- --ignored --nocapture`.
#[test]
#[ignore = "4 minutes: an hour of merged samples against the truth of the machine"]
fn an_hour_of_merged_samples_is_near_the_truth() {
    if let Some(errors) = compared(15.0, 3600) {
        told(&errors);
        good(&errors);
    }
}
