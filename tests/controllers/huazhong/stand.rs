//! A test stand: broker, simulated device on its thread, and clients.

use adapters::address::Address;
use adapters::clock::{Clock, SystemClock};
use adapters::mqtt::Options;
use adapters::nclink::connection::{Connection, Link};
use adapters::nclink::{NcLinkSource, open_address};
use adapters::nclink_device::{DeviceEvent, NcLinkDevice};
use adapters::simulated::{Simulated, SimulatedSettings};
use adapters::{Reading, Source};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use testkit::broker::Broker;

pub(crate) const SERIAL: &str = "SIM7";

/// The machine has been on for so long: it is warm and at work.
const ON_FOR_S: i64 = 1500;

/// A device that serves until it is dropped.
pub(crate) struct Served {
    stop: Arc<AtomicBool>,
    /// How often it has come to the broker.
    pub(crate) connected: Arc<AtomicU32>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    pub(crate) fn start(port: u16, machine: &Simulated, clock: &Arc<dyn Clock>) -> Self {
        let (stop, connected) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU32::new(0)));
        let (stopping, up) = (stop.clone(), connected.clone());
        let mut device = NcLinkDevice::new(SERIAL, machine, clock.clone());
        let thread = std::thread::spawn(move || {
            device.run(&Options::new("127.0.0.1", port, "device"), &stopping, |said| {
                if said == DeviceEvent::Connected {
                    up.fetch_add(1, Ordering::SeqCst);
                }
            });
        });
        let served = Self { stop, connected, thread: Some(thread) };
        served.wait(1);
        served
    }

    /// Waits until it has come to the broker so often.
    pub(crate) fn wait(&self, times: u32) {
        until("the device comes to the broker", || (self.connected.load(Ordering::SeqCst) >= times).then_some(()));
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("the device does not panic");
        }
    }
}

/// Asks until there is something; fails after 20 s.
pub(crate) fn until<T>(what: &str, mut ready: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + Duration::from_secs(20);
    loop {
        if let Some(found) = ready() {
            return found;
        }
        assert!(Instant::now() < end, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Broker, machine and device.
pub(crate) struct Stand {
    pub(crate) device: Served,
    pub(crate) machine: Simulated,
    pub(crate) clock: Arc<dyn Clock>,
    pub(crate) broker: Broker,
}

impl Stand {
    /// `None` without mosquitto.
    pub(crate) fn start() -> Option<Self> {
        Self::on_for(ON_FOR_S)
    }

    /// A machine that has been on for so long, s.
    pub(crate) fn on_for(on_for_s: i64) -> Option<Self> {
        let broker = Broker::start()?;
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        let origin_ns = clock.now_ns() - on_for_s * 1_000_000_000;
        let machine = Simulated::new("simulated://lathe", SimulatedSettings::default(), origin_ns);
        let _at_work = machine.moment(clock.now_ns());
        let device = Served::start(broker.port, &machine, &clock);
        Some(Self { device, machine, clock, broker })
    }

    pub(crate) fn link(&self) -> Link {
        link(self.broker.port)
    }

    pub(crate) fn connect(&self) -> Connection {
        Connection::open(&self.link(), false).expect("the broker is there")
    }

    pub(crate) fn source(&self) -> NcLinkSource {
        source(self.broker.port, "")
    }

    /// Reads once.
    pub(crate) fn read(&self, source: &mut dyn Source) -> Result<Vec<Reading>, adapters::SourceError> {
        let mut out = Vec::new();
        source.read(self.clock.as_ref(), &mut out).map(|()| out)
    }
}

pub(crate) fn link(port: u16) -> Link {
    Link {
        name: format!("nclink://127.0.0.1:{port}/{SERIAL}"),
        host: "127.0.0.1".to_owned(),
        port,
        serial: SERIAL.to_owned(),
        login: None,
        tls: None,
        encoding: adapters::text::TextEncoding::default(),
        deadline: Duration::from_secs(2),
    }
}

pub(crate) fn address(port: u16, keys: &str) -> Address {
    format!("nclink://127.0.0.1:{port}/{SERIAL}{keys}").parse().expect("usable")
}

/// A source as the address opens it, but with its own type.
pub(crate) fn source(port: u16, keys: &str) -> NcLinkSource {
    let address = address(port, keys);
    let adapters::address::Target::NcLink(target) = address.target() else { panic!("nclink") };
    open_address(address.text(), target).expect("opens");
    NcLinkSource::new(address.text(), target, None)
}
