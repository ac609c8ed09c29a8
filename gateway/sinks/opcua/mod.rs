//! `opcua://HOST:4840`: a server of OPC UA that can only be read, with the machine laid out after OPC 40501-1 (machine tools).
//!
//! Built in with the cargo feature `opcua` only: its library is large and has a licence of its own (MPL-2.0).
//!
//! - `Objects/Machines/MACHINE` has `Identification`, `Monitoring`, `Production` and `Notification` with what this box knows;
//!   `Values` beside them has every series under its own name, with unit and range. Table: `layout`.
//! - A missing value has no value and a bad status that says why. Times are those of the tick. When no sample has come for longer
//!   than the outbox may be silent, every value becomes missing: what is read is never old.
//! - Security: `Basic256Sha256`, signed and encrypted, nothing else. The box makes a certificate of its own at the first start. A
//!   client is known by its certificate: one that is not in `trusted` is refused, and lies in `rejected` for a person to look at.
//! - Nobody is let in without a password, unless the address says `anonymous=yes`.
//! - No node can be written and there are no methods: nothing of it reaches the gate.
//!
//! OPC UA has a way to tell of old values which this server does not offer: what an outage leaves behind is in the history.

mod certificates;
mod event;
mod layout;
mod server;
mod space;
mod units;
mod values;

use super::listen::listen_on;
use super::{Batch, Pending, Sink, SinkError};
use crate::target_error::TargetError;
use adapter_core::address::{Endpoint, Keys, Login, parse_endpoint};
use gateway_history::{Content, Item, Outbox, Record};
use server::Running;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The port of OPC UA (IANA).
const PORT: u16 = 4840;

/// What the box calls itself; the URI of the application is made of the second and the name of the box.
const APPLICATION: &str = "cnc-gateway";
const PRODUCT: &str = "urn:cnc-gateway";
/// The server is looked at this often while nothing is sent.
const LOOK_EVERY: Duration = Duration::from_secs(1);
/// The outbox repeats every value within `refresh_s`. A commit may be this much later before values count as lost: commits come twice a
/// second, and a disk that is busy takes seconds. Too long shows an old value, too short hides one that is right.
const LATE: Duration = Duration::from_secs(10);

/// Where the box listens, and whom it lets in.
#[derive(Debug, Clone, PartialEq)]
pub struct OpcuaTarget {
    /// The address of the box on the clients' network, and the port.
    pub at: Endpoint,
    /// User and password that clients give.
    pub login: Login,
    /// May clients come without them? Their certificate is checked all the same.
    pub anonymous: bool,
    /// Directory of the certificates; `None`: `opcua` beside the history.
    pub certificates: Option<PathBuf>,
    /// What stands on the plate of the machine: maker, model and serial number.
    pub plate: [Option<String>; 3],
}

/// Who the machine is.
#[derive(Debug, Clone, PartialEq, Eq)]
struct MachineIdentity {
    machine: String,
    device: String,
    manufacturer: Option<String>,
    model: Option<String>,
    serial_number: Option<String>,
}

impl MachineIdentity {
    fn from_target(target: &OpcuaTarget, outbox: &Outbox) -> Self {
        let [manufacturer, model, serial_number] = target.plate.clone();
        Self { machine: outbox.machine().to_owned(), device: outbox.device_name(), manufacturer, model, serial_number }
    }

    /// Names the machine over all plants.
    fn uri(&self) -> String {
        format!("{PRODUCT}:{}", self.device)
    }
}

impl OpcuaTarget {
    pub(super) fn parse(body: &str, keys: &mut Keys) -> Result<Self, TargetError> {
        let login = Login::from_keys(keys);
        let anonymous = keys.take_choice("anonymous", &[("no", false), ("yes", true)]);
        let certificates = keys.take_text("certificates").map(PathBuf::from);
        let plate = ["manufacturer", "model", "serial_number"].map(|key| keys.take_text(key));
        if !anonymous && login.user.is_none() {
            return Err(TargetError::NoSignIn);
        }
        let at = parse_endpoint(body, Some(PORT)).map_err(TargetError::Host)?;
        Ok(Self { at, login, anonymous, certificates, plate })
    }

    /// What is wrong with the files that the address names, each with what to do.
    #[must_use]
    pub fn find_file_problems(&self) -> Vec<(String, String)> {
        super::broker::broker_files(None, &self.login)
    }
}

pub(super) struct OpcuaSink {
    target: OpcuaTarget,
    outbox: Outbox,
    directory: PathBuf,
    running: Option<Running>,
    /// Alarms of the gateway that stand, by code.
    alarms: BTreeMap<String, String>,
    /// When the last sample came.
    heard: Instant,
    /// Have the values been taken away since?
    silent: bool,
}

impl OpcuaSink {
    pub(super) fn new(target: OpcuaTarget, outbox: &Outbox, history: &Path) -> Self {
        let beside = history.parent().unwrap_or(Path::new(".")).join("opcua");
        let directory = target.certificates.clone().unwrap_or(beside);
        Self {
            target,
            outbox: outbox.clone(),
            directory,
            running: None,
            alarms: BTreeMap::new(),
            heard: Instant::now(),
            silent: false,
        }
    }

    async fn start_server(&mut self) -> Result<(), SinkError> {
        self.stop();
        let listener = listen_on(&self.target.at).await?;
        let running = Running::start(&self.target, &self.outbox, self.directory.clone(), listener).await?;
        // A server that begins again has forgotten which alarms stand.
        running.tell_alarms(&self.standing_alarms(), self.outbox.watch_head().borrow().newest_ns.unwrap_or(0));
        self.running = Some(running);
        (self.heard, self.silent) = (Instant::now(), false);
        Ok(())
    }

    fn accept_item(&mut self, item: &Item) {
        let Some(running) = &self.running else { return };
        match &item.content {
            Content::Sample(readings) => {
                if std::mem::replace(&mut self.silent, false) {
                    // The item holds only what has changed.
                    running.tell_readings(&self.outbox.latest_readings(), item.at_ns);
                    running.tell_alarms(&self.standing_alarms(), item.at_ns);
                }
                self.heard = Instant::now();
                running.tell_readings(readings, item.at_ns);
            }
            Content::Record(record) => {
                match &**record {
                    Record::Alarm(alarm) => {
                        running.raise_alarm(alarm);
                        self.alarms.insert(alarm.code.clone(), format!("{}: {}", alarm.code, alarm.en));
                    }
                    Record::AlarmClear(clear) => {
                        running.clear(&clear.code, &clear.source, clear.at_ns);
                        self.alarms.remove(&clear.code);
                    }
                    _ => return,
                }
                running.tell_alarms(&self.standing_alarms(), item.at_ns);
            }
            Content::Gap(_) | Content::Means { .. } => {}
        }
    }

    fn standing_alarms(&self) -> Vec<String> {
        self.alarms.values().cloned().collect()
    }

    /// Takes the values away when nothing has come for too long; an error when the server has ended.
    fn check_server(&mut self) -> Result<(), SinkError> {
        let Some(running) = &self.running else { return Err(SinkError::failed_line("the box does not listen", "")) };
        running.look_after()?;
        if !self.silent && self.heard.elapsed() > self.outbox.settings().refresh + LATE {
            running.tell_nothing();
            self.silent = true;
        }
        Ok(())
    }

    fn stop(&mut self) {
        self.running = None;
    }
}

impl Sink for OpcuaSink {
    fn connect(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(self.start_server())
    }

    fn send_batch<'a>(&'a mut self, batch: Batch<'a>) -> Pending<'a, Result<(), SinkError>> {
        for item in batch.items {
            self.accept_item(item);
        }
        Box::pin(std::future::ready(self.check_server()))
    }

    fn wait_for_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(async {
            tokio::time::sleep(LOOK_EVERY).await;
            Ok(())
        })
    }

    fn serve_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(std::future::ready(self.check_server()))
    }

    fn probe_receiver(&mut self) -> Pending<'_, Result<(), SinkError>> {
        Box::pin(async move { listen_on(&self.target.at).await.map(drop) })
    }

    fn close(&mut self) -> Pending<'_, ()> {
        self.stop();
        Box::pin(std::future::ready(()))
    }

    fn takes_history(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gateway_history::OutboxSettings;

    /// A server on a free port, for everybody.
    fn anonymous(directory: &Path) -> OpcuaSink {
        let outbox = Outbox::new("Lathe 7", OutboxSettings::default(), []);
        let mut keys = Keys::from_query("anonymous=yes");
        let mut target = OpcuaTarget::parse("//127.0.0.1", &mut keys).expect("an address");
        target.at.port = 0;
        OpcuaSink::new(target, &outbox, &directory.join("history.db"))
    }

    #[tokio::test]
    async fn a_server_that_begins_again_tells_the_alarms_that_stand() {
        let directory = tempfile::tempdir().expect("a directory");
        let mut sink = anonymous(directory.path());
        sink.alarms.insert("coolant".to_owned(), "coolant: the level is low".to_owned());
        for _ in 0..2 {
            sink.start_server().await.expect("it listens");
            let told = sink.running.as_ref().expect("it runs").read_alarms().value;
            assert_eq!(told, Some(opcua::types::Variant::from(sink.standing_alarms())));
        }
    }

    #[tokio::test]
    async fn values_that_are_not_renewed_are_taken_away() {
        let directory = tempfile::tempdir().expect("a directory");
        let mut sink = anonymous(directory.path());
        sink.start_server().await.expect("it listens");
        sink.check_server().expect("it runs");
        assert!(!sink.silent);
        let running = sink.running.as_ref().expect("it runs");
        assert!(running.read_alarms().status.is_some_and(|status| status.is_good()));
        let limit = sink.outbox.settings().refresh + LATE;
        sink.heard = Instant::now().checked_sub(limit + LATE).expect("the computer has run for longer");
        sink.check_server().expect("it runs");
        assert!(sink.silent);
        let alarms = sink.running.as_ref().expect("it runs").read_alarms();
        assert!(alarms.status.is_some_and(|status| status.is_bad()));
    }
}
