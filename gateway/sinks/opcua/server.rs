//! The server: users, values, and its task.

use super::event::AlarmEvent;
use super::space::{self, Namespaces, Numbers};
use super::values::Shown;
use super::{APPLICATION, MachineIdentity, OpcuaTarget, PRODUCT, SinkError, certificates, layout};
use adapter_core::clock::TimeNs;
use gateway_history::{Alarm, Outbox, Reading};
use opcua::crypto::{SecurityPolicy, X509Data};
use opcua::server::node_manager::memory::{SimpleNodeManager, simple_node_manager_imports};
use opcua::server::{ANONYMOUS_USER_TOKEN_ID, Server, ServerBuilder, ServerEndpoint, ServerHandle, ServerUserToken};
use opcua::types::{DataValue, MessageSecurityMode, NodeId, ObjectId};
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::net::TcpListener;
use tokio::task::JoinHandle;

/// Clients at the same time; each has subscriptions of its own.
const SESSIONS_MAX: usize = 16;
/// The certificates of strangers are counted this often.
const COUNT_EVERY: Duration = Duration::from_secs(10);
/// Name of the user whose password the address gives.
const USER: &str = "user";

/// A server that runs; it ends when this goes.
pub(super) struct Running {
    handle: ServerHandle,
    manager: Arc<SimpleNodeManager>,
    shown: Shown,
    numbers: Numbers,
    task: JoinHandle<Result<(), String>>,
    rejected: PathBuf,
    counted: Mutex<Instant>,
}

impl Drop for Running {
    fn drop(&mut self) {
        self.handle.cancel();
        self.task.abort();
    }
}

pub(super) fn server_error(what: impl Into<String>) -> SinkError {
    SinkError::failed_line(what, "look at the directory of the certificates and at the log")
}

impl Running {
    /// Makes the nodes and begins to serve.
    pub(super) async fn start(
        target: &OpcuaTarget,
        outbox: &Outbox,
        directory: PathBuf,
        listener: TcpListener,
    ) -> Result<Self, SinkError> {
        let (own, box_id) = (target.clone(), outbox.box_id());
        let rejected = certificates::rejected_directory(&directory);
        // Making the first certificate takes a moment of one core.
        let built = tokio::task::spawn_blocking(move || build_server(&own, &box_id, &directory)).await;
        let (server, handle) = built.map_err(|error| server_error(error.to_string()))??;
        let manager = handle.node_managers().get_of_type::<SimpleNodeManager>();
        let manager = manager.ok_or_else(|| server_error("the OPC UA server has no nodes"))?;
        let number = |name: &str| {
            handle.get_namespace_index(name).ok_or_else(|| server_error(format!("the namespace {name} has no number")))
        };
        let numbers = Numbers {
            own: number(layout::OWN)?,
            devices: number(layout::DEVICES)?,
            machinery: number(layout::MACHINERY)?,
            machine_tool: number(layout::MACHINE_TOOL)?,
        };
        let (latest, identity) = (outbox.latest_readings(), MachineIdentity::from_target(target, outbox));
        let shown = {
            let mut space = manager.address_space().write();
            let shown = space::build_nodes(&mut space, numbers, &identity, &latest);
            space.load_into_type_tree(&mut handle.type_tree().write());
            shown
        };
        let task = tokio::spawn(server.run_with(listener));
        let running = Self { handle, manager, shown, numbers, task, rejected, counted: Mutex::new(Instant::now()) };
        let at_ns = outbox.watch_head().borrow().newest_ns.unwrap_or(0);
        running.tell_readings(&latest, at_ns);
        Ok(running)
    }

    /// These values are in force since this moment.
    pub(super) fn tell_readings(&self, readings: &[Reading], at_ns: TimeNs) {
        self.write_values(&self.shown.build_node_values(readings, at_ns));
    }

    /// No value is known any more: what a client reads is absent instead of old.
    pub(super) fn tell_nothing(&self) {
        self.write_values(&self.shown.list_unavailable_values());
    }

    /// These alarms stand since this moment.
    pub(super) fn tell_alarms(&self, alarms: &[String], at_ns: TimeNs) {
        self.write_values(&[self.shown.build_alarms_value(alarms, at_ns)]);
    }

    /// An alarm begins: an event for whoever has subscribed to the messages, or to everything that the server sends.
    pub(super) fn raise_alarm(&self, alarm: &Alarm) {
        self.send_event(&AlarmEvent::from_raised_alarm(self.numbers, alarm));
    }

    /// An alarm has ended.
    pub(super) fn clear(&self, code: &str, source: &str, at_ns: TimeNs) {
        self.send_event(&AlarmEvent::from_cleared_alarm(self.numbers, code, source, at_ns));
    }

    fn send_event(&self, event: &AlarmEvent) {
        let from = [NodeId::new(self.numbers.own, layout::MESSAGES), ObjectId::Server.into()];
        let event: &dyn opcua::nodes::Event = event;
        self.handle.subscriptions().notify_events(from.iter().map(|node| (event, node)));
    }

    fn write_values(&self, values: &[(NodeId, DataValue)]) {
        let each = values.iter().map(|(node, value)| (node, None, value.clone()));
        // Every node of the list was made by `space::build_nodes`.
        let _known = self.manager.set_values(self.handle.subscriptions(), each);
    }

    /// What a client reads of the alarms.
    #[cfg(test)]
    pub(super) fn read_alarms(&self) -> DataValue {
        let node = self.shown.build_alarms_value(&[], 0).0;
        super::values::read(&self.manager.address_space().read(), &node).expect("made with the others")
    }

    /// An error when the server has ended; keeps the number of strangers' certificates bounded.
    pub(super) fn look_after(&self) -> Result<(), SinkError> {
        if self.task.is_finished() {
            return Err(server_error("the OPC UA server has ended"));
        }
        let mut counted = self.counted.lock().unwrap_or_else(PoisonError::into_inner);
        if counted.elapsed() >= COUNT_EVERY {
            *counted = Instant::now();
            certificates::forget_oldest(&self.rejected);
        }
        Ok(())
    }
}

/// The host that clients are told. An address that stands for all of the box is none to connect to.
fn told_host(target: &OpcuaTarget) -> String {
    let host = target.at.host.as_str();
    let all = host.parse().is_ok_and(|address: IpAddr| address.is_unspecified());
    let own = || X509Data::computer_hostnames().into_iter().next();
    Some(host.to_owned()).filter(|_| !all).or_else(own).unwrap_or_else(|| "localhost".to_owned())
}

fn build_server(target: &OpcuaTarget, box_id: &str, directory: &Path) -> Result<(Server, ServerHandle), SinkError> {
    let (uri, host) = (format!("{PRODUCT}:{box_id}"), told_host(target));
    certificates::prepare_directory(directory, &uri, &host)?;
    let login = target.login.read().map_err(|(file, error)| {
        server_error(format!("the password file {} cannot be read: {error}", file.display()))
    })?;
    let mut users = Vec::new();
    let mut builder = ServerBuilder::new()
        .application_name(APPLICATION)
        .application_uri(uri)
        .product_uri(PRODUCT)
        .create_sample_keypair(false)
        .certificate_path(certificates::OWN)
        .private_key_path(certificates::KEY)
        .pki_dir(directory)
        .trust_client_certs(false)
        .check_cert_time(true)
        .host(host)
        .port(target.at.port)
        .max_sessions(SESSIONS_MAX)
        .diagnostics_enabled(false)
        .discovery_urls(vec!["/".to_owned()])
        .with_node_manager(simple_node_manager_imports(vec![Box::new(Namespaces)], "machine"));
    if let Some((user, password)) = login {
        builder = builder.add_user_token(USER, ServerUserToken::user_pass(user, password));
        users.push(USER.to_owned());
    }
    if target.anonymous {
        users.push(ANONYMOUS_USER_TOKEN_ID.to_owned());
    }
    let endpoint =
        ServerEndpoint::new("/", SecurityPolicy::Basic256Sha256, MessageSecurityMode::SignAndEncrypt, &users);
    builder.add_endpoint("encrypted", endpoint).default_endpoint("encrypted").build().map_err(server_error)
}
