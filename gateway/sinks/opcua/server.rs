//! The server: certificates, users, and its task.

use super::OpcuaTarget;
use super::space::{self, Namespaces, Numbers, Shown};
use super::{SinkError, layout};
use crate::history::{Outbox, Reading};
use adapters::clock::TimeNs;
use opcua::crypto::SecurityPolicy;
use opcua::server::node_manager::memory::{SimpleNodeManager, simple_node_manager_imports};
use opcua::server::{
    ANONYMOUS_USER_TOKEN_ID, Server, ServerBuilder, ServerEndpoint, ServerHandle, ServerUserToken,
};
use opcua::types::{DataValue, MessageSecurityMode, NodeId};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::net::TcpListener;
use tokio::task::JoinHandle;

/// Clients at the same time; each has subscriptions of its own.
const SESSIONS_MAX: usize = 16;
/// Certificates of strangers that are kept for a person to look at: anybody may show as many as he likes.
const REJECTED_MAX: usize = 32;
/// They are counted this often.
const COUNT_EVERY: Duration = Duration::from_secs(10);
/// Name of the user whose password the address gives.
const USER: &str = "user";

/// A server that runs; it ends when this goes.
pub(super) struct Running {
    handle: ServerHandle,
    manager: Arc<SimpleNodeManager>,
    shown: Shown,
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

fn failed(what: impl Into<String>) -> SinkError {
    SinkError::line(what, "look at the directory of the certificates and at the log")
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
        let rejected = directory.join("rejected");
        // Making the first certificate takes a moment of one core.
        let built = tokio::task::spawn_blocking(move || build(&own, &box_id, &directory)).await;
        let (server, handle) = built.map_err(|error| failed(error.to_string()))??;
        let manager = handle.node_managers().get_of_type::<SimpleNodeManager>();
        let manager = manager.ok_or_else(|| failed("the OPC UA server has no nodes"))?;
        let number = |name: &str| {
            handle.get_namespace_index(name).ok_or_else(|| failed(format!("the namespace {name} has no number")))
        };
        let numbers = Numbers {
            own: number(layout::OWN)?,
            devices: number(layout::DEVICES)?,
            machinery: number(layout::MACHINERY)?,
            machine_tool: number(layout::MACHINE_TOOL)?,
        };
        let (latest, name) = (outbox.latest(), (outbox.machine(), outbox.box_id()));
        let shown = {
            let mut space = manager.address_space().write();
            let shown = space::build(&mut space, numbers, (name.0, &name.1), &latest);
            space.load_into_type_tree(&mut handle.type_tree().write());
            shown
        };
        let task = tokio::spawn(server.run_with(listener));
        let running = Self { handle, manager, shown, task, rejected, counted: Mutex::new(Instant::now()) };
        running.tell(&latest, outbox.head().borrow().newest_ns.unwrap_or(0));
        Ok(running)
    }

    /// These values are in force since this moment.
    pub(super) fn tell(&self, readings: &[Reading], at_ns: TimeNs) {
        let values: Vec<(NodeId, DataValue)> = self.shown.values(readings, at_ns);
        let each = values.iter().map(|(node, value)| (node, None, value.clone()));
        // Every node of the list was made by `space::build`.
        let _known = self.manager.set_values(self.handle.subscriptions(), each);
    }

    /// An error when the server has ended; keeps the number of strangers' certificates bounded.
    pub(super) fn look_after(&self) -> Result<(), SinkError> {
        if self.task.is_finished() {
            return Err(failed("the OPC UA server has ended"));
        }
        let mut counted = self.counted.lock().unwrap_or_else(PoisonError::into_inner);
        if counted.elapsed() >= COUNT_EVERY {
            *counted = Instant::now();
            forget_oldest(&self.rejected);
        }
        Ok(())
    }
}

/// Leaves the newest certificates of strangers.
fn forget_oldest(directory: &Path) {
    let Ok(entries) = std::fs::read_dir(directory) else { return };
    let dated = |entry: std::fs::DirEntry| Some((entry.metadata().ok()?.modified().ok()?, entry.path()));
    let mut files: Vec<_> = entries.filter_map(Result::ok).filter_map(dated).collect();
    files.sort();
    let beyond = files.len().saturating_sub(REJECTED_MAX);
    for (_, file) in &files[..beyond] {
        // What cannot be removed is tried again.
        let _gone = std::fs::remove_file(file);
    }
}

fn build(target: &OpcuaTarget, box_id: &str, directory: &Path) -> Result<(Server, ServerHandle), SinkError> {
    // The private key lies in it.
    let made = std::fs::DirBuilder::new().recursive(true).mode(0o700).create(directory);
    made.map_err(|error| failed(format!("{} cannot be made: {error}", directory.display())))?;
    let login = target.login.read().map_err(|(file, error)| {
        failed(format!("the password file {} cannot be read: {error}", file.display()))
    })?;
    let mut users: Vec<String> = Vec::new();
    let mut builder = ServerBuilder::new()
        .application_name("cnc-gateway")
        .application_uri(format!("urn:cnc-gateway:{box_id}"))
        .product_uri("urn:cnc-gateway")
        .create_sample_keypair(true)
        .certificate_path("own/cert.der")
        .private_key_path("own/private.pem")
        .pki_dir(directory)
        .trust_client_certs(false)
        .check_cert_time(true)
        .host(target.at.host.clone())
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
    let endpoint = ServerEndpoint::new(
        "/",
        SecurityPolicy::Basic256Sha256,
        MessageSecurityMode::SignAndEncrypt,
        &users,
    );
    builder.add_endpoint("encrypted", endpoint).default_endpoint("encrypted").build().map_err(failed)
}
